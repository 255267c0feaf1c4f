"""Whether readings scatter as much as their ``sigma_mm`` says: what is stated is checked like any other figure.

What is seen is the scatter of repeats about their means; where there are none, that of each set-up's readings about a
straight line over the load; where there is only one load, what is left by the springs that fit best, rigid to negative.
The first two hold whatever the arm lacks. Slips of the pen are cut at four times the scatter of the middle half.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from doe.certainty.doubts import LEVEL, Doubt, p_words
from doe.estimation.least_squares import spanning
from doe.estimation.problem import problem
from doe.estimation.robust import robust_sd
from doe.tables.loaded import spring_parts
from doe.tables.measurements import Measurements
from fem import ArmModel
from robots import InputError
from robots.arrays import Array, Integers

# Beyond this factor one of them is a slip: micrometres typed as millimetres are a thousand times off.
SLIP = 30.0
# Sigmas this near to what is seen are right, however many readings say that they are not exact.
NEAR = 1.1
# Degrees of freedom from which on a scatter is seen.
FEWEST = 4
CUT = 4.0
ROUNDING = 1e-9


@dataclass(frozen=True)
class Seen:
    """``times``: scatter seen over that stated; ``p_value``: of the two-sided chi-square test; ``of``: in words.

    ``by_springs``: seen as what springs leave, so that it may be the arm that lacks something.
    """

    times: float
    p_value: float
    seen_m: float
    stated_m: float
    of: str
    by_springs: bool

    @property
    def words(self) -> str:
        """Both figures."""
        return f"sigma_mm says {1e3 * self.stated_m:.3g} mm, but {self.of} by {1e3 * self.seen_m:.3g} mm"


def seen_scatter(model: ArmModel, data: Measurements) -> Seen | None:
    """The scatter of displacements that bring a sigma, against it; None where none does or too few readings tell."""
    mine = np.isfinite(data.sigma)[:, None] & data.used & (np.arange(6) < 3)
    if not mine.any():
        return None
    p = problem(model, data, ())
    keep = mine[p.row, p.component]
    row, sigma, value = p.row[keep], p.sigma[keep], p.value[keep]
    wrench = data.wrench[row]
    size = np.linalg.norm(wrench, axis=1)
    setup = np.column_stack([p.pose[keep], p.component[keep], np.round(wrench / np.maximum(size, 1e-300)[:, None], 3)])
    phase = np.array([x or "" for x in data.phase])[row]
    labels = np.column_stack([_number(setup), np.unique(phase, return_inverse=True)[1]])
    influence, rest = (part[row, ..., p.component[keep]] for part in _parts(model, data))
    looked_at: tuple[tuple[str, Integers | None, Array, list[Array]], ...] = (
        ("repeats scatter", p.replicate[keep], value, []),
        ("readings of a set-up scatter about a straight line over the load", _number(labels), value, [size]),
        ("readings are missed by the best springs", None, value - rest, [*influence.T]),
    )
    for seen in looked_at:
        of, group, y, shapes = seen
        left, freedom = _left(y / sigma, group, [x / sigma for x in shapes], 1.0 / sigma)
        if freedom >= FEWEST:
            break
    else:
        return None
    scale = robust_sd(left[left != 0.0]) if np.any(left) else 0.0
    square = float(np.sum(np.clip(left, -CUT * scale, CUT * scale) ** 2))
    times, stated = float(np.sqrt(square / freedom)), float(np.sqrt(np.mean(sigma**2)))
    p_value = 2.0 * min(float(chi2.sf(square, freedom)), float(chi2.cdf(square, freedom)))
    return Seen(times, min(p_value, 1.0), times * stated, stated, of, group is None)


def _parts(model: ArmModel, data: Measurements) -> tuple[Array, Array]:
    """What springs do per compliance (n, dof, 6), and all else (n, 6)."""
    influence, rest = spring_parts(model, data)
    return np.swapaxes(influence, 1, 2), rest


def _number(rows: Array) -> Integers:
    return np.asarray(np.unique(rows, axis=0, return_inverse=True)[1].reshape(-1))


def _left(y: Array, group: Integers | None, shapes: list[Array], one: Array) -> tuple[Array, int]:
    """What is left (m,) of y by ``shapes``, group by group with a constant ``one`` (m,), and its degrees of freedom."""
    if group is None:
        basis = spanning(np.column_stack(shapes), ROUNDING)
        return np.asarray(y - basis @ (basis.T @ y)), len(y) - basis.shape[1]
    count = int(group.max()) + 1
    columns = [one, *shapes]
    left, freedom = y, len(y)
    # One column after the other, each across those before it (Gram and Schmidt), in all groups at once.
    across: list[Array] = []
    for column in columns:
        x, whole = column, np.bincount(group, column**2, minlength=count)
        for q in across:
            x = x - q * np.bincount(group, q * x, minlength=count)[group]
        length = np.bincount(group, x**2, minlength=count)
        there = length > ROUNDING * whole
        q = x * np.where(there, 1.0 / np.sqrt(np.where(there, length, 1.0)), 0.0)[group]
        left = left - q * np.bincount(group, q * left, minlength=count)[group]
        freedom -= int(there.sum())
        across.append(q)
    return np.where(np.abs(left) > ROUNDING * np.abs(y), left, 0.0), freedom


def check_sigma(model: ArmModel, data: Measurements, *, confirmed: bool = False) -> None:
    """Refuse sigmas that are more than SLIP times off what the readings show, unless that is ``confirmed``.

    Raises
    ------
    InputError
        Stated and seen scatter are that far apart.
    """
    s = seen_scatter(model, data)
    if s is None or confirmed or 1.0 / SLIP <= s.times <= SLIP:
        return
    raise InputError(
        f"{data.source}: {s.words}{' (micrometres typed as millimetres?)' if s.times < 1.0 else ''}",
        allowed=f"a standard deviation within {SLIP:g} times of what the readings show",
        remedy="correct the column sigma_mm (standard deviation of one reading, mm) or leave it out, so that the "
        "scatter is estimated; or confirm with --confirm-units that the table is right as it is",
    )


def sigma_doubt(model: ArmModel, data: Measurements) -> Doubt | None:
    """Sigmas that readings refute (two-sided chi-square test): intervals are as much too narrow or too wide."""
    s = seen_scatter(model, data)
    if s is None or s.p_value >= LEVEL or 1.0 / NEAR <= s.times <= NEAR:
        return None
    wide = f"{s.times:.2g} times too narrow" if s.times > 1.0 else f"{1.0 / s.times:.2g} times too wide"
    words = (
        f"{'sigma_mm or the model' if s.by_springs else 'sigma_mm'} is refuted: {s.words} ({p_words(s.p_value)} of the "
        f"chi-square test). Intervals that rest on it are about {wide}: correct the column, or leave it out"
    )
    return Doubt("sigma", words, s.p_value, s.times)
