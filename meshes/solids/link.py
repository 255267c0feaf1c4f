"""A link's solid from a STEP file or a closed surface: meshed, its seats found and checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from meshes.solid_mesh import SolidMesh, outer_faces
from meshes.solids.tetrahedra import STEP_SUFFIXES, in_surface, read_step
from meshes.surfaces.checks import mean_wall
from meshes.surfaces.link import check_interfaces
from meshes.surfaces.reading import SPAN_RATIO, check_scale, read_surface
from meshes.surfaces.rings import Interface, Ring, choose_rings
from robots.arrays import Array, Integers

# A closed surface whose mean wall is less than this share of its least extent is that of the material itself: walls of
# castings have some 0.05, outer skins and solid bars 0.25 and more.
MATERIAL = 0.15
# A seat takes in all of the plane face that it lies on, where that reaches no further than so many of its radii;
# nodes this near to the plane, in element sizes, lie on it.
WHOLE_FACE, ON_PLANE = 1.6, 0.01


@dataclass(frozen=True)
class SolidSettings:
    """How a solid is meshed. ``size`` m; None gives some 25,000 tetrahedra. Span and its ratio as of shells."""

    youngs_modulus: float
    poissons_ratio: float
    size: float | None = None
    expected_span: float | None = None
    span_ratio: tuple[float, float] = SPAN_RATIO


@dataclass(frozen=True)
class ImportedSolid:
    """Solid mesh of a link, what was done to get it, element size (m), and rings by interface."""

    mesh: SolidMesh
    report: tuple[str, ...]
    size: float
    rings: dict[str, Ring]


def is_material(nodes: Array, faces: Integers) -> bool:
    """Whether a closed surface is that of the material itself, both sides of its walls."""
    return bool(mean_wall(nodes, faces)[1] < MATERIAL)


def import_solid(
    path: Path, interfaces: Mapping[str, Interface], settings: SolidSettings, scale: float | None = None
) -> ImportedSolid:
    """Solid of a link from a STEP file or a closed STL, OBJ, PLY or DAE file, in the link's own frame.

    Parameters
    ----------
    interfaces : the root first
    scale : metres for one unit of the file; None takes the file's own, else metres (STEP has its own always)

    Raises
    ------
    InputError
        What :func:`meshes.solids.tetrahedra.read_step` and :func:`meshes.solids.tetrahedra.in_surface` refuse, a
        wrong scale, no seat at an interface, seats that share nodes.
    """
    name = path.stem
    if path.suffix.lower() not in STEP_SUFFIXES:
        nodes, faces, notes = read_surface(path, scale)
        return solid_in_surface(name, nodes, faces, interfaces, settings, tuple(notes))
    check_interfaces(interfaces)
    nodes, cells, size, notes = read_step(path, settings.size, scale)
    said = check_scale(name, nodes, _points(interfaces), settings.expected_span, settings.span_ratio)
    return _with_seats(name, nodes, cells, size, interfaces, settings, (*notes, said))


def solid_in_surface(
    name: str,
    nodes: Array,
    faces: Integers,
    interfaces: Mapping[str, Interface],
    settings: SolidSettings,
    notes: tuple[str, ...] = (),
) -> ImportedSolid:
    """As :func:`import_solid`, from a surface, nodes (n, 3) m and faces (m, 3)."""
    check_interfaces(interfaces)
    said = check_scale(name, nodes, _points(interfaces), settings.expected_span, settings.span_ratio)
    points, cells, size, more = in_surface(name, nodes, faces, settings.size)
    return _with_seats(name, points, cells, size, interfaces, settings, (*notes, said, *more))


def _points(interfaces: Mapping[str, Interface]) -> Array:
    return np.stack([interface.point for interface in interfaces.values()])


def _with_seats(
    name: str,
    nodes: Array,
    cells: Integers,
    size: float,
    interfaces: Mapping[str, Interface],
    settings: SolidSettings,
    notes: tuple[str, ...],
) -> ImportedSolid:
    skin, _ = outer_faces(cells)
    used, place = np.unique(skin[:, :3], return_inverse=True)
    corners, faces = nodes[used], place.reshape(-1, 3)
    # Neighbours are measured to in elements, which on a solid may be smaller than what was asked for.
    found, shrunk = choose_rings(interfaces, corners, faces, size, name)
    rings, report = {}, [*notes, *shrunk]
    for key, ring in found.items():
        whole = _whole_face(ring, interfaces[key], corners, faces, size)
        rings[key] = Ring(_with_middles(used[whole.nodes], skin), whole.radius, whole.words)
        report.append(f"interface {key}: {whole.words}, {rings[key].nodes.size} nodes")
    mesh = SolidMesh(
        name,
        nodes,
        cells,
        settings.youngs_modulus,
        settings.poissons_ratio,
        {key: ring.nodes for key, ring in rings.items()},
    )
    return ImportedSolid(mesh, tuple(report), size, rings)


def _whole_face(ring: Ring, here: Interface, nodes: Array, faces: Integers, size: float) -> Ring:
    """The plane face that a seat lies on, where it is one and hardly larger than the seat; else the seat as it is.

    A shell's seat is cut to be on the safe side; a solid shows where the machined face ends.
    """
    if here.axis is None or here.radius is not None:
        return ring
    axis = here.axis / np.linalg.norm(here.axis)
    along = (nodes - here.point) @ axis
    level = float(np.median(along[ring.nodes]))
    flat = (np.abs(along[faces] - level) <= ON_PLANE * size).all(axis=1)
    if np.abs(along[ring.nodes] - level).max() > 2.0 * size or not flat.any():
        return ring
    # Spread over the plane's faces from those of the seat.
    face = np.isin(np.arange(len(nodes)), ring.nodes) & (np.abs(along - level) <= ON_PLANE * size)
    while True:
        grown = face.copy()
        grown[faces[flat & face[faces].any(axis=1)]] = True
        if (grown == face).all():
            break
        face = grown
    off = np.linalg.norm(nodes - here.point - along[:, None] * axis, axis=1)
    found = np.flatnonzero(face)
    if not found.size or off[found].max() > WHOLE_FACE * ring.radius:
        return ring
    radius = float(off[found].max())
    return replace(
        ring, nodes=found, radius=radius, words=f"whole plane face, {1e3 * radius:.4g} mm about the joint's axis"
    )


def _with_middles(nodes: Integers, skin: Integers) -> Integers:
    """Corner nodes and the middles of the sides of skin faces (f, 6) between two of them."""
    held = np.isin(skin[:, :3], nodes)
    middles = skin[:, 3:][held & np.roll(held, -1, axis=1)]
    return np.union1d(nodes, middles)
