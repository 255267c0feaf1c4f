"""Arrays by what they hold: the types that all packages write in their signatures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
# Whole numbers as files and meshes hold them; Indices are what numpy's own searches and sorts give.
Integers = NDArray[np.int64]
Indices = NDArray[np.intp]
