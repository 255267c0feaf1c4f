"""Moves of a reader beside moves that are known: ends, rapid or feed, circles; all in mm and mm/min.

Lines of the reader may be in parts and its arcs in chords, if all of these lie on them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

# Ends agree to this, points and middles of chords lie on their arc to that. Inch programs are written to 2.5e-6 mm;
# a corner between arcs that are nearly tangent makes fifty times as much of it, so that 1e-4 mm would be too strict.
END_mm, ON_ARC_mm = 2e-4, 5e-3
FEED = 1e-6
# An arc that ends as near to its start as this is a full circle.
FULL_mm = 2e-4
# A feed that the program does not tell: NaN of the reader.
UNKNOWN = -1.0
Point = tuple[float, float, float]


@dataclass(frozen=True)
class Move:
    """One move to ``end`` mm.

    ``feed`` mm/min (NaN: any). An arc has a ``centre``, the index of its ``normal``, a ``sense`` (1 against the clock,
    seen from where the normal points to) and full ``turns`` added. ``top``: a hole from there that is drilled in pecks
    of at most ``peck`` mm, each as the control likes.
    """

    end: Point
    rapid: bool = False
    feed: float = math.nan
    centre: Point | None = None
    normal: int = 2
    sense: int = 1
    turns: int = 0
    top: float | None = None
    peck: float = 0.0


def sweep(start: Sequence[float], move: Move) -> float:
    """Angle rad that an arc turns by, positive; a full circle where it ends where it starts."""
    u, v = ((1, 2), (2, 0), (0, 1))[move.normal]
    c = move.centre or (0.0, 0.0, 0.0)
    a = math.atan2(start[v] - c[v], start[u] - c[u])
    b = math.atan2(move.end[v] - c[v], move.end[u] - c[u])
    turn = (move.sense * (b - a)) % (2.0 * math.pi)
    if math.hypot(start[u] - move.end[u], start[v] - move.end[v]) < FULL_mm:
        turn = 2.0 * math.pi
    return turn + 2.0 * math.pi * move.turns


def disagreement(points: ArrayLike, rapid: ArrayLike, feed: ArrayLike, moves: Sequence[Move]) -> str:
    """What differs first; "" where nothing does. points (n, 3) mm, rapid (n,), feed (n,) mm/min of the reader."""
    p, fast, speed = np.asarray(points, float), np.asarray(rapid, bool), np.asarray(feed, float)
    kept = np.append(True, np.linalg.norm(np.diff(p, axis=0), axis=1) > END_mm / 10) if len(p) else slice(0)
    p, fast, speed = p[kept], fast[kept], speed[kept]
    here: Point | None = None
    k = 0
    for number, move in enumerate(moves, 1):
        if here is not None and move.centre is None and math.dist(here, move.end) <= END_mm / 10:
            continue
        first = k
        if move.top is not None:
            k, wrong = _pecked(p, fast, k, move)
            if wrong:
                return f"move {number} to {_text(move.end)}: {wrong}"
            here = move.end
            continue
        while k < len(p) and k - first < 200_000:
            near = math.dist(p[k], move.end) <= END_mm
            if near and (move.centre is None or here is None or _turned(p, first, k, here, move)):
                break
            if here is None or (move.centre is None and _off_line(p[k], here, move.end) > END_mm):
                return _told(number, move, p, k)
            k += 1
        if k >= len(p):
            return _told(number, move, p, first)
        k += 1
        wrong = _wrong(p[first - 1 : k] if first else p[:k], fast[first:k], speed[first:k], move)
        if wrong:
            return f"move {number} to {_text(move.end)}: {wrong}"
        here = move.end
    return "" if k == len(p) else f"{len(p) - k} moves more than there are, to {_text(p[k])}"


def _pecked(p: np.ndarray, fast: np.ndarray, k: int, move: Move) -> tuple[int, str]:
    """The point behind the bottom of a hole, and what is wrong with how it is drilled."""
    deepest = top = move.top or 0.0
    while k < len(p):
        x, y, z = p[k]
        if math.hypot(x - move.end[0], y - move.end[1]) > END_mm or not move.end[2] - END_mm <= z <= top + END_mm:
            return k, f"beside its hole: {_text(p[k])}"
        if z < deepest - END_mm:
            if fast[k] or (move.peck and deepest - z > move.peck + END_mm):
                return k, f"from {deepest:g} to {z:g} at once" + " in rapid" * bool(fast[k])
            deepest = z
        k += 1
        if z <= move.end[2] + END_mm:
            return k, ""
    return k, "ends in its hole"


def _turned(p: np.ndarray, first: int, k: int, here: Point, move: Move) -> bool:
    """Whether chords up to point k have turned as far as the arc does: it may pass its own end before."""
    if not move.turns and math.dist(here, move.end) > END_mm:
        return True
    return _turn(np.vstack([np.array(here), p[first : k + 1]]), move) > sweep(here, move) - 1e-2


def _turn(chain: np.ndarray, move: Move) -> float:
    u, v = ((1, 2), (2, 0), (0, 1))[move.normal]
    off = chain - np.array(move.centre)
    angle = np.unwrap(np.arctan2(off[:, v], off[:, u]))
    return float(move.sense * (angle[-1] - angle[0]))


def _wrong(chain: np.ndarray, fast: np.ndarray, speed: np.ndarray, move: Move) -> str:
    if (fast != move.rapid).any():
        return "at feed, not rapid" if move.rapid else "rapid, not at feed"
    if move.feed == UNKNOWN:
        return "" if np.isnan(speed).all() else f"feed {speed[0]:g} mm/min, which is not known"
    if not move.rapid and not math.isnan(move.feed):
        off = ~(np.abs(speed - move.feed) <= FEED * move.feed)
        if off.any():
            return f"feed {speed[off][0]:g}, not {move.feed:g} mm/min"
    if move.centre is None or len(chain) < 2:
        return ""
    u, v = ((1, 2), (2, 0), (0, 1))[move.normal]
    c, w = np.array(move.centre), move.normal
    radius = float(np.hypot(chain[0, u] - c[u], chain[0, v] - c[v]))
    middle = 0.5 * (chain[1:] + chain[:-1])
    for some in (chain, middle):
        off = np.abs(np.hypot(some[:, u] - c[u], some[:, v] - c[v]) - radius)
        if off.max() > ON_ARC_mm:
            return f"{1e3 * off.max():.3g} um off its arc"
    turn, full = _turn(chain, move), sweep(chain[0].tolist(), move)
    if abs(turn - full) > 1e-3 + END_mm / max(radius, END_mm):
        return f"turns by {math.degrees(turn):.4g} deg, not {math.degrees(full):.4g}"
    angle = np.unwrap(np.arctan2(chain[:, v] - c[v], chain[:, u] - c[u]))
    share = move.sense * (angle - angle[0]) / full
    rise = chain[0, w] + share * (chain[-1, w] - chain[0, w])
    if np.abs(chain[:, w] - rise).max() > ON_ARC_mm:
        return f"{1e3 * np.abs(chain[:, w] - rise).max():.3g} um off its helix"
    return ""


def _off_line(point: np.ndarray, a: Point, b: Point) -> float:
    along = np.array(b) - np.array(a)
    t = float((point - np.array(a)) @ along / (along @ along))
    return float(np.linalg.norm(point - np.array(a) - t * along)) if 0.0 <= t <= 1.0 else math.inf


def _told(number: int, move: Move, p: np.ndarray, k: int) -> str:
    got = _text(p[k]) if k < len(p) else "none"
    return f"move {number} to {_text(move.end)}: ours to {got}"


def _text(point: Sequence[float] | np.ndarray) -> str:
    return ",".join(f"{v:.6g}" for v in point)


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
