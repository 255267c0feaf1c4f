"""`robots --pose` in the controllers' conventions, and `robots check` against a pendant's table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cli_runs import Command
from scipy.spatial.transform import Rotation

import stiffarm as sa
from machining.programs.orientation import SPOKEN
from robots import forward_kinematics, load_robot


def pendant(path: Path, name: str, columns: str = "w_deg,p_deg,r_deg", change: float = 1.0) -> Path:
    """What a controller shows at six poses; ``change``: what joint 3 is multiplied by in the table."""
    robot = load_robot(name)
    low, high = np.degrees(robot.limits).T
    q = np.round(np.random.default_rng(3).uniform(0.5 * low, 0.5 * high, (6, 6)), 1)
    at = forward_kinematics(robot, np.radians(q))
    spoken = next(s for s in SPOKEN if ",".join(s.columns) == columns)
    q[:, 2] *= change
    rows = np.column_stack([q, (at.p_flange * 1e3).round(2), spoken.orientation.write(at.R_flange).round(4)])
    head = f"{','.join(robot.coordinates)},x_mm,y_mm,z_mm,{columns}"
    path.write_text("\n".join([head, *(",".join(map(str, row)) for row in rows.tolist())]) + "\n", encoding="utf-8")
    return path


def test_a_pose_is_shown_in_the_controllers_frame_and_conventions(cli: Command) -> None:
    outcome = cli("robots", "r2000ic-270f", "--pose", "J2_deg=30,J3_deg=-10,J5_deg=-20", "--out", "out", "--json")
    assert outcome.code == 0, outcome.err
    answer = outcome.json
    assert answer["pose_deg"]["q3_deg"] == 20.0
    np.testing.assert_allclose(np.subtract(answer["base_position_mm"], answer["position_mm"]), [0, 0, 670])
    told = answer["orientation"]
    R = Rotation.from_quat(list(told["abb"].values()), scalar_first=True)
    for code, sequence in (("kuka", "ZYX"), ("fanuc", "xyz"), ("staubli", "XYZ"), ("kawasaki", "ZYZ")):
        same = Rotation.from_euler(sequence, list(told[code].values()), degrees=True)
        assert (R.inv() * same).magnitude() < 1e-6
    assert (R.inv() * Rotation.from_rotvec(list(told["ur"].values()))).magnitude() < 1e-5
    assert {p.name for p in Path("out").iterdir()} == {"pose.json", "pose.png", "report.html", "run.json"}


@pytest.mark.parametrize("columns", [",".join(spoken.columns) for spoken in SPOKEN])
def test_a_right_model_agrees_in_every_convention(cli: Command, tmp_path: Path, columns: str) -> None:
    answer = cli("robots", "check", "gp25", pendant(tmp_path / "p.csv", "gp25", columns), "--json").json
    assert answer["verdict"] == "agrees"
    assert answer["orientation"]["largest_deg"] < 0.05


def test_the_convention_that_columns_are_named_after_matters(cli: Command, tmp_path: Path) -> None:
    table = pendant(tmp_path / "p.csv", "gp25")
    table.write_text(table.read_text().replace("w_deg,p_deg,r_deg", "rx_deg,ry_deg,rz_deg"), encoding="utf-8")
    answer = cli("robots", "check", "gp25", table, "--json").json
    assert answer["verdict"] == "orientation"
    # Yaskawa calls its angles so, and they are FANUC's W P R.
    assert "w_deg, p_deg, r_deg" in answer["orientation"]["agrees_as"]
    assert answer["orientation"]["largest_deg"] < 0.1
    assert "w_deg, p_deg, r_deg" in cli("robots", "check", "gp25", table, "--out", "out").err
    assert "w_deg, p_deg, r_deg" in Path("out/report.html").read_text(encoding="utf-8")


def test_angles_alone_are_the_pose_in_the_order_of_the_joints(cli: Command) -> None:
    by_name = ",".join(f"q{i}_deg={i}" for i in range(1, 7))
    one, other = (cli("robots", "gp25", "--pose", pose, "--json").json for pose in ("1,2,3,4,5,6", by_name))
    assert one == other


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("x_mm", "x_m", "x_mm"),
        (",z_mm", ",height", "no column z_mm"),
        ("q1_deg", "q1_rad", "q1_deg"),
        (",r_deg", ",other", "not whole"),
        ("\n", "\n1e9,", "does not fit the header"),
        ("r_deg", "a_deg", "not whole"),
        ("-268.24", "1e9", "row 3"),
    ],
)
def test_wrong_columns_are_one_message(cli: Command, tmp_path: Path, old: str, new: str, said: str) -> None:
    table = pendant(tmp_path / "p.csv", "gp25")
    table.write_text(table.read_text().replace(old, new, 1), encoding="utf-8")
    outcome = cli("robots", "check", "gp25", table)
    assert outcome.code == 2
    assert said in outcome.err
    assert len(outcome.err.splitlines()) <= 3


def test_rows_without_a_position_are_skipped_and_none_at_all_refused(cli: Command) -> None:
    assert cli("new", "mine", "--like", "gp25").code == 0
    table = Path("mine/pendant.csv")
    nothing = cli("robots", "check", "mine/mine.toml", table)
    assert (nothing.code, len(nothing.err.splitlines())) == (2, 1)
    rows = table.read_text().splitlines()
    robot = load_robot("gp25")
    for i in range(1, 5):
        q = np.radians([[float(v) for v in rows[i].split(",")[1:7]]])
        x, y, z = (forward_kinematics(robot, q).p_flange[0] - [0.0, 0.0, 0.505]) * 1e3
        rows[i] = rows[i].removesuffix(",,,") + f",{x:.3f},{y:.3f},{z:.3f}"
    table.write_text("\n".join(rows) + "\n", encoding="utf-8")
    answer = cli("robots", "check", "mine/mine.toml", table, "--json").json
    assert (answer["verdict"], answer["poses"]) == ("agrees", 4)


@pytest.mark.parametrize(
    "arguments",
    [
        ("--pose", "q1_deg=3"),
        ("gp25", "--pose", "q2_deg=900"),
        ("gp25", "--pose", "j2=3"),
        ("check", "gp25", "nowhere.csv"),
        ("check", "nowhere", "nowhere.csv"),
    ],
)
def test_bad_input_is_refused(cli: Command, arguments: tuple[str, ...]) -> None:
    outcome = cli("robots", *arguments)
    assert outcome.code == 2
    assert not list(Path().iterdir())


def test_a_flipped_joint_is_named_with_what_to_write_on_every_way(cli: Command, tmp_path: Path) -> None:
    table = pendant(tmp_path / "p.csv", "gp25", change=-1.0)
    outcome = cli("robots", "check", "gp25", table, "--out", "out", "--json")
    change = outcome.json["explanations"][0]["changes"][0]
    assert (change["code"], "sign = -1" in change["remedy"]) == ("sign:j3", True)
    assert {p.name for p in Path("out").iterdir()} >= {"check.json", "check.csv", "skeleton.png", "distances.png"}
    page = Path("out/report.html").read_text(encoding="utf-8")
    assert "<code>in [[joint]] j3: sign = -1" in page
    rows = outcome.json["by_pose"]
    assert max(one["distance_mm"] for one in rows) == outcome.json["largest_mm"] > 10.0
    assert max(one["put_right_mm"] for one in rows) < 0.05
    # The same from Python, on an arm made there.
    found = sa.check_kinematics(sa.new_arm("mine", like="gp25").arm, table)
    assert found.verdict == "explained"
    assert next(iter(found.remedies.values())) == "in [[joint]] j3: sign = -1"
    off = found.to_frame()[["dx_mm", "dy_mm", "dz_mm"]].to_numpy()
    np.testing.assert_allclose(np.linalg.norm(off, axis=1), found.to_frame()["distance_mm"], rtol=1e-5)
