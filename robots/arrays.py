"""Arrays by what they hold: types that all packages write in signatures; a check of shapes, and rows in blocks."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robots.errors import InputError

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
# Whole numbers as files and meshes hold them; Indices are what numpy's own searches and sorts give.
Integers = NDArray[np.int64]
Indices = NDArray[np.intp]


def in_blocks(n: int, size: int) -> Iterator[slice]:
    """Consecutive slices that cover the rows 0 to n, ``size`` each; the last one ends at n."""
    for first in range(0, n, size):
        yield slice(first, min(first + size, n))


def finite(what: str, values: ArrayLike, shape: tuple[int | str, ...], unit: str = "") -> Array:
    """Finite numbers of a shape, in which a letter stands for any length but 0: ``("n", 3)``.

    Raises
    ------
    InputError
        Another shape, or values that are not finite.
    """
    array = np.asarray(values, dtype=np.float64)
    lengths = zip(array.shape, shape, strict=False)
    fits = array.ndim == len(shape) and all(k > 0 if isinstance(want, str) else k == want for k, want in lengths)
    if not fits or not np.isfinite(array).all():
        value = array.tolist() if fits and array.size < 10 else f"shape {array.shape}"
        form = f"({', '.join(map(str, shape))}{',' * (len(shape) == 1)})"
        raise InputError(what, code="B001", value=value, allowed=f"finite numbers, shape {form} {unit}".rstrip())
    return array
