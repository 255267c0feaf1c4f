"""Axes maps: zones and values against a direct evaluation of every branch, in parts, and with courses through them."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from posture_cases import dome_task, part, spindle
from refusals import refuses

import fem
from machining import Drive, GammaRange, Objective, Task, limit_distance, optimise_path, singular_distance, tool_path
from machining import sweep_parts as parts
from machining.posture.axes_map import Zone, axes_map
from machining.posture.points import sweep_gamma
from robots import inverse_kinematics
from robots.arrays import Array

GAMMA = np.radians(np.arange(-180.0, 180.0, 15.0))


def clearance(q: Array) -> Array:
    """No cell, just a figure that some postures fail: m."""
    return np.asarray(0.4 - np.abs(np.sin(q[:, 0]) + 0.5 * np.cos(q[:, 4])))


def leaving(n: int) -> Task:
    """A path that leaves the reach."""
    return Task(tool_path(np.linspace([0.7, 0.0, 0.5], [2.6, 0.3, 0.5], n), [0.0, 0.0, 1.0]), spindle(), np.eye(4))


def by_hand(model: fem.ArmModel, task: Task, drive: Drive, i: int, gamma: float) -> tuple[Zone, float]:
    """Zone and best value of one cell, branch by branch."""
    solved = inverse_kinematics(model.robot, task.tool_frames(np.array([gamma]))[i], T_flange_tool=task.T_flange_tool)
    seen, values = [], {Zone.OPEN: [-np.inf], Zone.SINGULAR: [-np.inf]}
    for q, valid in zip(solved.q[0], solved.valid[0], strict=True):
        if np.isnan(q).any():
            seen.append("gone")
            continue
        # The nearest turn to the middle of the ranges is the one farthest from the limits for ranges about it.
        if not valid or limit_distance(model.robot, q[None])[0] < drive.limit_least:
            seen.append("limits")
            continue
        distance = singular_distance(model.robot, q[None])[0]
        clear = drive.clearance_of is None or drive.clearance_of(q[None])[0] >= drive.clearance_least
        value = Objective().values(model, q[None], task, np.array([i]))[0]
        if distance >= drive.singular_zone:
            seen.append("open" if clear else "collision")
            if clear:
                values[Zone.OPEN].append(value)
        else:
            soft = clear and distance >= drive.singular_least
            seen.append("soft" if soft else "singular")
            if soft:
                values[Zone.SINGULAR].append(value)
    order = {
        "open": Zone.OPEN,
        "soft": Zone.SINGULAR,
        "collision": Zone.COLLISION,
        "singular": Zone.SINGULAR,
        "limits": Zone.LIMITS,
        "gone": Zone.UNREACHABLE,
    }
    name = next(name for name in order if name in seen)
    zone = order[name]
    return zone, max(values[zone]) if name in ("open", "soft") else np.nan


@pytest.mark.parametrize("limit_least_deg", [0.0, 4.0])
def test_every_cell_is_what_its_branches_are(kr60: fem.ArmModel, limit_least_deg: float) -> None:
    drive = Drive(
        clearance_of=clearance,
        clearance_least=0.05,
        singular_zone=0.35,
        singular_least=0.25,
        limit_least=float(np.radians(limit_least_deg)),
    )
    task, gamma = leaving(8), GAMMA[::2]
    made = axes_map(kr60, task, drive=drive, gamma=gamma)
    assert made.zone.shape == made.value.shape == made.branch.shape == (8, len(gamma))
    for i in range(8):
        for j, g in enumerate(gamma):
            zone, value = by_hand(kr60, task, drive, i, g)
            assert made.zone[i, j] == zone, (i, np.degrees(g))
            # The same formulas in another order: rounding.
            np.testing.assert_allclose(made.value[i, j], value, rtol=1e-8)
    # All kinds are there, or this proves little.
    assert set(np.unique(made.zone)) == set(Zone)
    assert np.isfinite(made.value[made.zone == Zone.SINGULAR]).any() == (limit_least_deg == 0.0)
    assert np.isnan(made.value[made.zone == Zone.SINGULAR]).any()
    np.testing.assert_allclose(sum(made.share(zone) for zone in Zone), 1.0)


def test_the_branch_named_is_the_one_that_has_the_value(kr60: fem.ArmModel) -> None:
    task = leaving(6)
    made = axes_map(kr60, task, gamma=GAMMA)
    sweep = sweep_gamma(kr60, task, Objective(), GAMMA)
    i, j = np.nonzero(np.isfinite(made.value))
    np.testing.assert_allclose(made.value[i, j], sweep.value[i, j, made.branch[i, j]], rtol=1e-12)
    assert (made.branch[~np.isfinite(made.value)] == -1).all()
    assert made.names == sweep.names
    np.testing.assert_allclose(made.length[[0, -1]], [0.0, np.hypot(1.9, 0.3)], rtol=1e-12)


def test_displacements_are_smallest_where_the_map_is_best(kr60: fem.ArmModel) -> None:
    objective, task = Objective("displacement", np.array([0.0, 50.0, -200.0])), leaving(4)
    made = axes_map(kr60, task, objective, Drive(singular=0.0, singular_least=0.0), GAMMA)
    sweep = sweep_gamma(kr60, task, objective, GAMMA)
    least = np.where(sweep.valid, sweep.value, np.inf).min(axis=2)
    np.testing.assert_allclose(made.value, np.where(np.isfinite(least), least, np.nan), rtol=1e-12)


def test_a_zone_that_is_switched_off_is_not_drawn(kr60: fem.ArmModel) -> None:
    task = leaving(6)
    on, off = (axes_map(kr60, task, drive=Drive(singular=w, singular_zone=0.5), gamma=GAMMA) for w in (0.05, 0.0))
    assert on.share(Zone.SINGULAR) > off.share(Zone.SINGULAR)
    assert off.share(Zone.OPEN) > on.share(Zone.OPEN)


def test_the_parts_of_a_map_make_the_whole(kr60: fem.ArmModel, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = axes_map(kr60, dome_task(7), gamma=GAMMA)
    seen: list[tuple[int, int]] = []
    monkeypatch.setattr(parts.sweep_parts, "__kwdefaults__", {**parts.sweep_parts.__kwdefaults__, "targets": 50})
    made = axes_map(kr60, dome_task(7), gamma=GAMMA, progress=lambda *at: seen.append(at))
    assert seen == [(2, 7), (4, 7), (6, 7), (7, 7)]
    np.testing.assert_array_equal(made.zone, whole.zone)
    np.testing.assert_allclose(made.value, whole.value, rtol=1e-12)


def test_a_drivable_course_never_leaves_the_cells_that_have_a_value(kr60: fem.ArmModel) -> None:
    gammas, task = GammaRange(count=36), dome_task(40)
    drive = Drive(clearance_of=lambda q: 0.3 - np.abs(np.sin(q[:, 0]) * np.cos(q[:, 4])), clearance_least=0.05)
    made = axes_map(kr60, task, drive=drive, gamma=gammas.angles)
    course = optimise_path(kr60, task, gammas=gammas, drive=drive, passes=0).course
    column = np.abs(course.gamma[:, None] - gammas.angles).argmin(axis=1)
    rows = np.arange(40)
    assert made.share(Zone.COLLISION) > 0.0
    assert np.isin(made.zone[rows, column], [Zone.OPEN, Zone.SINGULAR]).all()
    open_ = made.zone[rows, column] == Zone.OPEN
    far = singular_distance(kr60.robot, course.q) >= drive.singular_zone
    # Away from singularities the map has the best branch, so no course is better.
    assert (course.value[open_ & far] <= made.value[rows, column][open_ & far] * (1.0 + 1e-9)).all()
    assert (open_ & far).any()


def test_a_clearance_callback_of_the_wrong_shape_is_refused(kr60: fem.ArmModel) -> None:
    refuses(
        "G004",
        "clearance callback",
        axes_map,
        kr60,
        dome_task(3),
        drive=Drive(clearance_of=lambda q: np.zeros(1)),
        gamma=GAMMA,
    )


@pytest.mark.slow
def test_a_long_path_by_degrees_stays_within_its_memory(kr60: fem.ArmModel) -> None:
    path = dome_task(1000).path
    task = Task(path, spindle(), part())
    tracemalloc.start()
    made = axes_map(kr60, task, gamma=np.radians(np.arange(-180.0, 180.0, 1.0)))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert made.zone.shape == (1000, 360)
    # All branches at once would be 1000 x 360 x 8 x 6 doubles = 138 MB for the angles alone, and their parts more.
    assert peak < 150e6
