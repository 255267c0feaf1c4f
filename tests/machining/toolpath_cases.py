"""Small helpers of the tool path tests."""

from __future__ import annotations

from pathlib import Path

from machining.toolpaths import Motions, ReadOptions, read_apt, read_gcode

SAMPLES = Path(__file__).parent / "toolpath_samples"


def apt(tmp_path: Path, text: str, head: str = "UNITS/MM\n", **options: object) -> Motions:
    path = tmp_path / "program.apt"
    path.write_bytes((head + text).encode("latin-1"))
    return read_apt(path, ReadOptions(**options))  # type: ignore[arg-type]


def gcode(tmp_path: Path, text: str, head: str = "G21\n", **options: object) -> Motions:
    path = tmp_path / "program.nc"
    path.write_bytes((head + text).encode("latin-1"))
    return read_gcode(path, ReadOptions(**options))  # type: ignore[arg-type]
