"""The deformed arm as a file: every cell of every link with displacement, stress and strain energy (.vtu)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from fem import ArmFields
from fem.elements.solid import solid_volume
from meshes import ShellMesh, SolidMesh
from meshes.solid_mesh import outer_faces
from robots import InputError
from robots.arrays import Array, Integers
from robots.constants import M_TO_MM
from surrogate.maps.whole_file import whole_file

# Share of the arm's size that the largest displacement is drawn as.
DRAWN_SHARE: Final = 0.08
UNITS: Final = (
    "points and displacement mm, rotation mrad, stress MPa, energy mJ, energy density J/m^3, thickness mm; base axes"
)


@dataclass(frozen=True)
class FieldGrid:
    """Shells and solids of all links as one grid: k nodes, e cells, p parts.

    ``nodes`` (k, 3) m unloaded, ``displacement`` (k, 6) m and rad, both in base axes. ``cells``: nodes of each
    cell in turn, ``starts`` (e + 1,) where each begins: triangles, quads and ten-noded tetrahedra. ``part`` (e,)
    indexes ``parts``. ``energy`` (e,) J, ``volume`` (e,) m^3 of wall, ``thickness`` (e,) m, 0 of solids,
    ``von_mises`` (e, 2) Pa on both faces (see LinkField).
    """

    parts: tuple[str, ...]
    nodes: Array
    displacement: Array
    cells: Integers
    starts: Integers
    part: Integers
    energy: Array
    volume: Array
    thickness: Array
    von_mises: Array

    @property
    def density(self) -> Array:
        """Strain energy per volume of wall (e,), J/m^3."""
        return self.energy / self.volume

    def deformed(self, scale: float) -> Array:
        """Nodes (k, 3) m with their displacement drawn ``scale`` times."""
        return np.asarray(self.nodes + scale * self.displacement[:, :3])

    def triangles(self) -> tuple[Integers, Integers]:
        """What is seen: quads halved, solids' outer faces; triangles (m, 3) of nodes, and the cell (m,) of each."""
        first, size = self.starts[:-1], np.diff(self.starts)
        flat, quad, solid = (np.flatnonzero(found) for found in (size <= 4, size == 4, size == 10))
        corners = np.concatenate([first[flat, None] + [0, 1, 2], first[quad, None] + [0, 2, 3]])
        seen, cell = self.cells[corners], np.concatenate([flat, quad])
        if solid.size:
            skin, owner = outer_faces(self.cells[first[solid, None] + np.arange(10)])
            seen, cell = np.concatenate([seen, skin[:, :3]]), np.concatenate([cell, solid[owner]])
        return seen, cell


def field_grid(fields: ArmFields) -> FieldGrid:
    """Join the fields of all links."""
    links = fields.links
    first = np.cumsum([0, *(len(link.mesh.nodes) for link in links)])
    cells, sizes = [], []
    for link, offset in zip(links, first[:-1], strict=True):
        for nodes in _cells(link.mesh):
            cells.append(offset + nodes.ravel())
            sizes.append(np.full(len(nodes), nodes.shape[1]))
    thickness = [_thickness(link.mesh) for link in links]
    volume = [_volume(link.mesh) for link in links]
    return FieldGrid(
        parts=tuple(link.name for link in links),
        nodes=np.concatenate([link.positions for link in links]),
        displacement=np.concatenate([link.displacement for link in links]),
        cells=np.concatenate(cells).astype(np.int64),
        starts=np.concatenate([[0], np.cumsum(np.concatenate(sizes))]).astype(np.int64),
        part=np.repeat(np.arange(len(links)), [len(v) for v in volume]),
        energy=np.concatenate([link.energy for link in links]),
        volume=np.concatenate(volume),
        thickness=np.concatenate(thickness),
        von_mises=np.concatenate([link.von_mises for link in links]),
    )


def _cells(mesh: ShellMesh | SolidMesh) -> tuple[Integers, ...]:
    """Nodes of the cells by kind."""
    return (mesh.triangles, mesh.quads) if isinstance(mesh, ShellMesh) else (mesh.tetrahedra,)


def _thickness(mesh: ShellMesh | SolidMesh) -> Array:
    return mesh.thickness if isinstance(mesh, ShellMesh) else np.zeros(len(mesh.tetrahedra))


def _volume(mesh: ShellMesh | SolidMesh) -> Array:
    """Volume (e,) m^3 of the cells."""
    return _area(mesh) * mesh.thickness if isinstance(mesh, ShellMesh) else solid_volume(mesh)[0]


def _area(mesh: ShellMesh) -> Array:
    """Area (e,) of the cells, m^2; of a warped quad that of its projection."""
    t, q = mesh.triangle_corners, mesh.quad_corners
    spans = np.concatenate(
        [np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), np.cross(q[:, 2] - q[:, 0], q[:, 3] - q[:, 1])]
    )
    return np.asarray(0.5 * np.linalg.norm(spans, axis=1))


