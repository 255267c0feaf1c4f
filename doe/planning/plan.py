"""Which poses, loads and directions to measure next, given what is known already, and what that will tell."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from doe.estimation.noise import Noise
from doe.planning.optimal_choice import Choice, Criterion, choose, judge, random_values
from doe.planning.outset import Outset
from doe.planning.protocol import Protocol
from fem.free.parameters import Parameter
from fem.statics.loads import LoadedPoses
from robots.arrays import Array, Bools
from robots.constants import NORMAL_95
from robots.progress import Progress

# Random plans are drawn up to so many times as many set-ups as chosen ones.
RANDOM_REACH = 4
# Of random plans: one in ten is better, half are, nine in ten are.
QUANTILES = (0.1, 0.5, 0.9)
# Columns below this share of the largest are moved by no reading.
BLIND = 1e-9
# Other values tried of a coordinate in each pose.
TRIALS = 4
# Information that changes by less than this share is the same.
SAME = 1e-6


@dataclass(frozen=True)
class Foresight:
    """What a plan will tell about one parameter.

    ``before``, ``after``: standard deviations of ln value (positive ones) or of the value, the vague prior included;
    ``planned_for``: its value at which that holds; ``seen``: whether a reading of the plan moves with it at all.
    Both are by the readings' noise alone. ``half95``: half width of the 95 % interval of the same, with the model's
    lack of fit, that aims to be kept in nine campaigns of ten (:mod:`doe.planning.forecast`); None before it was
    foretold.
    """

    parameter: Parameter
    planned_for: float
    before: float
    after: float
    seen: bool
    half95: float | None = None

    @property
    def shrink(self) -> float:
        """How many times narrower the interval gets, if the model misses nothing."""
        return self.before / self.after

    @property
    def promised(self) -> float:
        """A 1.96th of the half width promised: the standard deviation that the plan answers for."""
        return self.after if self.half95 is None else self.half95 / NORMAL_95

    @property
    def promised_shrink(self) -> float:
        """How many times narrower than before the promised interval is."""
        return self.before / self.promised


@dataclass(frozen=True)
class MeasurementPlan:
    """n new set-ups: ``q`` (n, dof) rad, ``direction`` (n, 3), and what they will tell.

    ``value`` of the criterion, smaller is better (D: ln det of the covariance; A: mean share of the vague prior's
    variance that is left; I: mean variance of predictions, mm^2). ``random`` (m, 3): the same for 1 to m set-ups
    chosen at random, as quantiles 0.1, 0.5 and 0.9; without rows for a plan that was not chosen.
    """

    q: Array
    direction: Array
    protocol: Protocol
    foresight: tuple[Foresight, ...]
    criterion: Criterion
    value: float
    random: Array

    @property
    def random_median(self) -> float:
        """Value of the median random plan of the same size; NaN if none was drawn."""
        return float(self.random[len(self.q) - 1, 1]) if len(self.random) else np.nan

    @property
    def random_needed(self) -> int | None:
        """How many set-ups chosen at random it takes (in the median) to be as good; None: more than were tried."""
        enough = np.flatnonzero(self.random[:, 1] <= self.value) if len(self.random) else np.zeros(0, dtype=np.int64)
        return int(enough[0]) + 1 if enough.size else None

    def per_parameter(self, value: float | Array) -> Array:
        """A criterion's value as a standard deviation: of the mean seen parameter (D, A) or prediction (I, mm).

        D: geometric mean of the standard deviations along the covariance's axes, unseen parameters left out.
        A: root mean square, as a share of the vague prior's.
        """
        if self.criterion != "D":
            return np.asarray(np.sqrt(value))
        unseen = [f for f in self.foresight if not f.seen]
        constant = sum(2.0 * float(np.log(f.after)) for f in unseen)
        seen = max(len(self.foresight) - len(unseen), 1)
        return np.asarray(np.exp((np.asarray(value) - constant) / (2.0 * seen)))


def plan(
    start: Outset,
    poses: Array,
    n: int,
    protocol: Protocol,
    criterion: Criterion = "D",
    *,
    workspace: LoadedPoses | None = None,
    rng: np.random.Generator,
    starts: int = 4,
    progress: Progress | None = None,
) -> MeasurementPlan:
    """Choose n set-ups among ``poses`` (N, dof) rad x the protocol's directions.

    Parameters
    ----------
    start : what is known so far, and the noise to expect
    workspace : for the I criterion: loaded poses at which the model shall predict well (default: the candidates)

    Raises
    ------
    InputError
        Bad protocol or criterion, or fewer candidates than set-ups.
    """
    candidates = experiments(start, poses, protocol)
    weight = criterion_weight(start, criterion, workspace or _all(start, poses, protocol))
    found = choose(start.known, candidates, n, criterion, weight=weight, rng=rng, starts=starts, progress=progress)
    most = min(RANDOM_REACH * n, len(candidates))
    random = random_values(start.known, candidates, most, criterion, weight, rng)
    pose, direction = np.divmod(found.chosen, len(protocol.directions))
    return MeasurementPlan(
        poses[pose],
        protocol.directions[direction],
        protocol,
        _foresight(start, candidates, found),
        criterion,
        found.value,
        np.quantile(random, QUANTILES, axis=0).T,
    )


def foresee(start: Outset, poses: Array, protocol: Protocol, criterion: Criterion = "D") -> MeasurementPlan:
    """What measuring all ``poses`` (n, dof) under all directions will tell: a plan that nobody chose."""
    candidates = experiments(start, poses, protocol)
    weight = criterion_weight(start, criterion, _all(start, poses, protocol))
    found = judge(start.known, candidates, np.arange(len(candidates)), criterion, weight)
    d = len(protocol.directions)
    return MeasurementPlan(
        np.repeat(poses, d, axis=0),
        np.tile(protocol.directions, (len(poses), 1)),
        protocol,
        _foresight(start, candidates, found),
        criterion,
        found.value,
        np.zeros((0, 3)),
    )


def _all(start: Outset, poses: Array, protocol: Protocol) -> LoadedPoses:
    return protocol.every(start.free.model, poses, protocol.forces)


def experiments(start: Outset, poses: Array, protocol: Protocol) -> Array:
    """Factors (N d, r, p) of the information of every pose and direction, poses slowest; r components read.

    A displacement is proportional to the force, so all forces of one set-up tell the same in the same direction:
    they are one row, weighed with their joint information ``F^T V^-1 F``.
    """
    at = protocol.every(start.free.model, poses, np.ones(1))
    return factors(start, *replace(start.free, at=at, history=None).evaluate(start.u), protocol)


def factors(start: Outset, value: Array, J: Array, protocol: Protocol) -> Array:
    """Factors (n, r, p) by displacements (n, 6) under 1 N at the variables of ``start``, and derivatives (n, 6, p)."""
    read = list(protocol.components)
    weight = np.stack([_weight(start.noise, value[:, k], k >= 3, protocol) for k in read], axis=1)
    return np.asarray(np.sqrt(weight)[:, :, None] * J[:, read] * start.slopes)


def _weight(noise: Noise, per_newton: Array, turn: bool, protocol: Protocol) -> Array:
    """Information (s,) of one component's readings about its displacement under 1 N."""
    F = protocol.forces
    f = per_newton[:, None] * F
    variance = (noise.white[int(turn)] ** 2 + (noise.share * f) ** 2) / protocol.repeats
    V = noise.pose[int(turn)] ** 2 + noise.pose_share**2 * f[:, :, None] * f[:, None, :]
    V = np.broadcast_to(V, (len(f), F.size, F.size)).copy()
    d = np.arange(F.size)
    V[:, d, d] += variance
    return np.asarray(np.linalg.solve(V, np.broadcast_to(F[:, None], (len(f), F.size, 1)))[:, :, 0] @ F)


