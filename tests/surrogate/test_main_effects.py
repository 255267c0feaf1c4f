from __future__ import annotations

import numpy as np
import pytest
from refusals import refuses

from surrogate.main_effects import main_effects


def test_by_hand() -> None:
    q = np.array([[0.0, 10.0], [0.0, 20.0], [90.0, 10.0], [90.0, 20.0], [90.0, 20.0]])
    stiffness = np.array([100.0, 200.0, 400.0, 50.0, 150.0])
    effects = main_effects(q, stiffness, ("q2_deg", "q4_deg"))
    assert list(effects) == ["q2_deg", "q4_deg"]
    # All sums and quotients of these numbers are exact in binary, up to one rounding in the division.
    for name, levels, low, mean, high in (
        ("q2_deg", [0, 90], [0.25, 0.125], [0.375, 0.5], [0.5, 1.0]),
        ("q4_deg", [10, 20], [0.25, 0.125], [0.625, 1 / 3], [1.0, 0.5]),
    ):
        for found, expected in zip(effects[name], (levels, low, mean, high), strict=True):
            assert found == pytest.approx(expected, rel=1e-15)


def test_it_does_not_depend_on_the_unit_or_the_order_of_runs(rng: np.random.Generator) -> None:
    q = rng.choice([-35.0, 5.0, 45.0], size=(40, 2))
    stiffness = rng.uniform(100.0, 900.0, 40)
    shuffle = rng.permutation(40)
    one = main_effects(q, stiffness, ("a", "b"))
    other = main_effects(q[shuffle], 1e3 * stiffness[shuffle], ("a", "b"))
    for name in one:
        # Round-off of a mean of up to 40 numbers, summed in another order.
        np.testing.assert_allclose(np.array(one[name]), np.array(other[name]), rtol=1e-13)


def test_levels_that_differ_by_round_off_are_one() -> None:
    q = np.array([[77.5], [np.degrees(np.radians(77.5)) + 1e-13], [115.0]])
    levels = main_effects(q, np.array([1.0, 2.0, 3.0]), ("q3real_deg",))["q3real_deg"].levels_deg
    assert levels.tolist() == [77.5, 115.0]


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_a_failed_run_is_named(bad: float) -> None:
    refuses("B002", "run 2", main_effects, np.array([[0.0], [1.0]]), np.array([1.0, bad]), ("q2_deg",))


@pytest.mark.parametrize(
    ("q", "stiffness", "names"),
    [
        (np.zeros((2, 2)), np.ones(2), ("a",)),
        (np.zeros((2, 1)), np.ones(3), ("a",)),
        (np.zeros(2), np.ones(2), ("a",)),
        (np.zeros((0, 1)), np.ones(0), ("a",)),
        (np.zeros((2, 2)), np.ones(2), ("a", "a")),
        (np.array([[0.0], [np.nan]]), np.ones(2), ("a",)),
    ],
)
def test_bad_input_is_refused(q: np.ndarray, stiffness: np.ndarray, names: tuple[str, ...]) -> None:
    refuses("B002", "main effects", main_effects, q, stiffness, names)
