"""What a law may be off by: no assumed law is exact, so an effect's part of the readings may bend a little.

An effect's part of the readings is multiplied by smooth functions of what its law depends on - the torque or load it
acts on, apart for loading and unloading, its joint's angle, the clock - each of the size of the doubt about the law
(:attr:`fem.effects.base.Effect.law_doubt`). So real friction, which is no textbook's, is still friction, and what its
law misses is not named as a second effect.
"""

from __future__ import annotations

import numpy as np

from doe.estimation.problem import Problem
from fem.effects.base import Effect
from fem.effects.situation import Situation
from robots.arrays import Array, Bools


def bends(effect: Effect, p: Problem, situation: Situation, unloading: Bools) -> Array:
    """Smooth functions (m, d) of what an effect's law depends on; ``unloading`` (n,): of the loaded poses."""
    joints, joint, history = situation.model.robot.joint_names, effect.place, situation.history
    if effect.depends_on == "angle" and joint in joints:
        q = p.free.at.q[p.row, joints.index(joint)]
        return np.stack([f(k * q) for k in (1, 2, 3) for f in (np.cos, np.sin)], axis=1)
    if effect.depends_on == "clock":
        t = np.nan_to_num(history.clock)[p.row]
        return np.stack([np.cos(np.pi * k * t) for k in range(1, 5)], axis=1)
    if joint in joints:
        x = np.abs(situation.torque(joint))[p.row]
    else:
        x = np.linalg.norm(p.free.at.wrench[p.row, :3], axis=1)
    u = 2.0 * x / max(float(x.max(initial=0.0)), 1e-12) - 1.0
    powers = np.stack([u**k for k in range(4)], axis=1)
    if not (history.is_known and effect.needs_history):
        return powers[:, 1:]
    way = np.where(unloading[p.row], 1.0, -1.0)
    return np.hstack([powers[:, 1:], way[:, None] * powers[:, :3]])
