"""A parameter of a model that can be set free, and what kinds of parameters there can be."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, Protocol

import numpy as np

from fem.model import ArmModel
from fem.statics.ports import BASE, ROWS, TOOL, Port
from robots import InputError, ModelDescription
from robots.arrays import Array
from robots.schema.units import dimension_of, factor

Table = dict[str, Any]


class Figure(Protocol):
    """What makes a figure: its value with unit, source and what is known of it."""

    def __call__(self, value: float, unit: str) -> Table:
        """The figure as a file has it."""
        ...


class Tables:
    """The tables of a description (:meth:`pydantic.BaseModel.model_dump`), to be changed in place.

    ``points``: table and key of what a shift of the readings' point moves.
    """

    def __init__(self, data: Table, points: tuple[tuple[str, str], ...] = (("tool", "xyz"),)) -> None:
        self.data = data
        self.points = points

    def of(self, kind: str, name: str) -> Table:
        """The table of a joint or a link."""
        found: Table = next(one for one in self.data[kind] if one["name"] == name)
        return found

    def place(self, name: str) -> Table:
        """Table of a place's stiffness in six directions, made if it is not there."""
        if name == BASE:
            self.data["base"] = self.data["base"] or {}
            return _with_entries(self.data["base"])
        if name == TOOL:
            zero = {"value": (0.0, 0.0, 0.0), "unit": "m", "source": "definition"}
            self.data["tool"] = self.data["tool"] or {"xyz": zero}
            self.data["tool"]["stiffness"] = self.data["tool"].get("stiffness") or {}
            return _with_entries(self.data["tool"]["stiffness"])
        joint = self.of("joint", name)
        if joint.get("bearing") is None:
            joint["bearing"] = {}
            for rows, key in ((ROWS[:3], "translational_stiffness"), (ROWS[3:5], "tilt_stiffness")):
                if joint.get(key) is not None:
                    joint["bearing"] |= {row: dict(joint[key]) for row in rows}
                joint[key] = None
        return _with_entries(joint["bearing"])

    def shift(self, table: str, key: str, index: int, name: str, added: Table) -> None:
        """Add a figure in m or rad to one component of a triple of lengths or angles."""
        dimension = dimension_of(added["unit"])
        self.data[table] = self.data[table] or {}
        old: Mapping[str, Any] | None = self.data[table].get(key)
        values = [0.0, 0.0, 0.0] if old is None else [v * factor(dimension, old["unit"]) for v in old["value"]]
        values[index] += added["value"]
        note = f"{name}: {added['note']}"
        if old is not None and old.get("source") == added["source"]:
            note = f"{old['note']}; {note}"
        self.data[table][key] = {**added, "value": tuple(values), "note": note}


def _with_entries(place: Table) -> Table:
    place["entry"] = list(place.get("entry") or ())
    return place


Scale = Literal["compliance", "log", "linear"]
Shifts = Literal["zero", "load", "tilt", "point", "frame"]
# Of a link by its wall (m): flexibility and its derivative by ln(wall).
Flexibility = Callable[[float], tuple[Array, Array]]

# Wider than anything plausible: an estimate that ends there is reported as standing at a bound.
TURN, SHIFT = (1e3, 1e9), (1e4, 1e12)
# The widest range is often that of the softest parts there are; parts of arms are ten thousand times stiffer.
OF_WIDEST = 1e-4


