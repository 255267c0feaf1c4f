"""Posture at points: against direct evaluation and a fine grid; points out of reach."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from posture_cases import dome, dome_task, part, spindle
from refusals import refuses

import fem
from machining import evaluate, stiffness_index, translational
from machining.posture.points import GammaRange, best_postures, postures_at, sweep_gamma
from machining.stiffness.objective import Objective
from machining.task import Task
from robots import forward_kinematics, inverse_kinematics

F = np.array([200.0, -100.0, 150.0])


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
