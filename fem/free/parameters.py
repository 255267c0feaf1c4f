"""Parameters of a model that can be set free, by name.

Names: ``PLACE.ROW`` is a stiffness (``j2.rz``, also ``j2.stiffness``; ``base.rx``, ``tool.ty``), with rows tx, ty,
tz (N/m) and rx, ry, rz (N m/rad) in the place's axes; ``PLACE.ROW-ROW`` an entry of the compliance off the
diagonal; ``LINK.modulus`` (Pa) and ``LINK.wall`` (m, a factor of all its walls); ``bar.stiffness`` (N/m);
``JOINT.zero`` (rad), ``load.x|y|z`` (m: where the load acts, from the read point, flange axes),
``load.tilt_x|tilt_y`` (rad: the load's direction about the base axes), ``point.x|y|z`` (m: read and loaded point,
flange axes, of all readings: the model's tool point, and points that readings bring themselves); ``JOINT.law[k]`` the
coefficients of ln(stiffness) over joint angles (:mod:`fem.springs`); ``CODE.NAME`` a number of an effect that the
model has (``backlash:j2.gap``). What each kind is: :mod:`fem.free.kinds`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fem.effects.base import PlacedEffect
from fem.free.base import SHIFT, TURN, Kind, Parameter, Scale
from fem.free.kinds import KINDS, of_effect
from fem.free.laws import AXIAL, FreeLaw, law_parameters
from fem.model import ArmModel, JointPart
from fem.springs import LawSpring, SpringLaw
from fem.statics.ports import ROWS
from robots import InputError, ModelDescription
from robots.arrays import Array, Indices

__all__ = ["SHIFT", "TURN", "Kind", "Parameter", "Scale", "known_parameters", "parameter"]


def parameter(model: ArmModel, name: str, effects: Sequence[PlacedEffect] = ()) -> Parameter:
    """The parameter of that name with the model's value and the widest plausible range.

    Coefficients of laws are made by :func:`fem.free.laws.law_parameters`; ``effects``: those that the model has.

    Raises
    ------
    InputError
        No such place or number in this model.
    """
    place, _, what = name.partition(".")
    made = (kind.made(model, place, what) for kind in KINDS)
    found = next((p for p in made if p is not None), None) or of_effect(effects, name)
    if found is None:
        raise InputError("parameter", value=name, allowed="; ".join(known_parameters(model, effects)))
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
            raise InputError("coefficient of a law", value=name, allowed=f"{whole}[0] to [{law.basis.size - 1}]")
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
    def springs(part: JointPart) -> list[SpringLaw]:
        return [part.axial] if row == AXIAL else [one for its_row, one in part.laws if its_row == row]

    having = {part.name: one for part in model.joints for one in springs(part) if isinstance(one, LawSpring)}
    if joint not in having:
        raise InputError(
            "coefficient of a law",
            value=name,
            allowed=f"joints with a law: {', '.join(having) or 'none in this model'}",
        )
    return having[joint]
