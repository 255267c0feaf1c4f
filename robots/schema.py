"""The model file: a robot, its parts with values, units and sources (validated, TOML on disk).

Every figure is a table ``{ value, unit, source }``. ``source`` is a key of the file's ``[sources]``
table, or ``"assumed"``, ``"derived"`` or ``"definition"``; so no figure is without its origin.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Real
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, field_validator, model_validator

from robots.units import factor

SCHEMA = "stiffarm-model/1"
BUILT_IN_SOURCES = ("assumed", "derived", "definition")

LoadPath = Literal["parallelogram", "serial"]


class ReferenceFaults(ValueError):  # noqa: N818 - a list of faults
    """Every name in the file that is used twice or leads nowhere, one message each."""

    def __init__(self, faults: Sequence[str]) -> None:
        self.faults = tuple(faults)
        super().__init__("; ".join(faults))


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Quantity(_Strict):
    """A number (or a list of them) with its unit and the source of the figure."""

    dimension: ClassVar[str] = ""

    value: float | tuple[float, ...]
    unit: str
    source: str
    note: str | None = None

    @field_validator("value", mode="before")
    @classmethod
    def _finite_numbers(cls, value: Any) -> Any:
        # Before pydantic's own reading, which takes "12" for 12 and true for 1.
        for entry in value if isinstance(value, list | tuple) else (value,):
            if isinstance(entry, bool) or not isinstance(entry, Real):
                raise ValueError("must be a number or a list of numbers")  # noqa: TRY004 - as below
            if not math.isfinite(entry):
                raise ValueError("must be a finite number")
        return value

    @field_validator("unit")
    @classmethod
    def _known_unit(cls, unit: str) -> str:
        factor(cls.dimension, unit)
        return unit

    @property
    def si(self) -> float:
        """The single value in SI units."""
        if isinstance(self.value, tuple):
            raise TypeError("this quantity is a list; use si_array")
        return self.value * factor(self.dimension, self.unit)

    @property
    def si_array(self) -> NDArray[np.float64]:
        """The values in SI units, shape (m,)."""
        return np.atleast_1d(np.asarray(self.value, dtype=np.float64)) * factor(self.dimension, self.unit)


class _Scalar(Quantity):
    @field_validator("value")
    @classmethod
    def _one(cls, value: float | tuple[float, ...]) -> float | tuple[float, ...]:
        if isinstance(value, tuple):
            raise ValueError("must be one number, not a list")  # noqa: TRY004 - pydantic wants ValueError
        return value


class _Positive(_Scalar):
    @field_validator("value")
    @classmethod
    def _above_zero(cls, value: float) -> float:
        if not value > 0.0:
            raise ValueError("must be greater than zero")
        return value


class _Triple(Quantity):
    @field_validator("value")
    @classmethod
    def _three(cls, value: float | tuple[float, ...]) -> float | tuple[float, ...]:
        if not isinstance(value, tuple) or len(value) != 3:
            raise ValueError("must be a list of three numbers")
        return value


class _Range(Quantity):
    @field_validator("value")
    @classmethod
    def _ordered_pair(cls, value: float | tuple[float, ...]) -> float | tuple[float, ...]:
        if not isinstance(value, tuple) or len(value) != 2 or not value[0] < value[1]:
            raise ValueError("must be a pair [lower, upper] with lower < upper")
        return value


class Length(_Scalar):
    """A length, which may be zero or negative."""

    dimension = "length"


class PositiveLength(_Positive):
    """A length greater than zero."""

    dimension = "length"


class Position(_Triple):
    """Three lengths x, y, z."""

    dimension = "length"


class Angle(_Scalar):
    """An angle."""

    dimension = "angle"


class Angles(_Triple):
    """Roll, pitch, yaw about fixed x, y, z, as in URDF."""

    dimension = "angle"


class AngleRange(_Range):
    """Lower and upper angle."""

    dimension = "angle"


class Mass(_Positive):
    """A mass."""

    dimension = "mass"


class Density(_Positive):
    """A mass density."""

    dimension = "density"


class Modulus(_Positive):
    """An elastic modulus."""

    dimension = "pressure"


class Ratio(_Scalar):
    """A pure number."""

    dimension = "ratio"


class PoissonsRatio(Ratio):
    """A Poisson's ratio: an isotropic material is stable only between -1 and 0.5."""

    @model_validator(mode="after")
    def _stable(self) -> Self:
        if not -1.0 < self.si < 0.5:
            raise ValueError(f"Poisson's ratio {self.si:g} is not between -1 and 0.5")
        return self


