"""The library's arms against figures worked out by pinocchio from the published descriptions themselves.

``data/library_poses.csv`` holds two random poses of each arm within its limits, with position and orientation (unit
quaternion, scalar first) of the description's tool0 (or last) frame in its base frame. They were worked out once, by
pinocchio 4.1 on the joints' origins and axes as published; each arm's file says in [sources] which repository, file and
commit that was. So the figures here share no code with the model files, which have their frames laid out anew.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from robots import bundled_names, forward_kinematics, library_names, load_description, load_robot
from robots.robot import robot_from

ROWS = list(csv.DictReader((Path(__file__).parent / "data/library_poses.csv").open(encoding="utf-8")))
# Descriptions that write right angles as 1.5708 or 3.1416 are off by up to 7e-6 rad a joint; the model files are not.
ROUNDED = {"kr120-r2700-2", "ns16-hand", "nj220"}


def _columns(rows: list[dict[str, str]], *names: str) -> np.ndarray:
    return np.array([[float(row[name]) for name in names] for row in rows])


def test_every_arm_of_the_library_has_figures() -> None:
    assert {row["arm"] for row in ROWS} == set(library_names())
    assert len(library_names()) >= 25
    assert not set(library_names()) & set(bundled_names())


@pytest.mark.parametrize("name", sorted({row["arm"] for row in ROWS}))
def test_positions_and_orientations_are_those_of_the_published_description(name: str) -> None:
    rows = [row for row in ROWS if row["arm"] == name]
    robot = load_robot(name)
    q = np.radians(_columns(rows, *robot.coordinates))
    assert robot.reachable(q).all()
    T = forward_kinematics(robot, q).T_flange
    slack = 100.0 if name in ROUNDED else 1.0
    np.testing.assert_allclose(T[:, :3, 3] * 1e3, _columns(rows, "x_mm", "y_mm", "z_mm"), atol=2e-3 * slack)
    w, x, y, z = _columns(rows, "qw", "qx", "qy", "qz").T
    R = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    np.testing.assert_allclose(T[:, :3, :3], np.moveaxis(R, -1, 0), atol=1e-6 * slack)


def test_every_figure_has_a_source_with_its_licence_and_no_spring_is_made_up() -> None:
    for name in library_names():
        arm = load_description(name)
        assert arm.payload is not None
        assert any(licence in arm.sources["urdf"] for licence in ("Apache", "BSD", "MIT"))
        assert all(joint.stiffness is None for joint in arm.joint)
        assert not {"assumed", "derived"} & {joint.limits.source for joint in arm.joint}


def test_a_fanuc_counts_its_third_angle_from_the_horizontal() -> None:
    robot = robot_from(load_description("r2000ic-270f"))
    assert robot.controller is not None
    p = np.radians([[10.0, 35.0, -20.0, 5.0, 6.0, 7.0], [10.0, 5.0, -20.0, 5.0, 6.0, 7.0]])
    forearm = forward_kinematics(robot, robot.controller.model(p)).R[:, 3]
    np.testing.assert_allclose(forearm[0], forearm[1], atol=1e-12)
    np.testing.assert_allclose(robot.controller.controller(robot.controller.model(p)), p, atol=1e-12)
