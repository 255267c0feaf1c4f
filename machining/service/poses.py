"""Commands about single poses: fk, ik, stiffness, deflection, clearance."""

from __future__ import annotations

from typing import Any

import numpy as np

from fem.statics.small_displacements import FLAG, beyond_small
from machining.cell import Scene, clearance
from machining.service.asked import (
    Arm,
    best_first,
    direction_of,
    displacements,
    flag_of,
    force_of,
    in_base,
    middle,
    near_of,
    nearest_column,
    need_force,
    not_reached,
    poses_of,
    solutions,
    tool_axes,
    unit_of,
    values_of,
)
from machining.service.state import shown, state_of, target_of
from machining.service.wire import MOST, Fields, number, numbers
from machining.stiffness.cartesian import translational
from machining.stiffness.indices import INDICES, evaluate, stiffness_index
from machining.stiffness.objective import QUANTITIES
from robots import InverseSolutions, Reason, forward_kinematics
from robots.arrays import Array
from robots.frames import inverse
from robots.inverse.branches import SINGULARITIES

# Bodies farther apart than this (mm) are not measured unless asked for.
WITHIN = 50.0


def fk(arm: Arm, fields: Fields) -> dict[str, Any]:
    """Tool frame of joint angles."""
    state = state_of(fields, arm.state)
    poses = poses_of(arm, fields, state, inside=False)
    fields.done()
    T = inverse(state.T_base_given) @ forward_kinematics(arm.robot, poses.q).T_flange @ state.T_tool
    inside = arm.robot.reachable(poses.q)
    answers = []
    for i in range(len(poses.q)):
        answer = shown(T[i], state.reference) | {"matrix_mm": _matrix(T[i]), "inside_limits": bool(inside[i])}
        if not inside[i]:
            answer["violations"] = arm.robot.violations(poses.q[i])
        answers.append(answer)
    return answers[0] if poses.one else {"poses": answers}


def ik(arm: Arm, fields: Fields) -> dict[str, Any]:
    """Joint angles of a tool frame: the nearest, all, or the stiffest branch."""
    state = state_of(fields, arm.state)
    T, near = target_of(fields, state.reference), near_of(arm, fields)
    which = fields.choice("which", ("nearest", "all", "stiffest"), "nearest")
    if which == "stiffest":
        quantity = fields.choice("quantity", QUANTITIES, "k_fs")
        direction, force = direction_of(fields, state, 1), force_of(fields, state, 1)
        need_force(fields, quantity, force)
    fields.done()
    found = solutions(arm, state, T, near)
    if which == "all":
        return _all(arm, found)
    if which == "nearest":
        return _branch(found, nearest_column(found, near, "ik"))
    columns = np.flatnonzero(found.valid[0] & ~found.twin[0])
    if not len(columns):
        raise not_reached(found, "ik")
    if direction is None:
        direction = -(state.T_base_given[:3, :3] @ T[:3, 2])
    value = values_of(arm, state, quantity, found.q[0, columns], direction, force)
    key, factor = unit_of(quantity)
    merit = factor * (value if quantity in INDICES else -value)
    # An index may be infinite; that is then the best.
    best = int(best_first(np.clip(merit, -MOST, MOST), found.q[0, columns], middle(arm) if near is None else near)[0])
    marks = flag_of(arm, quantity, value[best])
    return _branch(found, int(columns[best])) | {key: number(value[best] * factor)} | marks


def stiffness(arm: Arm, fields: Fields) -> dict[str, Any]:
    """Stiffness along a direction, and the other indices."""
    state = state_of(fields, arm.state)
    poses = poses_of(arm, fields, state)
    n = len(poses.q)
    direction, force = direction_of(fields, state, n), force_of(fields, state, n)
    names = fields.names("indices", ("all", *INDICES)) or ["directional"]
    fields.done()
    if "all" in names:
        names = [name for name in INDICES if force is not None or "force" not in INDICES[name].uses]
    for name in names:
        need_force(fields, name, force)
    if direction is None:
        direction = tool_axes(arm, state, poses)
    tip = state.T_tool[:3, 3]
    C = None if names == ["k_fs"] else translational(arm.model, poses.q, tip)
    answer: dict[str, Any] = {"q_deg": numbers(np.degrees(poses.q))[0]} if poses.T is not None else {}
    for name in names:
        value = (
            stiffness_index(arm.model, poses.q, direction, tip) if C is None else evaluate(name, C, direction, force)
        )
        key, factor = unit_of(name)
        answer[key] = poses.answer(numbers(value * factor, None))
    return answer


