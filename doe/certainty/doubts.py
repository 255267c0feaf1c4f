"""What readings say against a calibration: a drift in their order, and what springs of no kind explain.

Each test has a stated rate of false alarms, :data:`LEVEL` where the springs are right and the noise is as estimated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import f as fisher

from doe.estimation.estimate import Estimate
from doe.estimation.least_squares import prior_residual, spanning
from doe.estimation.noise import fit_noise
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


def drift(e: Estimate, clock: Array) -> Drift | None:
    """Whether residuals follow the order of reading: a straight line and one wave over the clock in each component.

    Noise is estimated again with the drift free, so that scatter between set-ups, which a drift looks like, is told
    from it: set-ups scatter independently of their order. Where they scatter the F test has as many degrees of freedom
    as there are set-ups (times components) to spare, else as many as readings.

    ``clock`` (m,): from 0 to 1, NaN where it is not known; None is returned there, and where too few readings are left.
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
        least = float(min(x for x in e.noise.white if x > 0.0)) * 1e-3
        told = fit_noise(
            p, e.prediction, np.hstack([J, D]), e.residual, e.noise, (least, least), weight, names=e.estimated
        )
        V = told.covariance(p, e.prediction, weight)
    priors = prior_residual(p, e.u)
    white = V.whiten(np.column_stack([e.residual, J, D]))
    z = np.concatenate([white[:, 0], -priors[0]])
    none = np.zeros((len(priors[0]), D.shape[1]))
    A = np.vstack([white[:, 1:], np.hstack([priors[1][:, seen], none])])
    # Springs, and a zero of each component: neither is a drift.
    still = spanning(A[:, : J.shape[1] + of.shape[1]], ROUNDING)
    W = A[:, J.shape[1] + of.shape[1] :]
    way = spanning(W - still @ (still.T @ W), ROUNDING)
    k, rank = way.shape[1], still.shape[1]
    several = e.problem.blocks.most > 1 and any(name.startswith("pose") for name in e.estimated)
    left = (len(p.blocks) if several else len(p)) - rank - k
    if left < 1 or k == 0:
        return None
    gone, scatter = float(np.sum((way.T @ z) ** 2)), float(z @ z - np.sum((still.T @ z) ** 2))
    ratio = gone / k * (len(z) - rank - k) / max(scatter - gone, 1e-300)
    moved, found = np.split(np.linalg.lstsq(A, z, rcond=ROUNDING)[0], [J.shape[1]])
    u = e.u.copy()
    u[seen] = np.clip(u[seen] + moved, p.bounds[0][seen], p.bounds[1][seen])
    size = D[:, of.shape[1] :] @ found[of.shape[1] :]
    return Drift(float(fisher.sf(ratio, k, left)), ratio, np.asarray(size), u)


def _weight(e: Estimate) -> Array:
    """Weights (m,) of the readings; all one where so many lost theirs that they are no outliers."""
    return e.weight if np.mean(e.weight < 0.5) <= MOST_OUTLIERS else np.ones(len(e.weight))


@dataclass(frozen=True)
class Sums:
    """Sums of squares, each reading over its own standard deviation, and degrees of freedom.

    ``lines``: about a straight line over the load for each set-up, component and phase; ``proportional``: about one
    line through zero for each set-up and component. ``reach``: what zeros of set-ups that are off by one unit add to
    the second.
    """

    lines: float
    lines_dof: int
    proportional: float
    proportional_dof: int
    reach: float


def within_setups(
    setup: Integers, component: Integers, down: Bools, load: Array, value: Array, precision: Array
) -> Sums:
    """Readings (m,) against lines of their own: what scatters whatever arm it is, and what no linear arm does.

    ``setup``: number of pose, direction and point of the load; ``down``: read while unloading; ``precision``: one over
    a reading's own variance.
    """
    group = np.unique(6 * setup + component, return_inverse=True)[1]
    phase = np.unique(2 * group + down, return_inverse=True)[1]

    def sums(key: Integers) -> list[Array]:
        every = (np.ones(len(load)), load, load**2, value, load * value, value**2)
        return [np.asarray(np.bincount(key, precision * x), dtype=np.float64) for x in every]

    one, x, xx, y, xy, yy = sums(phase)
    spread, slope = xx - x**2 / one, xy - x * y / one
    several = spread > ROUNDING * xx
    about = yy - y**2 / one - np.where(several, slope**2 / np.where(several, spread, 1.0), 0.0)
    one0, x0, xx0, _, xy0, yy0 = sums(group)
    through = yy0 - xy0**2 / xx0
    return Sums(
        float(np.maximum(about, 0.0).sum()),
        len(value) - len(one) - int(several.sum()),
        float(np.maximum(through, 0.0).sum()),
        len(value) - len(one0),
        float(np.maximum(one0 - x0**2 / xx0, 0.0).sum()),
    )


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


def unexplained(e: Estimate, down: Bools, drifted: Array | float = 0.0) -> Unexplained:
    """Whether deflections are proportional to the load in each set-up, and what set-ups give by the springs.

    A linear arm's deflection is proportional to the load, whatever its springs, links, tilts, and whatever share of
    the deflection set-ups scatter by: backlash, friction, hardening, another load than the sheet's or a zero that
    moved are not. ``down`` (m,): read while unloading; ``drifted`` (m,): a drift that was found, taken off.
    """
    p, at = e.problem, e.problem.free.at
    size = np.linalg.norm(at.wrench, axis=1)
    case = np.column_stack([at.wrench / np.maximum(size, 1e-300)[:, None], 10.0 * at.point])
    setup = np.unique(np.column_stack([np.round(case, 3)[p.row] + 0.0, p.pose]), axis=0, return_inverse=True)[1]
    precision = _weight(e) / e.noise.variance(p, e.prediction)
    of = setup.reshape(-1), p.component
    read = size[p.row], p.value - drifted, precision
    s = within_setups(*of, down, *read)
    if s.lines_dof == 0:
        s = within_setups(*of, np.zeros_like(down), *read)
    zero_p = zero_m = times = setups_p = share = math.nan
    own = float(np.median(1.0 / precision))
    more = s.proportional_dof - s.lines_dof
    if s.lines_dof > 0 and more > 0 and s.lines > 0.0 and s.reach > 0.0:
        rise = s.proportional - s.lines
        scatter = s.lines / s.lines_dof
        ratio = rise / more / scatter / (1.0 + ZEROS**2 * own * s.reach / more)
        zero_p = float(fisher.sf(ratio, min(more, len(np.unique(6 * of[0] + of[1]))), s.lines_dof))
        zero_m = math.sqrt(max(rise - more * scatter, 0.0) / s.reach)
        times = zero_m / math.sqrt(own * scatter)
    basis = spanning((e.jacobian * np.sqrt(precision)[:, None])[:, e.seen], ROUNDING)
    z = (e.residual - drifted) * np.sqrt(precision)
    lack_dof = len(p) - s.proportional_dof - basis.shape[1]
    if s.proportional_dof > 0 and lack_dof > 0 and s.proportional > 0.0:
        lack = float(z @ z - np.sum((basis.T @ z) ** 2)) - s.proportional
        setups_p = float(
            fisher.sf(lack / lack_dof / (s.proportional / s.proportional_dof), lack_dof, s.proportional_dof)
        )
        common = np.sum(e.noise.common(p, e.prediction) ** 2, axis=1)
        share = float(np.sqrt(common.sum() / max(float(np.sum(e.prediction**2)), 1e-300)))
    return Unexplained(zero_m, times, zero_p, share, setups_p)
