"""Regression of a joint's stiffness against joint angles: smooth, positive, through the points.

Three to five distinct angles cannot fix the seven coefficients of a sixth degree. The rest is decided by
the smallest roughness: among all polynomials in ln k that pass through the points, the one whose
coefficients have the least sum of squares, each weighted by (1 + degree)^2, the mean of ln k being free.
That keeps k positive, gives an even law for mirrored points, and adds no bumps that no point asks for.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from robots import InputError, Robot
from robots.arrays import Array, Integers
from robots.schema.description import LogPolynomialLaw


@dataclass(frozen=True)
class SpringPoints:
    """Calibrated points of one spring.

    ``angles`` (m, i) rad in the law's inputs; ``stiffness`` (m,) N m/rad; ``origin`` (m,): "calibrated",
    "mirrored" or "held" (the value an earlier stage assumed there).
    """

    joint: str
    inputs: tuple[str, ...]
    angles: Array
    stiffness: Array
    origin: tuple[str, ...]


def total_degree_exponents(inputs: int, degree: int) -> Integers:
    """All exponents with a sum of at most ``degree``, lowest degree first, (t, inputs)."""
    rows = [e for e in itertools.product(range(degree + 1), repeat=inputs) if sum(e) <= degree]
    return np.array(sorted(rows, key=lambda e: (sum(e), e)), dtype=np.int64)


def fit_law(robot: Robot, points: SpringPoints, degree: int, source: str) -> LogPolynomialLaw:
    """Fit ln k by a polynomial of total degree ``degree`` in the scaled inputs.

    Points with equal angles and different stiffness get their least-squares (geometric) mean.
    Valid inside the robot's joint limits, to which the inputs are scaled.

    Raises
    ------
    InputError
        No points, or a stiffness that is not positive and finite.
    """
    if points.stiffness.size == 0:
        raise InputError(f"regression of {points.joint}: no calibrated point")
    if not (np.isfinite(points.stiffness).all() and (points.stiffness > 0.0).all()):
        raise InputError(
            f"regression of {points.joint}: stiffness",
            value=points.stiffness.tolist(),
            allowed="positive, finite",
        )
    limits = robot.limits[[robot.coordinate_index(name) for name in points.inputs]]
    centre, half = limits.mean(axis=1), np.ptp(limits, axis=1) / 2.0
    exponents = total_degree_exponents(len(points.inputs), degree)
    u = (points.angles - centre) / half
    V = np.prod(u[:, None, :] ** exponents[None], axis=2)
    weight = (1.0 + exponents.sum(axis=1)) ** 2.0
    weight[0] = 1e-3  # the constant term is all but free
    y = np.log(points.stiffness)
    scaled, *_ = np.linalg.lstsq(V / weight, y - y.mean(), rcond=1e-12)
    coefficients = scaled / weight
    coefficients[0] += y.mean()
    return LogPolynomialLaw(
        inputs=points.inputs,
        centre_deg=tuple(np.degrees(centre)),
        half_range_deg=tuple(np.degrees(half)),
        exponents=tuple(tuple(int(e) for e in row) for row in exponents),
        coefficients=tuple(float(c) for c in coefficients),
        source=source,
    )
