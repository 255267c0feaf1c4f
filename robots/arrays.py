"""Arrays by what they hold: the types that all packages write in their signatures; and their rows, block by block."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
# Whole numbers as files and meshes hold them; Indices are what numpy's own searches and sorts give.
Integers = NDArray[np.int64]
Indices = NDArray[np.intp]


def in_blocks(n: int, size: int) -> Iterator[slice]:
    """Consecutive slices that cover the rows 0 to n, ``size`` each; the last one ends at n."""
    for first in range(0, n, size):
        yield slice(first, min(first + size, n))
