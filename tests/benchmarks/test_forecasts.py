"""Intervals of readings not used and promises of plans, in worlds that the diagnosis shares nothing with."""

from __future__ import annotations

from forecast_coverage import bundled, study


def test_intervals_and_promises_hold_with_something_hidden() -> None:
    found = study("kr60-3", 16)
    for case in ("nothing", "hidden"):
        assert 0.90 <= found[case].inside / found[case].readings <= 0.98
    # 90 % in 320 draws of four arms; 80 intervals of 16 worlds, those of one world alike, scatter by some 8 %.
    assert sum(found["first"].kept) / len(found["first"].kept) >= 0.74
    # By the readings' noise alone hardly any promise is kept.
    assert sum(found["first"].noise_alone) / len(found["first"].noise_alone) < 0.5


def test_real_readings_at_poses_left_out() -> None:
    assert 0.90 <= bundled("fanuc-r2000ic").share <= 0.98
    assert bundled("xr701").readings == 27
