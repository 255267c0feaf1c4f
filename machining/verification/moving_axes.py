"""All axes of a cell as columns of one table: joints, then linear axes, then the turntable."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from machining.cell import Cell
from machining.programs.program import JointProgram
from robots import Robot
from robots.arrays import Array, Bools


@dataclass(frozen=True, eq=False)
class MovingAxes:
    """Names and bounds of a axes: dof joints, k linear axes, and the turntable if there is one.

    ``lower``, ``upper`` (a,) rad or m; ``speed`` (a,) and ``acceleration`` (a,), inf where not known; ``linear`` (a,)
    says which are in m.
    """

    names: tuple[str, ...]
    lower: Array
    upper: Array
    speed: Array
    acceleration: Array
    linear: Bools
    dof: int
    travels: int

    @property
    def count(self) -> int:
        """Number of axes."""
        return len(self.names)

    def unit(self, axis: int, per: str = "") -> str:
        """Unit of an axis, as in "rad/s"."""
        return ("m" if self.linear[axis] else "rad") + per

    def table(self, q: Array, travel: Array, table: Array) -> Array:
        """Columns (n, a) of q (n, dof), travel (n, k) and table (n,)."""
        return np.concatenate([q, travel, table[:, None]], axis=1)[:, : self.count]

    def parts(self, values: Array) -> tuple[Array, Array, Array]:
        """Undo :meth:`table`; the turntable stands at 0 where there is none."""
        k = self.dof + self.travels
        table = values[:, k] if self.count > k else np.zeros(len(values))
        return values[:, : self.dof], values[:, self.dof : k], table

    def of(self, program: JointProgram) -> Array:
        """Coordinates (n, a) of all axes at a program's points."""
        return self.table(program.q, program.travel, program.table)


def moving_axes(robot: Robot, cell: Cell) -> MovingAxes:
    """Axes of a robot in its cell."""
    table = cell.turntable
    names = [name.removesuffix("_deg") for name in robot.coordinates] + [axis.name for axis in cell.linear_axes]
    bounds = [robot.limits, *(axis.limits[None] for axis in cell.linear_axes)]
    speed = [_each(cell.joint_speed, robot.dof), *(_known(axis.speed) for axis in cell.linear_axes)]
    rate = [_each(cell.joint_acceleration, robot.dof), *(_known(axis.acceleration) for axis in cell.linear_axes)]
    linear = [False] * robot.dof + [True] * len(cell.linear_axes)
    if table is not None:
        names.append("turntable")
        bounds.append(np.array([[-np.inf, np.inf]]) if table.limits is None else table.limits[None])
        speed.append(_known(table.speed))
        rate.append(_known(table.acceleration))
        linear.append(False)
    limits = np.concatenate(bounds)
    return MovingAxes(
        tuple(names),
        limits[:, 0],
        limits[:, 1],
        np.concatenate(speed),
        np.concatenate(rate),
        np.array(linear),
        robot.dof,
        len(cell.linear_axes),
    )


def _each(rate: object, dof: int) -> Array:
    return np.broadcast_to(np.asarray(np.inf if rate is None else rate, dtype=np.float64), (dof,))


def _known(rate: float | None) -> Array:
    return np.array([np.inf if rate is None else rate])
