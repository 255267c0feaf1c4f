"""Intervals of readings not used and promises of plans, in worlds that the diagnosis shares nothing with."""

from __future__ import annotations

import pytest
from forecast_coverage import bundled, left_out, plans

from stiffarm import load


@pytest.mark.slow
def test_readings_left_out_lie_in_their_intervals_with_something_hidden() -> None:
    for t in left_out(load("kr60-3"), 8).values():
        assert 0.90 <= t.inside / t.readings <= 0.98


@pytest.mark.slow
def test_promises_are_kept_with_something_hidden() -> None:
    """90 % is what they aim at; intervals of one world are alike, so that those of 4 worlds scatter by some 15 %."""
    for t in plans(load("kr60-3"), 4, seed=7).values():
        assert sum(t.kept) / len(t.kept) >= 0.6
        # By the readings' noise alone fewer are kept.
        assert sum(t.noise_alone) < sum(t.kept)


def test_real_readings_at_poses_left_out() -> None:
    assert 0.90 <= bundled("fanuc-r2000ic").share <= 0.98
    assert bundled("xr701").readings == 27
