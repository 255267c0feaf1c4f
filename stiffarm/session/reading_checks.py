"""What commands ask of a measurement table before they take it: signs, units for this class of arm, that it tells.

And what a table does not say that effects ask for.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from doe import Measurements
from doe.certainty.doubts import Doubt
from doe.estimation.problem import problem
from doe.plausibility.passive_arm import refuse_frozen, refuse_telling_nothing
from doe.plausibility.stated_scatter import sigma_doubt
from doe.plausibility.units_check import check_units, class_doubt
from doe.tables.checks import work_done
from fem.arm import Arm
from fem.effects import History, PlacedEffect
from fem.statics.small_displacements import LIMIT, refuse_beyond, turn
from robots import InputError
from stiffarm.session.console import say

FEWEST, LISTED = 3, 10
# A reading against its load by less than this (m/N) is noise about zero; arms give 20 times as much and more.
STILL = 2e-8


def check_readings(given: Arm, data: Measurements, *, confirm_units: bool = False) -> None:
    """Refuse a table that no arm like this gives as it is typed; remark on readings against their load.

    ``confirm_units``: the user has checked the units; what looks like others is remarked on.

    Raises
    ------
    InputError
        Most readings move against their load, look like other units, are beyond small displacements, or scatter by
        something quite else than their sigma_mm.
    """
    refuse_against_load(data)
    notes = check_units(given.description, given.model, data, confirm_units=confirm_units)
    refuse_large(given, data)
    sigma_doubt(given.model, data, confirmed=confirm_units)
    for remark in (against_load(data), *notes):
        if remark is not None:
            say(f"note: {remark}")


def reading_doubts(given: Arm, data: Measurements) -> tuple[Doubt, ...]:
    """What readings that are taken say against themselves: size for this class of arm, scatter against sigma_mm."""
    found = class_doubt(given.description, given.model, data), sigma_doubt(given.model, data)
    return tuple(one for one in found if one is not None)


def refuse_useless(given: Arm, table: Measurements, used: Measurements, history: History | None = None) -> None:
    """Refuse a table in which a gauge stood still, and readings of it, those ``used``, that tell nothing.

    ``history`` of those used, by default what the table says.

    Raises
    ------
    InputError
        Naming file, column and value, or what of the readings is left beside any passive arm.
    """
    p = problem(given.model, used, (), history=history)
    refuse_frozen(given.model, table, p if used is table else None)
    refuse_telling_nothing(p, used.source)


def refuse_against_load(data: Measurements) -> None:
    """Raise InputError if most readings move against their load.

    Only readings in every direction that is loaded tell: the work of the load is known there. A passive arm never
    moves against a load as a whole, so a calibration would drive every spring to its rigid end and look calm.
    """
    work, known = work_done(data)
    against, told = int((work[known] < 0.0).sum()), int(known.sum())
    if told >= FEWEST and 2 * against > told:
        raise InputError(
            f"{data.source}: {against} of {told} readings move against the load",
            code="T012",
            allowed="deflections along the load, as those of every passive arm",
            remedy="check the sign of the load and reading columns (a downward load has fz_N < 0 and gives dz_mm < 0)",
        )


def refuse_large(given: Arm, data: Measurements) -> None:
    """Raise InputError if most readings are beyond small displacements: nothing linear can be told from them."""
    turned = turn(given.robot, data.displacement)
    if len(turned) and np.median(turned) > LIMIT:
        middle = np.argsort(turned)[len(turned) // 2 :][:1]
        refuse_beyond(given.robot, data.displacement[middle], f"{data.source}, row {data.row_numbers[middle[0]]}")


def against_load(data: Measurements) -> str | None:
    """A remark on readings that move against their load by more than a gauge's noise would; None if none do.

    Few of them may be slips of the pen; a calibration gives them little weight if it can.
    """
    work, known = work_done(data)
    odd = np.flatnonzero(known & (work < 0.0) & (np.abs(work) >= STILL * data.loads_N**2))
    if not odd.size:
        return None
    rows = ", ".join(str(data.row_numbers[i]) for i in odd[:LISTED]) + (" ..." if odd.size > LISTED else "")
    return f"{data.source}: {odd.size} of {known.sum()} readings move against their load: the sign? Rows {rows}"


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
