"""Packages whose names are imported when asked for: all names are there, and none hides a module."""

from __future__ import annotations

import importlib
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LAZY = sorted(
    ".".join(path.parent.relative_to(ROOT).parts)
    for path in ROOT.glob("[a-z]*/**/__init__.py")
    if "lazily(__name__)" in path.read_text(encoding="utf-8") and "tests" not in path.parts
)


@pytest.mark.parametrize("package", LAZY)
def test_every_public_name_is_there(package: str) -> None:
    module = importlib.import_module(package)
    assert module.__all__
    for name in module.__all__:
        assert getattr(module, name) is getattr(module, name)


@pytest.mark.parametrize("package", LAZY)
def test_no_public_name_is_also_a_module(package: str) -> None:
    """Importing that module would put it in the name's place."""
    module = importlib.import_module(package)
    folder = ROOT / package.replace(".", "/")
    modules = {p.stem for p in folder.glob("*.py")} | {p.name for p in folder.iterdir() if p.is_dir()}
    assert not modules & set(module.__all__)


def test_an_unknown_name_is_refused_as_by_any_module() -> None:
    with pytest.raises(AttributeError, match="module 'robots' has no attribute 'no_such_name'"):
        importlib.import_module("robots").no_such_name  # noqa: B018


def test_a_package_loads_only_what_is_asked_for() -> None:
    code = "import sys; from robots import InputError; print('numpy' in sys.modules, 'robots.robot' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)  # noqa: S603
    assert run.stdout.split() == ["False", "False"]
