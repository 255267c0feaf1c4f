"""A sweep of many points in parts: the memory stays bounded, whatever the number of points."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

import fem
from machining.posture.points import Sweep, sweep_gamma
from machining.stiffness.objective import Objective
from machining.task import Task
from robots import InputError
from robots.arrays import Array, finite
from robots.progress import Progress, report_progress

# Points x angles of one part, each with up to eight poses: some 100 MB with rigid links.
TARGETS = 20_000
# Points x angles of a whole map: one figure each, kept.
MOST = 20_000_000


def sweep_parts(
    model: fem.ArmModel,
    task: Task,
    objective: Objective,
    gamma: ArrayLike,
    *,
    generator: np.random.Generator | None = None,
    progress: Progress | None = None,
    targets: int = TARGETS,
) -> Iterator[tuple[slice, Task, Sweep]]:
    """Sweeps of consecutive points of a task, with the rows and the task of each; gamma (m,) rad is that of all.

    ``progress``: called with points done and points in all.

    Raises
    ------
    InputError
        Angles of another shape, a map too large to hold; else as :func:`machining.posture.points.sweep_gamma`.
    """
    angle, n = finite("gamma", gamma, ("m",), "rad"), task.path.n
    if n * len(angle) > MOST:
        raise InputError(
            "map",
            code="S011",
            value=f"{n} points x {len(angle)} angles gamma",
            allowed=f"{MOST} in all",
            remedy="make the step of the grid or of gamma larger",
        )
    rows = max(1, targets // len(angle))
    for first in range(0, n, rows):
        part = slice(first, min(first + rows, n))
        some = task.at(part)
        yield part, some, sweep_gamma(model, some, _forces(objective, part, n), angle, generator=generator)
        report_progress(progress, part.stop, n)


def _forces(objective: Objective, part: slice, n: int) -> Objective:
    force: Array | None = objective.forces(n)
    return objective if force is None else replace(objective, force=force[part])
