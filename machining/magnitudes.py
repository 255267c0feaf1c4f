"""How large the numbers of a shop can be: beyond these a number is a slip of the pen, a lost point, or no number.

What is within them can be squared, multiplied and turned into another unit without leaving the range of floats.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robots.arrays import Array, Bools

# m: no machine is ten kilometres long; in inches and without its point a coordinate of a machine is below that.
FARTHEST: Final = 1e4
# m/s at which a tool is fed: F words of seven digits in mm/min are below, as placeholders for "rapid" are.
SLOWEST: Final = 1e-9
FASTEST: Final = 1e3
# s of rest: eleven days.
LONGEST_REST: Final = 1e6
# rad/s of a spindle: the fastest turn at 2e4 or so.
FASTEST_TURN: Final = 1e6
# Largest number in a tool path file, whatever it counts: nine digits, and one that was typed twice.
LARGEST: Final = 1e10
# Numbers of tools, operations and source lines.
LARGEST_NUMBER: Final = 10**9


def feeds(feed: Array) -> Bools:
    """Feeds m/s that can be; NaN stands for one that is not given."""
    return np.isnan(feed) | ((feed >= SLOWEST) & (feed <= FASTEST))


FEEDS: Final = f"{SLOWEST * 6e4:.5f} to {FASTEST * 6e4:,.0f} mm/min"
PLACES: Final = f"finite numbers from -{FARTHEST * 1e3:,.0f} to {FARTHEST * 1e3:,.0f} mm"