class RotationalStiffness(_Positive):
    """A stiffness against rotation."""

    dimension = "rotational stiffness"


class TranslationalStiffness(_Positive):
    """A stiffness against displacement."""

    dimension = "translational stiffness"


class DHRow(_Strict):
    """One row of modified DH parameters: ``Rot_x(alpha) Trans_x(a) Rot_z(theta) Trans_z(d)``.

    ``alpha`` and ``a`` belong to the link before the joint (alpha_{i-1}, a_{i-1}; Craig's convention).
    """

    alpha: Angle
    a: Length
    d: Length


class FrameRow(_Strict):
    """A joint's frame in its parent body's frame, and the joint axis in that frame."""

    xyz: Position
    rpy: Angles | None = None
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)

    @field_validator("axis")
    @classmethod
    def _nonzero(cls, axis: tuple[float, float, float]) -> tuple[float, float, float]:
        if not np.linalg.norm(axis) > 1e-9:
            raise ValueError("the joint axis must not have length zero")
        return axis


class LogPolynomialLaw(_Strict):
    """Angle-dependent spring: ln(k / (N m/rad)) is a polynomial in scaled joint coordinates.

    ``k = exp(sum_t c_t prod_i u_i^e_ti)``, ``u_i = (q_i - centre_i) / half_range_i``; k stays positive.
    """

    kind: Literal["log-polynomial"] = "log-polynomial"
    inputs: tuple[str, ...]
    centre_deg: tuple[float, ...]
    half_range_deg: tuple[float, ...]
    exponents: tuple[tuple[int, ...], ...]
    coefficients: tuple[float, ...]
    source: str

    @model_validator(mode="after")
    def _shapes_agree(self) -> Self:
        n = len(self.inputs)
        if len(self.centre_deg) != n or len(self.half_range_deg) != n:
            raise ValueError("centre_deg and half_range_deg need one number for each input")
        if any(len(row) != n for row in self.exponents) or len(self.exponents) != len(self.coefficients):
            raise ValueError("exponents need one row for each coefficient and one column for each input")
        if any(e < 0 for row in self.exponents for e in row) or any(h <= 0 for h in self.half_range_deg):
            raise ValueError("exponents must be 0 or more and half_range_deg greater than zero")
        return self


def _spring_kind(value: Any) -> str:
    keys = value if isinstance(value, dict) else {}
    law = isinstance(value, LogPolynomialLaw) or "kind" in keys or "coefficients" in keys
    return "law" if law else "constant"


# Told apart before validation: otherwise one slip in a constant is reported as eight faults of a law.
Spring = Annotated[
    Annotated[RotationalStiffness, Tag("constant")] | Annotated[LogPolynomialLaw, Tag("law")],
    Discriminator(_spring_kind),
]


class Joint(_Strict):
    """A revolute joint: where it sits, how its coordinate turns it, its limits and its springs."""

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

    @field_validator("coordinate")
    @classmethod
    def _names_its_unit(cls, coordinate: str) -> str:
        if not coordinate.endswith("_deg"):
            raise ValueError("a joint coordinate's name must end in _deg")
        return coordinate

    @model_validator(mode="after")
    def _one_placement(self) -> Self:
        if (self.dh is None) == (self.frame is None):
            raise ValueError(f"joint {self.name!r} needs exactly one of 'dh' and 'frame'")
        return self


class BoxSection(_Strict):
    """Hollow rectangle; ``width`` along local y, ``height`` along local z of the beam."""

    kind: Literal["box"]
    width: PositiveLength
    height: PositiveLength
    wall: PositiveLength

    @model_validator(mode="after")
    def _wall_fits(self) -> Self:
        if 2.0 * self.wall.si > min(self.width.si, self.height.si):
            raise ValueError(
                f"the wall ({self.wall.si:g} m) is thicker than half of the section "
                f"({self.width.si:g} x {self.height.si:g} m)"
            )
        return self


class TubeSection(_Strict):
    """Hollow circle."""

    kind: Literal["tube"]
    diameter: PositiveLength
    wall: PositiveLength

    @model_validator(mode="after")
    def _wall_fits(self) -> Self:
        if 2.0 * self.wall.si > self.diameter.si:
            raise ValueError(
                f"the wall ({self.wall.si:g} m) is thicker than half of the diameter ({self.diameter.si:g} m)"
            )
        return self


