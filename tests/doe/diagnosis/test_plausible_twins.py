"""Twins have the signs that they can have; where it is asked, plausible sizes too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up import campaign, exactly, found_friction, kr60, setting

from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import Signature, signature
from doe.diagnosis.twins import APART, Likeness
from doe.estimation.noise import Noise
from fem.effects.catalogue import effect_of


@pytest.fixture(scope="module")
def s() -> Setting:
    _, model = kr60()
    data = campaign(poses=12, repeats=1)
    return setting(replace(data, displacement=np.where(np.isnan(data.displacement), np.nan, exactly(model, data, ()))))


@pytest.fixture(scope="module")
def like(s: Setting) -> Likeness:
    return Likeness(s, Noise((2e-6, 2e-6)), np.ones(len(s.data)))


def sign(s: Setting, code: str, values: dict[str, float]) -> Signature:
    description, model = kr60()
    placed = effect_of(code, model, description).placed(values)
    return signature(s, placed.effect, placed.values)


@pytest.mark.parametrize(
    ("times", "same"), [(1.0, True), (1.2, True), (5.0, False), (0.05, False), (-1.0, True), (-5.0, False)]
)
def test_a_twin_of_implausible_size_is_none_where_size_counts(
    s: Setting, like: Likeness, times: float, *, same: bool
) -> None:
    c = sign(s, "payload", {"force": 20.0})
    change = times * c.columns[:, 0] * c.effect.parameters[0].upper
    assert like.left(change, [c]) < 1e-6 * like.strength(change) + 1e-6  # any size does
    assert (like.left(change, [c], plausible=True) < APART) is same


def test_what_can_be_neither_less_than_nothing_imitates_no_minus(s: Setting, like: Likeness) -> None:
    c = sign(s, "backlash:j2", {"gap": 8e-4, "crossing": 20.0, "preload": 0.0})
    change = c.columns[:, 0] * 8e-4
    for plausible in (False, True):
        assert like.left(change, [c], plausible=plausible) < 1e-6 * like.strength(change) + 1e-6
        assert like.left(-change, [c], plausible=plausible) > APART


def test_of_an_effect_of_both_kinds_the_one_without_a_sign_keeps_to_it(s: Setting, like: Likeness) -> None:
    """An own effect may have an amplitude that cannot be negative beside one that can."""
    gap = sign(s, "backlash:j2", {"gap": 8e-4, "crossing": 20.0, "preload": 0.0})
    force = sign(s, "payload", {"force": 20.0})
    both = replace(
        gap,
        effect=replace(gap.effect, parameters=(*gap.effect.parameters, *force.effect.parameters)),
        rows=np.hstack([gap.columns, force.columns]),
        alike=None,
        positive=np.array([True, False]),
    )
    plus, minus = gap.columns[:, 0] * 8e-4, force.columns[:, 0] * -20.0
    assert like.left(plus + minus, [both]) < 1e-6 * like.strength(plus + minus) + 1e-6
    assert like.left(plus + minus, [both], plausible=True) < 1e-6 * like.strength(plus + minus) + 1e-6
    assert like.left(minus - plus, [both]) > APART
    # Were it free to be negative it would do.
    assert like.left(minus - plus, [replace(both, positive=np.zeros(2, dtype=bool))]) < APART


def test_of_several_amplitudes_one_may_be_nothing(s: Setting, like: Likeness) -> None:
    c = sign(s, "load-misalignment", {"tilt_x": 0.0, "tilt_y": 0.0})
    change = c.columns[:, 1] * 0.05
    assert like.left(change, [c], plausible=True) < 1e-6 * like.strength(change) + 1e-6


def test_twins_of_plausible_size_are_some_of_all_twins() -> None:
    d = found_friction()
    every, plausible = d.twins(["friction:j2"])["friction:j2"], d.plausible_twins("friction:j2")
    assert plausible is not None
    assert set(plausible) <= set(every)
    weak = replace(d, after=replace(d.after, refit=replace(d.after.refit, noise=Noise((1.0, 1.0)))))
    assert weak.plausible_twins("friction:j2") is None
