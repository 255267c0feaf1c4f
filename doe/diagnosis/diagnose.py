"""The whole diagnosis: rank, accept, look again, and judge what was found on poses left out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np

from doe.certainty.verdicts import NAME
from doe.diagnosis import checks as checking
from doe.diagnosis.candidates import not_testable
from doe.diagnosis.evidence import leave_one_pose_out
from doe.diagnosis.hypotheses import (
    NONE,
    UNKNOWN,
    Decision,
    Hypothesis,
    Kind,
    Options,
    Ranking,
    best_law,
    decide,
    is_learned,
    log_priors,
)
from doe.diagnosis.known import Refit, accept, base_of, refit
from doe.diagnosis.outlying import ODD, reading_weights
from doe.diagnosis.ranking import rank
from doe.diagnosis.scatter import covariance
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import Signature, shape_count, signature
from doe.diagnosis.twins import APART, Likeness, beside_twins, likely_amplitude, twins_of
from doe.estimation.noise import Noise, within_readings
from doe.estimation.repeats import repeated
from doe.plausibility.passive_arm import told_by
from doe.tables.loaded import rms_mm
from fem.effects.base import PlacedEffect
from robots.arrays import Array, Bools
from robots.progress import Messages, Progress

# Effects looked for one after the other.
MOST = 3
# A further effect must explain at least this share of what the first one did: less is the first one's law being not
# quite right.
FURTHER = 0.01
# And this many times what its law may be off by, as a share of what it explained.
BENT_OFF = 5.5
# A further effect with which poses left out are predicted worse by more than this is none that a model should have.
WORSE = 1.05
# What names leave to the unknown may be this share of what there was to explain; more, surely there, is something else.
LEFT_OVER, SURE = 0.1, 0.9
# What is left to the unknown with more than this probability makes names provisional.
HALF = 0.5
# A name stands where so much is left for it after its checks. Of 61 names given on 159 sets of four foreign worlds (two
# of them not tuned on) 14 were wrong; with 0.8 eight of 49 would be, with 0.85 seven of 46, with 0.9 five of 37.
NAMES: Final = 0.85
# Checks that a second name must pass. On 178 sets of two foreign worlds all four second names that were wrong failed
# one of these, and three of the twelve that were right; of first names they tell nothing.
SECOND: Final[tuple[checking.Code, ...]] = ("no-twin", "predicts-left-out")


@dataclass(frozen=True)
class Found:
    """An accepted effect.

    Its numbers, their standard deviations by name (of amplitudes and free shapes), how probable it was when it was
    accepted, and what log evidence it gained.
    """

    placed: PlacedEffect
    sd: dict[str, float]
    probability: float
    log_gain: float

    @property
    def code(self) -> str:
        """Code of the effect."""
        return self.placed.effect.code


@dataclass(frozen=True)
class State:
    """A model on the readings: fitted numbers, and how far off it is, also on poses left out (mm, RMS).

    Readings that hardly count (:data:`doe.diagnosis.outlying.ODD`) are in the errors (m,), not in their RMS.
    """

    refit: Refit
    residual: Array
    left_out: Array
    fit_rms_mm: float
    left_out_rms_mm: float
    noise_floor_mm: float

    @property
    def setting(self) -> Setting:
        """The setting with its numbers."""
        return self.refit.setting


@dataclass(frozen=True)
class Rejected:
    """Effects with which poses that no fit had seen are predicted worse: RMS without and with them, mm."""

    codes: tuple[str, ...]
    before_mm: float
    after_mm: float


@dataclass(frozen=True)
class Diagnosis:
    """What is missing from a model, by these readings.

    ``rankings``: one for each look, the first with nothing accepted; ``decisions`` go with them. ``before`` and
    ``after``: the model without and with the effects found (the most probable one where the verdict is ambiguous);
    ``start``: the setting that was ranked first. ``provisional``: effects taken up that are not sure; ``learned``: laws
    without a name, each of one place along one axis; ``odds``: log
    odds of all effects taken up against something unknown; ``rejected``: what was found and spoils unseen poses.
    """

    verdict: Kind
    reason: str
    effects: tuple[Found, ...]
    provisional: tuple[Found, ...]
    learned: tuple[Found, ...]
    odds: float
    rankings: tuple[Ranking, ...]
    decisions: tuple[Decision, ...]
    before: State
    after: State
    start: Setting = field(repr=False)
    weight: Array = field(repr=False)
    rejected: Rejected | None = None

    @property
    def found(self) -> tuple[Found, ...]:
        """All that was taken up, the sure ones first, in the order of the model's accepted effects otherwise."""
        return (*self.effects, *self.learned, *self.provisional)

    @property
    def counts(self) -> Bools:
        """Which readings (m,) count: not those that are far from what all others make of them."""
        return self.weight >= ODD

    def not_testable(self) -> dict[str, str]:
        """Codes that these readings cannot judge, with the reason."""
        found = [f.code for f in self.found]
        # What would give the same readings as what was found was judged with it.
        found += self.same
        look = min(len(found), len(self.rankings) - 1)
        return not_testable(self.after.setting, self.rankings[look], found)

    @property
    def same(self) -> tuple[str, ...]:
        """Codes that would give the very same readings as what was found."""
        taken = len(self.found)
        return tuple(dict.fromkeys(code for d in self.decisions[:taken] for code in d.same))

    def twins(self, codes: Sequence[str] | None = None) -> dict[str, tuple[str, ...]]:
        """For each code (of ``codes``), those that these readings could not tell from it.

        What was found is asked about with all else that was found in the model; its rivals, and all others, where they
        were ranked. One that hardly shows there, so that anything would imitate it, has no entry.
        """
        found, r, best = [f.code for f in self.found], self._named_by, self._shapes
        out = {}
        ranked = Likeness(self.without(found[-1]) if found else self.start, r.best.noise, self.weight)
        for code in [*best] if codes is None else codes:
            if code in found:
                out[code] = self._imitated[code]
                continue
            if code in best:
                like = ranked
                own = signature(like.s, best[code].effect, best[code].values)
                change = like.change(own, likely_amplitude(r.of(code)))
                if like.strength(change) < APART:
                    continue
            else:
                continue
            out[code] = twins_of(like, change, code, best)
        return out

    def plausible_twins(self, code: str) -> tuple[str, ...] | None:
        """Of an effect that was found, those twins that are so with numbers that are plausible for them.

        None where it hardly shows, so that anything would imitate it. Others of its family at its place are none: they
        are cured alike.
        """
        like, change = self._likenesses[code]
        if like.strength(change) < APART:
            return None
        own, known = next(f.placed.effect for f in self.found if f.code == code), self.start.known
        other = [c for c in self._imitated[code] if (known[c].family, known[c].place) != (own.family, own.place)]
        return twins_of(like, change, code, self._shapes, among=other)

    @cached_property
    def _imitated(self) -> dict[str, tuple[str, ...]]:
        """Twins of each effect that was found."""
        return {code: twins_of(*of, code, self._shapes) for code, of in self._likenesses.items()}

    @cached_property
    def _likenesses(self) -> dict[str, tuple[Likeness, Array]]:
        """Of each effect that was found: readings with all else in the model, and what it changes of them (m,)."""
        return {f.code: self._likeness(f.code) for f in self.found}

    def _likeness(self, code: str) -> tuple[Likeness, Array]:
        placed = next(f.placed for f in self.found if f.code == code)
        like = Likeness(self.without(code), self.after.refit.noise, self.weight)
        # Straight like the columns that imitate it: what bends with a large turn would tell it from itself.
        own = signature(like.s, placed.effect, placed.values)
        return like, like.change(own, placed.values[placed.effect.amplitudes])

    @property
    def _named_by(self) -> Ranking:
        """The look that took up the last effect; the verdict's own where nothing was."""
        return self.rankings[min(len(self.found), len(self.rankings)) - 1] if self.found else self.ranking

    @property
    def _shapes(self) -> dict[str, Signature]:
        """The best shape of each effect there."""
        return {h.code: h.signature for h in self._named_by.hypotheses if h.signature is not None}

    def without(self, code: str) -> Setting:
        """The setting with all that was found but one."""
        s = self.after.setting
        return s.moved(s.springs, [e for e in s.accepted if e.effect.code != code])

    @property
    def suspect(self) -> Hypothesis | None:
        """Of laws learned at one place the one that alone goes best with the readings: where something unknown acts.

        None where none of them explains anything.
        """
        return best_law(self.rankings[0])

    @property
    def ranking(self) -> Ranking:
        """The ranking that the verdict rests on."""
        return self.rankings[self.look]

    @property
    def look(self) -> int:
        """Number of the look that the verdict rests on: the one after all names if something beside them is open."""
        named = len(self.effects)
        return named if named and self.provisional else max(named - 1, 0)

    @cached_property
    def checks(self) -> tuple[checking.Check, ...]:
        """What speaks for and against everything that was taken up, worked out when asked for."""
        return checking.checks(self)

    @cached_property
    def stated(self) -> float:
        """Probability of the first name after these checks; NaN where nothing was taken up."""
        return checking.stated(self.found[0], self.checks) if self.found else math.nan


