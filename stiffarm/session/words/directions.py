"""Set-ups and directions of loads in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robots.arrays import Array

_SIDES = {
    (1, 0, 0): "forward (+x)",
    (-1, 0, 0): "backward (−x)",
    (0, 1, 0): "to the left (+y)",
    (0, -1, 0): "to the right (−y)",
    (0, 0, 1): "up (+z)",
    (0, 0, -1): "down (−z)",
}


def direction_words(direction: Array) -> str:
    """``down (−z)``; other directions as a unit vector. Base axes: x forward at q1 = 0, z up."""
    x, y, z = (float(v) + 0.0 for v in np.round(direction, 6))
    known = _SIDES.get((int(x), int(y), int(z))) if {abs(x), abs(y), abs(z)} <= {0.0, 1.0} else None
    return known or f"along ({x:.3g}, {y:.3g}, {z:.3g}) of the base".replace("-", "−")


def set_up_rows(labels: Sequence[str], q: Array, direction: Array) -> tuple[tuple[str, ...], ...]:
    """A row for each set-up (n,) to measure: label, angles of q (n, dof) rad in deg, direction (n, 3) of the load."""
    return tuple(
        (label, *(f"{v:.5g}" for v in angles), direction_words(way))
        for label, angles, way in zip(labels, np.degrees(q) + 0.0, direction, strict=True)
    )
