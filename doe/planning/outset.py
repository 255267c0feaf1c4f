"""Starting point of a plan: parameters to identify, prior knowledge, expected noise."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from doe.certainty.uncertainty import Certainty, ParameterEstimate
from doe.estimation.estimate import Estimate, estimate, prior_residual
from doe.estimation.noise import Noise, Origin, origin
from doe.estimation.problem import Problem
from doe.planning.lack_of_fit import Shown, blocks, counted, shown
from fem import ArmModel
from fem.free.model import FreeModel
from fem.free.parameters import Parameter
from fem.statics.loads import LoadedPoses
from robots import InputError
from robots.arrays import Array

# What is known of a positive parameter before any reading: a factor of this to either side, one standard deviation.
VAGUE = math.log(30.0)


@dataclass(frozen=True)
class Outset:
    """What is known of p parameters before new readings.

    ``free``: the model and its parameters; ``u`` (p,): estimator's variables at which the plan is made;
    ``known`` (p, p): information so far about ln value (positive ones) or the value, a vague prior included;
    ``noise``: expected of the new readings, ``noise_origin``: where it is from; ``found``: what the readings so far
    say, empty if they cannot say; ``readings``: how many there are; ``best`` (p,): the estimate itself, None before any
    reading. ``shown``: the lack of fit that the readings so far show, None where none is to spare; ``counted``:
    variance of a set-up's mean over the square of the deflection, as ``known`` has it; ``blocks``: components read,
    over all set-ups.
    """

    free: FreeModel
    u: Array
    known: Array
    noise: Noise
    found: tuple[ParameterEstimate, ...] = ()
    readings: int = 0
    best: Array | None = None
    noise_origin: Origin = "given"
    shown: Shown | None = None
    counted: float = 0.0
    blocks: int = 0

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters to identify."""
        return self.free.parameters

    @property
    def slopes(self) -> Array:
        """Derivative (p,) of the estimator's variable by ln value, or by the variable itself."""
        return slopes(self.parameters, self.u)

    @property
    def vague(self) -> Array:
        """Standard deviations (p,) before any reading."""
        return vague_sd(self.parameters)


def slopes(parameters: Sequence[Parameter], u: Array) -> Array:
    """Derivative (p,) of the variables u (p,) by ln value (compliances) or by themselves."""
    return np.array([-v if q.scale == "compliance" else 1.0 for q, v in zip(parameters, u, strict=True)])


def vague_sd(parameters: Sequence[Parameter]) -> Array:
    """Standard deviation (p,) of ln value (or value) before any reading: 30 to either side, or the range as 4 of them.

    A parameter's own prior goes before.
    """
    out = []
    for q in parameters:
        span = q.upper - q.lower if q.scale == "linear" else math.log(q.upper / q.lower)
        sd = span / 4.0 if q.scale == "linear" else min(VAGUE, span / 4.0)
        out.append(sd if q.prior is None else q.prior[1])
    return np.array(out)


def first_outset(
    model: ArmModel, parameters: Sequence[Parameter], noise: Noise, usual: Mapping[str, float] | None = None
) -> Outset:
    """Before any reading: the model's own values; where it is rigid, ``usual`` by name, else the range's middle."""
    nowhere = LoadedPoses(np.zeros((0, model.robot.dof)), np.zeros((0, 6)), np.zeros((0, 3)))
    free = FreeModel(model, tuple(parameters), nowhere)
    u = np.array([_own(q, (usual or {}).get(q.name)) for q in parameters])
    return Outset(free, u, np.diag(1.0 / vague_sd(parameters) ** 2), noise)


def _own(q: Parameter, usual: float | None = None) -> float:
    """The model's value as estimator's variable; where it is rigid there what is usual, else the range's middle."""
    if q.scale != "linear" and not q.lower < q.value < q.upper:
        middle = math.sqrt(q.lower * q.upper) if usual is None else min(max(usual, q.lower), q.upper)
        return q.inner(middle)
    return q.inner(q.value)


def outset(e: Estimate, c: Certainty) -> Outset:
    """After readings that were estimated from; their noise is expected of the new ones too."""
    u, noise = design_point(e, c), _expected(e)
    return Outset(
        e.problem.free,
        u,
        known_information(e, u),
        noise,
        c.estimates,
        len(e.problem),
        e.u,
        origin(e.problem, given=not e.estimated),
        shown(replace(e, noise=noise)),
        counted(e),
        blocks(e.problem),
    )


def helped_outset(p: Problem, gauge: tuple[float, float]) -> Outset:
    """After fewer readings than parameters: a vague prior stands in for the rest."""
    priors = [_with_prior(q, sd) for q, sd in zip(p.parameters, vague_sd(p.parameters), strict=True)]
    helped = replace(p, free=replace(p.free, parameters=tuple(priors)))
    e = estimate(helped, gauge, fixed_noise=Noise(white=gauge), robust=False)
    return Outset(
        helped.free, e.u, known_information(e, e.u), _expected(e), (), len(p), e.u, counted=counted(e), blocks=blocks(p)
    )


def _with_prior(q: Parameter, sd: float) -> Parameter:
    if q.prior is not None:
        return q
    # Of a stiffness the prior is about ln value, and its variable falls as that rises.
    middle = math.log(q.outer(_own(q))) if q.scale != "linear" else q.value
    return replace(q, prior=(middle, float(sd)))


def design_point(e: Estimate, c: Certainty) -> Array:
    """Variables (p,) at which a plan is made: the estimates, or the softest part the data allow where they are open.

    At the estimate of a rigid joint no reading moves with its stiffness, and no pose would seem worth measuring.
    """
    u = e.u.copy()
    for k, found in enumerate(c.estimates):
        p = found.parameter
        if p.scale != "compliance" or found.status == "determined":
            continue
        softest, stiffest = found.interval
        if found.status != "not identified" and softest > p.lower:
            u[k] = 1.0 / softest
        elif found.status == "not identified" or not math.isfinite(stiffest):
            u[k] = 1.0 / math.sqrt(p.lower * p.upper)
    return u


def known_information(e: Estimate, u: Array) -> Array:
    """Information (p, p) of the readings so far about the logarithms (or values), with the vague prior."""
    p = e.problem
    f, J = p.evaluate(u)
    white = e.noise.covariance(p, f, e.weight).whiten(J * slopes(p.parameters, u))
    rows = prior_residual(p, u)[1] * slopes(p.parameters, u)
    own = np.array([q.prior is None for q in p.parameters]) / vague_sd(p.parameters) ** 2
    return np.asarray(white.T @ white + rows.T @ rows + np.diag(own))


def _expected(e: Estimate) -> Noise:
    """Noise of new readings: as estimated; where the readings brought their own sigma, as large as theirs."""
    noise = e.noise.as_share(e.problem, e.prediction)
    white = list(noise.white)
    for kind, mine in enumerate((e.problem.component < 3, e.problem.component >= 3)):
        sigma = e.problem.sigma[mine]
        if sigma.size and not np.isnan(sigma).any():
            white[kind] = float(np.sqrt(np.mean(sigma**2)))
    return replace(noise, white=(white[0], white[1]))


def check_plannable(parameters: Sequence[Parameter]) -> None:
    """Refuse parameters that need more than their name to be evaluated."""
    for q in parameters:
        if q.kind.has_sections:
            raise InputError(
                f"parameter {q.name}: a plan cannot vary walls",
                code="M001",
                allowed=f"{q.place}.modulus",
                remedy="plan for the link's modulus: readings see only how the link deflects",
            )
