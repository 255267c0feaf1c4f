"""Isotropic remeshing of a closed triangle surface, of Botsch and Kobbelt (2004).

Split long edges, collapse short ones, flip to Delaunay, smooth in the tangent plane, project back; each pass
works on an independent set of edges at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
import trimesh
from scipy.spatial import KDTree

from meshes.shell_mesh import sides, used_only
from robots.arrays import Array, Bools, Integers, in_blocks

# Has no type hints.
_triangles: Any = trimesh.triangles

# Edges between these shares of the target size stay (Botsch and Kobbelt).
SHORT, LONG = 0.8, 4.0 / 3.0
# Faces that meet at more than this form an edge of the part, which remeshing keeps; no step turns a face further.
SHARP_DEG = 40.0
# How far a step may turn a face where no edges are kept.
FOLD_DEG = 75.0
NEVER = -2.0  # no cosine is less
# Below this share of the size an edge goes, even one of a corner: no element could hold such a detail.
TINY = 0.4
# Height over longest edge, below which the normal of a face says nothing.
SLIVER = 0.2
# Of small triangles, the one nearest to a point is among so many whose middles are nearest.
CANDIDATES = 12
ROUNDS = 6
LEFT_OVER = 0.002


@dataclass(frozen=True)
class _Limits:
    """Element size (m), and cosines: of the angle that makes an edge sharp, and of the most that a face turns.

    ``lenient``: no edge is sharp near a sliver.
    """

    size: float
    sharp: float
    fold: float
    lenient: bool = False


def remesh(
    nodes: Array, faces: Integers, size: float, keep_edges: bool = True, start: tuple[Array, Integers] | None = None
) -> tuple[Array, Integers]:
    """Even triangles of edge ``size`` m on a closed manifold surface.

    ``keep_edges``: edges sharper than 40 deg stay where they are. Without, they are rounded by up to an element,
    and the elements are better: for surfaces whose edges mean nothing, as those of contours and wraps. ``start``:
    a coarser mesh of the same surface to begin with, which saves time.
    """
    limits = _limits(size, keep_edges)
    target = surface_to_stay_on(nodes, faces, size, keep_edges)
    nodes, faces = (nodes, faces) if start is None else start
    for _ in range(ROUNDS):
        nodes, faces = _split(nodes, faces, LONG * size)
        nodes, faces = _collapse(nodes, faces, limits)
        faces = _flip(nodes, faces, limits)
        nodes = _smooth(nodes, faces, target, limits)
    return _without_slivers(nodes, faces, target, limits)


def _limits(size: float, keep_edges: bool) -> _Limits:
    sharp, fold = float(np.cos(np.deg2rad(SHARP_DEG))), float(np.cos(np.deg2rad(FOLD_DEG)))
    return _Limits(size, sharp, sharp) if keep_edges else _Limits(size, NEVER, fold)


def surface_to_stay_on(nodes: Array, faces: Integers, size: float, keep_edges: bool = True) -> NearestOn:
    """A closed manifold surface, (n, 3) m and (m, 3), as a place that points are put back to."""
    edges = _edges(faces)
    fine, cells = _split(nodes, faces, size)
    sharp = _sharpness(nodes, faces, edges, _limits(size, keep_edges))[0]
    return NearestOn(fine[cells], nodes[edges.ends[sharp]], size)


def _without_slivers(nodes: Array, faces: Integers, target: NearestOn, limits: _Limits) -> tuple[Array, Integers]:
    """Give up sharp edges where they force slivers; and nodes that the way back to such edges brought together."""
    limits = replace(limits, fold=min(limits.fold, float(np.cos(np.deg2rad(FOLD_DEG)))), lenient=True)
    for _ in range(ROUNDS):
        nodes, faces = _collapse(nodes, faces, limits, TINY)
        faces = _flip(nodes, faces, limits)
        if not _slivers(nodes, faces, normals(nodes, faces)).any():
            break
        nodes, faces = _collapse(nodes, faces, limits)
        faces = _flip(nodes, faces, limits)
        nodes = _smooth(nodes, faces, target, limits)
    return nodes, faces


def sharp_density(nodes: Array, faces: Integers) -> float:
    """Length of a closed surface's edges sharper than 40 deg over its area, 1/m."""
    edges = _edges(faces)
    sharp = float(np.cos(np.deg2rad(SHARP_DEG)))
    ends = nodes[edges.ends[_sharpness(nodes, faces, edges, _Limits(0.0, sharp, sharp))[0]]]
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() / _triangles.area(nodes[faces]).sum())


