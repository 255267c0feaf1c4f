"""Readings that are in doubt, by the notes of their set or by the diagnosis itself, and what is found without them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from doe import Measurements
from doe.diagnosis.hypotheses import Kind
from doe.tables.notes import bundled_notes
from robots import InputError
from robots.arrays import Bools
from stiffarm.commands.diagnose import step
from stiffarm.commands.diagnose.step import Diagnosed
from stiffarm.session.steps import is_bundled


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
    notes = bundled_notes(d.given.robot.name).doubts if is_bundled(d.given.robot, table) else ()
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
