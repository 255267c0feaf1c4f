"""Options of the readers on the command line: every remedy of a reader can be typed, and then the file is read."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from machining.toolpaths import ReadOptions, read_toolpath
from robots import InputError
from stiffarm.path_request import read_options


def asked(*read: str, units: str | None = None, tcp: bool = False) -> ReadOptions:
    return read_options(read, units, "table-AC", tcp=tcp)


@pytest.mark.parametrize(
    ("name", "text", "remedy", "options"),
    [
        (
            "a.apt",
            "UNITS/MM\nGOTO/0,0,0\nMSYS/1,0,0,1,0,0,0,1,0\nGOTO/1,0,0\nFINI\n",
            "frames=written",
            ["frames=written"],
        ),
        ("b.nc", "G21\nG1 X5 F100\nM30\n", "start=X,Y,Z", ["start=0,0,5"]),
        ("c.nc", "G21\nG0 X10 Y0 Z0\nG3 X0 Y10 I0 J0 F100\nM30\n", "arc_absolute=yes", ["arc_absolute=yes"]),
        ("d.apt", "UNITS/MM\nGOTO/0,0,0\nSMIL/3\nFINI\n", "unknown_motion=report", ["unknown_motion=report"]),
        ("e.nc", "G21\nG0 X0 Y0 Z0\nG51 X2\nM30\n", "unknown_motion=report", ["unknown_motion=report"]),
        (
            "f.nc",
            "G21\nG54 G0 X0 Y0 Z0\nG55 G0 X1 Y0 Z0\nM30\n",
            "G54=X,Y,Z --read G55=X,Y,Z",
            ["G54=0,0,0", "g55=100,0,0"],
        ),
        ("h.nc", "G21\nG0 X0 Y0 Z0\nG41 D1 X5\nM30\n", "compensation=centre", ["compensation=centre"]),
        ("i.h", "BEGIN PGM I MM\nL Z+5 F100\nEND PGM I MM\n", "start=X,Y,Z", ["start=0,0,9"]),
        ("j.nc", "G21\nG0 X0 Y0 Z0 A10\nM30\n", "pivot=X,Y,Z", ["pivot=0,0,-50", "rotary_reversed=A"]),
        ("g.nc", "G21\nG0 X0 Y0 Z0\nG1 X1 F60\nG1 X2\nG1 X3\nM30\n", "max_moves=N", ["max_moves=100"]),
    ],
)
def test_a_remedy_can_be_typed_and_helps(tmp_path: Path, name: str, text: str, remedy: str, options: list[str]) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    before = asked(*(["max_moves=2"] if "max_moves" in remedy else []))
    with pytest.raises(InputError) as caught:
        read_toolpath(tmp_path / name, options=before)
    assert f"--read {remedy}" in str(caught.value)
    assert read_toolpath(tmp_path / name, options=asked(*options)).n >= 1


@pytest.mark.parametrize(
    ("name", "text", "remedy", "after"),
    [
        ("a.apt", "GOTO/0,0,0\nFINI\n", "--units mm or inch", {"units": "mm"}),
        ("b.nc", "G0 X0 Y0 Z0\nM30\n", "--units mm or inch", {"units": "inch"}),
        ("c.txt", "hello\n", "--kind apt, gcode, heidenhain or csv", None),
        ("d.nc", "G21\nG0 X0 Y0 Z0 A10\nM30\n", "--tcp", {"tcp": True}),
    ],
)
def test_flags_too(tmp_path: Path, name: str, text: str, remedy: str, after: dict | None) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_toolpath(tmp_path / name, options=asked())
    assert remedy in str(caught.value)
    if after is not None:
        assert read_toolpath(tmp_path / name, options=asked(**after)).n == 1


def test_no_remedy_of_a_reader_names_an_argument_alone() -> None:
    """Where a text says what to pass in Python, it says the option too."""
    folder = Path(__file__).parents[3] / "machining" / "toolpaths"
    names = "frames|start|arc_absolute|unknown_motion|units|kind|offsets|tcp|rotary|skip_deleted|dwell_unit|retract"
    for file in folder.rglob("*.py"):
        for text in re.findall(r'"[^"\n]*"', file.read_text(encoding="utf-8")):
            assert not re.search(rf"\bpass (?:{names})\b", text), (file.name, text)
            assert not re.search(rf"\b(?:{names})='", text), (file.name, text)


def test_all_keys_together() -> None:
    found = asked(
        "frames=absolute",
        "unknown_motion=report",
        "start=1,2,3",
        "G59.1=0,0,10",
        "arc_absolute=yes",
        "circle_axis=left",
        "dwell_unit=ms",
        "skip_deleted=no",
        "chord_tolerance_um=5",
        "arc_tolerance_um=20",
        "max_moves=10",
        "max_bytes=1000",
        "retract=42.5",
    )
    assert (found.frames, found.unknown_motion, found.circle_axis, found.dwell_unit) == (
        "absolute",
        "report",
        "left",
        "ms",
    )
    assert found.start == pytest.approx((0.001, 0.002, 0.003))
    assert found.offsets["G59.1"] == pytest.approx((0.0, 0.0, 0.01))
    assert (found.arc_absolute, found.skip_deleted) == (True, False)
    assert (found.chord_tolerance, found.arc_tolerance) == pytest.approx((5e-6, 20e-6))
    assert found.retract == pytest.approx(0.0425)
    assert (found.max_moves, found.max_bytes) == (10, 1000)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("frames", "KEY=VALUE"),
        ("frames=", "KEY=VALUE"),
        ("frames=mine", "one, written"),
        ("colour=red", "frames, unknown_motion"),
        ("start=1,2", "X,Y,Z in mm"),
        ("start=1,2,nan", "X,Y,Z in mm"),
        ("G60=1,2,3", "frames, unknown_motion"),
        ("arc_absolute=true", "yes or no"),
        ("chord_tolerance_um=0", "1e-9"),
        ("chord_tolerance_um=x", "a number"),
        ("chord_tolerance=1", "frames, unknown_motion"),
        ("max_moves=-1", "a whole number"),
        ("max_moves=0", "1"),
        ("units=mm", "frames, unknown_motion"),
    ],
)
def test_values_that_do_not_fit(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        asked(text)
    with pytest.raises(InputError, match="once"):
        asked("frames=one", "frames=written")


@pytest.mark.parametrize("value", ["high", "1,2", "nan", "1e9"])
def test_a_height_of_retracts_that_is_none(value: str) -> None:
    with pytest.raises(InputError, match="retract"):
        asked(f"retract={value}")