@dataclass(frozen=True)
class _Edges:
    """Edges of a closed manifold: ends (e, 2) in the first face's sense, both faces (e, 2), corners opposite (e, 2)."""

    ends: Integers
    faces: Integers
    opposite: Integers
    sides: Integers  # (m, 3): edge from corner i to corner i + 1 of each face


def _edges(faces: Integers) -> _Edges:
    half = sides(faces)
    pairs = np.argsort(half.min(axis=1) * (faces.max() + 1) + half.max(axis=1), kind="stable").reshape(-1, 2)
    number = np.empty(len(half), dtype=np.int64)
    number[pairs] = np.arange(len(pairs))[:, None]
    return _Edges(half[pairs[:, 0]], pairs // 3, faces[pairs // 3, (pairs + 2) % 3], number.reshape(-1, 3))


def normals(nodes: Array, faces: Integers) -> Array:
    """Normals (m, 3) as long as twice the area."""
    a, b, c = (nodes[faces[:, i]] for i in range(3))
    return np.asarray(np.cross(b - a, c - a))


def _slivers(nodes: Array, faces: Integers, normal: Array) -> Bools:
    """Faces (m,) so flat that their normal says nothing of the surface; ``normal`` (m, 3) as from normals()."""
    return np.asarray(_length(normal) <= SLIVER * _longest(nodes, faces) ** 2)


def _length(vectors: Array) -> Array:
    """Length (m,) of vectors (m, 3); several times as fast as a norm along so short an axis."""
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)))


def _longest(nodes: Array, faces: Integers) -> Array:
    """Longest edge (m,) of each face."""
    a, b, c = (nodes[faces[:, i]] for i in range(3))
    return np.asarray(np.maximum(np.maximum(_length(b - a), _length(c - b)), _length(a - c)))


def unit(vectors: Array) -> Array:
    """Vectors (m, 3) of length one."""
    return np.asarray(vectors / np.maximum(_length(vectors), 1e-300)[:, None])


def _sharpness(nodes: Array, faces: Integers, edges: _Edges, limits: _Limits) -> tuple[Bools, Integers]:
    """Which edges (e,) are sharp, and the nodes' kind (n,): 0 on a face, 1 along a sharp edge, 2 a corner."""
    normal = unit(normals(nodes, faces))
    sharp = np.einsum("ij,ij->i", normal[edges.faces[:, 0]], normal[edges.faces[:, 1]]) < limits.sharp
    if limits.lenient:
        near = np.zeros(len(nodes), dtype=bool)
        near[faces[_slivers(nodes, faces, normals(nodes, faces))]] = True
        for _ in range(2):
            near[faces[near[faces].any(axis=1)]] = True
        sharp &= ~near[edges.ends].any(axis=1)
    ends = edges.ends[sharp]
    way = unit(nodes[ends[:, 1]] - nodes[ends[:, 0]])
    turn = np.zeros((len(nodes), 3))
    np.add.at(turn, ends[:, 0], way)
    np.add.at(turn, ends[:, 1], -way)
    degree = np.bincount(ends.ravel(), minlength=len(nodes))
    # Two edges that go straight on cancel; |turn| = 2 sin(angle / 2).
    bent = np.linalg.norm(turn, axis=1) > np.sqrt(2.0 - 2.0 * limits.sharp)
    return sharp, np.where(degree == 0, 0, np.where((degree == 2) & ~bent, 1, 2))


