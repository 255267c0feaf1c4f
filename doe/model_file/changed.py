"""Values that a user gives for single parameters of a model, put into its description."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from doe.model_file.applied import check_passive
from fem.arm import Arm
from fem.effects import described_effects
from fem.free.base import Parameter, Tables
from fem.free.parameters import parameter
from robots import ModelDescription
from robots.errors import InputError, raise_any
from robots.schema.units import dimension_of, factor

GIVEN_SOURCE = "given"
_VALUE = re.compile(r"\s*(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(?P<unit>.*?)\s*")


def changed(arm: Arm, values: Mapping[str, str | float], what: str = "value") -> ModelDescription:
    """The arm's description with other values of some parameters, each marked as given by the user.

    Parameters
    ----------
    values : parameter name as in :func:`fem.free.parameters.parameter` -> number, or text with a unit of the same
        dimension ("1.4e6", "70 GPa"); without a unit it is in SI. Zero errors of joints and shifts of points and loads
        are counted from where the model has them
    what : how errors call the values

    Raises
    ------
    InputError
        An unknown parameter, a value that is no finite number, beyond the widest plausible range or in a unit of
        another dimension, or stiffnesses that no passive part has.
    """
    data: dict[str, Any] = arm.description.model_dump(by_alias=True)
    tables, faults = Tables(data), []
    effects = described_effects(arm.description, arm.model, arm.own)
    for name, text in values.items():
        try:
            p = parameter(arm.model, name, effects)
            value = _value(p, text, what)
        except InputError as fault:
            faults.append(fault)
            continue
        p.kind.put(p, value, tables, _figure)
    raise_any(what, faults)
    data["sources"] = {GIVEN_SOURCE: "given by the user in place of the model's own", **data["sources"]}
    description = ModelDescription.model_validate(data)
    check_passive(description)
    return description


def _figure(value: float, unit: str) -> dict[str, Any]:
    return {"value": float(value), "unit": unit, "source": GIVEN_SOURCE, "note": "given by the user"}


def _value(p: Parameter, text: str | float, what: str) -> float:
    """SI value of a parameter from a number, or from text with or without a unit."""
    allowed = f"{p.lower:.4g} to {p.upper:.4g} {p.unit}"
    found = _VALUE.fullmatch(str(text))
    value = math.nan
    if found is not None:
        dimension = dimension_of(p.unit)
        try:
            value = float(found["number"]) * factor(dimension, found["unit"] or p.unit)
        except ValueError as error:
            raise InputError(
                f"{what} of {p.name}", code="M002", value=str(text), allowed=allowed, remedy=str(error)
            ) from None
    if not p.lower <= value <= p.upper:
        raise InputError(
            f"{what} of {p.name}",
            code="M002",
            value=str(text),
            allowed=allowed,
            remedy=f"write a number in {p.unit}, or with its unit",
        )
    return value
