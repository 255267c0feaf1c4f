"""Force of a tool that goes into the part along its own axis: plunging and drilling.

The end teeth cut over the radius R of the tool, each a chip as thick as the feed per tooth c, with linear edge forces
as in :mod:`machining.cutting.end_mill`: ``F = z R (K_pc c + K_pe)``, z teeth, along the tool from the tip into the
holder. Forces across the tool cancel over the teeth. The coefficients are those of the end teeth, or of a drill's two
lips; the coefficients of peripheral milling say nothing about them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from machining.cutting.force import ASSUMED_SD, CuttingForce, ForceAlong, MillingForce
from machining.task import Task
from robots import InputError
from robots.arrays import Array, Bools, Integers

NAMES = ("K_pc", "K_pe")


@dataclass(frozen=True, eq=False)
class Thrust:
    """Force of a milling force's tool that plunges all along a path.

    Raises
    ------
    InputError
        The milling force has no coefficients for plunging.
    """

    force: MillingForce

    def __post_init__(self) -> None:
        if self.force.plunge is None:
            raise InputError(
                "force of a tool that plunges or drills",
                code="K007",
                value="no coefficients",
                allowed="milling that goes sideways, or the coefficients of the end teeth",
                remedy="add the table [plunge] to the milling file, or give --force in base or part axes",
            )

    def along(self, task: Task) -> ForceAlong:
        """See :class:`machining.cutting.CuttingForce`. Raises InputError where the path has no feed."""
        return self.at(task, np.arange(task.path.n))

    def at(self, task: Task, rows: Integers) -> ForceAlong:
        """The force at some points, zero at others; errors as :meth:`along`."""
        given = self.force.plunge
        assert given is not None  # noqa: S101 - checked when made
        mill = self.force.mill
        width = 0.5 * mill.diameter * mill.teeth
        basis = np.zeros((task.path.n, 2, 3))
        if len(rows):
            chip = self.force.chip(task.at(rows))
            basis[rows] = width * np.stack([chip, np.ones(len(rows))], axis=1)[..., None] * task.axes[rows, None]
        values = np.array([given.chip, given.edge])
        said = ", assumed" if given.relative_sd == ASSUMED_SD else ""
        note = f"plunging coefficients: standard deviation {100 * given.relative_sd:g} % each, independent{said}"
        covariance = np.diag((given.relative_sd * values) ** 2)
        return ForceAlong(basis, values, covariance, NAMES, f"{note}; source of the values: {given.source}")


def with_thrust(found: ForceAlong | None, force: CuttingForce, task: Task, plunging: Bools) -> ForceAlong | None:
    """A force along a path (None: nothing is milled) with that of the moves (n,) that plunge, where it is known."""
    if not isinstance(force, MillingForce) or force.plunge is None or not plunging.any():
        return found
    rows = np.flatnonzero(plunging)
    more = Thrust(force).at(task, rows)
    if found is None:
        return more
    basis: Array = np.concatenate([found.basis, more.basis], axis=1)
    # Where the tool plunges nothing is milled sideways.
    basis[rows, : found.basis.shape[1]] = 0.0
    return replace(
        found,
        basis=basis,
        value=np.append(found.value, more.value),
        covariance=block_diag(found.covariance, more.covariance),
        names=(*found.names, *more.names),
        note=f"{found.note}; {more.note}",
    )
