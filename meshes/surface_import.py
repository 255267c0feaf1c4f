"""A link's shell mesh from a user's surface file: repaired, remeshed, moved to the mid-surface, rings picked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
import trimesh
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.csgraph import connected_components

from meshes.shell_mesh import ShellMesh
from meshes.surface_checks import check_scale, crossings, read_surface, repair_surface
from meshes.surface_remesh import normals, remesh, unit
from robots import InputError

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]

# Has no type hints.
_triangles: Any = trimesh.triangles

# Elements beyond this come from a target size in the wrong unit.
MOST_ELEMENTS = 400_000
# Directions in which the faces around a node say less than this about the mid-surface are left alone.
LEAST_SHARE = 0.03
# No node moves further than this many half walls: a right-angled corner needs 1.73.
FARTHEST = 2.5
LEAST_RING = 6
POOR_ANGLE_DEG = 10.0


@dataclass(frozen=True)
class ImportedLink:
    """Shell mesh of a link and what was done to get it, one line a change or figure."""

    mesh: ShellMesh
    report: tuple[str, ...]


def import_surface(
    path: Path | str,
    *,
    scale: float | None = None,
    target_size: float,
    wall: float,
    youngs_modulus: float,
    poissons_ratio: float,
    interface_points: Mapping[str, ArrayLike],
    interface_radius: Mapping[str, float] | None = None,
    expected_span: float | None = None,
) -> ImportedLink:
    """Triangle shell on the mid-surface of a casing whose outer skin is in a STL, OBJ, DAE or PLY file.

    Parameters
    ----------
    path : the file, in the link's own frame
    scale : metres for one unit of the file (0.001 for mm); None takes the file's own unit, else metres
    target_size : edge length aimed at, m
    wall : thickness everywhere, m; the skin moves inward by half of it
    youngs_modulus, poissons_ratio : Pa, -
    interface_points : point (3,) m of each interface, the root first
    interface_radius : by name, m: the ring is every node so near the point. Without it, the ring is the band of
        nodes within half a target size of the plane through the point, at right angles to the way to the other
        points, around the point; a closed end there belongs to it
    expected_span : distance that the surface should span, m; None takes the interfaces' largest distance

    Limits: one closed outer skin and one wall thickness; openings must be closed in the file, holes smaller than
    two target sizes across are filled; details smaller than the target size are lost.

    Raises
    ------
    InputError
        Bad numbers, unreadable file, wrong scale, an open, self-crossing or degenerate surface, several bodies,
        a wall that the casing has no room for, no ring at an interface, rings that share nodes.
    """
    path = Path(path)
    points = _checked_points(interface_points, interface_radius, target_size, wall)
    nodes, faces, report = read_surface(path, scale)
    report.append(check_scale(path.name, nodes, np.stack(list(points.values())), expected_span))
    nodes, faces, notes = repair_surface(path.name, nodes, faces, 2.0 * np.pi * target_size)
    _check_room(path.name, nodes, faces, target_size, wall)
    skin, cells = remesh(nodes, faces, target_size)
    _refuse_crossings(path.name, skin, cells, "crosses itself", "separate the parts in the program it came from")
    report += [*notes, f"remeshed from {len(faces)} to {len(cells)} triangles of {1e3 * target_size:.4g} mm"]
    rings = {name: _ring(name, point, points, interface_radius, skin, cells, target_size)
             for name, point in points.items()}  # fmt: skip
    _check_apart(rings)
    middle, fewer = offset_inward(path.name, skin, cells, 0.5 * wall)
    _refuse_crossings(path.name, middle, cells, "has places thinner than the wall", "give the wall's true thickness")
    report.append(f"nodes moved inward by half the wall, {1e3 * wall / 2:.4g} mm, to the mid-surface")
    if fewer:
        report.append(f"{fewer} nodes moved less, where elements would have folded")
    report += [f"interface {name}: ring of {ring.size} nodes" for name, ring in rings.items()]
    mesh = ShellMesh(
        name=path.stem,
        nodes=middle,
        triangles=cells,
        quads=np.zeros((0, 4), dtype=np.int64),
        thickness=np.full(len(cells), float(wall)),
        youngs_modulus=youngs_modulus,
        poissons_ratio=poissons_ratio,
        interfaces=rings,
    )
    return ImportedLink(mesh, (*report, _quality(middle, cells)))


def _checked_points(
    points: Mapping[str, ArrayLike], radius: Mapping[str, float] | None, target_size: float, wall: float
) -> dict[str, Array]:
    """Interface points as arrays, with the numbers beside them checked."""
    for what, value in (("wall thickness (m)", wall), ("target size (m)", target_size)):
        if not 0.0 < value < np.inf:
            raise InputError(what, value=value, allowed="greater than 0")
    found = {name: np.asarray(point, dtype=np.float64) for name, point in points.items()}
    if not found:
        raise InputError("no interface points", remedy="name one point or more, the root first")
    for name, point in found.items():
        if point.shape != (3,) or not np.isfinite(point).all():
            raise InputError(f"interface point {name} (m)", value=point.tolist(), allowed="three finite numbers")
    for name, value in (radius or {}).items():
        if name not in found or not 0.0 < value < np.inf:
            raise InputError(
                f"interface radius {name} (m)", value=value, allowed=f"greater than 0, for {', '.join(found)}"
            )
    if len(found) == 1 and not radius:
        raise InputError("one interface has no direction to cut along", remedy="give its interface_radius")
    return found


def _check_room(name: str, nodes: Array, faces: Indices, size: float, wall: float) -> None:
    """Refuse target sizes out of all proportion, and skins that enclose the wall instead of the casing."""
    mesh = trimesh.Trimesh(nodes, faces, process=False)
    elements = mesh.area / (np.sqrt(0.1875) * size**2)
    if not 50.0 <= elements <= MOST_ELEMENTS:
        raise InputError(
            f"target size for {name} (m)", value=size, allowed=f"50 to {MOST_ELEMENTS} elements, not {elements:.3g}"
        )
    room = 2.0 * mesh.volume / mesh.area
    # A plain tube has a quarter of its width more than this; two sides of a wall have exactly the wall.
    if room < 2.0 * wall:
        raise InputError(
            f"surface {name} encloses {room:.3g} m on average between its sides (2 volume / area)",
            value=f"wall {wall:.3g} m",
            allowed="a wall below half of it",
            remedy="if the file holds both sides of the casing's wall, export the outer skin alone, closed",
        )


def _refuse_crossings(name: str, nodes: Array, faces: Indices, what: str, remedy: str) -> None:
    pairs = crossings(nodes, faces)
    if len(pairs):
        place = np.round(nodes[faces[pairs[0, 0]]].mean(axis=0), 4).tolist()
        raise InputError(
            f"surface {name} {what}: {np.unique(pairs).size} triangles, the first near {place} m", remedy=remedy
        )


def _ring(
    name: str, point: Array, points: Mapping[str, Array], radius: Mapping[str, float] | None,
    nodes: Array, faces: Indices, size: float,
) -> Indices:  # fmt: skip
    """Nodes of one interface on the outer skin."""
    distance = np.linalg.norm(nodes - point, axis=1)
    if radius and name in radius:
        where = f"a radius of {radius[name]:.4g} m"
        ring = np.flatnonzero(distance <= radius[name])
    else:
        way = np.mean([other for key, other in points.items() if key != name], axis=0) - point
        where = "the plane through it"
        ring = np.flatnonzero(np.abs((nodes - point) @ way) <= 0.5 * size * np.linalg.norm(way))
        if ring.size:
            ring = _nearest_piece(ring, faces, distance)
            middle = nodes[ring].mean(axis=0)
            # Around the point, not beside it.
            if np.linalg.norm(point - middle) > np.linalg.norm(nodes[ring] - middle, axis=1).max():
                ring = ring[:0]
    if ring.size < LEAST_RING:
        raise InputError(
            f"no ring found at interface {name}: {ring.size} nodes around {point.tolist()} m within {where}",
            value=f"the nearest node is {distance.min():.4g} m away",
            allowed=f"{LEAST_RING} nodes or more",
            remedy="move the point onto the surface's end, or give its interface_radius",
        )
    return ring


def _nearest_piece(ring: Indices, faces: Indices, distance: Array) -> Indices:
    """The connected part of a band of nodes that has the node nearest to the point."""
    edges = np.concatenate([faces[:, :2], faces[:, 1:], faces[:, ::2]])
    edges = edges[np.isin(edges, ring).all(axis=1)]
    shape = (len(distance), len(distance))
    label = connected_components(sp.coo_array((np.ones(len(edges)), tuple(edges.T)), shape=shape), False)[1]
    return np.asarray(ring[label[ring] == label[ring[np.argmin(distance[ring])]]])


def _check_apart(rings: Mapping[str, Indices]) -> None:
    owner: dict[int, str] = {}
    for name, ring in rings.items():
        shared = {owner[node] for node in ring.tolist() if node in owner}
        if shared:
            raise InputError(
                f"interfaces {shared.pop()} and {name} share nodes", remedy="give smaller interface_radius for both"
            )
        owner |= dict.fromkeys(ring.tolist(), name)


def offset_inward(name: str, nodes: Array, faces: Indices, depth: float) -> tuple[Array, int]:
    """Move nodes (n, 3) so that the planes of the faces around each move inward by ``depth`` m.

    Least squares over the faces, weighted by angle, so that sharp edges and corners keep the wall on all their
    sides. Nodes of elements that would fold move less; their number comes with the new nodes.

    Raises
    ------
    InputError
        Elements fold even so.
    """
    normal = unit(normals(nodes, faces))
    weight = _triangles.angles(nodes[faces])[:, :, None]
    matrix, side = np.zeros((len(nodes), 3, 3)), np.zeros((len(nodes), 3))
    np.add.at(matrix, faces, weight[..., None] * (normal[:, :, None] * normal[:, None, :])[:, None])
    np.add.at(side, faces, -depth * weight * normal[:, None])
    values, axes = np.linalg.eigh(matrix)
    inverse = np.where(values > LEAST_SHARE * values[:, -1:], 1.0 / np.maximum(values, 1e-300), 0.0)
    move = np.einsum("nij,nj,nkj,nk->ni", axes, inverse, axes, side)
    move *= np.minimum(1.0, FARTHEST * depth / np.maximum(np.linalg.norm(move, axis=1), 1e-300))[:, None]
    less = np.zeros(len(nodes), dtype=bool)
    for _ in range(5):
        folded = _folded(nodes, nodes + move, faces)
        if not folded.any():
            return nodes + move, int(less.sum())
        worst = np.unique(faces[folded])
        less[worst] = True
        move[worst] *= 0.5
    raise InputError(
        f"surface {name}: {int(folded.sum())} elements fold on the way to the mid-surface",
        value=f"inward by {depth:.4g} m",
        remedy="smooth sharp details, or choose a larger target size or a thinner wall",
    )


def _folded(before: Array, after: Array, faces: Indices) -> Flags:
    """Faces (m,) that turned by more than 60 deg or with an edge that all but vanished or turned round."""
    tilted = np.einsum("ij,ij->i", unit(normals(after, faces)), unit(normals(before, faces))) < 0.5
    old, new = (np.roll(nodes[faces], -1, axis=1) - nodes[faces] for nodes in (before, after))
    return np.asarray(tilted | ((old * new).sum(axis=2) < 0.1 * (old**2).sum(axis=2)).any(axis=1))


def _quality(nodes: Array, faces: Indices) -> str:
    mesh = trimesh.Trimesh(nodes, faces, process=False)
    least = float(np.rad2deg(_triangles.angles(nodes[faces]).min()))
    edge = mesh.edges_unique_length
    poor = " (POOR: stresses near it are not to be trusted)" if least < POOR_ANGLE_DEG else ""
    return (
        f"quality: {len(faces)} triangles, minimum angle {least:.1f} deg{poor}, edges {1e3 * edge.min():.4g} to "
        f"{1e3 * edge.max():.4g} mm, watertight {'yes' if mesh.is_watertight else 'NO'}, "
        f"bodies {mesh.body_count}, folds 0, area {mesh.area:.6g} m2"
    )