Section = Annotated[BoxSection | TubeSection, Field(discriminator="kind")]


class Material(_Strict):
    """Isotropic elastic material."""

    youngs_modulus: Modulus
    poissons_ratio: PoissonsRatio
    density: Density


class Link(_Strict):
    """A link: the body it is, its material, its section (tapering to ``section_end``), its mass.

    The centre line runs from the body's own joint to the next one, through ``via`` if given.
    ``beam_up`` is the direction (body frame) that the section's height follows.
    """

    name: str
    body: str
    material: str
    section: Section
    section_end: Section | None = None
    via: tuple[Position, ...] = ()
    beam_up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    mass: Mass | None = None

    @field_validator("beam_up")
    @classmethod
    def _nonzero(cls, beam_up: tuple[float, float, float]) -> tuple[float, float, float]:
        if not np.linalg.norm(beam_up) > 1e-9:
            raise ValueError("the direction must not have length zero")
        return beam_up

    @model_validator(mode="after")
    def _same_kind(self) -> Self:
        if self.section_end is not None and self.section_end.kind != self.section.kind:
            raise ValueError(f"link {self.name!r} cannot taper from {self.section.kind} to another kind")
        return self


class ParallelogramBar(_Strict):
    """The parallelogram that drives the forearm from a motor at the shoulder.

    ``pin`` is the bar's pin on the driven link, in that link's body frame; crank and driven lever
    are parallel and equally long. The bar is pinned at both ends (a two-force member).
    """

    driven: str
    crank_about: str
    pin: Position
    bar: Section
    bar_material: str
    crank: Section
    crank_material: str


class CouplingTerm(_Strict):
    """One coordinate with its factor in a coupled limit."""

    coordinate: str
    factor: float


class Coupling(_Strict):
    """A limit on a sum of joint coordinates: ``lower <= offset + sum(factor * q) <= upper``."""

    name: str
    terms: tuple[CouplingTerm, ...]
    offset: Angle | None = None
    limits: AngleRange


class Tool(_Strict):
    """The tool point in the flange frame."""

    xyz: Position
    rpy: Angles | None = None


class Flange(_Strict):
    """The flange in the last body's frame."""

    xyz: Position
    rpy: Angles | None = None


class Calibration(_Strict):
    """Where calibrated springs came from."""

    scheme: str
    load_path: LoadPath
    links: str
    data: str
    data_sha256: str
    rms_mm: float
    loads_N: tuple[float, ...]  # noqa: N815 - units are in the names of the file's keys
    notes: tuple[str, ...] = ()


class ModelDescription(_Strict):
    """A whole model file."""

    schema_version: Literal["stiffarm-model/1"] = Field(alias="schema")
    name: str
    title: str
    notes: tuple[str, ...] = ()
    load_path: LoadPath = "serial"
    sources: dict[str, str]
    mass: Mass | None = None
    payload: Mass | None = None
    materials: dict[str, Material] = Field(default_factory=dict)
    joint: tuple[Joint, ...] = Field(min_length=1)
    flange: Flange
    tool: Tool | None = None
    link: tuple[Link, ...] = ()
    parallelogram: ParallelogramBar | None = None
    coupling: tuple[Coupling, ...] = ()
    calibration: Calibration | None = None

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
    faults = []
    for kind, names in (
        ("joint", [joint.name for joint in model.joint]),
        ("coordinate", [joint.coordinate for joint in model.joint]),
        ("link", [link.name for link in model.link]),
    ):
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            faults.append(f"{kind} name used twice: {', '.join(twice)}")
    return faults


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
        if isinstance(joint.stiffness, LogPolynomialLaw):
            used += [("coordinate", name) for name in joint.stiffness.inputs]
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
    if not missing:
        return []
    return [
        f"source not listed under [sources]: {', '.join(sorted(missing))} (or use one of {', '.join(BUILT_IN_SOURCES)})"
    ]


def _sources_used(node: Any) -> set[str]:
    if isinstance(node, dict):
        own = {node["source"]} if isinstance(node.get("source"), str) else set()
        return own.union(*(_sources_used(child) for child in node.values()))
    if isinstance(node, list | tuple):
        return set().union(*(_sources_used(child) for child in node))
    return set()
