"""Which pose stands at a point: held to closed forms, to each other and to brute force."""

from __future__ import annotations

import numpy as np
import pytest
from map_arms import DOWN, K1, K2, L1, L2, box_layout, cylinder_layout, engine, kr60, one_spring, planar, slice_layout
from refusals import refuses
from rigid_frames import rigid_frame
from scipy.spatial.transform import Rotation

import fem
from machining.task import Task, tool_path
from robots import Robot, forward_kinematics, inverse_kinematics, singularity_distance, tool_position
from robots.arrays import Array
from robots.inverse.singularities import NEAR_SINGULAR
from surrogate.maps.candidates import Arm
from surrogate.maps.layouts import points_of
from surrogate.maps.orientation import directions, spread_rotations, tool_rotations
from surrogate.maps.poses import BestGamma, Extreme, away_from_singular, check_robot, last_joint_is_free, shortfall

UP = np.array([0.0, 0.0, 1.0])
OFF_AXIS = rigid_frame((0.1, 0.02, 0.2))


def stiffness(model: fem.ArmModel, q: Array, point: Array | None = None) -> Array:
    out = np.full(len(q), np.nan)
    there = np.isfinite(q).all(axis=1)
    out[there] = fem.directional_stiffness(model, q[there], DOWN, point) * 1e-3
    return out


def some_points(model: fem.ArmModel, count: int, rng: np.random.Generator, point: Array | None = None) -> Array:
    robot = model.robot
    q = rng.uniform(*robot.limits.T, (4 * count, robot.dof))
    q = q[robot.reachable(q)][:count]
    return tool_position(robot, forward_kinematics(robot, q), point)


@pytest.mark.parametrize("axis", [UP, -UP, np.array([1.0, 0.0, 0.0]), np.array([0.9, 0.3, -0.2])])
def test_tool_axis_and_gamma_are_those_of_machining_tasks(axis: Array) -> None:
    gamma = np.radians([-170.0, -30.0, 0.0, 75.0])
    task = Task(tool_path(np.zeros((1, 3)), UP, axis / np.linalg.norm(axis)), np.eye(4), np.eye(4))
    np.testing.assert_allclose(tool_rotations(axis, gamma), task.tool_frames(gamma)[0, :, :3, :3], atol=1e-14)


def test_orientations_are_spread_over_the_sphere() -> None:
    axes = directions(100)
    cosine = axes @ axes.T - 2.0 * np.eye(100)
    nearest = np.degrees(np.arccos(cosine.max(axis=1)))
    # An even spread has one axis in 4 pi / 100 sr, some 20 deg apart.
    assert nearest.min() > 12.0
    R = spread_rotations(20, 4)
    np.testing.assert_allclose(R.swapaxes(1, 2) @ R, np.broadcast_to(np.eye(3), R.shape), atol=1e-14)


@pytest.mark.parametrize("rule", [BestGamma(UP, np.zeros(1)), BestGamma(UP, np.radians([0.0, 90.0])), Extreme()])
def test_with_one_spring_the_stiffness_is_that_of_its_lever_whatever_the_pose(
    rule: BestGamma | Extreme,
) -> None:
    k, load = 1e6, np.array([1.0, 0.0, 0.0])
    model = one_spring(k)
    grid = box_layout([900.0, 1200.0], [-300.0, 0.0, 300.0], [500.0, 800.0])
    made = engine(model, grid, rule, direction=load).block(slice(None))
    y = points_of(grid, slice(None))[:, 1]
    there = made["reached"] & (y != 0.0)
    assert there.sum() > 4
    np.testing.assert_allclose(made["stiffness_N_per_mm"][there], k / y[there] ** 2 * 1e-3, rtol=1e-8)


