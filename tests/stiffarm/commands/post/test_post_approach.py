"""`post --approach`: positioning moves come from one side in every program, verified, counted; and bad input."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cli_runs import Command

from machining.cell import read_cell
from machining.programs.formats import read_program
from robots import InputError, load_robot
from stiffarm.commands.post.command import approach_of

CELL = """schema = "stiffarm-cell/1"
[tool]
position_mm = [200, 0, 80]
rpy_deg = [0, 90, 0]
[robot]
joint_speed_deg_s = [128, 102, 128, 260, 245, 322]
[part]
position_mm = [1200, 200, 600]
"""
DRILL = """[[tool.body]]
name = "drill"
shape = { kind = "cylinder", diameter_mm = 6, length_mm = 40 }
position_mm = [200, 0, 80]
rpy_deg = [0, -90, 0]
"""
FIXTURE = """[[fixture]]
name = "clamp"
shape = {{ kind = "box", size_mm = [5, 5, 5] }}
position_mm = [{:.3f}, {:.3f}, {:.3f}]
"""
CLS = """TOOL PATH/HOLES,TOOL,DRILL
UNITS/MM
TLDATA/DRILL,6,0,50
LOAD/TOOL,2
RAPID
GOTO/5,5,40,0,0,1
CYCLE/DRILL,RAPTO,30,FEDTO,-10,MMPM,100,DWELL,0.5
GOTO/5,5,0
GOTO/25,5,0
CYCLE/OFF
END-OF-PATH
"""
SIGNS = "+-+00\N{MINUS SIGN}"
WAYS = [1.0, -1.0, 1.0, 0.0, 0.0, -1.0]


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    cell, cls = tmp_path / "cell.toml", tmp_path / "holes.cls"
    cell.write_text(CELL)
    cls.write_text(CLS)
    return cell, cls


@pytest.mark.slow
@pytest.mark.parametrize("rapid", ["linear", "joint"])
def test_holes_are_come_to_from_one_side(cli: Command, files: tuple[Path, Path], tmp_path: Path, rapid: str) -> None:
    cell, cls = files
    out = tmp_path / "out"
    outcome = cli(
        "post",
        "kr60-3",
        cls,
        "--cell",
        cell,
        "--links",
        "rigid",
        "--gamma",
        "65",
        "--format",
        "krl,json",
        "--rapid",
        rapid,
        "--approach",
        SIGNS,
        "--approach-deg",
        "0.25",
        "--out",
        out,
        "--json",
    )
    assert outcome.code == 0, outcome.err
    found = outcome.json["approach"]
    assert (found["signs"], found["angle_deg"]) == ("+-+00-", pytest.approx(0.25))
    # The height above each of the two holes.
    assert (found["positioning_moves"], found["points_put_in"], found["no_room_within_limits"]) == (2, 2, {})
    assert 0.0 < found["deepest_beyond_target_mm"] < found["farthest_from_target_mm"] < 30.0
    program = read_program(out / "json" / "holes.json", load_robot("kr60-3"), read_cell(cell))
    assert program.n == outcome.json["moves_written"]
    plunges = np.flatnonzero(program.motions.rapid[:-1] & ~program.motions.rapid[1:])
    turned = np.degrees(program.q[plunges] - program.q[plunges - 1])
    # Angles in the file have all their digits.
    np.testing.assert_allclose(turned, [[0.25 * way for way in WAYS]] * 2, atol=1e-9)
    assert cli("verify", "kr60-3", out / "json" / "holes.json", "--cell", cell).code == 0


@pytest.mark.slow
def test_verify_finds_what_stands_in_the_way_from_that_side(
    cli: Command, files: tuple[Path, Path], tmp_path: Path
) -> None:
    cell, cls = files
    cell.write_text(CELL + DRILL)
    common = ("post", "kr60-3", cls, "--cell", cell, "--links", "rigid", "--gamma", "65")
    assert cli(*common, "--out", tmp_path / "any").code == 0
    assert cli(*common, "--out", tmp_path / "side", "--approach", "+++000", "--approach-deg", "2").code == 0
    program = read_program(tmp_path / "side" / "json" / "holes.json", load_robot("kr60-3"), read_cell(cell))
    moves = program.motions
    # The tip in the world, where the first target is come to from.
    tip = moves.points[np.argmax(moves.rapid[:-1] & ~moves.rapid[1:]) - 1] * 1e3 + [1200, 200, 600]
    clamped = tmp_path / "clamped.toml"
    clamped.write_text(CELL + DRILL + FIXTURE.format(*tip))
    codes = [
        cli("verify", "kr60-3", tmp_path / out / "json" / "holes.json", "--cell", clamped).code
        for out in ("any", "side")
    ]
    assert codes == [0, 1]


@pytest.mark.parametrize(
    ("signs", "deg"),
    [
        ("+-+00", None),
        ("+-+00+0", None),
        ("+-+x0+", None),
        ("", None),
        ("000000", None),
        ("+-+00+", 0.0),
        ("+-+00+", -1.0),
        ("+-+00+", 5.1),
        ("+-+00+", float("nan")),
        (None, 0.5),
    ],
)
def test_signs_and_angles_that_cannot_be_are_refused(signs: str | None, deg: float | None) -> None:
    with pytest.raises(InputError, match="--approach"):
        approach_of(signs, deg, load_robot("kr60-3"))


def test_signs_are_those_of_the_column() -> None:
    robot = load_robot("kr60-3")
    assert approach_of(None, None, robot) is None
    found = approach_of(SIGNS, None, robot)
    assert found is not None
    np.testing.assert_array_equal(found.ways, WAYS)
    assert found.angle == pytest.approx(np.radians(0.5))


def test_wrong_signs_leave_nothing_behind(cli: Command, files: tuple[Path, Path], tmp_path: Path) -> None:
    cell, cls = files
    out = tmp_path / "out"
    outcome = cli("post", "kr60-3", cls, "--cell", cell, "--links", "rigid", "--approach", "-+", "--out", out)
    assert outcome.code == 2
    assert "--approach" in outcome.err
    assert not out.exists()
