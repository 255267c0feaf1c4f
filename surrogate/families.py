"""One-dimensional functions of a joint angle, orthonormal over its range.

Orthonormal functions change nothing about what a basis can represent, but the least squares problem is then about as
well conditioned as the choice of poses allows, and neither a narrow range nor a high degree spoils the digits.
"""

from __future__ import annotations

import numpy as np

from robots.arrays import Array
from robots.errors import InputError
from surrogate.expansion import Family

# One-dimensional functions closer to dependent than this leave fewer than four digits.
_WORST_RECOMBINATION = 1e12
# A function that the ones before it represent to this share adds nothing but noise; polynomials are taken by what they
# add, tenth by tenth.
_DEPENDENT = 1e-7
_SHARES = tuple(10.0**-k for k in range(1, 8))
# Functions are sums of harmonics and polynomials; with larger factors than this fewer than eight digits are left.
_LARGEST = 1e7


def polynomial_family(lower: float, upper: float, degree: int, *, periodic: bool = False) -> Family:
    """Legendre polynomials of degree 0 to ``degree`` over lower to upper (rad), orthonormal for the mean."""
    norm = np.sqrt(2.0 * np.arange(degree + 1) + 1.0)
    return Family(*_centre(lower, upper), periodic, 0, tuple(range(1, degree + 1)), np.diag(norm))


def trigonometric_family(lower: float, upper: float, order: int, *, periodic: bool = False) -> Family:
    """``1, cos q, sin q, ..., cos m q, sin m q`` made orthonormal over lower to upper (rad).

    Raises
    ------
    InputError
        The range is so narrow that double precision cannot tell the functions apart.
    """
    centre, half = _centre(lower, upper)
    _, r = np.linalg.qr(_weighted(centre, half, order, ()).T)
    condition = np.linalg.cond(r)
    if not condition < _WORST_RECOMBINATION:
        raise InputError(
            f"trigonometric basis of order {order} over a range of {2.0 * np.degrees(half):.6g} deg",
            code="S003",
            value=f"functions that agree to 1 part in {condition:.1g}",
            allowed=f"up to {_WORST_RECOMBINATION:.0e}",
            remedy="lower the order, widen the range, or use the polynomial basis",
        )
    matrix = np.linalg.inv(r * np.sign(np.diag(r))[:, None]).T
    return Family(centre, half, periodic, order, (), matrix)


def mixed_family(lower: float, upper: float, order: int, degree: int, *, periodic: bool = False) -> Family:
    """The harmonics up to ``order``, then what Legendre polynomials up to ``degree`` add to them; orthonormal.

    The harmonics carry the arm's geometry, in which an angle enters by its sine and cosine; the polynomials what else
    varies with the angle, such as a spring's stiffness. Over a short range both are nearly the same, so polynomials
    that are least like the functions before them come first, and what those represent is left out: taken by ascending
    degree, the last of 12 degrees over 80 deg would be differences of numbers of 1e16, which is noise.
    """
    centre, half = _centre(lower, upper)
    degrees = tuple(range(1, degree + 1))
    raw = _weighted(centre, half, order, degrees)
    found, rows = np.empty((0, raw.shape[1])), np.empty((0, len(raw)))
    size = np.linalg.norm(raw, axis=1)
    harmonics, left = list(range(1 + 2 * order)), list(range(1 + 2 * order, len(raw)))
    for candidates, least in [(harmonics, _DEPENDENT), *((left, share) for share in _SHARES)]:
        for i in list(candidates):
            rest, row = raw[i], np.eye(len(raw))[i]
            # Twice is enough (Kahan and Parlett): one pass leaves what cancellation lost.
            for _ in range(2):
                share = found @ rest
                rest, row = rest - share @ found, row - share @ rows
            length = float(np.linalg.norm(rest))
            if length > least * size[i] and np.abs(row).max() <= _LARGEST * length:
                found, rows = np.vstack([found, rest / length]), np.vstack([rows, row / length])
                candidates.remove(i)
    return Family(centre, half, periodic, order, degrees, rows)


def _centre(lower: float, upper: float) -> tuple[float, float]:
    return 0.5 * (lower + upper), 0.5 * (upper - lower)


def _weighted(centre: float, half: float, order: int, degrees: tuple[int, ...]) -> Array:
    """The raw functions at quadrature nodes, scaled so that products of rows are mean values."""
    # Gauss-Legendre is exact to round-off here: 20 nodes or more for each turn of the fastest product of harmonics, and
    # twice as many as products of polynomials need.
    count = 40 + int(40.0 * max(order, 1) * half / np.pi) + 2 * max(degrees, default=0)
    u, w = np.polynomial.legendre.leggauss(count)
    size = 1 + 2 * order + len(degrees)
    plain = Family(centre, half, False, order, degrees, np.eye(size))
    return np.asarray(plain.raw(centre + half * u) * np.sqrt(0.5 * w))
