"""Posture along a path: exact on small paths, never worse than simpler choices, drivable, or said why not."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from posture_cases import SPEED, dome, dome_task, part, spindle
from refusals import refuses
from rigid_frames import rigid_frame

import fem
from machining import evaluate, stiffness_index, translational
from machining.posture.drive import Drive, limit_distance, singular_distance
from machining.posture.path import PathPosture, optimise_path
from machining.posture.points import GammaRange, best_postures, postures_at, sweep_gamma
from machining.posture.problem import is_better
from machining.stiffness.objective import Objective
from machining.task import Task, tool_path
from robots import forward_kinematics, inverse_kinematics, singularity_distance
from robots.arrays import Array

BARE = Drive(jump=np.inf, motion=0.0, limit=0.0, singular=0.0, singular_least=0.0)
F = np.array([200.0, -100.0, 150.0])


@pytest.mark.parametrize("objective", [Objective(), Objective("displacement", F), Objective(aim="worst")])
def test_without_costs_and_limits_it_is_each_points_best(kr60: fem.ArmModel, objective: Objective) -> None:
    task, gammas = dome_task(6), GammaRange(count=24)
    found = optimise_path(kr60, task, objective, gammas, BARE, passes=0)
    best = best_postures(kr60, task, objective, gammas, starts=0)
    worst = np.max if objective.minimised else np.min
    assert found.course.worst == pytest.approx(worst(best.value), rel=1e-12)
    # Equally good branches differ in the last digit.
    np.testing.assert_allclose(found.course.value, best.value, rtol=1e-12)
    np.testing.assert_allclose(found.each_point.value, best.value, rtol=1e-9)
    assert found.course.cost == pytest.approx(-objective.sign * best.value.mean() / found.scale, rel=1e-12)
    assert found.scale == pytest.approx(abs(best.value.mean()), rel=1e-12)


@pytest.mark.parametrize("aim", ["mean", "worst"])
def test_a_small_path_equals_every_course_there_is(kr60: fem.ArmModel, aim: str) -> None:
    """All postures and turns of three points, put together in all ways, straight from the inverse kinematics."""
    task, gammas = dome_task(3, 0.05), GammaRange(-1.0, 1.0, 6)
    jump, weight = np.radians(60.0), 0.3
    drive = Drive(jump=jump, motion=weight, limit=0.0, singular=0.0, singular_least=0.0)
    found = optimise_path(kr60, task, Objective(aim=aim), gammas, drive, passes=0)  # type: ignore[arg-type]

    frames = task.tool_frames(gammas.angles)
    q, k = [], []
    for i in range(3):
        turns = inverse_kinematics(kr60.robot, frames[i], T_flange_tool=spindle()).turns()
        q.append(turns.q)
        k.append(stiffness_index(kr60, turns.q, task.path.normals[i], spindle()[:3, 3]))
    scale = np.mean([values.max() for values in k])
    d01, d12 = q[1] - q[0][:, None], q[2] - q[1][:, None]
    motion = [weight * ((d / jump) ** 2).mean(axis=2) for d in (d01, d12)]
    allowed = [(np.abs(d) <= jump).all(axis=2) for d in (d01, d12)]
    quality = k[0][:, None, None] + k[1][:, None] + k[2]
    cost = (motion[0][:, :, None] + motion[1] - quality / scale) / 3.0
    cost[~(allowed[0][:, :, None] & allowed[1])] = np.inf
    assert 0.0 < np.isfinite(cost).mean() < 0.2
    if aim == "worst":
        lowest = np.minimum(np.minimum(k[0][:, None, None], k[1][:, None]), k[2])
        top = lowest[np.isfinite(cost)].max()
        assert found.course.worst == pytest.approx(top, rel=1e-12)
        # Wrist flips have the same index but for rounding, which the two computations do differently.
        cost[lowest < top * (1.0 - 1e-12)] = np.inf
        assert found.course.cost >= cost.min() - 1e-12
    else:
        assert found.course.cost == pytest.approx(cost.min(), rel=1e-12)


@pytest.fixture(scope="module")
def fed() -> Task:
    """A path of close points at a feed: from point to point no joint can follow a whole cell of gamma."""
    return dome_task(60, 0.5, feed=0.7)


@pytest.fixture(scope="module")
def found(kr60: fem.ArmModel, fed: Task) -> PathPosture:
    return optimise_path(kr60, fed, gammas=GammaRange(count=36), drive=Drive(speed=SPEED), passes=2)


def test_the_course_keeps_speeds_and_limits_and_beats_a_fixed_gamma(
    kr60: fem.ArmModel, fed: Task, found: PathPosture
) -> None:
    course, robot = found.course, kr60.robot
    speed = np.abs(np.diff(course.q, axis=0)) / fed.path.times[:, None]
    assert (speed <= SPEED * (1.0 + 1e-8)).all()
    assert (speed.max(axis=0) > 0.1 * SPEED).any()
    assert robot.reachable(course.q).all()
    frames = forward_kinematics(robot, course.q)
    tip = frames.p_flange + frames.R_flange @ spindle()[:3, 3]
    np.testing.assert_allclose(tip, fed.path.points + fed.T_base_part[:3, 3], atol=1e-12)
    np.testing.assert_allclose(course.value, stiffness_index(kr60, course.q, fed.normals, spindle()[:3, 3]), rtol=1e-12)
    assert found.fixed is not None
    assert course.cost < found.fixed.cost
    assert np.ptp(found.fixed.gamma) == 0.0
    assert np.ptp(course.gamma) > 0.0
    assert course.mean <= found.each_point.mean
    np.testing.assert_allclose(course.smoothness.peak_speed, speed.max(axis=0), rtol=1e-12)
    assert course.smoothness.undrivable == ()


def test_finer_grids_never_make_it_worse(kr60: fem.ArmModel) -> None:
    task = dome_task(20, 0.2, feed=0.5)
    costs = [
        optimise_path(kr60, task, gammas=GammaRange(count=18), drive=Drive(speed=SPEED), passes=n).course.cost
        for n in range(3)
    ]
    assert costs[0] > costs[1] > costs[2]


def test_gamma_travels_far_where_single_steps_are_short(fed: Task, found: PathPosture) -> None:
    """Between close points a joint has time for half a cell; the optimum moves by ten cells along the path."""
    cell = GammaRange(count=36).cell
    assert (SPEED * np.median(fed.path.times) < cell).all()
    assert np.ptp(np.unwrap(found.course.gamma)) > 5 * cell
    assert found.fixed is not None
    assert found.course.mean > 1.02 * found.fixed.mean
    assert found.course.smoothness.undrivable == ()


def test_joints_turn_on_beyond_half_a_turn(kr60: fem.ArmModel) -> None:
    """Joint 6 passes 180 deg on the way: the next equivalent angle, not the one in the middle of its range."""
    along = rigid_frame((0.0, 0.0, 0.15))
    q0 = np.radians([[10.0, -60.0, 40.0, 20.0, 40.0, 180.0]])
    frames = forward_kinematics(kr60.robot, q0)
    R, tip = frames.R_flange[0], frames.p_flange[0] + 0.15 * frames.R_flange[0, :, 2]
    points = tip + np.linspace(-0.2, 0.2, 9)[:, None] * np.array([0.0, 1.0, 0.0])
    task = Task(tool_path(points, -R[:, 2]), along, np.eye(4), R[:, 0])
    limits = kr60.robot.limits.copy()
    limits[3] = np.radians([-60.0, 60.0])  # the wrist flip, with joint 6 near 0, is out of reach
    narrow = replace(kr60, robot=replace(kr60.robot, limits=limits))
    course = optimise_path(narrow, task, gammas=GammaRange(-1e-3, 1e-3, 3), passes=0).course
    assert course.smoothness.undrivable == ()
    turn = np.abs(course.q[:, 5])
    assert turn.min() < np.pi - 0.02
    assert turn.max() > np.pi + 0.02


def test_the_worst_point_comes_before_the_cost(kr60: fem.ArmModel) -> None:
    task, gammas = dome_task(4), GammaRange(count=12)
    for objective, lower_is_better in ((Objective(aim="worst"), False), (Objective("displacement", F, "worst"), True)):
        course = optimise_path(kr60, task, objective, gammas, BARE, passes=0).course
        problem = SimpleNamespace(objective=objective)
        up, down = (replace(course, worst=course.worst * f, cost=course.cost) for f in (1.1, 0.9))
        better, worse = (down, up) if lower_is_better else (up, down)
        assert is_better(problem, replace(better, cost=9.0), course)  # type: ignore[arg-type]
        assert not is_better(problem, replace(worse, cost=-9.0), course)  # type: ignore[arg-type]
        assert not is_better(problem, course, course)  # type: ignore[arg-type]
        assert is_better(problem, replace(course, cost=course.cost - 1.0), course)  # type: ignore[arg-type]


def test_a_lower_speed_costs_and_a_feed_too_high_is_refused(kr60: fem.ArmModel) -> None:
    gammas = GammaRange(count=18)
    fast, slow = (
        optimise_path(kr60, dome_task(30, 0.3, feed=feed), gammas=gammas, drive=Drive(speed=SPEED, motion=0.0))
        for feed in (1.0, 0.01)
    )
    assert fast.course.cost > slow.course.cost
    refuses(
        "G003",
        r"cannot be driven from point \d+ to \d+.* would have to move",
        optimise_path,
        kr60,
        dome_task(40, 0.3, feed=30.0),
        gammas=gammas,
        drive=Drive(speed=SPEED),
    )


def past_a_wrist_singularity(model: fem.ArmModel, T_flange_tool: Array, miss_deg: float) -> Task:
    """Fixed tip; the tool swings by 1 deg a point through a pose with the wrist straight, missing it by a little.

    The tip moves by 0.1 mm a point, because a path needs a direction.
    """
    q0 = np.radians([[10.0, -60.0, 40.0, 0.0, 0.0, 0.0]])
    frames = forward_kinematics(model.robot, q0)
    T = rigid_frame(frames.p_flange[0], frames.R_flange[0])
    T = T @ T_flange_tool
    swing, miss = np.radians(np.arange(-15.0, 16.0)), np.radians(miss_deg)
    x, y, axis = T[:3, 0], T[:3, 1], -T[:3, 2]
    axes = axis + np.tan(swing)[:, None] * x + np.tan(miss) * y
    points = T[:3, 3] + 1e-4 * np.arange(-15.0, 16.0)[:, None] * x
    return Task(tool_path(points, axes), T_flange_tool, np.eye(4), x)


def test_a_wrist_singularity_that_gamma_cannot_avoid_is_said(kr60: fem.ArmModel) -> None:
    """With the tool along the flange's axis gamma only turns joint 6."""
    along = rigid_frame((0.0, 0.0, 0.15))
    missed = past_a_wrist_singularity(kr60, along, 0.4)
    refuses(
        "G003",
        r"cannot be driven from point 1\d to 1\d.*nearest singularity there 0.0",
        optimise_path,
        kr60,
        missed,
        gammas=GammaRange(count=8),
    )
    refuses(
        "G002",
        r"point 15 .*too near to a singularity",
        optimise_path,
        kr60,
        past_a_wrist_singularity(kr60, along, 0.0),
        gammas=GammaRange(count=8),
    )


