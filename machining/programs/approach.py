"""How programs begin and end, and positioning moves that end from the side that an arm was calibrated from.

With ``[moves]`` of the cell file a program goes from home to its first point and back, and each operation has a point
before and behind it along the tool axis.

A joint that loses motion where it turns back stands a little short of where it says, on the side that it came from.
Before such a move's end the program first goes to the target's joint angles moved back by a small angle, so that every
joint turns its last bit the same way. That is done where something begins behind the move: a move at feed (a cut, a
plunge, a hole), a rest, a stop, the probe. Moves at feed stay as they are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from machining.cell.schema import MovesTable
from machining.programs.program import JointProgram, tool_in_part
from machining.toolpaths.events import ordered
from machining.toolpaths.motions import Motions
from machining.verification.courses import courses_of
from robots import InputError
from robots.arrays import Array, Bools, Integers
from robots.constants import MM

# The angle that takes up lost motion unless the caller says so, and the most that is still a little way, rad.
ANGLE, LARGEST = float(np.radians(0.5)), float(np.radians(5.0))
# Commands that begin where the arm stands; the probe when it is switched on.
BEGIN = ("dwell", "stop", "optional stop")
# Changes of axes (rad, m) below this are rounding: the arm stands.
STILL = 1e-9


@dataclass(frozen=True, eq=False)
class Approach:
    """Which way joints turn their last bit.

    ``ways`` (dof,): 1, -1, or 0 where it does not matter; ``angle`` rad of that bit.

    Raises
    ------
    InputError
        Other ways, none, or an angle that is no small one.
    """

    ways: Array
    angle: float = ANGLE

    def __post_init__(self) -> None:
        if self.ways.ndim != 1 or not np.isin(self.ways, (-1.0, 0.0, 1.0)).all() or not self.ways.any():
            raise InputError(
                "ways that joints come",
                code="Q009",
                value=str(self.ways.tolist()),
                allowed="1, -1 or 0 for each joint, not all 0",
            )
        if not 0.0 < self.angle <= LARGEST * (1.0 + 1e-12):
            raise InputError(
                "angle of the approach",
                code="Q009",
                value=f"{np.degrees(self.angle):g} deg",
                allowed=f"above 0, up to {np.degrees(LARGEST):g} deg",
                remedy="give several times the lost motion of the joints, as 0.5 deg",
            )


@dataclass(frozen=True, eq=False)
class Approached:
    """A program that comes from one side.

    ``moves`` (m,): those to the points put in, each before the move to its target; ``targets``: ends of positioning
    moves where something begins; ``left_out``: by joint, at how many of them it has no room within its limits to come
    from that side. ``away`` m: the farthest that a point put in is from its target; ``deeper`` m: of that, along the
    tool out of its tip.
    """

    program: JointProgram
    moves: Integers
    targets: int
    left_out: Mapping[str, int]
    away: float
    deeper: float


def approached(program: JointProgram, approach: Approach, *, straight: bool = False) -> Approached:
    """Put in points from which every joint turns to the targets of positioning moves the same way.

    Parameters
    ----------
    straight : the tool goes straight to these targets (Cartesian programs without joint moves): then it is made sure
        that joints do not turn back on the way

    Raises
    ------
    InputError
        Ways of another number of joints, or a joint that turns back on the straight way to a target.
    """
    robot = program.robot
    if len(approach.ways) != robot.dof:
        raise InputError(
            "ways that joints come",
            code="Q009",
            value=f"{len(approach.ways)}",
            allowed=f"{robot.dof}, one for each joint",
        )
    ends = positioned(program)
    q, wanted = program.q[ends], np.broadcast_to(approach.ways * approach.angle, (len(ends), robot.dof))
    lower, upper = robot.limits.T
    step = np.where((q - wanted >= lower) & (q - wanted <= upper), wanted, 0.0)
    # Joints that limit one another.
    step[~robot.reachable(q - step)] = 0.0
    lacks = np.count_nonzero((step == 0.0) & (wanted != 0.0), axis=0)
    left_out = {name: int(count) for name, count in zip(robot.joint_names, lacks, strict=True) if count}
    comes = step.any(axis=1)
    if not comes.any():
        return Approached(program, ends[:0], len(ends), left_out, 0.0, 0.0)
    out, moves = _with_points(program, ends[comes], (q - step)[comes])
    if straight:
        _refuse_turning_back(out, moves, step[comes])
    way = out.motions.points[moves] - out.motions.points[moves + 1]
    deeper = -np.einsum("ni,ni->n", way, out.motions.axes[moves + 1])
    away = float(np.linalg.norm(way, axis=1).max(initial=0.0))
    return Approached(out, moves, len(ends), left_out, away, float(deeper.max(initial=0.0)))


def positioned(program: JointProgram) -> Integers:
    """Positioning moves (m,) that end where something begins; the move to the first point is one of them.

    Moves that lead nowhere belong to the one before: what is said there begins where that one ends.
    """
    motions = program.motions
    begins = np.append(motions.cutting[1:], [False])
    for event in ordered(motions):
        if event.move > 0 and (event.kind in BEGIN or (event.kind == "probe" and event.value > 0.0)):
            begins[event.move - 1] = True
    axes = np.column_stack([program.q, program.travel, program.table])
    first = np.flatnonzero(np.append([True], np.abs(np.diff(axes, axis=0)).max(axis=1) > STILL))
    rapid = motions.rapid[first]
    rapid[0] = True
    return np.asarray(first[rapid & np.logical_or.reduceat(begins, first)])


def _with_points(program: JointProgram, ends: Integers, q: Array) -> tuple[JointProgram, Integers]:
    """Put joint angles q (m, dof) rad in before the ends (m,) of moves; the program, and the moves put in (m,)."""
    copies = np.ones(program.n, dtype=np.int64)
    copies[ends] = 2
    row = np.repeat(np.arange(program.n), copies)
    via = ends + np.arange(len(ends))
    joints, T, inserted = program.q[row], program.T_part_tool[row], program.inserted[row]
    joints[via], inserted[via] = q, True
    T[via] = tool_in_part(
        program.robot, program.cell, q, program.travel[ends], program.table[ends], program.tool_at(ends)
    )
    m = program.motions
    points, axes, rapid, feed, dwell = m.points[row], m.axes[row], m.rapid[row], m.feed[row], m.dwell[row]
    points[via], axes[via], dwell[via] = T[via, :3, 3], -T[via, :3, 2], 0.0
    # Both ways are positioning moves; the first point of a path may be written as one at feed.
    for moves in (via, via + 1):
        rapid[moves], feed[moves] = True, np.nan
    events = tuple(replace(event, move=event.move + int(np.searchsorted(ends, event.move))) for event in m.events)
    motions = replace(
        m,
        points=points,
        axes=axes,
        rapid=rapid,
        feed=feed,
        dwell=dwell,
        events=events,
        line=m.line[row],
        tool=m.tool[row],
        spindle=m.spindle[row],
        operation=m.operation[row],
    )
    whole = replace(
        program,
        motions=motions,
        T_part_tool=T,
        q=joints,
        travel=program.travel[row],
        table=program.table[row],
        gamma=program.gamma[row],
        branch=program.branch[row],
        inserted=inserted,
        file_lines=None,
    )
    return whole, via


def _refuse_turning_back(program: JointProgram, moves: Integers, step: Array) -> None:
    """Raise InputError where a joint turns against its ``step`` (m, dof) while the tool goes straight to a target."""
    values, followed = courses_of(program, "linear").sampled(moves + 1)
    turn = np.diff(values[:, :, : program.robot.dof], axis=1) * np.sign(step)[:, None, :]
    back = (step != 0.0) & ~((turn > 0.0).all(axis=1) & followed[:, None])
    if back.any():
        k, joint = (int(i) for i in np.argwhere(back)[0])
        raise InputError(
            f"line {int(program.motions.line[moves[k]])}: {program.robot.joint_names[joint]} turns back on the "
            "straight way to its target",
            code="Q009",
            allowed="all joints turning one way",
            remedy="make rapid moves joint moves (--rapid joint), or come by a smaller angle",
        )


def with_leads(motions: Motions, moves: MovesTable) -> tuple[Motions, Integers, Bools]:
    """A tool path with rapid points before and behind each operation, along the tool axis, as the cell asks.

    Also of which move (m,) of the path each is, or is beside; and which were put in.
    """
    before, behind = (0.0 if way is None else way * MM for way in (moves.approach_mm, moves.retract_mm))
    if not (motions.n and (before or behind)):
        return motions, np.arange(motions.n), np.zeros(motions.n, dtype=np.bool_)
    runs = np.flatnonzero(np.append([True], np.diff(motions.operation) != 0))
    ends = np.append(runs[1:], motions.n) - 1
    copies = np.ones(motions.n, dtype=np.int64)
    copies[runs] += before > 0.0
    copies[ends] += behind > 0.0
    row = np.repeat(np.arange(motions.n), copies)
    first = np.append(np.cumsum(copies) - copies, len(row))
    heads = first[runs] if before else runs[:0]
    tails = first[ends + 1] - 1 if behind else runs[:0]
    points, feed, rapid, dwell = motions.points[row], motions.feed[row], motions.rapid[row], motions.dwell[row]
    points[heads] += before * motions.axes[row[heads]]
    points[tails] += behind * motions.axes[row[tails]]
    for rows in (heads, tails):
        rapid[rows], feed[rows], dwell[rows] = True, np.nan, 0.0
    # What was said before a move is said before its approach, and behind the retract of the operation before.
    events = tuple(replace(event, move=int(first[event.move])) for event in motions.events)
    led = replace(
        motions,
        points=points,
        axes=motions.axes[row],
        rapid=rapid,
        feed=feed,
        dwell=dwell,
        line=motions.line[row],
        tool=motions.tool[row],
        spindle=motions.spindle[row],
        operation=motions.operation[row],
        events=events,
    )
    return led, row, np.isin(np.arange(len(row)), np.concatenate([heads, tails]))


def with_home(program: JointProgram) -> JointProgram:
    """A program with joint moves from home to its first point and back from the last, where the cell asks for them."""
    cell, n = program.cell, program.n
    if not cell.moves.home or cell.home is None:
        return program
    row = np.concatenate([[0], np.arange(n), [n - 1]])
    ends = np.array([0, n + 1])
    q, T, m = program.q[row], program.T_part_tool[row], program.motions
    q[ends] = cell.home
    T[ends] = tool_in_part(
        program.robot, cell, q[ends], program.travel[row][ends], program.table[row][ends], program.tool_at(row[ends])
    )
    points, axes, rapid, feed, dwell = m.points[row], m.axes[row], m.rapid[row], m.feed[row], m.dwell[row]
    points[ends], axes[ends] = T[ends, :3, 3], -T[ends, :3, 2]
    to_start = np.array([0, 1, n + 1])
    rapid[to_start], feed[to_start], dwell[ends] = True, np.nan, 0.0
    spindle, inserted = m.spindle[row], program.inserted[row]
    stops = [event.value for event in m.events if event.kind == "spindle" and event.move == n]
    spindle[ends], inserted[ends] = (0.0, stops[-1] if stops else m.spindle[-1]), True
    motions = replace(
        m,
        points=points,
        axes=axes,
        rapid=rapid,
        feed=feed,
        dwell=dwell,
        spindle=spindle,
        line=m.line[row],
        tool=m.tool[row],
        operation=m.operation[row],
        events=tuple(replace(event, move=event.move + 1) for event in m.events),
    )
    return replace(
        program,
        motions=motions,
        T_part_tool=T,
        q=q,
        travel=program.travel[row],
        table=program.table[row],
        gamma=program.gamma[row],
        branch=program.branch[row],
        inserted=inserted,
        file_lines=None,
    )
