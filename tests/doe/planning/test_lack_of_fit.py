"""What the readings so far show of a lack of fit, and what that says of campaigns to come."""

from __future__ import annotations

import numpy as np
import pytest

from doe.estimation.noise import Noise
from doe.planning.lack_of_fit import ELSEWHERE, HIDDEN, SPREAD, USUAL, Shown, drawn_shares
from robots.arrays import Array


def _shares(lack: float, *, own: float = 1e-6, dof: float = 30.0) -> Array:
    return np.log(drawn_shares(Shown(lack**2, own, dof, 0.0, Noise((1e-5, 1e-5))), 4000, np.random.default_rng(0)))


def test_before_any_reading_it_is_the_usual_one() -> None:
    x = np.log(drawn_shares(None, 4000, np.random.default_rng(0)))
    assert np.median(x) == pytest.approx(np.log(USUAL), abs=0.08)
    assert x.std() == pytest.approx(SPREAD, rel=0.05)


def test_readings_and_what_is_usual_share_the_say() -> None:
    """With many degrees of freedom all is normal, and the posterior has a closed form."""
    x = _shares(0.2, own=1e-12, dof=1000.0)
    weight = SPREAD**2 / (SPREAD**2 + ELSEWHERE**2)
    assert x.mean() == pytest.approx(weight * (np.log(0.2) + HIDDEN) + (1.0 - weight) * np.log(USUAL), abs=0.06)
    assert x.std() == pytest.approx(np.sqrt(weight) * ELSEWHERE, rel=0.06)


def test_few_degrees_of_freedom_say_less() -> None:
    assert _shares(0.2, dof=2.0).std() > 1.05 * _shares(0.2, dof=200.0).std()
    assert np.quantile(_shares(0.2, dof=2.0), 0.9) > np.quantile(_shares(0.2, dof=200.0), 0.9)


def test_what_hides_in_the_readings_own_scatter_is_not_taken_for_none() -> None:
    hidden, clear = _shares(0.0, own=0.05**2), _shares(0.0, own=0.005**2)
    assert np.quantile(hidden, 0.9) > np.quantile(clear, 0.9) + 0.5
    assert np.exp(np.quantile(hidden, 0.9)) < USUAL * np.exp(1.2816 * SPREAD)


def test_more_shown_is_more_to_come() -> None:
    found = [np.quantile(_shares(lack), 0.9) for lack in (0.0, 0.02, 0.1, 0.4)]
    assert (np.diff(found) > 0.0).all()
