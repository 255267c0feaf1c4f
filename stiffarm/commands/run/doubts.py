"""Readings that are in doubt, by the notes of their set or by the diagnosis itself, and what is found without them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from doe import Measurements
from doe.diagnosis.hypotheses import Kind
from robots import InputError
from robots.arrays import Bools
from stiffarm.commands.diagnose import step
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
    "from the other loads. If the pairs are swapped, readings at 650 N do not ask for the load path: for the serial "
    "chain nothing missing is the most probable then, with 76 %."
)


@dataclass(frozen=True)
class Without:
    """What a diagnosis says without the readings in doubt. ``readings``: those, in words.

    ``codes``: effects named; ``likely``: those that are at least taken up.
    """

    verdict: Kind
    codes: tuple[str, ...]
    likely: tuple[str, ...]
    readings: str


def doubted(d: Diagnosed, table: Measurements) -> Bools:
    """Which of the readings used (n,) the notes of the set ``table`` or the diagnosis itself doubts."""
    notes = PUBLISHED if is_bundled(d.given.robot, table) else ()
    rows = [any(n.holds(*one) for n in notes) for one in zip(d.used.pose, d.used.loads_N.tolist(), strict=True)]
    out = np.array(rows, dtype=bool)
    out[d.found.before.setting.data.row[d.odd]] = True
    return out


def without_doubted(d: Diagnosed, table: Measurements) -> Without | None:
    """The same diagnosis without the readings in doubt; None where there are none."""
    rows = doubted(d, table)
    if not rows.any() or not d.tells:
        return None
    places = [f"{d.used.pose[k]} at {d.used.loads_N[k]:g} N" for k in np.flatnonzero(rows)]
    words = f"{len(places)} of {d.used.n} readings (pose {', '.join(places)})"
    try:
        request = replace(d.request, next_poses=0, folds=0)
        found = step.diagnose(d.given, d.used.select(~rows), request).found
    except InputError:
        return Without("uninformative", (), (), words)
    codes, likely = (tuple(f.code for f in some) for some in (found.effects, found.found))
    return Without(found.verdict, codes, likely, words)
