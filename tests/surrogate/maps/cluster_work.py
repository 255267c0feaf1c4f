"""What workers of a test's cluster do: blocks of a small map, slowly, so that a worker can be killed in the middle."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from map_arms import engine, kr60, slice_layout

from surrogate.maps.blocks import Engine
from surrogate.maps.cluster import REFUSED
from surrogate.maps.poses import BestGamma

SIZE = 16


def made() -> Engine:
    grid = slice_layout("xz", np.arange(0.0, 2001.0, 100.0), np.arange(0.0, 1001.0, 100.0))
    return engine(kr60(), grid, BestGamma(np.array([0.0, 0.0, 1.0]), np.zeros(1)), wanted=("stiffness", "isotropy"))


def slowly(request: str, number: int) -> dict[str, Any]:
    """A block of the map; ``request`` is how long it takes, s."""
    time.sleep(float(request))
    one = made()
    return dict(one.block(slice(number * SIZE, min((number + 1) * SIZE, one.grid.n))))


def refusing(request: str, number: int) -> dict[str, Any]:
    return {REFUSED: f"map request: version: got '{request}'"}


def failing(request: str, number: int) -> dict[str, Any]:
    raise ImportError("No module named 'stiffarm'")
