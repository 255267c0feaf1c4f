"""Which nodes of a casing are its interfaces: rings, discs about a joint's axis, or balls."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from meshes.shell_mesh import connected, sides
from meshes.surfaces.remesh import normals
from meshes.surfaces.seats import ALONG, LEAST_RING, Seats, Skin, seats_around
from robots import InputError
from robots.arrays import Array, Integers

# Interfaces reach no further than this share of the way to the next one.
SHARE_OF_WAY = 0.45
SHRINK, MOST_SHRINKS = 0.75, 8
# One bearing joins two links: where their rings' radii differ by more, the smaller takes the larger (see
# docs/decisions/meshes.md for what that did to a FANUC's real readings).
ONE_BEARING = 1.5


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
    """Nodes of an interface, how far they reach (m) from the axis or the point, and how they were chosen.

    ``across``: the joint's axis stands across the link, so there may be a boss around it. ``flange_m3``: volume of a
    solid flange that is held with all its body. ``seat``: whether a seat around the axis was found.
    """

    nodes: Integers
    radius: float
    words: str
    across: bool = False
    flange_m3: float = 0.0
    seat: bool = False


def choose_rings(
    interfaces: Mapping[str, Interface], nodes: Array, faces: Integers, size: float, link: str = ""
) -> tuple[dict[str, Ring], list[str]]:
    """Nodes of each interface on a surface (n, 3), (m, 3) with elements of ``size`` m; notes of what was shrunk.

    ``link``: for messages.

    With an axis: the *seats* around it (:mod:`meshes.surfaces.seats`), places that face along it on five eighths of
    its turn at least; of these the nearest to the neighbour's surface, or without a neighbour the nearest to the point.
    Two on both sides of a fork are both taken. An axis along the way to the next interface has the whole seat: the end
    of the arm. One across it, on the side of an arm, has a disc with the median of the seat's reach all round as its
    radius. A thin flange is held with all its body. Rings that meet are kept within 45 % of the way between them, or
    less. Where no seat is, and the point is near the surface: a ball around it. Without an axis: all nodes within
    ``radius``, or else the band of nodes within half an element of the plane through the point at right angles to the
    way to the other points.

    Raises
    ------
    InputError
        No ring at an interface, or rings that share nodes however small they are.
    """
    normal = np.zeros((len(nodes), 3))
    np.add.at(normal, faces, normals(nodes, faces)[:, None] / 6.0)
    skin = Skin(nodes, faces, normal, size, f" of link {link}" if link else "")
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
            f"interfaces {' and '.join(common)}{skin.of} share nodes",
            code="L006",
            remedy="give smaller radii for both (--radius LINK.END=MM)",
        )
    return rings, notes


def _sharing(rings: Mapping[str, Ring]) -> list[str]:
    """Names of the first two rings with a node in common."""
    names = list(rings)
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            if np.intersect1d(rings[one].nodes, rings[other].nodes).size:
                return [one, other]
    return []


def _ring(name: str, interfaces: Mapping[str, Interface], skin: Skin, share: float) -> Ring:
    here = interfaces[name]
    others = [other.point for key, other in interfaces.items() if key != name]
    ways = sorted((p - here.point for p in others), key=lambda way: float(np.linalg.norm(way)))
    limit = share * float(np.linalg.norm(ways[0])) if ways else np.inf
    distance = np.linalg.norm(skin.nodes - here.point, axis=1)
    if here.axis is not None:
        where = f"{1e3 * (here.radius or limit):.4g} mm of the joint's axis"
        found = _seat_ring(here, ways, skin, limit, share < 1.0) or _ball_ring(
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
            code="L006",
            value=f"the nearest node is {distance.min():.4g} m away",
            allowed=f"{LEAST_RING} nodes or more",
            remedy="move the point onto the surface's end, or give its radius (--radius LINK.END=MM)",
        )
    return found


def _band_ring(point: Array, others: list[Array], distance: Array, skin: Skin) -> Ring | None:
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


def _seat_ring(here: Interface, ways: list[Array], skin: Skin, limit: float, shrunk: bool) -> Ring | None:
    """Seats around the joint's axis as a ring; ``shrunk``: kept off another ring, without a flange's body."""
    assert here.axis is not None  # noqa: S101 - asked only of those
    given = here.radius is not None
    axis = here.axis / np.linalg.norm(here.axis)
    across = bool(ways) and abs(float(ways[0] @ axis)) < ALONG * float(np.linalg.norm(ways[0]))
    most = here.radius if here.radius is not None else np.inf if here.whole else limit
    disc = across and not here.whole
    found = seats_around(skin, here.point, axis, most, here.facing, given, disc, not (here.whole or shrunk))
    return (
        None
        if found is None
        else Ring(found.nodes, found.radius, _words(found, given), across and not here.whole, found.flange_m3, True)
    )


def _words(found: Seats, given: bool) -> str:
    places = " and ".join(f"{1e3 * place:+.4g}" for place in found.places)
    near = "" if found.gap is None else f", {1e3 * found.gap:.3g} mm from its neighbour"
    body = ", with the whole body of its flange" if found.flange_m3 else ""
    bearing = ", its radius given" if given else ""
    return f"disc of {1e3 * found.radius:.4g} mm about the joint's axis at {places} mm{near}{bearing}{body}"


def one_bearing(tip: Ring, root: Ring, before: int, after: int) -> list[tuple[int, str, float]]:
    """What to mend where two links meet: number of the link, its interface, and the radius (m) it should have.

    ``tip`` of link ``before`` and ``root`` of link ``after`` are bolted to the same bearing.
    """
    if not (tip.seat and root.seat):
        return []
    if tip.radius > ONE_BEARING * root.radius:
        return [(after, "root", tip.radius)]
    return [(before, "tip", root.radius)] if root.radius > ONE_BEARING * tip.radius else []
