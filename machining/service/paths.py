"""The command best_path: posture along a block of points, as one course that can be driven."""

from __future__ import annotations

from typing import Any

import numpy as np

from machining.posture.long_path import optimise_long_path
from machining.posture.problem import course_at
from machining.service.asked import Arm, generator
from machining.service.blocks import block_of, collisions_of, course_payload, drive_of, gammas_of, objective_of
from machining.service.fields import Fields
from machining.service.state import state_of


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