def expected(start: Outset, q: Array, force: Array, protocol: Protocol) -> Array | None:
    """Displacements (n, 6) m and rad to expect at poses q (n, dof) under forces (n, 3) N; None before any reading."""
    if start.best is None:
        return None
    return replace(start.free, at=protocol.loaded(start.free.model, q, force), history=None).evaluate(start.best)[0]


def criterion_weight(start: Outset, criterion: Criterion, workspace: LoadedPoses) -> Array | None:
    """Weight (p, p) of the A and I criteria.

    A: parameters have different units, so each variance counts as a share of what it was before any reading.
    I: mean of the derivatives' products over predictions of translations, mm.
    """
    if criterion == "A":
        return np.diag(1.0 / start.vague**2) / len(start.u)
    if criterion == "I":
        J = replace(start.free, at=workspace, history=None).evaluate(start.u)[1][:, :3].reshape(-1, len(start.u))
        J = J * start.slopes * 1e3
        return np.asarray(J.T @ J / len(workspace))
    return None


def seen_by(candidates: Array, vague: Array) -> Bools:
    """Which parameters (p,) any of the experiments (N, r, p) moves with; vague (p,): their standard deviations."""
    norm = np.linalg.norm(candidates.reshape(-1, candidates.shape[2]) * vague, axis=0)
    return np.asarray(norm > BLIND * max(float(norm.max(initial=0.0)), 1e-300))


def _foresight(start: Outset, candidates: Array, choice: Choice) -> tuple[Foresight, ...]:
    before, after = np.sqrt(np.diag(np.linalg.inv(start.known))), np.sqrt(np.diag(choice.covariance))
    # A parameter that no candidate moves with may still be known from the readings so far.
    visible = seen_by(candidates[choice.chosen], start.vague)
    rows = zip(start.parameters, start.u, before, after, visible, strict=True)
    return tuple(Foresight(q, q.outer(float(u)), float(a), float(b), bool(s)) for q, u, a, b, s in rows)


def idle_coordinates(start: Outset, protocol: Protocol, poses: Array, rng: np.random.Generator) -> tuple[str, ...]:
    """Coordinates whose value changes nothing of what any experiment tells, as in q1 under a vertical load.

    Each is moved alone, in ``poses`` (n, dof) rad, to other values that the robot can take; where there are none
    it is not called idle.
    """
    robot = start.free.model.robot
    at = _information(start, poses, protocol)
    # Each parameter against the most that any pose tells of it.
    size = np.sqrt(np.max(np.diagonal(at, axis1=2, axis2=3), axis=(0, 1)))
    scale = np.where(size > 0.0, size, 1.0)
    out = []
    for k, name in enumerate(robot.coordinates):
        low, high = robot.limits[k]
        moved = np.repeat(poses, TRIALS, axis=0)
        moved[:, k] = low + rng.random(len(moved)) * (high - low)
        allowed = np.flatnonzero(robot.reachable(moved))
        if not allowed.size:
            continue
        change = _information(start, moved[allowed], protocol) - at[allowed // TRIALS]
        if np.abs(change / np.outer(scale, scale)).max() < SAME:
            out.append(name)
    return tuple(out)


def _information(start: Outset, poses: Array, protocol: Protocol) -> Array:
    """Information (n, d, p, p) of each pose and direction."""
    B = experiments(start, poses, protocol)
    p = B.shape[2]
    return np.asarray((np.swapaxes(B, 1, 2) @ B).reshape(len(poses), -1, p, p))
