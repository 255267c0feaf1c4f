"""Compensation: the model's own deflection brings the tool back onto the path, never beyond the cap."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from posture_cases import dome
from refusals import refuses
from test_posting import asked, cell_of, motions_of

import fem
from machining.cutting import ConstantForce, ToolBending
from machining.programs.compensation import compensate, cuts_of, milling_force, ramped
from machining.programs.posting import Posted, PostSettings, post
from machining.programs.program import frame_distance
from machining.task import Task, ToolPath
from robots.arrays import Array


@pytest.fixture(scope="module")
def posted(kr60: fem.ArmModel) -> Posted:
    return post(kr60, cell_of(), motions_of(dome(15, 0.3)), asked(gamma=0.3, tolerance=1e-4))


def reached(model: fem.ArmModel, posted: Posted, force: Array) -> Array:
    """Tool points (n, 3) in the part frame with the force on the tool: joint program plus deflection, from scratch."""
    program = posted.program
    w = np.concatenate([np.broadcast_to(force, (program.n, 3)), np.zeros((program.n, 3))], axis=1)
    d = fem.deflection(model, program.q, w, program.cell.tool.T_flange_tool[:3, 3])[:, :3]
    # The part's axes are the base's in this cell.
    return program.reached()[:, :3, 3] + d


def test_the_loaded_tool_ends_up_on_the_wanted_path(kr60: fem.ArmModel, posted: Posted) -> None:
    force = np.array([60.0, -80.0, 120.0])
    found = compensate(kr60, posted, ConstantForce(force))
    wanted = posted.program.motions.points
    off_before = np.linalg.norm(reached(kr60, posted, force) - wanted, axis=1)
    off_after = np.linalg.norm(reached(kr60, found.posted, force) - wanted, axis=1)
    assert off_before.max() > 1e-4
    # The fixed point stops when the deflection changes by less than 1e-8 m. The first point has no move that mills.
    assert off_after[1:].max() < 2e-8
    assert not found.capped.any()
    assert np.abs(found.left[1:]).max() < 2e-8
    away, turned = frame_distance(found.posted.program.reached(), found.posted.program.T_part_tool)
    assert max(away.max(), turned.max()) < 1e-12
    np.testing.assert_array_equal(found.posted.program.gamma, posted.program.gamma)


def test_moved_by_minus_the_deflection_and_to_first_order_only_once(kr60: fem.ArmModel, posted: Posted) -> None:
    force = np.array([0.0, 0.0, 50.0])
    found = compensate(kr60, posted, ConstantForce(force))
    moved = found.posted.program.motions.points - posted.program.motions.points
    np.testing.assert_allclose(moved, -found.moved, atol=1e-15)
    first = reached(kr60, posted, force) - posted.program.motions.points
    # The posture of the moved path gives way by a share of about its move over the arm's length more or less.
    np.testing.assert_allclose(found.deflection[1:], first[1:], atol=2e-3 * np.abs(first).max())
    assert found.rounds <= 5


def test_nothing_is_moved_beyond_the_cap_and_it_is_said(kr60: fem.ArmModel, posted: Posted) -> None:
    force = ConstantForce([60.0, -80.0, 120.0])
    free = compensate(kr60, posted, force)
    cap = float(np.median(np.linalg.norm(free.moved[1:], axis=1)))
    found = compensate(kr60, posted, force, cap=cap)
    length = np.linalg.norm(found.moved, axis=1)
    assert length.max() <= cap * (1.0 + 1e-12)
    assert 0.2 < found.capped.mean() < 0.8
    over = found.capped
    assert (np.linalg.norm(found.left[over], axis=1) > 0.0).all()
    assert np.abs(found.left[~over]).max() < 2e-8


def test_the_tools_own_bending_is_taken_off_too(kr60: fem.ArmModel, posted: Posted) -> None:
    bending = ToolBending(0.05, 0.008, 600e9)
    force = np.array([40.0, 10.0, 0.0])
    plain = compensate(kr60, posted, ConstantForce(force))
    more = compensate(kr60, posted, ConstantForce(force), tool=bending)
    axes = posted.program.motions.axes
    across = force - (axes @ force)[:, None] * axes
    np.testing.assert_allclose(
        (more.deflection - plain.deflection)[1:], bending.compliance * across[1:], rtol=2e-2, atol=2e-8
    )


def test_rapid_moves_plunges_and_their_like_carry_no_force(kr60: fem.ArmModel) -> None:
    points = np.array([[0, 0, 50], [0, 0, 5], [0, 0, 0], [30, 0, 0], [30, 30, 0], [30, 30, 40], [0, 0, 50]]) * 1e-3
    axes = np.tile([0.0, 0.0, 1.0], (7, 1))
    rapid = np.array([True, True, False, False, False, False, True])
    path = ToolPath(points, axes, axes, np.where(rapid, np.nan, 0.01))
    motions = motions_of(path, rapid=rapid, feed=path.feed)
    posted = post(kr60, cell_of(), motions, PostSettings(gamma=-2.0, tolerance=1e-3))
    task, (kept, _) = posted.state.task, posted.state.places
    cutting = posted.program.motions.cutting[kept]
    cuts = cuts_of(task, cutting)
    assert len(cuts) == 1
    ends = task.path.points[[cuts[0].start, cuts[0].stop - 1]]
    np.testing.assert_allclose(ends, points[[2, 4]], atol=1e-15)
    force = milling_force(ConstantForce([10.0, 20.0, 0.0], "process"), task, cutting).force
    at = [int(np.argmin(np.linalg.norm(task.path.points - p, axis=1))) for p in points[:6]]
    assert not force[at[:3]].any()
    assert not force[at[5]].any()
    # Feed along x: the cross-feed is tool axis x feed = y.
    halfway = force[at[3]]
    np.testing.assert_allclose(halfway, [10.0, 20.0, 0.0], atol=1e-12)
    force = ConstantForce([10.0, 20.0, 0.0], "process")
    found = compensate(kr60, posted, force, ramp=0.0)
    idle = ~(np.linalg.norm(found.deflection, axis=1) > 0.0)
    np.testing.assert_array_equal(found.posted.program.motions.points[idle], posted.program.motions.points[idle])
    np.testing.assert_array_equal(idle, ~found.engaged)
    assert 0 < idle.sum() < posted.program.n
    # With a ramp the point that the cut begins at is corrected as its first one, and farther than 5 mm away nothing is.
    ramped = compensate(kr60, posted, force, ramp=5e-3)
    first = int(np.argmax(ramped.engaged))
    np.testing.assert_allclose(ramped.moved[first - 1], ramped.moved[first], atol=1e-15)
    far = np.linalg.norm(posted.program.motions.points - points[2], axis=1) > 5e-3
    assert not ramped.moved[: first - 1][far[: first - 1]].any()
    assert np.abs(ramped.left).max() < 2e-8


def test_each_cut_has_its_own_feed_direction(kr60: fem.ArmModel) -> None:
    """Two grooves with a lift between: the lift's direction does not leak into the cuts' ends."""
    points = np.array([[0, 0, 0], [20, 0, 0], [20, 0, 30], [20, 40, 30], [20, 40, 0], [0, 40, 0]]) * 1e-3
    axes = np.tile([0.0, 0.0, 1.0], (6, 1))
    rapid = np.array([True, False, True, True, True, False])
    task = Task(ToolPath(points, axes, axes, np.full(6, np.nan)), np.eye(4), np.eye(4))
    force = milling_force(ConstantForce([5.0, 0.0, 0.0], "process"), task, ~rapid).force
    np.testing.assert_allclose(force[[1, 5]], [[5.0, 0.0, 0.0], [-5.0, 0.0, 0.0]], atol=1e-12)
    assert not force[[0, 2, 3, 4]].any()


def test_bad_caps_and_paths_that_mill_nothing_are_refused(kr60: fem.ArmModel, posted: Posted) -> None:
    refuses("Q008", "cap of the compensation", compensate, kr60, posted, ConstantForce([0.0, 0.0, 50.0]), cap=0.0)
    task, (kept, _) = posted.state.task, posted.state.places
    refuses(
        "K004",
        "no move mills",
        milling_force,
        ConstantForce([0.0, 0.0, 50.0]),
        task,
        np.zeros(len(kept), dtype=np.bool_),
    )
    refuses("M006", "beyond small displacements", compensate, kr60, posted, ConstantForce([0.0, 0.0, 1e7]), cap=10.0)


def test_the_uncertainty_is_that_of_the_deflection(kr60: fem.ArmModel, posted: Posted) -> None:
    """All springs off by the same 15 % and the force exact: the error is off by 15 %."""
    force = ConstantForce([0.0, 0.0, 80.0], relative_sd=0.0)
    found = compensate(kr60, posted, force)
    part = found.error
    assert (part.sd[1:] > 0.0).all()
    assert (part.sd[1:] < 0.15 * np.abs(part.normal[1:]) * 1.0001).all()
    assert posted.state.reference is not None
    again = replace(force, relative_sd=0.1)
    assert (compensate(kr60, posted, again).error.sd[1:] > part.sd[1:]).all()


# ------------------------------------------------------------
# Corrections fade in before a cut and out behind it, and are whole within it

FULL = np.array([0.6e-3, 0.0, 0.0])


def line(*x_mm: float) -> np.ndarray:
    return np.stack([np.array(x_mm) * 1e-3, np.zeros(len(x_mm)), np.zeros(len(x_mm))], axis=1)


def test_a_correction_fades_over_the_length_on_both_sides() -> None:
    points = line(0, 6, 8, 10, 20, 30, 31, 34, 40)
    milled = np.array([0, 0, 0, 0, 1, 1, 0, 0, 0]) > 0
    moved = np.where(milled[:, None], FULL, 0.0)
    found = ramped(moved, milled, points, 5e-3)
    # The cut begins at 10 mm: whole there, and 1 - d/5 mm before; it ends at 30 mm.
    np.testing.assert_allclose(found[:, 0] / FULL[0], [0, 0.2, 0.6, 1, 1, 1, 0.8, 0.2, 0], atol=1e-12)
    np.testing.assert_array_equal(ramped(moved, milled, points, 0.0), moved)


def test_two_cuts_that_are_near_share_the_way_between_them() -> None:
    points = line(0, 10, 12, 14, 24)
    milled = np.array([0, 1, 0, 0, 1]) > 0
    moved = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 0, 0], [0, 1, 0]]) * 1e-3
    found = ramped(moved, milled, points, 5e-3) * 1e3
    # At 12 mm: 2 mm behind the first cut (0.6) and 2 mm before the second (0.6), so half of each.
    np.testing.assert_allclose(found[2], [0.5, 0.5, 0.0])
    # At 14 mm, where the second begins: 0.2 and 1, together 1.
    np.testing.assert_allclose(found[3], [0.2 / 1.2, 1.0 / 1.2, 0.0])
    # At no point more than the larger of the two: weights never add up to more than 1.
    assert np.linalg.norm(found, axis=1).max() <= 1.0 + 1e-12


@pytest.mark.parametrize("milled", [[True] * 3, [False] * 3])
def test_nothing_but_cuts_and_no_cut(milled: list[bool]) -> None:
    moved = np.ones((3, 3))
    found = ramped(moved, np.array(milled), line(0, 1, 2), 5e-3)
    np.testing.assert_array_equal(found, moved * np.array(milled)[:, None])