def test_a_wrist_singularity_that_gamma_can_avoid_is_avoided(kr60: fem.ArmModel) -> None:
    across = past_a_wrist_singularity(kr60, spindle(), 0.0)
    near = GammaRange(np.radians(-0.5), np.radians(0.5), 3)
    drive = Drive(singular_least=0.05)
    refuses("G002", "too near to a singularity", optimise_path, kr60, across, gammas=near, drive=drive)
    found = optimise_path(kr60, across, gammas=GammaRange(count=36), drive=drive).course
    assert found.smoothness.undrivable == ()
    away = singularity_distance(kr60.robot, found.q)
    assert min(np.sin(away.wrist_rad).min(), np.sin(away.elbow_rad).min()) >= 0.05
    assert found.smoothness.singular_distance >= 0.05


def test_soft_costs_are_what_they_say(kr60: fem.ArmModel) -> None:
    """Cost of a course from its poses, term by term."""
    task = dome_task(8, 0.2)

    def clearance(q: Array) -> Array:
        return np.asarray(0.05 + 0.1 * np.cos(q[:, 0]) ** 2)

    drive = Drive(
        motion=0.2,
        limit=0.3,
        limit_zone=1.5,
        singular=0.4,
        singular_zone=0.9,
        clearance=0.5,
        clearance_zone=0.3,
        clearance_of=clearance,
    )
    found = optimise_path(kr60, task, gammas=GammaRange(count=18), drive=drive, passes=1)
    q = found.course.q
    soft = sum(
        weight * np.maximum(0.0, 1.0 - distance / zone) ** 2
        for weight, zone, distance in (
            (0.3, 1.5, limit_distance(kr60.robot, q)),
            (0.4, 0.9, singular_distance(kr60.robot, q)),
            (0.5, 0.3, clearance(q)),
        )
    )
    motion = 0.2 * ((np.diff(q, axis=0) / drive.jump) ** 2).mean(axis=1).sum()
    assert (soft > 0.0).all()
    cost = (soft.sum() + motion - (found.course.value / found.scale).sum()) / 8
    assert found.course.cost == pytest.approx(cost, rel=1e-12)


