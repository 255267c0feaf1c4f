"""Inverse kinematics by search: damped least squares from many starts, for arms without a closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robots.arrays import Array, Bools, Integers
from robots.inverse.axis_lines import axis_lines
from robots.kinematics import forward_kinematics, jacobian_at
from robots.robot import Robot

# Solutions closer than this in every joint (rad, whole turns aside) are one.
SAME_RAD = 1e-5
# A residual (m over the arm's length, rad) this small counts as met; what is kept is then improved once more.
MET = 1e-11
# A general 6R arm has at most 16 solutions (Raghavan and Roth 1993, doi:10.1115/1.2899218).
MOST_SOLUTIONS = 16
# A solution hit less often says that there may be others like it that were not hit at all.
FEWEST_HITS = 4
# Next to a singularity steps grow without bound; half a radian keeps the linear picture halfway true.
LONGEST_STEP_RAD = 0.6


@dataclass(frozen=True)
class Found:
    """What a search found for n targets.

    ``q`` (n, m, dof) rad in (-pi, pi], NaN where there are fewer than m; ``hits`` (n, m) how many starts ended
    there; ``starts`` (n,) how many there were; ``unseen`` (n,) estimated probability that one more start finds
    something new; ``sure`` (n,); ``beyond`` (n,) farther away than the arm can be long, so certainly no solution.
    """

    q: Array
    hits: Integers
    starts: Integers
    unseen: Array
    sure: Bools
    beyond: Bools


def refine(robot: Robot, q: Array, T_base_flange: Array, *, steps: int = 60) -> tuple[Array, Bools]:
    """Damped least squares from q (k, dof) rad to flange targets (k, 4, 4).

    Returns
    -------
    q : (k, dof) rad, where each start ended
    met : (k,) whether the residual is below 1e-11 (rotations in rad, positions over the arm's length)

    Notes
    -----
    Levenberg-Marquardt with damping equal to the squared residual (T. Sugihara, IEEE Transactions on Robotics 27
    (2011) 984, doi:10.1109/TRO.2011.2148230): quadratic near a regular solution, bounded steps next to singular
    ones, where convergence is slow and may stop short.
    """
    length = axis_lines(robot).length
    scale = np.array([1.0 / length] * 3 + [1.0] * 3)
    q, met = q.copy(), np.zeros(len(q), dtype=np.bool_)
    best, running = np.full(len(q), np.inf), np.arange(len(q))
    kept = q.copy()
    for _ in range(steps):
        if not len(running):
            break
        here = q[running]
        error, J = residual_and_jacobian(robot, here, T_base_flange[running])
        error, J = error * scale, J * scale[:, None]
        size = np.linalg.norm(error, axis=1)
        better = size < best[running]
        kept[running[better]], best[running[better]] = here[better], size[better]
        # Below the goal a further step or two reach rounding; where they no longer help, that is the end.
        done = ((size < MET) & ~better) | (size < 1e-15)
        met[running] |= size < MET
        Jt = np.swapaxes(J, 1, 2)
        damping = 0.05 * size**2 + 1e-14  # the last so that a matrix singular by structure can be solved
        step = np.linalg.solve(Jt @ J + damping[:, None, None] * np.eye(robot.dof), Jt @ error[..., None])[..., 0]
        longest = np.abs(step).max(axis=1)
        step *= np.minimum(1.0, LONGEST_STEP_RAD / np.maximum(longest, 1e-300))[:, None]
        q[running] = here + step
        running = running[~done]
    return kept, met


def residual_and_jacobian(robot: Robot, q: Array, T: Array) -> tuple[Array, Array]:
    """Way from the flange at q (k, dof) to the target (k, 4, 4), m and rad (rotation vector), (k, 6), base frame.

    With the geometric Jacobian (k, 6, dof) at the flange from the same pass of forward kinematics.
    """
    from scipy.spatial.transform import Rotation  # which arms with a closed form do not need

    frames = forward_kinematics(robot, q)
    turn = Rotation.from_matrix(T[:, :3, :3] @ np.swapaxes(frames.R_flange, 1, 2)).as_rotvec()
    residual = np.concatenate([T[:, :3, 3] - frames.p_flange, turn], axis=1)
    return residual, jacobian_at(robot, frames, frames.p_flange)


def search(
    robot: Robot,
    T_base_flange: Array,
    generator: np.random.Generator,
    *,
    starts: int = 64,
    most_starts: int = 512,
    most_solutions: int = MOST_SOLUTIONS,
) -> Found:
    """Search for all solutions of n flange targets (n, 4, 4), limits aside.

    Rounds of ``starts`` random poses (full turns in every joint) go on, for the targets that are not sure yet,
    up to ``most_starts`` in all.

    Notes
    -----
    Sure means: every solution was hit at least four times, and for six joints their number is even. (At a regular
    target it always is: the flange's motion is a smooth map from a closed manifold into a connected one of the
    same dimension that is not compact, so its degree modulo 2 is zero.) That is statistics, no proof: a solution
    whose basin of attraction is a share s of all starts stays unseen in N starts with probability (1 - s)^N.
    ``unseen`` is the Good-Turing estimate, the share of successful starts whose solution was hit once only (I. J.
    Good, Biometrika 40 (1953) 237, doi:10.1093/biomet/40.3-4.237). No solution at all is sure only where the target
    is farther away than the arm is long. With other than six joints nothing else is ever sure: more joints have
    solutions without number, fewer meet a target by exception.
    """
    n, dof = len(T_base_flange), robot.dof
    found = Found(
        q=np.full((n, most_solutions, dof), np.nan),
        hits=np.zeros((n, most_solutions), dtype=np.int64),
        starts=np.zeros(n, dtype=np.int64),
        unseen=np.ones(n),
        sure=np.zeros(n, dtype=np.bool_),
        beyond=_beyond(robot, T_base_flange),
    )
    found.sure[:] = found.beyond
    found.unseen[found.beyond] = 0.0
    while True:
        rows = np.flatnonzero(~found.sure & (found.starts < most_starts))
        if not len(rows):
            return found
        each = np.repeat(rows, starts)
        q, met = refine(robot, generator.uniform(-np.pi, np.pi, (len(each), dof)), T_base_flange[each])
        q = q - 2.0 * np.pi * np.ceil(q / (2.0 * np.pi) - 0.5)
        _enter(found, rows, q.reshape(len(rows), starts, dof), met.reshape(len(rows), starts))
        found.starts[rows] += starts
        _judge(found, rows, dof)


def _beyond(robot: Robot, T: Array) -> Bools:
    """Whether a target is farther from joint 1 than the way along the arm to the flange, (n,)."""
    lines = axis_lines(robot)
    return np.asarray(np.linalg.norm(T[:, :3, 3] - lines.point[0], axis=1) > lines.length * (1.0 + 1e-9))


def _enter(found: Found, rows: Integers, q: Array, met: Bools) -> None:
    """Count each start's end as a hit on a known solution, or enter it as a new one; a loop over starts."""
    for start in range(q.shape[1]):
        apart = q[:, start, None, :] - found.q[rows]
        with np.errstate(invalid="ignore"):  # NaN: places not taken yet
            same = np.abs(apart - 2.0 * np.pi * np.round(apart / (2.0 * np.pi))).max(axis=2) < SAME_RAD
        known, first_free = same.argmax(axis=1), (found.hits[rows] == 0).argmax(axis=1)
        place = np.where(same.any(axis=1), known, first_free)
        # All places taken and none the same: solutions without number, most hit once, so _judge is not sure.
        room = met[:, start] & (same.any(axis=1) | (found.hits[rows, first_free] == 0))
        new = room & ~same.any(axis=1)
        found.q[rows[new], place[new]] = q[new, start]
        found.hits[rows[room], place[room]] += 1


def _judge(found: Found, rows: Integers, dof: int) -> None:
    hits = found.hits[rows]
    count, total = (hits > 0).sum(axis=1), hits.sum(axis=1)
    found.unseen[rows] = np.where(total > 0, (hits == 1).sum(axis=1) / np.maximum(total, 1), 1.0)
    enough = np.where(hits > 0, hits, FEWEST_HITS).min(axis=1) >= FEWEST_HITS
    found.sure[rows] = (dof == 6) & enough & (count > 0) & (count % 2 == 0)
