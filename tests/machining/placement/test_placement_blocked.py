"""Positions are given up only when all their postures are in the way; the present place has its best gamma."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from placement_cases import cell_of, line, problem_of, rail

import fem
from machining.placement import place, search, start_of, survey
from machining.placement.search import find_staying
from machining.posture.points import GammaRange
from robots import InputError

FINE = GammaRange(count=72)


def test_stiff_postures_that_collide_do_not_hide_free_ones(kr60: fem.ArmModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a long part, where the sixty stiffest are all of the branch with its elbow in the bench."""
    problem = problem_of(kr60, cell_of(rail()), line(3, 0.1), gamma=FINE)
    free = survey(problem, (3,)).grid[1]
    seen: list[list[int]] = []
    bad: set[bytes] = set()

    def blocked(_: Any, q: Any, e: Any, table: float, first: list[int]) -> tuple[str, int]:
        del e, table
        seen.append(list(first))
        if len(bad) < 60:
            bad.add(q.tobytes())
        return ("collision", 2) if q.tobytes() in bad else ("", -1)

    monkeypatch.setattr(search, "blocked", blocked)
    looked = search.Looker(problem).at(free.x[None], np.arange(3))[0]
    assert looked.why == ""
    assert 0.0 < looked.merit < free.merit
    # The pose that collided is asked first at the next angle of its branch.
    assert [2] in seen


def test_a_position_where_nothing_is_free_says_why(kr60: fem.ArmModel, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = problem_of(kr60, cell_of(rail()), line(3, 0.1), gamma=GammaRange(count=12))
    monkeypatch.setattr(search, "blocked", lambda *_: ("collision", 0))
    looked = search.Looker(problem).at(np.zeros((1, 1)), np.arange(3))[0]
    assert (looked.why, looked.values) == ("collision", None)


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
