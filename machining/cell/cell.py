"""The machining cell: where robot, part and fixtures stand, what carries them, the tool on the flange.

World frame: any frame of the shop floor with z up. Linear axes carry the robot, in their order from the floor to its
base; their directions do not turn, so their travels add up. A turntable carries the part. All surfaces are given
where they stand in the world with every external axis at 0. SI inside: m, rad, m/s, rad/s.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from machining.cell.schema import CommandsTable, MovesTable
from machining.inputs import as_frame, as_units
from robots import InputError, require_at_least, require_positive
from robots.arrays import Array, Bools, finite
from robots.frames import inverse

if TYPE_CHECKING:
    from machining.cell.solids import Body

MOST_LINEAR_AXES = 3
# Name that stands for the floor in pairs of bodies.
FLOOR = "floor"
# A travel on its limit must not fail by rounding.
LIMIT_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class Load:
    """What the flange carries: ``mass`` kg, its ``centre`` (3,) m in the flange frame.

    ``inertia`` (3,) kg m^2 about axes through the centre, parallel to the flange's; None: not known.
    """

    mass: float
    centre: Array
    inertia: Array | None = None


@dataclass(frozen=True, eq=False)
class Tool:
    """Tool on the flange: ``T_flange_tool`` (4, 4) m with its origin at the tip, bodies in the flange frame.

    ``holder``: spindle, holder and whatever else may touch nothing. ``cutter``: bodies that may touch the part.
    ``number`` and ``name``: what the tool changer and tool paths call it, where there are several; ``milling``: its
    milling file. ``load``: its weight and that of what carries it, None: not known.
    """

    T_flange_tool: Array = field(default_factory=lambda: np.eye(4))
    holder: tuple[Body, ...] = ()
    cutter: tuple[Body, ...] = ()
    number: int | None = None
    name: str = ""
    milling: Path | None = None
    load: Load | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_flange_tool", as_frame("tool frame on the flange", self.T_flange_tool))


@dataclass(frozen=True, eq=False)
class Fixture:
    """Something that stands in the cell; ``on_turntable``: it turns with the part."""

    body: Body
    on_turntable: bool = False


@dataclass(frozen=True, eq=False)
class LinearAxis:
    """A linear axis that carries what comes after it.

    ``direction`` (3,) in the world, made a unit vector; ``limits`` (2,) m; ``speed`` m/s and ``acceleration`` m/s^2,
    None where not known; ``compliance`` (6,): three m/N and three rad/(N m) along and about the world's axes at the
    carriage, None: stiff; ``carriage``: the moving body, in the world with all axes at 0.

    Raises
    ------
    InputError
        A direction of length zero, limits that are not a rising pair, figures that are not positive.
    """

    name: str
    direction: Array
    limits: Array
    speed: float | None = None
    acceleration: float | None = None
    compliance: Array | None = None
    carriage: Body | None = None

    def __post_init__(self) -> None:
        where = f"linear axis {self.name}"
        object.__setattr__(self, "direction", as_units(f"{where}: direction", self.direction, 1)[0])
        object.__setattr__(self, "limits", _range(f"{where}: limits (m)", self.limits))
        _rates(where, "m", self.speed, self.acceleration)
        if self.compliance is not None:
            c = np.asarray(self.compliance, dtype=np.float64)
            if c.shape != (6,) or not (np.isfinite(c) & (c >= 0.0)).all():
                allowed = "six figures of 0 or more: three in m/N, three in rad/(N m)"
                raise InputError(f"{where}: compliance", code="K001", value=c.tolist(), allowed=allowed)
            object.__setattr__(self, "compliance", c)


@dataclass(frozen=True, eq=False)
class Turntable:
    """A turning axis that carries the part: ``point`` (3,) m on it and ``axis`` (3,), in the world.

    ``limits`` (2,) rad, None: it turns without end. ``speed`` rad/s, ``acceleration`` rad/s^2. Errors as
    :class:`LinearAxis`.
    """

    point: Array
    axis: Array
    limits: Array | None = None
    speed: float | None = None
    acceleration: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", finite("point of the turntable's axis", self.point, (3,), "m"))
        object.__setattr__(self, "axis", as_units("axis of the turntable", self.axis, 1)[0])
        if self.limits is not None:
            object.__setattr__(self, "limits", _range("limits of the turntable (rad)", self.limits))
        _rates("turntable", "rad", self.speed, self.acceleration)


@dataclass(frozen=True, eq=False)
class Cell:
    """A cell; without arguments an empty one, robot and part in the world frame's origin, flange as tool.

    Attributes
    ----------
    T_world_base0 : (4, 4) m, the robot's base with all linear axes at 0
    T_world_part0 : (4, 4) m, the part frame with the turntable at 0
    tool : what is on the flange
    tools : what a tool changer puts there instead, each with a number or a name; none: always ``tool``
    part : the part or its raw stock, in the world with the turntable at 0; None: no surface known
    fixtures : what else stands there
    floor : height of the floor in the world, m; None: no floor
    stands : where there is no floor, the plane that the robot stands on (z = 0 of its base) counts as one
    beam_radius : m of the capsules that stand for bodies without a shape; None: by the arm's size, 0: none
    linear_axes : at most three, from the floor to the robot
    turntable : None: the part stands still
    joint_speed : rad/s, one or (dof,), None: not known; ``joint_acceleration`` rad/s^2 likewise
    home : (dof,) rad, a pose in which nothing collides; None: the middle of the joint ranges
    safety : distance (m) that a user wants kept; nothing here adds it to bodies
    allowed_contacts : pairs of body names that are not checked against each other; ``"floor"`` is one too
    commands : outputs, inputs and routines of the robot's controller for spindle, coolant, probe and tool changer
    moves : how programs begin and end

    Raises
    ------
    InputError
        A frame that is not rigid, more than three linear axes, a name used twice, figures out of range.
    """

    name: str = "cell"
    T_world_base0: Array = field(default_factory=lambda: np.eye(4))
    T_world_part0: Array = field(default_factory=lambda: np.eye(4))
    tool: Tool = field(default_factory=Tool)
    part: Body | None = None
    fixtures: tuple[Fixture, ...] = ()
    floor: float | None = None
    stands: bool = False
    beam_radius: float | None = None
    linear_axes: tuple[LinearAxis, ...] = ()
    turntable: Turntable | None = None
    joint_speed: ArrayLike | None = None
    joint_acceleration: ArrayLike | None = None
    safety: float = 0.0
    home: Array | None = None
    allowed_contacts: tuple[tuple[str, str], ...] = ()
    commands: CommandsTable = field(default_factory=CommandsTable)
    tools: tuple[Tool, ...] = ()
    moves: MovesTable = field(default_factory=MovesTable)

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_base0", as_frame("robot frame in the world", self.T_world_base0))
        object.__setattr__(self, "T_world_part0", as_frame("part frame in the world", self.T_world_part0))
        if len(self.linear_axes) > MOST_LINEAR_AXES:
            raise InputError(
                "linear axes", code="K001", value=len(self.linear_axes), allowed=f"at most {MOST_LINEAR_AXES}"
            )
        if self.floor is not None and not np.isfinite(self.floor):
            raise InputError(
                "height of the floor (m)", code="K001", value=self.floor, allowed="a finite number, or no floor"
            )
        if self.beam_radius is not None:
            require_at_least("radius of beams (m)", self.beam_radius, 0.0, code="K001")
        require_at_least("safety distance (m)", self.safety, 0.0, code="K001")
        for what, rate in (("joint speeds", self.joint_speed), ("joint accelerations", self.joint_acceleration)):
            if rate is not None and not (np.asarray(rate, dtype=np.float64) > 0.0).all():
                raise InputError(what, code="K001", value=rate, allowed="more than 0")
        if self.turntable is None and any(f.on_turntable for f in self.fixtures):
            raise InputError("fixture on the turntable", code="K001", allowed="only in a cell with a turntable")
        names = [body.name for body in self.bodies] + [axis.name for axis in self.linear_axes] + [FLOOR]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(
                "name in the cell", code="K001", value=", ".join(twice), allowed="each once; the floor has one too"
            )

    def with_tool(self, tool: Tool) -> Cell:
        """The cell while this tool is on the flange."""
        return self if tool is self.tool else replace(self, tool=tool)

    @property
    def bodies(self) -> tuple[Body, ...]:
        """All bodies of the cell: part, fixtures, carriages, tool."""
        carriages = [axis.carriage for axis in self.linear_axes]
        given = chain([self.part], (f.body for f in self.fixtures), carriages, self.tool.holder, self.tool.cutter)
        return tuple(body for body in given if body is not None)

    # Methods carry the letters of their matrices, as arrays do.
    def T_world_base(self, e: ArrayLike | None = None) -> Array:  # noqa: N802
        """Robot base in the world (n, 4, 4) for travels e (n, k) m of the k linear axes; None: all 0, n = 1.

        Limits are not checked here. Raises InputError for another shape or travels that are not finite.
        """
        moved = self.carried(e)
        T = np.broadcast_to(self.T_world_base0, (len(moved), 4, 4)).copy()
        T[:, :3, 3] += moved[:, -1]
        return T

    def carried(self, e: ArrayLike | None = None) -> Array:
        """Displacement (n, k + 1, 3) m in the world: row 0 of the floor, row i behind linear axis i."""
        k = len(self.linear_axes)
        travel = finite("travels of the linear axes", np.zeros((1, k)) if e is None else e, ("n", k), "m")
        steps = np.zeros((len(travel), k + 1, 3))
        for i, axis in enumerate(self.linear_axes):
            steps[:, i + 1] = travel[:, i, None] * axis.direction
        return np.asarray(np.cumsum(steps, axis=1))

    def T_world_table(self, table: ArrayLike | None = None) -> Array:  # noqa: N802
        """Displacement (n, 4, 4) in the world of what the turntable carries, at angles (n,) rad; None: 0, n = 1.

        Raises
        ------
        InputError
            Another shape, angles that are not finite, or an angle other than 0 without a turntable.
        """
        angle = finite("angles of the turntable", np.zeros(1) if table is None else np.atleast_1d(table), ("n",), "rad")
        T = np.broadcast_to(np.eye(4), (len(angle), 4, 4)).copy()
        if self.turntable is None:
            if angle.any():
                raise InputError("angle of the turntable", code="K001", allowed="0: this cell has none")
            return T
        x, y, z = self.turntable.axis
        K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        sin, cos = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
        T[:, :3, :3] = np.eye(3) + sin * K + (1.0 - cos) * (K @ K)
        T[:, :3, 3] = self.turntable.point - T[:, :3, :3] @ self.turntable.point
        return T

    def T_world_part(self, table: ArrayLike | None = None) -> Array:  # noqa: N802
        """Part frame in the world (n, 4, 4) at the turntable's angles; errors as :meth:`T_world_table`."""
        return np.asarray(self.T_world_table(table) @ self.T_world_part0)

    def T_base_part(self, e: ArrayLike | None = None, table: ArrayLike | None = None) -> Array:  # noqa: N802
        """Part frame in the robot's base (n, 4, 4); one row of travels or angles goes with all of the other."""
        return np.asarray(inverse(self.T_world_base(e)) @ self.T_world_part(table))

    def inside_limits(self, e: ArrayLike | None = None, table: ArrayLike | None = None) -> Bools:
        """Whether travels and angles keep the limits, (n,)."""
        travel = np.zeros((1, len(self.linear_axes))) if e is None else np.asarray(e, dtype=np.float64)
        self.carried(travel)
        ok = np.ones(len(travel), dtype=np.bool_)
        for axis, column in zip(self.linear_axes, travel.T, strict=True):
            ok &= _within(column, axis.limits)
        angle = np.zeros(1) if table is None else np.atleast_1d(np.asarray(table, dtype=np.float64))
        if self.turntable is not None and self.turntable.limits is not None:
            return np.asarray(ok & _within(angle, self.turntable.limits))
        return np.asarray(ok & np.isfinite(angle))


def _within(value: Array, limits: Array) -> Bools:
    return np.asarray((value >= limits[0] - LIMIT_TOLERANCE) & (value <= limits[1] + LIMIT_TOLERANCE))


def _range(what: str, limits: ArrayLike) -> Array:
    pair = np.asarray(limits, dtype=np.float64)
    if pair.shape != (2,) or not np.isfinite(pair).all() or not pair[0] < pair[1]:
        raise InputError(what, code="K001", value=pair.tolist(), allowed="a pair [lower, upper] with lower < upper")
    return pair


def _rates(where: str, unit: str, speed: float | None, acceleration: float | None) -> None:
    for what, value in ((f"speed ({unit}/s)", speed), (f"acceleration ({unit}/s^2)", acceleration)):
        require_positive(f"{where}: {what}", value, code="K001")
