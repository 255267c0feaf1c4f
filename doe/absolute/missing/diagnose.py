"""The whole diagnosis of absolute readings: look, take up, look again, ask each effect once more beside the others."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.special import logsumexp

from doe.absolute.calibrate import FOLDS, fitted
from doe.absolute.fit import Fit
from doe.absolute.gross import Gross, gross
from doe.absolute.known import known
from doe.absolute.missing.candidates import Candidate, candidates, kinds
from doe.absolute.missing.evidence import NONE, UNKNOWN, Weighing, ground, weigh
from doe.absolute.prediction import Predicted, carried_over, folds, left_out
from doe.absolute.readings import AbsoluteReadings
from doe.absolute.start import Start, started
from doe.absolute.structure import Twin, twins
from doe.absolute.unknowns import Layout, Unknown, masses, unknowns
from doe.absolute.weight import has_weight
from doe.certainty.verdicts import ALARM, FURTHER, GAIN, NAME, PRIOR_NONE, PRIOR_UNKNOWN
from fem import ArmModel
from robots.progress import Messages

Verdict = Literal["none", "named", "ambiguous", "unknown"]
# A real arm has many small errors; so many are taken up one after the other.
MOST = 16
# What moves readings by less than this share of their scatter is not worth a name.
SMALL = 0.15
# Share to which drawings know what links weigh, and where their centres are.
DRAWN = 0.04
# Rivals that are kept.
KEPT = 8
# What is left to the unknown with more than this probability is no effect of the catalogue.
HALF = 0.5


@dataclass(frozen=True)
class Line:
    """A hypothesis of a look: its code, log evidence over that of nothing, probability, and what it does (m, RMS)."""

    code: str
    gain: float
    probability: float
    acts: float


@dataclass(frozen=True)
class Look:
    """What one look saw, most probable first; ``axis``: of the unknown, what it varies with; ``scatter`` m."""

    lines: tuple[Line, ...]
    axis: str
    scatter: float
    hidden: tuple[str, ...]
    weighing: Weighing

    def of(self, code: str) -> Line:
        """One hypothesis."""
        return next(one for one in self.lines if one.code == code)

    @property
    def effects(self) -> list[Line]:
        """The effects among them."""
        return [one for one in self.lines if one.code not in (NONE, UNKNOWN)]


@dataclass(frozen=True)
class FoundEffect:
    """An effect that was taken up: the candidate, its unknowns as large as they go best, what it does (m, RMS).

    ``probability``: among all else, the others in the model; ``rivals``: codes that explain it about as well.
    """

    candidate: Candidate
    unknowns: tuple[Unknown, ...]
    acts: float
    gain: float
    probability: float
    rivals: tuple[str, ...]

    @property
    def free(self) -> str:
        """What ``calibrate --free`` has for it."""
        return self.candidate.free or ",".join(one.name for one in self.unknowns)


@dataclass(frozen=True)
class Missing:
    """What absolute readings say is missing.

    ``effects`` are sure, ``provisional`` are not; ``looks`` one after the other; ``before``: geometry, frames, targets
    and the model's own springs and masses, ``after`` with all that was taken up; ``left_out``: readings predicted by
    the others, before and after; ``holdout``: other readings, with both; ``twins``: of the geometry that nothing tells.
    """

    verdict: Verdict
    reason: str
    effects: tuple[FoundEffect, ...]
    provisional: tuple[FoundEffect, ...]
    looks: tuple[Look, ...]
    before: Fit
    after: Fit
    left_out: tuple[Predicted, Predicted]
    holdout: tuple[AbsoluteReadings, Predicted, Predicted] | None
    twins: tuple[Twin, ...]
    gross: tuple[Gross, ...]
    weighs: bool

    @property
    def found(self) -> tuple[FoundEffect, ...]:
        """All that was taken up, the sure ones first."""
        return (*self.effects, *self.provisional)

    def left_out_rms(self) -> tuple[float, float]:
        """RMS distances m of readings left out, before and after; wrong ones aside."""
        wrong = [one.row for one in self.gross]
        before, after = (np.delete(p.error, wrong, axis=0) for p in self.left_out)
        return float(np.sqrt(np.mean(np.sum(before**2, axis=1)))), float(np.sqrt(np.mean(np.sum(after**2, axis=1))))


@dataclass(frozen=True)
class _Work:
    """What every estimate of one diagnosis shares."""

    model: ArmModel
    data: AbsoluteReadings
    begin: Start
    base: Layout
    same: tuple[Twin, ...]

    def fit(self, more: Sequence[Unknown]) -> Fit:
        """Geometry, frames and targets with some effects' unknowns."""
        taken = {one.name for one in more}
        rest = tuple(one for one in self.base.unknowns if one.name not in taken)
        return fitted(self.model, self.data, Layout((*rest, *more)), self.begin, self.same, robust=True)


