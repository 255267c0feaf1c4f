"""Corners of a contour that are rounded or chamfered (in the plane X Y), and arcs that go on along a direction (CT)."""

from __future__ import annotations

import math

import numpy as np

from machining.toolpaths.recorder import StatementError
from robots.arrays import Array


def rounded(start: Array, corner: Array, end: Array, radius: float) -> tuple[Array, Array, Array, bool]:
    """Where the rounding of a corner between two lines begins and ends, its centre (3,) m; whether it is clockwise.

    Raises
    ------
    StatementError
        Lines that are one, or too short for the radius.
    """
    into, out, turn = _turn(start, corner, end)
    cut = radius * math.tan(abs(turn) / 2.0)
    _room(start, corner, end, cut, "rounding")
    side = np.array([-into[1], into[0], 0.0]) * math.copysign(1.0, turn)
    first = corner - cut * into
    return first, corner + cut * out, first + radius * side, turn < 0.0


def chamfered(start: Array, corner: Array, end: Array, length: float, across: bool = False) -> tuple[Array, Array]:
    """Where a chamfer begins and ends: it takes ``length`` m off both lines, or is so long itself (``across``).

    Errors as :func:`rounded`.
    """
    into, out, turn = _turn(start, corner, end)
    if across:
        length /= 2.0 * math.cos(turn / 2.0)
    _room(start, corner, end, length, "chamfer")
    return corner - length * into, corner + length * out


def _turn(start: Array, corner: Array, end: Array) -> tuple[Array, Array, float]:
    """Unit directions into and out of a corner, and the angle rad that the way turns by in X Y."""
    a, b = corner - start, end - corner
    if abs(a[2]) + abs(b[2]) > 1e-9 or not np.hypot(*a[:2]) > 1e-9 or not np.hypot(*b[:2]) > 1e-9:
        raise StatementError(
            "a rounding or chamfer of a corner that is not in the plane", "two lines in the plane", code="P021"
        )
    into, out = a / np.linalg.norm(a), b / np.linalg.norm(b)
    turn = math.atan2(into[0] * out[1] - into[1] * out[0], float(into @ out))
    if abs(turn) < 1e-9 or abs(turn) > math.pi - 1e-6:
        raise StatementError(
            "a rounding or chamfer between lines that make no corner", "two lines at an angle", code="P021"
        )
    return into, out, turn


def _room(start: Array, corner: Array, end: Array, cut: float, word: str) -> None:
    if not 0.0 < cut <= min(np.linalg.norm(corner - start), np.linalg.norm(end - corner)) + 1e-9:
        raise StatementError(
            f"a {word} too large for its lines", "a radius or length that both lines have room for", code="P021"
        )


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
