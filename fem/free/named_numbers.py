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
from fem.free.laws import FreeLaw, law_parameters
from fem.free.parameters import GEOMETRIC, Parameter, parameter
from fem.model import ArmModel
from fem.springs import LawSpring
from robots import InputError, ModelDescription
from robots.arrays import Array, Indices

_COEFFICIENT = re.compile(r"(?P<joint>.+)\.law\[(?P<index>\d+)\]")


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
        law = next((one for one in laws if one.joint == joint), None)
        if law is None:
            spring = _law_of(model, name, joint)
            law = FreeLaw(joint, spring.basis, len(parameters))
            laws.append(law)
            parameters += [
                replace(p, value=float(c))
                for p, c in zip(law_parameters(model, joint, spring.basis), spring.coefficients, strict=True)
            ]
        if index >= law.basis.size:
            raise InputError("coefficient of a law", value=name, allowed=f"{joint}.law[0] to [{law.basis.size - 1}]")
        columns.append(law.first + index)
    u = [0.0 if p.kind in GEOMETRIC else p.inner(p.value) for p in parameters]
    return NamedNumbers(tuple(parameters), tuple(laws), np.array(u), np.array(columns, dtype=np.intp))


def described_variables(description: ModelDescription, numbers: NamedNumbers) -> Array:
    """Variables (p,) of the names asked for as the description has them: a joint's zero is its whole zero error."""
    out = numbers.u[numbers.columns]
    for k, column in enumerate(numbers.columns):
        p = numbers.parameters[column]
        if p.kind == "zero":
            error = description.joint[p.index[0]].zero_error
            out[k] = 0.0 if error is None else error.si
    return np.asarray(out)


def _law_of(model: ArmModel, name: str, joint: str) -> LawSpring:
    spring = next((part.axial for part in model.joints if part.name == joint), None)
    if not isinstance(spring, LawSpring):
        having = [part.name for part in model.joints if isinstance(part.axial, LawSpring)]
        raise InputError(
            "coefficient of a law",
            value=name,
            allowed=f"joints with a law: {', '.join(having) or 'none in this model'}",
        )
    return spring