@dataclass(frozen=True)
class Parameter:
    """A number set free.

    ``value``: the model's own (inf where it is rigid), ``lower`` to ``upper``: the range searched, all in SI
    ``unit``. ``scale``: how an estimator moves it, so that the arm is linear or nearly so: 1/value, ln value or
    the value. ``prior``: mean and standard deviation, of ln value where the value is positive, or None.
    ``place``, ``kind`` and ``index`` say where it sits.
    """

    name: str
    kind: Kind
    place: str
    index: tuple[int, ...]
    unit: str
    value: float
    lower: float
    upper: float
    scale: Scale
    prior: tuple[float, float] | None = None

    def inner(self, value: float) -> float:
        """The estimator's variable for a value."""
        if self.scale == "compliance":
            return 1.0 / value
        return float(np.log(value)) if self.scale == "log" else value

    def outer(self, u: float) -> float:
        """The value for an estimator's variable."""
        if self.scale == "compliance":
            return 1.0 / u if u != 0.0 else np.inf
        return float(np.exp(u)) if self.scale == "log" else u

    @property
    def inner_bounds(self) -> tuple[float, float]:
        """Bounds of the estimator's variable, lower first."""
        ends = self.inner(self.lower), self.inner(self.upper)
        return min(ends), max(ends)

    @property
    def is_linear(self) -> bool:
        """Whether the displacement is linear in the estimator's variable."""
        return self.kind.is_linear

    @property
    def is_logarithm(self) -> bool:
        """Whether the estimator's variable is a logarithm."""
        return self.scale == "log" or self.kind.of_law

    @property
    def spring_of(self) -> str | None:
        """The joint whose constant spring about its axis this is, else None."""
        return self.kind.spring_of(self)

    def between(self, lower: float, upper: float) -> Parameter:
        """Copy with another range; raises InputError if it is none."""
        positive = self.scale != "linear"
        if not (lower < upper and np.isfinite([lower, upper]).all() and (lower > 0.0 or not positive)):
            raise InputError(
                f"range of {self.name} ({self.unit})",
                code="M002",
                value=f"{lower:g} to {upper:g}",
                allowed=f"{'0 < ' if positive else ''}lower < upper, finite",
            )
        return replace(self, lower=lower, upper=upper)


@dataclass(frozen=True)
class Kind:
    """What parameters of a kind are called, do to an arm, and are in a model file; one object a kind.

    ``is_linear``: displacements are linear in the estimator's variable. ``shifts``: what of the loaded poses, or of
    the joints' zeros, they move (derivatives are then differences); None for what acts at a port.
    ``of_law``, ``of_effect``: coefficients of a spring's law, numbers of an effect. ``has_sections``: the link's
    sections are needed to vary them (:func:`fem.elements.walls.wall_flexibilities`).
    """

    name: str
    is_linear: bool = False
    shifts: Shifts | None = None
    of_law: bool = False
    of_effect: bool = False
    has_sections: bool = False

    def made(self, model: ArmModel, place: str, what: str) -> Parameter | None:
        """The parameter ``PLACE.WHAT`` of the model over the widest plausible range, None if it is not of this kind."""
        return None

    def known(self, model: ArmModel) -> Iterator[str]:
        """Names of this kind that the model has, in words."""
        return iter(())

    def spring_of(self, p: Parameter) -> str | None:
        """See :attr:`Parameter.spring_of`."""
        return None

    def check(self, p: Parameter, among: Sequence[Parameter], given: Given) -> None:
        """Raise InputError where the parameter cannot be free beside the others, or lacks what it needs."""

    def changed(self, p: Parameter, v: float, model: ArmModel, walls: Mapping[str, Flexibility]) -> ArmModel:
        """The model with the parameter's variable at v."""
        return model

    def at_port(
        self, p: Parameter, v: Array, port: Port, model: ArmModel, q: Array, walls: Mapping[str, Flexibility]
    ) -> tuple[Array, Array]:
        """Change of the displacements (n, 6) of the model by its variable at v, () or (n,), and their derivatives."""
        raise NotImplementedError

    @property
    def is_at_port(self) -> bool:
        """Whether it acts at a port, with exact derivatives."""
        return not (self.shifts or self.of_law or self.of_effect)

    def variable(self, p: Parameter, description: ModelDescription) -> float | None:
        """The variable as a description has it where that is not the model's own value, else None."""
        return None

    def screened(self, p: Parameter, springs: tuple[float, float]) -> tuple[float, float]:
        """Usual range of the value; ``springs``: of joints' springs, N m/rad."""
        return p.value - OF_WIDEST * p.upper, p.value + OF_WIDEST * p.upper

    def put(self, p: Parameter, value: float, tables: Tables, figure: Figure) -> None:
        """Write a value into the tables of a model file."""
        raise NotImplementedError


@dataclass(frozen=True)
class Given:
    """What a model with numbers set free has beside its parameters.

    ``codes`` of its effects, joints and rows of free ``laws``, links with ``walls`` to vary.
    """

    codes: frozenset[str]
    laws: frozenset[tuple[str, int]]
    walls: frozenset[str]
