"""Inputs that once failed, small ones: each is answered rightly or refused cleanly now, and stays so."""

from __future__ import annotations

from pathlib import Path

import pytest

from .__main__ import folder_of
from .registry import readers
from .samples import Sample
from .shrink import shrunk
from .trial import attempt

CASES = Path(__file__).parent / "cases"
READERS = {folder_of(name): name for name in readers()}
FILES = sorted(path for path in CASES.glob("*/*") if path.is_file())


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_a_finding_stays_mended(path: Path, tmp_path: Path) -> None:
    name = READERS[path.parent.name]
    suffix = path.name[path.name.index(".") :]
    fault = attempt(name, readers()[name].run, Sample(suffix, path.read_bytes()), tmp_path)
    assert fault is None, str(fault)


def test_there_are_cases_and_they_are_small() -> None:
    assert len(FILES) > 30
    assert max(path.stat().st_size for path in FILES) < 20_000


def test_an_input_is_made_small() -> None:
    data = b"".join(b"line %d\n" % k for k in range(200))
    assert shrunk(data, lambda d: b"73" in d and b"e 9" in d) in (b"73e 9", b"e 973", b"e 97373", b"e 973\n")
    assert shrunk(b"abc", lambda _: False) == b"abc"
