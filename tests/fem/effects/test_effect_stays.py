"""What sticks over several load cycles of one stay at a pose, followed by hand; laws that feel the links' weight."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from effect_arms import LENGTH, STIFFNESS, angle_of, extra, lever_loads, of, torque, with_weight

from fem import ArmModel, build_model
from fem.effects import History
from fem.effects.history import Carried
from robots import ModelDescription
from robots.arrays import Array

UP_AND_DOWN = np.array([1.0, 2.0, 1.0])


@pytest.fixture(scope="module")
def lever(boom: Callable[..., ModelDescription]) -> ArmModel:
    return build_model(boom(LENGTH, stiffness=STIFFNESS), links="rigid")


def twice(*, moved: bool) -> History:
    """One load up and down, twice, the arm moved on between or not."""
    stay = np.repeat([0, 1], 3) if moved else np.zeros(6, dtype=np.intp)
    clock = np.linspace(0.0, 1.0, 6)
    return History(np.repeat([0, 1], 3), np.tile([0, 1, 2], 2), clock, is_known=True, stay=stay)


# With a play of 0.5: up 0.5, 1.5; down 1.5; unloaded 0.5, which is where the second cycle begins.
@pytest.mark.parametrize(("carried", "second"), [(0, [0.5, 1.5, 1.5]), (1, [0.0, 1.0, 1.0]), (2, [0.5, 1.5, 1.5])])
def test_play_that_outlasts_a_cycle(carried: Carried, second: list[float]) -> None:
    y = twice(moved=False).play(np.tile(UP_AND_DOWN, 2), 0.5, carried)
    np.testing.assert_allclose(y, [0.5, 1.5, 1.5, *second])


def test_what_sticks_without_a_new_zero_starts_where_it_was() -> None:
    # It lets go beyond 0.7 and keeps half of that: 1 - 0.35, 2 - 0.35, then -0.65 behind 1 stays put.
    h = twice(moved=False)
    one, zeroed, kept = (h.stick(np.tile(UP_AND_DOWN, 2), 0.7, 0.5, c) for c in (0, 1, 2))
    np.testing.assert_allclose(one, np.tile([0.65, 1.65, 1.65], 2))
    # Unloaded it lets go from 1.65 down to 0.35; 1 is 0.65 ahead of that.
    np.testing.assert_allclose(kept[3:], [0.35, 1.65, 1.65])
    np.testing.assert_allclose(zeroed[3:], kept[3:] - 0.35)


def test_an_arm_that_moved_on_has_forgotten() -> None:
    x = np.tile(UP_AND_DOWN, 2)
    afresh = twice(moved=True).play(x, 0.5)
    for carried in (1, 2):
        np.testing.assert_array_equal(twice(moved=True).play(x, 0.5, carried), afresh)


def test_rows_in_any_order_give_the_same_stays(rng: np.random.Generator) -> None:
    x, mixed, h = rng.normal(size=6), rng.permutation(6), twice(moved=False)
    np.testing.assert_array_equal(h.play(x, 0.3, 2)[mixed], h.take(mixed).play(x[mixed], 0.3, 2))


@pytest.mark.parametrize(
    ("code", "values", "law"),
    [
        ("softening:j1", {"share": 0.4, "torque": 300.0, "power": 2.0}, lambda x: 0.4 * x * (abs(x) / 300.0) ** 2),
        (
            "hardening:j1",
            {"share": 0.4, "knee": 300.0, "power": 1.0},
            lambda x: -0.4 * (x - 300.0 * np.tanh(x / 300.0)),
        ),
    ],
)
def test_a_law_under_the_links_weight_is_read_from_there_on(
    lever: ArmModel, code: str, values: dict[str, float], law: Callable[[Array], Array]
) -> None:
    """What is read is the turn from weight alone to weight and load: f(tau + g) - f(g), by hand."""
    heavy, at = with_weight(lever, 40.0, 0.7), lever_loads(30.0, 100.0, 400.0)
    g = 0.8 * 40.0 * 9.80665 * 0.7 * np.cos(np.radians(30.0))
    turn = angle_of(extra(heavy, at, of(heavy, code, preload=0.8, **values)), at)
    np.testing.assert_allclose(turn, (law(torque(at) + g) - law(np.full(2, g))) / STIFFNESS, rtol=1e-9)
