"""Commands that search: best_angle at one point, best_path along a block of points, best_base for a point or a block.

The search of best_angle is that of :func:`machining.best_postures`, without postures that may not be taken: singular
ones, those farther from the last posture than a jump, and, of the best that remain, those that collide.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from machining.cutting import ConstantForce
from machining.placement import Goal, Problem, find_fixed, space_of
from machining.placement.problem import Aim
from machining.posture.drive import Drive
from machining.posture.long_path import optimise_long_path
from machining.posture.points import GammaRange, Postures, Sweep, refined_peaks, sweep_gamma
from machining.posture.stretches import course_at
from machining.service.asked import Arm, best_first, flag_of, generator, middle, near_of, unit_of
from machining.service.blocks import (
    Block,
    block_of,
    collisions_of,
    course_payload,
    distances,
    drive_of,
    gammas_of,
    objective_of,
    quantity_of,
)
from machining.service.state import State, state_of, vectors_of
from machining.service.wire import Fields, number, numbers
from machining.stiffness.objective import Objective
from machining.task import Task
from robots import InputError, Reason
from robots.arrays import Array
from robots.inverse.turns import nearest_turn

# Peaks of the grid that are refined, as machining.best_postures.
PEAKS = 3
# Postures that are asked for collisions at once, and in all.
AT_ONCE, TRIES = 16, 400
BASE_AIMS: Mapping[str, Aim] = {"mean": "mean", "worst": "worst", "ksf": "ksf"}


def best_angle(arm: Arm, fields: Fields) -> dict[str, Any]:
    """Best gamma, branch and turns at a point."""
    state = state_of(fields, arm.state)
    block = block_of(arm, fields, state, "point_mm")
    quantity, gammas = quantity_of(fields, block.force), gammas_of(fields)
    near, jump = near_of(arm, fields), fields.number("jump_deg", 1e-6, 360.0)
    collisions, refine = collisions_of(arm, fields), fields.flag("refine", True)
    fields.done()
    if jump is not None and near is None:
        raise fields.fault("jump_deg", jump, "together with near_deg: the posture that it starts from")
    objective = Objective(quantity, block.force)
    search = _Search(arm, block.task, objective, gammas, near, np.inf if jump is None else float(np.radians(jump)))
    found = search.best_first(refine)
    at, room = _first_free(arm, state, found.q) if collisions else (0, np.nan)
    key, factor = unit_of(quantity)
    answer: dict[str, Any] = {
        "gamma_deg": number(np.degrees(found.gamma[at]), 9),
        "q_deg": numbers(np.degrees(found.q[at])),
        "branch": found.names[found.branch[at]],
        key: number(found.value[at] * factor),
        **flag_of(arm, quantity, found.value[at]),
    }
    return answer | {"clearance_mm": number(room * 1e3, 9)} if collisions else answer


@dataclass(frozen=True, eq=False)
class _Search:
    """One point; ``near`` (dof,) rad or None, ``jump`` rad."""

    arm: Arm
    task: Task
    objective: Objective
    gammas: GammaRange
    near: Array | None
    jump: float

    def best_first(self, refine: bool) -> Postures:
        """Postures of the grid and of its refined peaks, the best first; InputError if there is none."""
        grid = self._look(self.gammas.angles)
        if not grid.valid.any():
            raise self._none(int((grid.reason == Reason.FOUND).sum()))
        sweeps = [grid]
        if refine:
            merit = grid.merit.max(axis=2)
            angles = refined_peaks(self.gammas, merit, lambda gamma: self._look(gamma).merit.max(axis=2), PEAKS)
            sweeps.append(self._look(np.unique(angles)))
        parts = []
        for sweep in sweeps:
            found = np.nonzero(sweep.valid)
            parts.append((sweep.gamma[found[:2]], sweep.q[found], sweep.value[found], found[2]))
        gamma, q, value, branch = (np.concatenate(part) for part in zip(*parts, strict=True))
        near = middle(self.arm) if self.near is None else self.near
        order = best_first(self.objective.sign * value, q, near)
        names = max((sweep.names for sweep in sweeps), key=len)
        return Postures(gamma[order], q[order], value[order], branch[order], names)

    def _look(self, angles: Array) -> Sweep:
        """Postures at angles (m,) or (1, m) rad, valid where they may be taken, in the turn nearest to ``near``."""
        sweep = sweep_gamma(self.arm.model, self.task, self.objective, angles, generator=generator(self.arm))
        found = np.nonzero(sweep.valid)
        q, valid = sweep.q.copy(), sweep.valid.copy()
        kept = Drive().near_singular(self.arm.robot, q[found])[1]
        if self.near is not None:
            q[found], _ = nearest_turn(self.arm.robot, q[found], np.broadcast_to(self.near, q[found].shape))
            kept = kept & (np.abs(q[found] - self.near).max(axis=1, initial=0.0) <= self.jump)
        valid[found] = kept
        return replace(sweep, q=q, valid=valid)

    def _none(self, valid: int) -> InputError:
        p = self.task.path.points[0] * 1e3
        what = f"best_angle: point {p.round(3).tolist()} mm"
        span = f"any of {self.gammas.count} angles gamma"
        if not valid:
            return InputError(
                what,
                code="V003",
                value=f"out of reach or beyond joint limits at {span}",
                allowed="one branch within reach and joint limits",
                remedy="move the part or the base, or widen the range of gamma; ik with which = all says why",
            )
        return InputError(
            what,
            code="V003",
            value=f"{valid} postures at {span}, all singular or farther than jump_deg from near_deg",
            allowed="one that may be taken",
            remedy="allow a larger jump_deg, or retract and start anew without near_deg",
        )


def _first_free(arm: Arm, state: State, q: Array) -> tuple[int, float]:
    """Row of the first of poses q (k, dof) that keeps the cell's safety distance, and its clearance (m)."""
    safety = state.cell.safety
    within = max(2.0 * safety, 0.05)
    for start in range(0, min(len(q), TRIES), AT_ONCE):
        rows = q[start : start + AT_ONCE]
        room = distances(arm, state, rows, within)
        free = np.flatnonzero(room >= safety)
        if len(free):
            return start + int(free[0]), float(room[free[0]])
    raise InputError(
        "best_angle: collisions",
        code="V003",
        value=f"the best {min(len(q), TRIES)} postures come nearer than {safety * 1e3:g} mm to something",
        allowed="one that keeps the cell's safety distance",
        remedy="widen the range of gamma, move what is in the way, or ask with collisions = false to see the posture",
    )


