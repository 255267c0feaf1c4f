"""How far a pose is from the singularities, and which branch it stands in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.arrays import Array, Integers, in_blocks
from robots.errors import require_positive
from robots.inverse.axis_lines import axis_lines
from robots.inverse.spherical_wrist import SphericalWristArm, spherical_wrist_arm, why_not_spherical
from robots.kinematics import as_poses, forward_kinematics, jacobian
from robots.robot import Robot

# Smallest singular value of the Jacobian (lengths over the arm's) below which a pose is near a singular one: a hand
# then turns or moves in some direction a hundred times slower than its joints.
NEAR_SINGULAR = 0.01
# Poses whose frames are held at once.
BLOCK = 8_192


@dataclass(frozen=True)
class SingularityDistance:
    """Distances of n poses from singularities, (n,) each; 0 is singular.

    ``shoulder_m``: of the wrist centre from the plane through axis 1 along axis 2 (m). ``elbow_rad``: of the
    elbow from stretched or folded, at most pi/2. ``wrist_rad``: of the wrist from straight or folded (axes 4, 5
    and 6 in one plane). They are NaN for arms without a spherical wrist. ``sigma_min``: smallest singular value
    of the Jacobian at the tool point, with lengths counted in ``length_m``; any robot. It depends on that length
    and on the tool point, the other three do not.
    """

    shoulder_m: Array
    elbow_rad: Array
    wrist_rad: Array
    sigma_min: Array
    length_m: float


def singularity_distance(
    robot: Robot, q: Array, *, length_m: float | None = None, point: Array | None = None
) -> SingularityDistance:
    """Distances of poses q (n, dof) rad from the singularities.

    Parameters
    ----------
    length_m : makes the Jacobian dimensionless; default the arm's length stretched out
    point : as in :func:`robots.jacobian`

    Raises
    ------
    InputError
        Wrong shape, poses that are not finite, a length that is not positive.
    """
    q = as_poses(robot, q)
    length = axis_lines(robot).length if length_m is None else float(length_m)
    require_positive("length for the Jacobian", length, "m", "give one in m", code="B003")
    J = jacobian(robot, q, point)
    J = np.concatenate([J[:, :3] / length, J[:, 3:]], axis=1)
    sigma = np.asarray(np.linalg.svd(J, compute_uv=False)[:, -1], dtype=np.float64)
    shoulder, elbow, wrist = np.full((3, len(q)), np.nan)
    if why_not_spherical(robot) is None:
        shoulder, elbow, wrist = np.abs(configuration(spherical_wrist_arm(robot), robot, q))
        elbow, wrist = np.minimum(elbow, np.pi - elbow), np.minimum(wrist, np.pi - wrist)
    return SingularityDistance(shoulder, elbow, wrist, sigma, length)


def configuration(arm: SphericalWristArm, robot: Robot, q: Array) -> Array:
    """Signed shoulder (m), elbow and wrist (rad, within half a turn) coordinates of poses q (n, 6), as (3, n).

    Positive: front, up (in front), no flip. Their zeros are the singularities (elbow and wrist: pi as well).
    """
    centre = np.empty((len(q), 3))
    for rows in in_blocks(len(q), BLOCK):
        frames = forward_kinematics(robot, q[rows])
        centre[rows] = frames.p_flange + frames.R_flange @ arm.wrist.centre_flange - arm.p1
    x, y, _ = arm.B1.T @ centre.T
    shoulder = arm.front * (np.cos(q[:, 0]) * y - np.sin(q[:, 0]) * x)
    elbow = arm.elbow_up * _half_turn(arm.elbow_zero + arm.sign3 * q[:, 2])
    straight = 0.0 if arm.wrist.outward > 0.0 else np.pi
    return np.stack([shoulder, elbow, _half_turn(q[:, 4] + arm.wrist.zero + straight)])


def branch_of(robot: Robot, q: Array) -> Integers:
    """Index into :data:`robots.inverse.branches.BRANCHES` of poses q (n, 6) rad; any turn of the joints.

    At a singularity, where branches meet, rounding decides.

    Raises
    ------
    InputError
        Wrong shape, poses that are not finite, or a robot without a spherical wrist.
    """
    shoulder, elbow, wrist = configuration(spherical_wrist_arm(robot), robot, as_poses(robot, q))
    back = shoulder < 0.0
    down = np.where(back, elbow > 0.0, elbow < 0.0)
    return np.asarray(4 * back + 2 * down + (wrist < 0.0), dtype=np.int64)


def _half_turn(angle: Array) -> Array:
    return np.asarray(angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi)))
