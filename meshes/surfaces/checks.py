"""A user's surface repaired and judged, before anything is meshed on it.

Surfaces here are arrays: corners (n, 3) and faces (m, 3), the outward sense of a face by its right hand.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import KDTree

from meshes.shell_mesh import connected, sides, used_only
from robots import InputError
from robots.arrays import Array, Bools, Integers

# Has no type hints.
_triangles: Any = trimesh.triangles


class SurfaceFault(InputError):  # noqa: N818 - a fault of the surface
    """A surface that is no clean closed skin; wrapping may mend it."""


# Corners nearer than this share of the diagonal are one; a 32 bit STL resolves 1e-7 of its extents.
SAME_POINT = 1e-6
# A face lower than this share of its longest edge has no normal worth the name.
FLAT_FACE = 1e-6
# Bodies with less than this share of the largest one's volume are hollows, or specks of no account.
HOLLOW = 1e-6
# A second body with more than this share of the largest one's area is not an accessory.
SECOND_BODY = 0.2


def census(nodes: Array, faces: Integers) -> tuple[int, int]:
    """Bodies of a surface, and its edges with one face only, once corners at the same place are merged."""
    nodes, faces, _ = _merged(nodes, faces)
    if not len(faces):
        return 0, 0
    return int(np.unique(connected(len(nodes), sides(faces))[faces[:, 0]]).size), len(_open_edges(faces))


def repair_surface(name: str, nodes: Array, faces: Integers, hole: float) -> tuple[Array, Integers, list[str]]:
    """One closed body, facing outward: merge, drop, keep the largest body, fill holes up to ``hole`` m around.

    Raises
    ------
    SurfaceFault
        Degenerate triangles that cannot be dropped, two bodies, an open surface, edges with three faces or more,
        a surface without an inside.
    """
    nodes, faces, notes = _merged(nodes, faces)
    faces, dropped = _without_flat(name, nodes, faces)
    faces, more = _largest_body(name, nodes, faces)
    mesh = trimesh.Trimesh(nodes, faces, process=False)
    if (np.unique(np.sort(mesh.edges, axis=1), axis=0, return_counts=True)[1] > 2).any():
        raise SurfaceFault(
            f"surface {name}: edges with more than two faces",
            code="L003",
            remedy="remove inner walls and touching parts, or let the import wrap it",
        )
    faces, turned = _wound(name, faces)
    nodes, faces, filled = _fill_holes(name, nodes, faces, hole)
    mesh = trimesh.Trimesh(nodes, faces, process=False)
    if mesh.volume < 0.0:
        faces = faces[:, ::-1].copy()
        more.append("all faces turned: their normals pointed inward")
    elif turned:
        more.append(f"{turned} faces turned to agree with their neighbours")
    return *used_only(nodes, faces), [*notes, *dropped, *more, *filled]


def material_surface(name: str, nodes: Array, faces: Integers) -> tuple[Array, Integers, list[str]]:
    """One body of material, closed and facing outward, its hollows facing inward: corners merged, slivers dropped.

    Raises
    ------
    SurfaceFault
        An open surface, edges with three faces or more, a surface with one side only, several bodies.
    """
    nodes, faces, notes = _merged(nodes, faces)
    faces, dropped = _without_flat(name, nodes, faces)
    edges, count = np.unique(np.sort(sides(faces), axis=1), axis=0, return_counts=True)
    for wrong, what in (
        (count > 2, "with more than two faces: it is not manifold"),
        (count < 2, "with one face: it is open"),
    ):
        if wrong.any():
            place = np.round(nodes[edges[wrong][0]].mean(axis=0), 4).tolist()
            raise SurfaceFault(
                f"surface {name} as a solid: {int(wrong.sum())} edges {what}",
                code="L003",
                value=f"the first near {place} m",
                allowed="two faces at every edge",
                remedy="export the solid as one closed body, or as STEP",
            )
    faces, turned = _wound(name, faces)
    body = np.unique(connected(len(nodes), sides(faces))[faces[:, 0]], return_inverse=True)[1]
    corners = nodes[faces]
    volume = np.bincount(body, np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0)
    if volume.sum() < 0.0:
        faces, volume = faces[:, ::-1].copy(), -volume
        notes.append("all faces turned: their normals pointed inward")
    solid = volume > HOLLOW * volume.max()
    if solid.sum() > 1:
        raise SurfaceFault(
            f"surface {name} as a solid: separate bodies",
            code="L003",
            value=f"{int(solid.sum())}, of {', '.join(f'{1e6 * v:.4g}' for v in volume[solid])} cm3",
            allowed="one",
            remedy="unite the bodies that are cast or welded together, or export the link's structure alone",
        )
    notes += dropped
    notes += [f"{turned} faces turned to agree with their neighbours"] if turned else []
    notes += [f"{len(volume) - 1} hollow(s) inside"] if len(volume) > 1 else []
    return *used_only(nodes, faces), notes


def mean_wall(nodes: Array, faces: Integers) -> tuple[float, float]:
    """Twice volume over area (m), and its share of the least extent along the surface's principal axes.

    Where a closed surface is that of both sides of a wall, it is the wall. NaN where the surface encloses nothing.
    """
    corners = nodes[faces]
    area = float(_triangles.area(corners).sum())
    volume = float(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum()) / 6.0
    used = nodes[np.unique(faces)]
    axes = np.linalg.svd(used - used.mean(axis=0), full_matrices=False)[2]
    extent = float(np.ptp(used @ axes.T, axis=0).min())
    wall = 2.0 * abs(volume) / area
    return (wall, wall / extent) if volume and extent else (float("nan"), float("nan"))


def _merged(nodes: Array, faces: Integers) -> tuple[Array, Integers, list[str]]:
    """Merge corners at the same place, then drop faces with repeated corners and doubled faces."""
    step = SAME_POINT * max(float(np.linalg.norm(np.ptp(nodes, axis=0))), np.finfo(float).tiny)
    # Not rounding to a grid: that would part two corners on both sides of a grid line.
    pairs = KDTree(nodes).query_pairs(step, output_type="ndarray")
    label = connected(len(nodes), pairs)
    first = np.unique(label, return_index=True)[1]
    merged = label[faces]
    point = (merged == np.roll(merged, 1, axis=1)).any(axis=1)
    kept = merged[~point]
    _, single = np.unique(np.sort(kept, axis=1), axis=0, return_index=True)
    lost = len(nodes) - len(first)
    notes = [f"{lost} corners merged with others at the same place"] if lost else []
    if point.any():
        notes.append(f"{int(point.sum())} degenerate triangles with repeated corners dropped")
    if single.size < len(kept):
        notes.append(f"{len(kept) - single.size} doubled triangles dropped")
    return nodes[first], kept[np.sort(single)], notes


def _without_flat(name: str, nodes: Array, faces: Integers) -> tuple[Integers, list[str]]:
    """Drop triangles without area, where no neighbour needs them."""
    corners = nodes[faces]
    edge = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    twice_area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    flat = twice_area <= FLAT_FACE * edge**2
    if not flat.any():
        return faces, []
    if flat.all() or len(_open_edges(faces[~flat])) > len(_open_edges(faces)):
        raise SurfaceFault(
            f"surface {name}: {int(flat.sum())} degenerate triangles (three corners on a line)",
            code="L003",
            value=f"the first has corners {np.round(corners[flat][0], 6).tolist()} m",
            allowed="triangles with area, unless the surface stays closed without them",
            remedy="remesh the surface in the program it came from",
        )
    return faces[~flat], [f"{int(flat.sum())} degenerate triangles without area dropped"]


def _largest_body(name: str, nodes: Array, faces: Integers) -> tuple[Integers, list[str]]:
    """Faces of the body with the largest area."""
    body = connected(len(nodes), sides(faces))[faces[:, 0]]
    area = np.bincount(body, _triangles.area(nodes[faces]))
    order = np.argsort(-area)
    order = order[area[order] > 0.0]
    if order.size == 1:
        return faces, []
    share = float(area[order[1]] / area[order[0]])
    if share > SECOND_BODY:
        raise SurfaceFault(
            f"surface {name}: {order.size} separate bodies, areas of the two largest 1 : {share:.2f}",
            code="L003",
            allowed=f"one body, others below {SECOND_BODY:g} of its area",
            remedy="export the casing's outer skin alone, or unite the parts",
        )
    lost = 100 * float(area[order[1:]].sum() / area.sum())
    return faces[body == order[0]], [f"{order.size - 1} smaller bodies dropped, {lost:.1f} % of the area"]


def _wound(name: str, faces: Integers) -> tuple[Integers, int]:
    """Turn faces until neighbours run along their common edge in opposite ways; how many were turned."""
    m = len(faces)
    half = sides(faces)
    order = np.lexsort(np.sort(half, axis=1).T)
    same = (np.sort(half[order[1:]], axis=1) == np.sort(half[order[:-1]], axis=1)).all(axis=1)
    one, two = order[:-1][same], order[1:][same]
    against = half[one, 0] == half[two, 0]
    one, two = one // 3, two // 3
    # Each face stands twice, as it is (f) and turned (f + m); agreeing neighbours are joined.
    agreeing = [[one, np.where(against, two + m, two)], [one + m, np.where(against, two, two + m)]]
    label = connected(2 * m, np.concatenate(agreeing, axis=1).T).reshape(2, m)
    if (label[0] == label[1]).any():
        raise SurfaceFault(f"surface {name} has one side only", code="L003", remedy="repair it in a CAD program")
    turned = label[0] > label[1]
    if turned.sum() > m / 2:
        turned = ~turned
    return np.where(turned[:, None], faces[:, ::-1], faces), int(turned.sum())


def _open_edges(faces: Integers) -> Integers:
    """Edges (e, 2) with one face only, in that face's sense."""
    edges = sides(faces)
    _, inverse, count = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    return np.asarray(edges[count[inverse.ravel()] == 1])


