"""Links in a model file: sections, casings' openings and rims, prepared surfaces, materials."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from robots.schema.quantities import Density, Direction, Mass, Modulus, PoissonsRatio, Position, PositiveLength, Strict

FlangeCoupling = Literal["rigid", "distributing"]


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


class PreparedMesh(Strict):
    """A mesh of a link in a file beside the model; written by `import`.

    ``file`` is relative to the model file; ``sha256`` is that of the file's content. ``changes`` says what was
    done to the source to get it.
    """

    file: str
    sha256: str
    size: PositiveLength
    source: str
    changes: tuple[str, ...] = ()


class Surface(PreparedMesh):
    """A prepared shell mesh of a link that takes the casing's place (shell links)."""

    wall: PositiveLength


class Solid(PreparedMesh):
    """A prepared mesh of tetrahedra of a link, of the material itself (solid links)."""


class Link(Strict):
    """A link: the body it is, its material, its section (tapering to ``section_end``), its mass.

    The centre line runs from the body's own joint to the next one, through ``via`` if given; or from ``rigid_to`` to
    ``rigid_from``, where the link is rigid from its own joint to the first and from the second to the next joint.
    ``beam_up`` is the direction (body frame) that the section's height follows. For shell links: openings and
    rims of the casing, or the ``surface`` in its place. For solid links: the ``solid``. For both: how the interfaces
    (``root``, ``tip``, ``pin``) are coupled to their points (``flanges``; rigid where nothing is said).
    ``youngs_modulus`` overrides the material's.
    """

    name: str
    body: str
    material: str
    section: Section
    section_end: Section | None = None
    via: tuple[Position, ...] = ()
    rigid_to: Position | None = None
    rigid_from: Position | None = None
    beam_up: Direction = (0.0, 0.0, 1.0)
    mass: Mass | None = None
    opening: tuple[Opening, ...] = ()
    rim: Rim | None = None
    surface: Surface | None = None
    solid: Solid | None = None
    flanges: dict[Literal["root", "tip", "pin"], FlangeCoupling] = Field(default_factory=dict)
    youngs_modulus: Modulus | None = None

    @model_validator(mode="after")
    def _of_one_kind(self) -> Self:
        if self.section_end is not None and self.section_end.kind != self.section.kind:
            raise ValueError(f"link {self.name!r} cannot taper from {self.section.kind} to another kind")
        if self.opening and self.section.kind != "box":
            raise ValueError(f"link {self.name!r} is a {self.section.kind}; only box casings can have openings")
        return self
