"""Splines of LinuxCNC as chords: G5 (cubic), G5.1 (quadratic) and G5.2 to G5.3 (rational, by control points).

By its manual (G-codes, G5 to G5.3): a Bezier curve is the same with one span. Knots of G5.2 are 0, 1, 2, ..., the first
and the last repeated by the order.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from machining.toolpaths.recorder import StatementError
from robots.arrays import Array

CUBIC, QUADRATIC, NURBS, NURBS_END = SPLINES = 50, 51, 52, 53
# Chords of one span before any is split, and most of a curve.
FEWEST, MOST = 8, 100_000


@dataclass(frozen=True, eq=False)
class Nurbs:
    """A curve of the ``order`` (degree + 1) by ``control`` points (3,) m and their ``weights`` (none: all 1)."""

    control: list[Array]
    weights: list[float] = field(default_factory=list)
    order: int = 3

    def points(self, tolerance: float) -> Array:
        """Points (n, 3) m behind the first control point, whose chords lie within ``tolerance`` m of the curve.

        Raises
        ------
        StatementError
            Fewer control points than the order, weights that are not positive, a curve of too many chords.
        """
        # Most files have no splines, and reading them must not wait for scipy.
        from scipy.interpolate import BSpline

        control, order, weights = self.control, self.order, self.weights or [1.0] * len(self.control)
        if not 2 <= order <= len(control) or not min(weights) > 0.0:
            raise StatementError(
                f"a spline of order {order} by {len(control)} points",
                "as many points as the order, weights above 0",
                code="P011",
            )
        spans = len(control) - order + 1
        knots = np.concatenate([np.zeros(order), np.arange(1, spans), np.full(order, spans)])
        homogeneous = np.column_stack([np.array(control), np.ones(len(control))]) * np.array(weights)[:, None]
        curve, count = BSpline(knots, homogeneous, order - 1), FEWEST * spans
        while count <= MOST:
            values = curve(np.linspace(0.0, spans, 4 * count + 1))
            points = values[:, :3] / values[:, 3:]
            ends, off = points[::4], points[:-1].reshape(count, 4, 3) - points[:-1:4, None]
            way = np.diff(ends, axis=0)[:, None]
            along = np.clip((off * way).sum(2) / np.maximum((way * way).sum(2), 1e-300), 0.0, 1.0)
            if np.linalg.norm(off - along[..., None] * way, axis=2).max() <= tolerance:
                return np.asarray(ends[1:])
            count *= 2
        raise StatementError(
            "a spline of too many chords", f"up to {MOST}", "--read chord_tolerance_um=10", code="P011"
        )
