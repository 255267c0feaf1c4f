"""Points of a request as a machining task: one of them or a block, with tool axes, normals, feed, ranges of gamma."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from machining.cell import clearance
from machining.posture.drive import Drive
from machining.posture.points import GammaRange
from machining.posture.problem import Course
from machining.service.asked import Arm, fitting, flag_of, force_of, need_force, unit_of
from machining.service.state import State, vectors_of
from machining.service.wire import Fields, number, numbers
from machining.setup import weighed_zone
from machining.stiffness.objective import QUANTITIES, Objective
from machining.task import Task, ToolPath
from robots.arrays import Array, Bools

# Angles gamma of a range: beyond, a sweep takes seconds a point.
MOST_ANGLES = 3600
# Defaults, deg.
GAMMA_STEP = 5.0
JUMP = 20.0
LIMIT_MARGIN = 0.5


@dataclass(frozen=True, eq=False)
class Block:
    """Points as a task; ``force`` (3,) or (n, 3) N in base axes; ``free`` (n - 1,): segments that are rapid moves."""

    task: Task
    force: Array | None
    free: Bools | None


def block_of(arm: Arm, fields: Fields, state: State, key: str) -> Block:
    """Points of ``key`` (mm) with ``tool_axis``, ``direction`` (default: the tool axis), ``force_N``.

    Raises
    ------
    InputError
        What is missing or does not fit; see :class:`machining.ToolPath` and :class:`machining.Task`.
    """
    one = key == "point_mm"
    points, axes = fields.rows(key, 3), fields.rows("tool_axis", 3)
    if points is None:
        raise fields.needed(key, "[x, y, z]" if one else "a list of [x, y, z]")
    if axes is None:
        raise fields.needed("tool_axis", "the direction from the tool's tip into the holder, one or one a point")
    if one and points.ndim != 1:
        raise fields.fault(key, f"{len(points)} rows", "three numbers", "use best_path for several points")
    points = np.atleast_2d(points) * 1e-3
    n = len(points)
    fitting(fields, "tool_axis", axes, n)
    normals = fitting(fields, "direction", vectors_of(fields, "direction", state.direction), n)
    force = force_of(fields, state, n)
    feed, free = (None, None) if one else (fields.positive("feed_mm_per_min", n), _free(fields, n))
    speed = np.full(n, np.nan) if feed is None else feed * 1e-3 / 60.0
    path = ToolPath(points, axes if normals is None else normals, axes, speed)
    return Block(Task(path, state.T_tool, state.T_base_given, state.reference), force, free)


def _free(fields: Fields, n: int) -> Bools | None:
    value = fields.take("rapid")
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != n or not all(isinstance(v, bool) for v in value):
        raise fields.fault("rapid", value, f"{n} times true or false: whether the move to the point is a rapid one")
    return np.array(value[1:], dtype=np.bool_)


def gammas_of(fields: Fields) -> GammaRange:
    """``gamma_from_deg``, ``gamma_to_deg``, ``gamma_step_deg``; default: a full turn every 5 deg."""
    low = fields.number("gamma_from_deg", -720.0, 720.0)
    high = fields.number("gamma_to_deg", -720.0, 720.0)
    step = fields.number("gamma_step_deg", 360.0 / MOST_ANGLES, 360.0)
    low, high, step = -180.0 if low is None else low, 180.0 if high is None else high, step or GAMMA_STEP
    if not step <= high - low <= 360.0 + 1e-9:
        allowed = "from below to, a step at least and 360 deg at most apart"
        raise fields.fault("gamma_from_deg, gamma_to_deg", [low, high], allowed)
    return GammaRange.of_degrees(low, high, step)


def quantity_of(fields: Fields, force: Array | None) -> str:
    """``quantity``, default k_fs; InputError where its force is missing."""
    quantity = fields.choice("quantity", QUANTITIES, "k_fs")
    need_force(fields, quantity, force)
    return quantity


def objective_of(fields: Fields, force: Array | None) -> Objective:
    """``quantity`` and ``aim`` (mean, worst)."""
    quantity = quantity_of(fields, force)
    aim = fields.choice("aim", ("mean", "worst"), "mean")
    return Objective(quantity, force, "worst" if aim == "worst" else "mean")


def collisions_of(arm: Arm, fields: Fields) -> bool:
    """``collisions``; default: where the cell has surfaces. InputError if they are wanted and it has none."""
    wanted = fields.flag("collisions", arm.scene is not None)
    if wanted and arm.scene is None:
        raise fields.fault(
            "collisions", True, "false: no surfaces are known", "start the service with --cell CELL.toml"
        )
    return wanted


def drive_of(arm: Arm, fields: Fields, state: State, collisions: bool) -> Drive:
    """``jump_deg``, ``motion``, ``limit_margin_deg``, ``joint_speed_deg_per_s`` (default: the cell's); clearance."""
    speed = fields.positive("joint_speed_deg_per_s", arm.robot.dof)
    jump = fields.number("jump_deg", 1e-6, 360.0) or JUMP
    motion, margin = fields.number("motion", 0.0), fields.number("limit_margin_deg", 0.0, 180.0)
    drive = Drive(
        speed=state.cell.joint_speed if speed is None else np.radians(speed),
        jump=float(np.radians(jump)),
        motion=Drive.motion if motion is None else motion,
        limit_least=float(np.radians(LIMIT_MARGIN if margin is None else margin)),
    )
    if not collisions:
        return drive
    zone, safety = weighed_zone(state.cell.safety), state.cell.safety
    clear = partial(distances, arm, state, within=zone)
    return replace(drive, clearance_of=clear, clearance_zone=zone, clearance_least=safety)


def distances(arm: Arm, state: State, q: Array, within: float) -> Array:
    """Clearance (k,) m of poses q (k, dof) rad where base and part stand; a session with surfaces."""
    assert arm.scene is not None  # noqa: S101 - collisions_of has seen to it
    return clearance(arm.scene, q, state.travel[None], [state.table], within=within).distance


def course_payload(arm: Arm, course: Course, objective: Objective) -> dict[str, Any]:
    """A course for an answer."""
    moves, (key, factor) = course.smoothness, unit_of(objective.quantity)
    return {
        "q_deg": numbers(np.degrees(course.q)),
        "gamma_deg": numbers(np.degrees(course.gamma)),
        "branch": [course.names[b] for b in course.branch.tolist()],
        key: numbers(course.value * factor, None),
        f"mean_{key}": number(course.mean * factor),
        f"worst_{key}": number(course.worst * factor),
        "largest_step_deg": numbers(np.degrees(moves.largest_step)),
        "limit_distance_deg": number(np.degrees(moves.limit_distance), 9),
        "singular_distance": number(moves.singular_distance),
    } | flag_of(arm, objective.quantity, course.value)
