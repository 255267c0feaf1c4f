"""An arm's controller: how it counts the angles (the model's coordinates are ``q = A p + b``), its frames, its formats.

FANUC's third angle counts from the horizontal, whatever joint 2 does; a parallelogram's motor turns the forearm against
the carousel; gears drag joints 5 and 6 along with joint 4. Everything inside computes in the model's own coordinates.
Where people read or write angles (tables, ``--pose``, sheets, programs) these are taken and given as the controller
has them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from robots.arrays import Array
from robots.errors import InputError, twice
from robots.frames import framed, rotation_rpy
from robots.schema.controller import Controller, Placed

if TYPE_CHECKING:
    from robots.robot import Robot

# Below this share of the largest singular value, two of the controller's angles are one.
_SINGULAR = 1e-9


@dataclass(frozen=True, eq=False)
class ArmController:
    """``q = matrix @ p + offset``, rad: model coordinates q from the controller's angles p, by their ``names``.

    ``formats``: program formats that it reads; ``T_base`` (4, 4) m: its robot frame in the model's base frame, None
    where that is not known; ``T_flange``: its flange frame in the model's.
    """

    names: tuple[str, ...]
    matrix: Array
    offset: Array
    formats: tuple[str, ...]
    T_base: Array | None
    T_flange: Array

    def model(self, p: Array) -> Array:
        """Coordinates (n, dof) rad of the model from the controller's angles (n, dof) rad."""
        return np.asarray(p @ self.matrix.T + self.offset)

    def controller(self, q: Array) -> Array:
        """Angles (n, dof) rad as the controller counts them, of model coordinates (n, dof) rad."""
        return np.asarray(np.linalg.solve(self.matrix, (np.asarray(q) - self.offset).T).T)

    @property
    def coupled(self) -> tuple[int, ...]:
        """Coordinates, by index, that take more than their own angle."""
        own = np.eye(len(self.names), dtype=bool)
        return tuple(int(i) for i in np.flatnonzero((np.where(own, 0.0, self.matrix) != 0.0).any(axis=1)))


def arm_controller(table: Controller | None, coordinates: Sequence[str], robot: str) -> ArmController | None:
    """The ``[controller]`` table of a robot with these ``coordinates``; None where there is none.

    Raises
    ------
    InputError
        Another number of axes than joints, a name twice, one that is unknown, or angles that do not determine the
        coordinates.
    """
    if table is None:
        return None
    if table.angle and not table.axes:
        raise InputError(
            f"{robot}: [controller] has [[controller.angle]] but no axes",
            code="R003",
            allowed=f"axes = [...], {len(coordinates)} names ending in _deg",
            remedy="name the controller's angles, one for each joint",
        )
    matrix, offset = _counted(table, table.axes or tuple(coordinates), coordinates, robot)
    return ArmController(
        table.axes or tuple(coordinates),
        matrix,
        offset,
        table.formats,
        None if table.base is None else _frame(table.base),
        np.eye(4) if table.flange is None else _frame(table.flange),
    )


def shown_tool(robot: Robot) -> Array:
    """The frame (4, 4) m in the model's flange frame whose place the controller shows.

    That is the model's tool; without one, the controller's own flange frame.
    """
    if robot.controller is None or not np.array_equal(robot.T_flange_tool, np.eye(4)):
        return robot.T_flange_tool
    return robot.controller.T_flange


def shown_base(robot: Robot) -> Array:
    """The controller's robot frame (4, 4) m in the model's base frame; that frame itself where it is not known."""
    known = None if robot.controller is None else robot.controller.T_base
    return np.eye(4) if known is None else known


def _frame(placed: Placed) -> Array:
    turn = np.zeros(3) if placed.rpy is None else placed.rpy.si_array
    return framed(rotation_rpy(turn), placed.xyz.si_array)


def _counted(table: Controller, names: Sequence[str], coordinates: Sequence[str], robot: str) -> tuple[Array, Array]:
    """A (dof, dof) and b (dof,) rad of ``q = A p + b``."""
    where = f"{robot}: [controller] axes"
    if len(names) != len(coordinates) or twice(names):
        raise InputError(
            where,
            code="R003",
            value=", ".join(names),
            allowed=f"{len(coordinates)} different names, one for each joint",
            remedy="name each of the controller's angles once, in the joints' order",
        )
    matrix, offset = np.eye(len(names)), np.zeros(len(names))
    for row in table.angle:
        if row.coordinate not in coordinates:
            raise InputError(
                f"{robot}: [[controller.angle]] coordinate",
                code="R003",
                value=row.coordinate,
                allowed=", ".join(coordinates),
                remedy="name a joint's coordinate",
            )
        i = list(coordinates).index(row.coordinate)
        matrix[i], offset[i] = 0.0, 0.0 if row.offset is None else row.offset.si
        for term in row.terms:
            if term.axis not in names:
                raise InputError(
                    f"{robot}: [[controller.angle]] {row.coordinate}: axis",
                    code="R003",
                    value=term.axis,
                    allowed=", ".join(names),
                    remedy="name one of the axes",
                )
            matrix[i, list(names).index(term.axis)] += term.factor
    for j, name in enumerate(names):
        if name in coordinates and not (coordinates[j] == name and _same(matrix[j], offset[j], j)):
            raise InputError(
                where,
                code="R003",
                value=name,
                allowed="the same name only where both count the same angle",
                remedy="give the controller's angle a name of its own, as in J3_deg",
            )
    size = np.linalg.svd(matrix, compute_uv=False)
    if size[-1] < _SINGULAR * size[0]:
        raise InputError(
            f"{robot}: [[controller.angle]]",
            code="R003",
            value=matrix.tolist(),
            allowed="factors by which the controller's angles determine all coordinates",
            remedy="check the factors: two rows say the same",
        )
    return matrix, offset


def _same(row: Array, offset: float, index: int) -> bool:
    return offset == 0.0 and row[index] == 1.0 and np.count_nonzero(row) == 1