def _first_of(rank: Array, groups: Integers, n: int) -> Array:
    """Smallest rank (n,) among the edges that touch each of n nodes."""
    first = np.full(n, np.inf)
    for column in groups.T:
        np.minimum.at(first, column, rank)
    return first


def _split(nodes: Array, faces: Integers, longest: float) -> tuple[Array, Integers]:
    """Halve edges longer than ``longest`` until there are none; neighbours stay joined."""
    while True:
        edges = _edges(faces)
        ends = nodes[edges.ends]
        long = _length(ends[:, 1] - ends[:, 0]) > longest
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


def _collapse(nodes: Array, faces: Integers, limits: _Limits, shortest: float = SHORT) -> tuple[Array, Integers]:
    """Collapse edges below ``shortest`` of the size, where form and manifold allow it."""
    # In random order many collapses are independent of each other; the fixed seed makes meshes repeatable.
    order = np.random.default_rng(0)
    for _ in range(400):
        edges = _edges(faces)
        n = len(nodes)
        gone, kept = _collapsible(nodes, faces, edges, limits, shortest)
        # The last few block each other for many passes; the next round takes them, if there is one.
        if gone.size <= (LEFT_OVER * len(edges.ends) if shortest == SHORT else 0):
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
        a, b, c = faces.T
        faces = faces[(a != b) & (b != c) & (c != a)]
    return used_only(nodes, faces)


def _collapsible(
    nodes: Array, faces: Integers, edges: _Edges, limits: _Limits, shortest: float
) -> tuple[Integers, Integers]:
    """Pairs (gone, kept) of nodes whose collapse keeps form, edge length and manifold, each judged by itself."""
    sharp, kind = _sharpness(nodes, faces, edges, limits)
    length = _length(nodes[edges.ends[:, 1]] - nodes[edges.ends[:, 0]])
    short = length < shortest * limits.size
    ends, along, tiny = edges.ends[short], sharp[short], length[short] < TINY * limits.size
    swap = kind[ends[:, 0]] > kind[ends[:, 1]]
    gone, kept = np.where(swap, ends[:, 1], ends[:, 0]), np.where(swap, ends[:, 0], ends[:, 1])
    # Nodes on a face may go anywhere, nodes of a sharp edge only along it, corners never.
    allowed = (kind[gone] == 0) | ((kind[gone] == 1) & along) | tiny
    gone, kept, tiny = gone[allowed], kept[allowed], tiny[allowed]
    n = len(nodes)
    both = np.concatenate([edges.ends, edges.ends[:, ::-1]])
    joined = sp.csr_array((np.ones(len(both)), tuple(both.T)), shape=(n, n))
    common = np.asarray(joined[gone].multiply(joined[kept]).sum(axis=1)).ravel()
    gone, kept, tiny = gone[common == 2], kept[common == 2], tiny[common == 2]
    star = sp.csr_array((np.ones(faces.size), (faces.ravel(), np.repeat(np.arange(len(faces)), 3))), (n, len(faces)))
    around = star[gone]
    pair, face = np.repeat(np.arange(gone.size), np.diff(around.indptr)), around.indices
    old = faces[face]
    end = kept[pair]
    apart = (old[:, 0] != end) & (old[:, 1] != end) & (old[:, 2] != end)
    pair, old, face, end = pair[apart], old[apart], face[apart], end[apart]
    new = np.where(old == gone[pair][:, None], end[:, None], old)
    length, normal, before = _longest(nodes, new), normals(nodes, new), normals(nodes, faces)
    level = np.einsum("ij,ij->i", unit(normal), unit(before)[face])
    poor = _slivers(nodes, faces, before)[face] & tiny[pair]
    level[poor] = 1.0
    # Slivers beside an edge that is all but nothing would keep it for ever.
    thin = (_length(normal) < 0.05 * length**2) & ~poor
    wrong = ((length > LONG * limits.size) & ~tiny[pair]) | (level < limits.fold) | thin
    bad = np.bincount(pair, wrong, minlength=gone.size) > 0
    return gone[~bad], kept[~bad]


