"""Estimated parameters put back into a model description, with where they came from and how sure they are."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from doe.certainty.uncertainty import ParameterEstimate
from doe.tables.loaded import PointOf
from fem.free.base import Tables
from fem.free.parameters import FreeLaw
from fem.springs import Basis, FourierBasis, PolynomialBasis, TableBasis
from robots import InputError, ModelDescription
from robots.schema.description import Joint, LogFourierLaw, LogPolynomialLaw, PlaceStiffness, TableLaw
from robots.schema.quantities import RotationalStiffness

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

    ``points``: whose points the readings were taken at (:func:`doe.tables.loaded.points_of`): a shift of the point
    goes where the model holds these, to the tool point and to what points of a table are off by.

    Every figure carries ``source`` (a key of the description's sources, or to be added) and a note with its status
    and interval. Reading the result back and building it gives the calibrated model.

    Raises
    ------
    InputError
        A compliance matrix that is not positive semi-definite: no passive part has it.
    """
    data: dict[str, Any] = description.model_dump(by_alias=True)
    tables = Tables(data, tuple(POINTS[whose] for whose in points))
    for e in estimates:
        if not e.parameter.kind.of_law and not math.isnan(e.value):
            e.parameter.kind.put(e.parameter, e.value, tables, partial(_figure, e, source))
    names = [joint.coordinate for joint in description.joint]
    for law in laws:
        mine = [e for e in estimates if e.parameter.kind.of_law and e.parameter.place == law.joint]
        values = [e.parameter.value if math.isnan(e.value) else e.value for e in mine]
        tables.of("joint", law.joint)["stiffness"] = law_table(names, law.basis, values, source).model_dump()
    data["sources"] = {source: "calibration", **data["sources"]}
    applied = ModelDescription.model_validate(data)
    check_passive(applied)
    return applied


def with_springs(
    description: ModelDescription,
    springs: Mapping[str, RotationalStiffness | LogPolynomialLaw],
    source: str = "calibrated",
) -> ModelDescription:
    """The description with other springs of some joints, from ``source``."""
    joints = tuple(
        joint.model_copy(update={"stiffness": springs[joint.name].model_copy(update={"source": source})})
        if joint.name in springs
        else joint
        for joint in description.joint
    )
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


def _figure(e: ParameterEstimate, source: str, value: float, unit: str) -> dict[str, Any]:
    return {"value": float(value), "unit": unit, "source": source, "note": note_of(e)}


def law_table(
    names: Sequence[str], basis: Basis, values: Sequence[float], source: str
) -> LogPolynomialLaw | LogFourierLaw | TableLaw:
    """A spring's law as a model file has it: coefficients ``values`` of ln k; ``names`` of the basis's columns."""
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


def check_passive(description: ModelDescription) -> None:
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
                code="M002",
                remedy="its entries off the diagonal are larger than the readings can tell: free fewer of them",
            )