def deflection(arm: Arm, fields: Fields) -> dict[str, Any]:
    """Displacement of the tool under a force on it."""
    state = state_of(fields, arm.state)
    poses = poses_of(arm, fields, state)
    n = len(poses.q)
    direction, force = direction_of(fields, state, n), force_of(fields, state, n)
    given = fields.vector("moment_Nm", 3)
    fields.done()
    if force is None and given is None:
        raise fields.needed("force_N", "N on the tool at its tip, of the request or set before")
    moment = None if given is None else in_base(state, np.array(given))
    d = displacements(arm, state, poses.q, np.zeros(3) if force is None else force, moment)
    R = state.T_base_given[:3, :3]
    shift = d[:, :3] * 1e3
    answer: dict[str, Any] = {"q_deg": numbers(np.degrees(poses.q))[0]} if poses.T is not None else {}
    answer["displacement_mm"] = poses.answer(numbers(shift @ R, None))
    answer["size_mm"] = poses.answer(numbers(np.linalg.norm(shift, axis=1), None))
    answer["rotation_deg"] = poses.answer(numbers(np.degrees(d[:, 3:] @ R), None))
    if direction is not None:
        unit = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
        answer["along_direction_mm"] = poses.answer(numbers((shift * unit).sum(axis=1), None))
    beyond = beyond_small(arm.robot, d)
    if beyond.any():
        answer[FLAG] = poses.answer(beyond.tolist())
    return answer


def clearance_of_poses(arm: Arm, fields: Fields) -> dict[str, Any]:
    """Distance of arm and tool from the cell."""
    state = state_of(fields, arm.state)
    poses = poses_of(arm, fields, state)
    within = fields.number("within_mm", 1e-3, 1e6) or WITHIN
    fields.done()
    found = clearance(known(arm, fields), poses.q, state.travel[None], [state.table], within=within * 1e-3)
    pairs = [found.nearest(i) for i in range(len(poses.q))]
    answer: dict[str, Any] = {"q_deg": numbers(np.degrees(poses.q))[0]} if poses.T is not None else {}
    # Overlap has no depth: less than 0 says that there is one.
    answer["clearance_mm"] = poses.answer(numbers(np.where(found.collides, -1.0, found.distance * 1e3)))
    answer["nearest"] = poses.answer([None if pair is None else list(pair) for pair in pairs])
    answer["collides"] = poses.answer(found.collides.tolist())
    return answer


def known(arm: Arm, fields: Fields) -> Scene:
    """The cell with its bodies; InputError without one."""
    if arm.scene is None:
        raise fields.fault("cell", "none", "a cell with surfaces", "start the service with --cell CELL.toml")
    return arm.scene


def branch_payload(found: InverseSolutions, column: int) -> dict[str, Any]:
    """A solution for an answer."""
    marks = [name for name, on in zip(SINGULARITIES, found.singular[0, column].tolist(), strict=True) if on]
    return {
        "q_deg": numbers(np.degrees(found.q[0, column])),
        "branch": found.names[column],
        "singular": marks,
    }


def _branch(found: InverseSolutions, column: int) -> dict[str, Any]:
    return branch_payload(found, column) | {"sure": bool(found.sure[0])}


def _all(arm: Arm, found: InverseSolutions) -> dict[str, Any]:
    solved, missing = [], []
    for column in range(len(found.names)):
        if found.twin[0, column]:
            continue
        if found.valid[0, column]:
            solved.append(branch_payload(found, column))
            continue
        reason = Reason(int(found.reason[0, column]))
        if reason is Reason.NO_SUCH:
            continue
        why = [reason.words]
        if reason is Reason.LIMITS:
            why += arm.robot.violations(found.q[0, column])
        missing.append({"branch": found.names[column], "why": "; ".join(why)})
    return {"solutions": solved, "missing": missing, "sure": bool(found.sure[0])}


def _matrix(T: Array) -> Any:
    scaled = T.copy()
    scaled[:3, 3] *= 1e3
    return numbers(scaled, 12)
