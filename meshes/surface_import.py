"""A link's shell mesh from a user's surface file: repaired, remeshed, moved to the mid-surface, rings picked.

The remesher is the isotropic one of Botsch and Kobbelt (2004): split long edges, collapse short ones, flip to
Delaunay, smooth in the tangent plane, project back; each pass works on an independent set of edges at once.
"""

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
from scipy.spatial import KDTree

from meshes.shell_mesh import ShellMesh
from meshes.surface_checks import check_scale, crossings, read_surface, repair_surface
from robots import InputError

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]

# Has no type hints.
_triangles: Any = trimesh.triangles

# Edges between these shares of the target size stay (Botsch and Kobbelt).
SHORT, LONG = 0.8, 4.0 / 3.0
# Faces that meet at more than 40 deg form an edge of the part, which remeshing keeps.
SHARP = np.cos(np.deg2rad(40.0))
ROUNDS = 8
LEFT_OVER = 0.002
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
    normal = _unit(_normals(nodes, faces))
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
    tilted = np.einsum("ij,ij->i", _unit(_normals(after, faces)), _unit(_normals(before, faces))) < 0.5
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


def remesh(nodes: Array, faces: Indices, size: float) -> tuple[Array, Indices]:
    """Even triangles of edge ``size`` m on a closed manifold surface; edges sharper than 40 deg are kept."""
    target = _Surface(nodes, faces, size)
    for _ in range(ROUNDS):
        nodes, faces = _split(nodes, faces, LONG * size)
        nodes, faces = _collapse(nodes, faces, size)
        faces = _flip(nodes, faces)
        nodes = _smooth(nodes, faces, target)
    return nodes, _flip(nodes, faces)


@dataclass(frozen=True)
class _Edges:
    """Edges of a closed manifold: ends (e, 2) in the first face's sense, both faces (e, 2), corners opposite (e, 2)."""

    ends: Indices
    faces: Indices
    opposite: Indices
    sides: Indices  # (m, 3): edge from corner i to corner i + 1 of each face


def _edges(faces: Indices) -> _Edges:
    half = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    pairs = np.argsort(half.min(axis=1) * (faces.max() + 1) + half.max(axis=1), kind="stable").reshape(-1, 2)
    sides = np.empty(len(half), dtype=np.int64)
    sides[pairs] = np.arange(len(pairs))[:, None]
    return _Edges(half[pairs[:, 0]], pairs // 3, faces[pairs // 3, (pairs + 2) % 3], sides.reshape(-1, 3))


def _normals(nodes: Array, faces: Indices) -> Array:
    """Normals (m, 3) as long as twice the area."""
    a, b, c = (nodes[faces[:, i]] for i in range(3))
    return np.asarray(np.cross(b - a, c - a))


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300))


def _sharpness(nodes: Array, faces: Indices, edges: _Edges) -> tuple[Flags, Indices]:
    """Which edges (e,) are sharp, and the nodes' kind (n,): 0 on a face, 1 along a sharp edge, 2 a corner."""
    normal = _unit(_normals(nodes, faces))
    sharp = np.einsum("ij,ij->i", normal[edges.faces[:, 0]], normal[edges.faces[:, 1]]) < SHARP
    ends = edges.ends[sharp]
    way = _unit(nodes[ends[:, 1]] - nodes[ends[:, 0]])
    turn = np.zeros((len(nodes), 3))
    np.add.at(turn, ends[:, 0], way)
    np.add.at(turn, ends[:, 1], -way)
    degree = np.bincount(ends.ravel(), minlength=len(nodes))
    # Two edges that go straight on cancel; |turn| = 2 sin(angle / 2).
    bent = np.linalg.norm(turn, axis=1) > np.sqrt(2.0 - 2.0 * SHARP)
    return sharp, np.where(degree == 0, 0, np.where((degree == 2) & ~bent, 1, 2))


def _first_of(rank: Array, groups: Indices, n: int) -> Array:
    """Smallest rank (n,) among the edges that touch each of n nodes."""
    first = np.full(n, np.inf)
    for column in groups.T:
        np.minimum.at(first, column, rank)
    return first


