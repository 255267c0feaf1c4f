"""Evidence against dense formulas and quadrature."""

from __future__ import annotations

import numpy as np
import pytest
from made_up import read, setting
from scipy.stats import multivariate_normal, norm

from doe.diagnosis.evidence import Base, Whitened, leave_one_pose_out
from doe.diagnosis.fits import fit_all
from doe.diagnosis.known import base_of
from doe.diagnosis.scatter import covariance
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import Signature, signatures
from doe.diagnosis.weighing import extended
from doe.estimation.noise import Noise

NOISE = Noise(white=(5e-6, 1e-5), share=0.02, pose_share=0.01)


@pytest.fixture(scope="module")
def small() -> Setting:
    return setting(read({}, poses=8, repeats=1))


def dense(s: Setting, base: Base, more: Signature | None = None) -> float:
    """Log density of the readings with all numbers integrated out, by the full covariance matrix."""
    f = s.prediction
    V = np.diag(NOISE.variance(s.data, f))
    common = NOISE.common(s.data, f)
    same = s.data.blocks.number[:, None] == s.data.blocks.number
    V += same * (common @ common.T) + base.columns @ np.diag(1.0 / base.precision) @ base.columns.T
    residual = base.residual
    if more is not None:
        V += more.columns @ np.diag(more.sd**2) @ more.columns.T
        residual = residual - more.columns @ more.mean
    return float(multivariate_normal(cov=V, allow_singular=True).logpdf(residual))


def unbounded(base: Base) -> Base:
    return Base(base.columns, base.residual, base.precision, np.full(len(base.floor), -np.inf))


def test_the_base_alone_is_the_density_of_a_normal(small: Setting) -> None:
    base = unbounded(base_of(small))
    w = Whitened(base, covariance(small, NOISE, np.ones(len(small.data))))
    # Two factorisations of a matrix of condition 1e6 or so.
    assert w.log_evidence == pytest.approx(dense(small, base), abs=1e-5)


@pytest.mark.parametrize("code", ["load-misalignment", "angle-dependent-stiffness:j2", "joint-zero-offset:j3"])
def test_signed_amplitudes_add_their_columns_to_the_covariance(small: Setting, code: str) -> None:
    base = unbounded(base_of(small))
    w = Whitened(base, covariance(small, NOISE, np.ones(len(small.data))))
    some = signatures(small, small.known[code])
    for c, value in zip(some, fit_all(w, some).log_evidence, strict=True):
        assert value == pytest.approx(dense(small, base, c), abs=1e-5)


def test_a_positive_amplitude_is_integrated_above_zero_only(small: Setting) -> None:
    base = unbounded(base_of(small))
    V = covariance(small, NOISE, np.ones(len(small.data)))
    c = signatures(small, small.known["base-vertical"])[0]
    fit = fit_all(Whitened(base, V), [c])[0]
    grid = np.linspace(0.0, c.mean[0] + 8.0 * c.sd[0], 4001)
    at = [
        Whitened(Base(base.columns, base.residual - c.columns[:, 0] * v, base.precision, base.floor), V).log_evidence
        for v in grid[::40]
    ]
    # The log evidence is a parabola in the amplitude: a coarse grid of it interpolates exactly.
    curve = np.polyval(np.polyfit(grid[::40], at, 2), grid)
    density = norm(c.mean[0], c.sd[0]).pdf(grid) / norm(c.mean[0], c.sd[0]).sf(0.0)
    top = curve.max()
    expected = top + np.log(np.trapezoid(np.exp(curve - top) * density, grid))
    # Quadrature of a peak some tens of grid points wide.
    assert fit.log_evidence == pytest.approx(expected, abs=1e-3)


def test_leaving_a_pose_out_is_fitting_without_it(small: Setting) -> None:
    base = extended(small, base_of(small), signatures(small, small.known["load-misalignment"])[0])
    weight = np.ones(len(small.data))
    V = covariance(small, NOISE, weight)
    left = leave_one_pose_out(base, V, small.data.pose)
    for g in (0, 5):
        rest = small.data.pose != g
        f = small.prediction[rest]
        part = small.data.take(rest)
        own = NOISE.covariance(part, f, np.ones(len(part)))
        W = own.whiten(base.columns[rest])
        r = own.whiten(base.residual[rest][:, None])[:, 0]
        u = np.linalg.solve(W.T @ W + np.diag(base.precision), W.T @ r)
        expected = base.residual[~rest] - base.columns[~rest] @ u
        np.testing.assert_allclose(left.error[~rest], expected, atol=1e-10)  # m: round-off of 1e-4 m readings


def test_the_density_of_a_pose_left_out_is_the_conditional_one(small: Setting) -> None:
    """At any noise: of the readings themselves, so that hypotheses at different noises compare."""
    base = unbounded(base_of(small))
    mine = small.data.pose == 3
    f = small.prediction
    for noise in (NOISE, Noise(white=(2e-5, 1e-5), share=0.05)):
        common = noise.common(small.data, f)
        same = small.data.blocks.number[:, None] == small.data.blocks.number
        V = np.diag(noise.variance(small.data, f)) + same * (common @ common.T)
        V += base.columns @ np.diag(1.0 / base.precision) @ base.columns.T
        whole, rest = (
            multivariate_normal(cov=V[np.ix_(k, k)], allow_singular=True).logpdf(base.residual[k])
            for k in (np.ones(len(mine), dtype=bool), ~mine)
        )
        left = leave_one_pose_out(base, covariance(small, noise, np.ones(len(mine))), small.data.pose)
        # Two factorisations of a matrix of condition 1e6 or so.
        assert left.log_density[3] == pytest.approx(whole - rest, abs=1e-5)
