"""Numbers that are agreed upon, and factors between units of length and speed: each stands here and nowhere else."""

from __future__ import annotations

import math
from typing import Final

# m/s^2, by definition (3rd CGPM, 1901).
STANDARD_GRAVITY: Final = 9.80665
# Half the width of a 95 % interval of the normal distribution, in standard deviations.
NORMAL_95: Final = 1.959963984540054

# The way of a weight, base axes of an arm on the floor.
DOWN: Final = (0.0, 0.0, -1.0)

M_TO_MM: Final = 1e3
N_PER_M_TO_N_PER_MM: Final = 1e-3
# A millimetre (m), a millimetre a minute (m/s), a turn a minute (rad/s).
MM: Final = 1e-3
MM_MIN: Final = 1e-3 / 60.0
RPM: Final = 2.0 * math.pi / 60.0
