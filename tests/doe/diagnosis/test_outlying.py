"""Readings that are wrong are told from good ones before any effect is named, whatever their scatter depends on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up import read, setting

from doe import Measurements
from doe.diagnosis.outlying import reading_weights
from doe.diagnosis.setting import setting_of
from doe.tables.reading import bundled_data, read_measurements
from fem import build_model
from fem.effects.catalogue import effect_of
from robots import load_description
from robots.arrays import Array


def weights(data: Measurements) -> Array:
    s = setting(data)
    assert len(s.data) == data.n
    return reading_weights(s)


def spoilt(data: Measurements, rows: list[int], factor: float = 10.0) -> Measurements:
    """A digit slipped in some rows."""
    wrong = data.displacement.copy()
    wrong[rows, 2] *= factor
    return replace(data, displacement=wrong)


@pytest.mark.parametrize("repeats", [1, 2, 3])
def test_slipped_digits_lose_their_weight_and_good_readings_keep_theirs(repeats: int) -> None:
    data = read({}, poses=12, repeats=repeats)
    rows = [5, data.n // 2, data.n - 4]
    weight = weights(spoilt(data, rows))
    # A factor of ten is some 300 standard deviations of 3 % noise.
    assert (weight[rows] < 0.05).all()
    # Of normal noise 0.3 % are beyond three standard deviations.
    assert np.sum(np.delete(weight, rows) < 0.9) <= 0.02 * data.n


def test_an_effect_makes_no_outliers() -> None:
    """What repeats confirm is no outlier, however far from the model: backlash moves single loads of single poses."""
    data = read({"backlash:j2": {"gap": 8e-4, "crossing": 20.0, "preload": 0.0}}, poses=12, repeats=3)
    assert np.sum(weights(data) < 0.5) <= 0.01 * data.n


def test_noise_that_does_not_grow_with_the_reading_makes_no_outliers_of_small_ones() -> None:
    data = read({}, poses=12, repeats=3, share=0.0)
    rng = np.random.default_rng(1)
    noisy = data.displacement.copy()
    noisy[:, 2] += 3e-5 * rng.standard_normal(data.n)
    assert np.sum(weights(replace(data, displacement=noisy)) < 0.5) <= 0.01 * data.n


def test_two_wrong_readings_of_the_xr701_are_seen_beside_one_another() -> None:
    """Poses 3 and 4 under 375 N are 0.4 mm short of what their other loads and the other poses say."""
    description = load_description("xr701")
    model = build_model(description, "rigid", load_path="serial")
    data = read_measurements(bundled_data("xr701"), model.robot)
    s = setting_of(description, model, data)
    weight = reading_weights(s)
    odd = np.array([pose in ("3", "4") for pose in data.pose]) & (np.abs(data.loads_N - 375.0) < 1.0)
    assert odd.sum() == 2
    assert (weight[odd] < 0.3).all()
    assert (weight[~odd] > 0.9).all()


@pytest.mark.slow
def test_an_explanation_shows_readings_that_it_does_not_explain() -> None:
    data = read({"load-misalignment": {"tilt_x": 0.0, "tilt_y": np.radians(6.0)}}, poses=40, repeats=1, share=0.005)
    rows = [10, 77, 200]
    wrong = spoilt(data, rows, 1.15)
    s = setting(wrong)
    truth = effect_of("load-misalignment", s.model, s.description)
    ends = [s.read(s.arm, (truth.placed({"tilt_x": 0.0, "tilt_y": y}),)) for y in (0.1, -0.1)]
    plain, explained = reading_weights(s), reading_weights(s, [0.5 * (ends[0] - ends[1])[:, None]])
    # Fifteen per cent is thirty standard deviations: hidden as long as something else is missing.
    assert (explained[rows] < 0.2).all()
    assert explained[rows].max() <= plain[rows].max() + 0.01
    assert np.sum(np.delete(explained, rows) < 0.5) <= 0.01 * data.n