def diagnose(
    s: Setting,
    options: Options = Options(),  # noqa: B008 - frozen
    progress: Messages | None = None,
    within: Progress | None = None,
) -> Diagnosis:
    """Find what is missing from a model whose springs are fitted.

    Readings that tell nothing about the arm are fitted and ranked once, for the record, and get that verdict.
    ``progress`` hears what each look found, ``within`` how far a look is.
    """
    say = progress or (lambda text: None)
    weight = reading_weights(s)
    say(f"{len(s.data)} readings in {len(s.data.poses)} poses, {len(s.known)} candidates")
    rankings: list[Ranking] = []
    decisions: list[Decision] = []
    found: list[_Pick] = []
    told = told_by(s.data)
    here, total = s, 0.0
    for look in range(MOST + 1 if options.for_record else MOST):
        r = rank(here, weight, options, further=bool(found), progress=within)
        d = (
            beside_twins(here, r, weight, decide(r, further=bool(found)))
            if told.anything
            else Decision("uninformative", None, told.words)
        )
        d = _with_partner(rankings, found, r, d)
        rankings.append(r)
        decisions.append(d)
        say(f"look {look + 1}: {_words(r) if told.anything else 'these readings tell nothing about the arm'}")
        if d.hypothesis is None or look == MOST:
            break
        gain = d.hypothesis.log_evidence - r.of(NONE).log_evidence
        if _as_noise(gain, s) < max(FURTHER * _as_noise(total, s), _bent_off(found, s)):
            break
        there = refit(accept(here, d.hypothesis), d.hypothesis.noise, weight).setting
        if found and _spoils(here, there, d.hypothesis.noise, weight):
            break
        total, here = max(total, gain), there
        found.append(_Pick(d.hypothesis, gain, d.kind, d.reason))
        # What was sure beside all others at once needs no second look.
        if len(found) == 2 and found[0].kind not in ("named", "learned"):
            here, found = _swapped(s, here, found, weight, options, say)
    # Both models at the scatter that the better one leaves: by its own the poorer one would fit its springs loosely.
    noise = rankings[len(found)].of(NONE).noise if len(found) < len(rankings) else found[-1].hypothesis.noise
    before = state_of(s, noise, weight)
    after = state_of(here, noise, weight) if found else before
    all_found = tuple(
        Found(after.setting.accepted[k], after.refit.spread(k), pick.hypothesis.probability, pick.gain)
        for k, pick in enumerate(found, start=len(s.accepted))
    )
    odds = _odds_against_unknown(s, rankings, found, options)
    verdict, reason = _verdict(s, rankings, decisions, found, odds)
    # A name that leaves most unexplained is no name: what it took up may not be it.
    sure = () if verdict == "unknown" or len(found) == MOST else tuple(zip(all_found, found, strict=True))
    certain = tuple(f for f, pick in sure if pick.kind == "named")
    learned = tuple(f for f, pick in sure if pick.kind == "learned")
    rest = tuple(f for f in all_found if f not in (*certain, *learned))
    whole = Diagnosis(
        verdict, reason, certain, rest, learned, odds, tuple(rankings), tuple(decisions), before, after, s, weight
    )
    # Where poses are left out in turn it is what was taken up that counts, not how it is called.
    return _doubted(whole) if options.for_record else whole


