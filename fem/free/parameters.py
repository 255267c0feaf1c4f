"""Parameters of a model that can be set free, by name.

Names: ``PLACE.ROW`` is a stiffness (``j2.rz``, also ``j2.stiffness``; ``base.rx``, ``tool.ty``), with rows tx, ty,
tz (N/m) and rx, ry, rz (N m/rad) in the place's axes; ``PLACE.ROW-ROW`` an entry of the compliance off the
diagonal; ``LINK.modulus`` (Pa) and ``LINK.wall`` (m, a factor of all its walls); ``bar.stiffness`` (N/m);
``JOINT.zero`` (rad), ``load.x|y|z`` (m: where the load acts, from the read point, flange axes),
``load.tilt_x|tilt_y|tilt_z`` (rad: the load's direction about the base axes), ``frame.rx|ry|rz`` (rad: the table's
frame of forces and displacements about the base axes), ``point.x|y|z`` (m: read and loaded point,
flange axes, of all readings: the model's tool point, and points that readings bring themselves); ``JOINT.law[k]`` the
coefficients of ln(stiffness) over joint angles (:mod:`fem.springs`); ``CODE.NAME`` a number of an effect that the
model has (``backlash:j2.gap``). What each kind is: :mod:`fem.free.kinds`.

Springs over joint angles: ln(stiffness) is linear in coefficients of a basis, so whatever these are, the stiffness
stays positive. Bases over scaled angles ``u = (q - centre) / half_range``: polynomials (total degree up to six;
monomials, as in the model file; the solver orthogonalises them), Fourier series ``1, cos m q, sin m q`` in the angle
itself, tables (piecewise linear between nodes, constant beyond the ends). Fitted on the angles that were read: beyond
them a polynomial runs away.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from fem.effects.base import PlacedEffect
from fem.free.base import SHIFT, TURN, Kind, Parameter, Scale
from fem.free.kinds import KINDS, LAW, of_effect
from fem.model import ArmModel
from fem.springs import Basis, FourierBasis, LawSpring, PolynomialBasis, TableBasis
from fem.statics.ports import ROWS
from robots import InputError, ModelDescription, require_one_of
from robots.arrays import Array, Indices

__all__ = [
    "SHIFT",
    "TURN",
    "Basis",
    "FourierBasis",
    "FreeLaw",
    "Kind",
    "Parameter",
    "PolynomialBasis",
    "Scale",
    "TableBasis",
    "known_parameters",
    "law_parameters",
    "parameter",
    "polynomial_basis",
]

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
        raise InputError("degree of a spring's law", code="M001", value=degree, allowed=f"0 to {HIGHEST_DEGREE}")
    columns = tuple(model.robot.coordinate_index(name) for name in inputs)
    limits = model.robot.limits[list(columns)]
    powers = sorted(
        (e for e in product(range(degree + 1), repeat=len(columns)) if sum(e) <= degree), key=lambda e: (sum(e), e)
    )
    return PolynomialBasis(columns, limits.mean(axis=1), np.diff(limits, axis=1)[:, 0] / 2.0, np.array(powers))


def law_compliance(model: ArmModel, law: FreeLaw, q: Array) -> Array:
    """Compliance (n,) at poses q (n, dof) rad of what the model has in a free law's place."""
    joint = model.joints[model.robot.joint_names.index(law.joint)]
    return np.asarray(sum((one.compliance(q) for one in joint.springs_about(law.row)), np.zeros(len(q))))


def law_parameters(model: ArmModel, joint: str, basis: Basis, spread: float = 1.0, row: int = AXIAL) -> list[Parameter]:
    """The coefficients of a joint's law, ``JOINT.law[0]`` onwards; they start at the model's constant spring.

    ``spread``: standard deviation of the prior of every coefficient but those of the mean: laws that the data
    do not ask for stay flat. ``row`` as in :class:`FreeLaw`: of a bearing law they are ``JOINT.ROW.law[0]`` onwards.
    """
    require_one_of("joint of a law", joint, model.robot.joint_names, code="M001")
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


