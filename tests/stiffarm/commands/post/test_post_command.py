"""The command `post`: from CLS to programs that are on the path, with compensation, and clear errors."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cli_runs import Command

import stiffarm as sa
from machining.cell import read_cell
from machining.placement import Placement, placement_content
from machining.programs.formats import NEUTRAL, changed_since
from machining.programs.program import frame_distance
from robots import load_description
from robots.robot import robot_from
from stiffarm.commands.post.command import targets_of

CELL = """
schema = "stiffarm-cell/1"
[tool]
position_mm = [200, 0, 80]
rpy_deg = [0, 90, 0]
[robot]
joint_speed_deg_s = [128, 102, 128, 260, 245, 322]
[part]
position_mm = [1200, 200, 600]
[[linear_axis]]
name = "rail"
direction = [1, 0, 0]
limits_mm = [-500, 500]
"""
CLS = """TOOL PATH/POCKET,TOOL,MILL_D10
UNITS/MM
TLDATA/MILL,10.0,0.0,75.0,0.0,0.0
LOADTL/1
SPINDL/RPM,9000,CLW
$$ {{ 7 * 7 }} ; PTP $POS_ACT
RAPID
GOTO/-40.0,0.0,30.0,0.0,0.0,1.0
FEDRAT/MMPM,1200
GOTO/-40.0,0.0,0.0
GOTO/40.0,0.0,0.0
GOTO/40.0,40.0,0.0
GOTO/-40.0,40.0,0.0,0.0998334,0.0,0.9950042
GOTO/-40.0,0.0,0.0,0.0,0.0,1.0
RAPID
GOTO/-40.0,0.0,30.0
FINI
"""


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    cell, cls = tmp_path / "cell.toml", tmp_path / "pocket.cls"
    cell.write_text(CELL)
    cls.write_text(CLS)
    return cell, cls


def test_a_measured_force_says_how_sure_it_is(cli: Command, files: tuple[Path, Path], tmp_path: Path) -> None:
    cell, cls = files
    common = ("post", "kr60-3", cls, "--cell", cell, "--links", "rigid", "--gamma", "-30", "--compensate")
    force = ("--force", "20,40,-60", "--force-axes", "process")
    unknown = {}
    for sd in ("0.001", "20"):
        out = tmp_path / sd
        outcome = cli(*common, *force, "--force-measured", sd, "--out", out)
        assert outcome.code == 0, outcome.err
        content = json.loads((out / "post.json").read_text(encoding="utf-8"))["compensation"]
        unknown[sd] = content["unknown_95_um"], content["largest_um"]
        assert not any("not measured" in note for note in content["rests_on"])
    assert unknown["20"][0] > 1.2 * unknown["0.001"][0]
    # How sure the force is changes nothing of what is taken off the path.
    assert unknown["20"][1] == unknown["0.001"][1]
    for more in (("--force-measured", "2"), (*force, "--force-measured", "-1")):
        refused = cli(*common, *more, "--out", tmp_path / "refused")
        assert refused.code == 2
        assert "--force-measured" in refused.err
        assert not (tmp_path / "refused").exists()


def test_a_program_edited_after_it_was_posted_is_found(cli: Command, files: tuple[Path, Path], tmp_path: Path) -> None:
    cell, cls = files
    out = tmp_path / "out"
    common = ("--cell", cell)
    outcome = cli(
        "post", "kr60-3", cls, *common, "--links", "rigid", "--gamma", "-30", "--format", "krl,json", "--out", out
    )
    assert outcome.code == 0, outcome.err
    main = next((out / "krl_cartesian").glob("*.src"))
    assert changed_since(out / "post.json", main) == ()
    assert changed_since(out / "no.json", main) == ()
    # A comment changes no move, and still the file is not what was posted.
    text = main.read_text(encoding="utf-8")
    main.write_text(text.replace("END", "; hello\nEND", 1), encoding="utf-8")
    assert changed_since(out / "post.json", main) == (main.name,)
    verified = cli("verify", "kr60-3", main, *common, "--json")
    assert verified.code == 1, verified.err
    assert f"{main.name} was changed after it was posted" in verified.out + verified.err
    # The same by Python, with the neutral program of the same run named or found.
    arm = sa.load("kr60-3")
    for more in ({}, {"against": out / "json" / "pocket.json"}):
        checked = sa.verify(arm, main, cell=cell, **more)
        assert any("changed after" in offence.text for offence in checked.found.offences)
    # A second file of the program counts as much, and so does one that is gone.
    main.write_text(text, encoding="utf-8")
    other = next((file for file in main.parent.iterdir() if file != main), None)
    if other is not None:
        other.unlink()
        assert other.name in changed_since(out / "post.json", main)


@pytest.mark.slow
def test_the_programs_are_on_the_path(cli: Command, files: tuple[Path, Path], tmp_path: Path) -> None:
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
        "-60:0:10",
        "--format",
        "krl,sinumerik,csv,json",
        "--travel",
        "100",
        "--out",
        out,
    )
    assert outcome.code == 0, outcome.err
    content = json.loads((out / "post.json").read_text(encoding="utf-8"))
    written = {"krl_cartesian", "krl_joint", "sinumerik_joint", "csv", "json"}
    assert {found["program"] for found in content["programs"]} == written
    for found in content["programs"]:
        assert found["off_path_um"] < 1.0
        assert found["off_path_urad"] < 1.0
    assert content["moves_read"] == 7
    assert content["largest_bend_of_cuts_um"] <= 10.0
    both = content["largest_bend_of_cuts_um"], content["largest_bend_of_rapids_um"]
    assert content["largest_bend_um"] == max(both)
    robot = robot_from(load_description("kr60-3"))
    text = (out / "json" / "pocket.json").read_text(encoding="utf-8")
    program = NEUTRAL[".json"].program(text, robot, read_cell(cell))
    assert program.n == content["moves_written"]
    np.testing.assert_allclose(program.travel, 0.1)
    kept = program.motions.points[~program.inserted] * 1e3
    wanted = [[-40, 0, 30], [-40, 0, 0], [40, 0, 0], [40, 40, 0], [-40, 40, 0], [-40, 0, 0], [-40, 0, 30]]
    np.testing.assert_allclose(kept, wanted, atol=1e-6)
    away, turned = frame_distance(program.reached(), program.T_part_tool)
    assert max(away.max(), turned.max()) < 1e-9
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "stiffarm verify" in page
    assert 'src="http' not in page
    for name in ("krl_cartesian", "krl_joint"):
        for file in (out / name).iterdir():
            statements = [line for line in file.read_text(encoding="utf-8").splitlines() if "POS_ACT" in line]
            assert all(line.lstrip().startswith(";") for line in statements)


@pytest.mark.slow
def test_one_kind_of_coordinates_is_written_if_asked(cli: Command, files: tuple[Path, Path], tmp_path: Path) -> None:
    cell, cls = files
    outcome = cli(
        "post",
        "kr60-3",
        cls,
        "--cell",
        cell,
        "--links",
        "rigid",
        "--gamma",
        "-30",
        "--format",
        "krl",
        "--coordinates",
        "joint",
        "--out",
        tmp_path / "out",
        "--json",
    )
    assert outcome.code == 0, outcome.err
    assert [found["program"] for found in outcome.json["programs"]] == ["krl_joint"]
    assert outcome.json["gamma_deg"] == [-30.0, -30.0]


@pytest.mark.slow
def test_compensation_moves_the_path_by_what_it_says(cli: Command, files: tuple[Path, Path], tmp_path: Path) -> None:
    cell, cls = files
    plain, moved = tmp_path / "plain", tmp_path / "moved"
    common = ("post", "kr60-3", cls, "--cell", cell, "--links", "rigid", "--gamma", "-30", "--tolerance-um", "100")
    assert cli(*common, "--out", plain).code == 0
    outcome = cli(*common, "--out", moved, "--compensate", "--force", "20,40,-60", "--force-axes", "process", "--json")
    assert outcome.code == 0, outcome.err
    found = outcome.json["compensation"]
    assert found["capped_moves"] == 0
    assert found["left_um"] < 0.1
    robot, where = robot_from(load_description("kr60-3")), read_cell(cell)
    before, after = (
        NEUTRAL[".json"].program((folder / "json" / file).read_text(encoding="utf-8"), robot, where)
        # A compensated program has a name of its own.
        for folder, file in ((plain, "pocket.json"), (moved, "pocket_c.json"))
    )
    shift = np.linalg.norm(after.motions.points - before.motions.points, axis=1) * 1e6
    assert shift.max() == pytest.approx(found["largest_um"], rel=1e-3)
    # Rapid moves and the plunge stay.
    assert shift[before.motions.rapid].max() < 1e-6
    capped = cli(*common, "--out", tmp_path / "c", "--compensate", "--force", "20,40,-60", "--cap-um", "50", "--json")
    assert capped.json["compensation"]["capped_moves"] > 0
    assert capped.json["compensation"]["largest_um"] <= 50.0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--format", "apt"), "--format"),
        (("--format", "rapid"), "joint convention of kr60-3"),
        (("--coordinates", "polar"), "--coordinates"),
        (("--format", "sinumerik", "--coordinates", "cartesian"), "--coordinates of sinumerik"),
        (("--travel", "900"), "external axes at move 0"),
        (("--travel", "1,2"), "--travel"),
        (("--compensate",), "--compensate needs a cutting force"),
        (("--rapid", "fast"), "--rapid"),
        (("--units", "yard"), "units"),
    ],
)
def test_bad_input_is_named(
    cli: Command, files: tuple[Path, Path], tmp_path: Path, arguments: tuple[str, ...], words: str
) -> None:
    cell, cls = files
    outcome = cli("post", "kr60-3", cls, "--cell", cell, "--links", "rigid", "--out", tmp_path / "o", *arguments)
    assert outcome.code == 2, outcome.err
    assert words in outcome.err.replace("\n", " ")
    assert not (tmp_path / "o").exists()


def test_a_broken_tool_path_names_its_lines(cli: Command, files: tuple[Path, Path], tmp_path: Path) -> None:
    cell, _ = files
    bad = tmp_path / "bad.cls"
    bad.write_text(CLS.replace("GOTO/40.0,0.0,0.0", "GOTO/40.0,nan,0.0").replace("GOTO/40.0,40.0,0.0", "GOTO/40.0"))
    outcome = cli("post", "kr60-3", bad, "--cell", cell, "--out", tmp_path / "o")
    assert outcome.code == 2
    assert "line 11" in outcome.err
    assert "line 12" in outcome.err


def test_a_point_out_of_reach_names_its_line(cli: Command, files: tuple[Path, Path], tmp_path: Path) -> None:
    cell, _ = files
    far = tmp_path / "far.cls"
    far.write_text(CLS.replace("GOTO/40.0,0.0,0.0", "GOTO/4000.0,0.0,0.0"))
    outcome = cli(
        "post", "kr60-3", far, "--cell", cell, "--out", tmp_path / "o", "--tolerance-um", "1000", "--gamma", "-30"
    )
    assert outcome.code == 2
    assert "line 11: " in outcome.err
    assert "cannot be reached" in outcome.err


def test_targets() -> None:
    assert [t.folder for t in targets_of(("krl", "json"), "both")] == ["krl_cartesian", "krl_joint", "json"]
    assert [t.folder for t in targets_of(("val3",), "cartesian")] == ["val3_cartesian"]


@pytest.mark.slow
def test_a_placement_is_taken_as_it_is(cli: Command, files: tuple[Path, Path], tmp_path: Path) -> None:
    """Axes, gamma and branch of a placement file stand in the program; one of another path is refused."""
    cell, cls = files
    common = ("post", "kr60-3", cls, "--cell", cell, "--links", "rigid", "--tolerance-um", "1000")
    assert cli(*common, "--gamma", "-30", "--travel", "120", "--out", tmp_path / "first").code == 0
    robot, where = robot_from(load_description("kr60-3")), read_cell(cell)
    text = (tmp_path / "first" / "json" / "pocket.json").read_text(encoding="utf-8")
    first = NEUTRAL[".json"].program(text, robot, where)
    given = np.flatnonzero(~first.inserted)
    # The other side of the wrist, which nobody would choose by himself.
    q = first.q[given].copy()
    q[:, 3] += np.where(q[:, 3] > 0.0, -np.pi, np.pi)
    q[:, 4] *= -1.0
    q[:, 5] += np.where(q[:, 5] > 0.0, -np.pi, np.pi)
    placement = Placement(
        "kr60-3",
        where.name,
        ("rail",),
        first.travel[given],
        0.0,
        first.gamma[given],
        robot.coordinates,
        q,
        np.arange(len(given)),
        len(given),
    )
    file = tmp_path / "placement.json"
    file.write_text(json.dumps(placement_content(placement)))
    outcome = cli(*common, "--placement", file, "--out", tmp_path / "second")
    assert outcome.code == 0, outcome.err
    text = (tmp_path / "second" / "json" / "pocket.json").read_text(encoding="utf-8")
    second = NEUTRAL[".json"].program(text, robot, where)
    np.testing.assert_allclose(second.q[~second.inserted], q, atol=1e-6)
    np.testing.assert_allclose(second.travel, 0.12, atol=1e-12)
    file.write_text(json.dumps(placement_content(replace(placement, gamma=placement.gamma + 0.1))))
    wrong = cli(*common, "--placement", file, "--out", tmp_path / "third")
    assert wrong.code == 2
    assert "not those of this path" in wrong.err.replace("\n", " ")
    assert "--gamma with --placement" in cli(*common, "--placement", file, "--gamma", "5", "--out", tmp_path / "x").err


@pytest.mark.slow
def test_a_model_without_stiffness_is_posted_by_room(cli: Command, files: tuple[Path, Path], tmp_path: Path) -> None:
    """tx200 comes without joint stiffness: room chooses, and what names a stiffness is refused."""
    cell, cls = files
    cell.write_text(CELL.replace("[1200, 200, 600]", "[1300, 300, 500]"))
    common = ("post", "tx200", cls, "--cell", cell, "--links", "rigid", "--tolerance-um", "1000")
    outcome = cli(*common, "--gamma", "150", "--out", tmp_path / "out", "--json")
    assert outcome.code == 0, outcome.err
    assert outcome.json["chosen_by"] == "room"
    assert "mean_k_fs_N_per_mm" not in outcome.json
    assert outcome.json["gamma_counts_from"] == [1.0, 0.0, 0.0]
    ranged = cli(*common, "--gamma", "100:200:20", "--out", tmp_path / "ranged", "--json")
    assert ranged.code == 0, ranged.err
    assert ranged.json["mean_room"] >= outcome.json["mean_room"] - 1e-6
    posture = cli("posture", "tx200", cls, "--cell", cell, "--links", "rigid", "--quantity", "k_fs")
    assert posture.code == 2
    assert "nothing in this model deflects" in posture.err.replace("\n", " ")


def test_a_placement_on_a_turntable_alone_has_no_travels() -> None:
    three = np.zeros(3)
    placement = Placement(
        "kr60-3", "c", (), np.zeros((3, 0)), 0.3, three, ("q1",), three[:, None], np.array([0, 2, 4]), 5
    )
    assert placement.at_moves().shape == (5, 0)
    assert placement.joints_at_moves().shape == (5, 1)