def without_harm(d: Diagnosis, before_mm: float, after_mm: float) -> Diagnosis:
    """The diagnosis with a model of springs alone, no name given, where unseen poses get worse with what was found.

    ``before_mm``, ``after_mm``: RMS at poses that neither the choice of effects nor the fit had seen.
    """
    if not d.found or not after_mm > before_mm:
        return d
    codes = tuple(f.code for f in d.found)
    return replace(
        d,
        verdict="unknown" if d.verdict == "unknown" else "ambiguous",
        reason=f"with {' and '.join(codes)} poses not seen are predicted worse",
        effects=(),
        provisional=(),
        learned=(),
        after=d.before,
        rejected=Rejected(codes, before_mm, after_mm),
    )


def _doubted(d: Diagnosis) -> Diagnosis:
    """The diagnosis with those names provisional that their checks speak against; all of them where the first is."""
    against = {f.code: why for k, f in enumerate(d.effects) if (why := _doubt(d, f, first=not k))}
    if not against:
        return d
    code, why = next(iter(against.items()))
    out = d.effects if code == d.effects[0].code else tuple(f for f in d.effects if f.code in against)
    return replace(
        d,
        verdict="ambiguous",
        reason=f"{code} is not sure: {why}",
        effects=tuple(f for f in d.effects if f not in out),
        provisional=(*out, *d.provisional),
    )


