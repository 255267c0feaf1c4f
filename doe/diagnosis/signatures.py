"""How an effect would show in the readings: columns per amplitude, for every shape of its law, with priors."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from doe.diagnosis.setting import Setting
from doe.estimation.blocks import Alike
from fem.effects.base import Effect, EffectParameter, PlacedEffect
from fem.effects.observed import act, added
from robots import InputError
from robots.arrays import Array, Bools


@dataclass(frozen=True)
class Signature:
    """An effect with the shapes of its law held: readings change by ``columns`` (m, a) times its amplitudes.

    ``values`` (k,): of all parameters, amplitudes at their prior means; ``mean``, ``sd`` (a,): normal priors of the
    amplitudes; ``positive`` (a,): which of them cannot be negative. ``rows``: the columns, once for each group (g, a)
    of readings that are ``alike`` (None: the law tells these apart, and the rows are those of the readings). ``shift``
    (m,) and ``springs`` (m, s): change of the prediction and other derivatives by the springs, of an effect that has no
    amplitudes; else None. ``rarity``: log of how many such shapes go into one point of the grid.
    """

    effect: Effect
    values: Array
    rows: Array
    alike: Alike | None
    mean: Array
    sd: Array
    positive: Bools
    shift: Array | None = None
    springs: Array | None = None
    rarity: float = 0.0

    @property
    def columns(self) -> Array:
        """Change of the readings (m, a) by each amplitude."""
        return self.rows if self.alike is None else self.rows[self.alike.groups.number]


def prior(p: EffectParameter) -> tuple[float, float]:
    """Mean and standard deviation of an amplitude: its plausible range is one standard deviation about its middle.

    Signed amplitudes are as likely to either side; others are cut off at zero.
    """
    low, high = p.size
    return (0.0, 0.7 * high) if p.signed else (0.5 * (low + high), 0.5 * (high - low))


def shapes(effect: Effect) -> Iterator[Array]:
    """Values (k,) of all parameters, amplitudes at their prior means, for every point of the shapes' grid."""
    choices = [p.grid if p.role == "shape" else (prior(p)[0],) for p in effect.parameters]
    for one in product(*choices):
        values = np.array(one, dtype=np.float64)
        if effect.differs is None or effect.differs(values):
            yield values


def shape_count(effect: Effect) -> int:
    """Number of points on the shapes' grid, times the widths tried."""
    if effect.differs is None:
        return len(effect.widths) * math.prod(len(p.grid) for p in effect.parameters if p.role == "shape")
    return len(effect.widths) * sum(1 for _ in shapes(effect))


def widened(c: Signature) -> list[Signature]:
    """A signature with each of the widths that its effect's amplitudes may have."""
    return [c if width == 1.0 else replace(c, sd=width * c.sd) for width in c.effect.widths]


def signatures(s: Setting, effect: Effect) -> list[Signature]:
    """The signatures of an effect, one for each point of its shapes' grid.

    Raises
    ------
    InputError
        The effect's law gives another shape than one number for each reading, or numbers that are not finite.
    """
    return [signature(s, effect, values) for values in shapes(effect)]


def signature(s: Setting, effect: Effect, values: Array) -> Signature:
    """The signature with shapes as in ``values`` (k,), its columns around no effect."""
    amplitudes = effect.amplitudes
    if not amplitudes:
        changed = s.moved(s.springs, (*s.accepted, PlacedEffect(effect, values)))
        none = np.zeros(0)
        return Signature(
            effect,
            values,
            np.zeros((len(s.data), 0)),
            None,
            none,
            none,
            none.astype(bool),
            changed.prediction - s.prediction,
            changed.spring_columns,
        )
    chosen = [effect.parameters[k] for k in amplitudes]
    zero = values.copy()
    zero[amplitudes] = 0.0
    columns = np.stack([_column(s, effect, zero, k) for k in amplitudes], axis=1)
    if not np.isfinite(columns).all():
        raise InputError(
            f"effect {effect.code}", code="M011", value="readings that are not finite", remedy="check its law"
        )
    priors = np.array([prior(p) for p in chosen])
    positive = np.array([not p.signed for p in chosen])
    return Signature(effect, values, *once(s, columns), priors[:, 0], priors[:, 1], positive)


def once(s: Setting, columns: Array) -> tuple[Array, Alike | None]:
    """Columns (m, a), once for each group of readings that are alike where they are the same for all of a group."""
    rows = s.alike.once(columns)
    return (columns, None) if rows is None else (rows, s.alike)


def _column(s: Setting, effect: Effect, zero: Array, k: int) -> Array:
    """Change of the readings (m,) per amplitude k, from no effect."""
    p = effect.parameters[k]
    step = 0.3 * p.size[1]

    def with_it(by: float) -> tuple[PlacedEffect, ...]:
        return (*s.accepted, PlacedEffect(effect, np.where(np.arange(len(zero)) == k, by, zero)))

    if effect.stage == "arm":
        # On top of everything else: the rest of the arm need not be worked out again.
        d = added(with_it(step)[-1], s.situation)
        return np.asarray(d[s.data.row, s.data.component] / step)
    if effect.stage == "gauge" and not effect.own:
        # After everything else, and linear.
        before, there = s.seen
        return np.asarray((act(with_it(step)[-1], before, there) - before)[s.data.row, s.data.component] / step)
    return s.slope(with_it, step) if p.signed else (s.read(s.arm, with_it(step)) - s.prediction) / step
