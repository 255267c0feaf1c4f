"""Which poses can be taken, and what is said about those that cannot."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses

from robots import bundled_names, load_description, load_robot
from robots.robot import LIMIT_TOLERANCE_RAD


def xr701_pose(q2_deg: float, q3real_deg: float) -> np.ndarray:
    return np.radians([0.0, q2_deg, q3real_deg, 0.0, 0.0, 0.0])


def forearm_limits_deg() -> tuple[float, float]:
    """Read from the file as it stands: the paper only brackets them (30 is out, 67.5 and 185 are in)."""
    limits = load_description("xr701").coupling[0].limits
    assert limits.unit == "deg"
    assert isinstance(limits.value, tuple)
    lower, upper = limits.value
    assert 30.0 < lower <= 67.5
    assert upper >= 185.0
    return lower, upper


# The paper's Table 2, where bracketed q3real levels stand in for those that cannot be taken.
TABLE_2 = [
    (-35, 40, True),
    (-35, 60, True),
    (-35, 77.5, True),
    (-35, 115, False),
    *[(q2, q3real, True) for q2 in (5, 45) for q3real in (40, 77.5, 115)],
]


@pytest.mark.parametrize(("q2_deg", "q3real_deg", "exists"), TABLE_2)
def test_the_papers_table_2(q2_deg: float, q3real_deg: float, exists: bool) -> None:
    pose = xr701_pose(q2_deg, q3real_deg)
    assert load_robot("xr701").reachable(pose[None]).tolist() == [exists]


def test_the_81_poses_of_the_adjusted_factorial_exist() -> None:
    levels = {-35: (40, 60, 77.5), 5: (40, 77.5, 115), 45: (40, 77.5, 115)}
    poses = [
        [0, q2, q3real, q4, q5, 0]
        for q2, q3s in levels.items()
        for q3real, q4, q5 in itertools.product(q3s, (-200, 0, 200), (-100, 0, 100))
    ]
    assert load_robot("xr701").reachable(np.radians(poses)).tolist() == [True] * 81


def test_the_coupled_limit_is_explained_with_its_sum() -> None:
    lower_deg, upper_deg = forearm_limits_deg()
    messages = load_robot("xr701").violations(xr701_pose(-35, 115))
    # 180 - 35 - 115 = 30.
    assert messages == [
        f"forearm_deg = 30 is outside {lower_deg:g} to {upper_deg:g} deg (forearm_deg = 180 +1 q2_deg -1 q3real_deg)"
    ]


def test_every_broken_limit_is_named() -> None:
    messages = load_robot("kr60-3").violations(np.radians([186.0, 0.0, 69.0, 0.0, -120.0, 0.0]))
    assert [message.split(" = ")[0] for message in messages] == ["q1_deg", "q3_deg", "q5_deg"]
    assert messages[0] == "q1_deg = 186 is outside -185 to 185 deg"


@pytest.mark.parametrize("name", bundled_names())
def test_a_joint_limit_can_be_taken_and_a_step_beyond_cannot(name: str) -> None:
    robot = load_robot(name)
    home = np.radians([0.0, 5.0, 77.5, 0.0, 0.0, 0.0]) if name == "xr701" else np.zeros(robot.dof)
    assert robot.violations(home) == []
    # The tolerance is there for rounding; a thousand times of it is a real violation.
    beyond = 1e3 * LIMIT_TOLERANCE_RAD
    for joint, outwards in itertools.product(range(robot.dof), (-1, 1)):
        on_limit = home.copy()
        on_limit[joint] = robot.limits[joint, (outwards + 1) // 2]
        assert robot.violations(on_limit) == []
        assert robot.reachable(on_limit[None]).all()
        over = on_limit.copy()
        over[joint] += outwards * beyond
        assert not robot.reachable(over[None]).any()
        assert robot.coordinates[joint] in robot.violations(over)[0]


@pytest.mark.parametrize("name", ["kr60-3", "tx200"])
def test_without_couplings_every_corner_of_the_limits_is_reachable(name: str) -> None:
    robot = load_robot(name)
    assert robot.couplings == ()
    assert robot.reachable(np.array(list(itertools.product(*robot.limits)))).all()


@pytest.mark.parametrize("q2_deg", [-35.0, -33.3, -30.7, -76.0 / 3.0, -20.0])
def test_a_pose_on_the_coupled_limit_is_reachable(q2_deg: float) -> None:
    robot = load_robot("xr701")
    q3real_deg = 180.0 + q2_deg - forearm_limits_deg()[0]
    # On the limit by hand; the sum in radians need not round to it.
    assert robot.reachable(xr701_pose(q2_deg, q3real_deg)[None]).all()
    assert not robot.reachable(xr701_pose(q2_deg, q3real_deg + 1e-4)[None]).any()


# Where each coordinate stands in its range: inside, on the ends, or beyond them.
PLACES = st.lists(st.sampled_from([0.0, 1.0]) | st.floats(-0.05, 1.05), min_size=6, max_size=6)


@pytest.mark.slow
@pytest.mark.parametrize("name", bundled_names())
@given(places=PLACES)
def test_reachable_exactly_when_nothing_is_violated(name: str, places: list[float]) -> None:
    robot = load_robot(name)
    lower, upper = robot.limits.T
    q = lower + np.array(places) * (upper - lower)
    assert bool(robot.reachable(q[None])[0]) == (robot.violations(q) == [])


@pytest.mark.slow
@given(places=PLACES)
def test_reachable_means_inside_every_range(places: list[float]) -> None:
    """Worked out in degrees from the paper's ranges and the file's assumed ones."""
    forearm_lower, forearm_upper = forearm_limits_deg()
    lower = np.array([-160.0, -35.0, 40.0, -200.0, -100.0, -270.0])
    upper = np.array([160.0, 45.0, 115.0, 200.0, 100.0, 270.0])
    q_deg = lower + np.array(places) * (upper - lower)
    forearm_deg = 180.0 + q_deg[1] - q_deg[2]
    # How far the pose is inside the nearest limit; within 1e-6 deg of it rounding decides.
    to_ranges = min((q_deg - lower).min(), (upper - q_deg).min())
    margin = min(to_ranges, forearm_deg - forearm_lower, forearm_upper - forearm_deg)
    if abs(margin) > 1e-6:
        assert bool(load_robot("xr701").reachable(np.radians(q_deg)[None])[0]) == (margin > 0.0)


def test_nan_is_never_reachable_and_is_named() -> None:
    robot = load_robot("xr701")
    for joint, name in enumerate(robot.coordinates):
        pose = xr701_pose(5, 77.5)
        pose[joint] = np.nan
        assert not robot.reachable(pose[None]).any()
        assert any(message.startswith(f"{name} = nan") for message in robot.violations(pose))


@pytest.mark.parametrize("shape", [(6,), (3, 5)])
def test_reachable_refuses_the_wrong_shape(shape: tuple[int, ...]) -> None:
    refuses("B001", r"pose array for xr701.*\(n, 6\) in rad", load_robot("xr701").reachable, np.zeros(shape))


def test_an_unknown_coordinate_lists_the_known_ones() -> None:
    refuses("B003", r"'q3_deg'; allowed: q1_deg, q2_deg, q3real_deg", load_robot("xr701").coordinate_index, "q3_deg")
