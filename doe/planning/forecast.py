"""What intervals a plan will give: with the lack of fit of the model, so wide that nine campaigns in ten keep to it.

A plan's standard deviations by the readings' noise alone come true only where the model misses nothing. Real models do:
what they miss shifts all readings of a set-up together, however often they are repeated. A forecast therefore draws
whole campaigns: parameters as far as they are known, the lack of fit, its estimate from as many set-ups, and Student's
t for these; promised is the half width that nine in ten of them do not pass.

Where there are readings, the lack of fit is the one they show: the scatter of their set-ups, or, where no set-up has
two readings that could tell it from the gauge's, all of the residual. Where there are none it is the usual one
(:data:`USUAL`): effects hidden in 40 campaigns of one arm (kr60-3, frames not among them) left a median of 9 %
of the deflection (90 %: 23 %) between set-ups; the bundled FANUC campaign shows 22 % (docs/validation/forecasts.md). Other
poses show another one, in the same spread as other arms do: few poses in a corner of the workspace say little of what
a model misses elsewhere.

Limits of validity: first order in the parameters; springs within :data:`WITHIN` of the planned value; a lack of fit
that is alike at all poses.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from doe.estimation.noise import Noise
from doe.planning.outset import Outset
from doe.planning.plan import MeasurementPlan, factors
from doe.planning.protocol import at_tool
from fem.statics.loads import LoadedPoses
from robots.arrays import Array

# Lack of fit where no reading shows one: share of the deflection, a set-up; median, and standard deviation of its ln.
USUAL, SPREAD = 0.10, 0.8
# Lack of fit that readings of few poses may hide, for their springs followed it: a share of the deflection, a set-up
# (assumed).
UNSEEN = 0.03
# A spring that is not known better may be so many times softer or stiffer than planned for.
WITHIN = 2.0
# The share of campaigns whose interval is no wider than promised, and how many are drawn.
HOLDS, DRAWS = 0.9, 400
UPPER = 0.975
# A compliance known to no better than its own size leaves the stiffness open.
OPEN = 0.9999


@dataclass(frozen=True)
class Forecast:
    """``half95`` (p,): promised half widths of the 95 % intervals, of ln value (positive ones) or of the value.

    ``seen``: whether the lack of fit is one that readings show, else the usual one; ``noise``: with it, as set-up
    scatter (the median where it is the usual one).
    """

    half95: Array
    seen: bool
    noise: Noise


def forecast(start: Outset, made: MeasurementPlan, rng: np.random.Generator) -> Forecast:
    """What intervals the set-ups of a plan will give in nine campaigns of ten."""
    p, components = len(start.u), len(made.protocol.components)
    at = at_tool(start.free.model, made.q, made.direction)
    blocks = len(made.q) * components + start.blocks
    spare = max(blocks - p, 1)
    moves = _Moves.of(start, at)
    positive = np.array([q.scale != "linear" for q in start.parameters], dtype=np.bool_)
    half = np.empty((DRAWS, p))
    prior = np.diag(1.0 / start.vague**2)
    f = moves.value[:, list(made.protocol.components)] * made.protocol.forces.max()
    for k in range(DRAWS):
        u, ratio = _drawn(start, positive, rng)
        noise, size = _drawn_noise(start, float(np.sqrt(np.mean(f**2))), rng)
        then = replace(start, u=u, noise=noise)
        B = factors(then, *moves.at(u), made.protocol).reshape(-1, p)
        known = prior + (start.known - prior) * np.outer(ratio, ratio) / size
        sd = np.sqrt(np.diag(np.linalg.inv(known + B.T @ B)))
        half[k] = stdtrit(spare, UPPER) * np.sqrt(rng.chisquare(spare) / spare) * sd
    bent = np.array([q.scale == "compliance" for q in start.parameters], dtype=np.bool_)
    # Half of ln(upper / lower) of a stiffness whose compliance is known to so large a share.
    half[:, bent] = np.arctanh(np.minimum(half[:, bent], OPEN))
    return Forecast(np.quantile(half, HOLDS, axis=0), start.shown is not None, _lacking(start, 1.0, 1.0))


@dataclass(frozen=True)
class _Moves:
    """Displacements under 1 N and their derivatives at the set-ups, for any variables."""

    start: Outset
    loaded: LoadedPoses
    value: Array
    J: Array
    linear: bool

    @staticmethod
    def of(start: Outset, at: LoadedPoses) -> _Moves:
        free = replace(start.free, at=at, history=None)
        value, J = free.evaluate(start.u)
        return _Moves(start, at, value, J, free.is_linear)

    def at(self, u: Array) -> tuple[Array, Array]:
        if self.linear:
            return self.value + self.J @ (u - self.start.u), self.J
        return replace(self.start.free, at=self.loaded, history=None).evaluate(u)


def _drawn(start: Outset, positive: np.ndarray, rng: np.random.Generator) -> tuple[Array, Array]:
    """Variables (p,) as far as they are known, and (p,) how many times softer compliances are."""
    sd = np.sqrt(np.diag(np.linalg.inv(start.known)))
    most = np.log(WITHIN)
    step = np.where(sd < most, np.clip(sd * rng.normal(size=len(sd)), -most, most), rng.uniform(-most, most, len(sd)))
    compliance = np.array([q.scale == "compliance" for q in start.parameters], dtype=np.bool_)
    ratio = np.where(compliance, np.exp(-step), 1.0)
    u = np.where(compliance, start.u * ratio, start.u + np.where(positive, step, 0.0))
    low, high = np.array([q.inner_bounds for q in start.parameters]).T
    return np.clip(u, low, high), ratio


def _drawn_noise(start: Outset, f: float, rng: np.random.Generator) -> tuple[Noise, float]:
    """Noise with a lack of fit, and its variance over that of the readings so far.

    ``f``: the deflection (m) at which the two are compared.
    """
    size, lack = 1.0, float(np.exp(SPREAD * rng.normal()))
    if start.shown is not None:
        dof = max(start.spare, 1.0)
        size = float(np.sqrt(dof / max(float(rng.chisquare(dof)), 0.05 * dof)))
    drawn, so_far = _lacking(start, size, lack), _lacking(start, 1.0, 1.0)
    return drawn, _variance(drawn, f) / _variance(so_far, f) if start.shown is not None else 1.0


def _variance(noise: Noise, f: float) -> float:
    """Of a translation of f (m), all scatter together."""
    return noise.white[0] ** 2 + noise.pose[0] ** 2 + (noise.share**2 + noise.pose_share**2) * f**2


def _lacking(start: Outset, size: float, lack: float) -> Noise:
    """The noise with ``size`` times the standard deviations shown, and the lack of fit ``lack`` times that besides."""
    if start.shown is None:
        return replace(start.noise, pose_share=float(np.hypot(start.noise.pose_share, USUAL * lack)))
    numbers = start.shown.numbers * size
    numbers[3:5] *= lack
    numbers[5] = np.hypot(numbers[5], UNSEEN) * lack
    return Noise.of(numbers)
