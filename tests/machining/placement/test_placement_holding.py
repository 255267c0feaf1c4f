"""Axes that are not needed while cutting move near and hold still, where that costs little."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from placement_cases import cell_of, line, problem_of, rail

import fem
from machining.placement import Problem, holding
from machining.placement.following import Found
from machining.placement.holding import held
from robots import InputError
from robots.arrays import Array

N = 12
# The rail is worth much, the lift little, where they go along with the path.
WANTED = np.stack([np.linspace(-0.5, 0.5, N), np.linspace(-0.2, 0.2, N)], axis=1)
WORTH = np.array([2000.0, 20.0])


@pytest.fixture
def problem(kr60: fem.ArmModel) -> Problem:
    cell = cell_of(rail(), rail("lift", (0.0, 0.0, 1.0), limits=(-0.5, 0.5)))
    return problem_of(kr60, cell, line(N), "mean", free=np.arange(N - 1) == 5)


def course_at(e: Array) -> Any:
    return SimpleNamespace(value=1000.0 - ((e - WANTED) ** 2) @ WORTH, gamma=np.zeros(N))


@pytest.fixture
def moving(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> Found:
    monkeypatch.setattr(holding, "follow", lambda _, e, *__: course_at(e))
    course = course_at(WANTED)
    return Found(problem, WANTED.copy(), course.gamma, course, 1000.0, 1)


def test_the_axis_that_brings_little_holds_still_in_each_cut(problem: Problem, moving: Found) -> None:
    found, names = held(problem, moving, 0.01)
    assert names == ("lift",)
    np.testing.assert_array_equal(found.x[:, 0], WANTED[:, 0])
    # The middle of each cut's way: half way between the ends of six points.
    expected = np.repeat([WANTED[:6, 1].mean(), WANTED[6:, 1].mean()], 6)
    np.testing.assert_allclose(found.x[:, 1], expected, atol=1e-15)
    assert 990.0 <= found.merit < 1000.0
    assert found.merit == pytest.approx(course_at(found.x).value.mean())


def test_all_axes_together_cost_no_more_than_the_share(problem: Problem, moving: Found) -> None:
    assert held(problem, moving, 0.0)[1] == ()
    both, names = held(problem, moving, 0.2)
    assert names == ("lift", "rail")
    assert both.merit >= 800.0
    assert np.ptp(both.x[:6], axis=0).max() == 0.0


def test_a_place_that_cannot_be_driven_is_not_taken(
    problem: Problem, moving: Found, monkeypatch: pytest.MonkeyPatch
) -> None:
    def follow(_: Any, e: Array, *__: Any) -> Any:
        # Nothing in the middle of a cut's way.
        if any(abs(e[0, j] - WANTED[:6, j].mean()) < 1e-9 for j in range(2)):
            raise InputError("in the way", code="X004")
        return course_at(e)

    monkeypatch.setattr(holding, "follow", follow)
    found, names = held(problem, moving, 0.01)
    assert names == ("lift",)
    low, high = WANTED[0, 1], WANTED[5, 1]
    assert found.x[0, 1] in (pytest.approx(low + 0.25 * (high - low)), pytest.approx(low + 0.75 * (high - low)))
    monkeypatch.setattr(holding, "follow", lambda *_: (_ for _ in ()).throw(InputError("nothing", code="X004")))
    assert held(problem, moving, 0.5) == (moving, ())


def test_an_axis_at_rest_is_left_alone(problem: Problem, moving: Found) -> None:
    x = WANTED.copy()
    x[:, 1] = 0.1
    assert "lift" not in held(problem, Found(problem, x, moving.gamma, moving.course, 900.0, 1), 1.0)[1]