def diagnose_positions(
    model: ArmModel,
    data: AbsoluteReadings,
    *,
    holdout: AbsoluteReadings | None = None,
    seed: int = 0,
    progress: Messages | None = None,
) -> Missing:
    """Find what a model is missing beside its geometry, by absolute readings.

    Raises
    ------
    InputError
        Too few readings for frames, targets and geometry.
    """
    say = progress or (lambda _: None)
    begin = started(model.robot, data, seed)
    names = ("geometry", *(f"rail.{a}" for a in "xyz" if data.has_rail))
    layout = Layout(unknowns(model.robot, data, names))
    same = twins(model, data, layout, begin.nominal, seed)
    work = _Work(model, data, begin, Layout((*layout.unknowns, *_as_every_arm(model, data, layout))), same)
    some = candidates(model, data)
    say(f"{len(data)} positions, {len(some)} candidates")
    before = work.fit(())
    looks, picks, after = _looks(work, before, some, say)
    effects, provisional = list[FoundEffect](), list[FoundEffect]()
    for k, pick in enumerate(picks):
        others = [other for i, other in enumerate(picks) if i != k]
        one = _once_more(work, pick, others, some) if len(picks) > 1 else pick
        (effects if one.probability >= NAME else provisional).append(one)
    parts = folds(data, FOLDS, seed)
    first = left_out(before, parts)
    kept = None if holdout is None else (holdout, carried_over(before, holdout)[0], carried_over(after, holdout)[0])
    out = Missing(
        "none",
        "",
        tuple(effects),
        tuple(provisional),
        looks,
        before,
        after,
        (first, left_out(after, parts) if picks else first),
        kept,
        same,
        gross(after),
        has_weight(model, data.payloads),
    )
    verdict, reason = _verdict(out)
    if out.found and not _predicts(out):
        out = replace(out, effects=(), provisional=out.found)
    return replace(out, verdict=verdict, reason=reason)


def _as_every_arm(model: ArmModel, data: AbsoluteReadings, layout: Layout) -> Iterator[Unknown]:
    """What is free beside the geometry: how stiff the model's own springs are, and how heavy its links.

    Neither is what is missing, and springs are told by masses that nobody has weighed.
    """
    for one, value in known(model, layout.unknowns).items():
        if one.kind == "spring":
            yield replace(one, start=value, sd=value)
    heavy = {mass.body - 1 for mass in model.masses}
    yield from (replace(one, sd=DRAWN) for one in masses(model.robot, data) if one.index[0] in heavy)


def _looks(
    work: _Work, before: Fit, some: Sequence[Candidate], say: Messages
) -> tuple[tuple[Look, ...], list[FoundEffect], Fit]:
    """Look, take up what leads, and look again until nothing asks for more; the estimate with all of it."""
    here, looks, picks = before, list[Look](), list[FoundEffect]()
    for _ in range(MOST + 1):
        taken = {pick.candidate.code for pick in picks}
        look = _look(here, [c for c in some if c.code not in taken])
        looks.append(look)
        say(f"look {len(looks)}: " + ", ".join(f"{x.code} {100.0 * x.probability:.0f} %" for x in look.lines[:3]))
        if len(picks) == MOST or not _asks_for_more(look, further=bool(picks)):
            break
        top = look.effects[0]
        picks.append(_pick(look, top, some))
        here = work.fit(_all_of(picks))
        if not picks[-1].probability >= NAME and len(picks) > 1:
            break
    return tuple(looks), picks, here


