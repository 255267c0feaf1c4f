"""What the user asks of an import, and the materials it knows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from meshes.surfaces.routes import Repair
from robots import InputError, require_one_of
from robots.schema.description import Material
from robots.schema.quantities import Density, Modulus, PoissonsRatio

# Young's modulus (GPa), Poisson's ratio, density (kg/m^3): usual figures of structural steel, a cast aluminium
# alloy and spheroidal graphite iron. Which alloy a casing is made of is not known from its mesh.
MATERIALS = {"steel": (210.0, 0.3, 7850.0), "aluminium": (70.0, 0.33, 2700.0), "cast-iron": (170.0, 0.28, 7100.0)}
Meshes = Literal["auto", "visual", "collision"]
Wrap = Literal["auto", "alpha", "grid"]


@dataclass(frozen=True)
class MaterialChoice:
    """The material asked for, None to let the masses choose, and figures of it that are given (GPa, 1, kg/m^3)."""

    name: str | None = None
    youngs_modulus: float | None = None
    poissons_ratio: float | None = None
    density: float | None = None

    def figures(self, name: str) -> Material:
        """The material of that name with the figures given."""
        return material_of(name, self.youngs_modulus, self.poissons_ratio, self.density)


@dataclass(frozen=True)
class ImportOptions:
    """What the user asks of an import; lengths in m.

    ``wall``: of all links; None: by mass, or assumed. ``walls``, ``rigid``: by link, named as in the URDF or by its
    joint. ``boss``: walls of bosses over the barrel's, None: 2.5, and 1 for hulls. ``robot_kg``: mass of the whole
    arm, where links have none. ``size`` None: some ten thousand elements a link. ``radius``: of the rings, by link, or
    by link and interface as in ``forearm.tip``. ``solids``: STEP files of links, each in its link's frame.
    """

    material: MaterialChoice = MaterialChoice()
    wall: float | None = None
    walls: Mapping[str, float] = field(default_factory=dict)
    boss: float | None = None
    robot_kg: float | None = None
    rigid: tuple[str, ...] = ()
    solids: Mapping[str, Path] = field(default_factory=dict)
    radius: Mapping[str, float] = field(default_factory=dict)
    size: float | None = None
    opening: float | None = None
    meshes: Meshes = "auto"
    repair: Repair = "auto"
    wrap: Wrap = "auto"


def material_of(
    name: str, youngs_modulus: float | None, poissons_ratio: float | None, density: float | None
) -> Material:
    """A material by name, with figures of its own where they are given.

    Raises
    ------
    InputError
        Unknown name, or figures out of range.
    """
    require_one_of("--material", name, MATERIALS, code="L011", remedy="choose the nearest of them")
    given = (youngs_modulus, poissons_ratio, density)
    limits = (("--youngs-modulus-GPa", 1.0, 1000.0), ("--poissons-ratio", 0.0, 0.49), ("--density", 100.0, 25000.0))
    for (option, low, high), value in zip(limits, given, strict=True):
        if value is not None and not low <= value <= high:
            raise InputError(
                option, code="L011", value=value, allowed=f"{low:g} to {high:g}", remedy="look at its unit"
            )
    E, nu, rho = (usual if own is None else own for usual, own in zip(MATERIALS[name], given, strict=True))
    notes = [f"usual for {name}" if own is None else "given to the import" for own in given]
    return Material(
        youngs_modulus=Modulus(value=E, unit="GPa", source="assumed", note=notes[0]),
        poissons_ratio=PoissonsRatio(value=nu, unit="1", source="assumed", note=notes[1]),
        density=Density(value=rho, unit="kg/m^3", source="assumed", note=notes[2]),
    )
