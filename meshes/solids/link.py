"""A link's solid from a STEP file or a closed surface: meshed, its seats found and checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from meshes.shell_mesh import connected, sides
from meshes.solid_mesh import SolidMesh, outer_faces
from meshes.solids.tetrahedra import in_surface, mesh_step, open_step
from meshes.surfaces.checks import mean_wall
from meshes.surfaces.link import check_interfaces
from meshes.surfaces.reading import SPAN_RATIO, STEP_SUFFIXES, check_scale, read_surface
from meshes.surfaces.rings import Interface, Ring, choose_rings
from robots.arrays import Array, Bools, Integers

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
        What :func:`meshes.solids.tetrahedra.open_step` and :func:`meshes.solids.tetrahedra.in_surface` refuse, a
        wrong scale, no seat at an interface, seats that share nodes.
    """
    name = path.stem
    if path.suffix.lower() not in STEP_SUFFIXES:
        nodes, faces, notes = read_surface(path, scale)
        return solid_in_surface(name, nodes, faces, interfaces, settings, tuple(notes))
    check_interfaces(interfaces)
    step = open_step(path, scale)
    said = check_scale(name, step.extent, _points(interfaces), settings.expected_span, settings.span_ratio)
    nodes, cells, size, notes = mesh_step(step, settings.size)
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
    skin = _outside(outer_faces(cells)[0], nodes)
    used, place = np.unique(skin[:, :3], return_inverse=True)
    corners, faces = nodes[used], place.reshape(-1, 3)
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


def _outside(skin: Integers, nodes: Array) -> Integers:
    """Faces (f, 6) of a solid's outer skin; no joint sits in a closed hollow."""
    used, place = np.unique(skin[:, :3], return_inverse=True)
    faces = place.reshape(-1, 3)
    body = connected(len(used), sides(faces))
    # What lies farthest out, in whatever direction, is the outer skin.
    return np.asarray(skin[body[faces[:, 0]] == body[np.argmax(nodes[used, 0])]])


def _whole_face(ring: Ring, here: Interface, nodes: Array, faces: Integers, size: float) -> Ring:
    """The plane faces that a seat lies on, where they are hardly larger than the seat; else the seat as it is.

    A shell's seat is cut to be on the safe side; a solid shows where the machined face ends.
    """
    if here.axis is None or here.radius is not None:
        return ring
    axis = here.axis / np.linalg.norm(here.axis)
    along = (nodes - here.point) @ axis
    off = np.linalg.norm(nodes - here.point - along[:, None] * axis, axis=1)
    in_ring = np.zeros(len(nodes), dtype=bool)
    in_ring[ring.nodes] = True
    # Across the axis, with a corner in the seat.
    flat = np.ptp(along[faces], axis=1) <= 2.0 * ON_PLANE * size
    planes = []
    for level in np.unique(np.round(along[faces[flat & in_ring[faces].all(axis=1), 0]] / (ON_PLANE * size))):
        same = flat & (np.abs(along[faces] - level * ON_PLANE * size) <= 2.0 * ON_PLANE * size).all(axis=1)
        face = _spread(in_ring, faces[same])
        if face.size and off[face].max() <= WHOLE_FACE * ring.radius:
            planes.append(face)
    if not planes:
        return ring
    gap = [_gap(here, nodes[face], along[face]) for face in planes]
    found = np.unique(np.concatenate([face for face, one in zip(planes, gap, strict=True) if one <= min(gap) + size]))
    radius = float(off[found].max())
    words = f"whole plane face, {1e3 * radius:.4g} mm about the joint's axis"
    return replace(ring, nodes=found, radius=radius, words=words)


def _spread(start: Bools, faces: Integers) -> Integers:
    """Nodes that faces (f, 3) lead to from those of ``start`` (n,) which are on them."""
    on = np.zeros(len(start), dtype=bool)
    on[faces[start[faces].all(axis=1)]] = True
    while True:
        grown = on.copy()
        grown[faces[on[faces].any(axis=1)]] = True
        if (grown == on).all():
            return np.flatnonzero(on)
        on = grown


def _gap(here: Interface, nodes: Array, along: Array) -> float:
    """How far a face is from the neighbour (m), or without one from the interface's point along the axis."""
    if here.facing is None or not len(here.facing):
        return float(np.abs(np.median(along)))
    return float(np.quantile(KDTree(here.facing).query(nodes)[0], 0.25))


def _with_middles(nodes: Integers, skin: Integers) -> Integers:
    """Corner nodes and the middles of the sides of skin faces (f, 6) between two of them."""
    held = np.isin(skin[:, :3], nodes)
    middles = skin[:, 3:][held & np.roll(held, -1, axis=1)]
    return np.union1d(nodes, middles)