def parameter(model: ArmModel, name: str, effects: Sequence[PlacedEffect] = ()) -> Parameter:
    """The parameter of that name with the model's value and the widest plausible range.

    Coefficients of laws are made by :func:`law_parameters`; ``effects``: those that the model has.

    Raises
    ------
    InputError
        No such place or number in this model.
    """
    place, _, what = name.partition(".")
    made = (kind.made(model, place, what) for kind in KINDS)
    found = next((p for p in made if p is not None), None) or of_effect(effects, name)
    if found is None:
        raise InputError("parameter", code="M001", value=name, allowed="; ".join(known_parameters(model, effects)))
    return replace(found, name=name)


def known_parameters(model: ArmModel, effects: Sequence[PlacedEffect] = ()) -> list[str]:
    """The names that :func:`parameter` takes for this model, in words."""
    out = [words for kind in KINDS for words in kind.known(model)]
    for one in effects:
        names = [p.name for p in one.effect.parameters]
        if names:
            out.append(f"{one.effect.code}.{names[0] if len(names) == 1 else '{' + '|'.join(names) + '}'}")
    return out


_COEFFICIENT = re.compile(r"(?P<joint>.+?)(?:\.(?P<row>t[xyz]|r[xyz]))?\.law\[(?P<index>\d+)\]")


@dataclass(frozen=True)
class NamedNumbers:
    """Parameters for a :class:`fem.free.model.FreeModel`, laws whole.

    ``u`` (P,): its variables at the model's own numbers (angles and points: 0, they are counted from the model's);
    ``columns`` (p,): where the p names asked for stand among the P parameters.
    """

    parameters: tuple[Parameter, ...]
    laws: tuple[FreeLaw, ...]
    u: Array
    columns: Indices


def named_numbers(model: ArmModel, names: Sequence[str], effects: Sequence[PlacedEffect] = ()) -> NamedNumbers:
    """The numbers of these names; ``effects``: those that the arm has beyond ``model``.

    Raises
    ------
    InputError
        A name that leads to no number of this model, or a coefficient that its law does not have.
    """
    parameters: list[Parameter] = []
    laws: list[FreeLaw] = []
    columns = []
    for name in names:
        match = _COEFFICIENT.fullmatch(name)
        if match is None:
            columns.append(len(parameters))
            parameters.append(parameter(model, name, effects))
            continue
        joint, index = match["joint"], int(match["index"])
        row = AXIAL if match["row"] is None else ROWS.index(match["row"])
        law = next((one for one in laws if (one.joint, one.row) == (joint, row)), None)
        if law is None:
            spring = _law_of(model, name, joint, row)
            law = FreeLaw(joint, spring.basis, len(parameters), row)
            laws.append(law)
            parameters += [
                replace(p, value=float(c))
                for p, c in zip(law_parameters(model, joint, spring.basis, row=row), spring.coefficients, strict=True)
            ]
        if index >= law.basis.size:
            whole = name.rpartition("[")[0]
            raise InputError(
                "coefficient of a law", code="M001", value=name, allowed=f"{whole}[0] to [{law.basis.size - 1}]"
            )
        columns.append(law.first + index)
    u = [0.0 if p.kind.shifts else p.inner(p.value) for p in parameters]
    return NamedNumbers(tuple(parameters), tuple(laws), np.array(u), np.array(columns, dtype=np.intp))


def described_variables(description: ModelDescription, numbers: NamedNumbers) -> Array:
    """Variables (p,) of the names asked for as the description has them: a joint's zero is its whole zero error."""
    out = numbers.u[numbers.columns]
    for k, column in enumerate(numbers.columns):
        p = numbers.parameters[column]
        own = p.kind.variable(p, description)
        out[k] = out[k] if own is None else own
    return np.asarray(out)


def _law_of(model: ArmModel, name: str, joint: str, row: int) -> LawSpring:
    springs = [(part.name, one) for part in model.joints for one in part.springs_about(row)]
    having = {joint: one for joint, one in springs if isinstance(one, LawSpring)}
    if joint not in having:
        raise InputError(
            "coefficient of a law",
            code="M001",
            value=name,
            allowed=f"joints with a law: {', '.join(having) or 'none in this model'}",
        )
    return having[joint]