def test_clearance_and_limit_margin_are_kept_or_said(kr60: fem.ArmModel) -> None:
    task, gammas = dome_task(5, 0.1), GammaRange(count=36)

    def left(q: Array) -> Array:
        """An obstacle where the free optimum puts joint 6."""
        return np.asarray(np.abs(np.sin(q[:, 5] - q_free[0, 5])))

    q_free = optimise_path(kr60, task, gammas=gammas, drive=Drive(jump=1.0)).course.q
    around = optimise_path(
        kr60, task, gammas=gammas, drive=Drive(jump=1.0, clearance_of=left, clearance_least=0.3)
    ).course
    assert (left(around.q) >= 0.3).all()
    margin = float(limit_distance(kr60.robot, q_free).min()) + 0.05
    kept = optimise_path(kr60, task, gammas=gammas, drive=Drive(jump=1.0, limit_least=margin)).course
    assert (limit_distance(kr60.robot, kept.q) >= margin).all()
    refuses(
        "G002",
        "too near to a joint limit",
        optimise_path,
        kr60,
        task,
        gammas=gammas,
        drive=Drive(jump=1.0, limit_least=3.0),
    )
    refuses(
        "G002",
        "too near to an obstacle",
        optimise_path,
        kr60,
        task,
        gammas=gammas,
        drive=Drive(jump=1.0, clearance_of=left, clearance_least=2.0),
    )
    refuses(
        "G004",
        "clearance callback",
        optimise_path,
        kr60,
        task,
        gammas=gammas,
        drive=Drive(jump=1.0, clearance_of=lambda q: q),
    )


