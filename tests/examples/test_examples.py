"""The examples run as they are written: each asks one question, draws one picture, asserts one number."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "examples"
EXAMPLES = sorted(FOLDER.glob("*.py"))
LONGEST = 40

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs_as_it_is_written(example: Path, tmp_path: Path) -> None:
    text = example.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= LONGEST
    assert "\nassert " in text
    done = subprocess.run(  # noqa: S603 - our own interpreter and our own file
        [sys.executable, "-c", "import sys, runpy; sys.path.insert(0, sys.argv[1]); runpy.run_path(sys.argv[2])",
         str(FOLDER.parent), str(example)],
        cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False, env={**os.environ, "MPLBACKEND": "agg"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert len(list(tmp_path.glob("*.png"))) == 1
    assert done.stdout.strip()
    assert len(done.stdout.splitlines()) <= LONGEST
