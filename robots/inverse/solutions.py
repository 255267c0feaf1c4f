"""Inverse kinematics: all joint angles that bring the tool to given frames, with names and reasons."""

from __future__ import annotations

import numpy as np

from robots.arrays import Array, Bools
from robots.errors import InputError
from robots.frames import inverse
from robots.inverse.axis_lines import axis_lines
from robots.inverse.branches import BRANCH_NAMES, InverseSolutions, Reason, as_near, twins_of
from robots.inverse.closed_form import ClosedForm, closed_form
from robots.inverse.search import refine, search
from robots.inverse.skew_arm import SKEW_NAMES, skew_arm, solve_skew_arm
from robots.inverse.spherical_wrist import spherical_wrist_arm, why_no_spherical_wrist, why_not_spherical
from robots.inverse.turns import nearest_turn
from robots.kinematics import jacobian
from robots.robot import Robot

# Rotations from files are rounded; further off they are no rotations, and nobody knows what was meant.
ROTATION_TOLERANCE = 1e-6
# Smallest singular value (lengths over the arm's) at which a searched solution counts as singular.
SINGULAR = 1e-6


def inverse_kinematics(
    robot: Robot,
    T_base_tool: Array,
    *,
    T_flange_tool: Array | None = None,
    near: Array | None = None,
    generator: np.random.Generator | None = None,
) -> InverseSolutions:
    """All joint angles that bring the robot's tool to each of n frames.

    Arms with six joints, axes 4, 5, 6 through one point and 2 parallel to 3 are solved in closed form: eight
    branches, none lost. Where 2 and 3 are not parallel, a quartic gives up to eight solutions, but no names that
    mean anything. Where a file's rounding spoils such a picture slightly, the solutions of the nearest ideal arm
    are refined on the real one. All others are searched from random starts.

    Parameters
    ----------
    T_base_tool : (n, 4, 4), lengths in m
    T_flange_tool : (4, 4), or (n, 4, 4) one a target; default the robot's own tool; ``numpy.eye(4)`` for targets of
        the flange
    near : (6,) or (n, 6) rad: among equivalent angles the nearest to these are returned, and where a target leaves
        joints free (see :class:`robots.inverse.branches.InverseSolutions`) these are kept. Default: the middle of the
        ranges
    generator : for the random starts of a search, which needs one

    Raises
    ------
    InputError
        Frames of the wrong shape, not finite or not rigid; a search without a generator.
    """
    targets = as_frames(T_base_tool, "target frames")
    tool = robot.T_flange_tool if T_flange_tool is None else np.asarray(T_flange_tool, dtype=np.float64)
    tool = as_frames(tool[None] if tool.ndim == 2 else tool, "tool frame")
    if len(tool) not in (1, len(targets)):
        allowed = f"(4, 4) or ({len(targets)}, 4, 4)"
        raise InputError(
            "tool frame", code="B001", value=f"shape {tool.shape}", allowed=allowed, remedy="give one tool a target"
        )
    flange = targets @ inverse(tool)
    wanted = as_near(robot, near, len(targets))
    if why_not_spherical(robot) is None:
        arm = spherical_wrist_arm(robot)
        solved = closed_form(arm, flange, wanted)
        if arm.exact:
            return _exact(robot, solved, wanted)
        return _refined(robot, arm.deviation, BRANCH_NAMES, solved, flange, wanted)
    skew = skew_arm(robot)
    if skew is None:
        return _searched(robot, flange, wanted, generator)
    return _refined(robot, skew.deviation, SKEW_NAMES, solve_skew_arm(skew, flange, wanted), flange, wanted)


def why_no_closed_form(robot: Robot) -> str | None:
    """Say in words why :func:`inverse_kinematics` has to search for this robot; None if it need not."""
    if why_not_spherical(robot) is None or skew_arm(robot) is not None:
        return None
    return why_no_spherical_wrist(robot) or "joints 1 to 3 cannot move the wrist centre in all directions"


def _exact(robot: Robot, solved: ClosedForm, near: Array) -> InverseSolutions:
    n = len(near)
    reached = solved.reason == Reason.FOUND
    q, inside = nearest_turn(robot, solved.q, near[:, None])
    reason = np.where(reached & ~inside, np.int8(Reason.LIMITS), solved.reason)
    twin = _twins(q, reached, solved.singular)
    sure, unseen = np.ones(n, dtype=np.bool_), np.zeros(n)
    return InverseSolutions(robot, "closed form", BRANCH_NAMES, q, inside, reason, solved.singular, twin, sure, unseen)