def test_limit_distance_counts_joints_and_is_negative_beyond(kr60: fem.ArmModel) -> None:
    limits = kr60.robot.limits
    q = np.stack([limits.mean(axis=1), limits[:, 0] + 0.01, limits[:, 1] + 0.02])
    expected = [0.5 * np.ptp(limits, axis=1).min(), 0.01, -0.02]
    np.testing.assert_allclose(limit_distance(kr60.robot, q), expected, atol=1e-14)


def test_one_point_is_a_path(kr60: fem.ArmModel) -> None:
    task = dome_task(3)
    path = task.path
    single = replace(task, path=type(path)(path.points[:1], path.normals[:1], path.axes[:1], path.feed[:1]))
    found = optimise_path(kr60, single, drive=BARE)
    # The path's finer grids go about the best peak only, the point's about three.
    np.testing.assert_allclose(found.course.value, found.each_point.value, rtol=1e-3)


@pytest.mark.parametrize(
    ("figures", "message"),
    [
        ({"motion": -1.0}, "path cost motion"),
        ({"limit_zone": np.nan}, "limit_zone"),
        ({"jump": 0.0}, "jump"),
        ({"gamma_step": -0.1}, "gamma_step"),
        ({"speed": [1.0, 0.0]}, "joint speeds"),
    ],
)
def test_bad_figures_are_refused(figures: dict[str, object], message: str) -> None:
    refuses("G004", message, Drive, **figures)


