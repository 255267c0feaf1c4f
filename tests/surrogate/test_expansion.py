from itertools import product

import numpy as np
import pytest
from expansion_cases import KINDS, angles, expansion, size
from numpy.polynomial import legendre
from refusals import refuses

from surrogate.expansion import Expansion, Family, check_terms


def by_hand(e, q):
    """The sum at one pose (k,), term by term, with numpy's Legendre series."""
    out = np.zeros(e.n_outputs)
    for row, c in zip(e.terms, e.coefficients, strict=True):
        factor = 1.0
        for i, j in enumerate(row):
            f = e.families[i]
            x = q[i] - f.centre
            if f.periodic:
                x = np.arctan2(np.sin(x), np.cos(x))
            g = [1.0]
            for m in range(1, f.harmonics + 1):
                g += [np.cos(m * x), np.sin(m * x)]
            g += [legendre.Legendre.basis(d)(x / f.half_range) for d in f.degrees]
            factor *= f.matrix[j] @ g
        out += factor * c
    return out


@pytest.mark.parametrize("m", [1, 5])
@pytest.mark.parametrize("kinds", [(k,) for k in KINDS] + [("polynomial", "mixed", "periodic"), KINDS])
def test_sums_of_products_term_by_term(kinds, m, rng):
    e = expansion(kinds, m, rng)
    Q = angles(e, 20, rng)
    # 1e-12 of the terms' sizes: round-off, more where whole turns are taken off.
    assert np.all(np.abs(e(Q) - [by_hand(e, q) for q in Q]) <= 1e-12 * size(e, Q))
    np.testing.assert_allclose(e.design(Q) @ e.coefficients, e(Q), atol=1e-12 * size(e, Q).max())


def test_no_pose_at_all(rng):
    e = expansion(("mixed", "periodic"), 3, rng)
    assert e(np.empty((0, 2))).shape == (0, 3)


def test_nothing_can_be_changed_afterwards(rng):
    terms, coefficients = np.array([[0], [1]]), np.ones((2, 1))
    family = Family(0.0, 1.0, False, 0, (1,), np.eye(2))
    e = Expansion((family,), terms, coefficients)
    terms[0], coefficients[0] = 1, 9.0
    assert e.terms[0, 0] == 0
    assert e.coefficients[0, 0] == 1.0
    for array in (e.terms, e.coefficients, family.matrix):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 5


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"centre": np.nan}, "centre and half_range"),
        ({"half_range": 0.0}, "range above 0"),
        ({"half_range": np.inf}, "finite"),
        ({"harmonics": -1}, "0 or more"),
        ({"degrees": (0, 1)}, "degrees from 1"),
        ({"degrees": (2, 1)}, "ascending"),
        ({"degrees": (1, 1)}, "ascending"),
        ({"degrees": (1, 10**9)}, "to 200"),
        ({"matrix": np.eye(4)}, r"shape \(4, 4\).*\(f, 5\)"),
        ({"matrix": np.full((5, 5), np.nan)}, "finite"),
        ({"matrix": np.empty((0, 5))}, "f >= 1"),
    ],
)
def test_families_that_make_no_sense_are_refused(changes, words):
    good = {"centre": 0.0, "half_range": 1.0, "periodic": False, "harmonics": 1, "degrees": (1, 2), "matrix": np.eye(5)}
    Family(**good)
    refuses("F007", words, Family, **{**good, **changes})


FAMILIES = (Family(0.0, 1.0, False, 0, (1, 2), np.eye(3)), Family(0.0, 1.0, False, 1, (), np.eye(3)))


@pytest.mark.parametrize(
    ("terms", "words"),
    [
        ([[0, 0], [0, 3]], "functions that the families have"),
        ([[0, -1], [0, 0]], "functions that the families have"),
        ([[0, 1], [0, 0]], "sorted by rows"),
        ([[0, 1], [0, 1]], "each once"),
        ([[0], [1]], r"\(t, 2\)"),
        (np.empty((0, 2), dtype=int), "at least 1"),
    ],
)
def test_terms_that_make_no_sense_are_refused(terms, words):
    refuses("F007", words, check_terms, FAMILIES, np.array(terms))
    refuses("F007", words, Expansion, FAMILIES, np.array(terms), np.ones((len(terms), 1)))


def test_coefficients_that_make_no_sense_are_refused():
    terms = np.array([*product(range(3), repeat=2)])
    Expansion(FAMILIES, terms, np.ones((9, 2)))
    for bad, words in (
        (np.ones((8, 1)), "one row for each term"),
        (np.ones(9), r"\(9, m\)"),
        (np.empty((9, 0)), r"\(9, m\)"),
        (np.full((9, 1), np.inf), "finite"),
    ):
        refuses("F007", words, Expansion, FAMILIES, terms, bad)
