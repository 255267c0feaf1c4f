"""Joint springs: stiffness about the joint axis, constant or depending on joint angles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from robots import InputError, Robot
from robots.schema import LogPolynomialLaw

Array = NDArray[np.float64]


class SpringLaw(Protocol):
    """A rotational compliance that may depend on the pose."""

    def compliance(self, q: Array) -> Array:
        """Compliance (n,) in rad/(N m) at poses q (n, dof) rad."""
        ...


@dataclass(frozen=True)
class ConstantSpring:
    """The same stiffness in every pose, N m/rad; infinite means rigid."""

    stiffness: float

    def __post_init__(self) -> None:
        if not self.stiffness > 0.0:
            raise InputError("joint stiffness", value=self.stiffness, allowed="greater than 0 N m/rad (inf is rigid)")

    def compliance(self, q: Array) -> Array:
        """See :class:`SpringLaw`."""
        return np.full(len(q), 1.0 / self.stiffness)


@dataclass(frozen=True)
class LogPolynomialSpring:
    """``k = exp(sum_t c_t prod_i u_i^e_ti)``, ``u_i = (q_i - centre_i) / half_range_i``.

    ``columns``: the joint coordinates used; ``exponents`` (t, i); ``coefficients`` (t,).
    Meant for |u| <= 1: a sixth degree runs away beyond the angles it was fitted on.
    """

    columns: tuple[int, ...]
    centre: Array
    half_range: Array
    exponents: NDArray[np.int64]
    coefficients: Array

    def compliance(self, q: Array) -> Array:
        """See :class:`SpringLaw`."""
        u = (q[:, list(self.columns)] - self.centre) / self.half_range
        terms = np.prod(u[:, None, :] ** self.exponents[None], axis=2)
        return np.asarray(np.exp(-(terms @ self.coefficients)))


RIGID = ConstantSpring(np.inf)


def spring_from(robot: Robot, law: LogPolynomialLaw) -> LogPolynomialSpring:
    """Turn a law from a model file into a spring of this robot."""
    return LogPolynomialSpring(
        columns=tuple(robot.coordinate_index(name) for name in law.inputs),
        centre=np.radians(law.centre_deg),
        half_range=np.radians(law.half_range_deg),
        exponents=np.array(law.exponents, dtype=np.int64).reshape(len(law.coefficients), len(law.inputs)),
        coefficients=np.array(law.coefficients),
    )
