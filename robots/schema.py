"""The model file: a robot, its parts with values, units and sources (validated, TOML on disk).

Every figure is a table ``{ value, unit, source }``. ``source`` is a key of the file's ``[sources]``
table, or ``"assumed"``, ``"derived"`` or ``"definition"``; so no figure is without its origin.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Discriminator, Field, Tag, field_validator, model_validator

from robots.quantities import (
    Angle,
    AngleRange,
    Angles,
    Density,
    Length,
    Mass,
    Modulus,
    PoissonsRatio,
    Position,
    PositiveLength,
    RotationalStiffness,
    Strict,
    TranslationalStiffness,
)

SCHEMA = "stiffarm-model/1"
BUILT_IN_SOURCES = ("assumed", "derived", "definition")

LoadPath = Literal["parallelogram", "serial"]
FlangeCoupling = Literal["rigid", "distributing"]


class ReferenceFaults(ValueError):  # noqa: N818 - a list of faults
    """Every name in the file that is used twice or leads nowhere, one message each."""

    def __init__(self, faults: Sequence[str]) -> None:
        self.faults = tuple(faults)
        super().__init__("; ".join(faults))


class DHRow(Strict):
    """One row of modified DH parameters: ``Rot_x(alpha) Trans_x(a) Rot_z(theta) Trans_z(d)``.

    ``alpha`` and ``a`` belong to the link before the joint (alpha_{i-1}, a_{i-1}; Craig's convention).
    """

    alpha: Angle
    a: Length
    d: Length


class FrameRow(Strict):
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


class LogPolynomialLaw(Strict):
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


class Joint(Strict):
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


class BoxSection(Strict):
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


class TubeSection(Strict):
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


class Material(Strict):
    """Isotropic elastic material."""

    youngs_modulus: Modulus
    poissons_ratio: PoissonsRatio
    density: Density


class Opening(Strict):
    """A rectangular hole in a wall of a box casing (shell links).

    ``side``: the wall, by its outward direction in the section's axes (y along its width, z along its height).
    ``along``: share of the centre line from root to tip; ``across``: share of the wall in the direction of
    growing z or y. Both start and end strictly inside the wall.
    """

    side: Literal["+y", "-y", "+z", "-z"]
    along: tuple[float, float]
    across: tuple[float, float]
    source: str
    note: str | None = None

    @field_validator("along", "across")
    @classmethod
    def _inside(cls, share: tuple[float, float]) -> tuple[float, float]:
        if not 0.0 < share[0] < share[1] < 1.0:
            raise ValueError("must be a pair [from, to] with 0 < from < to < 1")
        return share


class Rim(Strict):
    """A thicker wall over a length from each interface: the flange that is cast or welded on (shell links)."""

    length: PositiveLength
    wall: PositiveLength


class Surface(Strict):
    """A prepared shell mesh of a link that takes the casing's place (shell links); written by `import`.

    ``file`` is relative to the model file; ``sha256`` is that of the file's content. ``changes`` says what was
    done to the source to get it.
    """

    file: str
    sha256: str
    wall: PositiveLength
    size: PositiveLength
    source: str
    changes: tuple[str, ...] = ()


class Link(Strict):
    """A link: the body it is, its material, its section (tapering to ``section_end``), its mass.

    The centre line runs from the body's own joint to the next one, through ``via`` if given.
    ``beam_up`` is the direction (body frame) that the section's height follows. For shell links: openings and
    rims of the casing, or the ``surface`` in its place, and how the interfaces (``root``, ``tip``, ``pin``) are
    coupled to their points (``flanges``; rigid where nothing is said).
    """

    name: str
    body: str
    material: str
    section: Section
    section_end: Section | None = None
    via: tuple[Position, ...] = ()
    beam_up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    mass: Mass | None = None
    opening: tuple[Opening, ...] = ()
    rim: Rim | None = None
    surface: Surface | None = None
    flanges: dict[Literal["root", "tip", "pin"], FlangeCoupling] = Field(default_factory=dict)

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

    @model_validator(mode="after")
    def _openings_in_boxes(self) -> Self:
        if self.opening and self.section.kind != "box":
            raise ValueError(f"link {self.name!r} is a {self.section.kind}; only box casings can have openings")
        return self


class ParallelogramBar(Strict):
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


class Tool(Strict):
    """The tool point in the flange frame."""

    xyz: Position
    rpy: Angles | None = None


class Flange(Strict):
    """The flange in the last body's frame."""

    xyz: Position
    rpy: Angles | None = None


class Calibration(Strict):
    """Where calibrated springs came from."""

    scheme: str
    load_path: LoadPath
    links: str
    data: str
    data_sha256: str
    rms_mm: float
    loads_N: tuple[float, ...]  # noqa: N815 - units are in the names of the file's keys
    notes: tuple[str, ...] = ()


class ModelDescription(Strict):
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