def test_speeds_must_fit_the_joints(kr60: fem.ArmModel) -> None:
    refuses(
        "G004",
        "joint speeds",
        optimise_path,
        kr60,
        dome_task(2, 0.01),
        gammas=GammaRange(count=4),
        drive=Drive(speed=[1.0, 2.0]),
    )


# ------------------------------------------------------------
# Posture at points: against direct evaluation and a fine grid; points out of reach


def test_a_fixed_gamma_equals_direct_evaluation_point_by_point(kr60: fem.ArmModel) -> None:
    task, gamma = dome_task(7), np.radians(20.0)
    found = postures_at(kr60, task, Objective(), gamma)
    frames = task.tool_frames([gamma])[:, 0]
    for i in range(7):
        solved = inverse_kinematics(kr60.robot, frames[i : i + 1], T_flange_tool=spindle())
        q = solved.q[0][solved.valid[0]]
        k = stiffness_index(kr60, q, task.path.normals[i], spindle()[:3, 3])
        # The same operations in other batches: rounding only.
        np.testing.assert_allclose(found.value[i], k.max(), rtol=1e-12)
    placed = forward_kinematics(kr60.robot, found.q)
    tip = placed.p_flange + placed.R_flange @ spindle()[:3, 3]
    np.testing.assert_allclose(tip, task.path.points + part()[:3, 3], atol=1e-12)
    assert kr60.robot.reachable(found.q).all()


@pytest.mark.parametrize("quantity", ["k_fs", "nspi", "rayleigh", "weakest", "displacement", "normal displacement"])
def test_each_quantity_is_what_it_says(kr60: fem.ArmModel, quantity: str) -> None:
    task = dome_task(3)
    sweep = sweep_gamma(kr60, task, Objective(quantity, F), np.radians([0.0, 40.0]))
    point = np.nonzero(sweep.valid)[0]
    C = translational(kr60, sweep.q[sweep.valid], spindle()[:3, 3])
    n = task.normals[point]
    d = C @ F
    direct = {
        "displacement": np.linalg.norm(d, axis=1),
        "normal displacement": np.abs((n * d).sum(axis=1)),
    }.get(quantity)
    if direct is None:
        direct = evaluate(quantity, C, n, F)
    np.testing.assert_allclose(sweep.value[sweep.valid], direct, rtol=1e-11)  # sums in another order
    assert np.isnan(sweep.value[~sweep.valid]).all()


def test_normals_and_forces_are_in_base_axes(kr60: fem.ArmModel) -> None:
    """The same part, its frame turned about z and its path turned back: nothing changes but gamma's zero."""
    c, s = np.cos(0.7), np.sin(0.7)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    T = part()
    T[:3, :3] = R
    path = dome(4)
    straight = Task(path, spindle(), part(), np.array([1.0, 0.0, 0.0]))
    turned = Task(
        type(path)(path.points @ R, path.normals @ R, path.axes @ R, path.feed), spindle(), T, R.T @ [1.0, 0.0, 0.0]
    )
    objective = Objective("normal displacement", F)
    a, b = (sweep_gamma(kr60, t, objective, [0.0, 0.5]) for t in (straight, turned))
    np.testing.assert_array_equal(a.valid, b.valid)
    np.testing.assert_allclose(a.value[a.valid], b.value[b.valid], rtol=1e-9)  # small components cancel


