"""Which poses, loads and directions to measure next, given what is measured already, and what that will tell."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from doe.estimate import Estimate, prior_residual
from doe.noise import Blocks, Noise
from doe.optimal_choice import Choice, Criterion, Progress, choose, judge
from doe.problem import Problem
from doe.uncertainty import Certainty
from fem.free_model import FreeModel, LoadedPoses
from fem.parameters import Parameter
from robots import InputError

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# What is known of a positive parameter before any reading: a factor of this to either side, one standard deviation.
VAGUE = math.log(30.0)
# Where the data leave a stiffness open, the plan is made for this share of the softest one they allow.
OPEN_SHARE = 1.0
# Random plans that the choice is compared with.
RANDOM_PLANS = 200


@dataclass(frozen=True)
class Protocol:
    """What is done in every new pose.

    ``forces`` (l,) N; ``directions`` (d, 3) unit vectors, base axes: each new set-up takes one of them with all the
    forces; ``components``: what is read (0..5); ``repeats`` of each force.
    """

    forces: Array
    directions: Array
    components: tuple[int, ...] = (2,)
    repeats: int = 1

    def __post_init__(self) -> None:
        length = np.linalg.norm(self.directions, axis=1) if self.directions.ndim == 2 else np.zeros(0)
        if self.directions.shape[1:] != (3,) or not np.allclose(length, 1.0):
            raise InputError("directions of a plan", value=self.directions.tolist(), allowed="unit vectors (d, 3)")
        if self.forces.size == 0 or not (np.isfinite(self.forces) & (self.forces > 0.0)).all():
            raise InputError("forces of a plan (N)", value=self.forces.tolist(), allowed="greater than 0")
        if not self.components or not set(self.components) <= set(range(6)):
            raise InputError("components to read", value=self.components, allowed="0 to 5, one or more")
        if not 1 <= self.repeats <= 1000:
            raise InputError("repeats of a plan", value=self.repeats, allowed="1 to 1000")


@dataclass(frozen=True)
class Foresight:
    """What a plan will tell about one parameter.

    ``before``, ``after``: standard deviations of ln value (positive ones) or of the value, the vague prior included;
    ``shrink``: before / after.
    """

    parameter: Parameter
    before: float
    after: float

    @property
    def shrink(self) -> float:
        """How many times narrower the interval gets."""
        return self.before / self.after


@dataclass(frozen=True)
class MeasurementPlan:
    """n new set-ups: ``q`` (n, dof) rad, ``direction`` (n, 3), and what they will tell.

    ``value``: of the criterion; ``random``: the same for random choices of as many set-ups (their median);
    ``efficiency``: how many times as many random set-ups would be needed (D: from the determinants, per parameter).
    """

    q: Array
    direction: Array
    protocol: Protocol
    foresight: tuple[Foresight, ...]
    criterion: Criterion
    value: float
    random: float


def design_point(e: Estimate, c: Certainty) -> Array:
    """Variables (p,) at which a plan is made: the estimates, or the softest part the data allow where they are open.

    At the estimate of a rigid joint no reading moves with its stiffness, and no pose would seem worth measuring.
    """
    u = e.u.copy()
    for k, found in enumerate(c.estimates):
        p = found.parameter
        if p.scale != "compliance" or found.status == "determined":
            continue
        softest = found.interval[0] if found.status in ("at bound", "one-sided") else math.nan
        if not softest > p.lower:
            softest = math.sqrt(p.lower * p.upper)
        u[k] = OPEN_SHARE / softest
    return u


def known_information(e: Estimate, u: Array) -> Array:
    """Information (p, p) of the readings so far about the logarithms (or values), with the vague prior."""
    p = e.problem
    f, J = p.evaluate(u)
    white, _ = Blocks.of(p).whiten(e.noise.variance(p, f) / e.weight, e.noise.common(p, f), J * _slopes(p, u))
    rows = prior_residual(p, u)[1] * _slopes(p, u)
    return np.asarray(white.T @ white + rows.T @ rows + np.diag(_vague(p)))


def plan(
    e: Estimate,
    c: Certainty,
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
    e, c : what the readings so far say; their noise is assumed for the new ones too
    workspace : for the I criterion: loaded poses at which the model shall predict well (default: the candidates)

    Raises
    ------
    InputError
        Bad protocol or criterion, or fewer candidates than set-ups.
    """
    u = design_point(e, c)
    known = known_information(e, u)
    candidates = experiments(e, u, poses, protocol)
    weight = _weight(e, u, workspace or _loaded(e, poses, protocol)) if criterion == "I" else None
    found = choose(known, candidates, n, criterion, weight=weight, rng=rng, starts=starts, progress=progress)
    random = [
        judge(known, candidates, rng.choice(len(candidates), n, replace=False), criterion, weight).value
        for _ in range(RANDOM_PLANS)
    ]
    pose, direction = np.divmod(found.chosen, len(protocol.directions))
    return MeasurementPlan(
        poses[pose], protocol.directions[direction], protocol, _foresight(e.problem, known, found), criterion,
        found.value, float(np.median(random)),
    )  # fmt: skip


