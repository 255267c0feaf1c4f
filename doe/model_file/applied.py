"""Estimated parameters put back into a model description, with where they came from and how sure they are."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from doe.certainty.uncertainty import ParameterEstimate
from doe.published.readings import PointOf
from fem.elements.walls import WALLS
from fem.free.law_bases import FourierBasis, PolynomialBasis, TableBasis
from fem.free.laws import FreeLaw
from fem.statics.ports import ROWS
from robots import InputError, ModelDescription
from robots.schema.description import Joint, LogFourierLaw, LogPolynomialLaw, PlaceStiffness, TableLaw
from robots.schema.quantities import RotationalStiffness
from robots.schema.units import UNITS, factor

# Entries off the diagonal have a unit for each pair of kinds of rows.
ENTRY_UNITS = ("m/N", "rad/N", "rad/(N m)")
# Table and key of the model file that hold where a reading's point is.
POINTS: dict[PointOf, tuple[str, str]] = {"tool": ("tool", "xyz"), "table": ("load", "point")}


def apply_estimates(
    description: ModelDescription,
    estimates: Sequence[ParameterEstimate],
    laws: Sequence[FreeLaw] = (),
    source: str = "calibrated",
    points: Sequence[PointOf] = ("tool",),
) -> ModelDescription:
    """The description with the estimated numbers; one that no reading moves keeps what it had.

    ``points``: whose points the readings were taken at (:func:`doe.published.readings.points_of`): a shift of the point
    goes where the model holds these, to the tool point and to what points of a table are off by.

    Every figure carries ``source`` (a key of the description's sources, or to be added) and a note with its status
    and interval. Reading the result back and building it gives the calibrated model.

    Raises
    ------
    InputError
        A compliance matrix that is not positive semi-definite: no passive part has it.
    """
    data: dict[str, Any] = description.model_dump(by_alias=True)
    for e in estimates:
        if e.parameter.kind != "law" and not math.isnan(e.value):
            _put(data, description, e, source, points)
    for law in laws:
        mine = [e for e in estimates if e.parameter.kind == "law" and e.parameter.place == law.joint]
        values = [e.parameter.value if math.isnan(e.value) else e.value for e in mine]
        _joint(data, law.joint)["stiffness"] = _law(description, law, values, source).model_dump()
    data["sources"] = {source: "calibration", **data["sources"]}
    applied = ModelDescription.model_validate(data)
    _check_passive(applied)
    return applied


def with_springs(
    description: ModelDescription,
    springs: Mapping[str, RotationalStiffness | LogPolynomialLaw],
    source: str = "calibrated",
) -> ModelDescription:
    """The description with other springs of some joints, from ``source``."""
    joints = tuple(
        joint.model_copy(update={"stiffness": springs[joint.name].model_copy(update={"source": source})})
        if joint.name in springs else joint
        for joint in description.joint
    )  # fmt: skip
    update = {"joint": joints, "sources": {source: "calibration", **description.sources}}
    return description.model_copy(update=update)


def note_of(e: ParameterEstimate) -> str:
    """Status and 95 % interval in words."""
    low, high = e.interval
    if math.isnan(low):
        return e.status
    ends = [
        "no lower limit" if low in (0.0, -math.inf) else f"{low:.3g}",
        "no upper limit" if math.isinf(high) else f"{high:.3g}",
    ]
    return f"{e.status}; 95 % interval {ends[0]} to {ends[1]} {e.parameter.unit}"


def _figure(e: ParameterEstimate, value: float, unit: str, source: str) -> dict[str, Any]:
    return {"value": float(value), "unit": unit, "source": source, "note": note_of(e)}


def _put(
    data: dict[str, Any], description: ModelDescription, e: ParameterEstimate, source: str, points: Sequence[PointOf]
) -> None:
    p = e.parameter
    if p.kind == "stiffness" and p.place == "bar":
        data["parallelogram"]["bar_stiffness"] = _figure(e, e.value, "N/m", source)
    elif p.kind == "stiffness" and p.index == (5,) and p.place in [j.name for j in description.joint]:
        _joint(data, p.place)["stiffness"] = _figure(e, e.value, "N m/rad", source)
    elif p.kind == "stiffness":
        _place(data, p.place)[ROWS[p.index[0]]] = _figure(e, e.value, p.unit, source)
    elif p.kind == "coupling":
        _entry(_place(data, p.place), e, source)
    elif p.kind == "modulus":
        _link(data, p.place)["youngs_modulus"] = _figure(e, e.value, "Pa", source)
    elif p.kind == "wall":
        _scale_walls(_link(data, p.place), e, source)
    elif p.kind == "zero":
        joint = _joint(data, p.place)
        before = description.joint[p.index[0]].zero_error
        total = np.degrees(e.value + (0.0 if before is None else before.si))
        joint["zero_error"] = _figure(e, total, "deg", source)
    elif p.kind == "effect":
        _put_effect(data, e, source)
    elif p.kind == "point":
        for whose in points:
            _shift(data, POINTS[whose], e, source)
    elif p.kind == "load":
        _shift(data, ("load", "offset"), e, source)
    else:
        _shift(data, ("load", "tilt"), e, source)


def _joint(data: dict[str, Any], name: str) -> dict[str, Any]:
    found: dict[str, Any] = next(joint for joint in data["joint"] if joint["name"] == name)
    return found


def _link(data: dict[str, Any], name: str) -> dict[str, Any]:
    found: dict[str, Any] = next(link for link in data["link"] if link["name"] == name)
    return found


def _place(data: dict[str, Any], name: str) -> dict[str, Any]:
    """Table of the place's stiffness in six directions, made if it is not there."""
    if name == "base":
        data["base"] = data["base"] or {}
        return _table(data["base"])
    if name == "tool":
        zero = {"value": (0.0, 0.0, 0.0), "unit": "m", "source": "definition"}
        data["tool"] = data["tool"] or {"xyz": zero}
        data["tool"]["stiffness"] = data["tool"].get("stiffness") or {}
        return _table(data["tool"]["stiffness"])
    joint = _joint(data, name)
    if joint.get("bearing") is None:
        joint["bearing"] = {}
        for rows, key in ((ROWS[:3], "translational_stiffness"), (ROWS[3:5], "tilt_stiffness")):
            if joint.get(key) is not None:
                joint["bearing"] |= {row: dict(joint[key]) for row in rows}
            joint[key] = None
    return _table(joint["bearing"])


def _table(place: dict[str, Any]) -> dict[str, Any]:
    place["entry"] = list(place.get("entry") or ())
    return place


def _entry(place: dict[str, Any], e: ParameterEstimate, source: str) -> None:
    rows = tuple(ROWS[k] for k in e.parameter.index)
    turns = sum(row.startswith("r") for row in rows)
    place["entry"] = [one for one in place["entry"] if set(one["rows"]) != set(rows)]
    place["entry"].append({"rows": rows, "compliance": _figure(e, e.value, ENTRY_UNITS[turns], source)})


def _put_effect(data: dict[str, Any], e: ParameterEstimate, source: str) -> None:
    """A number of an effect, in the unit that the file has it in."""
    code, _, name = e.parameter.name.rpartition(".")
    table = next(one for one in data["effect"] if one["code"] == code)
    old = table["parameters"].get(name)
    unit = e.parameter.unit if old is None else old["unit"]
    dimension = next(d for d, units in UNITS.items() if unit in units)
    figure = _figure(e, e.value / factor(dimension, unit), unit, source)
    table["parameters"] = {**table["parameters"], name: figure}


def _scale_walls(link: dict[str, Any], e: ParameterEstimate, source: str) -> None:
    ratio = e.value / e.parameter.value
    for key in WALLS:
        if link.get(key) is not None:
            wall = link[key]["wall"]
            link[key]["wall"] = {**_figure(e, wall["value"] * ratio, wall["unit"], source)}


def _shift(data: dict[str, Any], keys: tuple[str, str], e: ParameterEstimate, source: str) -> None:
    """Add to one component of a triple of lengths (m) or angles (rad)."""
    table, key = keys
    dimension, unit = ("angle", "rad") if key == "tilt" else ("length", "m")
    data[table] = data[table] or {}
    old = data[table].get(key)
    values = [0.0, 0.0, 0.0] if old is None else [v * factor(dimension, old["unit"]) for v in old["value"]]
    values[e.parameter.index[0]] += e.value
    note = f"{e.parameter.name}: {note_of(e)}"
    if old is not None and old.get("source") == source:
        note = f"{old['note']}; {note}"
    data[table][key] = {"value": tuple(values), "unit": unit, "source": source, "note": note}


def _law(
    description: ModelDescription, law: FreeLaw, values: list[float], source: str
) -> LogPolynomialLaw | LogFourierLaw | TableLaw:
    names = [joint.coordinate for joint in description.joint]
    basis = law.basis
    if isinstance(basis, PolynomialBasis):
        return LogPolynomialLaw(
            inputs=tuple(names[k] for k in basis.columns),
            centre_deg=tuple(np.degrees(basis.centre).tolist()),
            half_range_deg=tuple(np.degrees(basis.half_range).tolist()),
            exponents=tuple(tuple(int(x) for x in row) for row in basis.exponents),
            coefficients=tuple(values),
            source=source,
        )
    if isinstance(basis, FourierBasis):
        return LogFourierLaw(kind="log-fourier", input=names[basis.column], coefficients=tuple(values), source=source)
    assert isinstance(basis, TableBasis)  # noqa: S101 - the three kinds there are
    return TableLaw(
        kind="table",
        input=names[basis.column],
        nodes_deg=tuple(np.degrees(basis.nodes).tolist()),
        stiffness_Nm_per_rad=tuple(np.exp(values).tolist()),
        source=source,
    )


def _check_passive(description: ModelDescription) -> None:
    """Refuse compliance matrices that would give energy back."""
    places: list[tuple[str, PlaceStiffness | None, Joint | None]] = [("base", description.base, None)]
    places.append(("tool", None if description.tool is None else description.tool.stiffness, None))
    places += [(joint.name, joint.bearing, joint) for joint in description.joint]
    for name, place, joint in places:
        if place is None or not place.entry:
            continue
        C = place.compliance
        if joint is not None and joint.stiffness is not None and hasattr(joint.stiffness, "si"):
            C[5, 5] = 1.0 / joint.stiffness.si
        size = np.sqrt(np.maximum(np.diag(C), 1e-300))
        least = float(np.linalg.eigvalsh(C / np.outer(size, size))[0])
        if least < -1e-9:
            raise InputError(
                f"compliance matrix of {name}: not positive semi-definite (smallest scaled eigenvalue {least:.3g})",
                remedy="its entries off the diagonal are larger than the readings can tell: free fewer of them",
            )
