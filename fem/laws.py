"""Springs over joint angles as free parameters: ln(stiffness) is linear in coefficients of a basis.

Whatever the coefficients, the stiffness stays positive. Bases over scaled angles ``u = (q - centre) / half_range``:
polynomials (total degree up to six, orthogonal or not is the solver's affair: monomials, as in the model file),
Fourier series ``1, cos m q, sin m q`` in the angle itself, tables (piecewise linear between nodes, constant
beyond the ends). Fitted on the angles that were read: beyond them a polynomial runs away.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fem.model import ArmModel
from fem.parameters import TURN, Parameter
from robots import InputError

Array = NDArray[np.float64]

HIGHEST_DEGREE = 6


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
    exponents: NDArray[np.int64]

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


@dataclass(frozen=True)
class FreeLaw:
    """The law of one joint, set free: its basis, and where its coefficients stand among the parameters."""

    joint: str
    basis: Basis
    first: int


def polynomial_basis(model: ArmModel, inputs: tuple[str, ...], degree: int) -> PolynomialBasis:
    """Total degree up to six in one or more joint coordinates, scaled to their limits.

    Raises
    ------
    InputError
        Unknown coordinate, or a degree out of range.
    """
    if not 0 <= degree <= HIGHEST_DEGREE:
        raise InputError("degree of a spring's law", value=degree, allowed=f"0 to {HIGHEST_DEGREE}")
    columns = tuple(model.robot.coordinate_index(name) for name in inputs)
    limits = model.robot.limits[list(columns)]
    powers = sorted(
        (e for e in product(range(degree + 1), repeat=len(columns)) if sum(e) <= degree), key=lambda e: (sum(e), e)
    )
    return PolynomialBasis(columns, limits.mean(axis=1), np.diff(limits, axis=1)[:, 0] / 2.0, np.array(powers))


def law_parameters(model: ArmModel, joint: str, basis: Basis, spread: float = 1.0) -> list[Parameter]:
    """The coefficients of a joint's law, ``JOINT.law[0]`` onwards; they start at the model's constant spring.

    ``spread``: standard deviation of the prior of every coefficient but those of the mean: laws that the data
    do not ask for stay flat.
    """
    if joint not in model.robot.joint_names:
        raise InputError("joint of a law", value=joint, allowed=", ".join(model.robot.joint_names))
    number = model.robot.joint_names.index(joint)
    compliance = float(model.joints[number].axial.compliance(np.zeros((1, model.robot.dof)))[0])
    level = -np.log(compliance) if compliance > 0.0 else np.log(TURN[1])
    table = isinstance(basis, TableBasis)
    low, high = np.log(TURN[0]), np.log(TURN[1])
    out = []
    for k in range(basis.size):
        mean = table or k == 0
        start, span = (float(level), (low, high)) if mean else (0.0, (low - high, high - low))
        prior = None if mean else (0.0, spread)
        out.append(Parameter(f"{joint}.law[{k}]", "law", joint, (k,), "ln(N m/rad)", start, *span, "linear", prior))
    return out