def test_poses_bring_the_tool_to_the_point_with_the_orientation_asked_for(rng: np.random.Generator) -> None:
    model = kr60()
    points = some_points(model, 12, rng, OFF_AXIS[:3, 3])
    arm = Arm(model.robot, OFF_AXIS, lambda q: stiffness(model, q, OFF_AXIS[:3, 3]))
    axis = np.array([0.3, -0.5, 0.8])
    for rule in (
        BestGamma(axis, np.array([0.4])),
        BestGamma(axis, np.radians(np.arange(-180.0, 180.0, 60.0))),
        Extreme(),
    ):
        found = rule.choose(arm, points)
        there = found.reached
        assert there.any()
        assert model.robot.reachable(found.q[there]).all()
        frames = forward_kinematics(model.robot, found.q[there])
        tip = tool_position(model.robot, frames, OFF_AXIS[:3, 3])
        # The search holds the tool point to 1e-11 of the arm's length, 2 m.
        np.testing.assert_allclose(tip, points[there], atol=1e-10)
        if not isinstance(rule, Extreme):
            into_holder = -(frames.R_flange @ OFF_AXIS[:3, :3])[:, :, 2]
            np.testing.assert_allclose(into_holder @ axis / np.linalg.norm(axis), 1.0, atol=1e-9)
    assert there.all()


def test_best_gamma_is_never_worse_than_any_gamma_of_its_grid(rng: np.random.Generator) -> None:
    model = kr60()
    points = some_points(model, 40, rng, OFF_AXIS[:3, 3])
    arm = Arm(model.robot, OFF_AXIS, lambda q: stiffness(model, q, OFF_AXIS[:3, 3]))
    gammas = np.radians(np.arange(-180.0, 180.0, 30.0))
    value = stiffness(model, BestGamma(UP, gammas).choose(arm, points).q, OFF_AXIS[:3, 3])
    one = [stiffness(model, BestGamma(UP, np.array([g])).choose(arm, points).q, OFF_AXIS[:3, 3]) for g in gammas]
    best = np.fmax.reduce(one)
    assert (np.isnan(value) == np.isnan(best)).all()
    assert np.nanmax(best / value) < 1.0 + 1e-12
    # Between the angles there is something to gain somewhere: the refinement does its work.
    assert np.nanmax(value / best) > 1.001
    fine = BestGamma(UP, np.radians(np.arange(-180.0, 180.0, 1.0)), refine=False).choose(arm, points).q
    shares = stiffness(model, fine, OFF_AXIS[:3, 3]) / value
    # One of the 30 deg peaks may hide a higher one between two angles; all but a few are found.
    assert np.nanquantile(shares, 0.9) < 1.0 + 1e-6


def test_gamma_stays_between_its_ends(rng: np.random.Generator) -> None:
    model = kr60()
    points = some_points(model, 40, rng, OFF_AXIS[:3, 3])
    arm = Arm(model.robot, OFF_AXIS, lambda q: stiffness(model, q, OFF_AXIS[:3, 3]))
    found = BestGamma(UP, np.radians([20.0, 50.0, 80.0])).choose(arm, points)
    R = forward_kinematics(model.robot, found.q[found.reached]).R_flange
    inside = tool_rotations(UP, [0.0])[0].T @ R
    gamma = np.degrees(np.arctan2(-inside[:, 1, 0], inside[:, 0, 0]))
    assert len(gamma) > 5
    assert gamma.min() > 20.0 - 1e-6
    assert gamma.max() < 80.0 + 1e-6


def test_stiffest_fixed_and_softest_are_in_that_order(rng: np.random.Generator) -> None:
    model = kr60()
    points = some_points(model, 16, rng)
    arm = Arm(model.robot, model.robot.T_flange_tool, lambda q: stiffness(model, q), last_is_free=True)
    rules = (Extreme("stiffest"), BestGamma(UP, np.zeros(1)), Extreme("softest"))
    most, fixed, least = (stiffness(model, rule.choose(arm, points).q) for rule in rules)
    there = np.isfinite(fixed)
    assert there.sum() > 2
    assert np.isfinite(most).all()
    assert np.isfinite(least).all()
    assert (most[there] >= fixed[there] * (1.0 - 1e-9)).all()
    assert (fixed[there] >= least[there] * (1.0 - 1e-9)).all()


