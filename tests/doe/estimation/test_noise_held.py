"""No noise is larger than the readings can hold, and it is called noise only where something tells it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from table_cases import THREE_WAYS, Arm, campaign, plain_arm, spoilt

from doe.diagnosis.diagnose import state_of
from doe.diagnosis.setting import setting_of
from doe.diagnosis.where import spread
from doe.estimation.estimate import Estimate, estimate
from doe.estimation.noise import MOST_SHARE, Noise, origin, within_readings
from doe.estimation.problem import Problem, problem
from doe.tables.measurements import Measurements
from doe.tables.reading import bundled_data, read_measurements
from fem import ArmModel
from fem.free.parameters import parameter
from robots import load_description

GAUGE = (1e-6, 1e-6)
# Rounding of sums of squares.
ROUNDING = 1.0 + 1e-9


def freed(model: ArmModel, data: Measurements, joints: tuple[str, ...] = ("j2", "j3", "j5")) -> Problem:
    return problem(model, data, [parameter(model, f"{j}.stiffness") for j in joints])


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def assert_held(e: Estimate) -> None:
    p = e.problem
    for kind, floor in zip((p.component < 3, p.component >= 3), GAUGE, strict=True):
        if kind.any():
            assert rms(e.noise.spread(p, e.prediction)[kind]) <= max(rms(p.value[kind]), floor) * ROUNDING
    assert max(e.noise.share, e.noise.pose_share) <= MOST_SHARE


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    how=st.sampled_from(["rows flipped", "cells flipped", "random", "shuffled", "upside down", "as it is"]),
    layout=st.sampled_from(
        [
            {"poses": 9},
            {"poses": 3, "loads": (300.0,), "components": (0, 1, 2)},
            {"poses": 8, "components": (2, 4)},
            {"poses": 6, "loads": (150.0, 600.0), "ways": THREE_WAYS, "components": (0, 1, 2)},
            {"poses": 2, "loads": (100.0, 200.0, 400.0, 800.0)},
        ]
    ),
    noise=st.sampled_from([0.0, 0.3, 3.0]),
)
def test_noise_is_never_larger_than_the_readings(seed: int, how: str, layout: dict[str, object], noise: float) -> None:
    data = campaign(seed, noise=noise, **layout)  # type: ignore[arg-type]
    data = data if how == "as it is" else spoilt(data, how, seed)
    assert_held(estimate(freed(plain_arm("kr60-3"), data), GAUGE))


def test_flipped_readings_of_the_xr701_hold_no_noise_beyond_them(arm: Arm) -> None:
    """Springs at their rigid end predict next to nothing: a share of that once became 12 mm for 1.2 mm read."""
    model = arm()
    data = spoilt(read_measurements(bundled_data("xr701"), model.robot), "rows flipped")
    assert_held(estimate(freed(model, data, ("j2", "j3", "j4", "j5")), GAUGE))
    s = setting_of(load_description("xr701"), model, data)
    state = state_of(s, Noise(white=(5e-7, 5e-7), share=16.0), np.ones(len(s.data)))
    read = 1e3 * rms(s.data.value)
    assert state.noise_floor_mm <= read * ROUNDING
    assert 1e3 * rms(spread(s, Noise(white=(5e-7, 5e-7), share=1e6))) <= read * ROUNDING


def test_the_estimate_of_real_noise_is_left_as_it_is() -> None:
    p = freed(plain_arm("kr60-3"), campaign(0, poses=20, noise=0.2))
    f = p.evaluate(p.free.start)[0]
    noise = Noise((0.2 * rms(p.value), 1e-6), 0.1, (1e-5, 0.0), 0.02)
    held = within_readings(p, f, noise, GAUGE)
    np.testing.assert_allclose(held.white, noise.white, rtol=1e-12)
    assert (held.share, held.pose, held.pose_share) == (noise.share, noise.pose, noise.pose_share)


def test_sigmas_that_came_with_the_readings_are_left_alone() -> None:
    data = campaign(0, poses=8)
    p = freed(plain_arm("kr60-3"), replace(data, sigma=np.full(data.n, 1.0)))
    # Their white noise is the sigmas; the one beside it is of no reading.
    noise = Noise((1.0, 1.0), pose=(2e-5, 0.0))
    assert within_readings(p, p.value, noise) == noise


def test_only_repeats_and_sigmas_tell_noise_from_the_residual() -> None:
    model = plain_arm("kr60-3")
    single, double = campaign(0), campaign(0, loads=(300.0, 300.0))
    assert origin(freed(model, single)) == "residual"
    assert origin(freed(model, double)) == "repeats"
    assert origin(freed(model, replace(single, sigma=np.full(single.n, 1e-5)))) == "given"
    # Two repeats of one set-up do not tell a noise.
    few = double.select(np.arange(double.n) < double.n // 2 + 2)
    assert origin(freed(model, few)) == "residual"
    assert origin(freed(model, single), given=True) == "given"


def test_other_loads_are_no_repeats() -> None:
    p = freed(plain_arm("kr60-3"), campaign(0, poses=4, loads=(100.0, 200.0, 300.0)))
    assert origin(p) == "residual"
    assert pytest.approx(len(p)) == len(np.unique(p.replicate))
