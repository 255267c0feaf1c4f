"""Posture at points: the angle gamma about the tool axis and the branch that make the arm stiffest (Gao 2024, eq. 15).

doi:10.1109/ACCESS.2024.3435911. Each point is looked at by itself, as in the paper; for a path that can be driven see
:mod:`machining.posture.path`. Limits of the joints are kept, collisions are not looked at.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

import fem
from machining.stiffness.compiled import fast_sweep
from machining.stiffness.objective import Objective
from machining.task import Task, as_gammas
from machining.toolpaths.path_error import PathError
from robots import InputError, Reason, inverse_kinematics, require_at_least, require_positive
from robots.arrays import Array, Bools, Integers
from robots.frames import inverse
from robots.inverse.branches import BRANCH_NAMES
from robots.inverse.following import about, follow, is_redundant
from robots.inverse.turns import nearest_turn

# Targets a call of the inverse kinematics: bounds its memory, not the result.
TARGETS = 100_000
# Angles of a finer grid about a peak or a course: four cells to either side.
OFFSETS = np.linspace(-1.0, 1.0, 9)
# Turns of the elbow about a course, where gamma varies as well.
FIVE = np.linspace(-1.0, 1.0, 5)
# Columns of an arm whose elbow can turn: of a single gamma, and of many, which come to about as many states together.
COLUMNS, STATES, FEWEST_COLUMNS = 48, 1_500, 8
# Rad of gamma at which refinement ends.
TOLERANCE = 1e-5
# A full turn whose ends are this close (rad) is closed: its first and last angle are one.
CLOSED = 1e-9


@dataclass(frozen=True)
class GammaRange:
    """Angles gamma from ``lower`` to ``upper`` rad, ``count`` of them; a full turn counts its two ends once.

    Raises
    ------
    InputError
        An empty range, one of more than a turn, or fewer than two angles.
    """

    lower: float = -np.pi
    upper: float = np.pi
    count: int = 72

    def __post_init__(self) -> None:
        width = self.upper - self.lower
        if not 0.0 < width <= 2.0 * np.pi + CLOSED:
            raise InputError(
                "range of gamma",
                code="G004",
                value=f"{np.degrees(self.lower):g} to {np.degrees(self.upper):g} deg",
                allowed="lower below upper, at most 360 deg apart",
                remedy="for one angle use postures_at",
            )
        require_at_least("number of angles gamma", self.count, 2, code="G004")

    @classmethod
    def of_degrees(cls, lower: float, upper: float, step: float) -> GammaRange:
        """The range from ``lower`` to ``upper`` deg whose angles are nearly ``step`` deg apart.

        Raises
        ------
        InputError
            As for the range, or a step that is not above 0.
        """
        require_positive("step of gamma", step, "deg", code="G004")
        cells = max(1, round((upper - lower) / step))
        whole = cls(np.radians(lower), np.radians(upper))
        return cls(whole.lower, whole.upper, max(2, cells if whole.closed else cells + 1))

    @property
    def closed(self) -> bool:
        """Whether it is a full turn."""
        return self.upper - self.lower > 2.0 * np.pi - CLOSED

    @property
    def cell(self) -> float:
        """Rad from one angle to the next."""
        return (self.upper - self.lower) / (self.count if self.closed else self.count - 1)

    @property
    def angles(self) -> Array:
        """The angles (count,) rad."""
        return np.linspace(self.lower, self.upper, self.count, endpoint=not self.closed)

    def inside(self, gamma: Array) -> Array:
        """Bring angles into the range: by whole turns if it is closed, else to its nearer end."""
        if self.closed:
            return np.asarray(self.lower + np.mod(gamma - self.lower, 2.0 * np.pi))
        return np.clip(gamma, self.lower, self.upper)


@dataclass(frozen=True, eq=False)
class Sweep:
    """All postures of n points, m angles gamma and b branches.

    ``gamma`` (n, m) rad; ``q`` (n, m, b, dof) rad; ``valid`` (n, m, b); ``value`` (n, m, b) of the objective, NaN
    where not valid; ``reason`` (n, m, b) as in :class:`robots.InverseSolutions`; ``names`` (b,) of the branches;
    ``sure`` (n, m): all solutions were found.
    """

    objective: Objective
    gamma: Array
    q: Array
    valid: Bools
    value: Array
    reason: NDArray[np.int8]
    names: tuple[str, ...]
    sure: Bools

    @property
    def merit(self) -> Array:
        """Value with large is good, -inf where not valid, (n, m, b)."""
        return np.asarray(np.where(self.valid, self.objective.sign * self.value, -np.inf))

    def at(self, rows: slice) -> Sweep:
        """That of some of the points."""
        parts = {name: getattr(self, name)[rows] for name in ("gamma", "q", "valid", "value", "reason", "sure")}
        return replace(self, **parts)

    def at_angles(self, at: Integers) -> Sweep:
        """That of one angle (n,) a point."""
        names = ("gamma", "q", "valid", "value", "reason", "sure")
        rows = np.arange(len(at))
        return replace(self, **{name: getattr(self, name)[rows, at][:, None] for name in names})

    @property
    def lost(self) -> Integers:
        """Points (k,) that cannot be reached at any angle."""
        return np.flatnonzero(~self.valid.any(axis=(1, 2)))

    def check_reached(self) -> None:
        """Raise InputError if a point cannot be reached at any angle; it names the points and the reasons."""
        if len(self.lost):
            raise self.unreached(self.lost)

    def best_merit(self) -> Array:
        """The largest merit (n,) at each point. Raises InputError as :meth:`check_reached`."""
        self.check_reached()
        return np.asarray(self.merit.max(axis=(1, 2)))

    def unreached(self, lost: Integers, start: int = 0) -> PathError:
        """The error of points ``lost`` of a path, of which the first is here; ``start``: the path's number of row 0."""
        first = int(lost[0]) - start
        found = Counter(self.reason[first].ravel().tolist())
        why = "; ".join(
            f"{times} of {self.reason[first].size} {Reason(code).words}"
            for code, times in found.most_common()
            if Reason(code) is not Reason.NO_SUCH
        )
        more = f" (and {len(lost) - 1} more: {', '.join(map(str, lost[1:6]))}{' ...' if len(lost) > 6 else ''})"
        return PathError(
            lost,
            f"path point {int(lost[0])}{more if len(lost) > 1 else ''} cannot be reached at any of "
            f"{self.gamma.shape[1]} angles gamma from {np.degrees(self.gamma[first].min()):.4g} to "
            f"{np.degrees(self.gamma[first].max()):.4g} deg",
            code="G001",
            value=why or "no solution was found",
            allowed="one branch within joint limits",
            remedy="move the part, change the tool or its axis, or widen the range of gamma",
        )


