from dataclasses import replace

import numpy as np
import pytest
from arm_cases import COUPLED, LOWER, UPPER
from refusals import refuses

from surrogate.designs import space_filling_design


def sobol(n, k, density):
    return space_filling_design(LOWER[:k], UPPER[:k], n, np.random.default_rng(0), density=density)


@pytest.mark.parametrize("density", ["arcsine", "uniform", "random", "boundary"])
def test_designs_have_exactly_n_distinct_accepted_poses(density):
    def accept(Q):
        return Q[:, 1] > 1.0

    rng = np.random.default_rng
    limits = {"density": density, "couplings": COUPLED}
    for n in (1, 100, 777):
        Q = space_filling_design(LOWER[:2], UPPER[:2], n, rng(0), accept, **limits)
        assert Q.shape == (n, 2)
        assert np.all(np.clip(Q, LOWER[:2], UPPER[:2]) == Q)
        assert accept(Q).all()
        assert COUPLED.kept(Q).all()
    np.testing.assert_array_equal(Q, space_filling_design(LOWER[:2], UPPER[:2], 777, rng(0), accept, **limits))
    assert not np.array_equal(Q, space_filling_design(LOWER[:2], UPPER[:2], 777, rng(1), accept, **limits))
    if density != "boundary":
        assert len(np.unique(Q, axis=0)) == 777


def counts(density):
    Q = sobol(1024, 3, density)
    cells = np.floor((Q - LOWER[:3]) / (UPPER[:3] - LOWER[:3]) * 4).astype(int)
    return np.bincount(np.ravel_multi_index(cells.T, (4, 4, 4)), minlength=64)


def test_uniform_designs_fill_the_box_evenly():
    # A scrambled Sobol set of 2^10 has 16 points in each of 4^3 cells (8..24 leaves room for its t value);
    # random points would have 3 to 30.
    assert counts("uniform").min() >= 8
    assert counts("uniform").max() <= 24


def test_random_designs_scatter_as_independent_poses_do():
    # Variance of a multinomial count: 16 (1 - 1/64); its estimate from 64 counts is off by 18 % (1 sd).
    # Sobol points have a variance of 2 or less, with which no interval of statistics would hold.
    assert 8.0 < counts("random").var() < 28.0
    assert counts("uniform").var() < 4.0


def test_the_arcsine_density_is_that_of_chebyshev_points():
    Q = sobol(4096, 1, "arcsine")[:, 0]
    u = (2.0 * Q - UPPER[0] - LOWER[0]) / (UPPER[0] - LOWER[0])
    share = np.arange(1, 10) / 10.0
    # 1e-3: 4096 points of a Sobol sequence; its distribution function is 1 - arccos(u) / pi.
    np.testing.assert_allclose(np.mean(u[:, None] <= -np.cos(np.pi * share), axis=0), share, atol=1e-3)


def test_boundary_poses_have_an_input_at_its_limit():
    Q = sobol(300, 3, "boundary")
    at_limit = np.isin(Q, [*LOWER[:3], *UPPER[:3]])
    assert at_limit.any(axis=1).all()
    assert set(at_limit.sum(axis=1)) == {1, 2, 3}


def test_an_empty_design_space_names_the_limits():
    never = replace(COUPLED, lower=np.radians([20.0]), upper=np.radians([40.0]))
    words = r"0 of 10 poses.*q2_deg -35 to 45 deg.*forearm refuses .*spans -150 to 5 deg, allowed 20 to 40 deg"
    refuses(
        "C005",
        words,
        space_filling_design,
        LOWER[:2],
        UPPER[:2],
        10,
        np.random.default_rng(0),
        couplings=never,
        names=("q2_deg", "q3_deg"),
    )
    refuses(
        "C005",
        r"accept\(\) refuses",
        space_filling_design,
        LOWER[:2],
        UPPER[:2],
        10,
        np.random.default_rng(0),
        lambda Q: np.zeros(len(Q), dtype=bool),
    )


@pytest.mark.parametrize(("n", "density", "words"), [(0, "uniform", "1 or more"), (5, "even", "arcsine, uniform")])
def test_bad_designs_are_refused(n, density, words):
    refuses("C005", words, space_filling_design, LOWER, UPPER, n, np.random.default_rng(0), density=density)