def _fill_holes(name: str, nodes: Array, faces: Integers, hole: float) -> tuple[Array, Integers, list[str]]:
    """Close holes up to ``hole`` m around with a fan about their middle; refuse larger ones."""
    edges = _open_edges(faces)
    if not len(edges):
        return nodes, faces, []
    n = len(nodes)
    loop = connected(n, edges)[edges[:, 0]]
    around = np.bincount(loop, np.linalg.norm(nodes[edges[:, 1]] - nodes[edges[:, 0]], axis=1))
    simple = np.unique(edges[:, 0]).size == len(edges) == np.unique(edges[:, 1]).size
    if around.max() > hole or not simple:
        middle = nodes[edges[loop == np.argmax(around)][:, 0]].mean(axis=0)
        raise SurfaceFault(
            f"surface {name} is open: {np.unique(loop).size} hole(s), the largest {around.max():.4g} m around "
            f"at {np.round(middle, 4).tolist()} m",
            code="L003",
            allowed=f"a closed surface, or plain holes up to {hole:.4g} m around, which are filled",
            remedy="close it in the program it came from, or let the import wrap it",
        )
    loops, place = np.unique(loop, return_inverse=True)
    middles = np.stack([nodes[edges[place == i][:, 0]].mean(axis=0) for i in range(loops.size)])
    fan = np.stack([edges[:, 1], edges[:, 0], n + place], axis=1)
    note = f"{loops.size} hole(s) filled, the largest {around.max():.4g} m around"
    return np.vstack([nodes, middles]), np.vstack([faces, fan]), [note]


