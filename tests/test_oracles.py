"""Only what cannot be loaded skips, with its reason."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import oracles
import pytest

WAYS = {
    "gives_up": "import sys\nsys.exit('no display')",
    "lacks_a_library": "raise OSError('libgomp.so.1: cannot open shared object file')",
    # As openseespy does; the reason is what came first.
    "hides_it": "try:\n    raise ImportError('libquadmath')\nexcept ImportError:\n    raise RuntimeError('Failed')",
}
REASONS = {
    "gives_up": "no display",
    "lacks_a_library": "libgomp",
    "hides_it": "libquadmath",
    "is_not_there": "No module",
}


@pytest.fixture(autouse=True)
def broken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    for name, code in (WAYS | {"is_wrong": "raise ValueError('a bug')", "is_right": ""}).items():
        (tmp_path / f"{name}.py").write_text(code, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    yield
    sys.modules.pop("is_right", None)


@pytest.mark.parametrize(("name", "reason"), REASONS.items())
def test_what_cannot_be_loaded_skips_with_its_reason(name: str, reason: str) -> None:
    for load in (oracles.load, oracles.load_apart):
        with pytest.raises(pytest.skip.Exception, match=f"{name} cannot be loaded: .*{reason}"):
            load(name)


def test_what_is_there_is_loaded() -> None:
    assert oracles.load("is_right").__name__ == "is_right"
    oracles.load_apart("is_right")


def test_any_other_error_is_one() -> None:
    with pytest.raises(ValueError, match="a bug"):
        oracles.load("is_wrong")


def test_programs() -> None:
    assert oracles.program("no-such-program", "sh", "neither") is not None
    assert oracles.needs("no-such-program", "nor-this").args == (True,)
    assert oracles.needs("no-such-program", "sh").args == (False,)
