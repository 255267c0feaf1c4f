"""Which effects these readings might show, in which shapes; which they cannot tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from doe.diagnosis.evidence import Base, Whitened
from doe.diagnosis.finer import finer
from doe.diagnosis.fits import Stack, fit_all
from doe.diagnosis.hypotheses import NONE, UNKNOWN, Ranking, clash, is_learned
from doe.diagnosis.known import free_columns
from doe.diagnosis.scatter import covariance, fitted_noise, with_setup
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import Signature, shapes, signature, signatures, widened
from doe.diagnosis.weighing import as_if, bent, extended
from doe.estimation.noise import Noise
from fem.effects.base import Effect, PlacedEffect
from fem.effects.observed import observed
from fem.statics.loads import LoadedPoses
from robots import InputError
from robots.arrays import Array

# Why a spring is no candidate of its own.
FITTED_ALREADY = "the joint's spring is fitted already"
# Without priors amplitudes and springs have standard deviations larger by this.
VAGUE = 30.0
# An effect of usual size must raise chi-square by this to be seen at all.
SEEN = 2.0
# Laws with more shapes than this stand for themselves by their best one only.
MANY = 40
# Of each law the best few shapes at each of a few noises are kept: those this far behind in log evidence add nothing.
KEPT, NOTHING = 8, 12.0
# Shapes that the readings cannot tell apart are taken in their own order, not as rounding has it: equal to so many
# decimals of the log evidence.
TIED = 6
# Effects this far behind the best one in log evidence, by the best of a few noises, need no closer look by themselves.
BEHIND = 30.0
# Effects that lead by so many noises have their laws bent.
BENT = 24
# Laws whose shapes are sought between the points of their grids: so many, of those that gain this log evidence.
REFINED, LEADS = 8, 5.0
# An effect of usual size must raise chi-square by this to be told by name.
TESTABLE = 30.0
# An effect without sizes that lags behind nothing missing by this log evidence, at any noise, is ruled out.
RULED_OUT = 25.0


def candidates_of(s: Setting, *, priors: bool = True, further: bool = False) -> dict[str, list[Signature]]:
    """Signatures of every effect that these readings might show, by code; ``further``: something was found already."""
    taken = {e.effect.code for e in s.accepted}
    out = {
        code: possible(s, effect) if effect.gross else [w for c in signatures(s, effect) for w in widened(c)]
        for code, effect in s.known.items()
        if code not in taken
        and not (further and effect.gross)
        and impossible(s, effect) is None
        and not any(clash(effect, e.effect) for e in s.accepted)
    }
    out = {code: some for code, some in out.items() if some}
    return out if priors else {code: [_vague(c) for c in some] for code, some in out.items()}


def possible(s: Setting, effect: Effect) -> list[Signature]:
    """Signatures of those shapes with which the arm can stand as it was read at all."""
    out = []
    for values in shapes(effect):
        try:
            out.append(signature(s, effect, values))
        except InputError:
            # At these angles a parallelogram would be flat: the convention cannot be that one.
            continue
    return out


def standing(s: Setting, elsewhere: LoadedPoses) -> dict[str, Effect]:
    """The known effects, gross ones only with those shapes with which the arm can stand ``elsewhere``.

    It stood wherever it was read, whether these readings are used or not: another convention of angles under which it
    could not is none.
    """
    out = {}
    for code, effect in s.known.items():
        if not effect.gross:
            out[code] = effect
            continue
        kept = [v for v in shapes(effect) if stands(s, elsewhere, (PlacedEffect(effect, v),))]
        if kept:
            grids = [tuple(dict.fromkeys(column)) for column in np.transpose(kept).tolist()]
            narrowed = (
                replace(p, grid=g) if p.role == "shape" else p for p, g in zip(effect.parameters, grids, strict=True)
            )
            out[code] = replace(effect, parameters=tuple(narrowed))
    return out


def stands(s: Setting, at: LoadedPoses, effects: Sequence[PlacedEffect]) -> bool:
    """Whether the arm can stand at loaded poses with what is accepted and further effects."""
    try:
        observed(s.arm, at, (*s.accepted, *effects))
    except InputError:
        return False
    return True


def _vague(c: Signature) -> Signature:
    """A signature of which nothing is known beforehand, not even its sign (an ablation)."""
    return replace(c, mean=0.0 * c.mean, sd=VAGUE * c.sd, positive=np.zeros_like(c.positive))


@dataclass(frozen=True)
class Tried:
    """Candidates with the shapes that count, those of the leaders bent.

    ``plain``: what the bent ones are without; ``close``: codes that are not far behind the best one.
    """

    candidates: dict[str, list[Signature]]
    plain: dict[int, Signature]
    close: set[str]

    @cached_property
    def stack(self) -> Stack:
        """All candidates."""
        return Stack(self.candidates)

    @cached_property
    def near(self) -> Stack:
        """Those that are close."""
        return Stack({code: some for code, some in self.candidates.items() if code in self.close})


def tried(
    s: Setting, base: Base, weight: Array, noises: Sequence[Noise], candidates: dict[str, list[Signature]]
) -> Tried:
    """Candidates with those shapes only that count for something, by a few noises; none ruled out for its shape.

    The evidence stays an average over all shapes: what is left out adds next to nothing to it. Leaders' laws are bent
    (:mod:`doe.diagnosis.doubts`) at the amplitudes that go best with the readings.
    """
    gross = {code: some for code, some in candidates.items() if some[0].effect.gross}
    lead = dict.fromkeys(gross, -np.inf)
    stack = Stack(candidates)
    kept: dict[str, set[int]] = {code: set() for code in candidates}
    best: dict[str, float] = {}
    at: dict[str, tuple[Noise, int]] = {}
    amplitude: dict[int, Array] = {}
    most = np.full(len(stack.flat), -np.inf)
    for noise in noises:
        w = Whitened(base, covariance(s, noise, weight))
        for code, some in gross.items():
            z = max(Whitened(extended(s, base, c), w.V).log_evidence for c in some)
            lead[code] = max(lead[code], z - w.log_evidence)
        fits = fit_all(w, stack)
        gain = fits.log_evidence - w.log_evidence
        for i in np.flatnonzero(gain > most).tolist():
            most[i], amplitude[id(stack.flat[i])] = gain[i], fits.mean(i)
        for code, place in stack.place.items():
            here = gain[place]
            order = np.argsort(-np.round(here, TIED), kind="stable")[:KEPT]
            kept[code] |= {int(i) for i in order if here[i] > here[order[0]] - NOTHING}
            if here[order[0]] > best.get(code, -np.inf):
                best[code], at[code] = float(here[order[0]]), (noise, int(order[0]))
    finer_ones = _finer(s, base, weight, candidates, best, at)
    out: dict[str, list[Signature]] = {}
    plain: dict[int, Signature] = {}
    leaders = set(sorted(best, key=lambda code: -best[code])[:BENT])
    for code, some in candidates.items():
        if code in gross and lead[code] <= -RULED_OUT:
            continue
        mine = [c for i, c in enumerate(some) if i in kept[code] or c.shift is not None]
        if code in finer_ones:
            c, amplitude[id(c)] = finer_ones[code]
            mine.append(c)
        if code in leaders:
            curved = [bent(s, c, amplitude[id(c)]) for c in mine]
            plain |= {id(x): c for x, c in zip(curved, mine, strict=True)}
            mine = curved
        out[code] = mine
    top = max([0.0, *best.values()])
    close = {code for code in out if best.get(code, top) > top - BEHIND}
    return Tried(out, plain, close)


def _finer(
    s: Setting,
    base: Base,
    weight: Array,
    candidates: dict[str, list[Signature]],
    best: dict[str, float],
    at: dict[str, tuple[Noise, int]],
) -> dict[str, tuple[Signature, Array]]:
    """Better shapes of the laws that lead, each at the noise that it leaves, with their amplitudes.

    ``best``: gain in log evidence of each law's best shape so far; raised where a finer one is better.
    """
    out: dict[str, tuple[Signature, Array]] = {}
    whitened: dict[Noise, Whitened] = {}
    free = free_columns(s, base)
    lead = sorted((code for code in best if best[code] > LEADS), key=lambda code: -best[code])
    for code in [code for code in lead if candidates[code][0].effect.fine][:REFINED]:
        noise, i = at[code]
        c = candidates[code][i]
        # The noise that this law leaves: by a larger one all shapes near it would do as well.
        calm = fitted_noise(s, np.hstack([free, c.columns]), weight, noise)
        found = finer(s, Whitened(base, covariance(s, calm, weight)), c)
        if found is not None:
            out[code] = found
            w = whitened.setdefault(noise, Whitened(base, covariance(s, noise, weight)))
            best[code] = max(best[code], float(fit_all(w, [found[0]]).log_evidence[0]) - w.log_evidence)
    return out


def impossible(s: Setting, effect: Effect) -> str | None:
    """Why these readings can say nothing about an effect, whatever its size; None if they might."""
    if effect.needs_history and not s.history.is_known:
        return "the readings do not distinguish loading from unloading: give them a phase or a step"
    if effect.needs_clock and not np.isfinite(s.history.clock).all():
        return "the readings do not say in which order they were taken: number them in the column step"
    if effect.depends_on == "temperature" and not s.history.varies("temperature"):
        return "the readings do not say at which temperatures they were taken: give them a column temperature_C"
    if effect.depends_on == "session" and not s.history.varies("session"):
        return "the readings do not say that there was more than one session: give them a column session"
    if effect.spring in s.free:
        return FITTED_ALREADY
    return None


def hidden_among(
    s: Setting, base: Base, weight: Array, noise: Noise, candidates: dict[str, list[Signature]]
) -> tuple[dict[str, float], dict[str, float]]:
    """Codes whose effect of usual size would not be seen, with its excess; and the excess of all codes.

    Judged without scatter between set-ups beyond what is usual: the base's own may be the effect itself.
    """
    common = min(noise.pose_share, 0.01)
    w = Whitened(base, covariance(s, with_setup(noise, common), weight))
    hidden, usual = {}, {}
    stack = Stack(candidates)
    fits = fit_all(w, stack)
    excess = {id(c): fits.shows(i) for i, c in enumerate(stack.flat)}
    for some in candidates.values():
        for c in some:
            if c.shift is not None:
                WX = w.V.whiten(as_if(s, base, c, w.V)[:, None])
                excess[id(c)] = np.sum(WX**2, axis=0) - np.sum((w.root @ (w.W.T @ WX)) ** 2, axis=0)
    for code, some in candidates.items():
        found = [_usual_excess(c, excess[id(c)]) for c in some]
        usual[code] = float(np.median(found))
        if max(found) < SEEN:
            hidden[code] = max(found)
    return hidden, usual


def _usual_excess(c: Signature, shows: Array) -> float:
    """Rise of chi-square by an effect of usual size, of the rises (a,) by its columns."""
    if c.shift is not None:
        return float(shows[0])
    rise = shows * (c.mean**2 + c.sd**2)
    return float(np.mean(rise) * (len(rise) if c.positive.all() else 1.0))


def not_testable(s: Setting, r: Ranking, found: Sequence[str] = ()) -> dict[str, str]:
    """Codes that these readings cannot judge, with the reason; ``found``: codes that were seen all the same."""
    out: dict[str, str] = {}
    taken = {e.effect.code for e in s.accepted}
    for code, effect in s.known.items():
        if code in found or code in taken or is_learned(code):
            continue
        reason = impossible(s, effect)
        if reason is not None:
            out[code] = reason
        elif code in r.hidden:
            out[code] = _hidden(r.hidden[code])
    for h in r.hypotheses:
        if h.code in (NONE, UNKNOWN, *found, *r.credible()) or is_learned(h.code) or not h.usual_excess < TESTABLE:
            continue
        out[h.code] = (
            f"an effect of usual size would raise chi-square by {h.usual_excess:.2g} only, beyond what springs and "
            f"noise take up: {TESTABLE:.0f} would be needed to name it"
        )
    return out


def _hidden(excess: float) -> str:
    if excess < 1e-6:
        return "no reading depends on it, or the springs absorb all of it"
    return f"springs and noise absorb it: chi-square would rise by {excess:.1g}"