def crossings(nodes: Array, faces: Integers) -> Integers:
    """Pairs (p, 2) of faces that cross, of a mesh with even element sizes; faces that share a corner do not count."""
    corners = nodes[faces]
    centre = corners.mean(axis=1)
    radius = float(np.linalg.norm(corners - centre[:, None], axis=2).max())
    pairs = KDTree(centre).query_pairs(2.0 * radius, output_type="ndarray")
    low, high = corners.min(axis=1), corners.max(axis=1)
    first, second = pairs.T
    near = ((low[first] <= high[second]) & (low[second] <= high[first])).all(axis=1)
    near &= ~(faces[first][:, :, None] == faces[second][:, None, :]).any(axis=(1, 2))
    pairs = pairs[near]
    hit = np.zeros(len(pairs), dtype=bool)
    for one, other in ((0, 1), (1, 0)):
        triangle = corners[pairs[:, other]]
        for i, j in pairwise((0, 1, 2, 0)):
            hit |= _pierces(corners[pairs[:, one], i], corners[pairs[:, one], j], triangle)
    return np.asarray(pairs[hit])


def _pierces(start: Array, end: Array, triangle: Array) -> Bools:
    """Whether segments (p, 3) pass through triangles (p, 3, 3); touching does not count."""

    def volume(a: Array, b: Array, c: Array, d: Array) -> Array:
        return np.asarray(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a))

    a, b, c = triangle[:, 0], triangle[:, 1], triangle[:, 2]
    # Below this the signs are round-off.
    least = 1e-9 * np.linalg.norm(end - start, axis=1) * np.linalg.norm(b - a, axis=1) * np.linalg.norm(c - a, axis=1)
    above, below = volume(a, b, c, start), volume(a, b, c, end)
    sides = np.stack([volume(start, end, a, b), volume(start, end, b, c), volume(start, end, c, a)])
    inside = (sides > least).all(axis=0) | (sides < -least).all(axis=0)
    return np.asarray((np.abs(above) > least) & (np.abs(below) > least) & (above * below < 0.0) & inside)
