"""How far the statics of small displacements hold: up to a turn of 0.05 rad.

Loads are put on the undeformed arm. Where a joint turns by ``t`` under its load, lever arms and directions turn with
it: they change by ``t`` of their length to first order, and so does the result. At 0.05 rad it is off by about 5 %, as
much as good measurements scatter; beyond, it says less with every step and soon nothing (a sag of 68 m for an arm of
3 m). The turn of a whole arm is taken as its tool's rotation, or its tool's displacement over the stretched arm's
length, whichever is larger. No arm of a known class comes near it under its payload (some 0.003 rad).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from robots import InputError, Robot
from robots.arrays import Array, Bools
from robots.kinematics import stretched_length
from robots.robot import trial_poses

if TYPE_CHECKING:
    from fem.model import ArmModel

# Key of the flag in answers and results.
FLAG = "beyond_small_displacements"
# Largest turn, rad.
LIMIT = 0.05
# Poses at which a model's softness is judged, drawn over its joint ranges.
POSES, TRIALS = 32, 512


def turn(robot: Robot, displacement: Array) -> Array:
    """By how much (n,), rad, an arm turns that moves its tool by (n, 3) m or (n, 6) m and rad."""
    d = np.atleast_2d(displacement)
    length = max(stretched_length(robot), 1e-9)
    moved = np.linalg.norm(np.nan_to_num(d[:, :3]), axis=1) / length
    return np.asarray(np.maximum(moved, np.linalg.norm(np.nan_to_num(d[:, 3:]), axis=1)))


def beyond_small(robot: Robot, displacement: Array) -> Bools:
    """Which (n,) of these displacements linear statics cannot give; arguments as of :func:`turn`."""
    return np.asarray(turn(robot, displacement) > LIMIT)


def refuse_beyond(robot: Robot, displacement: Array, what: str) -> None:
    """Raise InputError where any displacement is beyond small ones; arguments as of :func:`turn`."""
    turned = turn(robot, displacement)
    if (turned > LIMIT).any():
        worst = int(np.argmax(turned))
        moved = float(np.linalg.norm(np.nan_to_num(np.atleast_2d(displacement)[worst, :3])))
        raise InputError(
            f"{what}: beyond small displacements, for which alone the model holds",
            code="M006",
            value=f"the tool moves by {moved * 1e3:.4g} mm, the arm turns by {turned[worst]:.3g} rad",
            allowed=f"a turn of up to {LIMIT:g} rad, as {LIMIT * stretched_length(robot) * 1e3:.3g} mm at the tool",
            remedy="check the load (N) and the model's stiffnesses (N m/rad, N/m)",
        )


def worst_turns(model: ArmModel) -> Array:
    """Turn (k,), rad, of the arm under 1 N in the direction that moves its tool most, at k poses.

    Up to POSES of them, drawn over the joint ranges with couplings and limits kept; none where no such pose was found.
    """
    from fem.compiled.compliance import compliance

    q = trial_poses(model.robot, TRIALS, POSES)
    if not len(q):
        return np.zeros(0)
    C = compliance(model, q)
    direction = np.linalg.svd(C[:, :3, :3])[2][:, 0]
    return turn(model.robot, np.einsum("nij,nj->ni", C[:, :, :3], direction))
