"""Seats: the flat or slanting places around a joint's axis on a casing, where its neighbour is bolted to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from meshes.shell_mesh import connected, sides
from meshes.surfaces.remesh import unit
from robots.arrays import Array, Bools, Integers

LEAST_RING = 6
# A seat faces along the axis within 60 deg, is this many elements deep, and stands in 5 of 8 sectors around it.
FACING, DEPTH, SECTORS, SECTORS_HELD = 0.5, 1.5, 8, 5
# Its reach is measured in so many sectors for each of these.
FINE = 3
# Of the angle between an axis and the way to the next interface: above, the axis is along the arm.
ALONG = 0.7
# Seats as near to the neighbour as the best one, to an element, and not much smaller, are held with it.
LEAST_SHARE = 0.2
# Of the neighbour around the axis, the share that lies beyond a seat, over that of the best one: a seat with less faces
# away from it. Both faces of a tongue in a fork have half of the fork beyond them.
LEAST_BEYOND = 0.4
# Hulls and castings slant away from each other by up to this much of the distance from the axis (15 deg).
SLANT = 0.27
# A seat fills at least this share of the disc it is held by, with so many nodes where it has them.
LEAST_FILL, LEAST_NODES = 0.25, 24
# A bearing's ring whose radius the neighbour gives also reaches down from the seat by this share of it.
DEEP = 0.25
# Of its radius: a flange is no thicker, its back leaves this much around the axis to the barrel, and its rim stands
# free in 7 of 8 sectors.
THICKEST, BARREL, RIM_SECTORS = 0.5, 0.3, 7


@dataclass(frozen=True)
class Skin:
    """A surface with its nodes' normals, as long as the area each stands for (m^2), and its element size.

    ``of``: whose it is, for messages.
    """

    nodes: Array
    faces: Integers
    normal: Array
    size: float
    of: str = ""


@dataclass(frozen=True)
class Seats:
    """Nodes held at an interface, their reach from the axis (m), the seats' places along it (m), and their gap (m).

    ``flange_m3``: volume of a flange that is held with all its body; 0 where there is none. ``gap``: None without a
    neighbour.
    """

    nodes: Integers
    radius: float
    places: tuple[float, ...]
    gap: float | None
    flange_m3: float


@dataclass(frozen=True)
class _Seat:
    """A place around an axis: nodes, area (m^2), reach (m), place along the axis, gap (m), and the way it faces.

    ``follows``: those of its nodes that the neighbour's surface is beside; all without a neighbour.
    ``beyond``: share of the neighbour around the axis that lies on the side it faces; 1 without a neighbour.
    """

    nodes: Integers
    follows: Integers
    area: float
    reach: float
    along: float
    gap: float
    normal: Array
    beyond: float

    @property
    def fill(self) -> float:
        """Share of the disc within its reach that it covers."""
        return self.area / (np.pi * max(self.reach, 1e-300) ** 2)


class _Around:
    """A skin as seen from a joint's axis: distances off it and along it, and sectors around it."""

    def __init__(self, skin: Skin, point: Array, axis: Array) -> None:
        self.skin, self.axis = skin, axis / np.linalg.norm(axis)
        self.arm = skin.nodes - point
        self.along = self.arm @ self.axis
        across = self.arm - self.along[:, None] * self.axis
        self.off = np.linalg.norm(across, axis=1)
        self.fine = _sectors(across, self.axis)
        self.out = unit(skin.normal)
        self.outward = unit(across)
        self.area = np.linalg.norm(skin.normal, axis=1)

    def held(self, nodes: Integers) -> int:
        """How many of the eight sectors some nodes stand in."""
        return int(np.unique(self.fine[nodes] // FINE).size)

    def reach(self, nodes: Integers) -> float:
        """Median over all directions in which there are nodes of how far they reach."""
        far = np.zeros(SECTORS * FINE)
        np.maximum.at(far, self.fine[nodes], self.off[nodes])
        return float(np.median(far[far > 0.0])) if (far > 0.0).any() else 0.0


class _Neighbour:
    """Points (p, 3) m of the neighbour's surface, from the same point of the axis."""

    def __init__(self, around: _Around, points: Array) -> None:
        self.points, self.axis = points, around.axis
        self.off = np.linalg.norm(points - (points @ around.axis)[:, None] * around.axis, axis=1)
        self._tree = KDTree(points)

    def gaps(self, arms: Array) -> Array:
        """How far some points (r, 3) are from it, m."""
        return np.asarray(self._tree.query(arms)[0])

    def beyond(self, normal: Array, place: float, reach: float) -> float:
        """Share of its points within ``reach`` of the axis that lie beyond a plane."""
        near = self.points[self.off <= reach]
        return float((near @ normal >= place).mean()) if len(near) else 0.0


def seats_around(
    skin: Skin,
    point: Array,
    axis: Array,
    most: float,
    facing: Array | None = None,
    given: bool = False,
    disc: bool = True,
    flange: bool = True,
) -> Seats | None:
    """Seats around the axis through a point, the nearest to the neighbour; None where there is none.

    Parameters
    ----------
    most : m, how far from the axis they may reach
    facing : (p, 3) m, points on the neighbour's surface; without, the seats nearest to the point
    given : whether ``most`` is the bearing's own radius: the ring then also takes what faces along the axis a little
        below the seat
    disc : cut to a disc with the median of the seat's reach all round; else the seat is held as far as the neighbour's
        surface is beside it
    flange : hold a thin flange by its whole body, with back face and rim
    """
    around = _Around(skin, point, axis)
    other = None if facing is None or not len(facing) else _Neighbour(around, facing - point)
    found = [
        seat
        for side in (1.0, -1.0)
        for level in _levels(around, side, most)
        if (seat := _seat(around, level, other)) is not None
    ]
    found = [seat for seat in found if seat.beyond >= LEAST_BEYOND * max(s.beyond for s in found)]
    found = [seat for seat in found if seat.fill >= LEAST_FILL] or found
    if not found:
        return None
    best = min(seat.gap for seat in found)
    near = [seat for seat in found if seat.gap <= best + skin.size]
    held = [seat for seat in near if seat.area >= LEAST_SHARE * max(s.area for s in near)]
    parts, volume = [], 0.0
    for seat in held:
        ring = _ring(around, seat, most, given, disc)
        parts.append(ring)
        if flange:
            body, own = _flange(around, seat, ring)
            parts.append(body)
            volume += own
    nodes = np.unique(np.concatenate(parts))
    places = tuple(seat.along for seat in held)
    return Seats(nodes, float(around.off[nodes].max()), places, None if other is None else best, volume)


def _sectors(across: Array, axis: Array) -> Integers:
    """Fine sector (n,) of the full turn that each arm (n, 3) at right angles to the axis points into."""
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    angle = np.arctan2(across @ np.cross(axis, first), across @ first)
    count = SECTORS * FINE
    return np.asarray(np.floor(angle / (2.0 * np.pi) * count).astype(np.int64) % count)


def _levels(around: _Around, side: float, most: float) -> list[tuple[Integers, Array]]:
    """Sets of nodes that lie within a few elements of a plane around the axis, largest areas first, and its normal.

    A plane may slant: a slice at right angles to the axis through a slanting face is a strip, whose normals say how
    the face lies.
    """
    skin = around.skin
    facing = np.flatnonzero((around.off <= most) & (side * (around.out @ around.axis) >= FACING))
    levels: list[tuple[Integers, Array]] = []
    first = 0.0
    while facing.size >= LEAST_RING:
        normal, level = side * around.axis, facing
        for _ in range(2):
            level = _slice(around, facing, normal)
            normal = unit(skin.normal[level].sum(axis=0)[None])[0]
        level = _slice(around, facing, normal, level)
        area = float(around.area[level].sum())
        first = max(first, area)
        if area < 0.05 * first:
            break
        if level.size >= LEAST_RING:
            levels.append((level, normal))
        facing = np.setdiff1d(facing, level)
    return levels


def _slice(around: _Around, facing: Integers, normal: Array, near: Integers | None = None) -> Integers:
    """Those of the nodes within the depth of a seat of one plane: with the largest area, or about some of them."""
    depth = DEPTH * around.skin.size
    place = around.arm[facing] @ normal
    if near is not None:
        middle = float(np.median(around.arm[near] @ normal))
        return np.asarray(facing[np.abs(place - middle) <= 0.5 * depth])
    order = np.argsort(place, kind="stable")
    place = place[order]
    total = np.concatenate([[0.0], np.cumsum(around.area[facing[order]])])
    end = np.searchsorted(place, place + depth, side="right")
    start = int(np.argmax(total[end] - total[:-1]))
    return np.asarray(facing[order[start : end[start]]])


def _seat(around: _Around, level: tuple[Integers, Array], other: _Neighbour | None) -> _Seat | None:
    nodes, normal = level
    gap = abs(float(np.median(around.along[nodes])))
    follows = nodes
    if other is not None:
        apart = other.gaps(around.arm[nodes])
        gap = float(np.quantile(apart, 0.25))
        follows = nodes[apart <= gap + DEPTH * around.skin.size + SLANT * around.off[nodes]]
        # A neighbour that is further off than the seat reaches does not show where it is bolted on.
        follows = follows if around.held(follows) >= SECTORS_HELD and gap <= around.reach(nodes) else nodes
    if around.held(follows) < SECTORS_HELD:
        return None
    reach = around.reach(follows)
    area = float(around.area[nodes[around.off[nodes] <= reach]].sum())
    place = float(np.median(around.arm[follows] @ normal))
    beyond = 1.0 if other is None else other.beyond(normal, place - around.skin.size, reach)
    return _Seat(nodes, follows, area, reach, float(np.median(around.along[follows])), gap, normal, beyond)


def _ring(around: _Around, seat: _Seat, most: float, given: bool, disc: bool) -> Integers:
    """Nodes of a seat that are held, with its rim whichever way that faces."""
    skin, off = around.skin, around.off
    ring = seat.nodes
    place = around.arm @ seat.normal
    middle = float(np.median(place[ring]))
    if given:
        facing = (around.out @ seat.normal >= FACING) & (off <= most)
        deep = max(0.5 * DEPTH * skin.size, DEEP * most)
        ring = np.union1d(ring, np.flatnonzero(facing & (place >= middle - deep) & (place <= middle + deep)))
        ring = _piece_of(ring, seat.nodes, skin)
    elif disc:
        # Half an element more, so that the rim of a round boss is all in; and as far as enough nodes need.
        least = np.sort(off[ring])[min(LEAST_NODES, ring.size) - 1]
        radius = max(seat.reach + 0.5 * skin.size, float(least))
        # The facets of a hull around the axis lie in planes of their own.
        facing = (around.out @ seat.normal >= FACING) & (off <= min(radius, most))
        facets = facing & (np.abs(place - middle) <= 0.5 * DEPTH * skin.size + SLANT * off)
        ring = _piece_of(np.union1d(ring[off[ring] <= radius], np.flatnonzero(facets)), ring, skin)
    else:
        # The end of an arm as far as its neighbour goes: a foot's upper side is wider than what stands on it.
        ring = seat.follows
    # Walls that start beside the ring would else hang on its edge.
    beside = np.unique(skin.faces[np.isin(skin.faces, ring).any(axis=1)])
    limit = off[ring].max() + 0.25 * skin.size
    level = (np.abs(place[beside] - middle) <= 0.5 * skin.size) & (off[beside] <= min(most, limit))
    return np.union1d(ring, beside[level])


def _piece_of(nodes: Integers, known: Integers, skin: Skin) -> Integers:
    """Those of the nodes that hang together with known ones over the surface."""
    place = np.full(len(skin.nodes), -1)
    place[nodes] = np.arange(nodes.size)
    edges = place[sides(skin.faces)]
    piece = connected(nodes.size, edges[(edges >= 0).all(axis=1)])
    own = place[known]
    return np.asarray(nodes[np.isin(piece, piece[own[own >= 0]])])


def _flange(around: _Around, seat: _Seat, ring: Integers) -> tuple[Integers, float]:
    """All nodes of a thin flange behind a seat, and its volume (m^3); none where the casing is as wide as the seat."""
    none = np.zeros(0, dtype=np.int64), 0.0
    skin, off = around.skin, around.off
    radius = float(off[ring].max())
    inward = np.median(around.arm[ring] @ seat.normal) - around.arm @ seat.normal
    body = (inward >= -0.5 * DEPTH * skin.size) & (inward <= THICKEST * radius) & (off <= radius + 2.0 * skin.size)
    back = np.flatnonzero(body & (around.out @ seat.normal <= -FACING) & (inward > skin.size))
    if around.held(back) < RIM_SECTORS or off[back].min() < BARREL * radius:
        return none
    depth = float(np.median(inward[back]))
    within: Bools = body & (inward <= depth + 0.5 * skin.size)
    rim = np.flatnonzero(
        within & (np.einsum("ij,ij->i", around.out, around.outward) >= FACING) & (off >= off[back].max() - skin.size)
    )
    if around.held(rim) < RIM_SECTORS:
        return none
    outer = around.reach(rim)
    nodes = np.flatnonzero(within & ((off >= off[back].min() - 0.25 * skin.size) | np.isin(np.arange(len(off)), ring)))
    return nodes, float(np.pi * outer**2 * depth)
