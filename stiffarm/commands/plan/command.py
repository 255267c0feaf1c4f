"""Which set-ups or poses to measure next, and a sheet to write the readings into."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from doe import bundled_data
from fem.arm import Arm
from robots import InputError
from stiffarm.capability import capability
from stiffarm.commands.plan.request import PlanRequest
from stiffarm.commands.plan.results import result
from stiffarm.commands.plan.step import make_plan
from stiffarm.request import readings_asked
from stiffarm.result import Result
from stiffarm.session.console import progress


def answer(given: Arm, asked: PlanRequest) -> Result:
    """The set-ups that tell most beyond the readings so far, or poses to read with a tracker."""
    asked.check_task()
    if asked.positions is not None:
        from stiffarm.commands.plan.positions import plan_positions

        return plan_positions(given, asked.campaign(given))
    source = asked.data
    if source is None:
        # A first campaign where none are bundled.
        with suppress(InputError):
            source = bundled_data(given.robot.name)
    none_there = source is None or asked.without_data
    table = None if none_there else readings_asked(given, source, confirm_units=asked.confirm_units)
    with progress("choosing set-ups") as bar:
        planned = make_plan(given, table, asked, bar)
    return result(given, table, asked.data if isinstance(asked.data, Path) else None, planned)


plan = capability("plan", PlanRequest, answer)
