"""What is said of effects on the command line."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fem.effects import History, PlacedEffect


def history_notes(effects: Sequence[PlacedEffect], history: History) -> list[str]:
    """What a table does not say that effects ask for: order of the loads, time."""
    notes = []
    memory = [e.effect.code for e in effects if e.effect.needs_history]
    if memory and not history.is_known:
        notes.append(
            f"{', '.join(memory)}: the table does not say of every reading whether it was loading or unloading "
            "(columns phase or step): those are taken as loadings from zero"
        )
    timed = [e.effect.code for e in effects if e.effect.needs_clock]
    if timed and np.isnan(history.clock).any():
        notes.append(
            f"{', '.join(timed)}: the table has no step that counts through the whole campaign: nothing drifts"
        )
    return notes
