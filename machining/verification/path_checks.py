"""How each move keeps to the programmed path, and how near it comes to singularities and other branches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from machining.posture.drive import singular_distance
from machining.programs.program import frame_distance
from machining.verification.courses import PIECES, Courses
from machining.verification.demands import Demands
from robots.arrays import Array, Bools, Integers
from robots.frames import frames_between
from robots.inverse.axis_lines import axis_lines
from robots.inverse.singularities import configuration
from robots.inverse.spherical_wrist import spherical_wrist_arm, why_not_spherical

CHUNK = 4096
SIGNS = ("shoulder", "elbow", "wrist")
# Nearer to its singularity (rad, or m over the arm's length) a sign is rounding.
NO_SIGN = 1e-9


@dataclass(frozen=True, eq=False)
class PathChecks:
    """Figures of n moves.

    Attributes
    ----------
    point, point_turn : (n,) m, rad: distance of the frame reached at each point from the wanted one
    line, line_turn : (n,) m, rad: greatest distance, in between, of the tip from the straight line between the wanted
        points, and of the tool frame from the evenly turned one, if all axes move evenly; NaN for rapid moves
    run_line : (n,) m: the same for the interpolation that was asked for
    singular, singular_at : (n,) least :func:`machining.singular_distance` seen, 0 where a sign changes; and its share
    changed : (n, 3) which of shoulder, elbow and wrist change sides; all False for arms without these names
    step, step_axis : (n,) rad, largest step of a joint, and which joint
    jumped : (n,) whether that step is a jump
    """

    point: Array
    point_turn: Array
    line: Array
    line_turn: Array
    run_line: Array
    singular: Array
    singular_at: Array
    changed: Bools
    step: Array
    step_axis: Integers
    jumped: Bools


def path_checks(courses: Courses, demands: Demands) -> PathChecks:
    """Look at all moves; interior figures come from even samples, eight pieces a move."""
    program = courses.program
    n, dof = program.n, courses.axes.dof
    point, point_turn = frame_distance(courses.reached, program.T_part_tool)
    line, line_turn, run_line = (np.full(n, np.nan) for _ in range(3))
    singular = singular_distance(program.robot, program.q)
    singular_at = np.ones(n)
    for start in range(1, n, CHUNK):
        moves = np.arange(start, min(start + CHUNK, n))
        cutting = moves[program.motions.cutting[moves]]
        line[cutting], line_turn[cutting] = _off_the_line(courses, cutting, even=True)
        run_line[cutting] = line[cutting]
        straight = cutting[courses.straight[cutting]]
        if len(straight):
            run_line[straight], _ = _off_the_line(courses, straight, even=False)
        counted = moves[counts(courses)[moves]]
        if len(counted):
            values, _ = courses.sampled(counted)
            distance = singular_distance(program.robot, values.reshape(-1, values.shape[2])[:, :dof])
            distance = distance.reshape(len(counted), -1)
            singular[counted] = distance.min(axis=1)
            singular_at[counted] = distance.argmin(axis=1) / PIECES
    changed = _side_changes(courses)
    passes = changed.any(axis=1) & counts(courses)
    singular[passes], singular_at[passes] = 0.0, 0.5
    steps = np.zeros((n, dof))
    steps[1:] = np.abs(np.diff(program.q, axis=0))
    step = steps.max(axis=1)
    jumped = (step > demands.jump) & (step > demands.jump_ratio * _tool_motion(courses))
    return PathChecks(
        point, point_turn, line, line_turn, run_line, singular, singular_at, changed, step, steps.argmax(axis=1), jumped
    )


def counts(courses: Courses) -> Bools:
    """Moves (n,) whose path counts: cutting moves, and straight ones of any kind."""
    return np.asarray(courses.program.motions.cutting | courses.straight)


def _off_the_line(courses: Courses, moves: Integers, *, even: bool) -> tuple[Array, Array]:
    """Distance (m,) m from the wanted line and (m,) rad from the frame turned evenly along it."""
    if not len(moves):
        return np.zeros(0), np.zeros(0)
    wanted = courses.program.T_part_tool
    share = np.linspace(0.0, 1.0, PIECES + 1)[1:-1]
    move, s = np.repeat(moves, len(share)), np.tile(share, len(moves))
    frames = courses.frames(courses.even(move, s) if even else courses.at(move, s)[0], move)
    start, way = wanted[move - 1, :3, 3], wanted[move, :3, 3] - wanted[move - 1, :3, 3]
    length = np.einsum("ni,ni->n", way, way)
    r = frames[:, :3, 3] - start
    with np.errstate(invalid="ignore", divide="ignore"):
        along = np.where(length > 0.0, np.clip(np.einsum("ni,ni->n", r, way) / length, 0.0, 1.0), 0.0)
    away = np.linalg.norm(r - along[:, None] * way, axis=1)
    _, turn = frame_distance(frames, frames_between(wanted[move - 1], wanted[move], s))
    shape = len(moves), len(share)
    return away.reshape(shape).max(axis=1), turn.reshape(shape).max(axis=1)


def _side_changes(courses: Courses) -> Bools:
    """Which of shoulder, elbow and wrist change sides in each move, (n, 3)."""
    robot, n = courses.program.robot, courses.program.n
    changed = np.zeros((n, 3), dtype=np.bool_)
    if why_not_spherical(robot) is not None:
        return changed
    arm = spherical_wrist_arm(robot)
    shoulder, elbow, wrist = configuration(arm, robot, courses.program.q)
    value = np.stack([shoulder / arm.length, elbow, wrist], axis=1)
    sign = np.where(np.abs(value) < NO_SIGN, 0.0, np.sign(value))
    # A point on the singularity has no side; it takes that of the point before.
    last = np.maximum.accumulate(np.where(sign == 0.0, 0, np.arange(n)[:, None]), axis=0)
    sign = np.take_along_axis(sign, last, axis=0)
    changed[1:] = sign[1:] * sign[:-1] < 0.0
    return changed


def _tool_motion(courses: Courses) -> Array:
    """Motion (n,) rad of the flange against the base in each move: turn, and way over the arm's length."""
    program = courses.program
    _, travel, table = courses.axes.parts(courses.points)
    T = program.cell.T_base_part(travel, table) @ courses.reached
    away, turn = frame_distance(T[1:], T[:-1])
    motion = np.zeros(program.n)
    motion[1:] = turn + away / axis_lines(program.robot).length
    return motion