def _split(nodes: Array, faces: Indices, longest: float) -> tuple[Array, Indices]:
    """Halve edges longer than ``longest`` until there are none; neighbours stay joined."""
    while True:
        edges = _edges(faces)
        ends = nodes[edges.ends]
        long = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > longest
        if not long.any():
            return nodes, faces
        number = np.where(long, len(nodes) + np.cumsum(long) - 1, -1)
        nodes = np.vstack([nodes, ends[long].mean(axis=1)])
        middle = number[edges.sides]
        marked = (middle >= 0).sum(axis=1)
        # Turn each face so that its one marked side is the first, its one unmarked side the last.
        lead = np.where(marked == 1, np.argmax(middle >= 0, axis=1), (np.argmin(middle >= 0, axis=1) + 1) % 3)
        turn = (lead[:, None] + np.arange(3)) % 3
        (a, b, c), (p, q, r) = np.take_along_axis(faces, turn, 1).T, np.take_along_axis(middle, turn, 1).T
        parts = [faces[marked == 0]]
        for count, cells in (
            (1, ((a, p, c), (p, b, c))),
            (2, ((p, b, q), (a, p, q), (a, q, c))),
            (3, ((a, p, r), (p, b, q), (r, q, c), (p, q, r))),
        ):
            parts += [np.stack(cell, axis=1)[marked == count] for cell in cells]
        faces = np.concatenate(parts)


def _collapse(nodes: Array, faces: Indices, size: float) -> tuple[Array, Indices]:
    """Collapse edges shorter than 0.8 of the size, where form and manifold allow it."""
    # In random order many collapses are independent of each other; the fixed seed makes meshes repeatable.
    order = np.random.default_rng(0)
    for _ in range(400):
        edges = _edges(faces)
        n = len(nodes)
        gone, kept = _collapsible(nodes, faces, edges, size)
        # The last few block each other for many passes; the next round takes them.
        if gone.size <= LEFT_OVER * len(edges.ends):
            break
        own = order.permutation(gone.size).astype(np.float64)
        first = _first_of(own, np.stack([gone, kept], axis=1), n)
        for _ring_out in range(2):
            rank = np.minimum(first[edges.ends[:, 0]], first[edges.ends[:, 1]])
            first = np.minimum(first, _first_of(rank, edges.ends, n))
        chosen = (first[gone] >= own) & (first[kept] >= own)
        target = np.arange(n)
        target[gone[chosen]] = kept[chosen]
        faces = target[faces]
        faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    used, flat = np.unique(faces, return_inverse=True)
    return nodes[used], flat.reshape(-1, 3)


def _collapsible(nodes: Array, faces: Indices, edges: _Edges, size: float) -> tuple[Indices, Indices]:
    """Pairs (gone, kept) of nodes whose collapse keeps form, edge length and manifold, each judged by itself."""
    sharp, kind = _sharpness(nodes, faces, edges)
    short = np.linalg.norm(nodes[edges.ends[:, 1]] - nodes[edges.ends[:, 0]], axis=1) < SHORT * size
    ends, along = edges.ends[short], sharp[short]
    swap = kind[ends[:, 0]] > kind[ends[:, 1]]
    gone, kept = np.where(swap, ends[:, 1], ends[:, 0]), np.where(swap, ends[:, 0], ends[:, 1])
    # Nodes on a face may go anywhere, nodes of a sharp edge only along it, corners never.
    allowed = (kind[gone] == 0) | ((kind[gone] == 1) & along)
    gone, kept = gone[allowed], kept[allowed]
    n = len(nodes)
    both = np.concatenate([edges.ends, edges.ends[:, ::-1]])
    joined = sp.csr_array((np.ones(len(both)), tuple(both.T)), shape=(n, n))
    common = np.asarray(joined[gone].multiply(joined[kept]).sum(axis=1)).ravel()
    gone, kept = gone[common == 2], kept[common == 2]
    star = sp.csr_array((np.ones(faces.size), (faces.ravel(), np.repeat(np.arange(len(faces)), 3))), (n, len(faces)))
    around = star[gone]
    pair, face = np.repeat(np.arange(gone.size), np.diff(around.indptr)), around.indices
    old = faces[face]
    apart = (old != kept[pair][:, None]).all(axis=1)
    pair, old = pair[apart], old[apart]
    new = np.where(old == gone[pair][:, None], kept[pair][:, None], old)
    corners = nodes[new]
    length = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    normal = _normals(nodes, new)
    level = np.einsum("ij,ij->i", _unit(normal), _unit(_normals(nodes, old)))
    thin = np.linalg.norm(normal, axis=1) < 0.05 * length**2
    bad = np.bincount(pair, (length > LONG * size) | (level < SHARP) | thin, minlength=gone.size) > 0
    return gone[~bad], kept[~bad]


