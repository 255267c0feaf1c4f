"""What the picture of positions shades no angle and no branch frees; what it leaves open is free at all points."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from placement_cases import cell_of, line, problem_of, rail
from rigid_frames import rigid_frame

import fem
from machining.cell import Body, Fixture, arm_of, box, clearance, scene_of
from machining.placement import Problem, freedom, place, search, start_of, survey
from machining.placement.confirming import STEP, confirmed, finely
from machining.placement.search import Look, find_staying
from machining.placement.sweeping import sweep_sites
from machining.posture.drive import singular_distance
from machining.posture.points import GammaRange
from robots import InputError, Reason, forward_kinematics, inverse_kinematics
from robots.arrays import Array

COARSE = GammaRange(count=12)


def gamma_of(problem: Problem, q: Array) -> Array:
    """Angle about the upright tool axis, from the part's x axis."""
    tool = forward_kinematics(problem.model.robot, q).R_flange @ problem.cell.tool.T_flange_tool[:3, :3]
    return np.asarray(np.arctan2(tool[:, 1, 0], tool[:, 0, 0]))


def patched(problem: Problem, monkeypatch: pytest.MonkeyPatch, bad: Any) -> None:
    """Poses collide where ``bad`` (gamma (m,), q) says so."""

    def blocked(_: Problem, q: Array, e: Array, table: float, point: Any) -> tuple[str, int]:
        del e, table, point
        hit = np.flatnonzero(bad(gamma_of(problem, q), q))
        return ("collision", int(hit[0])) if len(hit) else ("", -1)

    def stopped(_: Problem, q: Array, e: Array, table: float, point: Any) -> Array:
        del e, table, point
        return np.where(bad(gamma_of(problem, q), q), freedom.CAUSES.index("collision"), freedom.CAUSES.index(""))

    monkeypatch.setattr(freedom, "blocked", blocked)
    monkeypatch.setattr(freedom, "stopped", stopped)


def looks(problem: Problem) -> tuple[Look, Look]:
    """The middle of three positions before and after it was looked at again."""
    first = survey(problem, (3,))
    return first.grid[1], confirmed(replace(first, grid=first.grid[1:2])).grid[0]


