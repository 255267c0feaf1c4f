"""Corners between moves as a control rounds and chamfers them: tangent arcs and chamfers in the XY plane, plainly."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from moves_compared import Move, Point, sweep

# Radius of rounding (R, RND, RNDM), leg (C, CHR) or length (CHF) of a chamfer.
ROUND, LEG = ("R", "RND", "RNDM"), ("C", "CHR")
NEAR = 1e-6
Flat = tuple[float, float]


@dataclass(frozen=True)
class Corner:
    """What stands behind a move: ``kind``, its size mm, and its own feed mm/min if it has one."""

    kind: str
    size: float
    feed: float = math.nan


def cornered(moves: Sequence[Move], corners: dict[int, Corner], start: Point) -> list[Move]:
    """Moves with their corners in them; ValueError for a corner without room."""
    out: list[Move] = []
    for k, move in enumerate(moves):
        corner = corners.get(k)
        before, tail = out[-1].end if out else start, move
        made: list[Move] = []
        if corner is not None and not (corner.kind == "RNDM" and (k + 1 == len(moves) or moves[k + 1].rapid)):
            if k + 1 == len(moves):
                raise ValueError("a corner without its second side")
            made = _corner(before, move, moves[k + 1], corner)
        if made:
            tail = replace(move, end=made[0].end)
            made = made[1:]
        out += [tail, *made]
    return out


def _corner(before: Point, first: Move, then: Move, corner: Corner) -> list[Move]:
    """The end of the first side as a move, and what joins it to the second; nothing where the sides are tangent."""
    p = first.end
    if first.rapid or then.rapid or abs(before[2] - p[2]) > NEAR or abs(then.end[2] - p[2]) > NEAR:
        raise ValueError("a corner out of the plane")
    d1, d2 = direction(before, first, p), direction(p, then, p)
    bend = math.atan2(d1[0] * d2[1] - d1[1] * d2[0], d1[0] * d2[0] + d1[1] * d2[1])
    if abs(bend) < 1e-6:
        return []
    feed = first.feed if first.feed == then.feed else math.nan
    feed = feed if math.isnan(corner.feed) else corner.feed
    if corner.kind in ROUND:
        t1, t2, centre = _rounding(before, first, then, corner.size, 1 if bend > 0 else -1)
        arc = Move((*t2, p[2]), False, feed, (*centre, p[2]), 2, 1 if bend > 0 else -1)
        return [Move((*t1, p[2])), arc]
    if first.centre is not None or then.centre is not None:
        raise ValueError("a chamfer at an arc")
    # The chamfer is the base of a triangle with equal legs.
    leg = corner.size if corner.kind in LEG else corner.size / (2 * math.cos(bend / 2))
    if leg > min(math.dist(before, p), math.dist(p, then.end)) - NEAR:
        raise ValueError("no room for a chamfer")
    a = (p[0] - leg * d1[0], p[1] - leg * d1[1], p[2])
    return [Move(a), Move((p[0] + leg * d2[0], p[1] + leg * d2[1], p[2]), False, feed)]


def direction(start: Point, move: Move, at: Sequence[float]) -> Flat:
    """Unit direction of a move where it passes a point."""
    if move.centre is None:
        x, y = move.end[0] - start[0], move.end[1] - start[1]
    else:
        x, y = -move.sense * (at[1] - move.centre[1]), move.sense * (at[0] - move.centre[0])
    size = math.hypot(x, y)
    return x / size, y / size


def _rounding(before: Point, first: Move, then: Move, r: float, side: int) -> tuple[Flat, Flat, Flat]:
    """Where an arc of radius r touches both sides, and its centre: nearest to the corner of all that fit."""
    found = []
    p = first.end
    for centre in _meetings(_beside(before, first, r, side), _beside(p, then, r, side)):
        t1, t2 = _foot(before, first, centre), _foot(p, then, centre)
        if _on(before, first, t1) and _on(p, then, t2):
            found.append((math.dist(centre, p[:2]), t1, t2, centre))
    if not found:
        raise ValueError("no room for a rounding")
    return min(found)[1:]


def _beside(start: Point, move: Move, r: float, side: int) -> tuple[Flat, Flat] | tuple[Flat, float]:
    """Where centres are that lie r from a move on one side: a line (point, direction), or a circle (centre, radius)."""
    if move.centre is None:
        d = direction(start, move, start)
        return (start[0] - side * r * d[1], start[1] + side * r * d[0]), d
    radius = math.dist(start[:2], move.centre[:2])
    return move.centre[:2], radius - r * side * move.sense


def _meetings(a: tuple, b: tuple) -> Iterator[Flat]:
    line_a, line_b = isinstance(a[1], tuple), isinstance(b[1], tuple)
    if line_a and line_b:
        (x, y), (dx, dy) = a
        (u, v), (eu, ev) = b
        cross = dx * ev - dy * eu
        if abs(cross) > 1e-12:
            t = ((u - x) * ev - (v - y) * eu) / cross
            yield x + t * dx, y + t * dy
    elif line_a or line_b:
        (x, y), (dx, dy) = a if line_a else b
        (cx, cy), radius = b if line_a else a
        along = (cx - x) * dx + (cy - y) * dy
        gap = radius * radius - (cx - x - along * dx) ** 2 - (cy - y - along * dy) ** 2
        for sign in (-1, 1) if gap >= 0 and radius > 0 else ():
            t = along + sign * math.sqrt(gap)
            yield x + t * dx, y + t * dy
    else:
        yield from _circles(a, b)


def _circles(a: tuple, b: tuple) -> Iterator[Flat]:
    (x, y), r = a
    (u, v), q = b
    d = math.dist((x, y), (u, v))
    if r > 0 and q > 0 and abs(r - q) < d < r + q:
        t = (d * d + r * r - q * q) / (2 * d)
        h = math.sqrt(max(r * r - t * t, 0.0))
        for s in (-h, h):
            yield x + (t * (u - x) - s * (v - y)) / d, y + (t * (v - y) + s * (u - x)) / d


def _foot(start: Point, move: Move, centre: Flat) -> Flat:
    """The point of a move that is nearest to a centre beside it."""
    if move.centre is None:
        d = direction(start, move, start)
        t = (centre[0] - start[0]) * d[0] + (centre[1] - start[1]) * d[1]
        return start[0] + t * d[0], start[1] + t * d[1]
    c, radius = move.centre, math.dist(start[:2], move.centre[:2])
    d = math.dist(centre, c[:2])
    return c[0] + radius * (centre[0] - c[0]) / d, c[1] + radius * (centre[1] - c[1]) / d


def _on(start: Point, move: Move, point: Flat) -> bool:
    """Whether a point of the endless line or circle is on the move."""
    if move.centre is None:
        size = math.dist(start[:2], move.end[:2])
        d = direction(start, move, start)
        return NEAR < (point[0] - start[0]) * d[0] + (point[1] - start[1]) * d[1] < size - NEAR
    part = sweep(start, replace(move, end=(*point, start[2]), turns=0))
    return NEAR < part < sweep(start, move) - NEAR