def _asks_for_more(look: Look, *, further: bool) -> bool:
    """Whether something is missing, and an effect of the catalogue may be it."""
    none, unknown, effects = look.of(NONE), look.of(UNKNOWN), look.effects
    if none.probability >= ALARM or not effects:
        return False
    top = effects[0]
    if top.acts < SMALL * look.scatter or unknown.probability > HALF:
        return False
    # Nothing is quite right: what is left of one effect looks like others, and like several of them.
    return not further or (
        top.gain >= GAIN and sum(one.probability for one in effects) >= FURTHER * (1.0 - unknown.probability)
    )


def _look(here: Fit, some: Sequence[Candidate]) -> Look:
    """All hypotheses beside an estimate."""
    w = weigh(ground(here, some), some)
    prior = _log_priors([c for c in some if c.code in w.of])
    codes = [NONE, UNKNOWN, *w.of]
    worth = np.array([w.gain(code) + prior[code] for code in codes])
    chance = np.exp(worth - logsumexp(worth))
    lines = [
        Line(code, w.gain(code), float(p), w.of[code].acts if code in w.of else 0.0)
        for code, p in zip(codes, chance, strict=True)
    ]
    lines.sort(key=lambda one: -one.probability)
    hidden = tuple(c.code for c in some if c.code not in w.of)
    return Look(tuple(lines), max(w.unknown, key=lambda axis: w.unknown[axis]), w.scatter, hidden, w)


def _log_priors(some: Sequence[Candidate]) -> Mapping[str, float]:
    """Half that nothing is missing; the families share the rest, and their members each family's."""
    out = {NONE: math.log(PRIOR_NONE), UNKNOWN: math.log(PRIOR_UNKNOWN)}
    every = list(kinds(some))
    for _, members in every:
        share = (1.0 - PRIOR_NONE - PRIOR_UNKNOWN) / len(every) / len(members)
        out |= {c.code: math.log(share) for c in members}
    return out


def _pick(look: Look, top: Line, some: Sequence[Candidate]) -> FoundEffect:
    """The effect that leads a look, with its unknowns as large as they go best with the readings."""
    candidate = next(c for c in some if c.code == top.code)
    found = look.weighing.of[top.code]
    sized = tuple(replace(one, sd=found.size * scale, law="") for one, scale in found.shape)
    return FoundEffect(candidate, sized, top.acts, top.gain, top.probability, _rivals(look, top))


def _rivals(look: Look, line: Line) -> tuple[str, ...]:
    """Codes that explain the readings about as well as one of a look does."""
    close = (1.0 - NAME) * line.probability
    return tuple(one.code for one in look.effects if one is not line and one.probability > close)[:KEPT]


def _all_of(picks: Sequence[FoundEffect]) -> list[Unknown]:
    """The unknowns of several effects, each once, as large as the last one has them."""
    out: dict[str, Unknown] = {}
    for pick in picks:
        out |= {one.name: one for one in pick.unknowns}
    return list(out.values())


def _once_more(work: _Work, pick: FoundEffect, others: Sequence[FoundEffect], some: Sequence[Candidate]) -> FoundEffect:
    """An effect asked for again with all others in the model: taken up early, it may have stood for one of them."""
    here = work.fit(_all_of(others))
    taken = {other.candidate.code for other in others}
    look = _look(here, [c for c in some if c.code not in taken])
    code = pick.candidate.code
    if code not in look.weighing.of:
        return replace(pick, probability=0.0)
    line = look.of(code)
    return replace(pick, probability=line.probability, gain=line.gain, acts=line.acts, rivals=_rivals(look, line))


def _predicts(m: Missing) -> bool:
    """Whether readings left out are predicted better with what was found."""
    before, after = m.left_out_rms()
    return after < before


def _verdict(m: Missing) -> tuple[Verdict, str]:
    first, last = m.looks[0], m.looks[-1]
    if not m.found:
        if first.of(NONE).probability >= ALARM:
            return "none", "the readings do not ask for more than geometry, frames and targets"
        if first.of(UNKNOWN).probability > HALF:
            return (
                "unknown",
                f"what is left varies smoothly with the {first.axis}, and no effect of the catalogue does so",
            )
        return "none", "what is left is too small beside the scatter to be named"
    if not _predicts(m):
        return "ambiguous", "what was found does not predict readings left out"
    if m.provisional:
        return "ambiguous", "several effects explain the readings about equally well"
    if last.of(UNKNOWN).probability > HALF:
        return "ambiguous", "something unknown is left beside what was found"
    return "named", "explains the readings and predicts those left out"