def test_a_window_between_two_angles_is_found(kr60: fem.ArmModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """A window of 3 deg, wider than the angles of the picture and much narrower than the range's own of 30 deg."""
    problem = problem_of(kr60, cell_of(rail()), line(3, 0.1), gamma=COARSE)
    free = looks(problem)[0].gamma
    # Half way between two angles, away from the best one, about which it looks finer anyway.
    middles = COARSE.angles + 0.5 * COARSE.cell
    zero = np.zeros(1)
    taken = sweep_sites(problem, zero[None], zero, np.arange(3), middles).valid[0].all(axis=2).any(axis=1)
    middle = middles[taken & (np.abs(middles - free) > 1.2 * COARSE.cell)][0]
    patched(problem, monkeypatch, lambda gamma, _: np.abs(gamma - middle) > 0.75 * STEP)
    before, after = looks(problem)
    assert before.why == "collision"
    assert after.why == ""
    assert abs(after.gamma - middle) <= 0.75 * STEP
    patched(problem, monkeypatch, lambda gamma, _: np.abs(gamma - middle) > -1.0)
    barred = looks(problem)[1]
    assert (barred.why, barred.values) == ("collision", None)
    assert barred.stopped is not None


def test_an_open_position_is_free_at_all_points(kr60: fem.ArmModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 40 points the survey looks at some of them; the others bar an angle, and then the position."""
    problem = problem_of(kr60, cell_of(rail()), line(40, 0.1), gamma=COARSE)
    first = looks(problem)[0]
    row = np.setdiff1d(np.arange(40), problem.sure_rows(24))[5]
    at = problem.task_at(np.zeros(1), 0.0).targets[row]

    def there(q: Array) -> Array:
        found = forward_kinematics(problem.model.robot, q)
        tip = found.p_flange + found.R_flange @ problem.cell.tool.T_flange_tool[:3, 3]
        # Points are 2.6 mm apart.
        return np.asarray(np.linalg.norm(tip - at, axis=1) < 1e-4)

    patched(problem, monkeypatch, lambda gamma, q: there(q) & (np.abs(gamma - first.gamma) < 0.2))
    before, after = looks(problem)
    assert before.gamma == first.gamma
    assert after.why == ""
    assert abs(after.gamma - first.gamma) >= 0.2
    assert after.values is not None
    assert len(after.values) == len(problem.sure_rows(24))
    patched(problem, monkeypatch, lambda _, q: there(q))
    before, after = looks(problem)
    assert (before.why, after.why) == ("", "collision")
    assert after.stopped is not None
    assert after.stopped.point == row


def test_angles_are_near_enough_and_a_finer_range_is_kept(kr60: fem.ArmModel) -> None:
    problem = problem_of(kr60, cell_of(rail()), line(3, 0.1), gamma=COARSE)
    assert len(finely(problem).angles) == 180
    fine = problem_of(kr60, cell_of(rail()), line(3, 0.1), gamma=GammaRange(count=720))
    one = problem_of(kr60, cell_of(rail()), line(3, 0.1), gamma=0.3)
    assert finely(fine) is fine
    assert finely(one) is one


@pytest.mark.slow
def test_brute_force_agrees_about_a_post(kr60: fem.ArmModel) -> None:
    """Every point, angles 1 deg apart, eight branches, with nothing of the search."""
    post = rigid_frame((0.75, 0.45, 0.2))
    cell = cell_of(
        rail(limits=(-1.5, 1.0)), fixtures=(Fixture(Body("post", (box([0.12, 0.4, 1.0]).moved(post),))),), safety=0.02
    )
    scene = scene_of(cell, arm_of("kr60-3"))
    problem = problem_of(kr60, cell, line(5, 0.3), gamma=GammaRange(count=36), scene=scene, clearance=0.02)
    picture = confirmed(survey(problem, (11,)))
    truth = [_truth(problem, look.x) for look in picture.grid]
    assert [look.why for look in picture.grid] == truth
    assert {"", "collision"} < set(truth)


def _truth(problem: Problem, x: Array) -> str:
    gamma = np.radians(np.arange(-180.0, 180.0))
    e, table = problem.space.sites(x[None])
    frames = problem.task_at(e[0], 0.0).tool_frames(gamma)
    n, m = frames.shape[:2]
    found = inverse_kinematics(
        problem.model.robot, frames.reshape(-1, 4, 4), T_flange_tool=problem.cell.tool.T_flange_tool
    )
    reason, q = found.reason.reshape(n, m, 8), found.q.reshape(n, m, 8, -1)
    nearest = 0
    for k, b in np.ndindex(m, 8):
        why = reason[:, k, b]
        if (why != Reason.FOUND).any():
            rank = 1 if np.isin(why, (Reason.FOUND, Reason.LIMITS)).all() else 0
        elif (singular_distance(problem.model.robot, q[:, k, b]) < problem.drive.singular_least).any():
            rank = 2
        else:
            assert problem.scene is not None
            gap = clearance(problem.scene, q[:, k, b], e, table, within=0.05).distance
            rank = 4 if (gap >= problem.clearance).all() else 3
        nearest = max(nearest, rank)
        if nearest == 4:
            break
    return ("reach", "limit", "singularity", "collision", "")[nearest]


# ------------------------------------------------------------
# Positions are given up only when all their postures are in the way; the present place has its best gamma

FINE = GammaRange(count=72)


def test_stiff_postures_that_collide_do_not_hide_free_ones(kr60: fem.ArmModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a long part, where the sixty stiffest are all of the branch with its elbow in the bench."""
    problem = problem_of(kr60, cell_of(rail()), line(3, 0.1), gamma=FINE)
    free = survey(problem, (3,)).grid[1]
    bad: set[bytes] = set()

    def blocked(_: Any, q: Any, e: Any, table: float, point: Any) -> tuple[str, int]:
        del e, table, point
        if len(bad) < 60:
            bad.add(q.tobytes())
        return ("collision", 2) if q.tobytes() in bad else ("", -1)

    monkeypatch.setattr(freedom, "blocked", blocked)
    monkeypatch.setattr(freedom, "stopped", lambda _, q, *__: np.full(len(q), freedom.CAUSES.index("")))
    looked = search.Looker(problem).at(free.x[None], np.arange(3))[0]
    assert looked.why == ""
    assert 0.0 < looked.merit < free.merit


def test_a_point_that_stops_one_angle_is_asked_at_all_others(
    kr60: fem.ArmModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = problem_of(kr60, cell_of(rail()), line(3, 0.1), gamma=FINE)
    asked: list[int] = []

    def blocked(_: Any, q: Any, e: Any, table: float, point: Any) -> tuple[str, int]:
        del q, e, table, point
        asked.append(1)
        return "collision", 2

    monkeypatch.setattr(freedom, "blocked", blocked)
    monkeypatch.setattr(freedom, "stopped", lambda _, q, *__: np.full(len(q), freedom.CAUSES.index("collision")))
    assert survey(problem, (3,)).grid[1].why == "collision"
    # One pose of each of eight branches at each of three positions, not one of each of 72 angles.
    assert len(asked) <= 24


def test_a_position_where_nothing_is_free_says_why(kr60: fem.ArmModel, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = problem_of(kr60, cell_of(rail()), line(3, 0.1), gamma=GammaRange(count=12))
    monkeypatch.setattr(freedom, "blocked", lambda *_: ("collision", 0))
    looked = search.Looker(problem).at(np.zeros((1, 1)), np.arange(3))[0]
    assert (looked.why, looked.values) == ("collision", None)
    assert looked.stopped is not None
    assert looked.stopped.point == 0


def test_branches_may_change_at_rapid_moves_only(kr60: fem.ArmModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every branch is in the way over one of two cuts: with a rapid move between the cuts the position is free."""
    path, table = line(4, 0.2), np.zeros(1)
    wide = problem_of(kr60, cell_of(rail()), path, gamma=FINE)
    several = sweep_sites(wide, table[None], table, np.arange(4), wide.angles).valid[0].all(axis=2).sum(axis=1)
    whole = replace(wide, gamma=float(wide.angles[several.argmax()]))
    sites = sweep_sites(whole, table[None], table, np.arange(4), whole.angles)
    two = np.flatnonzero(sites.valid[0, 0].all(axis=1))[:2]
    assert len(two) == 2
    # The first branch is in the way in the second cut, all others in the first.
    stops = {sites.q[0, 0, b, p].tobytes() for b in range(8) for p in ((2, 3) if b == two[0] else (0, 1))}
    stops |= {sites.q[0, 0, b, p].tobytes() for b in range(8) for p in (2, 3) if b not in two}

    def blocked(_: Any, q: Any, e: Any, table: float, point: Any) -> tuple[str, int]:
        del e, table, point
        hit = [i for i, pose in enumerate(q) if pose.tobytes() in stops]
        return ("collision", hit[0]) if hit else ("", -1)

    monkeypatch.setattr(freedom, "blocked", blocked)
    cut = replace(whole, free=np.array([False, True, False]))
    assert search.Looker(whole).at(table[None], np.arange(4))[0].why == "collision"
    look = search.Looker(cut).at(table[None], np.arange(4))[0]
    assert look.why == ""
    assert look.values is not None
    expected = [*sites.value[0, 0, two[0], :2], *sites.value[0, 0, two[1], 2:]]
    np.testing.assert_allclose(look.values, expected, rtol=1e-12)


@pytest.mark.slow
def test_the_present_place_with_its_best_gamma(kr60: fem.ArmModel) -> None:
    problem = problem_of(kr60, cell_of(rail()), line(6, 0.2), gamma=GammaRange(count=36))
    placed = place(problem)
    assert placed.staying is not None
    np.testing.assert_array_equal(placed.staying.e, 0.0)
    # As good as the best angle of a fine grid there, and no better than the best place.
    fixed = place(problem_of(kr60, cell_of(rail(limits=(-1e-9, 1e-9))), line(6, 0.2), gamma=GammaRange(count=180)))
    assert placed.staying.mean == pytest.approx(fixed.after.mean, rel=1e-3)
    assert placed.staying.mean <= placed.after.mean * (1.0 + 1e-9)
    assert placed.after.gain(placed.staying, "worst").value == pytest.approx(placed.after.worst / placed.staying.worst)
    two = cell_of(rail(), rail("lift", (0.0, 0.0, 1.0)))
    held = problem_of(kr60, two, line(6, 0.2), gamma=GammaRange(count=36), ranges={"rail": (0.2, 0.2)})
    with pytest.raises(InputError, match="held elsewhere"):
        find_staying(held, *start_of(held.space))