def best_path(arm: Arm, fields: Fields) -> dict[str, Any]:
    """Gamma, branch and turns along a block; with ``gamma_deg`` branch and turns only."""
    state = state_of(fields, arm.state)
    block = block_of(arm, fields, state, "points_mm")
    objective, fixed, gammas = objective_of(fields, block.force), fields.number("gamma_deg"), gammas_of(fields)
    collisions = collisions_of(arm, fields)
    drive = drive_of(arm, fields, state, collisions)
    fields.done()
    task, free = block.task, block.free
    if fixed is None:
        course = optimise_long_path(
            arm.model, task, objective, gammas, drive, free=free, generator=generator(arm)
        ).course
    else:
        gamma = float(np.radians(fixed))
        course = course_at(arm.model, task, gamma, objective, drive, free=free, generator=generator(arm))
    return course_payload(arm, course, objective) | {"collisions_looked_at": collisions}


def best_base(arm: Arm, fields: Fields) -> dict[str, Any]:
    """Best position at rest by the stiffness along the cutting force; the rest is :mod:`machining.placement`."""
    state = state_of(fields, arm.state)
    if state.relative_to != "part":
        raise fields.fault("relative_to", state.relative_to, "part: the base is what is looked for")
    force = _force(fields, state)
    block = block_of(arm, fields, state, "points_mm" if fields.has("points_mm") else "point_mm")
    aim = BASE_AIMS[fields.choice("aim", tuple(BASE_AIMS), "mean")]
    fixed, gammas = fields.number("gamma_deg"), gammas_of(fields)
    ranges = _ranges(fields, state)
    collisions = collisions_of(arm, fields)
    drive = drive_of(arm, fields, state, False)
    fields.done()
    problem = Problem(
        model=arm.bare,
        space=space_of(state.cell, ranges, table=state.table),
        path=block.task.path,
        goal=Goal(aim, ConstantForce(_along(fields, block) if force is None else force, "part")),
        gamma=gammas if fixed is None else float(np.radians(fixed)),
        drive=drive,
        scene=arm.scene if collisions else None,
        clearance=state.cell.safety if collisions else 0.0,
        free=block.free,
        reference=state.reference,
    )
    found = find_fixed(problem)
    travel, _ = problem.space.sites(found.x[None])
    answer = {"travel_mm": numbers(travel[0] * 1e3), "axes": [axis.name for axis in state.cell.linear_axes]}
    return answer | course_payload(arm, found.course, Objective("directional")) | {"collisions_looked_at": collisions}


def _force(fields: Fields, state: State) -> Array | None:
    """Force, else direction that stiffness is looked at along (3,), part axes; None: the tool axis."""
    given = vectors_of(fields, "force_N", state.force)
    if given is None:
        given = vectors_of(fields, "direction", state.direction)
    if given is not None and given.ndim != 1:
        raise fields.fault("force_N", f"{len(given)} rows", "three numbers for all points")
    return given


def _along(fields: Fields, block: Block) -> Array:
    axes = block.task.path.axes
    if not np.allclose(axes, axes[0]):
        raise fields.needed("force_N or direction", "the direction of the cutting force, as the tool axis is not one")
    return np.asarray(axes[0])


def _ranges(fields: Fields, state: State) -> dict[str, tuple[float, float]]:
    """``range_mm`` {axis: [lower, upper]}; axes not named have their limits."""
    given = fields.take("range_mm")
    if given is None:
        return {}
    if not isinstance(given, dict):
        raise fields.fault("range_mm", given, 'as in {"rail": [-500, 500]}')
    inner = Fields(given, f"{fields.do}: range_mm")
    found = {}
    for axis in state.cell.linear_axes:
        ends = inner.vector(axis.name, 2)
        if ends is not None:
            found[axis.name] = (ends[0] * 1e-3, ends[1] * 1e-3)
    inner.seen = [axis.name for axis in state.cell.linear_axes]
    inner.done()
    return found
