"""Checks of the arrays that callers hand to the statics."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from robots import InputError
from robots.arrays import Array


def as_wrenches(wrench: ArrayLike, n: int) -> Array:
    """Wrenches (n, 6) from (6,) or (n, 6): force N, moment N m.

    Raises
    ------
    InputError
        Another shape, or a value that is not finite.
    """
    w = np.asarray(wrench, dtype=np.float64)
    _check("wrench array", w, 6, n, "force N, moment N m")
    return np.broadcast_to(w, (n, 6))


def as_points(point: ArrayLike | None, n: int) -> Array | None:
    """Tool points (n, 3) m in the flange frame from (3,) or (n, 3); None stays None (the model's own).

    Raises
    ------
    InputError
        Another shape, or a value that is not finite.
    """
    if point is None:
        return None
    p = np.asarray(point, dtype=np.float64)
    _check("tool point array", p, 3, n, "m in the flange frame")
    return np.broadcast_to(p, (n, 3))


def _check(what: str, values: Array, width: int, n: int, unit: str) -> None:
    allowed = f"finite, shape ({width},) or ({n}, {width}): {unit}"
    if values.shape not in ((width,), (n, width)):
        raise InputError(what, value=f"shape {values.shape}", allowed=allowed, remedy="one row a pose")
    if not np.isfinite(values).all():
        bad = np.atleast_2d(values)
        row = int(np.flatnonzero(~np.isfinite(bad).all(axis=1))[0])
        raise InputError(
            f"{what}, row {row}",
            value=bad[row].tolist(),
            allowed=allowed,
            remedy="remove or complete that row",
        )
