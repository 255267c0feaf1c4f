"""A placement task: what is placed, what for, and the path's task at given base positions."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

import fem
from machining.cell import Cell, Scene
from machining.cutting.each_tool import ForceOfEach
from machining.cutting.force import ByRuns, ConstantForce, CuttingForce
from machining.cutting.process_axes import weights
from machining.cutting.stiffness_uncertainty import StiffnessUncertainty, assumed_uncertainty
from machining.placement.space import Space
from machining.posture.drive import Drive
from machining.posture.points import GammaRange
from machining.setup import Tools
from machining.stiffness.criterion import N_PER_MM, Criterion
from machining.stiffness.objective import Objective
from machining.task import Task, ToolPath
from robots import InputError, require_at_least, require_one_of
from robots.arrays import Array, Bools, Integers

Aim = Literal["ksf", "mean", "worst", "error"]
AIMS: tuple[Aim, ...] = ("ksf", "mean", "worst", "error")
# Directions in which a path's outermost points are always looked at: axes and diagonals.
OUTWARD = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z], dtype=float)


@dataclass(frozen=True, eq=False)
class Goal:
    """What is made large, or small.

    Attributes
    ----------
    aim : "ksf", the criterion of :mod:`machining.stiffness.criterion`; "mean" or "worst" directional stiffness along
    the
        cutting force; "error": least RMS of the surface error along the path
    force : the cutting force; its direction at each point is what stiffness is looked at along
    criterion : weights of K_sf; None: comparable ones for the largest mean stiffness found on the coarse grid
    by_length : sums and means of stiffness by length of path, not by points. Off: eq. 4 counts points, and one path at
        several positions has the same points. Turn it on where a path's points are much denser here than there. The
        surface error is always by length, as in :mod:`machining.cutting.surface_error`

    Raises
    ------
    InputError
        No such aim.
    """

    aim: Aim = "ksf"
    force: CuttingForce = field(default_factory=lambda: ConstantForce(np.array([0.0, 0.0, -100.0])))
    criterion: Criterion | None = None
    by_length: bool = False

    def __post_init__(self) -> None:
        require_one_of("aim of the placement", self.aim, AIMS, code="G004")

    @property
    def minimised(self) -> bool:
        """Whether small is good."""
        return self.aim == "error"

    def share(self, path: ToolPath) -> Array:
        """Part (n,) of sums and means that each point stands for."""
        if self.by_length or self.minimised:
            return weights(path)
        return np.full(path.n, 1.0 / path.n)

    def merit(self, value: Array, share: Array, n: int) -> Array:
        """Large is good (...): of stiffness (N/m) or surface error (m) ``value`` (..., m) at points with ``share``.

        ``n``: points of the whole path.
        """
        if self.aim == "worst":
            return np.asarray(value.min(axis=-1))
        if self.aim == "mean":
            return np.asarray(value @ share)
        if self.aim == "error":
            return np.asarray(-np.sqrt(value**2 @ share))
        return self.weights_of_ksf.value(value, share, n)

    @property
    def weights_of_ksf(self) -> Criterion:
        """The criterion; there must be one."""
        if self.criterion is None:
            raise InputError(
                "weights of K_sf", code="G004", value="none", remedy="give them, or use machining.placement.place"
            )
        return self.criterion

    def gains(self, value: Array, n: int, slope: float) -> Array:
        """What each point adds per share, large is good (...): sums of it rank placements by pieces.

        K_sf is no sum; ``slope`` (mm/N) stands for its second term, see :func:`slopes`. For "worst" it is the value.
        """
        if self.aim == "error":
            return np.asarray(-(value**2))
        if self.aim != "ksf":
            return value
        k = value / N_PER_MM
        return np.asarray(self.weights_of_ksf.alpha * n * k**2 + slope * k)


@dataclass(frozen=True, eq=False)
class Problem:
    """What is placed.

    Attributes
    ----------
    model : the arm, without the compliance of what carries it
    space : where the base may stand
    path : in the part frame
    goal : what for
    gamma : one angle about the tool axis for all points (rad), or a range of which each position takes its best
    drive : limits and costs; its ``clearance_of`` is not used, see ``scene``
    scene : arm and cell for collisions; None: not looked at. ``clearance`` m is kept then
    tools : where tools are changed along the path, what is on the flange where; None: the cell's one tool
    free : (n - 1,) segments that are rapid moves: steps are not bounded there, and the base may be moved
    reference : (3,) direction in the part frame that gamma counts from
    stiffness : how uncertain the arm is, see :func:`machining.cutting.stiffness_uncertainty`; None: 15 % assumed

    Raises
    ------
    InputError
        Free segments of another shape, a clearance that is negative.
    """

    model: fem.ArmModel
    space: Space
    path: ToolPath
    goal: Goal
    gamma: float | GammaRange
    drive: Drive
    scene: Scene | None = None
    clearance: float = 0.0
    free: Bools | None = None
    reference: Array | None = None
    stiffness: StiffnessUncertainty | None = None
    tools: Tools | None = None

    def __post_init__(self) -> None:
        if self.free is not None and self.free.shape != (self.path.n - 1,):
            raise InputError(
                "free segments", code="G004", value=f"shape {self.free.shape}", allowed=f"({self.path.n - 1},)"
            )
        require_at_least("clearance", self.clearance, 0.0, "m", code="G004")

    @property
    def cell(self) -> Cell:
        """The cell."""
        return self.space.cell

    @cached_property
    def arm(self) -> fem.ArmModel:
        """The arm with the compliance of its linear axes under its base."""
        return on_axes(self.model, self.cell)

    @cached_property
    def uncertainty(self) -> StiffnessUncertainty:
        """How uncertain the arm is."""
        return self.stiffness or assumed_uncertainty(self.arm)

    @cached_property
    def angles(self) -> Array:
        """Angles gamma (g,) rad that are looked at."""
        return self.gamma.angles if isinstance(self.gamma, GammaRange) else np.array([float(self.gamma)])

    @cached_property
    def share(self) -> Array:
        """Part (n,) of sums and means that each point stands for."""
        return self.goal.share(self.path)

    @cached_property
    def home(self) -> Task:
        """The task with everything at 0; its reference direction holds for all."""
        T = self.cell.T_base_part(np.zeros((1, len(self.cell.linear_axes))))[0]
        return Task(self.path, self.T_flange_tool, T, self.reference)

    @property
    def T_flange_tool(self) -> Array:  # noqa: N802 - letters of a matrix
        """Tool frames on the flange: (4, 4) m, or (n, 4, 4) where tools are changed."""
        return self.cell.tool.T_flange_tool if self.tools is None else self.tools.T_flange_tool

    def by_scene(self, point: Integers) -> list[tuple[Integers, Scene]]:
        """Places in ``point`` (m,), numbers of path points, and the arm and cell that are there; collisions count."""
        if self.tools is None or not self.tools.scenes:
            return [] if self.scene is None else [(np.arange(len(point)), self.scene)]
        place = self.tools.place[point]
        return [(np.flatnonzero(place == i), self.tools.scenes[i]) for i in np.unique(place).tolist()]

    def task_at(self, e: ArrayLike, table: float, rows: Integers | None = None) -> Task:
        """The task, or some points of it, with the base at travels e (k,), or (n, k) point by point; ``table`` rad."""
        e = np.asarray(e, dtype=np.float64)
        T = self.cell.T_base_part(np.atleast_2d(e), [table])
        shift = None if e.ndim == 1 else T[:, :3, 3] - T[0, :3, 3]
        there = self.home if rows is None else self.home.at(rows)
        return Task(there.path, there.T_flange_tool, T[0], self.home.reference, shift)

    def forces(self, table: float) -> Array:
        """Cutting force (n, 3) N in base axes, which turn with nothing but the turntable."""
        return self.force.along(self.task_at(np.zeros(len(self.cell.linear_axes)), table)).force

    @property
    def force(self) -> CuttingForce:
        """The cutting force, run by run of cutting moves."""
        if self.free is None or not self.free.any():
            return self.goal.force
        if isinstance(self.goal.force, ForceOfEach):
            return self.goal.force.at(self.goal.force.tool, self.free)
        return ByRuns(self.goal.force, self.free)

    def looked_at(self, e: ArrayLike, table: float, rows: Integers) -> tuple[Task, Objective]:
        """The task at some points and the objective that give the goal's value there: stiffness N/m, or error m.

        ``e``: as :meth:`task_at`. Directional stiffness is that along the path's normals, so these become the force's
        direction.
        """
        task, force = self.task_at(e, table, rows), self.forces(table)[rows]
        if self.goal.minimised:
            return task, Objective("normal displacement", force)
        size = np.linalg.norm(force, axis=1)
        if not (size > 0.0).all():
            where = f"cutting force at path point {int(rows[np.argmin(size)])}"
            raise InputError(where, code="G004", value="0 N", allowed="a force that has a direction")
        p, R = task.path, task.T_base_part[:3, :3]
        path = ToolPath(p.points, (force / size[:, None]) @ R, p.axes, p.feed)
        return replace(task, path=path), Objective("directional")

    def sure_rows(self, count: int) -> Integers:
        """As :meth:`machining.ToolPath.even_rows`, and the path's outermost points."""
        outermost = (self.path.points @ OUTWARD.T).argmax(axis=0)
        return np.union1d(self.path.even_rows(count), outermost).astype(np.int64)

    def share_of(self, rows: Integers) -> Array:
        """Part that each of some points (ascending) stands for, its neighbours that were left out with it."""
        if len(rows) == self.path.n:
            return self.share
        middle = np.ceil(0.5 * (rows[1:] + rows[:-1])).astype(np.int64)
        return np.asarray(np.add.reduceat(self.share, np.concatenate([[0], middle])))


def on_axes(model: fem.ArmModel, cell: Cell) -> fem.ArmModel:
    """The arm on its linear axes: their compliances in series with the base's own.

    Each axis has a compliance at the carriage (world's axes). It is taken to act at the robot's base origin; from there
    to the tool the lever is that of rigid bodies, as for any compliance of the base. It does not depend on the travel.
    """
    C = np.zeros((6, 6))
    R = cell.T_world_base0[:3, :3].T
    for axis in cell.linear_axes:
        if axis.compliance is not None:
            C[:3, :3] += R @ np.diag(axis.compliance[:3]) @ R.T
            C[3:, 3:] += R @ np.diag(axis.compliance[3:]) @ R.T
    return replace(model, base=model.base + C) if C.any() else model
