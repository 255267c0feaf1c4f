"""Surface error before and after, both under the same uncertain springs and the same uncertain force.

What is uncertain about the arm and the force is common to both, so it largely cancels in the ratio and in the
difference: two intervals that overlap do not mean that nothing can be told.

It cancels as far as the model is right: a spring that is wrong by the same share in both postures. What is wrong in one
posture only (a spring that varies with its angle and is modelled as constant) is not in these intervals.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from machining.cutting.spread import Estimated, deviations, interval
from machining.cutting.surface_error import DRAWS, SurfaceError, statistics_of
from robots import InputError
from robots.arrays import Array

Verdict = Literal["smaller", "larger", "cannot tell", "no error"]

WORDS = {
    "mean": "size of the mean surface error",
    "rms": "RMS surface error",
    "worst": "worst surface error",
    "peak_to_valley": "peak-to-valley surface error",
}


# Share of an error below which a change is none, whatever its interval.
UNCHANGED = 1e-3


@dataclass(frozen=True)
class Change:
    """One statistic before and after, m, with 95 % intervals; of the mean its size.

    ``difference``: before minus after; ``factor``: before over after, above 1 is better; ``verdict``: whether the
    interval of the difference leaves out zero. "no error": both are zero.
    """

    statistic: str
    before: Estimated
    after: Estimated
    difference: Estimated
    factor: Estimated
    verdict: Verdict

    @property
    def sentence(self) -> str:
        """What can be said, in words."""
        what, before, after = WORDS[self.statistic], _um(self.before.value), _um(self.after.value)
        if self.verdict == "no error":
            return f"No {what}: nothing deflects under this force."
        span = f"{_times(self.factor.low)} to {_times(self.factor.high)}"
        said = f"factor {_times(self.factor.value)} (95 %: {span})"
        if self.verdict == "cannot tell":
            return (
                f"Whether the {what} gets smaller cannot be told: {before} um before, {after} um after, {said}, "
                "and the interval of the difference holds zero."
            )
        if abs(self.difference.value) < UNCHANGED * abs(self.before.value):
            return f"The {what} stays at {before} um."
        verb = "falls" if self.verdict == "smaller" else "grows"
        low, high = sorted((abs(self.difference.low), abs(self.difference.high)))
        return f"The {what} {verb} from {before} to {after} um, by {_um(low)} to {_um(high)} um (95 %); {said}."


@dataclass(frozen=True, eq=False)
class Comparison:
    """Errors of the same path with two sets of postures.

    ``difference`` (n,) m: error before minus after at each point, ``sd`` (n,) m of it with the common uncertainty;
    ``changes`` by statistic; ``notes``: what the uncertainty rests on.
    """

    difference: Array
    sd: Array
    changes: dict[str, Change]
    notes: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """The change of the RMS error, in words, with what goes the other way, what it rests on and leaves out."""
        rests = "; ".join(self.notes)
        words = " ".join([self.changes["rms"].sentence, *self.against])
        return f"{words} Static deflection only. Rests on: {rests}."

    @property
    def against(self) -> tuple[str, ...]:
        """What gets worse where the RMS error gets better, or better where it gets worse, a sentence each."""
        verdict = self.changes["rms"].verdict
        other = {"smaller": "larger", "larger": "smaller"}.get(verdict)
        return tuple(
            f"But {change.sentence[0].lower()}{change.sentence[1:]}"
            for change in self.changes.values()
            if other is not None and change.verdict == other
        )


def compare(
    before: SurfaceError, after: SurfaceError, generator: np.random.Generator, draws: int = DRAWS
) -> Comparison:
    """Compare two errors of one path under common uncertainty.

    The difference at each point is exact as in :mod:`machining.cutting.spread`; statistics and their ratio come from
    ``draws`` that both share.

    Raises
    ------
    InputError
        Different paths; different springs, forces or uncertainties: then the change is not that of the postures.
    """
    same_path = before.arc_length.shape == after.arc_length.shape and np.allclose(
        before.arc_length, after.arc_length, rtol=0.0, atol=1e-9
    )
    if not same_path:
        raise InputError(
            "comparison of surface errors: the paths differ", code="K008", allowed="two sets of postures of one path"
        )
    u = before.uncertain
    # With a balance the depth, and so the force, rightly depends on the posture.
    same_force = before.balance is not None or np.allclose(before.force_part, after.force_part, rtol=1e-9, atol=1e-9)
    if not (u.same_as(after.uncertain) and same_force and (before.balance is None) == (after.balance is None)):
        raise InputError(
            "comparison of surface errors: model, force or their uncertainties differ",
            code="K008",
            allowed="the same model, force, tool, balance and uncertainty before and after",
            remedy="compute both with the same arguments but the postures",
        )
    form = before.form - after.form
    common = u.draws(draws, generator)
    drawn = [statistics_of(e.sample(common), e.weight) for e in (before, after)]
    exact = [statistics_of(e.normal, e.weight) for e in (before, after)]
    changes = {
        name: _change(name, *(np.abs(v[name]) for v in exact), *(np.abs(v[name]) for v in drawn)) for name in WORDS
    }
    return Comparison(before.normal - after.normal, deviations(u, form)[0], changes, u.notes)


def _change(name: str, before: Array, after: Array, drawn_before: Array, drawn_after: Array) -> Change:
    gap = drawn_before - drawn_after
    difference = Estimated(float(before - after), *interval(gap))
    zero = float(before) == 0.0 and float(after) == 0.0
    factor = Estimated(np.nan, np.nan, np.nan)
    if not zero:
        factor = Estimated(float(_ratio(before, after)), *interval(_ratio(drawn_before, drawn_after)))
    verdict: Verdict = "smaller" if difference.low > 0.0 else "larger" if difference.high < 0.0 else "cannot tell"
    estimates = [Estimated(float(v), *interval(d)) for v, d in ((before, drawn_before), (after, drawn_after))]
    return Change(name, estimates[0], estimates[1], difference, factor, "no error" if zero else verdict)


def _ratio(before: Array, after: Array) -> Array:
    """Before over after; infinite where nothing is left."""
    safe = np.where(after > 0.0, after, 1.0)
    return np.where(after > 0.0, before / safe, np.inf)


def _um(metres: float) -> str:
    return f"{metres * 1e6:.3g}"


def _times(factor: float) -> str:
    return "no limit" if np.isinf(factor) else f"{factor:.3g}"
