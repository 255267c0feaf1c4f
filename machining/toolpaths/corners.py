"""Elements of a contour in a plane, corners that are rounded or chamfered, arcs that go on along a direction."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np

from machining.toolpaths.recorder import StatementError
from robots.arrays import Array


@dataclass(frozen=True, eq=False)
class Piece:
    """A line from ``start`` to ``end`` (3,) m, or an arc about ``center``; the plane is that of the first two axes.

    ``sweep``: rad that an arc turns by, positive counter-clockwise.
    """

    start: Array
    end: Array
    center: Array | None = None
    sweep: float = 0.0

    def along(self, share: Array) -> Array:
        """Points (n, 3) m at shares (n,) of the way."""
        if self.center is None:
            return np.asarray(self.start + share[:, None] * (self.end - self.start))
        out = np.tile(self.start, (len(share), 1))
        lever = complex(*(self.start - self.center)[:2]) * np.exp(1j * self.sweep * share)
        out[:, 0], out[:, 1] = self.center[0] + lever.real, self.center[1] + lever.imag
        return out

    def heading(self, share: float) -> Array:
        """Direction (3,), of any length, in which the way leads at a share of it."""
        if self.center is None:
            return self.end - self.start
        x, y, _ = (self.along(np.array([share]))[0] - self.center) * self.sweep
        return np.array([-y, x, 0.0])

    def share_beside(self, point: complex) -> float:
        """Share of the way at which it passes nearest to a point of the plane."""
        start = complex(*self.start[:2])
        if self.center is None:
            way = complex(*self.end[:2]) - start
            return ((point - start) / way).real
        center = complex(*self.center[:2])
        turned = cmath.phase((point - center) / (start - center)) * math.copysign(1.0, self.sweep)
        return turned % (2.0 * math.pi) / abs(self.sweep)


def rounded(into: Piece, out: Piece, radius: float) -> tuple[float, Piece]:
    """The share of the first of two pieces at which the rounding of their corner begins, and the arc that it is.

    Of the circles that touch both pieces on the side that the way turns to, the one nearest to the corner.

    Raises
    ------
    StatementError
        Pieces without a corner, or too short for the radius.
    """
    side = math.copysign(radius, _turn(into, out))
    found = list[tuple[float, float, complex]]()
    for center in _centers(into, out, side):
        first, last = into.share_beside(center), out.share_beside(center)
        if first > -1e-9 and last < 1.0 + 1e-9 and first <= 1.0 and last >= 0.0:
            found.append((max(first, 0.0), min(last, 1.0), center))
    if not found:
        raise StatementError(
            "a rounding too large for its corner", "a radius that both sides have room for", code="P021"
        )
    first, last, center = max(found, key=lambda one: one[0] - one[1])
    start, end = into.along(np.array([first]))[0], out.along(np.array([last]))[0]
    lever = complex(*start[:2]) - center
    sweep = cmath.phase((complex(*end[:2]) - center) / lever) * math.copysign(1.0, side) % (2.0 * math.pi)
    return first, Piece(start, end, np.array([center.real, center.imag, start[2]]), math.copysign(sweep, side))


def chamfered(into: Piece, out: Piece, length: float, across: bool = False) -> tuple[float, Piece]:
    """As :func:`rounded`: a chamfer takes ``length`` m off both lines, or is so long itself (``across``)."""
    turn = _turn(into, out)
    if into.center is not None or out.center is not None:
        raise StatementError("a chamfer at an arc: controls differ", "a chamfer between two lines", code="P021")
    if across:
        length /= 2.0 * math.cos(turn / 2.0)
    a, b = (float(np.linalg.norm(one.end - one.start)) for one in (into, out))
    if not 0.0 < length <= min(a, b) + 1e-9:
        raise StatementError("a chamfer too large for its lines", "a length that both lines have room for", code="P021")
    first, last = 1.0 - min(length / a, 1.0), min(length / b, 1.0)
    return first, Piece(into.along(np.array([first]))[0], out.along(np.array([last]))[0])


def _turn(into: Piece, out: Piece) -> float:
    """Angle rad that the way turns by at the corner of two pieces."""
    if np.ptp([into.start[2], into.end[2], out.start[2], out.end[2]]) > 1e-9:
        raise StatementError(
            "a rounding or chamfer of a corner that is not in the plane", "elements of the plane", code="P021"
        )
    a, b = complex(*into.heading(1.0)[:2]), complex(*out.heading(0.0)[:2])
    turn = cmath.phase(b / a) if min(abs(a), abs(b)) > 1e-9 else 0.0
    if abs(turn) < 1e-9 or abs(turn) > math.pi - 1e-6:
        raise StatementError(
            "a rounding or chamfer between elements that make no corner", "two at an angle", code="P021"
        )
    return turn


def _centers(into: Piece, out: Piece, side: float) -> list[complex]:
    """Points of the plane that lie beside both pieces, as far as ``side`` m to their left."""
    lines, circles = list[tuple[complex, complex]](), list[tuple[complex, float]]()
    for one in (into, out):
        if one.center is None:
            way = complex(*(one.end - one.start)[:2])
            lines.append((complex(*one.end[:2]) + 1j * side * way / abs(way), way / abs(way)))
        else:
            radius = math.hypot(*(one.end - one.center)[:2]) - math.copysign(side, side * one.sweep)
            circles.append((complex(*one.center[:2]), radius))
    if not circles:
        (p, u), (q, v) = lines
        return [p + u * ((q - p) * v.conjugate()).imag / (u * v.conjugate()).imag]
    (center, radius), *others = circles
    for middle, other in others:
        # Two circles meet on the line across that of their centres.
        way, size = middle - center, abs(middle - center)
        if not size > 1e-12:
            return []
        lines.append((center + way * (1.0 + (radius**2 - other**2) / size**2) / 2.0, 1j * way / size))
    p, u = lines[0]
    foot = p + u * ((center - p) / u).real
    half = radius**2 - abs(center - foot) ** 2
    # One that goes by inside the arc has no room.
    if min(radius, *(one for _, one in circles)) <= 0.0 or half < 0.0:
        return []
    return [foot + u * math.sqrt(half), foot - u * math.sqrt(half)]


def through_point(start: Array, on_way: Array, end: Array) -> tuple[Array, bool]:
    """Centre (3,) m in the plane X Y of the arc from ``start`` by way of a point to ``end``; whether it is clockwise.

    Raises
    ------
    StatementError
        Points in a line, or two that are one.
    """
    (a, b), (c, d) = (on_way - start)[:2], (end - start)[:2]
    bend = a * d - b * c
    if abs(bend) < 1e-9 * (np.hypot(a, b) + np.hypot(c, d)):
        raise StatementError("an arc through points in a line", "three points that bend", code="P021")
    p, q, out = a * a + b * b, c * c + d * d, start.copy()
    out[:2] += np.array([p * d - q * b, q * a - p * c]) / (2.0 * bend)
    return out, bend < 0.0


def tangent_arc(start: Array, end: Array, along: Array) -> tuple[Array, bool]:
    """Centre (3,) m in the plane X Y of the arc that leaves ``start`` along a direction, and whether it is clockwise.

    Raises
    ------
    StatementError
        No direction, or an end straight ahead: the arc would be a line.
    """
    way, size = end[:2] - start[:2], float(np.hypot(*along[:2]))
    if not size > 1e-9:
        raise StatementError("CT without a contour before it", "L, C, CR or CT before it", code="P011")
    u = along[:2] / size
    normal = np.array([-u[1], u[0]])
    beside = float(normal @ way)
    if abs(beside) < 1e-9:
        raise StatementError("CT straight ahead", "an end beside the direction of the contour before it", code="P011")
    radius = float(way @ way) / (2.0 * beside)
    centre = start.copy()
    centre[:2] += radius * normal
    return centre, radius < 0.0
