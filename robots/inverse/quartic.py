"""Real roots of equations in the cosine and sine of one angle, for many right-hand sides at once."""

from __future__ import annotations

import numpy as np

from robots.arrays import Array, Bools

# A root this far (rad) off the real axis may be a double one spread by rounding; the equation itself decides.
NEARLY_REAL = 1e-5
# Left over from an equation, over the sum of its coefficients, where it counts as met: rounding, a hundredfold.
MET = 1e-13
# Slope at a root, over the same sum, below which the root counts as double.
DOUBLE = 1e-7


def line_roots(cosine: float, sine: float, right: Array) -> tuple[Array, Bools]:
    """Angles with ``cosine * cos + sine * sin = right`` (k,): (2, k) rad, NaN if there are none; and double ones."""
    size = float(np.hypot(cosine, sine))
    rest = (size - right) * (size + right)
    half = np.arctan2(np.sqrt(np.maximum(rest, 0.0)), right)
    angle = np.arctan2(sine, cosine) + np.stack([-half, half])
    angle[:, rest < -1e-10 * size**2] = np.nan
    return angle, np.asarray(np.abs(np.sin(np.stack([half, half]))) < DOUBLE)


def quartic_roots(constant: Array, cosine: Array, sine: Array, mixed: Array) -> tuple[Array, Bools]:
    """Angles x with ``constant + cosine cos x + sine sin x + (cos^2, cos sin, sin^2) . mixed = 0``.

    Parameters
    ----------
    constant, cosine, sine : (k,)
    mixed : (3,) the same for all

    Returns
    -------
    angle : (4, k) rad, rising, NaN for the missing ones at the end; a double root comes twice
    double : (4, k) which are double roots

    Notes
    -----
    The tangent of half the angle, counted from where the equation is farthest from zero, makes a quartic with a
    safe leading coefficient; its roots are the eigenvalues of the companion matrix. Newton's method afterwards was
    tried and changed nothing.
    """
    A0, A1, B1 = constant + 0.5 * (mixed[0] + mixed[2]), cosine, sine
    A2, B2 = np.full_like(A0, 0.5 * (mixed[0] - mixed[2])), np.full_like(A0, 0.5 * mixed[1])
    size = np.abs(A0) + np.abs(A1) + np.abs(B1) + np.abs(A2) + np.abs(B2) + 1e-300
    # Five values fix the equation, so not all eight of these can be small.
    tried = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)[:, None]
    value, _ = _value((A0, A1, B1, A2, B2), tried)
    start = tried[np.abs(value).argmax(axis=0), 0] - np.pi
    c1, s1, c2, s2 = np.cos(start), np.sin(start), np.cos(2.0 * start), np.sin(2.0 * start)
    a1, b1, a2, b2 = A1 * c1 + B1 * s1, B1 * c1 - A1 * s1, A2 * c2 + B2 * s2, B2 * c2 - A2 * s2
    leading = A0 - a1 + a2
    lower = np.stack([A0 + a1 + a2, 2.0 * b1 + 4.0 * b2, 2.0 * A0 - 6.0 * a2, 2.0 * b1 - 4.0 * b2])
    companion = np.zeros((len(A0), 4, 4))
    companion[:, [1, 2, 3], [0, 1, 2]] = 1.0
    companion[:, :, 3] = -(lower / np.where(leading == 0.0, 1e-300, leading)).T
    t = np.linalg.eigvals(np.clip(companion, -1e200, 1e200)).T
    real = np.abs(t.imag) < NEARLY_REAL * (1.0 + np.abs(t) ** 2)
    angle = start + 2.0 * np.arctan(t.real)
    value, slope = _value((A0, A1, B1, A2, B2), angle)
    angle = np.where(real & (np.abs(value) < MET * size), angle, np.nan)
    angle -= 2.0 * np.pi * np.round(angle / (2.0 * np.pi))
    order = np.argsort(angle, axis=0)  # NaN last
    slope = np.take_along_axis(slope, order, axis=0)
    return np.take_along_axis(angle, order, axis=0), np.asarray(np.abs(slope) < DOUBLE * size)


def _value(terms: tuple[Array, Array, Array, Array, Array], x: Array) -> tuple[Array, Array]:
    """Value and slope of the equation, by its Fourier terms, at angles x (m, k) or (m, 1)."""
    A0, A1, B1, A2, B2 = terms
    c, s, c2, s2 = np.cos(x), np.sin(x), np.cos(2.0 * x), np.sin(2.0 * x)
    return A0 + A1 * c + B1 * s + A2 * c2 + B2 * s2, B1 * c - A1 * s + 2.0 * (B2 * c2 - A2 * s2)
