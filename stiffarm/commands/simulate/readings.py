"""Every reading of a table, simulated against measured."""

from __future__ import annotations

from typing import Any

import numpy as np

from doe import Measurements
from doe.tables.loaded import history_of, simulate
from fem.arm import Arm
from robots.arrays import Array
from stiffarm.commands.simulate.step import head
from stiffarm.session.console import say_notes
from stiffarm.session.json_text import number
from stiffarm.session.parsing import DISPLACEMENT_NAMES
from stiffarm.session.reading_checks import history_notes
from stiffarm.session.softness import flagged


def of_table(given: Arm, data: Measurements, rigid_joints: bool) -> dict[str, Any]:
    """Simulated against measured for every reading."""
    model = given.model.with_rigid_joints() if rigid_joints else given.model
    history = history_of(data)
    d = simulate(model, data, () if rigid_joints else given.effects, history)
    notes = [] if rigid_joints else history_notes(given.effects, history)
    say_notes(notes)
    marks = flagged(model.robot, d, "simulated readings")
    rows: list[dict[str, Any]] = []
    for i in range(data.n):
        row: dict[str, Any] = {
            "line": data.row_numbers[i],
            "pose": data.pose[i],
            "load_N": number(float(data.loads_N[i])),
        }
        for k in np.flatnonzero(data.used[i]):
            row[f"{DISPLACEMENT_NAMES[k]}_measured"] = number(data.displacement[i, k] * 1e3)
            row[f"{DISPLACEMENT_NAMES[k]}_simulated"] = number(d[i, k] * 1e3)
        rows.append(row | marks[i])
    error = (d - data.displacement) * 1e3
    return head(given, model, rigid_joints) | {
        "notes": [*data.notes, *notes],
        "rms_mm": _rms(error[:, :3][data.used[:, :3]]),
        "rms_mrad": _rms(error[:, 3:][data.used[:, 3:]]),
        "readings": rows,
    }


def _rms(error: Array) -> float | None:
    return number(float(np.sqrt(np.mean(error**2)))) if error.size else None
