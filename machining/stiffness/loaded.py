"""The arm under load: the complementary stiffness K_C and the compliance that it changes.

At equilibrium the springs hold the load, ``K_theta (theta - theta_0) = J^T w``. A small change gives
``(K_theta - K_C) dtheta = J^T dw`` with ``K_C = d(J^T)/dtheta w``, hence eq. 1 of Gao 2024
(doi:10.1109/ACCESS.2024.3435911, after Chen and Kao, Int. J. Robot. Res. 19 (2000) 835-847): w is the load *on* the
tool, and a load that pushes towards the base softens the arm.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

import fem
from fem.statics.loads import as_points, as_wrenches
from robots import InputError, Robot, forward_kinematics, jacobian
from robots.arrays import Array
from robots.kinematics import as_poses


def jacobian_derivative(robot: Robot, q: Array, point: Array | None = None) -> Array:
    """Exact derivative of :func:`robots.jacobian`: (n, 6, dof, dof), ``[:, :, i, j] = d J[:, :, i] / d q_j``.

    With joint axes z and origins p, and the tool at P: a joint nearer to the base turns what follows, so
    ``d(z_i x (P - p_i))/dq_j = z_a x (z_b x (P - p_b))`` with a the smaller and b the larger of i and j, and
    ``dz_i/dq_j = z_j x z_i`` for j < i, else zero.

    Arguments and errors as in :func:`robots.jacobian`.
    """
    q = as_poses(robot, q)
    frames = forward_kinematics(robot, q)
    axis = frames.axis * robot.sign[:, None]
    lin = np.swapaxes(jacobian(robot, q, as_points(point, len(q)))[:, :3], 1, 2)
    joints = np.arange(robot.dof)
    nearer = np.minimum(joints[:, None], joints)
    farther = np.maximum(joints[:, None], joints)
    out = np.empty((len(q), 6, robot.dof, robot.dof))
    out[:, :3] = np.moveaxis(np.cross(axis[:, nearer], lin[:, farther]), -1, 1)
    turned = np.cross(axis[:, None, :], axis[:, :, None])
    out[:, 3:] = np.moveaxis(turned * (joints[:, None] > joints)[:, :, None], -1, 1)
    return out


def complementary_stiffness(robot: Robot, q: Array, wrench: ArrayLike, point: Array | None = None) -> Array:
    """K_C (n, dof, dof) N m/rad: ``K_C[i, j] = d(J^T w)_i / d q_j`` for a wrench that keeps its size and direction.

    ``wrench`` (6,) or (n, 6): force N, moment N m on the tool, base axes, at the tool point, which it follows.
    Symmetric for a force; not for a moment, because a moment with fixed axes is not conservative.

    Raises
    ------
    InputError
        Shapes, or values that are not finite.
    """
    q = as_poses(robot, q)
    w = as_wrenches(wrench, len(q))
    return np.asarray(np.einsum("nkij,nk->nij", jacobian_derivative(robot, q, point), w))


def loaded_compliance(model: fem.ArmModel, q: Array, wrench: ArrayLike, point: Array | None = None) -> Array:
    """Compliance (n, 6, 6) of the arm in equilibrium at q under a wrench: what a small further load sees.

    The springs about the joint axes follow eq. 1, ``J (K_theta - K_C)^-1 J^T``, in a form that allows rigid joints
    and any number of joints; links, bearings, base and tool are added as without load. Springs that depend on
    angles count with their stiffness at q. With a parallelogram the springs sit between crank and upper arm.

    Raises
    ------
    InputError
        The load is beyond what the springs can hold (the model buckles); else as :func:`fem.compliance` and
        :func:`complementary_stiffness`.
    """
    robot = model.robot
    q = as_poses(robot, q)
    C = fem.compliance(model, q, point)
    J = spring_jacobian(model, q, point)
    own, K_C = _springs(model, q, wrench, point)
    _check_stable(own, K_C)
    unloaded = own[:, :, None] * np.eye(robot.dof)
    softened = np.linalg.solve(np.eye(robot.dof) - own[:, :, None] * K_C, unloaded)
    return np.asarray(C + J @ (softened - unloaded) @ np.swapaxes(J, 1, 2))


def softest_share(model: fem.ArmModel, q: Array, wrench: ArrayLike, point: Array | None = None) -> Array:
    """Largest part (n,) of the joint stiffness that the load takes away in any direction; at 1 the model buckles.

    It says whether K_C matters: below 0.01 the indices change by about a percent at most. Errors as in
    :func:`complementary_stiffness`.
    """
    return _largest_share(*_springs(model, as_poses(model.robot, q), wrench, point))


def spring_jacobian(model: fem.ArmModel, q: Array, point: Array | None = None) -> Array:
    """Velocity of the tool point by the turn of each joint's *spring*, (n, 6, dof).

    Equals :func:`robots.jacobian` but for a parallelogram, where the third actuator turns the forearm against the
    carousel. Errors as there.
    """
    q = as_poses(model.robot, q)
    return np.asarray(jacobian(model.robot, q, as_points(point, len(q))) @ _spring_turns(model))


def _springs(model: fem.ArmModel, q: Array, wrench: ArrayLike, point: Array | None) -> tuple[Array, Array]:
    """Compliances (n, dof) rad/(N m) of the springs about the axes, and K_C (n, dof, dof) by their turns."""
    own, B = np.stack([joint.axial.compliance(q) for joint in model.joints], axis=1), _spring_turns(model)
    return own, B.T @ complementary_stiffness(model.robot, q, wrench, point) @ B


def _spring_turns(model: fem.ArmModel) -> Array:
    """Joint coordinates by spring turns, (dof, dof): constant, because crank and lever stay parallel."""
    robot = model.robot
    B = np.diag(robot.sign)
    p = robot.parallelogram
    if model.bar is not None and p is not None:
        # The upper arm's actuator moves the elbow and leaves the forearm's direction as it is.
        B[p.driven, p.crank_about] = -robot.sign[p.driven]
    return B


def _largest_share(own: Array, K_C: Array) -> Array:
    root = np.sqrt(own)
    symmetric = 0.5 * (K_C + np.swapaxes(K_C, 1, 2))
    return np.asarray(np.linalg.eigvalsh(root[:, :, None] * symmetric * root[:, None, :])[:, -1])


def _check_stable(own: Array, K_C: Array) -> None:
    share = _largest_share(own, K_C)
    if not (share < 1.0).all():
        row = int(np.argmax(~(share < 1.0)))
        raise InputError(
            f"load at pose {row}: it takes away {share[row]:.3g} times the joint stiffness, and the model buckles",
            code="M006",
            allowed="less than 1",
            remedy="check the load's size (N, N m) and the joint stiffnesses (N m/rad)",
        )
