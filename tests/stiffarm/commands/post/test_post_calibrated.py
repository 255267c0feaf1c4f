"""`post --compensate` with a model that positions have calibrated: moved targets, what is said, and bad input."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomlkit
from cli_runs import Outcome, row_of, run_here
from made_up_positions import Plan, Truth, campaign

from fem import build_model
from machining.cell import read_cell
from machining.programs.formats import read_program
from machining.programs.program import frame_distance
from robots import load_description
from robots.library.models import to_toml
from robots.robot import as_designed, robot_from

CELL = """
schema = "stiffarm-cell/1"
[tool]
position_mm = [200, 0, 80]
rpy_deg = [0, 90, 0]
[part]
position_mm = [1200, 200, 600]
"""
PATH = "x_mm,y_mm,z_mm,nx,ny,nz,feed_mm_per_min\n-40,0,0,0,0,1,900\n40,0,0,0,0,1,900\n40,40,0,0,0,1,900\n"


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("shop")
    data = tomllib.loads(to_toml(load_description("kr60-3")))
    for k, joint in enumerate(data["joint"]):
        joint["zero_error"] = {"value": 0.02 * (k - 2), "unit": "deg", "source": "assumed"}
        joint["error"] = {"x": {"value": 0.2 * k, "unit": "mm", "source": "assumed"}}
    data["positions"] = {
        "data": "made up",
        "data_sha256": "0",
        "before_rms_mm": 2.0,
        "rms_mm": 0.1,
        "left_out_rms_mm": 0.12,
    }
    (folder / "model.toml").write_text(tomlkit.dumps(data), encoding="utf-8")
    (folder / "cell.toml").write_text(CELL, encoding="utf-8")
    (folder / "path.csv").write_text(PATH, encoding="utf-8")
    return folder


def post(shop: Path, *more: str, out: str = "program") -> Outcome:
    return run_here(
        "post",
        shop / "model.toml",
        shop / "path.csv",
        "--cell",
        shop / "cell.toml",
        "--out",
        shop / out,
        "--format",
        "json,krl",
        "--gamma",
        "90",
        "--tolerance-um",
        "200",
        "--json",
        *more,
    )


@pytest.fixture(scope="module")
def moved(shop: Path) -> Outcome:
    outcome = post(shop, "--compensate", "--payload", "25,0,0,120")
    assert outcome.code == 0, outcome.err
    return outcome


@pytest.mark.slow
def test_no_force_is_needed_and_what_is_moved_is_said(moved: Outcome) -> None:
    c = moved.json["correction"]
    assert c["largest_um"] > 500.0
    assert c["by"]["force"]["largest_um"] == 0.0
    assert c["by"]["weight"]["largest_um"] > 50.0
    assert c["left_um"] < 1.0
    assert c["place_sd_um"] is None
    assert c["turns_corrected"]
    assert c["calibrated_rms_mm"]["readings_left_out"] == 0.12
    assert "compensation" not in moved.json
    assert row_of(moved.json["programs"], program="krl_cartesian")["off_path_um"] < 1.0


@pytest.mark.slow
def test_programs_are_those_of_the_arm_as_designed(shop: Path, moved: Outcome) -> None:
    robot = robot_from(load_description(shop / "model.toml"))
    cell = read_cell(shop / "cell.toml")
    file = shop / "program" / "json" / "path_c.json"
    away = []
    for arm in (as_designed(robot), robot):
        program = read_program(file, arm, cell)
        away.append(float(frame_distance(program.reached(), program.T_part_tool)[0].max()))
    # The program's decimals, and what zeros of a fiftieth of a degree make at two metres.
    assert away[0] < 1e-6
    assert away[1] > 1e-4
    checked = run_here("verify", shop / "model.toml", file, "--cell", shop / "cell.toml", "--json")
    assert checked.code in (0, 1), checked.err


@pytest.mark.slow
def test_corrected_targets_are_come_to_from_the_calibrated_side(shop: Path, moved: Outcome) -> None:
    more = post(shop, "--compensate", "--payload", "25,0,0,120", "--approach", "+-+000", out="side")
    assert more.code == 0, more.err
    assert more.json["approach"]["points_put_in"] == 1
    robot, cell = as_designed(robot_from(load_description(shop / "model.toml"))), read_cell(shop / "cell.toml")
    any_side, side = (read_program(shop / out / "json" / "path_c.json", robot, cell).q for out in ("program", "side"))
    np.testing.assert_allclose(side[1:], any_side, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(np.degrees(side[1] - side[0]), [0.5, -0.5, 0.5, 0.0, 0.0, 0.0], atol=1e-9)
    assert more.json["correction"] == moved.json["correction"]


@pytest.mark.slow
def test_with_a_force_both_are_taken_off(shop: Path, moved: Outcome) -> None:
    more = post(shop, "--compensate", "--payload", "25,0,0,120", "--force", "100,50,0", out="forced")
    assert more.json["correction"]["by"]["force"]["largest_um"] > 5.0
    assert more.json["correction"]["error_sd_um"] > 0.0
    assert more.json["correction"]["by"]["geometry"] == moved.json["correction"]["by"]["geometry"]
    assert json.loads((shop / "forced" / "post.json").read_text(encoding="utf-8")) == more.json


@pytest.mark.slow
def test_without_compensate_it_says_that_errors_are_known(shop: Path, moved: Outcome) -> None:
    plain = run_here(
        "post",
        shop / "model.toml",
        shop / "path.csv",
        "--cell",
        shop / "cell.toml",
        "--gamma",
        "90",
        "--tolerance-um",
        "200",
        "--out",
        shop / "plain",
    )
    assert plain.code == 0, plain.err
    assert "--compensate takes them in" in plain.err
    points = np.array([[float(v) for v in row.split(",")[:3]] for row in PATH.splitlines()[1:]])
    robot = as_designed(robot_from(load_description(shop / "model.toml")))
    program = read_program(shop / "plain" / "json" / "path.json", robot, read_cell(shop / "cell.toml"))
    np.testing.assert_allclose(program.T_part_tool[~program.inserted, :3, 3] * 1e3, points, atol=1e-4)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--payload", "25"), "--payload"),
        (("--compensate", "--payload", "25,0,0"), "KG,X,Y,Z"),
        (("--compensate", "--payload", "-1"), "KG,X,Y,Z"),
        (("--compensate", "--payload", "nan"), "KG,X,Y,Z"),
        (("--compensate", "--payload", "25,0,0,90000"), "within"),
        (("--compensate", "--payload", "heavy"), "KG,X,Y,Z"),
        (("--compensate", "--cap-um", "100"), "--cap-um"),
        (("--force", "0,0,10"), "--compensate"),
    ],
)
def test_bad_input_is_one_message_and_leaves_nothing(shop: Path, more: tuple[str, ...], words: str) -> None:
    outcome = post(shop, *more, out="bad")
    assert outcome.code == 2
    assert words in outcome.err
    assert not (shop / "bad").exists()


def test_payload_of_a_model_without_positions_is_refused(shop: Path) -> None:
    outcome = run_here(
        "post",
        "kr60-3",
        shop / "path.csv",
        "--cell",
        shop / "cell.toml",
        "--compensate",
        "--force",
        "0,0,10",
        "--payload",
        "25",
        "--out",
        shop / "bad",
    )
    assert outcome.code == 2
    assert "stiffarm calibrate" in outcome.err


@pytest.mark.slow
def test_from_readings_to_a_program_whose_doubt_is_said(shop: Path) -> None:
    model = build_model(load_description("kr60-3"), "rigid").with_rigid_joints()
    numbers = {"j2.frame.x": 1e-3, "j3.zero": 1e-3, "j4.frame.rx": -1e-3, "j2.stiffness": 1e-6, "j3.stiffness": 1e-6}
    places = {"a": (0.1, 0.0, 0.05), "b": (-0.1, 0.1, 0.05), "c": (0.0, -0.15, 0.1)}
    numbers |= {f"target.{t}.{a}": v for t, p in places.items() for a, v in zip("xyz", p, strict=True)}
    read = campaign(model, Truth(numbers), Plan(90, targets=3, noise=2e-5), np.random.default_rng(1))
    head = ",".join((*model.robot.coordinates, "x_mm", "y_mm", "z_mm", "session", "target"))
    rows = [
        ",".join([*(f"{v:.9f}" for v in (*np.degrees(q), *(1e3 * p))), "s", "abc"[t]])
        for q, p, t in zip(read.q, read.position, read.target.number, strict=True)
    ]
    (shop / "read.csv").write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    calibrated = run_here(
        "calibrate", "kr60-3", shop / "read.csv", "--free", "geometry,springs", "--out", shop / "cal", "--json"
    )
    assert calibrated.code == 0, calibrated.err
    made = run_here(
        "post",
        shop / "cal" / "model.toml",
        shop / "path.csv",
        "--cell",
        shop / "cell.toml",
        "--gamma",
        "90",
        "--compensate",
        "--force",
        "100,0,0",
        "--tolerance-um",
        "200",
        "--out",
        shop / "made",
        "--json",
    )
    assert made.code == 0, made.err
    c = made.json["correction"]
    assert 1.0 < c["place_sd_um"] < 100.0
    assert c["turns_corrected"]
    assert c["targets_where_a_joint_error_is_not_identified"] == {}
    # The covariance of the springs serves the force's part.
    assert c["error_sd_um"] > 0.0
    assert made.json["stiffness_uncertainty"]
