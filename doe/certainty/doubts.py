"""What readings say against a calibration: a drift in their order, and what springs of no kind explain.

Each test has a stated rate of false alarms, :data:`LEVEL` where the springs are right and the noise is as estimated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import f as fisher

from doe.estimation.estimate import Estimate
from doe.estimation.least_squares import spanning
from doe.estimation.noise import fit_noise
from doe.estimation.problem import Problem
from robots.arrays import Array, Bools, Integers

# Share of right calibrations that each code of a doubt is raised about.
LEVEL = 0.01
# Set-ups' zeros may be off by so many times a reading's own scatter: a gauge is zeroed by readings of its own.
ZEROS = 2.0
# Set-ups that scatter by more than this share of the deflection are no careful ones (assumed).
CAREFUL = 0.05
# Times of reading there must be for a drift to be told from noise.
FEWEST_TIMES = 6
# Rows may be the order of time where neighbours differ in every joint by at least this share of what any two do
# (von Neumann's ratio, about 1 in random order): else a drift would be what poses in their order lack.
MIXED = 0.5
# More outliers than this share of the readings are none (assumed).
MOST_OUTLIERS = 0.1
# Directions below this share of the strongest are rounding.
ROUNDING = 1e-9

Code = Literal["drift", "not-proportional", "set-ups-differ", "sigma", "class"]
# In the catalogue of failures.
CODES: dict[Code, str] = {
    "drift": "W005",
    "not-proportional": "W004",
    "set-ups-differ": "W004",
    "sigma": "W006",
    "class": "W007",
}


@dataclass(frozen=True)
class Doubt:
    """One thing that readings say against a calibration, or against themselves.

    ``words``: a sentence or two; ``p_value``: how probable as much or more is by chance; ``factor``: how many times
    what was seen is what was to be expected.
    """

    code: Code
    words: str
    p_value: float
    factor: float


def p_words(p: float) -> str:
    """``p = 0.034``; of one that no test can tell from zero: ``p below 0.0001``."""
    return "p below 0.0001" if p < 1e-4 else f"p = {p:.2g}"


@dataclass(frozen=True)
class Drift:
    """A drift of what is read, that follows the clock and no spring.

    ``p_value``: of the F test of ``columns`` (m, k) that may drift, with ``ratio`` F; ``size`` (m,): the drift found,
    m or rad; ``u`` (p,): the variables that the estimate would have with the drift free.
    """

    p_value: float
    ratio: float
    size: Array
    u: Array


def order_of_rows(q: Array) -> Array:
    """A clock (n,) from the order of rows with poses q (n, dof), NaN where poses stand in an order of their own."""
    moved = np.vstack([q[:1], q[1:][np.diff(q, axis=0).any(axis=1)]])
    spread = moved.var(axis=0)
    way = np.mean(np.diff(moved, axis=0) ** 2, axis=0) / 2.0 if len(moved) > 1 else spread
    mixed = len(moved) >= FEWEST_TIMES and bool((way >= MIXED * spread).all())
    return np.linspace(0.0, 1.0, len(q)) if mixed else np.full(len(q), np.nan)


def drift(e: Estimate, clock: Array, floor: tuple[float, float]) -> Drift | None:
    """Whether residuals follow the order of reading: a straight line and one wave over the clock in each component.

    Noise is estimated again with the drift free, so that scatter between set-ups, which a drift looks like, is told
    from it: set-ups scatter independently of their order. Where they scatter the F test has as many degrees of freedom
    as there are set-ups (times components) to spare, else as many as readings.

    Priors are left out: parameters are as free to follow the clock as readings leave them.

    ``clock`` (m,): from 0 to 1, NaN where it is not known; None is returned there, and where too few readings are left.
    ``floor``: least standard deviation of a reading, m and rad.
    """
    p = e.problem
    if not np.isfinite(clock).all() or len(np.unique(clock)) < FEWEST_TIMES:
        return None
    of = (p.component[:, None] == np.unique(p.component)).astype(float)
    D = np.hstack([of, of * clock[:, None], of * np.cos(2.0 * np.pi * clock)[:, None]])
    seen = e.seen & ~((e.u <= p.bounds[0]) | (e.u >= p.bounds[1]))
    J, weight = e.jacobian[:, seen], _weight(e)
    V = e.noise.covariance(p, e.prediction, weight)
    if e.estimated:
        free = np.hstack([J, D])
        told = fit_noise(p, e.prediction, free, e.residual, e.noise, floor, weight, names=e.estimated)
        V = told.covariance(p, e.prediction, weight)
    white = V.whiten(np.column_stack([e.residual, J, D]))
    z, A, fixed = white[:, 0], white[:, 1:], J.shape[1] + of.shape[1]
    # Springs, and a zero of each component: neither is a drift.
    still = spanning(A[:, :fixed], ROUNDING)
    way = spanning(A[:, fixed:] - still @ (still.T @ A[:, fixed:]), ROUNDING)
    k, rank = way.shape[1], still.shape[1]
    several = p.blocks.most > 1 and any(name.startswith("pose") for name in e.estimated)
    left = (len(p.blocks) if several else len(p)) - rank - k
    if left < 1 or k == 0:
        return None
    gone, scatter = float(np.sum((way.T @ z) ** 2)), float(z @ z - np.sum((still.T @ z) ** 2))
    # Sigmas that came with the readings may be wrong; an estimated noise is not, but may stand at the gauge's digit.
    mean = (scatter - gone) / (len(z) - rank - k)
    ratio = gone / k / max(mean, 1.0 if e.estimated else 1e-300)
    moved, found = np.split(np.linalg.lstsq(A, z, rcond=ROUNDING)[0], [J.shape[1]])
    u = e.u.copy()
    u[seen] = np.clip(u[seen] + moved, p.bounds[0][seen], p.bounds[1][seen])
    size = D[:, of.shape[1] :] @ found[of.shape[1] :]
    return Drift(float(fisher.sf(ratio, k, left)), ratio, np.asarray(size), u)


def _weight(e: Estimate) -> Array:
    """Weights (m,) of the readings; all one where so many lost theirs that they are no outliers, or by given sigmas.

    Sigmas that are too small make outliers of good readings.
    """
    trusted = np.isnan(e.problem.sigma).all() and np.mean(e.weight < 0.5) <= MOST_OUTLIERS
    return e.weight if trusted else np.ones(len(e.weight))


def left_in_groups(y: Array, group: Integers, columns: Sequence[Array]) -> tuple[Array, int]:
    """What is left (m,) of y by ``columns`` (m,), fitted in each group by itself, and its degrees of freedom."""
    left, freedom, across = y, len(y), list[Array]()
    # One column after the other, each across those before it (Gram and Schmidt), in all groups at once.
    for column in columns:
        x = column
        for q in across:
            x = x - q * np.bincount(group, q * x)[group]
        length, whole = np.bincount(group, x**2), np.bincount(group, column**2)
        there = length > ROUNDING * whole
        across.append(x * np.where(there, 1.0 / np.sqrt(np.where(there, length, 1.0)), 0.0)[group])
        left = left - across[-1] * np.bincount(group, across[-1] * left)[group]
        freedom -= int(there.sum())
    return np.where(np.abs(left) > ROUNDING * np.abs(y), left, 0.0), freedom


def numbered(rows: Array) -> Integers:
    """The number (m,) of each different row (m, k)."""
    return np.asarray(np.unique(rows, axis=0, return_inverse=True)[1].reshape(-1))


def setups(p: Problem) -> Integers:
    """The number (m,) of component, pose, direction and point of the load of each reading."""
    at = p.free.at
    way = at.wrench / np.maximum(np.linalg.norm(at.wrench, axis=1), 1e-300)[:, None]
    return numbered(np.column_stack([np.round(np.hstack([way, at.point]), 3)[p.row] + 0.0, p.pose, p.component]))


@dataclass(frozen=True)
class Unexplained:
    """What no springs explain, against the scatter of readings within their set-ups.

    ``zero_m``: how far deflections are off at no load, RMS (m), ``zero_times`` a reading's scatter within its set-up,
    with ``zero_p``: of the F test that they are off by no more than ZEROS times that; ``setups_p``: of the F test that
    springs explain what each set-up gives per load, ``setups_share``: how far they do not, as a share of the
    deflection. NaN: not testable.
    """

    zero_m: float
    zero_times: float
    zero_p: float
    setups_share: float
    setups_p: float


def unexplained(e: Estimate, down: Bools, floor: float, drifted: Array | float = 0.0) -> Unexplained:
    """Whether deflections are proportional to the load in each set-up, and what set-ups give by the springs.

    A linear arm's deflection is proportional to the load, whatever its springs, links, tilts, and whatever share of
    the deflection set-ups scatter by: backlash, friction, hardening, another load than the sheet's or a zero that
    moved are not. ``down`` (m,): read while unloading; ``floor``: least standard deviation of a
    reading (m); ``drifted`` (m,): a drift that was found, taken off.
    """
    p = e.problem
    group, root = setups(p), np.sqrt(_weight(e) / e.noise.variance(p, e.prediction))
    # Of the residual, so that what effects of the model explain is no doubt; springs' own share is proportional.
    x, y = root * np.linalg.norm(p.free.at.wrench, axis=1)[p.row], root * (e.residual - drifted)
    about, about_dof = left_in_groups(y, 2 * group + down, [root, x])
    if about_dof == 0:
        about, about_dof = left_in_groups(y, group, [root, x])
    through, through_dof = left_in_groups(y, group, [x])
    lines, proportional = float(about @ about), float(through @ through)
    # What zeros of set-ups that are off by 1 m (or rad) add to the second.
    reach = float(np.sum(left_in_groups(root, group, [x])[0] ** 2))
    zero_p = zero_m = times = setups_p = share = math.nan
    more, own = through_dof - about_dof, float(np.median(root**-2))
    if min(about_dof, more) > 0 and reach > 0.0:
        rise, scatter = proportional - lines, max(lines / about_dof, floor**2 / own)
        ratio = rise / more / scatter / (1.0 + ZEROS**2 * own * reach / more)
        zero_p = float(fisher.sf(ratio, min(more, len(np.unique(group))), about_dof))
        zero_m = math.sqrt(max(rise - more * scatter, 0.0) / reach)
        times = zero_m / math.sqrt(own * scatter)
    basis = spanning((e.jacobian * root[:, None])[:, e.seen], ROUNDING)
    lack_dof = len(p) - through_dof - basis.shape[1]
    if min(through_dof, lack_dof) > 0 and proportional > 0.0:
        lack = float(y @ y - np.sum((basis.T @ y) ** 2)) - proportional
        setups_p = float(fisher.sf(lack / lack_dof / (proportional / through_dof), lack_dof, through_dof))
        common = float(np.sum(e.noise.common(p, e.prediction) ** 2))
        share = math.sqrt(common / max(float(np.sum(e.prediction**2)), 1e-300))
    return Unexplained(zero_m, times, zero_p, share, setups_p)
