"""Which moves mill sideways: not the rapid ones, plunges, retracts and holes along the tool, nor the ramp into a cut.

Only where a tool mills sideways do cutting coefficients and a force in process axes say what acts on it, and only there
does a stiffness or an error show on the part.
"""

from __future__ import annotations

import numpy as np

from machining.task import REPEATED
from robots.arrays import Array, Bools

# Cosine between move and tool axis beyond which a move plunges, retracts or drills.
ALONG_AXIS = 0.999
# Sine of the slope against the plane across the tool: steeper moves descend, flatter ones are level.
DESCENDS, LEVEL = np.sin(np.radians([2.0, 0.2])).tolist()


def mills(points: Array, axes: Array, cutting: Bools) -> Bools:
    """Moves (n,) that mill sideways.

    ``points`` (n, 3) m and ``axes`` (n, 3), unit vectors, at the end of each move; ``cutting`` (n,): moves at feed.

    A ramp: the moves that descend at the start of a cut, behind a rapid move or a plunge, where at least as long a
    stretch across the tool follows them. A cut that goes down a surface is none: it does not end in a level stretch.
    """
    n = len(points)
    step = np.diff(points, axis=0)
    length = np.append(0.0, np.linalg.norm(step, axis=1))
    rise = np.append(0.0, np.einsum("ni,ni->n", step, axes[1:]))
    out = cutting & (length > REPEATED) & (np.abs(rise) < ALONG_AXIS * length)
    slope = rise / np.maximum(length, REPEATED)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], out, [False]]).astype(np.int8)))
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        run = slice(first, end)
        ramp = _leading(slope[run] < -DESCENDS)
        level = _leading(np.abs(slope[first + ramp : end]) < LEVEL)
        ramped = slice(first, first + ramp)
        if 0 < ramp < end - first and length[first + ramp : first + ramp + level].sum() >= length[ramped].sum():
            out[ramped] = False
    return np.asarray(out) if n else cutting


def plunges(points: Array, axes: Array, cutting: Bools) -> Bools:
    """Moves (n,) at feed that go into the part along the tool."""
    step = np.diff(points, axis=0)
    length, rise = np.linalg.norm(step, axis=1), np.einsum("ni,ni->n", step, axes[1:])
    into = (length > REPEATED) & (rise <= -ALONG_AXIS * length)
    return np.asarray(cutting & np.append(np.zeros(min(1, len(points)), dtype=np.bool_), into))


def _leading(flags: Bools) -> int:
    """How many are true before the first that is not."""
    return len(flags) if flags.all() else int(np.argmin(flags))
