"""A set-up for machining: the cell, the arm's bodies in it, and what that means for how the arm is driven."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

import machining.cell as cells
from machining.posture.drive import Drive
from machining.task import Task, ToolPath
from robots.arrays import Array

if TYPE_CHECKING:
    from machining.cell import ArmBodies, Cell

# Clearance is weighed from this many times the safety distance on, and from this far at least, m.
ZONE = 3.0
LEAST_ZONE = 0.02


def weighed_zone(safety: float) -> float:
    """Distance (m) from which on clearance is weighed where ``safety`` m is to be kept."""
    return max(ZONE * safety, LEAST_ZONE)


@dataclass(frozen=True, eq=False)
class Setup:
    """A cell, and the arm's bodies in it; ``arm`` is None where no surfaces are known, so nothing can collide."""

    cell: Cell
    arm: ArmBodies | None = None

    def drive(self, drive: Drive, *, clear: bool = True) -> Drive:
        """The drive with the cell's joint speeds and, if ``clear``, the arm's clearance with all axes at 0."""
        if drive.speed is None and self.cell.joint_speed is not None:
            drive = replace(drive, speed=self.cell.joint_speed)
        if self.arm is None:
            return drive
        zone = weighed_zone(self.cell.safety)
        drive = replace(drive, clearance_zone=zone, clearance_least=self.cell.safety)
        if not clear:
            return drive
        return replace(drive, clearance_of=cells.clearance_of(self.cell, self.arm, within=zone))

    @property
    def notes(self) -> tuple[str, ...]:
        """What is not looked at for collisions."""
        return () if self.arm is None else cells.scene_of(self.cell, self.arm).notes

    def clearance(self, table: float = 0.0) -> Callable[[Array, Array], Array] | None:
        """Clearance (k,) m of poses (k, dof) rad with the linear axes at (k, axes) m; None without surfaces."""
        if self.arm is None:
            return None
        scene, zone = cells.scene_of(self.cell, self.arm), weighed_zone(self.cell.safety)
        return lambda q, e: cells.clearance(scene, q, e, np.array([table]), within=zone).distance

    def task(self, path: ToolPath, reference: Array | None = None) -> Task:
        """The path on the part where the cell has it, all axes at 0; gamma counts from ``reference`` (3,)."""
        return Task(path, self.cell.tool.T_flange_tool, self.cell.T_base_part()[0], reference)
