"""What a model knows already: springs and errors of its joints that are not free stay as they are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from doe.absolute.unknowns import (
    Unknown,
    coupling_error,
    frame_error,
    periodic_error,
    ratio_error,
    spring,
)
from fem import ArmModel
from fem.springs import ConstantSpring, SpringLaw
from robots import Robot


def known(model: ArmModel, free: Sequence[Unknown]) -> dict[Unknown, float]:
    """Springs and errors that the model has and that are not free, with the values of their variables."""
    return known_springs(model, free) | known_errors(model.robot, free)


def known_springs(model: ArmModel, free: Sequence[Unknown]) -> dict[Unknown, float]:
    """Springs that the model has and that are not free, with their compliances; those that vary with the pose aside."""
    taken = {one.index for one in free if one.kind == "spring"}
    found: dict[Unknown, float] = {}
    for joint in model.joints:
        values = [*joint.other, *_constant(joint.axial)]
        for row, c in enumerate(values):
            if c > 0.0 and (joint.joint, row) not in taken:
                found[spring(joint.name, joint.joint, row)] = float(c)
    for row, c in enumerate(np.diag(model.base)):
        if c > 0.0 and (-1, row) not in taken:
            found[spring("base", -1, row)] = float(c)
    return found


def _constant(law: SpringLaw) -> list[float]:
    return [1.0 / law.stiffness] if isinstance(law, ConstantSpring) else []


def known_errors(robot: Robot, free: Sequence[Unknown]) -> dict[Unknown, float]:
    """Errors of joints and their frames that the robot has and that are not free; its zeros are its own already."""
    errors, taken = robot.errors, {one.name for one in free}
    if errors is None:
        return {}
    found: dict[Unknown, float] = {}
    for j in range(robot.dof):
        for c, value in enumerate(errors.frames[j].tolist()):
            found[frame_error(robot, j, c)] = value
        for k, value in enumerate(errors.turn[j].tolist()):
            found[ratio_error(robot, j) if k == j else coupling_error(robot, j, k)] = value
        for phase, waves in enumerate((errors.sin, errors.cos)):
            for order, value in enumerate(waves[j].tolist(), start=1):
                found[periodic_error(robot, j, order, phase)] = value
    # Held numbers are no draws from a law whose size readings tell.
    return {replace(one, law="", sd=math.inf): v for one, v in found.items() if v != 0.0 and one.name not in taken}
