"""Repeats tell what readings scatter by of their own, and what it depends on, whatever the model misses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_estimate import GAUGE, made_up

from doe.estimation.estimate import estimate
from doe.estimation.noise import NAMES, Noise, Structure, outlier_weight, pattern, terms_of
from doe.estimation.problem import Problem, When
from doe.estimation.repeats import FEWEST_CONTRASTS, _helmert, repeated
from robots.arrays import Array

TRUE = {
    "share": Noise((8e-6, 1e-6), share=0.02),
    "vector": Noise((8e-6, 1e-6), vector=0.02),
    "load": Noise((4e-6, 1e-6), load=(5e-8, 0.0)),
    "axes": Noise((8e-6, 1e-6), axes=(0.0, 1.5e-5, 3e-5, 0.0, 0.0, 0.0)),
}


def drawn(noise: Noise, seed: int = 0, *, tail: float = 0.0, **layout: object) -> tuple[Problem, Array]:
    """Readings with noise of their own, and their exact values."""
    p, u = made_up(**{"poses": 30, "repeats": 3, "loads": (100.0, 300.0, 900.0)} | layout)  # type: ignore[arg-type]
    rng = np.random.default_rng([seed, 7])
    f = p.evaluate(u)[0]
    e = rng.standard_t(tail, len(p)) if tail else rng.normal(size=len(p))
    return replace(p, value=f + np.sqrt(noise.variance(p, f)) * e), f


@pytest.mark.parametrize("structure", TRUE)
def test_the_structure_and_its_size_come_back(structure: Structure) -> None:
    truth = TRUE[structure]
    ratios = []
    for seed in range(5):
        p, f = drawn(truth, seed)
        told = repeated(p)
        assert told is not None
        assert told.structure == structure
        ratios.append(np.sqrt(told.noise.variance(p, f) / truth.variance(p, f)) * told.noise.whole)
    # 540 contrasts tell a standard deviation to within 3 %, five sets of them to within 1.4 %; two terms share them.
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.03)
    assert np.quantile(ratios, [0.05, 0.95]) == pytest.approx([1.0, 1.0], abs=0.2)


def test_no_error_of_a_model_touches_what_repeats_tell() -> None:
    p, _ = drawn(TRUE["load"])
    # Whatever is the same in all repeats: of one set-up, or of one load in it.
    group = np.random.default_rng(3).normal(size=int(p.replicate.max()) + 1)[p.replicate]
    moved = replace(p, value=p.value + 2e-4 * group)
    first, again = repeated(p), repeated(moved)
    assert first is not None
    assert again is not None
    names = ("white0", "load0")
    np.testing.assert_allclose(
        _fitted_alone(moved, "load").variances(names), _fitted_alone(p, "load").variances(names), rtol=1e-6
    )
    assert again.structure == "load"


def _fitted_alone(p: Problem, structure: Structure) -> Noise:
    told = repeated(p)
    assert told is not None
    return told.noise if told.structure == structure else told.others[structure]


def test_heavy_tails_are_told_from_normal_ones() -> None:
    truth = Noise((1e-5, 1e-6))
    heavy, _ = drawn(truth, tail=3.0)
    told = repeated(heavy)
    assert told is not None
    assert 0.0 < told.noise.tail <= 5.0
    # Of Student's t with three degrees of freedom the standard deviation is sqrt(3); an estimate by squares would
    # hang on the farthest few readings.
    assert told.noise.whole * told.noise.white[0] == pytest.approx(np.sqrt(3.0) * 1e-5, rel=0.25)
    normal, _ = drawn(truth)
    plain = repeated(normal)
    assert plain is not None
    assert plain.noise.tail == 0.0


def test_slipped_digits_do_not_widen_the_noise() -> None:
    p, f = drawn(TRUE["share"])
    value = p.value.copy()
    value[::50] *= 10.0
    told = repeated(replace(p, value=value))
    assert told is not None
    assert told.noise.tail == 0.0
    ratio = np.sqrt(told.noise.variance(p, f) / TRUE["share"].variance(p, f))
    assert np.median(ratio) == pytest.approx(1.0, abs=0.12)


def test_a_drift_between_repeats_is_no_noise() -> None:
    p, f = drawn(Noise((1e-5, 1e-6)))
    clock = np.linspace(0.0, 1.0, len(p))[np.random.default_rng(0).permutation(len(p))]
    when = When(clock, np.zeros(len(p), dtype=np.int64), p.pose)
    told = repeated(replace(p, value=p.value + 1e-4 * clock, when=when))
    assert told is not None
    assert np.median(np.sqrt(told.noise.variance(p, f))) * told.noise.whole == pytest.approx(1e-5, rel=0.1)


def test_visits_to_a_pose_that_scatter_are_told_from_the_readings_own_scatter() -> None:
    truth = Noise((5e-6, 1e-6), share=0.01)
    p, f = drawn(truth, repeats=3)
    # Rows of one repeat of a pose, all loads and components, are one visit.
    repeat = p.row % 3
    visit = 3 * p.pose + repeat
    moved = 1.0 + 0.03 * np.random.default_rng(5).normal(size=(int(visit.max()) + 1, 6))[visit, p.component]
    when = When(np.full(len(p), np.nan), np.zeros(len(p), dtype=np.int64), visit)
    told = repeated(replace(p, value=p.value + f * (moved - 1.0), when=when))
    assert told is not None
    assert told.apart
    assert told.visit == pytest.approx(0.03, rel=0.2)
    ratio = told.noise.whole * np.sqrt(told.noise.variance(p, f) / truth.variance(p, f))
    assert np.median(ratio) == pytest.approx(1.0, abs=0.1)
    calm = repeated(replace(p, when=when))
    assert calm is not None
    assert not calm.apart


def test_few_repeats_tell_nothing() -> None:
    p, _ = drawn(TRUE["share"], poses=3, repeats=2, loads=(100.0, 300.0), components=(2,))
    assert len(p) - len(np.unique(p.replicate)) < FEWEST_CONTRASTS
    assert repeated(p) is None


def test_contrasts_are_independent_and_see_no_deflection() -> None:
    for n in (2, 3, 5):
        H = _helmert(n)
        np.testing.assert_allclose(H @ H.T, np.eye(n - 1), atol=1e-14)
        np.testing.assert_allclose(H.sum(axis=1), 0.0, atol=1e-14)


def test_calibrations_take_the_structure_that_repeats_tell() -> None:
    p, f = drawn(TRUE["vector"])
    found = estimate(p, GAUGE)
    assert "vector" in found.estimated
    assert "share" not in found.estimated
    assert found.settled
    np.testing.assert_allclose(
        found.noise.variance(p, found.prediction), TRUE["vector"].variance(p, f), rtol=0.25
    )  # 5 standard errors of a variance by 800 readings


def test_the_variance_is_the_sum_of_its_terms() -> None:
    p, u = made_up(poses=4, components=(0, 1, 3, 5))
    f, one = p.evaluate(u)[0], np.ones(len(p))
    noise = Noise((1e-5, 2e-5), 0.02, (0.0, 0.0), 0.0, 0.03, (3e-8, 4e-8), (1e-6, 2e-6, 3e-6, 4e-6, 5e-6, 6e-6))
    own = tuple(n for n in NAMES if not n.startswith("pose"))
    terms = sum(v * pattern(n, p, f, one) for n, v in zip(own, noise.variances(own), strict=True))
    np.testing.assert_allclose(noise.variance(p, f), terms, rtol=1e-12)
    assert Noise.of(noise.numbers) == noise


def test_white_noise_by_axis_is_the_same_split_or_folded() -> None:
    p, u = made_up(poses=4)
    f, read = p.evaluate(u)[0], np.arange(6) < 3
    noise = Noise((1e-5, 0.0), axes=(0.0, 1e-5, 2e-5, 0.0, 0.0, 0.0))
    for other in (noise.split(read), noise.split(read).folded(read)):
        np.testing.assert_allclose(other.variance(p, f), noise.variance(p, f), rtol=1e-12)
    assert noise.split(read).folded(read).white == pytest.approx(noise.white)
    assert set(terms_of(p, f, "axes")) >= {"axis0", "axis1", "axis2"}
    assert not {"white0", "share"} & set(terms_of(p, f, "axes"))


def test_lengths_of_vectors_hold_components_that_no_gauge_read() -> None:
    whole, u = made_up(poses=6, components=(0, 1, 2))
    f = whole.evaluate(u)[0]
    np.testing.assert_allclose(whole.lengths(f), np.linalg.norm(f.reshape(-1, 3), axis=1).repeat(3), rtol=1e-12)
    alone, u = made_up(poses=6, components=(2,))
    # The model as given has other springs: its lengths are near, not the same.
    ratio = alone.lengths(alone.evaluate(u)[0]) / np.linalg.norm(f.reshape(-1, 3), axis=1)
    assert 0.5 < np.median(ratio) < 2.0
    assert (alone.lengths(alone.evaluate(u)[0]) >= np.abs(alone.evaluate(u)[0])).all()


def test_no_outlier_adds_more_than_a_good_reading_to_the_sum_of_squares() -> None:
    x = np.array([0.0, 1.0, 3.0, 10.0, 100.0, 1000.0])
    w = outlier_weight(x)
    np.testing.assert_array_equal(w[:3], 1.0)
    assert (w * x**2 <= 9.0).all()
    # Far out they no longer hang on how far; good readings count in full, so sure outliers do by a sixth more.
    np.testing.assert_allclose(w[4:] * x[4:] ** 2, 1.0, atol=0.2)
    # Student's t: as many squares as readings, on average.
    t = Noise((1.0, 1.0), tail=5.0)
    own = np.random.default_rng(0).standard_t(5.0, 200_000) * np.sqrt((t.tail + 1.0) / t.tail)
    assert float(np.mean(t.weigh(own) * own**2)) == pytest.approx(1.0, abs=0.02)
    assert float(np.std(own)) == pytest.approx(t.whole, rel=0.05)
