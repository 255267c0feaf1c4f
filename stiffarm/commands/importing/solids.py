"""Links as solids: from STEP files, and where a mesh is that of the material itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fem.elements.solid import solid_volume
from meshes import save_solid
from meshes.solids.link import ImportedSolid, SolidSettings, import_solid, is_material, solid_in_surface
from meshes.surfaces.bodies import BodySurface
from meshes.surfaces.checks import census, mean_wall
from meshes.surfaces.reading import SPAN_RATIO
from meshes.surfaces.rings import Interface
from robots import InputError, ModelDescription
from robots.arrays import Array, Integers
from robots.library.surface_files import surface_file_name
from robots.schema.description import Material, Solid
from robots.schema.quantities import PositiveLength


@dataclass(frozen=True)
class Piece:
    """What is drawn of a link: nodes (n, 3) m, outward triangles (m, 3), nodes of each interface, its points (i, 3)."""

    name: str
    nodes: Array
    triangles: Integers
    interfaces: Mapping[str, Integers]
    points: Array


@dataclass(frozen=True)
class MadeSolid:
    """The solid made for a link, by its name: its interfaces' points (i, 3) m, its mass by volume, its file."""

    name: str
    solid: ImportedSolid
    points: Array
    kg: float
    source: str

    @property
    def piece(self) -> Piece:
        """What is drawn of it."""
        mesh = self.solid.mesh
        return Piece(f"{self.name}, solid", mesh.nodes, mesh.skin[:, :3], mesh.interfaces, self.points)


def solid_settings(
    material: Material, size: float | None, span: float | None = None, ratio: tuple[float, float] = SPAN_RATIO
) -> SolidSettings:
    """How solids of a material are meshed; lengths in m."""
    return SolidSettings(material.youngs_modulus.si, material.poissons_ratio.si, size, span, ratio)


def from_file(
    name: str,
    path: Path,
    interfaces: Mapping[str, Interface],
    material: Material,
    settings: SolidSettings,
    scale: float | None = None,
) -> MadeSolid:
    """Solid of a link from a file; errors as of :func:`meshes.solids.link.import_solid`."""
    return _made(name, import_solid(path, interfaces, settings, scale), interfaces, material, path.name)


def of_material(
    name: str, own: BodySurface, interfaces: Mapping[str, Interface], material: Material, settings: SolidSettings
) -> tuple[MadeSolid | None, str | None]:
    """Solid of a link whose mesh is that of the material itself, None where it is not; and what is to be said of it."""
    if census(own.nodes, own.faces)[1] or not is_material(own.nodes, own.faces):
        return None, None
    wall = (
        f"link {name}: its mesh encloses the material itself, {1e3 * mean_wall(own.nodes, own.faces)[0]:.3g} mm thick"
    )
    try:
        solid = solid_in_surface(name, own.nodes, own.faces, interfaces, settings, own.notes)
    except InputError as error:
        return None, f"{wall}, but no solid could be made of it: {error.prose}"
    made = _made(name, solid, interfaces, material, ", ".join(own.sources))
    return made, f"{wall}; use --links solid to model it as a solid"


def _made(
    name: str, solid: ImportedSolid, interfaces: Mapping[str, Interface], material: Material, source: str
) -> MadeSolid:
    kg = float(solid_volume(solid.mesh)[0].sum()) * material.density.si
    return MadeSolid(name, solid, np.stack([one.point for one in interfaces.values()]), kg, source)


def with_solids(
    description: ModelDescription, solids: Sequence[MadeSolid], folder: Path, source: str
) -> ModelDescription:
    """The description with solids of its links, written into ``folder``; ``source``: a key of its sources."""
    by_name = {made.name: made for made in solids}
    links = [
        link.model_copy(update={"solid": _written(by_name[link.name], folder, source)})
        if link.name in by_name
        else link
        for link in description.link
    ]
    return description.model_copy(update={"link": tuple(links)})


def _written(made: MadeSolid, folder: Path, source: str) -> Solid:
    unnamed = folder / "solid.npz"
    sha256 = save_solid(made.solid.mesh, unnamed)
    path = unnamed.replace(folder / surface_file_name(f"{made.name}-solid", sha256))
    size = PositiveLength(value=round(1e3 * made.solid.size, 3), unit="mm", source="derived")
    return Solid(file=str(path.resolve()), sha256=sha256, size=size, source=source, changes=made.solid.report)
