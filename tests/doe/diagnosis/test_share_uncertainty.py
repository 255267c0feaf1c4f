"""A share of the disagreement has the uncertainty that springs and effects give it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from made_up import found_friction

from doe.diagnosis.diagnose import Diagnosis
from doe.diagnosis.known import base_of
from doe.diagnosis.where import labels_of, own_noise, shares, spread, where


def test_a_share_scatters_as_its_draws_do() -> None:
    z = np.array([3.0, 1.0, 2.0, 2.0])
    drawn = np.array([[3.0, 3.0], [1.0, 1.0], [1.0, 3.0], [2.0, 2.0]])
    first, second = shares(z, z, ["a", "a", "b", "b"], drawn)
    # Beyond their numbers: 8 of 14; in the draws 8 of 11 and 8 of 19.
    assert first.share == pytest.approx(8.0 / 14.0, rel=1e-12)  # round-off
    assert first.share_sd == pytest.approx(0.5 * (8.0 / 11.0 - 8.0 / 19.0), rel=1e-12)
    assert second.share_sd == pytest.approx(first.share_sd, rel=1e-12)
    assert math.isnan(shares(z, z, ["a", "a", "b", "b"])[0].share_sd)


def wider(d: Diagnosis, by: float) -> Diagnosis:
    """The diagnosis with springs and effects more uncertain by a factor."""
    refit = d.after.refit
    return replace(d, after=replace(d.after, refit=replace(refit, inverse=by**2 * refit.inverse)))


@pytest.mark.parametrize("kind", ["pose", "load", "phase"])
def test_it_is_what_the_covariance_of_springs_and_effects_makes_of_it(kind: str) -> None:
    """Against the first-order formula, where the covariance is so small that it holds."""
    d = wider(found_friction(), 0.02)
    found = where(d)[kind]
    s, refit = d.after.setting, d.after.refit
    numbers = [*range(len(s.free)), *refit.columns(0)]
    assert len(numbers) == len(s.free) + 2  # friction has a share and a torque
    A, sd = base_of(s).columns[:, numbers], spread(d.before.setting, own_noise(d))
    labels, z = labels_of(d.before.setting)[kind], d.before.residual / sd
    plain = np.array([g.share for g in shares(z, z, labels)])
    step = 1e-3 * np.sqrt(np.diag(refit.inverse)[numbers])
    there = [[g.share for g in shares(z + a * h / sd, z, labels)] for a, h in zip(A.T, step, strict=True)]
    G = ((np.array(there) - plain) / step[:, None]).T
    expected = np.sqrt(np.einsum("gk,kl,gl->g", G, refit.inverse[np.ix_(numbers, numbers)], G))
    assert d.counts.all()
    # 400 draws: four standard deviations of a standard deviation are 14 %.
    np.testing.assert_allclose([g.share_sd for g in found], expected, rtol=0.15, atol=1e-7)
    assert expected.max() > 1e-5
    np.testing.assert_allclose([g.share for g in found], plain, rtol=1e-12)


def test_shares_of_nothing_have_no_uncertainty() -> None:
    none = replace(found_friction(), verdict="none")
    assert all(math.isnan(g.share_sd) for groups in where(none).values() for g in groups)