@dataclass(frozen=True, eq=False)
class Postures:
    """One posture a point: ``gamma`` (n,) rad, ``q`` (n, dof) rad, ``value`` (n,), ``branch`` (n,) into ``names``."""

    gamma: Array
    q: Array
    value: Array
    branch: Integers
    names: tuple[str, ...]


def sweep_gamma(
    model: fem.ArmModel,
    task: Task,
    objective: Objective,
    gamma: ArrayLike,
    *,
    generator: np.random.Generator | None = None,
) -> Sweep:
    """Value of every branch at every point and angle; gamma (m,) or (n, m) rad.

    ``generator`` as in :func:`robots.inverse_kinematics`, for arms without a closed form. Their columns are
    solutions in no fixed order, not branches; those of arms with more than six joints are postures followed along the
    path (:mod:`robots.inverse.following`), a column of gamma by itself. Large sweeps go by compiled loops where that
    can be done (:mod:`machining.stiffness.compiled`), with the same results to rounding.

    Raises
    ------
    InputError
        As :class:`Objective`, :func:`robots.inverse_kinematics` and :func:`fem.deflection`.
    """
    angle = as_gammas(gamma, task.path.n)
    if is_redundant(model.robot):
        return _followed(model, task, objective, angle, generator)
    n, m = angle.shape
    fast = fast_sweep(model, task, objective.quantity, objective.forces(n), angle)
    if fast is None:
        q, reason, names, sure = _solved(model, task, angle, generator)
        value = None
    else:
        q, reason, value = fast
        names, sure = BRANCH_NAMES, np.ones(n * m, dtype=np.bool_)
    if value is not None:
        valid = reason == Reason.FOUND
        objective.check_finite(value[valid], np.nonzero(valid)[0] // m)
    shape = (n, m, len(names))
    solved = q.reshape(*shape, -1), reason.reshape(shape), names, sure.reshape(n, m)
    return _swept(model, task, objective, angle, *solved, None if value is None else value.reshape(shape))


def _swept(
    model: fem.ArmModel,
    task: Task,
    objective: Objective,
    gamma: Array,
    q: Array,
    reason: NDArray[np.int8],
    names: tuple[str, ...],
    sure: Bools,
    value: Array | None = None,
) -> Sweep:
    """A sweep of postures that are known, with the objective's ``value`` of them if that is known as well."""
    valid = reason == Reason.FOUND
    if value is None:
        value = np.full(valid.shape, np.nan)
        value[valid] = objective.values(model, q[valid], task, np.nonzero(valid)[0])
    return Sweep(objective, gamma, q, valid, value, reason, names, sure)


def _followed(
    model: fem.ArmModel, task: Task, objective: Objective, gamma: Array, generator: np.random.Generator | None
) -> Sweep:
    """The sweep of an arm whose elbow can turn: columns are postures followed along the path."""
    keep = int(np.clip(STATES // gamma.shape[1], FEWEST_COLUMNS, COLUMNS))
    frames = flange_frames(task, gamma)
    q, reason = follow(model.robot, frames, generator or np.random.default_rng(0), keep)
    q, _ = nearest_turn(model.robot, q, model.robot.limits.mean(axis=1))
    names = tuple(f"elbow course {i + 1}" for i in range(keep))
    return _swept(model, task, objective, gamma, q, reason, names, np.zeros(gamma.shape, dtype=np.bool_))


def sweep_about(
    model: fem.ArmModel, task: Task, objective: Objective, gamma: ArrayLike, q: Array, offsets: Array
) -> Sweep:
    """Values of the postures next to a course q (n, dof) rad of an arm whose elbow can turn.

    ``gamma`` (m,) or (n, m) rad; ``offsets`` (s,) rad of the joint that moves most along the arm's self-motion, a
    column of the sweep each. Errors as :func:`sweep_gamma`.
    """
    angle = as_gammas(gamma, task.path.n)
    n, m = angle.shape
    frames = flange_frames(task, angle).reshape(n * m, 4, 4)
    found, reason = about(model.robot, np.repeat(q, m, axis=0), frames, offsets)
    shape, names = (n, m, len(offsets)), tuple(f"elbow {np.degrees(offset):+.4g} deg" for offset in offsets)
    sure = np.zeros((n, m), dtype=np.bool_)
    return _swept(model, task, objective, angle, found.reshape(*shape, -1), reason.reshape(shape), names, sure)


def flange_frames(task: Task, gamma: Array) -> Array:
    """Frames (n, m, 4, 4) of the flange in the base for gamma (n, m) rad."""
    tool = inverse(task.T_flange_tool if task.T_flange_tool.ndim == 3 else task.T_flange_tool[None])
    return np.asarray(task.tool_frames(gamma) @ tool[:, None])


def _solved(
    model: fem.ArmModel, task: Task, angle: Array, generator: np.random.Generator | None
) -> tuple[Array, NDArray[np.int8], tuple[str, ...], Bools]:
    """Of all k targets: q (k, b, dof), reason (k, b), names (b,) of the branches, and whether they are all (k,)."""
    frames = task.tool_frames(angle).reshape(-1, 4, 4)
    point = np.repeat(np.arange(task.path.n), angle.shape[1])
    parts = [
        inverse_kinematics(
            model.robot,
            frames[i : i + TARGETS],
            T_flange_tool=task.tool_at(point[i : i + TARGETS]),
            generator=generator,
        )
        for i in range(0, len(frames), TARGETS)
    ]
    names = max((part.names for part in parts), key=len)
    q = np.full((len(frames), len(names), model.robot.dof), np.nan)
    reason = np.full(q.shape[:2], np.int8(Reason.NO_SUCH))
    for i, part in enumerate(parts):
        rows, b = slice(i * TARGETS, i * TARGETS + len(part.q)), len(part.names)
        q[rows, :b], reason[rows, :b] = part.q, part.reason
    return q, reason, names, np.concatenate([part.sure for part in parts])


def best_of(sweep: Sweep) -> Postures:
    """Best posture of each point among those of a sweep.

    Raises
    ------
    InputError
        A point that cannot be reached.
    """
    sweep.check_reached()
    return _best_known(sweep)


def _best_known(sweep: Sweep) -> Postures:
    """Best posture of each point; the value is NaN at points that have none."""
    n, _, b = sweep.valid.shape
    rows, best = np.arange(n), sweep.merit.reshape(n, -1).argmax(axis=1)
    at, branch = np.divmod(best, b)
    found = rows, at, branch
    return Postures(sweep.gamma[rows, at], sweep.q[found], sweep.value[found], branch, sweep.names)


def postures_at(
    model: fem.ArmModel,
    task: Task,
    objective: Objective,
    gamma: float | Array,
    *,
    generator: np.random.Generator | None = None,
) -> Postures:
    """Best branch of each point at a given gamma, one for all or (n,) rad. Errors as :func:`best_of`."""
    angle = np.broadcast_to(np.asarray(gamma, dtype=np.float64), (task.path.n,))
    return best_of(sweep_gamma(model, task, objective, angle[:, None], generator=generator))


def best_postures(
    model: fem.ArmModel,
    task: Task,
    objective: Objective,
    gammas: GammaRange | None = None,
    *,
    sweep: Sweep | None = None,
    starts: int = 3,
    tolerance: float = TOLERANCE,
    generator: np.random.Generator | None = None,
) -> Postures:
    """Best posture of each point over gamma and all branches: grid, then refined about the ``starts`` best peaks.

    A peak narrower than a cell of the grid can be missed; more angles find it.

    Parameters
    ----------
    gammas : the range and grid, default a full turn in 5 deg
    sweep : that of ``gammas``, if it is there already
    starts : peaks of the grid that are refined at each point; 0 gives the grid's best
    tolerance : rad, of gamma

    Raises
    ------
    InputError
        A point that cannot be reached; else as :func:`sweep_gamma`.
    """
    gammas = gammas or GammaRange()
    sweep = sweep or sweep_gamma(model, task, objective, gammas.angles, generator=generator)
    best = best_of(sweep)
    if starts < 1:
        return best

    def look(gamma: Array) -> Sweep:
        return sweep_gamma(model, task, objective, gamma, generator=generator)

    centre = refined_peaks(
        gammas, sweep.merit.max(axis=2), lambda gamma: look(gamma).merit.max(axis=2), starts, tolerance
    )
    fine = _best_known(look(centre))
    better = objective.sign * fine.value > objective.sign * best.value
    return Postures(
        np.where(better, fine.gamma, best.gamma),
        np.where(better[:, None], fine.q, best.q),
        np.where(better, fine.value, best.value),
        np.where(better, fine.branch, best.branch),
        max(best.names, fine.names, key=len),
    )


def refined_peaks(
    gammas: GammaRange, merit: Array, look: Callable[[Array], Array], starts: int, tolerance: float = TOLERANCE
) -> Array:
    """Gamma (n, starts) rad of each point's highest peaks of ``merit`` (n, m) on the grid, refined to ``tolerance``.

    ``look``: merit (n, k) at angles (n, k) rad. Where there are fewer peaks the highest is there again.
    """
    pad = ((0, 0), (1, 1))
    around = np.pad(merit, pad, mode="wrap") if gammas.closed else np.pad(merit, pad, constant_values=-np.inf)
    peak = np.isfinite(merit) & (merit >= around[:, :-2]) & (merit >= around[:, 2:])
    order = np.argsort(-np.where(peak, merit, -np.inf), axis=1, kind="stable")[:, :starts]
    order = np.where(np.take_along_axis(peak, order, axis=1), order, order[:, :1])
    centre, half = gammas.angles[order], gammas.cell
    while half > tolerance:
        trial = gammas.inside(centre[..., None] + half * OFFSETS)
        best = look(trial.reshape(len(merit), -1)).reshape(trial.shape).argmax(axis=2)
        centre = np.take_along_axis(trial, best[..., None], axis=2)[..., 0]
        half /= 4.0
    return np.asarray(centre)
