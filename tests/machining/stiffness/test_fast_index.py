"""Compiled sweeps against the way of inverse kinematics and statics: same postures, same reasons, same values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import oracles
import pytest
from posture_cases import dome, dome_task, part, spindle
from rigid_frames import rigid_frame
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import fem
from machining.posture.points import GammaRange, Sweep, best_postures, sweep_gamma
from machining.stiffness import compiled as fast_index
from machining.stiffness.objective import Objective
from machining.task import Task, tool_path
from robots import InputError, Reason, Robot, forward_kinematics, load_description
from robots.arrays import Array
from robots.inverse.spherical_wrist import spherical_wrist_arm

# Compiling takes its time.
pytestmark = pytest.mark.slow

oracles.load("numba")

F = np.array([200.0, -100.0, 150.0])
COMPILED = ["k_fs", "directional", "rayleigh", "nspi", "displacement", "normal displacement"]
NEVER = 1_000_000_000

Both = Callable[..., tuple[Sweep, Sweep]]


@pytest.fixture
def both(monkeypatch: pytest.MonkeyPatch) -> Both:
    """Sweep the compiled way and the other."""

    def run(model: fem.ArmModel, task: Task, objective: Objective, gamma: Array) -> tuple[Sweep, Sweep]:
        sweeps = []
        for fewest in (0, NEVER):
            monkeypatch.setattr(fast_index, "FEWEST", fewest)
            sweeps.append(sweep_gamma(model, task, objective, gamma))
        return sweeps[0], sweeps[1]

    return run


def same_postures(fast: Sweep, plain: Sweep, atol: float) -> None:
    np.testing.assert_array_equal(fast.reason, plain.reason)
    np.testing.assert_array_equal(fast.valid, plain.valid)
    np.testing.assert_array_equal(fast.sure, plain.sure)
    assert fast.names == plain.names
    np.testing.assert_allclose(fast.q, plain.q, atol=atol, rtol=0.0)  # NaN where there is no solution, in both


@pytest.mark.parametrize("quantity", [*COMPILED, "weakest"])
def test_postures_and_values_are_those_of_the_other_way(kr60: fem.ArmModel, both: Both, quantity: str) -> None:
    fast, plain = both(kr60, dome_task(30), Objective(quantity, F), GammaRange(count=20).angles)
    same_postures(fast, plain, atol=1e-12)
    assert {Reason.FOUND, Reason.LIMITS, Reason.TOO_FAR} <= set(fast.reason.ravel().tolist())
    # Along one direction displacements may cancel.
    rtol = 1e-10 if quantity in ("nspi", "normal displacement") else 1e-12
    np.testing.assert_allclose(fast.value, plain.value, rtol=rtol)


def random_arm(kr60: fem.ArmModel, rng: np.random.Generator, *, right_angles: bool) -> fem.ArmModel:
    """A spherical wrist on three axes with base, offsets, signs, springs, limits and flange at random."""
    twist = np.pi / 2 * rng.choice([-1, 1], 6) if right_angles else rng.uniform(0.4, 2.7, 6)
    twist[2] = rng.choice([0.0, np.pi])
    T = np.tile(np.eye(4), (6, 1, 1))
    T[:, :3, :3] = Rotation.from_euler("zx", np.stack([rng.uniform(-3, 3, 6), twist], axis=1)).as_matrix()
    T[1:4, :3, 3] = rng.normal(size=(3, 3))
    T[0, :3, :3], flange = Rotation.random(random_state=rng).as_matrix(), np.eye(4)
    flange[:3, 3] = rng.normal(size=3)
    limits = np.sort(rng.uniform(-7.0, 7.0, (6, 2)), axis=1) + np.array([0.0, 2.0])
    robot = replace(
        kr60.robot,
        T_pre=T,
        R_post=np.tile(np.eye(3), (6, 1, 1)),
        sign=rng.choice([-1.0, 1.0], 6),
        offset=rng.uniform(-3.0, 3.0, 6),
        limits=limits,
        T_last_flange=flange,
    )
    springs = dict(zip(robot.joint_names, rng.uniform(1e5, 1e7, 6), strict=True))
    return replace(kr60, robot=robot).with_springs(springs)


@pytest.mark.parametrize("right_angles", [True, False])
def test_arms_with_any_angles_and_limits(kr60: fem.ArmModel, both: Both, *, right_angles: bool) -> None:
    rng = np.random.default_rng(7)
    seen: set[int] = set()
    for _ in range(6):
        model = random_arm(kr60, rng, right_angles=right_angles)
        assert spherical_wrist_arm(model.robot).exact
        placed = forward_kinematics(model.robot, rng.uniform(-3.0, 3.0, (60, 6)))
        path = tool_path(placed.p_flange, rng.normal(size=(60, 3)), -placed.R_flange[:, :, 2])
        task = Task(path, spindle(), np.eye(4), rng.normal(size=3))
        fast, plain = both(model, task, Objective(), rng.uniform(-3.0, 3.0, (60, 12)))
        # Next to singularities, and in a skew wrist at the edge of its cone, rounding grows.
        same_postures(fast, plain, atol=1e-10)
        np.testing.assert_allclose(fast.value, plain.value, rtol=1e-10)
        seen |= set(fast.reason.ravel().tolist())
    wanted = {Reason.FOUND, Reason.LIMITS, Reason.TOO_FAR, Reason.TOO_NEAR, Reason.SHOULDER}
    assert wanted <= seen
    assert right_angles or Reason.ORIENTATION in seen


def at_pose(robot: Robot, q: Array) -> Task:
    """One point whose tool is the flange; at gamma 0 it is placed as by q."""
    placed = forward_kinematics(robot, q[None])
    T = rigid_frame(placed.p_flange[0], placed.R_flange[0])
    along = tool_path(np.zeros((1, 3)), [[0.3, 0.2, 1.0]], [0.0, 0.0, -1.0])
    return Task(along, np.eye(4), T, np.array([1.0, 0.0, 0.0]))


def stretched(robot: Robot) -> float:
    """Angle of joint 3 that brings the wrist centre farthest from axis 2."""
    arm = spherical_wrist_arm(robot)
    q3, middle = -arm.elbow_zero * arm.sign3, robot.limits[2].mean()
    return float(q3 + 2.0 * np.pi * np.round((middle - q3) / (2.0 * np.pi)))


def equal_links(kr60: fem.ArmModel) -> fem.ArmModel:
    """Upper arm as long as the forearm, so that the wrist centre can lie on axis 2; limits that let it."""
    T, limits = kr60.robot.T_pre.copy(), kr60.robot.limits.copy()
    T[2, 0, 3] = spherical_wrist_arm(kr60.robot).fore
    limits[2] = -7.0, 7.0
    return replace(kr60, robot=replace(kr60.robot, T_pre=T, limits=limits))


def over_axis_1(robot: Robot, q: Array) -> Array:
    """The pose with joint 3 changed so that the wrist centre lies on axis 1."""

    def radius(q3: float) -> float:
        placed = forward_kinematics(robot, np.array([[0.0, q[1], q3, 0.0, 0.0, 0.0]]))
        return float(placed.p[0, 4, 0])

    grid = np.linspace(*robot.limits[2], 40)
    sides = np.sign([radius(q3) for q3 in grid])
    first = int(np.flatnonzero(sides[1:] != sides[:-1])[0])
    return np.array([q[0], q[1], brentq(radius, grid[first], grid[first + 1], xtol=1e-15), *q[3:]])


@pytest.mark.parametrize("kind", ["straight wrist", "stretched", "both", "over axis 1", "on axis 2"])
def test_singular_targets(kr60: fem.ArmModel, both: Both, kind: str) -> None:
    model = equal_links(kr60) if kind == "on axis 2" else kr60
    robot, objective = model.robot, Objective()
    q = np.random.default_rng(5).uniform(robot.limits[:, 0], robot.limits[:, 1], (15, 6))
    if kind in ("straight wrist", "both"):
        q[:, 4] = 0.0
    if kind in ("stretched", "both"):
        q[:, 2] = stretched(robot)
    if kind == "over axis 1":
        q[:, 1] = np.linspace(-1.9, -1.6, 15)
        q = np.stack([over_axis_1(robot, pose) for pose in q])
    if kind == "on axis 2":
        q[:, 2] = stretched(robot) + np.pi
    found = 0
    for pose in q:
        task = at_pose(robot, pose)
        fast, plain = both(model, task, objective, np.zeros(1))
        np.testing.assert_array_equal(fast.reason, plain.reason)
        mine, point = fast.q[fast.valid], np.zeros(int(fast.valid.sum()), dtype=np.int64)
        found += len(mine)
        # A double root spreads rounding of 1e-16 to 1e-8, and behind a stretched arm a straight wrist may stand
        # anyhow. So there each way only has to be true to itself: the target is met, the value is that of its angles.
        if kind != "both":
            turns = (mine - plain.q[plain.valid] + np.pi) % (2.0 * np.pi) - np.pi
            np.testing.assert_allclose(turns, 0.0, atol=1e-6)
            np.testing.assert_allclose(fast.value, plain.value, rtol=1e-6)
        placed = forward_kinematics(robot, mine)
        np.testing.assert_allclose(placed.p_flange, np.tile(task.T_base_part[:3, 3], (len(mine), 1)), atol=1e-9)
        np.testing.assert_allclose(placed.R_flange, np.tile(task.T_base_part[:3, :3], (len(mine), 1, 1)), atol=1e-9)
        own = objective.values(model, mine, task, point)
        np.testing.assert_allclose(fast.value[fast.valid], own, rtol=1e-9)
    assert found >= 15


def test_joints_left_free_take_the_middle_of_their_range(kr60: fem.ArmModel, both: Both) -> None:
    limits = kr60.robot.limits.copy()
    limits[3] += 0.4
    model = replace(kr60, robot=replace(kr60.robot, limits=limits))
    task = at_pose(kr60.robot, np.array([0.3, -1.2, 0.4, 0.0, 0.0, 0.2]))
    fast, plain = both(model, task, Objective(), np.zeros(1))
    same_postures(fast, plain, atol=1e-7)  # double root
    assert fast.q[0, 0, 0, 3] == pytest.approx(0.4, abs=1e-12)
    assert fast.q[0, 0, 0, 4] == pytest.approx(0.0, abs=1e-7)


def test_a_flip_of_the_wrist_changes_nothing_if_its_axes_are_square(kr60: fem.ArmModel, both: Both) -> None:
    skew = random_arm(kr60, np.random.default_rng(3), right_angles=False)
    task, wide = dome_task(20), np.tile([-7.0, 7.0], (6, 1))
    task_of_skew = Task(dome(20), np.eye(4), np.eye(4))
    for model, place, same in ((kr60, task, True), (skew, task_of_skew, False)):
        free = replace(model, robot=replace(model.robot, limits=wide))
        value = both(free, place, Objective(), GammaRange(count=12).angles)[0].value
        pairs = value.reshape(-1, 2)[np.isfinite(value.reshape(-1, 2)).all(axis=1)]
        assert len(pairs) >= 10
        assert np.allclose(pairs[:, 0], pairs[:, 1], rtol=1e-11) == same


def test_neither_threads_nor_place_change_a_digit(kr60: fem.ArmModel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fast_index, "FEWEST", 0)
    task, angles = dome_task(97), GammaRange(count=73).angles
    sweeps = []
    for workers, share in ((1, 8), (2, 8), (3, 1), (2, 100)):
        monkeypatch.setattr(fast_index, "threads", lambda workers=workers: workers)
        monkeypatch.setattr(fast_index, "SHARE", share)
        sweeps.append(sweep_gamma(kr60, task, Objective(), angles))
    for other in sweeps[1:]:
        np.testing.assert_array_equal(other.q, sweeps[0].q)
        np.testing.assert_array_equal(other.value, sweeps[0].value)
        np.testing.assert_array_equal(other.reason, sweeps[0].reason)
    later = sweep_gamma(kr60, task, Objective(), angles[5:])
    np.testing.assert_array_equal(later.q, sweeps[0].q[:, 5:])
    np.testing.assert_array_equal(later.value, sweeps[0].value[:, 5:])


def test_large_sweeps_take_the_compiled_way_and_find_the_same_best(
    kr60: fem.ArmModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    task, gammas = dome_task(80), GammaRange()
    assert task.path.n * gammas.count >= fast_index.FEWEST
    assert fast_index.fast_sweep(kr60, task, "k_fs", None, np.broadcast_to(gammas.angles, (80, 72))) is not None
    found = best_postures(kr60, task, Objective(), gammas, starts=0)
    monkeypatch.setattr(fast_index, "kernels", lambda: None)
    plain = best_postures(kr60, task, Objective(), gammas, starts=0)
    np.testing.assert_allclose(found.value, plain.value, rtol=1e-12)
    # Flips are equally good here, and rounding decides between them.
    np.testing.assert_array_equal(found.gamma, plain.gamma)
    np.testing.assert_array_equal(found.branch // 2, plain.branch // 2)


def test_flexible_links_have_compiled_joint_angles_only(both: Both) -> None:
    beams = fem.build_model(load_description("kr60-3"), links="beam")
    assert fast_index.axial_compliance(beams) is None
    fast, plain = both(beams, dome_task(5), Objective(), GammaRange(count=8).angles)
    same_postures(fast, plain, atol=1e-12)
    np.testing.assert_allclose(fast.value, plain.value, rtol=1e-11)  # of angles that differ by 1e-14


def test_other_springs_are_not_taken_for_constant_ones(kr60: fem.ArmModel) -> None:
    joint = kr60.joints[2]
    bearing = np.zeros((6, 6))
    bearing[3, 3] = 1e-7
    for changed in (replace(joint, bearing=bearing), replace(joint, housing=bearing)):
        joints = (*kr60.joints[:2], changed, *kr60.joints[3:])
        assert fast_index.axial_compliance(replace(kr60, joints=joints)) is None
    assert fast_index.axial_compliance(replace(kr60, base=bearing)) is None
    assert fast_index.axial_compliance(replace(kr60, tool=bearing)) is None
    np.testing.assert_allclose(
        fast_index.axial_compliance(kr60), [1.0 / joint.axial.stiffness for joint in kr60.joints], rtol=1e-15
    )


def test_what_is_not_compiled_goes_the_other_way(kr60: fem.ArmModel, monkeypatch: pytest.MonkeyPatch) -> None:
    gamma = np.broadcast_to(GammaRange(count=8).angles, (3, 8))
    assert fast_index.fast_sweep(kr60, dome_task(3), "k_fs", None, gamma) is None  # too few
    monkeypatch.setattr(fast_index, "FEWEST", 0)
    coupled = fem.build_model(load_description("xr701"), links="rigid")
    assert coupled.robot.couplings
    assert fast_index.fast_sweep(coupled, dome_task(3), "k_fs", None, gamma) is None
    rounded = part()
    rounded[:3, :3] = Rotation.from_euler("xyz", [0.1, 0.2, 0.3]).as_matrix().round(8)
    task = Task(dome(3), spindle(), rounded)
    assert fast_index.fast_sweep(kr60, task, "k_fs", None, gamma) is None
    assert sweep_gamma(kr60, task, Objective(), gamma).valid.any()


def test_a_rigid_arm_is_refused_in_the_same_words(
    kr60: fem.ArmModel, both: Both, monkeypatch: pytest.MonkeyPatch
) -> None:
    rigid = kr60.with_rigid_joints()
    for fewest in (0, NEVER):
        monkeypatch.setattr(fast_index, "FEWEST", fewest)
        with pytest.raises(InputError, match=r"k_fs at path point 0: got .not finite"):
            sweep_gamma(rigid, dome_task(3), Objective(), np.zeros(1))
