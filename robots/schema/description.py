"""The model file: a robot, its parts with values, units and sources (validated, TOML on disk).

Every figure is a table ``{ value, unit, source }``. ``source`` is a key of the file's ``[sources]``
table, or ``"assumed"``, ``"derived"`` or ``"definition"``; so no figure is without its origin.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from robots.errors import twice
from robots.schema.controller import AxisTerm, Controller, ControllerAngle, Placed
from robots.schema.effects import EffectNumber, EffectTable
from robots.schema.joint_errors import JointError, Positions
from robots.schema.links import (
    BoxSection,
    FlangeCoupling,
    Link,
    Material,
    Opening,
    PreparedMesh,
    Rim,
    Section,
    Solid,
    Surface,
    TubeSection,
)
from robots.schema.quantities import (
    Angle,
    AngleRange,
    Angles,
    Direction,
    Length,
    Mass,
    Position,
    PositiveLength,
    Quantity,
    RotationalStiffness,
    Strict,
    TranslationalStiffness,
)
from robots.schema.springs import (
    BearingLaws,
    ComplianceEntry,
    LogFourierLaw,
    LogPolynomialLaw,
    PlaceStiffness,
    Spring,
    SpringLawTable,
    TableLaw,
)
from robots.schema.uncertainty import CalibrationUncertainty, UndeterminedNumber
from robots.schema.units import DIMENSIONS

__all__ = [
    "BUILT_IN_SOURCES",
    "SCHEMA",
    "AxisTerm",
    "BearingLaws",
    "BoxSection",
    "Calibration",
    "CalibrationUncertainty",
    "ComplianceEntry",
    "Controller",
    "ControllerAngle",
    "Coupling",
    "CouplingTerm",
    "DHRow",
    "EffectNumber",
    "EffectTable",
    "Flange",
    "FlangeCoupling",
    "FrameRow",
    "Joint",
    "Link",
    "LoadPath",
    "LoadPlacement",
    "LogFourierLaw",
    "LogPolynomialLaw",
    "Material",
    "ModelDescription",
    "Opening",
    "ParallelogramBar",
    "PlaceStiffness",
    "Placed",
    "PreparedMesh",
    "ReferenceFaults",
    "Rim",
    "Section",
    "Solid",
    "Spring",
    "SpringLawTable",
    "Surface",
    "TableLaw",
    "Tool",
    "TubeSection",
    "UndeterminedNumber",
]

SCHEMA = "stiffarm-model/1"
# The longest links of industrial arms have some 3 m.
LONGEST_LINK_m = 20.0
BUILT_IN_SOURCES = ("assumed", "derived", "definition")

LoadPath = Literal["parallelogram", "serial"]


class ReferenceFaults(ValueError):  # noqa: N818 - a list of faults
    """Every name in the file that is used twice or leads nowhere, one message each."""

    def __init__(self, faults: Sequence[str]) -> None:
        self.faults = tuple(faults)
        super().__init__("; ".join(faults))


def _check_length(key: str, length: Quantity) -> None:
    """Refuse what no arm has between two joints: as a rule a decimal point too far, or another unit."""
    for number in np.abs(length.si_array):
        if not number <= LONGEST_LINK_m:
            most = LONGEST_LINK_m / DIMENSIONS["length"].units[length.unit]
            raise ValueError(
                f"{key} has {number * most / LONGEST_LINK_m:g} {length.unit}, but no arm has more than {most:g} "
                f"{length.unit} from one joint to the next; check unit and decimal point"
            )


class DHRow(Strict):
    """One row of modified DH parameters: ``Rot_x(alpha) Trans_x(a) Rot_z(theta) Trans_z(d)``.

    ``alpha`` and ``a`` belong to the link before the joint (alpha_{i-1}, a_{i-1}; Craig's convention).
    """

    alpha: Angle
    a: Length
    d: Length

    @model_validator(mode="after")
    def _of_an_arm(self) -> Self:
        _check_length("a", self.a)
        _check_length("d", self.d)
        return self


class FrameRow(Placed):
    """A joint's frame in its parent body's frame, and the joint axis in that frame."""

    axis: Direction = (0.0, 0.0, 1.0)

    @model_validator(mode="after")
    def _of_an_arm(self) -> Self:
        _check_length("xyz", self.xyz)
        return self


class Joint(Strict):
    """A revolute joint: where it sits, how its coordinate turns it, its limits and its springs.

    ``stiffness`` is about the axis. ``bearing`` holds the other five directions one by one (and entries that couple
    them with the axis); ``tilt_stiffness`` and ``translational_stiffness`` are short for two or three equal ones.
    ``bearing_laws``: directions across the axis that vary with a joint's angle.
    ``zero_error`` is added to the coordinate: what the joint really turned when the controller says zero.
    ``error``: what else positions have told of it (:mod:`robots.joint_errors`).
    """

    name: str
    coordinate: str
    dh: DHRow | None = None
    frame: FrameRow | None = None
    sign: Literal[1, -1] = 1
    offset: Angle | None = None
    limits: AngleRange
    stiffness: Spring | None = None
    tilt_stiffness: RotationalStiffness | None = None
    translational_stiffness: TranslationalStiffness | None = None
    bearing: PlaceStiffness | None = None
    bearing_laws: BearingLaws | None = None
    zero_error: Angle | None = None
    error: JointError | None = None

    @field_validator("coordinate")
    @classmethod
    def _names_its_unit(cls, coordinate: str) -> str:
        if not coordinate.endswith("_deg"):
            raise ValueError("a joint coordinate's name must end in _deg")
        return coordinate

    @model_validator(mode="after")
    def _one_of_each(self) -> Self:
        if (self.dh is None) == (self.frame is None):
            raise ValueError(f"joint {self.name!r} needs exactly one of 'dh' and 'frame'")
        if self.bearing is not None and (self.tilt_stiffness or self.translational_stiffness):
            raise ValueError(f"joint {self.name!r}: 'bearing' takes the place of tilt_ and translational_stiffness")
        if self.bearing is not None and self.bearing.rz is not None:
            raise ValueError(f"joint {self.name!r}: the stiffness about the axis is 'stiffness', not bearing.rz")
        return self


class ParallelogramBar(Strict):
    """The parallelogram that drives the forearm from a motor at the shoulder.

    ``pin`` is the bar's pin on the driven link, in that link's body frame; crank and driven lever
    are parallel and equally long. The bar is pinned at both ends (a two-force member); ``bar_stiffness`` along it
    overrides what its section gives. ``crank_flanges``: how the crank's ends are coupled (shell links).
    """

    driven: str
    crank_about: str
    pin: Position
    bar: Section
    bar_material: str
    crank: Section
    crank_material: str
    bar_stiffness: TranslationalStiffness | None = None
    crank_flanges: FlangeCoupling = "rigid"


class CouplingTerm(Strict):
    """One coordinate with its factor in a coupled limit."""

    coordinate: str
    factor: float


class Coupling(Strict):
    """A limit on a sum of joint coordinates: ``lower <= offset + sum(factor * q) <= upper``."""

    name: str
    terms: tuple[CouplingTerm, ...]
    offset: Angle | None = None
    limits: AngleRange


class Tool(Placed):
    """The tool point in the flange frame, and how the tool (or a force sensor) gives way there, flange axes."""

    stiffness: PlaceStiffness | None = None


class LoadPlacement(Strict):
    """Where a test load really acts: ``offset`` from the read point (flange axes), ``tilt`` about the base axes.

    ``point``: what the points that readings bring themselves (px_mm, py_mm, pz_mm) are off by, flange axes.
    """

    point: Position | None = None
    offset: Position | None = None
    tilt: Angles | None = None


class Flange(Placed):
    """The flange in the last body's frame."""

    @model_validator(mode="after")
    def _of_an_arm(self) -> Self:
        _check_length("xyz", self.xyz)
        return self


class Calibration(Strict):
    """Where calibrated springs came from, and how sure they are (``uncertainty``, where the calibration can say)."""

    scheme: str
    load_path: LoadPath
    links: str
    data: str
    data_sha256: str
    rms_mm: float
    loads_N: tuple[float, ...]  # noqa: N815 - units are in the names of the file's keys
    notes: tuple[str, ...] = ()
    uncertainty: CalibrationUncertainty | None = None


class ModelDescription(Strict):
    """A whole model file; ``beam_radius``: of the capsules that stand for bodies of which no shape is known."""

    schema_version: Literal["stiffarm-model/1"] = Field(alias="schema")
    name: str
    title: str
    notes: tuple[str, ...] = ()
    load_path: LoadPath = "serial"
    sources: dict[str, str]
    mass: Mass | None = None
    payload: Mass | None = None
    beam_radius: PositiveLength | None = None
    materials: dict[str, Material] = Field(default_factory=dict)
    joint: tuple[Joint, ...] = Field(min_length=1)
    flange: Flange
    tool: Tool | None = None
    base: PlaceStiffness | None = None
    load: LoadPlacement | None = None
    link: tuple[Link, ...] = ()
    parallelogram: ParallelogramBar | None = None
    coupling: tuple[Coupling, ...] = ()
    controller: Controller | None = None
    effect: tuple[EffectTable, ...] = ()
    calibration: Calibration | None = None
    positions: Positions | None = None

    @field_validator("name")
    @classmethod
    def _name_is_text(cls, name: str) -> str:
        if not name.strip() or not name.isprintable():
            raise ValueError("the name must be text that can be printed, as in my-arm")
        return name

    @model_validator(mode="after")
    def _references_hold(self) -> Self:
        faults = [*_names_used_twice(self), *_unknown_names(self), *_unlisted_sources(self)]
        if self.load_path == "parallelogram" and self.parallelogram is None:
            faults.append(
                "load_path is 'parallelogram' but the file has no [parallelogram]; "
                "add that table or set load_path = 'serial'"
            )
        if faults:
            raise ReferenceFaults(faults)
        return self


def _names_used_twice(model: ModelDescription) -> list[str]:
    named = (
        ("joint name", [joint.name for joint in model.joint]),
        ("coordinate name", [joint.coordinate for joint in model.joint]),
        ("link name", [link.name for link in model.link]),
        ("effect code", [effect.code for effect in model.effect]),
    )
    return [f"{kind} used twice: {', '.join(more)}" for kind, names in named if (more := twice(names))]


def _unknown_names(model: ModelDescription) -> list[str]:
    known = {
        "joint": list(dict.fromkeys(joint.name for joint in model.joint)),
        "coordinate": [joint.coordinate for joint in model.joint],
        "material": list(model.materials),
    }
    known["link body"] = ["base", *known["joint"]]
    used = [("link body", link.body) for link in model.link]
    used += [("material", link.material) for link in model.link]
    used += [("coordinate", term.coordinate) for coupling in model.coupling for term in coupling.terms]
    for joint in model.joint:
        if isinstance(joint.stiffness, LogPolynomialLaw | LogFourierLaw | TableLaw):
            used += [("coordinate", name) for name in joint.stiffness.inputs]
        if joint.error is not None:
            used += [("joint", one.joint) for one in joint.error.turns_with]
        if joint.bearing_laws is not None:
            used += [("coordinate", law.input) for _, law in joint.bearing_laws.given]
    p = model.parallelogram
    if p is not None:
        used += [("joint", p.driven), ("joint", p.crank_about)]
        used += [("material", p.bar_material), ("material", p.crank_material)]
    return [
        f"unknown {kind} {name!r}; known: {', '.join(known[kind]) or 'none'}"
        for kind, name in dict.fromkeys(used)
        if name not in known[kind]
    ]


def _unlisted_sources(model: ModelDescription) -> list[str]:
    missing = _sources_used(model.model_dump()) - {*model.sources, *BUILT_IN_SOURCES}
    fault = (
        f"source not listed under [sources]: {', '.join(sorted(missing))} (or use one of {', '.join(BUILT_IN_SOURCES)})"
    )
    return [fault] if missing else []


def _sources_used(node: Any) -> set[str]:
    children = node.values() if isinstance(node, dict) else node if isinstance(node, list | tuple) else ()
    own = {node["source"]} if isinstance(node, dict) and isinstance(node.get("source"), str) else set()
    return own.union(*map(_sources_used, children))
