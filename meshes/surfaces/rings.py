"""Which nodes of a casing are its interfaces: rings, discs about a joint's axis, or balls."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from meshes.shell_mesh import connected, sides
from meshes.surfaces.remesh import normals, unit
from robots import InputError
from robots.arrays import Array, Integers

LEAST_RING = 6
# Interfaces reach no further than this share of the way to the next one.
SHARE_OF_WAY = 0.45
SHRINK, MOST_SHRINKS = 0.75, 8
# A seat faces along the axis within 60 deg, is this many elements deep, and stands in 5 of 8 sectors around it.
FACING, DEPTH, SECTORS, SECTORS_HELD = 0.5, 1.5, 8, 5
# Its reach is measured in so many sectors for each of these.
FINE = 3
# Of the angle between an axis and the way to the next interface: above, the axis is along the arm.
ALONG = 0.7
# Seats as near to the neighbour as the best one, to an element, and not much smaller, are held with it.
LEAST_SHARE = 0.2


@dataclass(frozen=True)
class Interface:
    """Where a link is held.

    ``point`` (3,) m, that the interface's motion is referred to. ``axis`` (3,): of the joint there. ``facing``
    (p, 3) m: points on the neighbour's surface. ``radius`` m: of the disc about the axis, or without one of the
    ball around the point. ``whole``: the disc has no limit, as that of a foot bolted to the floor.
    """

    point: Array
    axis: Array | None = None
    facing: Array | None = None
    radius: float | None = None
    whole: bool = False


@dataclass(frozen=True)
class Ring:
    """Nodes of an interface, how far they reach (m) from the axis or the point, and how they were chosen."""

    nodes: Integers
    radius: float
    words: str


def choose_rings(
    interfaces: Mapping[str, Interface], nodes: Array, faces: Integers, size: float, link: str = ""
) -> tuple[dict[str, Ring], list[str]]:
    """Nodes of each interface on a surface (n, 3), (m, 3) with elements of ``size`` m; notes of what was shrunk.

    ``link``: for messages.

    With an axis: the *seats* around it, flat places at right angles to it, on five eighths of its turn at least;
    of these the nearest to the neighbour's surface, as far as it follows that surface, or without a neighbour the
    nearest to the point. Two on both sides of a fork are both taken. An axis along the way to the next interface
    has the whole seat: the end of the arm. One across it, on the side of an arm, has a disc with the lower quartile
    of the seat's reach all round as its radius, which keeps within the arm's width. Rings that meet are
    kept within 45 % of the way between them, or less. Where no seat is, and the point is near the surface: a ball
    around it. Without an axis: all nodes within ``radius``, or else the band of nodes within half an element of the
    plane through the point at right angles to the way to the other points.

    Raises
    ------
    InputError
        No ring at an interface, or rings that share nodes however small they are.
    """
    normal = np.zeros((len(nodes), 3))
    np.add.at(normal, faces, normals(nodes, faces)[:, None] / 6.0)
    skin = _Skin(nodes, faces, normal, size, f" of link {link}" if link else "")
    notes: list[str] = []
    for share in (1.0, *(SHARE_OF_WAY * SHRINK**i for i in range(MOST_SHRINKS))):
        rings = {name: _ring(name, interfaces, skin, share) for name in interfaces}
        common = _sharing(rings)
        free = [name for name in common if interfaces[name].axis is not None and interfaces[name].radius is None]
        if not common or not free:
            break
        notes = [f"rings of {' and '.join(common)} met: their radii were cut, see below"]
    if common:
        raise InputError(
            f"interfaces {' and '.join(common)}{skin.of} share nodes", remedy="give smaller interface_radius for both"
        )
    return rings, notes


@dataclass(frozen=True)
class _Skin:
    """A surface with its nodes' normals, as long as the area each stands for (m^2), and its element size.

    ``of``: whose it is, for messages.
    """

    nodes: Array
    faces: Integers
    normal: Array
    size: float
    of: str = ""


def _sharing(rings: Mapping[str, Ring]) -> list[str]:
    """Names of the first two rings with a node in common."""
    names = list(rings)
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            if np.intersect1d(rings[one].nodes, rings[other].nodes).size:
                return [one, other]
    return []


def _ring(name: str, interfaces: Mapping[str, Interface], skin: _Skin, share: float) -> Ring:
    here = interfaces[name]
    others = [other.point for key, other in interfaces.items() if key != name]
    ways = sorted((p - here.point for p in others), key=lambda way: float(np.linalg.norm(way)))
    limit = share * float(np.linalg.norm(ways[0])) if ways else np.inf
    distance = np.linalg.norm(skin.nodes - here.point, axis=1)
    if here.axis is not None:
        where = f"{1e3 * (here.radius or limit):.4g} mm of the joint's axis"
        found = _seat_ring(here, ways, skin, limit) or _ball_ring(
            distance, skin.size, min(share, SHARE_OF_WAY) / share * limit
        )
    elif here.radius is not None:
        where = f"a radius of {here.radius:.4g} m"
        found = Ring(np.flatnonzero(distance <= here.radius), here.radius, f"within {1e3 * here.radius:.4g} mm")
    else:
        where = "the plane through it"
        found = _band_ring(here.point, others, distance, skin)
    if found is None or found.nodes.size < LEAST_RING:
        count = 0 if found is None else found.nodes.size
        raise InputError(
            f"no ring found at interface {name}{skin.of}: {count} nodes around {np.round(here.point, 6).tolist()} m "
            f"within {where}",
            value=f"the nearest node is {distance.min():.4g} m away",
            allowed=f"{LEAST_RING} nodes or more",
            remedy="move the point onto the surface's end, or give its interface_radius",
        )
    return found


def _band_ring(point: Array, others: list[Array], distance: Array, skin: _Skin) -> Ring | None:
    """The band of nodes around the point on the plane at right angles to the way to the other points."""
    way = np.mean(others, axis=0) - point
    ring = np.flatnonzero(np.abs((skin.nodes - point) @ way) <= 0.5 * skin.size * np.linalg.norm(way))
    if not ring.size:
        return None
    pieces = _pieces(ring, skin.faces)
    ring = ring[pieces == pieces[np.argmin(distance[ring])]]
    middle = skin.nodes[ring].mean(axis=0)
    # Around the point, not beside it.
    if np.linalg.norm(point - middle) > np.linalg.norm(skin.nodes[ring] - middle, axis=1).max():
        return None
    return Ring(ring, float(distance[ring].max()), "band around the point")


def _pieces(ring: Integers, faces: Integers) -> Integers:
    """Which connected piece (r,) of the surface each node of a set belongs to."""
    place = np.full(int(faces.max()) + 1, -1)
    place[ring] = np.arange(ring.size)
    edges = place[sides(faces)]
    return connected(ring.size, edges[(edges >= 0).all(axis=1)])


def _ball_ring(distance: Array, size: float, limit: float) -> Ring | None:
    """The smallest ball around the point with twice the least number of nodes, within the limit."""
    if not np.isfinite(limit):
        return None
    radius = np.partition(distance, 2 * LEAST_RING - 1)[2 * LEAST_RING - 1] if distance.size > 2 * LEAST_RING else limit
    radius = max(float(radius), size)
    if radius > limit:
        return None
    words = f"ball of {1e3 * radius:.4g} mm around the point: no flat place around the joint's axis"
    return Ring(np.flatnonzero(distance <= radius), radius, words)


@dataclass(frozen=True)
class _Seat:
    """A flat place around an axis: its nodes, their area (m^2), its place along the axis and its gap (m)."""

    nodes: Integers
    area: float
    along: float
    gap: float


def _seat_ring(here: Interface, ways: list[Array], skin: _Skin, limit: float) -> Ring | None:
    """Seats around the joint's axis, the nearest to the neighbour, cut to the casing's width."""
    assert here.axis is not None  # noqa: S101 - asked only of those
    axis = here.axis / np.linalg.norm(here.axis)
    arm = skin.nodes - here.point
    along = arm @ axis
    across = arm - along[:, None] * axis
    off = np.linalg.norm(across, axis=1)
    fine = _sectors(across, axis)
    sector = fine // FINE
    most = here.radius if here.radius is not None else np.inf if here.whole else limit
    tree = None if here.facing is None or not len(here.facing) else KDTree(here.facing)
    seats = []
    for side in (1.0, -1.0):
        facing = np.flatnonzero((off <= most) & (side * (unit(skin.normal) @ axis) >= FACING))
        for ring in _levels(facing, along, skin):
            gap = abs(float(np.median(along[ring])))
            if tree is not None:
                apart = tree.query(skin.nodes[ring])[0]
                gap = float(np.quantile(apart, 0.25))
                follows = ring[apart <= gap + DEPTH * skin.size]
                ring = follows if np.unique(sector[follows]).size >= SECTORS_HELD else ring
            if np.unique(sector[ring]).size >= SECTORS_HELD:
                area = float(np.linalg.norm(skin.normal[ring], axis=1).sum())
                seats.append(_Seat(ring, area, float(np.median(along[ring])), gap))
    if not seats:
        return None
    best = min(seat.gap for seat in seats)
    near = [seat for seat in seats if seat.gap <= best + skin.size]
    held = [seat for seat in near if seat.area >= LEAST_SHARE * max(s.area for s in near)]
    ring = np.unique(np.concatenate([seat.nodes for seat in held]))
    # The rim belongs to it whichever way its nodes face: walls that start beside the ring would hang on its edge.
    beside = np.unique(skin.faces[np.isin(skin.faces, ring).any(axis=1)])
    level = np.min([np.abs(along[beside] - seat.along) for seat in held], axis=0) <= 0.5 * skin.size
    ring = np.union1d(ring, beside[level & (off[beside] <= most)])
    across_arm = bool(ways) and abs(float(ways[0] @ axis)) < ALONG * float(np.linalg.norm(ways[0]))
    if across_arm and here.radius is None and not here.whole:
        ring = _disc(ring, off, fine, skin.size)
    radius = float(off[ring].max())
    places = " and ".join(f"{1e3 * seat.along:+.4g}" for seat in held)
    near_words = "" if tree is None else f", {1e3 * best:.3g} mm from its neighbour"
    return Ring(ring, radius, f"disc of {1e3 * radius:.4g} mm about the joint's axis at {places} mm{near_words}")


def _sectors(across: Array, axis: Array) -> Integers:
    """Fine sector (n,) of the full turn that each arm (n, 3) at right angles to the axis points into."""
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    angle = np.arctan2(across @ np.cross(axis, first), across @ first)
    count = SECTORS * FINE
    return np.asarray(np.floor(angle / (2.0 * np.pi) * count).astype(np.int64) % count)


def _levels(facing: Integers, along: Array, skin: _Skin) -> list[Integers]:
    """Sets of nodes that lie within a few elements along the axis, the largest areas first."""
    levels: list[Integers] = []
    weight = np.linalg.norm(skin.normal, axis=1)
    first = 0.0
    while facing.size >= LEAST_RING:
        order = facing[np.argsort(along[facing], kind="stable")]
        place = along[order]
        total = np.concatenate([[0.0], np.cumsum(weight[order])])
        end = np.searchsorted(place, place + DEPTH * skin.size, side="right")
        area = total[end] - total[:-1]
        start = int(np.argmax(area))
        first = max(first, float(area[start]))
        if area[start] < 0.05 * first:
            break
        level = order[start : end[start]]
        if level.size >= LEAST_RING:
            levels.append(level)
        facing = np.setdiff1d(facing, level)
    return levels


def _disc(ring: Integers, off: Array, sector: Integers, size: float) -> Integers:
    """Cut a seat to the lower quartile of its reach around the axis."""
    reach = [off[ring[sector[ring] == k]].max(initial=0.0) for k in range(SECTORS * FINE)]
    radius = float(np.quantile([r for r in reach if r > 0.0], 0.25))
    # Half an element more, so that the rim of a round boss is all in; on coarse meshes as far as a ring needs.
    least = np.sort(off[ring])[min(LEAST_RING, ring.size) - 1]
    return np.asarray(ring[off[ring] <= max(radius + 0.5 * size, float(least))])
