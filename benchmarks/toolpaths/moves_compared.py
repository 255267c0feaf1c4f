"""Moves of a reader beside moves that are known: ends, rapid or feed, circles; all in mm and mm/min.

Lines of the reader may be in parts and its arcs in chords, if all of these lie on them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

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