@pytest.mark.parametrize("tool", [None, pytest.param(OFF_AXIS, marks=pytest.mark.slow)])
def test_no_pose_of_a_brute_force_beats_the_extremes(tool: Array | None, rng: np.random.Generator) -> None:
    model = kr60()
    T = model.robot.T_flange_tool if tool is None else tool
    point = T[:3, 3]
    p = some_points(model, 8, rng, point)
    free = last_joint_is_free(model.robot, T, lambda q: fem.compliance(model, q, point)[:, :3, :3])
    assert free == (tool is None)
    arm = Arm(model.robot, T, lambda q: stiffness(model, q, point), free)
    most, least = (stiffness(model, Extreme(w).choose(arm, p).q, point) for w in ("stiffest", "softest"))
    targets = np.zeros((len(p), 4000, 4, 4))
    targets[..., :3, :3] = Rotation.random(4000, rng=rng).as_matrix()
    targets[..., :3, 3], targets[..., 3, 3] = p[:, None], 1.0
    found = inverse_kinematics(model.robot, targets.reshape(-1, 4, 4), T_flange_tool=T)
    value = np.full(found.valid.shape, np.nan)
    value[found.valid] = stiffness(model, found.q[found.valid], point)
    value = value.reshape(len(p), -1)
    # What is stated: peaks to 1e-6, a narrower one may be missed; none is at these points.
    assert (np.nanmax(value, axis=1) <= most * (1.0 + 1e-5)).all()
    assert (np.nanmin(value, axis=1) >= least * (1.0 - 1e-5)).all()
    # The brute force comes near, so the extremes are not beyond what the arm can do; sharp peaks it meets by chance.
    assert np.median(np.nanmax(value, axis=1) / most) > 0.95


@pytest.mark.slow
def test_a_denser_sample_finds_hardly_anything_better(rng: np.random.Generator) -> None:
    model = kr60()
    arm = Arm(model.robot, model.robot.T_flange_tool, lambda q: stiffness(model, q), last_is_free=True)
    for which in ("stiffest", "softest"):
        points = some_points(model, 12, rng)
        found = shortfall(Extreme(which), arm, points, Extreme(which).choose(arm, points).q)
        assert np.nanmax(found) < 1e-3


def test_points_at_the_rim_of_reach_are_not_lost() -> None:
    model = kr60()
    robot = model.robot
    # The tool as far out as it gets with a stretched wrist: few orientations are left there.
    q = np.zeros((1, 6))
    q[0, 1:3] = robot.limits[1, 1], robot.limits[2, 0]
    q = np.clip(q, *robot.limits.T)
    p = tool_position(robot, forward_kinematics(robot, q))
    arm = Arm(robot, robot.T_flange_tool, lambda q: stiffness(model, q), last_is_free=True)
    assert Extreme().choose(arm, p).reached.all()


def test_a_vertical_load_sees_no_difference_around_axis_1() -> None:
    model = kr60()
    grid = cylinder_layout([900.0, 1300.0], np.arange(-120.0, 121.0, 40.0), [600.0, 1000.0])
    for rule in (Extreme(), Extreme("softest")):
        k = np.asarray(engine(model, grid, rule).block(slice(None))["stiffness_N_per_mm"]).reshape(2, -1, 2)
        assert np.isfinite(k).all()
        # Each point is searched by itself, from other orientations: a peak is known to some 1e-5.
        np.testing.assert_allclose(k, np.broadcast_to(k[:, :1], k.shape), rtol=1e-4)


def test_an_arm_without_a_choice_of_orientation_finds_all_its_poses() -> None:
    # Two links reach a point of their plane with the elbow on either side; off the plane they reach nothing.
    model = planar()
    side = np.array([0.0, 1.0, 0.0])
    grid = box_layout([500.0, 700.0], [0.0, 200.0], [0.0, 100.0])
    found = {}
    for which in ("stiffest", "softest"):
        rule = Extreme(which)  # type: ignore[arg-type]
        found[which] = engine(model, grid, rule, direction=side).block(slice(None))
    reached = np.asarray(found["stiffest"]["reached"])
    np.testing.assert_array_equal(reached, [True] * 4 + [False] * 4)
    x, y, _ = points_of(grid, slice(None))[:4].T
    r = np.hypot(x, y)
    turn = np.arccos((r**2 + L1**2 - L2**2) / (2.0 * r * L1)) * np.array([[1.0], [-1.0]])
    elbow = L1 * np.cos(np.arctan2(y, x) + turn)
    k = 1e-3 / (x**2 / K1 + (x - elbow) ** 2 / K2)
    np.testing.assert_allclose(np.asarray(found["stiffest"]["stiffness_N_per_mm"])[:4], k.max(axis=0), rtol=1e-8)
    np.testing.assert_allclose(np.asarray(found["softest"]["stiffness_N_per_mm"])[:4], k.min(axis=0), rtol=1e-8)


