"""How much a model misses: what it usually is, and what the readings so far show of it.

The lack of fit counts as scatter of set-ups: a share of the deflection (root mean square over the readings) by which
all readings of one component in one set-up are off together, however often they are repeated. Its logarithm is normal
before any reading, about :data:`USUAL` with the standard deviation :data:`SPREAD`: other arms miss other things. The
readings so far show a part of it, ``ln shown = ln share - HIDDEN + ELSEWHERE z`` with z standard normal: in few poses
the parameters follow what is missing, for it is smooth over the poses, and other poses show another lack of fit. Both
numbers are for campaigns of which half is yet to be measured, and taken to go with that share. The variance found in
the readings is ``(shown^2 + own^2) chi^2 / dof``, where ``own`` is what their own scatter leaves in the mean of a
set-up. The posterior of the share is worked out on a grid.

The four numbers were set on made-up arms, which test nothing (docs/validation/forecasts.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from doe.certainty.predictive import birge
from doe.estimation.estimate import Estimate
from doe.estimation.noise import Noise
from doe.estimation.problem import Problem
from robots.arrays import Array

# Before any reading: median share of the deflection, and standard deviation of its logarithm.
USUAL, SPREAD = 0.06, 1.55
# How much less of it readings of a first campaign show, and the standard deviation of that; both in the logarithm.
HIDDEN, ELSEWHERE = 0.6, 1.1
# The grid: so many standard deviations to either side of the median, in so many steps.
REACH, STEPS = 4.0, 161
# Where nothing tells the readings' own scatter from the lack of fit it is all taken for the latter but this share.
OWN = 0.1


@dataclass(frozen=True)
class Shown:
    """What readings so far show, as variances over the square of the deflection (root mean square).

    ``lack``: by which set-ups are off; ``own``: of a set-up's mean, by the scatter of its readings; ``dof``: degrees of
    freedom of the two together; ``constant``: share of ``lack`` that does not go with the deflection; ``noise``: of
    readings, by their own scatter alone.
    """

    lack: float
    own: float
    dof: float
    constant: float
    noise: Noise


def shown(e: Estimate) -> Shown | None:
    """The lack of fit that an estimate shows beside the noise expected of new readings; None without a spare one."""
    p = int(e.seen.sum())
    if len(e.problem) <= p or not e.prediction.any():
        return None
    n = _with_lack_of_fit(e)
    pose, share = _common(e, n)
    lack = pose + share
    return Shown(
        lack, _own(e, n), max(float(blocks(e.problem) - p), 1.0), pose / lack if lack else 0.0, Noise(n.white, n.share)
    )


def counted(e: Estimate) -> float:
    """Variance of a set-up's mean over the square of the deflection, by the noise that an estimate counts with."""
    return sum(_common(e, e.noise)) + _own(e, e.noise)


def drawn_shares(so_far: Shown | None, n: int, rng: np.random.Generator, new: float = 0.5) -> Array:
    """Shares (n,) of the deflection by which campaigns may find the model to be off.

    ``new``: share of their set-ups that is yet to be measured; the fewer, the nearer they come to what is shown.
    """
    step = np.linspace(-REACH, REACH, STEPS)
    normal = np.exp(-0.5 * step**2)
    x, chance = np.log(USUAL) + SPREAD * step, normal
    if so_far is not None:
        found, turn = so_far.lack + so_far.own, new / 0.5
        # Of each share (columns), by how much of it is hidden (rows).
        expected = np.exp(2.0 * (x - turn * (HIDDEN - ELSEWHERE * step[:, None]))) + so_far.own
        log = -0.5 * so_far.dof * (np.log(expected / found) + found / expected)
        chance = normal * (normal @ np.exp(log - log.max()))
    sure = np.cumsum(chance) / chance.sum()
    return np.asarray(np.exp(np.interp(rng.random(n), sure, x)))


def _with_lack_of_fit(e: Estimate) -> Noise:
    """The noise of an estimate with the lack of fit as scatter of set-ups.

    Where no set-up has several readings of one component its scatter is in that of the readings, and repeats of new
    ones will not average it away. Where the noise was given, it is what the residuals have beyond that.
    """
    n, larger = e.noise, birge(e)[0] - 1.0
    if any(name.startswith("pose") for name in e.estimated):
        return n
    if e.estimated:
        return Noise((OWN * n.white[0], OWN * n.white[1]), OWN * n.share, n.white, n.share)
    beyond = float(np.sqrt(larger * np.mean(e.noise.variance(e.problem, e.prediction) / _scale(e) ** 2)))
    return replace(n, pose_share=beyond)


def blocks(p: Problem) -> int:
    """How many components were read, over all set-ups."""
    return len(np.unique(6 * p.pose + p.component))


def _scale(e: Estimate) -> Array:
    """Root mean square deflection (m,), of the translations or of the rotations."""
    out = np.empty(len(e.problem))
    for mine in (e.problem.component < 3, e.problem.component >= 3):
        out[mine] = np.sqrt(np.mean(e.prediction[mine] ** 2)) if mine.any() else 0.0
    return np.maximum(out, 1e-300)


def _common(e: Estimate, n: Noise) -> tuple[float, float]:
    """Mean variances of set-ups over squares of deflections: constant ones, and those that go with the deflection."""
    pose, share = np.mean((n.common(e.problem, e.prediction) / _scale(e)[:, None]) ** 2, axis=0)
    return float(pose), float(share)


def _own(e: Estimate, n: Noise) -> float:
    """The same of the mean of a set-up's readings by their own scatter."""
    return float(np.mean(n.variance(e.problem, e.prediction) / _scale(e) ** 2)) * blocks(e.problem) / len(e.problem)