def _flip(nodes: Array, faces: Indices) -> Indices:
    """Turn edges within their two faces until the mesh is Delaunay, but for sharp edges."""
    order = np.random.default_rng(0)
    for _ in range(60):
        edges = _edges(faces)
        n = len(nodes)
        sharp, _ = _sharpness(nodes, faces, edges)
        (a, b), (c, d) = edges.ends.T, edges.opposite.T
        angle = _triangles.angles(nodes[faces])
        corner = [
            angle[f, np.argmax(faces[f] == o[:, None], axis=1)] for f, o in zip(edges.faces.T, (c, d), strict=True)
        ]
        taken = np.isin(np.minimum(c, d) * n + np.maximum(c, d), edges.ends.min(axis=1) * n + edges.ends.max(axis=1))
        bad = np.flatnonzero((corner[0] + corner[1] > np.pi + 1e-6) & ~sharp & ~taken)
        one, two = np.stack([a, d, c], axis=1)[bad], np.stack([d, b, c], axis=1)[bad]
        before = _normals(nodes, faces[edges.faces[bad, 0]]) + _normals(nodes, faces[edges.faces[bad, 1]])
        fine = np.ones(len(bad), dtype=bool)
        for new in (one, two):
            fine &= np.einsum("ij,ij->i", _unit(_normals(nodes, new)), _unit(before)) > SHARP
        bad, one, two = bad[fine], one[fine], two[fine]
        if not bad.size:
            break
        rank = order.permutation(bad.size).astype(np.float64)
        four = np.stack([a, b, c, d], axis=1)[bad]
        first = _first_of(rank, four, n)
        chosen = (first[four] >= rank[:, None]).all(axis=1)
        faces = faces.copy()
        faces[edges.faces[bad[chosen], 0]], faces[edges.faces[bad[chosen], 1]] = one[chosen], two[chosen]
    return faces


def _smooth(nodes: Array, faces: Indices, target: _Surface) -> Array:
    """Move nodes towards their neighbours' middle and back on the surface; corners stay."""
    edges = _edges(faces)
    sharp, kind = _sharpness(nodes, faces, edges)
    n = len(nodes)
    # A node of a sharp edge has its two neighbours along it only.
    heard = np.concatenate([edges.ends, edges.ends[:, ::-1]])
    heard = heard[(kind[heard[:, 0]] == 0) | np.tile(sharp, 2)]
    count = np.bincount(heard[:, 0], minlength=n)
    middle = np.stack([np.bincount(heard[:, 0], nodes[heard[:, 1], i], minlength=n) for i in range(3)], axis=1)
    move = 0.7 * (middle / np.maximum(count, 1)[:, None] - nodes)
    move[kind == 2] = 0.0
    moved = nodes + move
    moved[kind == 0] = target.nearest(moved[kind == 0])
    moved[kind == 1] = target.nearest_sharp(moved[kind == 1])
    before = _unit(_normals(nodes, faces))
    for _ in range(4):
        turned = np.einsum("ij,ij->i", _unit(_normals(moved, faces)), before) < SHARP
        moved[np.unique(faces[turned])] = nodes[np.unique(faces[turned])]
    return moved


class _Surface:
    """The surface to stay on, cut into small triangles so that the nearest centres tell the nearest triangle."""

    def __init__(self, nodes: Array, faces: Indices, size: float) -> None:
        edges = _edges(faces)
        sharp, _ = _sharpness(nodes, faces, edges)
        self._segments = nodes[edges.ends[sharp]]
        fine, cells = _split(nodes, faces, size)
        self._triangles = fine[cells]
        self._tree = KDTree(self._triangles.mean(axis=1))
        self._size = size

    def nearest(self, points: Array) -> Array:
        """Nearest point on the surface (p, 3)."""
        count = min(12, len(self._triangles))
        near = self._tree.query(points, k=count)[1]
        on = _triangles.closest_point(self._triangles[near].reshape(-1, 3, 3), np.repeat(points, count, axis=0))
        return _nearest_of(points, np.asarray(on).reshape(-1, count, 3))

    def nearest_sharp(self, points: Array) -> Array:
        """Nearest point on the sharp edges, on the surface where none is near."""
        if not len(self._segments) or not len(points):
            return self.nearest(points) if len(points) else points
        start, way = self._segments[:, 0], self._segments[:, 1] - self._segments[:, 0]
        found = np.empty_like(points)
        for i in range(0, len(points), 256):  # keeps the table of points and segments small
            p = points[i : i + 256, None]
            share = np.clip(((p - start) * way).sum(axis=2) / (way**2).sum(axis=1), 0.0, 1.0)
            found[i : i + 256] = _nearest_of(p[:, 0], start + share[..., None] * way)
        far = np.linalg.norm(found - points, axis=1) > 0.5 * self._size
        found[far] = self.nearest(points[far])
        return found


def _nearest_of(points: Array, candidates: Array) -> Array:
    """The candidate (p, k, 3) nearest to each point (p, 3)."""
    best = np.argmin(((candidates - points[:, None]) ** 2).sum(axis=2), axis=1)
    return np.asarray(candidates[np.arange(len(points)), best])
