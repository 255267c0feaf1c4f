"""Joint springs: stiffness about the joint axis, constant or depending on joint angles.

Bases over joint angles are for ln(stiffness): it stays positive whatever the weights.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from robots import InputError, Robot
from robots.arrays import Array, Integers
from robots.schema.springs import LogFourierLaw, LogPolynomialLaw, SpringLawTable


class Basis(Protocol):
    """Functions of the pose that ln(stiffness) is a combination of."""

    @property
    def size(self) -> int:
        """How many functions."""
        ...

    def __call__(self, q: Array) -> Array:
        """Values (n, size) at poses q (n, dof) rad."""
        ...


@dataclass(frozen=True)
class PolynomialBasis:
    """Monomials in scaled angles: ``columns`` of the pose, ``centre``, ``half_range`` rad, ``exponents`` (t, i)."""

    columns: tuple[int, ...]
    centre: Array
    half_range: Array
    exponents: Integers

    @property
    def size(self) -> int:
        """See :class:`Basis`."""
        return len(self.exponents)

    def __call__(self, q: Array) -> Array:
        """See :class:`Basis`."""
        u = (q[:, list(self.columns)] - self.centre) / self.half_range
        return np.asarray(np.prod(u[:, None, :] ** self.exponents[None], axis=2))


@dataclass(frozen=True)
class FourierBasis:
    """``1, cos q, sin q, ... cos m q, sin m q`` of the angle in one column."""

    column: int
    order: int

    @property
    def size(self) -> int:
        """See :class:`Basis`."""
        return 2 * self.order + 1

    def __call__(self, q: Array) -> Array:
        """See :class:`Basis`."""
        angles = q[:, self.column, None] * np.arange(1, self.order + 1)
        waves = np.stack([np.cos(angles), np.sin(angles)], axis=2).reshape(len(q), -1)
        return np.hstack([np.ones((len(q), 1)), waves])


@dataclass(frozen=True)
class TableBasis:
    """Piecewise linear between ``nodes`` (t,) rad, in rising order, of the angle in one column."""

    column: int
    nodes: Array

    @property
    def size(self) -> int:
        """See :class:`Basis`."""
        return len(self.nodes)

    def __call__(self, q: Array) -> Array:
        """See :class:`Basis`."""
        eye = np.eye(self.size)
        return np.stack([np.interp(q[:, self.column], self.nodes, row) for row in eye], axis=1)


# Natural logarithm of a stiffness in N m/rad; no joint comes near, and its square is still a number.
WIDEST_LOG = 100.0


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
            raise InputError(
                "joint stiffness", code="M002", value=self.stiffness, allowed="greater than 0 N m/rad (inf is rigid)"
            )

    def compliance(self, q: Array) -> Array:
        """See :class:`SpringLaw`."""
        return np.full(len(q), 1.0 / self.stiffness)


@dataclass(frozen=True)
class LawSpring:
    """``k = exp(sum_t c_t b_t(q))`` N m/rad with functions b_t of the pose.

    Polynomials are meant for the angles they were fitted on: a sixth degree runs away beyond them.
    """

    basis: Basis
    coefficients: Array

    def compliance(self, q: Array) -> Array:
        """See :class:`SpringLaw`."""
        log = self.basis(q) @ self.coefficients
        if not (np.abs(log) <= WIDEST_LOG).all():
            raise InputError(
                "stiffness of a joint by its law",
                code="M002",
                value=f"exp({log[np.argmax(np.abs(np.nan_to_num(log, nan=np.inf)))]:.3g}) N m/rad",
                allowed=f"exp(-{WIDEST_LOG:g}) to exp({WIDEST_LOG:g})",
                remedy="check the law's coefficients and angles in the model; beyond the angles it was fitted on it "
                "runs away",
            )
        return np.asarray(np.exp(-log))


RIGID = ConstantSpring(np.inf)


def spring_from(robot: Robot, law: SpringLawTable) -> LawSpring:
    """Turn a law from a model file into a spring of this robot."""
    if isinstance(law, LogPolynomialLaw):
        basis = PolynomialBasis(
            columns=tuple(robot.coordinate_index(name) for name in law.inputs),
            centre=np.radians(law.centre_deg),
            half_range=np.radians(law.half_range_deg),
            exponents=np.array(law.exponents, dtype=np.int64).reshape(len(law.coefficients), len(law.inputs)),
        )
        return LawSpring(basis, np.array(law.coefficients))
    column = robot.coordinate_index(law.input)
    if isinstance(law, LogFourierLaw):
        return LawSpring(FourierBasis(column, len(law.coefficients) // 2), np.array(law.coefficients))
    return LawSpring(TableBasis(column, np.radians(law.nodes_deg)), np.log(law.stiffness_Nm_per_rad))


@dataclass(frozen=True)
class SumSpring:
    """A spring in series with another compliance, rad/(N m)."""

    spring: SpringLaw
    added: float

    def compliance(self, q: Array) -> Array:
        """See :class:`SpringLaw`."""
        return np.asarray(self.spring.compliance(q) + self.added)


@dataclass(frozen=True)
class VaryingSpring:
    """A spring whose compliance varies by a share over the pose: ``c(q) (1 + share(q))``, never below a tenth of c."""

    spring: SpringLaw
    share: Callable[[Array], Array]

    def compliance(self, q: Array) -> Array:
        """See :class:`SpringLaw`."""
        return np.asarray(self.spring.compliance(q) * np.maximum(1.0 + self.share(q), 0.1))