def _doubt(d: Diagnosis, f: Found, *, first: bool) -> str:
    """Why a name is not sure; empty where it is."""
    about = checking.about(f, d.checks)
    decisive = [c for c in about if c.passed is False and c.code in SECOND and c.effect and not first]
    if decisive:
        return decisive[0].evidence
    if checking.stated(f, d.checks) >= NAMES:
        return ""
    worst = min(about, key=lambda c: c.factor)
    return worst.evidence if worst.factor < 1.0 else f"{100.0 * f.probability:.0f} % speak for it"


@dataclass(frozen=True)
class _Pick:
    """A hypothesis taken up, the log evidence it gained, how sure it is, and why."""

    hypothesis: Hypothesis
    gain: float
    kind: Kind
    reason: str


def _with_partner(rankings: Sequence[Ranking], found: Sequence[_Pick], r: Ranking, d: Decision) -> Decision:
    """The decision of a second look, or what the first look saw beside the effect that is now accepted.

    Alone it was fitted to what both do, and what is left may look like neither.
    """
    if len(found) != 1 or d.kind in ("none", "named"):
        return d
    code, share = rankings[0].partner(found[0].hypothesis.code)
    if share < HALF or is_learned(code) or all(h.code != code for h in r.hypotheses):
        return d
    kind: Kind = "named" if share >= NAME else "ambiguous"
    picked = replace(r.of(code), probability=share)
    return Decision(kind, picked, "it explains the readings together with what was found before it")


def _bent_off(found: Sequence[_Pick], s: Setting) -> float:
    """Log evidence that laws which are not quite right may leave to a further effect."""
    laws = ((pick.gain, pick.hypothesis.signature) for pick in found)
    return BENT_OFF * max((_as_noise(x, s) * c.effect.law_doubt**2 for x, c in laws if c is not None), default=0.0)


def _spoils(here: Setting, there: Setting, noise: Noise, weight: Array) -> bool:
    """Whether poses left out are predicted worse with what is newly accepted there."""
    pose = here.data.pose
    before, after = (leave_one_pose_out(base_of(s), covariance(s, noise, weight), pose).error for s in (here, there))
    good = weight >= ODD
    return bool(np.sum(after[good] ** 2) > WORSE**2 * np.sum(before[good] ** 2))


def _words(r: Ranking) -> str:
    return ", ".join(f"{h.code} {100.0 * h.probability:.0f} %" for h in r.hypotheses[:3])


