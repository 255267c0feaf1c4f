"""From a tool path to a program: posture along it, points put in where joints would cut corners, all in one run.

The joint program and the Cartesian program come from the same points. Between two points of a joint program every axis
moves evenly, so the tool leaves the straight line by some micrometres; where that is more than the tolerance, points
are put in between.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

import fem
from machining.cell import Cell
from machining.posture.drive import Drive
from machining.posture.long_path import optimise_long_path
from machining.posture.points import GammaRange
from machining.posture.problem import Course
from machining.posture.stretches import course_at
from machining.programs.program import JointProgram, tool_in_part
from machining.programs.refining import PostState, pieces_for
from machining.stiffness.objective import Objective
from machining.tooling import numbered, require_tools
from machining.toolpaths.conversion import entered
from machining.toolpaths.engagement import mills
from machining.toolpaths.motions import Motions
from machining.toolpaths.path_error import PathError
from robots import InputError, require_one_of, require_positive
from robots.arrays import Array, Bools, Integers, finite
from robots.progress import Progress

# Rounds of putting points in; each divides what is left by the square of the pieces.
ROUNDS = 6


@dataclass(frozen=True, eq=False)
class PostSettings:
    """How a tool path becomes a program.

    Attributes
    ----------
    gamma : angle about the tool axis (rad), one for all moves or (n,), or the range in which the best is chosen
    objective, drive : as in :func:`machining.optimise_path`
    travel : (k,) m, where the linear axes stand, or (n, k) at each move; None: at 0
    table : rad, where the turntable stands
    tolerance : m that the tool may leave the straight line between two points of the joint program
    rapid : "linear": rapid moves are straight, and points are put into them too; "joint": every axis moves as it likes
    reference : (3,) direction in the part frame that gamma counts from, see :class:`machining.Task`
    near : (n, dof) rad at each move: branch and turns nearest to these are taken, for a given gamma only
    seed : of the search for joint angles, for arms without a closed form
    clearance : (k, dof) rad, (k, axes) m, (k,) tools of the motions -> (k,) m, free space around the arm with the
        linear axes there and those tools; asked instead of the drive's own, which knows of one place and tool only
    """

    gamma: float | Array | GammaRange = 0.0
    objective: Objective = field(default_factory=Objective)
    drive: Drive = field(default_factory=Drive)
    travel: ArrayLike | None = None
    table: float = 0.0
    tolerance: float = 1e-5
    rapid: Literal["linear", "joint"] = "linear"
    reference: Array | None = None
    near: Array | None = None
    seed: int = 0
    clearance: Callable[[Array, Array, Integers], Array] | None = None

    def at(self, row: Integers) -> PostSettings:
        """The same for a path of other moves: what is given for each move, of moves (m,) of the path before."""
        gamma = (
            self.gamma
            if isinstance(self.gamma, GammaRange) or np.ndim(self.gamma) == 0
            else np.asarray(self.gamma)[row]
        )
        travel = None if self.travel is None else np.asarray(self.travel)
        travel = travel if travel is None or travel.ndim < 2 else travel[row]
        return replace(self, gamma=gamma, travel=travel, near=None if self.near is None else self.near[row])

    def __post_init__(self) -> None:
        require_positive("tolerance of joint programs", self.tolerance, "m", code="Q007")
        require_one_of("rapid moves", self.rapid, ("linear", "joint"), code="Q007")


@dataclass(frozen=True, eq=False)
class Posted:
    """A program and how it was made.

    ``state``: the path that was followed, its task, and which moves lead to which of its points; ``course``: the
    postures at all moves; ``bend`` (n,) m: how far each move of the joint program leaves the straight line half-way.
    """

    program: JointProgram
    settings: PostSettings
    state: PostState
    course: Course
    bend: Array

    @property
    def bend_of_cuts(self) -> float:
        """The largest bend of moves at feed, which the tolerance bounds, m."""
        return float(self.bend[~self.program.motions.rapid].max(initial=0.0))

    @property
    def bend_of_rapids(self) -> float:
        """The largest bend of rapid moves, which joint motion may take as it likes, m."""
        return float(self.bend[self.program.motions.rapid].max(initial=0.0))

    @cached_property
    def judged(self) -> Bools:
        """Moves (n,) whose stiffness counts: those that mill sideways; where there are none, all at feed, or all."""
        motions = self.program.motions
        for moves in (mills(motions.points, motions.axes, motions.cutting), motions.cutting):
            if moves.any():
                return moves
        return np.ones(motions.n, dtype=np.bool_)

    @property
    def mean(self) -> float:
        """Mean of the objective over the moves that count."""
        return float(self.course.value[self.judged].mean())

    @property
    def worst(self) -> float:
        """Worst value of the objective at the moves that count."""
        value = self.course.value[self.judged]
        return float(value.max() if self.settings.objective.minimised else value.min())


def post(
    model: fem.ArmModel,
    cell: Cell,
    motions: Motions,
    settings: PostSettings | None = None,
    progress: Progress | None = None,
    *,
    led: Bools | None = None,
) -> Posted:
    """Make a program of a tool path; ``led`` (n,): moves that are not of the path's file.

    Raises
    ------
    InputError
        A tool that the cell does not have, axes out of their limits, as :func:`machining.optimise_path` where the path
        cannot be driven, or a move that no number of points makes straight enough.
    """
    settings = settings or PostSettings()
    if motions.n == 0:
        raise InputError(f"tool path {motions.source} has no motion", code="Q007")
    require_tools(cell, motions)
    motions = entered(numbered(cell, motions))
    travel = _travel(cell, settings, motions.n)
    split = _straight(motions, settings)
    reach = float(np.abs(cell.T_base_part(travel[:1], [settings.table])[0, :3, 3]).sum()) or 1.0
    pieces = pieces_for(motions, 4.0 * settings.tolerance, max(reach, 0.5), only=split)
    n, given = motions.n, settings.gamma
    chosen = isinstance(given, GammaRange) or np.ndim(given) == 0
    gamma = None if chosen else finite("gamma at each move", np.asarray(given), (n,), "rad")
    near = settings.near
    if near is not None:
        finite("postures at each move", near, (n, model.robot.dof), "rad")
    inserted = np.zeros(n, dtype=np.bool_) if led is None else led
    state = PostState(cell, motions, travel, settings.table, settings.reference, inserted, gamma, near)
    # Once for all: points put in later could make it another direction.
    state = replace(state, reference=state.task.reference).refined(pieces)
    for _ in range(ROUNDS):
        posted = _posted(model, state, settings, progress)
        progress = None
        state = replace(state, gamma=posted.course.gamma)
        may = _straight(state.motions, settings)
        bend = posted.bend
        coarse = may & (bend > settings.tolerance)
        if not coarse.any():
            return posted
        more = np.where(coarse, np.ceil(np.sqrt(1.1 * bend / settings.tolerance)), 1.0).astype(np.int64)
        state = state.refined(np.minimum(more, 64))
    worst = int(np.argmax(np.where(may, bend, 0.0)))
    raise InputError(
        f"line {int(state.motions.line[worst])}: joint motion leaves the straight line",
        code="Q006",
        value=f"{bend[worst] * 1e6:.3g} um",
        allowed=f"{settings.tolerance * 1e6:.3g} um",
        remedy="raise the tolerance, or keep the path away from singularities",
    )


def repost(model: fem.ArmModel, posted: Posted, points: Array) -> Posted:
    """The same program with its points (n, 3) m, part frame, moved a little; gamma stays, no points are put in.

    Raises
    ------
    InputError
        Shape, or a moved path that cannot be driven.
    """
    program = posted.program
    motions = replace(program.motions, points=np.asarray(points, dtype=np.float64))
    state = replace(posted.state, motions=motions, gamma=program.gamma, near=program.q)
    return _posted(model, state, posted.settings, None)


def _straight(motions: Motions, settings: PostSettings) -> Bools:
    """Moves (n,) that go straight: those at feed, and rapid ones if asked for, but for the way to another tool."""
    return ~motions.changes if settings.rapid == "linear" else ~motions.rapid


def _travel(cell: Cell, settings: PostSettings, n: int) -> Array:
    k = len(cell.linear_axes)
    travel = np.zeros(k) if settings.travel is None else np.asarray(settings.travel, dtype=np.float64)
    if travel.shape not in ((k,), (n, k)) or not np.isfinite(travel).all():
        raise InputError(
            "travels of the linear axes", code="Q007", value=f"shape {travel.shape}", allowed=f"({k},) or ({n}, {k}) m"
        )
    rows = np.broadcast_to(travel, (n, k)).copy()
    inside = cell.inside_limits(rows, np.full(n, settings.table))
    if not inside.all():
        row = int(np.argmin(inside))
        ranges = ", ".join(f"{a.name} {a.limits[0] * 1e3:g} to {a.limits[1] * 1e3:g} mm" for a in cell.linear_axes)
        raise InputError(
            f"external axes at move {row}",
            code="Q007",
            value=f"{(rows[row] * 1e3).tolist()} mm, turntable {np.degrees(settings.table):g} deg",
            allowed=ranges or "no linear axes; the turntable within its limits",
            remedy="choose a place within the limits",
        )
    return rows


def _posted(model: fem.ArmModel, state: PostState, settings: PostSettings, progress: Progress | None) -> Posted:
    """The program of moves. Raises PathError, with the line, where they cannot be driven."""
    try:
        course = _course(model, state, settings, progress)
    except PathError as error:
        first = state.places[0][error.point]
        raise error.at(error.point, f"line {int(state.motions.line[first])}") from None
    program = JointProgram(
        robot=model.robot,
        cell=state.cell,
        motions=state.motions,
        T_part_tool=state.tool_frames(course.gamma),
        q=course.q,
        travel=state.travel,
        table=np.full(state.motions.n, state.table),
        gamma=course.gamma,
        branch=course.branch,
        names=course.names,
        inserted=state.inserted,
    )
    return Posted(program, settings, state, course, _bend(program))


def _course(model: fem.ArmModel, state: PostState, settings: PostSettings, progress: Progress | None) -> Course:
    """Postures at every move; points that repeat the one before share its posture."""
    task, (first, place) = state.task, state.places
    loose = np.asarray(~_straight(state.motions, settings)[first][1:])
    free = loose if loose.any() else None
    drive, clear = settings.drive, settings.clearance
    if clear is not None:
        travel, tool = state.travel[first], state.motions.tool[first]
        drive = replace(drive, clearance_at=lambda q, point: clear(q, travel[point], tool[point]))
    near = None if state.near is None else state.near[first]
    generator = np.random.default_rng(settings.seed)
    chosen = settings.gamma if state.gamma is None else state.gamma[first]
    if isinstance(chosen, GammaRange):
        found = optimise_long_path(
            model, task, settings.objective, chosen, drive, free=free, generator=generator, progress=progress
        ).course
    else:
        found = course_at(model, task, chosen, settings.objective, drive, free=free, near=near, generator=generator)
    return replace(
        found, gamma=found.gamma[place], q=found.q[place], value=found.value[place], branch=found.branch[place]
    )


def _bend(program: JointProgram) -> Array:
    """Distance (n,) m of the tip from the straight line when all axes are half-way to each move's end."""
    points = program.motions.points
    half = [0.5 * (values[1:] + values[:-1]) for values in (program.q, program.travel, program.table, points)]
    tip = tool_in_part(program.robot, program.cell, half[0], half[1], half[2], program.tool_at(slice(1, None)))[
        :, :3, 3
    ]
    return np.append(np.zeros(min(1, program.n)), np.linalg.norm(tip - half[3], axis=1))
