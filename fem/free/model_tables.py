"""Tables of a model file as plain data, and where in them the figures of parts stand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from fem.statics.ports import BASE, ROWS, TOOL
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
