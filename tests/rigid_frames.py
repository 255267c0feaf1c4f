"""Homogeneous matrices of the places where parts, tools and bodies of tests stand."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

UNTURNED = np.eye(3)


def rigid_frame(p: ArrayLike = (0.0, 0.0, 0.0), R: ArrayLike = UNTURNED) -> NDArray[np.float64]:
    """The frame that stands at ``p`` and is turned by ``R``."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    return T