def _swapped(
    s: Setting, here: Setting, found: list[_Pick], weight: Array, options: Options, say: Messages
) -> tuple[Setting, list[_Pick]]:
    """Look at the first effect again now that the second is there: alone it may have stood for both."""
    first, second = found
    given = len(s.accepted)
    others = (*here.accepted[:given], *here.accepted[given + 1 :])
    alone = refit(s.moved(here.springs, others), second.hypothesis.noise, weight).setting
    r = rank(alone, weight, options, further=True)
    d = beside_twins(alone, r, weight, decide(r))
    say(f"first look repeated: {_words(r)}")
    if d.hypothesis is None:
        return here, found
    gain = d.hypothesis.log_evidence - r.of(NONE).log_evidence
    again = _Pick(d.hypothesis, gain, d.kind, d.reason)
    if d.hypothesis.code == first.hypothesis.code:
        return here, [again, second]
    # Order of acceptance is order of the accepted: the second one now stands first.
    return refit(accept(alone, d.hypothesis), d.hypothesis.noise, weight).setting, [second, again]


def state_of(s: Setting, noise: Noise, weight: Array) -> State:
    """A setting refitted at a noise, with its errors on its own poses and on poses left out."""
    fitted = refit(s, noise, weight)
    here = fitted.setting
    base, V = base_of(here), covariance(here, noise, weight)
    left = leave_one_pose_out(base, V, here.data.pose)
    f, component = here.prediction, here.data.component
    # The noise was found at the predictions that were ranked, and shares of the deflection move with these.
    fitted = replace(fitted, noise=within_readings(here.data, f, noise))
    floor = rms_mm(fitted.noise.spread(here.data, f), component) if (component < 3).any() else 0.0
    good = weight >= ODD
    own, out = (rms_mm(error[good], component[good]) for error in (here.residual, left.error))
    return State(fitted, here.residual, left.error, own, out, floor)


def _odds_against_unknown(s: Setting, rankings: list[Ranking], found: list[_Pick], options: Options) -> float:
    """Log odds of the effects found, all together, against something unknown; NaN where none was found."""
    if not found:
        return math.nan
    prior = log_priors(s, [h.code for h in rankings[0].hypotheses], options)
    last, least = rankings[min(len(found), len(rankings) - 1)], min(prior.values())
    known = last.of(NONE).log_evidence
    for pick in found:
        # The shapes were chosen by these readings: their number is part of what the name is worth beforehand.
        known += prior.get(pick.hypothesis.code, least) - math.log(shape_count(s.known[pick.hypothesis.code]))
    return known - rankings[0].of(UNKNOWN).log_evidence - prior[UNKNOWN]


def _as_noise(gain: float, s: Setting) -> float:
    """A log evidence as it would be were the noise not known: what is missing would then pass for noise as it can.

    Noise that repeats tell makes of what one effect explains many thousands, beside which no second one counts.
    """
    m = len(s.data)
    return 0.5 * m * math.log1p(2.0 * max(gain, 0.0) / m) if repeated(s.data) is not None else gain


def _verdict(
    s: Setting, rankings: list[Ranking], decisions: list[Decision], found: list[_Pick], odds: float
) -> tuple[Kind, str]:
    if not found:
        return decisions[0].kind, decisions[0].reason
    last = rankings[min(len(found), len(rankings) - 1)]
    left = last.of(UNKNOWN).log_evidence - last.of(NONE).log_evidence
    left, gained = _as_noise(left, s), _as_noise(sum(pick.gain for pick in found), s)
    # What is unknown along a learned law's own axis is that law.
    if odds < 0.0 and found[0].kind != "learned":
        return "unknown", "no effects of the catalogue explain the pattern over poses and loads"
    if last.of(UNKNOWN).probability > SURE and left > LEFT_OVER * (gained + left):
        return "unknown", "the best effects of the catalogue leave much of the pattern unexplained"
    if len(found) == MOST:
        return "ambiguous", f"it takes {MOST} effects or more: one that nobody catalogued is as likely"
    for kind in ("unknown", "ambiguous"):
        for pick in found:
            if pick.kind == kind:
                return "ambiguous", pick.reason
    if last.of(UNKNOWN).probability > HALF:
        return "ambiguous", "something unknown is left beside what was found"
    if found[0].kind == "learned":
        return "learned", found[0].reason
    return "named", "explains the readings and predicts poses left out"