def _flip(nodes: Array, faces: Integers, limits: _Limits) -> Integers:
    """Turn edges within their two faces until the mesh is Delaunay, but for sharp edges."""
    order = np.random.default_rng(0)
    for _ in range(60):
        edges = _edges(faces)
        n = len(nodes)
        sharp, _ = _sharpness(nodes, faces, edges, limits)
        (a, b), (c, d) = edges.ends.T, edges.opposite.T
        angle = _triangles.angles(nodes[faces])
        corner = [
            angle[f, np.argmax(faces[f] == o[:, None], axis=1)] for f, o in zip(edges.faces.T, (c, d), strict=True)
        ]
        taken = np.isin(np.minimum(c, d) * n + np.maximum(c, d), edges.ends.min(axis=1) * n + edges.ends.max(axis=1))
        bad = np.flatnonzero((corner[0] + corner[1] > np.pi + 1e-6) & ~sharp & ~taken)
        one, two = np.stack([a, d, c], axis=1)[bad], np.stack([d, b, c], axis=1)[bad]
        before = normals(nodes, faces[edges.faces[bad, 0]]) + normals(nodes, faces[edges.faces[bad, 1]])
        fine = np.ones(len(bad), dtype=bool)
        for new in (one, two):
            fine &= np.einsum("ij,ij->i", unit(normals(nodes, new)), unit(before)) > limits.fold
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


def _smooth(nodes: Array, faces: Integers, target: NearestOn, limits: _Limits) -> Array:
    """Move nodes towards their neighbours' middle and back on the surface; corners stay."""
    edges = _edges(faces)
    sharp, kind = _sharpness(nodes, faces, edges, limits)
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
    before = unit(normals(nodes, faces))
    for _ in range(4):
        turned = np.einsum("ij,ij->i", unit(normals(moved, faces)), before) < limits.fold
        moved[np.unique(faces[turned])] = nodes[np.unique(faces[turned])]
    return moved


class NearestOn:
    """A surface to stay on: triangles (m, 3, 3) no larger than ``size`` m, and its sharp edges (s, 2, 3)."""

    def __init__(self, triangles: Array, edges: Array, size: float) -> None:
        self._triangles, self._segments, self._size = triangles, edges, size
        self._tree = KDTree(triangles.mean(axis=1))

    def nearest(self, points: Array) -> Array:
        """Nearest point on the surface (p, 3)."""
        count = min(CANDIDATES, len(self._triangles))
        near = self._tree.query(points, k=count)[1]
        on = _triangles.closest_point(self._triangles[near].reshape(-1, 3, 3), np.repeat(points, count, axis=0))
        return _nearest_of(points, np.asarray(on).reshape(-1, count, 3))

    def nearest_sharp(self, points: Array) -> Array:
        """Nearest point on the sharp edges, on the surface where none is near."""
        if not len(self._segments) or not len(points):
            return self.nearest(points) if len(points) else points
        start, way = self._segments[:, 0], self._segments[:, 1] - self._segments[:, 0]
        # Contours have edges of no length, where they pass through a grid point.
        squared = np.maximum((way**2).sum(axis=1), 1e-300)
        found = np.empty_like(points)
        for some in in_blocks(len(points), 256):  # keeps the table of points and segments small
            p = points[some, None]
            share = np.clip(((p - start) * way).sum(axis=2) / squared, 0.0, 1.0)
            found[some] = _nearest_of(p[:, 0], start + share[..., None] * way)
        far = np.linalg.norm(found - points, axis=1) > 0.5 * self._size
        found[far] = self.nearest(points[far])
        return found


def _nearest_of(points: Array, candidates: Array) -> Array:
    """The candidate (p, k, 3) nearest to each point (p, 3)."""
    best = np.argmin(((candidates - points[:, None]) ** 2).sum(axis=2), axis=1)
    return np.asarray(candidates[np.arange(len(points)), best])
