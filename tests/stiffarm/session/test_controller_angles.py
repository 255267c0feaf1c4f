"""The controller's own angles: q = A p + b in the model file, wherever angles are read or given."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from doe import read_measurements
from doe.planning.protocol import Protocol, table_to_fill
from doe.tables.reading import read_set_ups, write_measurements
from fem.arm import Arm
from fem.effects.frames import frame_effects
from machining.programs.convention import convention_for
from robots import InputError, ModelDescription, Robot, content_hash, load_description
from robots.robot import robot_from
from stiffarm.request import POSE, pose_of

KR60_HASH = "8932e082dc0c74941d6e03bcec3e13dff00cbc996419c55ee931f689737f8738"
AXES = [f"J{i}_deg" for i in range(1, 7)]
FANUC = {"coordinate": "q3_deg", "terms": [{"axis": "J2_deg", "factor": 1.0}, {"axis": "J3_deg", "factor": 1.0}]}
GEARED = {"coordinate": "q6_deg", "terms": [{"axis": "J6_deg", "factor": 1.0}, {"axis": "J4_deg", "factor": -0.25}]}


def described(**controller: Any) -> ModelDescription:
    data = load_description("kr60-3").model_dump(by_alias=True, exclude_none=True)
    return ModelDescription.model_validate(data | {"controller": controller})


def robot_with(*angle: dict[str, Any]) -> Robot:
    return robot_from(described(axes=AXES, angle=angle))


def table(path: Path, header: str, row: str) -> Path:
    path.write_text(f"{header},fz_N,dz_mm\n{row},-500,-1.0\n", encoding="utf-8")
    return path


def test_a_table_may_have_the_controllers_angles(tmp_path: Path) -> None:
    robot = robot_with(FANUC)
    m = read_measurements(table(tmp_path / "t.csv", ",".join(AXES), "10,-80,90,1,2,3"), robot)
    np.testing.assert_allclose(np.degrees(m.q), [[10, -80, 10, 1, 2, 3]])


def test_both_conventions_in_a_row_must_agree(tmp_path: Path) -> None:
    robot, header = robot_with(FANUC), "J2_deg,J3_deg,q2_deg,q3_deg"
    m = read_measurements(table(tmp_path / "good.csv", header, "-80,90,-80,10"), robot)
    np.testing.assert_allclose(np.degrees(m.q[0, 1:3]), [-80, 10])
    with pytest.raises(InputError, match="q3_deg"):
        read_measurements(table(tmp_path / "bad.csv", header, "-80,90,-80,90"), robot)


def test_a_sheet_shows_both_and_comes_back_the_same(tmp_path: Path) -> None:
    robot = robot_with(FANUC, GEARED)
    q = np.radians([[5.0, -60.0, 20.0, 7.0, 8.0, 9.0]])
    protocol = Protocol(np.array([500.0]), np.array([[0.0, 0.0, -1.0]]))
    sheet = table_to_fill("sheet", q, protocol.directions, ("S1",), protocol)
    write_measurements(sheet, tmp_path / "sheet.csv", robot, to_fill=protocol.columns)
    assert (tmp_path / "sheet.csv").read_text().startswith("pose," + ",".join(AXES))
    again, columns = read_set_ups(tmp_path / "sheet.csv", robot)
    assert columns == ("dz_mm",)
    np.testing.assert_allclose(again.q, q, atol=1e-12)


def test_a_pose_is_given_in_one_of_the_two() -> None:
    robot = robot_with(FANUC)
    np.testing.assert_allclose(
        np.degrees(pose_of(robot, POSE.of("J2_deg=-80,J3_deg=90", "--pose"), "--pose"))[1:3], [-80, 10]
    )
    np.testing.assert_allclose(
        np.degrees(pose_of(robot, POSE.of("q2_deg=-80,q3_deg=10", "--pose"), "--pose"))[1:3], [-80, 10]
    )
    with pytest.raises(InputError, match="beside"):
        pose_of(robot, POSE.of("J2_deg=-80,q3_deg=10", "--pose"), "--pose")


def test_a_parallelograms_motor_turns_the_forearm_against_the_carousel() -> None:
    # The interior elbow angle of the xr701 from its motors: q3real = 180 + p2 - p3.
    data = load_description("xr701").model_dump(by_alias=True, exclude_none=True)
    terms = [{"axis": "J2_deg", "factor": 1.0}, {"axis": "J3_deg", "factor": -1.0}]
    offset = {"value": 180.0, "unit": "deg", "source": "definition"}
    row = {"coordinate": "q3real_deg", "terms": terms, "offset": offset}
    robot = robot_from(ModelDescription.model_validate(data | {"controller": {"axes": AXES, "angle": [row]}}))
    assert robot.controller is not None
    p = np.radians([[0.0, 5.0, 107.5, 0.0, 0.0, 0.0]])
    np.testing.assert_allclose(np.degrees(robot.controller.model(p))[0, 1:3], [5.0, 77.5])
    np.testing.assert_allclose(robot.controller.controller(robot.controller.model(p)), p)


def test_the_uncoupled_convention_is_among_the_candidates() -> None:
    given = described(axes=AXES, angle=[FANUC, GEARED])
    effects = {e.code: e for e in frame_effects(Arm.of(given, "rigid").model)}
    # J3 is the joint's own angle: the share -1 of the angle before it. Axes 4 and 6 are not parallel neighbours.
    assert "angle-coupling:j3" in effects
    assert "angle-uncoupled:j3" not in effects
    assert "angle-uncoupled:j6" in effects


def test_programs_count_as_the_model_file_says() -> None:
    base = {"xyz": {"value": [0, 0, 670], "unit": "mm", "source": "assumed"}}
    given = described(axes=AXES, angle=[FANUC], formats=["rapid"], base=base)
    robot = robot_from(given)
    convention = convention_for(robot, 0, "rapid", None)
    q = np.radians([[1.0, -50.0, 40.0, 4.0, 5.0, 6.0]])
    np.testing.assert_allclose(convention.controller_deg(q), [[1, -50, 90, 4, 5, 6]], atol=1e-12)
    np.testing.assert_allclose(convention.radians(convention.controller_deg(q)), q, atol=1e-12)
    assert convention.T_base is not None
    np.testing.assert_allclose(convention.T_base[:3, 3], [0, 0, 0.67])
    with pytest.raises(InputError, match="joint convention"):
        convention_for(robot, 0, "val3", None)


SAME = {"coordinate": "q3_deg", "terms": [{"axis": "q2_deg", "factor": 1}, {"axis": "q3_deg", "factor": 1}]}


@pytest.mark.parametrize(
    ("controller", "said"),
    [
        ({"axes": AXES[:5]}, "6 different names"),
        ({"axes": [*AXES[:5], "J1_deg"]}, "6 different names"),
        ({"axes": AXES, "angle": [FANUC | {"coordinate": "q9_deg"}]}, "q9_deg"),
        ({"axes": AXES, "angle": [{"coordinate": "q3_deg", "terms": [{"axis": "J9_deg", "factor": 1}]}]}, "J9_deg"),
        ({"axes": AXES, "angle": [{"coordinate": "q3_deg", "terms": [{"axis": "J2_deg", "factor": 1}]}]}, "determine"),
        ({"angle": [FANUC]}, "no axes"),
        ({"axes": ["J1_deg", "q2_deg", "q3_deg", "J4_deg", "J5_deg", "J6_deg"], "angle": [SAME]}, "same name"),
    ],
)
def test_a_table_that_makes_no_sense_is_one_message(controller: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        robot_from(described(**controller))


def test_models_without_a_controller_keep_their_hash() -> None:
    # Surrogates and calibrations name the model by it.
    assert content_hash(load_description("kr60-3")) == KR60_HASH
