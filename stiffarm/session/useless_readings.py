"""Readings that no number of an arm should come from, whichever command is asked for one."""

from __future__ import annotations

from doe import Measurements
from doe.estimation.problem import problem
from doe.tables.frozen import refuse_frozen
from doe.tables.telling import refuse_telling_nothing
from fem.arm import Arm


def refuse_useless(given: Arm, table: Measurements, used: Measurements) -> None:
    """Refuse a table in which a gauge stood still, and readings of it, those ``used``, that tell nothing.

    Raises
    ------
    InputError
        Naming file, column and value, or what of the readings is left beside any passive arm.
    """
    refuse_frozen(given.model, table)
    refuse_telling_nothing(problem(given.model, used, ()), used.source)