def test_random_starts_find_what_the_closed_form_finds(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = kr60()
    arm = Arm(model.robot, model.robot.T_flange_tool, lambda q: stiffness(model, q), last_is_free=True)
    points = some_points(model, 10, rng)
    exact = stiffness(model, Extreme().choose(arm, points).q)
    monkeypatch.setattr("surrogate.maps.poses.why_no_closed_form", lambda robot: "a test says so")
    found = Extreme().choose(arm, points)
    assert not found.sure.any()
    # Both may miss a narrow peak; at most of the points they agree.
    assert np.median(np.abs(stiffness(model, found.q) / exact - 1.0)) < 1e-4


def test_points_out_of_reach_have_no_pose() -> None:
    model = kr60()
    grid = slice_layout("xz", [1000.0, 9000.0], [800.0, 900.0])
    made = engine(model, grid, Extreme()).block(slice(None))
    np.testing.assert_array_equal(made["reached"], [True, False, True, False])
    np.testing.assert_array_equal(np.isnan(made["stiffness_N_per_mm"]), ~made["reached"])
    assert np.isnan(np.asarray(made["q"])[1]).all()


def test_what_is_refused() -> None:
    refuses("R004", r"2 joints.*six joints or more.*map joints", check_robot, planar().robot, any_orientation=False)
    assert check_robot(kr60().robot, any_orientation=False) is None
    assert "may have been missed" in str(check_robot(planar().robot, any_orientation=True))
    refuses("B003", "stiffest, softest", Extreme, "middling")
    refuses(
        "B001",
        "tool axis",
        lambda: BestGamma(np.zeros(3), np.zeros(1)).choose(
            Arm(kr60().robot, np.eye(4), lambda q: stiffness(kr60(), q)), np.zeros((1, 3))
        ),
    )
    refuses("B001", "gamma", BestGamma, UP, np.array([]))


@pytest.mark.slow
def test_the_stiffest_pose_is_not_near_a_singular_one_where_a_point_has_others() -> None:
    """By stiffness alone, poses win in which the force passes through it."""
    model = kr60()
    grid = slice_layout("xz", np.arange(600.0, 1900.0, 300.0), np.arange(300.0, 1600.0, 300.0), 0.0)
    points = points_of(grid)

    def merit(q: Array) -> Array:
        return stiffness(model, q)

    tip = model.robot.T_flange_tool[:3, 3]
    free = Arm(model.robot, model.robot.T_flange_tool, merit, True)
    regular = Arm(model.robot, model.robot.T_flange_tool, away_from_singular(model.robot, tip, merit), True)
    found = [Extreme().choose(arm, points).q for arm in (free, regular)]
    there = np.isfinite(found[0]).all(axis=1)
    assert (np.isfinite(found[1]).all(axis=1) == there).all()
    near = [singularity_distance(model.robot, q[there]).sigma_min < NEAR_SINGULAR for q in found]
    assert near[0].any()
    assert not near[1].any()
    # What is given up for it is little.
    assert np.median(merit(found[1][there]) / merit(found[0][there])) > 0.99


def test_a_point_that_has_only_poses_near_singular_ones_keeps_the_least_singular() -> None:
    robot = kr60().robot
    q = poses_near_singular(robot)
    sigma = singularity_distance(robot, q).sigma_min
    value = away_from_singular(robot, robot.T_flange_tool[:3, 3], lambda q: np.full(len(q), 5.0))(q)
    singular = sigma < NEAR_SINGULAR
    assert singular.any()
    assert not singular.all()
    assert (value[~singular] == 5.0).all()
    assert (value[singular] < 0.0).all()
    assert (np.argsort(value[singular]) == np.argsort(sigma[singular])).all()


def poses_near_singular(robot: Robot) -> Array:
    """Ever nearer to a stretched wrist, joint 5 at 0."""
    q = np.tile(np.radians([0.0, -60.0, 90.0, 30.0, 0.0, 0.0]), (9, 1))
    q[:, 4] = np.radians([30.0, 10.0, 3.0, 1.0, 0.5, 0.3, 0.1, 0.03, 0.01])
    return q
