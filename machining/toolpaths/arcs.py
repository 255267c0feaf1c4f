"""Arcs and helices as chords."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from machining.magnitudes import FARTHEST, PLACES
from machining.toolpaths.recorder import StatementError
from robots.arrays import Array

# Start and end nearer than this (m) across the axis are one point: the arc is a full turn. Half the finest increment of
# machining controls (0.1 um) and all that rounding leaves behind a change of units; no program means a shorter arc.
CLOSED = 2e-7
REMEDY = (
    "post with more decimals, or allow more: --read arc_tolerance_um=50; in G-code check G90.1 and G91.1, or say that "
    "centres are coordinates: --read arc_absolute=yes"
)
# Largest angle of one chord, whatever the tolerance: small circles stay round.
WIDEST = math.pi / 4.0


class ArcError(StatementError):
    """An arc that does not exist: what is wrong, the value, what is allowed."""

    def __init__(self, what: str, value: str, allowed: str) -> None:
        super().__init__(f"{what} ({value})", allowed, REMEDY, code="P011")


def chord_count(sweep: float, radius: float, tolerance: float) -> float:
    """Number of equal chords that stay within ``tolerance`` (m) of an arc of ``radius`` m and ``sweep`` rad.

    The sagitta of a chord over the angle a is ``r (1 - cos(a / 2)) = 2 r sin(a / 4)^2``. A float, so that absurd
    arcs can be refused before they are turned into arrays.
    """
    sine = math.sqrt(tolerance / (2.0 * radius)) if tolerance < 2.0 * radius else 1.0
    return max(1.0, math.ceil(sweep / min(WIDEST, 4.0 * math.asin(sine)) - 1e-9))


def sweep_about(start: ArrayLike, end: ArrayLike, center: ArrayLike, axis: ArrayLike) -> float:
    """Angle in (0, 2 pi] rad from start to end, right-handed about ``axis``; a full turn if they coincide.

    Raises
    ------
    ArcError
        An axis of length zero.
    """
    u, v, unit = _across(start, end, center, axis)
    if np.linalg.norm(u - v) < CLOSED:
        return 2.0 * math.pi
    return math.atan2(float(unit @ np.cross(u, v)), float(u @ v)) % (2.0 * math.pi) or 2.0 * math.pi


def arc_points(
    start: ArrayLike,
    end: ArrayLike,
    center: ArrayLike,
    axis: ArrayLike,
    *,
    chord_tolerance: float,
    arc_tolerance: float,
    radius: float | None = None,
    turns: int = 1,
    limit: float = math.inf,
) -> tuple[Array, Array]:
    """Fractions (n,) of the sweep and points (n, 3) m behind ``start`` up to ``end``, which is met exactly.

    The arc runs right-handed about ``axis`` from start to end, a full turn if they coincide across the axis;
    ``turns`` above 1 adds full turns. A difference of height along the axis makes a helix, a difference of radius
    within ``arc_tolerance`` is spread over the sweep.

    Raises
    ------
    ArcError
        Values that are not finite, an axis of length zero, a start on the centre, radii that differ by more than
        ``arc_tolerance`` (at both ends, and from ``radius`` if that is given), more chords than ``limit``.
    """
    s, e, c, a = (np.asarray(v, dtype=np.float64) for v in (start, end, center, axis))
    if not (np.abs(np.concatenate([s, e, c])) <= FARTHEST).all():
        raise ArcError("arc", "an end or a centre beyond that", PLACES)
    u, v, unit = _across(s, e, c, a)
    r0, r1 = float(np.linalg.norm(u)), float(np.linalg.norm(v))
    if r0 < CLOSED:
        raise ArcError("arc that starts on its centre", f"{r0 * 1e3:.6g} mm", "a radius more than 0")
    radii = f"radius {r0 * 1e3:.6g} mm at the start, {r1 * 1e3:.6g} mm at the end"
    if radius is not None:
        radii += f", {radius * 1e3:.6g} mm stated"
    if abs(r0 - r1) > arc_tolerance or (radius is not None and abs(r0 - abs(radius)) > arc_tolerance):
        raise ArcError("ends that do not lie on one circle", radii, f"equal within {arc_tolerance * 1e3:.6g} mm")
    sweep = sweep_about(s, e, c, a) + 2.0 * math.pi * (max(turns, 1) - 1)
    count = chord_count(sweep, max(r0, r1), chord_tolerance)
    if count > limit:
        raise ArcError("arc", f"{count:.3g} chords", f"up to {limit:.6g} (--read max_moves)")
    fraction = np.arange(1, int(count) + 1) / count
    angle, size = sweep * fraction, r0 + (r1 - r0) * fraction
    e1 = u / r0
    height = float((s - c) @ unit) + float((e - s) @ unit) * fraction
    points = (
        c
        + (size * np.cos(angle))[:, None] * e1
        + (size * np.sin(angle))[:, None] * np.cross(unit, e1)
        + height[:, None] * unit
    )
    points[-1] = e
    return fraction, points


def between(first: ArrayLike, last: ArrayLike, fraction: Array) -> Array:
    """Tool axes (n, 3) that turn from ``first`` to ``last`` at ``fraction`` (n,), blended straight and not unit."""
    a, b = np.asarray(first, dtype=np.float64), np.asarray(last, dtype=np.float64)
    return np.asarray(a + (b - a) * fraction[:, None])


def _across(start: ArrayLike, end: ArrayLike, center: ArrayLike, axis: ArrayLike) -> tuple[Array, Array, Array]:
    c, a = np.asarray(center, dtype=np.float64), np.asarray(axis, dtype=np.float64)
    if not 1e-9 < float(np.abs(a).max()) < 1e9:
        raise ArcError("axis of the arc", str(a.tolist()), "a direction")
    unit = a / np.linalg.norm(a)
    u, v = np.asarray(start, dtype=np.float64) - c, np.asarray(end, dtype=np.float64) - c
    return u - (u @ unit) * unit, v - (v @ unit) * unit, unit
