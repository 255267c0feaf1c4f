"""Readings that are in doubt, by the notes of their set or by the diagnosis itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from doe import Measurements
from robots.arrays import Bools
from stiffarm.commands.diagnose.step import Diagnosed
from stiffarm.session.steps import is_bundled


@dataclass(frozen=True)
class Doubt:
    """Readings that may be wrong: at these poses and loads (N), for the reason in ``note``."""

    poses: tuple[str, ...]
    loads_N: tuple[float, ...]  # noqa: N815 - the unit's letter
    note: str

    def holds(self, pose: str, load_N: float) -> bool:
        """Whether a reading is one of these."""
        return pose in self.poses and bool(np.isclose(load_N, self.loads_N, rtol=0.01).any())


# Of the readings bundled with the XR701, as doe/data/xr701_gotlih.md tells them.
PUBLISHED = (
    Doubt(("3", "4"), (375.0,), "outliers? (about 1.0 mm expected)"),
    Doubt(("39", "40"), (375.0,), "3/4 and 39/40 may be swapped"),
    Doubt(("3", "4", "39", "40"), (650.0,), "3/4 and 39/40 may be swapped"),
)
PUBLISHED_TEXT = (
    "The published chart's labels lost their order. At 375 N and 650 N the pair of poses 3 and 4 and the pair of 39 "
    "and 40 may be swapped with one another. Poses 3 and 4 at 375 N look like outliers: about 1.0 mm would be expected "
    "from the other loads."
)


def doubted(d: Diagnosed, table: Measurements) -> Bools:
    """Which of the readings used (n,) the notes of the set ``table`` or the diagnosis itself doubts."""
    notes = PUBLISHED if is_bundled(d.given.robot, table) else ()
    rows = [any(n.holds(*one) for n in notes) for one in zip(d.used.pose, d.used.loads_N.tolist(), strict=True)]
    out = np.array(rows, dtype=bool)
    out[d.found.before.setting.data.row[d.odd]] = True
    return out
