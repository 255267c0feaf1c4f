"""Solids that collisions are looked for between: convex hulls and closed surfaces, sharp or rounded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from meshes.surfaces.checks import census
from meshes.surfaces.reading import read_surface
from robots import InputError
from robots.arrays import Array, Integers, finite

# Has no type hints.
_graph: Any = trimesh.graph
# Sides of a prism that stands for a cylinder. It is drawn around the cylinder, so it is 0.12 % of the radius too large.
SIDES = 64
# Metres for one unit of a mesh file.
UNITS = {"mm": 1e-3, "m": 1.0}
# A surface that fills its hull but for this share of its volume is the hull.
CONVEX = 1e-6


@dataclass(frozen=True, eq=False)
class Solid:
    """All points no farther than ``radius`` from a core, which is a convex hull or what a closed surface encloses.

    ``nodes`` (k, 3) m and ``faces`` (m, 3) of the core, wound outward; a single point or a segment is a core too.
    ``convex``: the core is the hull of its nodes. ``seeds`` (s, 3): one node of each connected surface. Made by
    the functions below, which check what they are given.
    """

    nodes: Array
    faces: Integers
    convex: bool
    seeds: Array
    radius: float = 0.0

    def moved(self, T: ArrayLike) -> Solid:
        """The solid as ``T`` (4, 4) carries it; T is rigid."""
        T = np.asarray(T, dtype=np.float64)
        return replace(self, nodes=self.nodes @ T[:3, :3].T + T[:3, 3], seeds=self.seeds @ T[:3, :3].T + T[:3, 3])


@dataclass(frozen=True, eq=False)
class Body:
    """A named rigid body, the union of its solids. Pairs of bodies are what is checked and reported."""

    name: str
    solids: tuple[Solid, ...]

    def moved(self, T: ArrayLike) -> Body:
        """The body as ``T`` (4, 4) carries it."""
        return replace(self, solids=tuple(solid.moved(T) for solid in self.solids))


def hull(points: ArrayLike, radius: float = 0.0) -> Solid:
    """Convex hull of points (k, 3) m, rounded by ``radius``; the points span a volume.

    Raises
    ------
    InputError
        Points that are not finite, or lie in a plane.
    """
    p = finite("points of a solid", points, ("k", 3), "m")
    _size("rounding radius of a hull", radius, zero=True)
    try:
        mesh = trimesh.convex.convex_hull(p)
    except Exception as error:  # whatever Qhull says
        raise InputError(
            "points of a hull", code="K002", value=f"{len(p)} points", allowed="points that span a volume"
        ) from error
    nodes = np.asarray(mesh.vertices, dtype=np.float64)
    return Solid(nodes, np.asarray(mesh.faces, dtype=np.int64), True, nodes[:1], float(radius))


def box(size: ArrayLike) -> Solid:
    """Box of size (3,) m that stands on the xy plane, centred in x and y.

    Raises
    ------
    InputError
        Sizes that are not three numbers above 0.
    """
    s = np.asarray(size, dtype=np.float64)
    if s.shape != (3,) or not (np.isfinite(s) & (s > 0.0)).all():
        raise InputError("size of a box (m)", code="K002", value=s.tolist(), allowed="three numbers greater than 0")
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)])
    return hull(corners * s)


def cylinder(radius: float, length: float, sides: int = SIDES) -> Solid:
    """Prism drawn around the cylinder along z from 0 to ``length``, m; ``radius / cos(pi / sides)`` at its edges.

    Raises
    ------
    InputError
        Sizes that are not above 0.
    """
    top = np.array([0.0, 0.0, _size("length", length)])
    return hull(np.vstack([ring(radius, sides), ring(radius, sides) + top]))


def ring(radius: float, sides: int) -> Array:
    """Corners (sides, 3) m of the polygon drawn around a circle in the xy plane."""
    angle = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    out = _size("radius", radius) / np.cos(np.pi / sides)
    return np.stack([out * np.cos(angle), out * np.sin(angle), np.zeros(sides)], axis=1)


def sphere(radius: float) -> Solid:
    """Sphere about the origin; exact. Raises InputError for a radius that is not above 0."""
    nodes = np.zeros((1, 3))
    return Solid(nodes, np.zeros((1, 3), dtype=np.int64), True, nodes, _size("radius", radius))


def capsule(start: ArrayLike, end: ArrayLike, radius: float) -> Solid:
    """All points within ``radius`` of a segment; exact.

    Raises
    ------
    InputError
        A radius that is not above 0, ends that coincide or are not finite.
    """
    nodes = finite("ends of a capsule", np.array([start, end]), (2, 3), "m")
    if not np.linalg.norm(nodes[1] - nodes[0]) > 0.0:
        raise InputError("ends of a capsule", code="K002", value=nodes[0].tolist(), allowed="two different points")
    return Solid(nodes, np.array([[0, 1, 1]]), True, nodes[:1], _size("radius", radius))


def surface(name: str, nodes: ArrayLike, faces: ArrayLike, radius: float = 0.0) -> Solid:
    """What a closed surface encloses; several surfaces may be in one, and inner ones cut cavities.

    Raises
    ------
    InputError
        Corners that are not finite, faces out of range, a surface that is open or encloses nothing.
    """
    p, f = finite("points of a solid", nodes, ("k", 3), "m"), np.asarray(faces, dtype=np.int64)
    if f.ndim != 2 or f.shape[1] != 3 or not len(f) or f.min() < 0 or f.max() >= len(p):
        raise InputError(f"faces of {name}", code="K002", value=f"shape {f.shape}", allowed="(m, 3) numbers of nodes")
    _size(f"rounding radius of {name}", radius, zero=True)
    mesh = trimesh.Trimesh(p, f, process=True)
    if not mesh.is_watertight:
        count = census(p, f)[1]
        raise InputError(
            f"surface of {name} is not closed",
            code="L003",
            value=f"{count} open edges" if count else "edges with more than two faces",
            allowed="a closed surface: without an inside, a body within it is not seen",
            remedy="close it in the program it came from, or give a box or cylinder around it",
        )
    if not mesh.is_winding_consistent or mesh.volume < 0.0:
        mesh.fix_normals()
    around = mesh.convex_hull
    if not mesh.volume > 0.0:
        raise InputError(f"surface of {name} encloses nothing", code="L003", remedy="export it again")
    corners, cells = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)
    labels = _graph.connected_component_labels(mesh.face_adjacency, node_count=len(cells))
    first = np.unique(labels, return_index=True)[1]
    # Volumes of several surfaces may count what they share twice.
    if len(first) == 1 and around.volume - mesh.volume < CONVEX * mesh.volume:
        return hull(corners, radius)
    return Solid(corners, cells, False, corners[cells[first, 0]], float(radius))


def mesh_file(path: Path, unit: str) -> Solid:
    """Closed surface from an STL, OBJ or PLY file, whose ``unit`` is mm or m.

    Raises
    ------
    InputError
        Another unit, a file that is missing or cannot be read, a surface that is not closed.
    """
    if unit not in UNITS:
        raise InputError(f"unit of {path.name}", code="L001", value=unit, allowed=" or ".join(UNITS))
    nodes, faces, _ = read_surface(path, UNITS[unit])
    return surface(path.name, nodes, faces)


def inside(point: Array, solid: Solid) -> bool:
    """Whether a point (3,) is inside the core of a closed surface, by its winding number.

    The solid angles of the faces as seen from the point add up to 4 pi inside and 0 outside (A. van Oosterom,
    J. Strackee, IEEE Trans. Biomed. Eng. 30, 1983, doi:10.1109/TBME.1983.325207). Points on the surface fall to
    either side.
    """
    a, b, c = np.moveaxis(solid.nodes[solid.faces] - point, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    over = np.einsum("ij,ij->i", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a)))
    return bool(2.0 * np.arctan2(over, la * lb * lc + ab * lc + bc * la + ca * lb).sum() > 2.0 * np.pi)


def all_nodes(solids: Sequence[Solid]) -> Array:
    """Nodes of all solids (k, 3)."""
    return np.vstack([solid.nodes for solid in solids])


def _size(what: str, value: float, zero: bool = False) -> float:
    if not (np.isfinite(value) and (value > 0.0 or (zero and value == 0.0))):
        raise InputError(f"{what} (m)", code="K002", value=value, allowed=f"greater than 0{' or 0' if zero else ''}")
    return float(value)