def experiments(e: Estimate, u: Array, poses: Array, protocol: Protocol) -> Array:
    """Factors (N d, r, p) of the information of every pose and direction, poses slowest."""
    p = e.problem
    at = _loaded(e, poses, protocol)
    value, J = replace(p.free, at=at).evaluate(u)
    read = list(protocol.components)
    setups = len(poses) * len(protocol.directions)
    f = value[:, read].reshape(setups, -1, len(read))
    B = (J[:, read] * _slopes(p, u)).reshape(setups, f.shape[1], len(read), -1)
    out = [_whitened(e.noise, f[:, :, k], B[:, :, k], read[k] >= 3, protocol.repeats) for k in range(len(read))]
    return np.concatenate(out, axis=1)


def _whitened(noise: Noise, f: Array, B: Array, turn: bool, repeats: int) -> Array:
    """Derivatives (s, l, p) of one component under all loads of a set-up, with unit covariance."""
    variance = (noise.white[int(turn)] ** 2 + (noise.share * f) ** 2) / repeats
    V = noise.pose[int(turn)] ** 2 + noise.pose_share**2 * f[:, :, None] * f[:, None, :]
    d = np.arange(f.shape[1])
    V = np.broadcast_to(V, (len(f), d.size, d.size)).copy()
    V[:, d, d] += variance
    return np.asarray(np.linalg.solve(np.linalg.cholesky(V), B))


def _loaded(e: Estimate, poses: Array, protocol: Protocol) -> LoadedPoses:
    """Every pose under every direction and force, poses slowest, forces fastest."""
    loads = (protocol.directions[:, None] * protocol.forces[:, None]).reshape(-1, 3)
    wrench = np.hstack([np.tile(loads, (len(poses), 1)), np.zeros((len(poses) * len(loads), 3))])
    tool = e.problem.free.model.robot.T_flange_tool[:3, 3]
    return LoadedPoses(np.repeat(poses, len(loads), axis=0), wrench, np.tile(tool, (len(wrench), 1)))


def _slopes(p: Problem, u: Array) -> Array:
    """Derivative (p,) of the variable by ln value (compliances) or by itself."""
    return np.array([-v if q.scale == "compliance" else 1.0 for q, v in zip(p.parameters, u, strict=True)])


def _vague(p: Problem) -> Array:
    """Information of the vague prior: 30 to either side, or the range itself as two standard deviations."""
    out = []
    for q in p.parameters:
        sd = (q.upper - q.lower) / 4.0 if q.scale == "linear" else VAGUE
        out.append(0.0 if q.prior is not None else 1.0 / sd**2)
    return np.array(out)


def _weight(e: Estimate, u: Array, workspace: LoadedPoses) -> Array:
    """Mean (p, p) of the derivatives' products over predictions of translations, mm."""
    free: FreeModel = replace(e.problem.free, at=workspace)
    J = free.evaluate(u)[1][:, :3].reshape(-1, len(u)) * _slopes(e.problem, u) * 1e3
    return np.asarray(J.T @ J / len(workspace))


def _foresight(p: Problem, known: Array, choice: Choice) -> tuple[Foresight, ...]:
    before, after = np.sqrt(np.diag(np.linalg.inv(known))), np.sqrt(np.diag(choice.covariance))
    return tuple(Foresight(q, float(a), float(b)) for q, a, b in zip(p.parameters, before, after, strict=True))
