"""Springs over joint angles as free parameters: ln(stiffness) is linear in coefficients of a basis.

Whatever the coefficients, the stiffness stays positive. Bases over scaled angles ``u = (q - centre) / half_range``:
polynomials (total degree up to six; monomials, as in the model file; the solver orthogonalises them),
Fourier series ``1, cos m q, sin m q`` in the angle itself, tables (piecewise linear between nodes, constant
beyond the ends). Fitted on the angles that were read: beyond them a polynomial runs away.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from fem.free.base import SHIFT, TURN, Parameter
from fem.free.kinds import LAW
from fem.model import ArmModel
from fem.springs import Basis, FourierBasis, PolynomialBasis, TableBasis
from fem.statics.ports import ROWS
from robots import InputError
from robots.arrays import Array

__all__ = ["Basis", "FourierBasis", "FreeLaw", "PolynomialBasis", "TableBasis", "law_parameters", "polynomial_basis"]

HIGHEST_DEGREE = 6
# Row of a joint's axes that its spring acts in.
AXIAL = 5


@dataclass(frozen=True)
class FreeLaw:
    """The law of one joint, set free: its basis, and where its coefficients stand among the parameters.

    ``row``: of the joint's axes, 0 to 5; 5 is the spring about the axis, the others are bearing laws.
    """

    joint: str
    basis: Basis
    first: int
    row: int = AXIAL


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


def law_compliance(model: ArmModel, law: FreeLaw, q: Array) -> Array:
    """Compliance (n,) at poses q (n, dof) rad of what the model has in a free law's place."""
    joint = model.joints[model.robot.joint_names.index(law.joint)]
    springs = [joint.axial] if law.row == AXIAL else [one for row, one in joint.laws if row == law.row]
    return np.asarray(sum((one.compliance(q) for one in springs), np.zeros(len(q))))


def law_parameters(model: ArmModel, joint: str, basis: Basis, spread: float = 1.0, row: int = AXIAL) -> list[Parameter]:
    """The coefficients of a joint's law, ``JOINT.law[0]`` onwards; they start at the model's constant spring.

    ``spread``: standard deviation of the prior of every coefficient but those of the mean: laws that the data
    do not ask for stay flat. ``row`` as in :class:`FreeLaw`: of a bearing law they are ``JOINT.ROW.law[0]`` onwards.
    """
    if joint not in model.robot.joint_names:
        raise InputError("joint of a law", value=joint, allowed=", ".join(model.robot.joint_names))
    compliance = float(law_compliance(model, FreeLaw(joint, basis, 0, row), np.zeros((1, model.robot.dof)))[0])
    softest, stiffest = SHIFT if row < 3 else TURN
    level = -np.log(compliance) if compliance > 0.0 else np.log(stiffest)
    table = isinstance(basis, TableBasis)
    low, high = np.log(softest), np.log(stiffest)
    name, index = (f"{joint}.law", ()) if row == AXIAL else (f"{joint}.{ROWS[row]}.law", (row,))
    unit = "ln(N/m)" if row < 3 else "ln(N m/rad)"
    out = []
    for k in range(basis.size):
        mean = table or k == 0
        start, span = (float(level), (low, high)) if mean else (0.0, (low - high, high - low))
        prior = None if mean else (0.0, spread)
        out.append(Parameter(f"{name}[{k}]", LAW, joint, (*index, k), unit, start, *span, "linear", prior))
    return out
