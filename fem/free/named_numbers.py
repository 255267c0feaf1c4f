"""Numbers that a finished model holds, by name, ready to be varied.

Names as in :mod:`fem.free.parameters`. Where a calibration makes the coefficients of a law, here they are found in the
law that the joint has already.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fem.effects.base import PlacedEffect
from fem.free.laws import AXIAL, FreeLaw, law_parameters
from fem.free.parameters import Parameter, parameter
from fem.model import ArmModel, JointPart
from fem.springs import LawSpring, SpringLaw
from fem.statics.ports import ROWS
from robots import InputError, ModelDescription
from robots.arrays import Array, Indices

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