@pytest.mark.parametrize(
    ("objective", "gammas"),
    [
        (Objective(), GammaRange()),
        (Objective("displacement", F), GammaRange(np.radians(-60.0), np.radians(75.0), 28)),
    ],
)
def test_the_refined_optimum_beats_and_meets_a_fine_grid(
    kr60: fem.ArmModel, objective: Objective, gammas: GammaRange
) -> None:
    task = dome_task(5)
    refined = best_postures(kr60, task, objective, gammas)
    coarse = best_postures(kr60, task, objective, gammas, starts=0)
    fine = GammaRange(gammas.lower, gammas.upper, 2881 if not gammas.closed else 2880)
    brute = best_postures(kr60, task, objective, fine, starts=0)
    gain = objective.sign * (refined.value - coarse.value)
    assert (gain >= 0.0).all()
    assert (gain > 1e-6 * np.abs(coarse.value)).any()
    # 1e-5 rad beside the optimum costs less than this even where limits cut the range off at a slope.
    assert (objective.sign * (refined.value - brute.value) > -1e-4 * np.abs(brute.value)).all()
    # A peak between two angles of the fine grid, a slope of at most some 1/rad times 0.001 rad.
    np.testing.assert_allclose(refined.value, brute.value, rtol=5e-3)
    direct = postures_at(kr60, task, objective, refined.gamma)
    np.testing.assert_allclose(direct.value, refined.value, rtol=1e-9)
    again = objective.values(kr60, refined.q, task, np.arange(5))
    np.testing.assert_allclose(again, refined.value, rtol=1e-12)
    sweep = sweep_gamma(kr60, task, objective, gammas.angles)
    extreme = np.nanmin if objective.quantity == "displacement" else np.nanmax
    np.testing.assert_array_equal(coarse.value, extreme(sweep.value, axis=(1, 2)))


def test_a_point_out_of_reach_is_named_with_the_reason(kr60: fem.ArmModel) -> None:
    path = dome(5)
    far = path.points.copy()
    far[3] += [2.0, 0.0, 0.0]
    task = Task(type(path)(far, path.normals, path.axes, path.feed), spindle(), part(), np.array([0.0, 1.0, 0.0]))
    refuses(
        "G001", r"path point 3 cannot be reached at any of 72 .*out of reach", best_postures, kr60, task, Objective()
    )
    refuses("G001", r"path point 3 cannot be reached at any of 1 ", postures_at, kr60, task, Objective(), 0.0)


def test_a_tool_that_hits_the_limits_everywhere_is_said(kr60: fem.ArmModel) -> None:
    limits = kr60.robot.limits.copy()
    limits[0] = np.radians([120.0, 130.0])  # the part stands at some 10 deg, or 190 deg backwards
    narrow = replace(kr60, robot=replace(kr60.robot, limits=limits))
    refuses(
        "G001",
        r"cannot be reached at any of 72 .*beyond joint limits",
        best_postures,
        narrow,
        dome_task(2, 0.1),
        Objective(),
    )


def test_bad_objectives_and_ranges_are_refused(kr60: fem.ArmModel) -> None:
    refuses("G004", "objective", Objective, "stiffness")
    refuses("G004", "force for displacement", Objective, "displacement")
    refuses("G004", "aim", Objective, aim="best")
    refuses("G004", "range of gamma", GammaRange, 1.0, 1.0)
    refuses("G004", "number of angles", GammaRange, count=1)
    refuses("P009", "gamma", sweep_gamma, kr60, dome_task(2), Objective(), [])
    refuses("P009", "gamma", sweep_gamma, kr60, dome_task(2), Objective(), [np.nan])


def test_a_range_in_degrees_counts_the_ends_of_a_full_turn_once() -> None:
    assert GammaRange.of_degrees(-180.0, 180.0, 5.0).count == 72
    assert GammaRange.of_degrees(0.0, 90.0, 5.0).count == 19
    np.testing.assert_allclose(np.degrees(GammaRange.of_degrees(0.0, 90.0, 30.0).angles), [0, 30, 60, 90], atol=1e-12)
    refuses("G004", "step of gamma", GammaRange.of_degrees, 0.0, 90.0, 0.0)
