"""`new`: from a table, a xacro file or a known arm to a model with all that goes with it; bad tables in one message."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cli_runs import Command

import stiffarm as sa
from fem.arm import Arm
from robots import forward_kinematics, load_description, load_robot
from stiffarm.session.caution import CLASS_PRIOR, uncalibrated

HEAD = "joint,alpha_deg,a_mm,d_mm,theta_deg,lower_deg,upper_deg,sign"
# The KR60-3 once more, in Craig's parameters and in the standard ones.
MODIFIED = (
    HEAD,
    "j1,0,0,815,0,-185,185,1",
    "j2,-90,350,0,0,-135,35,1",
    "j3,0,850,0,0,-210,68,1",
    "j4,-90,145,820,0,-350,350,1",
    "j5,90,0,0,0,-119,119,1",
    "j6,-90,0,0,0,-350,350,1",
    "flange,0,0,170,0,,,",
)
STANDARD = (
    HEAD,
    "j1,-90,350,815,0,-185,185,1",
    "j2,0,850,0,0,-135,35,1",
    "j3,-90,145,0,0,-210,68,1",
    "j4,90,0,820,0,-350,350,1",
    "j5,-90,0,0,0,-119,119,1",
    "j6,0,0,170,0,-350,350,1",
)
XACRO = """<robot name="two" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="L" value="0.5"/>
<link name="base_link"/><link name="l1"/><link name="l2"/><link name="tool0"/>
<joint name="j1" type="revolute"><parent link="base_link"/><child link="l1"/><origin xyz="0 0 ${L}"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<joint name="j2" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="0.1 0 ${L/2}"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="end" type="fixed"><parent link="l2"/><child link="tool0"/><origin xyz="${L} 0 0"/></joint></robot>"""


def table(path: Path, lines: tuple[str, ...]) -> Path:
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(("option", "lines"), [("--mdh", MODIFIED), ("--dh", STANDARD)])
def test_a_table_of_either_form_gives_the_same_arm(
    cli: Command, tmp_path: Path, option: str, lines: tuple[str, ...]
) -> None:
    answer = cli("new", "mine", option, table(tmp_path / "t.csv", lines), "--payload-kg", "60", "--json")
    assert answer.code == 0, answer.err
    made, known = load_robot("mine/mine.toml"), load_robot("kr60-3")
    q = np.radians([[10.0, -70.0, 30.0, 40.0, 50.0, 60.0], [-20.0, -100.0, -30.0, 4.0, -5.0, 6.0]])
    np.testing.assert_allclose(forward_kinematics(made, q).T_flange, forward_kinematics(known, q).T_flange, atol=1e-9)
    np.testing.assert_allclose(made.limits, known.limits)
    assert sorted(answer.json["files"]) == sorted(p.name for p in Path("mine").glob("*") if p.name != "run.json")
    assert answer.json["joints_without_springs"] == [f"j{i}" for i in range(1, 7)]


def test_the_pendant_table_and_the_sheet_are_of_poses_that_the_arm_takes(cli: Command) -> None:
    assert cli("new", "mine", "--like", "r2000ic-270f").code == 0
    robot = load_robot("mine/mine.toml")
    assert robot.controller is not None
    rows = Path("mine/pendant.csv").read_text().splitlines()
    assert rows[0].startswith("pose,J1_deg,")
    p = np.radians([[float(cell) for cell in row.split(",")[1:7]] for row in rows[1:]])
    assert len(p) == 10
    assert robot.reachable(robot.controller.model(p)).all()
    assert (np.ptp(p, axis=0) > np.radians(30.0)).all()
    assert Path("mine/sheet.csv").read_text().startswith("pose,J1_deg,")


def test_springs_of_the_class_say_that_they_are_a_prior(cli: Command) -> None:
    assert cli("new", "mine", "--like", "gp25", "--springs", "class").code == 0
    made = load_description("mine/mine.toml")
    assert {joint.stiffness.source for joint in made.joint if joint.stiffness is not None} == {CLASS_PRIOR}
    assert "class prior" in made.sources[CLASS_PRIOR]
    assert "class prior" in uncalibrated(Arm.of(made, "rigid")), "pages and pictures warn of it"


def test_a_xacro_file_is_expanded(cli: Command, tmp_path: Path) -> None:
    pytest.importorskip("xacro")
    (tmp_path / "arm.xacro").write_text(XACRO, encoding="utf-8")
    assert cli("new", "two", "--urdf", "arm.xacro").code == 0
    T = forward_kinematics(load_robot("two/two.toml"), np.zeros((1, 2))).T_flange[0]
    np.testing.assert_allclose(T[:3, 3], [0.6, 0.0, 0.75])
    (tmp_path / "bad.xacro").write_text(XACRO.replace("${L/2}", "${M}"), encoding="utf-8")
    bad = cli("new", "bad", "--urdf", "bad.xacro")
    assert (bad.code, Path("bad").exists()) == (2, False)
    assert "bad.xacro" in bad.err


def test_without_a_source_there_is_a_table_to_fill_in(cli: Command) -> None:
    assert cli("new", "mine", "--json").json["table"] == "dh.csv"
    again = cli("new", "mine", "--mdh", "mine/dh.csv")
    assert again.code == 2
    assert again.err.count("dh.csv, row") == 1


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("0,0,815", "0,0,670000", "row 2, column d_mm"),
        ("0,0,815", "0,0,670,000", "row 2, the row does not fit"),
        ("-135,35,1", "-135,,1", "row 3, no upper_deg"),
        ("-135,35,1", "35,-135,1", "row 3, columns lower_deg, upper_deg"),
        ("-90,350", "-1.5708,350", "radians"),
        ("alpha_deg", "alpha_rad", "alpha_deg"),
        ("flange,0,0,170,0,,,\n", "", "no row named flange"),
        ("j3,", "j2,", "column joint"),
        ("-119,119,1", "-119,1e6,1", "row 6, columns lower_deg, upper_deg"),
        ("-90,350,0,0", "-90,350,0,1e6", "row 3, column theta_deg"),
        ("-119,119,1", "-119,119,2", "column sign"),
    ],
)
def test_a_slip_in_the_table_is_one_message(cli: Command, tmp_path: Path, old: str, new: str, said: str) -> None:
    text = "\n".join(MODIFIED) + "\n"
    (tmp_path / "t.csv").write_text(text.replace(old, new, 1), encoding="utf-8")
    outcome = cli("new", "mine", "--mdh", "t.csv")
    assert (outcome.code, Path("mine").exists()) == (2, False)
    assert said in outcome.err
    assert "Traceback" not in outcome.err
    assert len(outcome.err.splitlines()) <= 3


def test_a_table_in_metres_is_refused(cli: Command, tmp_path: Path) -> None:
    head, *rows = MODIFIED
    cells = [row.split(",") for row in rows]
    metres = [",".join([*row[:2], f"{float(row[2]) / 1e3:g}", f"{float(row[3]) / 1e3:g}", *row[4:]]) for row in cells]
    outcome = cli("new", "mine", "--mdh", table(tmp_path / "t.csv", [head, *metres]))
    assert (outcome.code, Path("mine").exists()) == (2, False)
    assert "metres" in outcome.err


@pytest.mark.parametrize(
    "arguments",
    [
        ("a b", "--like", "gp25"),
        ("xr701", "--like", "gp25"),
        ("gp25", "--like", "gp25"),
        ("mine", "--like", "gp2"),
        ("mine", "--like", "gp25", "--urdf", "x.urdf"),
        ("mine", "--like", "gp25", "--payload-kg", "-1"),
        ("mine", "--like", "gp25", "--payload-kg", "1e9"),
        ("mine", "--like", "gp25", "--springs", "steel"),
        ("mine", "--like", "gp25", "--tip", "tool0"),
        ("mine", "--payload-kg", "5"),
        ("mine", "--mdh", "nowhere.csv"),
        ("mine", "--urdf", "nowhere.urdf"),
    ],
)
def test_bad_options_are_refused_and_nothing_is_written(cli: Command, arguments: tuple[str, ...]) -> None:
    outcome = cli("new", *arguments)
    assert outcome.code == 2
    assert not list(Path().iterdir())


def test_the_face_makes_the_same_files(cli: Command, tmp_path: Path) -> None:
    lines = table(tmp_path / "t.csv", MODIFIED)
    assert cli("new", "mine", "--mdh", lines, "--payload-kg", "60", "--out", "a").code == 0
    sa.new_arm("mine", mdh=lines, payload_kg=60.0).save("b")
    for name in ("mine.toml", "pendant.csv", "sheet.csv"):
        assert Path("a", name).read_text() == Path("b", name).read_text()
    assert sa.new_arm("empty").save("c") == Path("c/dh.csv")
    with pytest.raises(sa.InputError, match="payload_kg"):
        sa.new_arm("mine", like="gp25", payload_kg=-1.0)


def test_a_joint_that_slides_is_named(cli: Command, tmp_path: Path) -> None:
    head = HEAD.replace("joint,", "joint,type,")
    rows = [line.replace(",", ",revolute,", 1) for line in STANDARD[1:]]
    accepted = cli("new", "a", "--dh", table(tmp_path / "r.csv", (head, *rows)), "--out", tmp_path / "a")
    assert accepted.code == 0, accepted.err
    rows[2] = rows[2].replace("revolute", "Prismatic")
    refused = cli("new", "b", "--dh", table(tmp_path / "p.csv", (head, *rows)), "--out", tmp_path / "b")
    assert refused.code == 2
    assert "row 4" in refused.err
    assert "slides" in refused.err
    assert not (tmp_path / "b").exists()


def test_a_controller_asked_for_is_written_and_post_takes_it(cli: Command, tmp_path: Path) -> None:
    made = table(tmp_path / "t.csv", MODIFIED)
    answer = cli("new", "mine", "--mdh", made, "--payload-kg", "60", "--controller", "krl, sinumerik", "--json")
    assert answer.code == 0, answer.err
    assert answer.json["controller_formats"] == ["krl", "sinumerik"]
    assert load_description("mine/mine.toml").controller.formats == ("krl", "sinumerik")  # type: ignore[union-attr]
    assert cli("new", "plain", "--mdh", made, "--payload-kg", "60", "--json").json["controller_formats"] == []
    # The same by Python; each joint counts as the model's does.
    arm = sa.new_arm("third", mdh=made, payload_kg=60, controller="krl").arm
    robot = arm.robot
    assert robot.controller is not None
    with pytest.raises(sa.InputError, match="controller"):
        sa.new_arm("fourth", mdh=made, payload_kg=60, controller="json")
    q = np.radians([[10.0, -70.0, 30.0, 40.0, 50.0, 60.0]])
    np.testing.assert_allclose(robot.controller.controller(q), q)
    for wrong in ("json", "kuka", ""):
        refused = cli("new", "wrong", "--mdh", made, "--payload-kg", "60", "--controller", wrong)
        assert refused.code == 2
        assert "--controller" in refused.err
        assert not Path("wrong").exists()
