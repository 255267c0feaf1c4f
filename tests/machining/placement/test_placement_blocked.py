"""Positions are given up only when all their postures are in the way; the present place has its best gamma."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from placement_cases import cell_of, line, problem_of, rail

import fem
from machining.placement import freedom, place, search, start_of, survey
from machining.placement.search import find_staying
from machining.placement.sweeping import sweep_sites
from machining.posture.points import GammaRange
from robots import InputError

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
