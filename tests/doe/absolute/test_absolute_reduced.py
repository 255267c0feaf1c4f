"""Blocks with a frame a session are reduced to what all rows at once give; variances are the likeliest."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose
from scipy.stats import multivariate_normal

from doe.absolute.reduced import Reduced, reduce_sessions
from doe.absolute.shrinkage import Variances, likeliest, minus_log, posterior
from doe.absolute.unknowns import Unknown

CURVE = tuple(Unknown(f"c{n}", "periodic", (0, n, 0), "", 1.0, 1.0, "periodic") for n in range(1, 6))
FLAT = (Unknown("a", "frame", (0, 0), "", 1.0), Unknown("b", "frame", (0, 1), "", 1.0, 2.0))


def alone(J: np.ndarray, r: np.ndarray) -> Reduced:
    """Rows that no frame has a say in, beside six that settle it."""
    block = np.zeros((6 + len(r), 7 + J.shape[1]))
    block[:6, :6], block[6:, 6:-1], block[6:, -1] = np.eye(6), J, r
    return reduce_sessions([[lambda: block]], J.shape[1])


def rows(rng: np.random.Generator) -> tuple[list[list[np.ndarray]], np.ndarray, np.ndarray]:
    """Blocks of two sessions, and the same as one matrix of both frames and seven variables, and its right side."""
    blocks = [[rng.normal(size=(m, 14)) for m in sizes] for sizes in ((9, 40, 3), (25,))]
    parts = []
    for s, mine in enumerate(blocks):
        every = np.vstack(mine)
        frames = np.zeros((len(every), 12))
        frames[:, 6 * s : 6 * s + 6] = every[:, :6]
        parts.append(np.hstack([frames, every[:, 6:]]))
    whole = np.vstack(parts)
    return blocks, whole[:, :-1], whole[:, -1]


def test_reduced_blocks_have_the_solution_of_all_rows() -> None:
    blocks, A, b = rows(np.random.default_rng(0))
    of = reduce_sessions([[(lambda m=m: m) for m in mine] for mine in blocks], 7)
    x, rest = np.linalg.lstsq(A, b, rcond=None)[:2]
    step = np.linalg.solve(of.R, of.z)
    assert_allclose(step, x[12:], atol=1e-12)
    assert_allclose(of.rest, rest[0], rtol=1e-12)
    for s, own in enumerate(of.own):
        assert_allclose(own.step(step), x[6 * s : 6 * s + 6], atol=1e-12)


def test_few_rows_leave_the_rest_open() -> None:
    blocks = [[np.random.default_rng(0).normal(size=(8, 14))]]
    of = reduce_sessions([[(lambda m=m: m) for m in mine] for mine in blocks], 7)
    assert of.R.shape == (7, 7)
    assert np.linalg.matrix_rank(of.R) == 2


def test_marginal_likelihood_is_that_of_the_readings_and_its_slopes_are_right() -> None:
    rng = np.random.default_rng(1)
    J, y = rng.normal(size=(30, 6)), rng.normal(size=30)
    unknowns, u = (*CURVE, FLAT[1]), 0.1 * rng.normal(size=6)
    of = alone(J, y - J @ u)
    values = []
    for v in (Variances(0.7, {"periodic": (0.5, 2.0)}), Variances(1.1, {"periodic": (0.9, 3.0)})):
        sd = v.sds(unknowns)
        covariance = v.sigma**2 * np.eye(30) + (J * sd**2) @ J.T
        value, slopes = minus_log(of, u, unknowns, v, 30)
        values.append(value + multivariate_normal(np.zeros(30), covariance).logpdf(y))
        for k in range(3):
            ends = []
            for way in (1e-5, -1e-5):
                x = np.log([v.sigma, *v.laws["periodic"]]) + way * (np.arange(3) == k)
                other = Variances(float(np.exp(x[0])), {"periodic": (float(np.exp(x[1])), float(np.exp(x[2])))})
                ends.append(minus_log(of, u, unknowns, other, 30)[0])
            assert_allclose(slopes[k], (ends[0] - ends[1]) / 2e-5, rtol=1e-6, atol=1e-6)
    assert_allclose(values[0], values[1], rtol=1e-12)


def test_what_is_not_there_is_shrunk_and_what_is_there_is_not() -> None:
    rng = np.random.default_rng(2)
    J = rng.normal(size=(400, 5))
    for true, low, high in ((0.0, 0.0, 0.002), (0.05, 0.02, 0.1)):
        y = J @ (true * rng.normal(size=5)) + 0.015 * rng.normal(size=400)
        of = alone(J, y)
        found = likeliest(of, np.zeros(5), CURVE, Variances(0.05, {"periodic": (0.01, 10.0)}), 400)
        assert_allclose(found.sigma, 0.015, rtol=0.12)  # three standard deviations of 400 readings' scatter
        assert low <= found.sds(CURVE)[0] <= high


def test_flat_unknowns_without_readings_stay_finite() -> None:
    of = reduce_sessions([[lambda: np.zeros((9, 9))]], 2)
    found, _ = posterior(of, np.zeros(2), np.zeros(2), np.array([np.inf, 2.0]), 1.0)
    assert np.isfinite(found.step).all()
    assert_allclose(found.half[1, 1], 2.0)