def _refined(
    robot: Robot, deviation: float, names: tuple[str, ...], solved: ClosedForm, flange: Array, near: Array
) -> InverseSolutions:
    """Closed form of the neighbouring arm as starts; sure where every branch of it led to a solution of its own."""
    reached = solved.reason == Reason.FOUND
    target, column = np.nonzero(reached)
    q, reason = solved.q.copy(), solved.reason.copy()
    better, met = refine(robot, solved.q[target, column], flange[target])
    # Next to the edge of reach a branch may exist for the neighbour only, and a start may cross to another branch.
    moved = np.abs(better - solved.q[target, column]).max(axis=1, initial=0.0)
    q[target, column] = np.where(met[:, None], better, np.nan)
    reason[target[~met], column[~met]] = Reason.NOT_FOUND
    doubt = np.zeros(reached.shape, dtype=np.bool_)
    doubt[target, column] = ~met | (moved > 1e3 * deviation + 1e-6) | (_sigma_min(robot, better) < np.sqrt(deviation))
    reached = reason == Reason.FOUND
    q, inside = nearest_turn(robot, q, near[:, None])
    reason[reached & ~inside] = Reason.LIMITS
    twin = twins_of(q, reached)
    sure = np.asarray(~(doubt.any(axis=1) | twin.any(axis=1) | solved.singular.any(axis=(1, 2))))
    unseen = np.where(sure, 0.0, np.nan)
    return InverseSolutions(
        robot, "closed form, refined", names, q, inside, reason, solved.singular, twin, sure, unseen
    )


def _searched(robot: Robot, flange: Array, near: Array, generator: np.random.Generator | None) -> InverseSolutions:
    if generator is None:
        raise InputError(
            f"inverse kinematics of {robot.name} needs a search, because {why_no_closed_form(robot)}",
            code="B003",
            allowed="a random generator",
            remedy="pass generator=numpy.random.default_rng(0)",
        )
    found = search(robot, flange, generator)
    m = max(1, int((found.hits > 0).sum(axis=1).max(initial=0)))
    raw, reached = found.q[:, :m], found.hits[:, :m] > 0
    q, inside = nearest_turn(robot, raw, near[:, None])
    reason = np.where(reached, np.int8(Reason.FOUND), np.int8(Reason.NOT_FOUND))
    reason[found.beyond] = Reason.TOO_FAR
    reason[reached & ~inside] = Reason.LIMITS
    singular = np.zeros((*reached.shape, 3), dtype=np.bool_)
    if reached.any():
        singular[reached] = (_sigma_min(robot, raw[reached]) < SINGULAR)[:, None]
    sure = found.sure & ~singular.any(axis=(1, 2))
    names = tuple(f"solution {i + 1}" for i in range(m))
    twin = np.zeros(reached.shape, dtype=np.bool_)
    return InverseSolutions(robot, "numerical search", names, q, inside, reason, singular, twin, sure, found.unseen)


def _sigma_min(robot: Robot, q: Array) -> Array:
    """Smallest singular value of the flange's Jacobian at q (k, dof), lengths over the arm's length."""
    J = jacobian(robot, q, np.zeros(3))
    J[:, :3] /= axis_lines(robot).length
    return np.asarray(np.linalg.svd(J, compute_uv=False)[:, -1])


def _twins(q: Array, reached: Bools, singular: Bools) -> Bools:
    """Twins of the closed form: branches only meet at singularities, so only such targets are looked at."""
    twin = np.zeros(reached.shape, dtype=np.bool_)
    rows = np.flatnonzero(singular.any(axis=(1, 2)))
    if len(rows):
        twin[rows] = twins_of(q[rows], reached[rows])
    return twin


def as_frames(T: Array, what: str) -> Array:
    """Check rigid transforms (n, 4, 4); rotations rounded by a file's digits are made orthonormal."""
    T = np.asarray(T, dtype=np.float64)
    if T.ndim != 3 or T.shape[1:] != (4, 4):
        raise InputError(
            what, code="B001", value=f"shape {T.shape}", allowed="(n, 4, 4)", remedy="pass one frame a target"
        )
    finite = np.isfinite(T).all(axis=(1, 2))
    if not finite.all():
        row = int(np.flatnonzero(~finite)[0])
        raise InputError(
            f"{what}, number {row}",
            code="B001",
            value=T[row].tolist(),
            allowed="finite numbers",
            remedy="complete or remove it",
        )
    R = T[:, :3, :3]
    off = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(axis=(1, 2), initial=0.0)
    bottom = np.abs(T[:, 3] - np.array([0.0, 0.0, 0.0, 1.0])).max(axis=1, initial=0.0)
    bad = (off > ROTATION_TOLERANCE) | (bottom > ROTATION_TOLERANCE) | (np.linalg.det(R) < 0.0)
    if bad.any():
        row = int(np.flatnonzero(bad)[0])
        raise InputError(
            f"{what}, number {row}, is no rigid transform",
            code="B001",
            value=T[row].round(6).tolist(),
            allowed="a right-handed rotation matrix, a position, and 0 0 0 1 below",
            remedy="build it from unit axes, x cross y = z",
        )
    rounded = np.flatnonzero(off > 1e-14)
    if len(rounded):
        U, _, Vt = np.linalg.svd(R[rounded])
        T = T.copy()
        T[rounded, :3, :3] = U @ Vt
    return T