def automatic_scale(grid: FieldGrid) -> float:
    """How many times to draw the displacement: 1, 2 or 5 times a power of ten.

    The largest displacement then measures about ``DRAWN_SHARE`` of the diagonal of the box around the arm.

    Raises
    ------
    InputError
        Nothing moves.
    """
    largest = float(np.linalg.norm(grid.displacement[:, :3], axis=1).max())
    wanted = DRAWN_SHARE * float(np.linalg.norm(np.ptp(grid.nodes, axis=0))) / largest if largest > 0.0 else np.inf
    if not 0.0 < wanted < np.inf:
        raise InputError(
            "deformed arm: the largest displacement (m)", code="B002", value=largest, allowed="greater than 0"
        )
    return round_scale(wanted)


def round_scale(value: float) -> float:
    """The nearest of 1, 2 and 5 times a power of ten, by ratio."""
    decade = np.floor(np.log10(value))
    choices = [float(f"{m}e{int(decade)}") for m in (1, 2, 5, 10)]
    return min(choices, key=lambda c: abs(np.log(c / value)))


def write_field(
    grid: FieldGrid,
    scale: float,
    path: Path,
    *,
    springs: Mapping[str, float] | None = None,
    metadata: Mapping[str, str] | None = None,
) -> None:
    """Write the arm as an XML unstructured grid: points in mm, displaced ``scale`` times, base axes.

    Point arrays: ``displacement_mm`` (true size) and ``rotation_mrad``, three components each, ``undeformed_mm``.
    Cell arrays: ``von_mises_MPa`` (the larger of both faces), ``von_mises_front_MPa`` (the face from which the
    cell's corners run counterclockwise) and ``von_mises_back_MPa``, ``strain_energy_mJ``,
    ``energy_density_J_per_m3``, ``thickness_mm`` (0 of solids), ``part``, a number into the field array ``part_names``.
    Field data: ``scale_factor``, ``energy_total_mJ``, ``spring_names`` with ``spring_energy_mJ`` (what is no shell:
    joints' springs, the bar), ``units``, and the texts of ``metadata``.

    Raises
    ------
    InputError
        The name does not end in .vtu, or the folder does not exist or cannot be written.
    """
    import pyvista as pv

    springs = {} if springs is None else springs
    sizes = np.diff(grid.starts)
    by_size = {3: pv.CellType.TRIANGLE, 4: pv.CellType.QUAD, 10: pv.CellType.QUADRATIC_TETRA}
    kinds = np.select([sizes == size for size in by_size], list(by_size.values())).astype(np.uint8)
    # Each cell's corners stand behind their count.
    out = pv.UnstructuredGrid(np.insert(grid.cells, grid.starts[:-1], sizes), kinds, grid.deformed(scale) * M_TO_MM)
    out.point_data.update(
        {
            "displacement_mm": grid.displacement[:, :3] * M_TO_MM,
            "rotation_mrad": grid.displacement[:, 3:] * 1e3,
            "undeformed_mm": grid.nodes * M_TO_MM,
        }
    )
    stress = grid.von_mises * 1e-6
    cells: dict[str, Any] = {
        "von_mises_MPa": stress.max(axis=1),
        "von_mises_front_MPa": stress[:, 0],
        "von_mises_back_MPa": stress[:, 1],
        "strain_energy_mJ": grid.energy * 1e3,
        "energy_density_J_per_m3": grid.density,
        "thickness_mm": grid.thickness * M_TO_MM,
        "part": grid.part,
    }
    out.cell_data.update(cells)
    out.field_data.update(
        {
            "scale_factor": np.array([scale]),
            "energy_total_mJ": np.array([grid.energy.sum() + sum(springs.values())]) * 1e3,
            "spring_energy_mJ": np.array(list(springs.values()), dtype=np.float64) * 1e3,
            "part_names": np.array(grid.parts, dtype=str),
            "spring_names": np.array(list(springs), dtype=str),
            "units": np.array([UNITS]),
            **{name: np.array([text]) for name, text in (metadata or {}).items()},
        }
    )
    out.point_data.active_vectors_name = "displacement_mm"
    out.cell_data.active_scalars_name = "energy_density_J_per_m3"
    _write(out, path)


def _write(grid: Any, path: Path) -> None:
    """Write a ``vtkUnstructuredGrid``: binary, compressed, whole or not at all."""
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    with whole_file(path, ".vtu") as draft:
        writer = vtkXMLUnstructuredGridWriter()
        writer.SetInputData(grid)
        writer.SetFileName(str(draft))
        writer.SetDataModeToBinary()
        writer.SetCompressorTypeToZLib()
        if writer.Write() != 1 or writer.GetErrorCode() != 0:
            raise InputError(
                f"file {path} could not be written", code="F008", remedy="check the free space of the disk"
            )
