"""The command best_base: where the linear axes should put the robot for a point or a block of points."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from machining.cutting import ConstantForce
from machining.placement import Goal, Problem, find_fixed, space_of
from machining.placement.problem import Aim
from machining.service.asked import Arm
from machining.service.blocks import Block, block_of, collisions_of, course_payload, drive_of, gammas_of
from machining.service.fields import Fields
from machining.service.state import State, state_of, vectors_of
from machining.service.wire import numbers
from machining.stiffness.objective import Objective
from robots.arrays import Array

BASE_AIMS: Mapping[str, Aim] = {"mean": "mean", "worst": "worst", "ksf": "ksf"}


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
