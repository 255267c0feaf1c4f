"""What a model says of each reading of a table."""

from __future__ import annotations

from collections.abc import Sequence

from doe.published.readings import loaded_points
from doe.tables.load_history import history_of
from doe.tables.measurements import Measurements
from fem import ArmModel
from fem.effects import History, PlacedEffect, observed
from fem.statics.loads import as_loaded
from robots.arrays import Array


def simulate(
    model: ArmModel, data: Measurements, effects: Sequence[PlacedEffect] = (), history: History | None = None
) -> Array:
    """Simulated displacement (n, 6) of every reading; ``history``: by default what the table says of it."""
    at = as_loaded(model, data.q, data.wrench, loaded_points(model, data))
    return observed(model, at, effects, history or history_of(data))
