"""Every reading of a table, simulated against measured."""

from __future__ import annotations

from typing import Any

import numpy as np

from doe import Measurements
from doe.tables.loaded import history_of, simulate
from fem.arm import Arm
from robots.arrays import Array
from robots.quantities import rounded
from stiffarm.commands.simulate.step import head
from stiffarm.session.console import say_notes
from stiffarm.session.parsing import DISPLACEMENT_NAMES
from stiffarm.session.reading_checks import history_notes
from stiffarm.session.softness import flagged

UNITS = {"mm": slice(0, 3), "mrad": slice(3, 6)}


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
            "load_N": rounded(float(data.loads_N[i])),
        }
        for k in np.flatnonzero(data.used[i]):
            row[f"{DISPLACEMENT_NAMES[k]}_measured"] = rounded(data.displacement[i, k] * 1e3)
            row[f"{DISPLACEMENT_NAMES[k]}_simulated"] = rounded(d[i, k] * 1e3)
        rows.append(row | marks[i])
    error = (d - data.displacement) * 1e3
    return head(given, model, rigid_joints) | {
        "notes": [*data.notes, *notes],
        **{f"rms_{unit}": _rms(error[:, of][data.used[:, of]]) for unit, of in UNITS.items()},
        # Both of single components, so that nothing simulated is 100 % off.
        "rms_over_measured": {
            unit: _ratio(error[:, of][data.used[:, of]], 1e3 * data.displacement[:, of][data.used[:, of]])
            for unit, of in UNITS.items()
        },
        "readings": rows,
    }


def _ratio(error: Array, measured: Array) -> float | None:
    return rounded(float(np.linalg.norm(error) / np.linalg.norm(measured))) if np.any(measured) else None


def _rms(error: Array) -> float | None:
    return rounded(float(np.sqrt(np.mean(error**2)))) if error.size else None
