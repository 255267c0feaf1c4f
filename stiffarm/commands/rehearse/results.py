"""What a rehearsal says, each outcome as it is: what was hidden, what was found, whether it could be seen."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from doe.diagnosis.where import least_rms_mm, noise_floor_mm
from rehearsal.possible import NOTHING
from rehearsal.scoring import DETECTABLE, OUTCOMES, Share
from robots.quantities import UNKNOWN, Quantity, length, percent, ranged, significant
from stiffarm.commands.rehearse.step import Number, Rehearsed, truth
from stiffarm.pages.report import Bullets, KeyFigure, Section
from stiffarm.result import Drawing, Result, Table
from stiffarm.session.json_text import share as share_json

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stiffarm.session.outputs import OutputFolder

# Candidates drawn beside the hidden one.
DRAWN: Final = 8
# What an outcome is called where nothing was hidden.
OF_NOTHING: Final = {"named": "rightly nothing found", "wrong": "a false alarm", "unnamed": "something suspected"}
MM: Final = length("")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Rehearsal(Result):
    """Finished rehearsals, unveiled; ``found`` has each draw."""

    @property
    def draws(self) -> tuple[Rehearsed, ...]:
        """All draws."""
        return tuple(self.found)

    @property
    def hidden(self) -> tuple[str, ...]:
        """Codes that were hidden, one a draw."""
        return tuple(r.world.code for r in self.draws)

    @property
    def outcomes(self) -> tuple[str, ...]:
        """What came of each: named, family, candidate, unnamed, not testable, nothing or wrong."""
        return tuple(r.outcome for r in self.draws)

    @property
    def gaps_mm(self) -> tuple[tuple[float, float] | None, ...]:
        """RMS errors at poses held out, before and after; None where no poses could be held out."""
        return tuple(r.gap_mm for r in self.draws)


def result(done: Sequence[tuple[Rehearsed, bytes]], *, secret: bool, seed: int) -> Rehearsal:
    """All draws with the tables of their readings; ``secret``: what was hidden was drawn at random."""
    draws = [r for r, _ in done]
    first, count = draws[0], len(draws)
    given, set_ups = first.diagnosed.given, first.set_ups
    every, seen = _right(draws)
    several = count > 1

    def more(folder: OutputFolder) -> Mapping[str, Any]:
        for k, (r, table) in enumerate(done, start=1):
            place = f"draw_{k:0{len(str(count))}d}/" if several else ""
            folder.path(f"{place}readings.csv").write_bytes(table)
            folder.write_json(f"{place}truth.json", truth(r.world))
        return {}

    return Rehearsal(
        name="rehearse",
        title=given.description.title.split(" (")[0],
        question="does the diagnosis find what is hidden?",
        answer=f"{count} draws; the right family came first in {_share(every)}. Of those that the readings could show, "
        f"in {_share(seen)}."
        if several
        else headline(first),
        how_sure="Each draw hides another effect, at these set-ups and with this noise." if several else visible(first),
        what_next="" if several else f"{gap(first)} One draw is an anecdote: `--draws 40` counts.",
        facts={
            "kind": "rehearsal",
            "robot": given.robot.name,
            "load_path": given.model.load_path,
            "links": given.model.link_kind,
            "set_ups": set_ups.source,
            "noise": set_ups.words,
            "secret": secret,
            "seed": seed,
            "detectable_chi2": DETECTABLE,
            "outcomes": dict(Counter(r.outcome for r in draws)),
            "right_family": share_json(every),
            "right_family_of_visible": share_json(seen),
        },
        tables=(_draws(draws), *((_tally(draws),) if several else ()), *_parameters(draws)),
        drawings=tuple(_tally_drawing(draws) if several else _drawings(first)),
        key=tuple(_key(draws)),
        sections=(_how(first),),
        arm=given,
        caution="",
        found=draws,
        more=more,
        made_of=f"rehearsal with simulated readings: {set_ups.source}; {given.model.link_kind} links, "
        f"{given.model.load_path} load path. Noise: {set_ups.words}",
    )


def outcome(r: Rehearsed) -> str:
    """The outcome of one draw."""
    if r.world.code == NOTHING:
        return OF_NOTHING[r.outcome]
    if r.outcome == "named" and r.world.code not in r.verdict.found:
        return "rightly called unknown"
    if r.outcome == "wrong" and r.world.code in r.verdict.not_testable:
        return "wrong, for an effect that it called not testable"
    too_many = r.outcome in ("named", "family") and r.verdict.sure > 1
    return OUTCOMES[r.outcome] + (", plus one too many" if too_many else "")


def headline(r: Rehearsed) -> str:
    """What was hidden and what came of it, in one sentence."""
    hidden = "nothing" if r.world.code == NOTHING else r.world.code
    return f"Hidden was {hidden}; the diagnosis {_verdict(r)}: {outcome(r)}."


def _verdict(r: Rehearsed) -> str:
    """What the diagnosis found."""
    v = r.verdict
    sure, unsure = ", ".join(v.found[: v.sure]), ", ".join(v.found[v.sure :])
    if v.kind == "named":
        return f"named {sure}" + (f" (and, not sure, {unsure})" if unsure else "")
    if v.kind == "none":
        return "found nothing missing"
    if v.kind == "uninformative":
        return "stated that the readings say nothing about the arm"
    if v.kind == "unknown":
        return "found something that it does not know" + (f" ({', '.join(v.found)} in part)" if v.found else "")
    left = [code for code in r.diagnosed.credible if code not in (NOTHING, "unknown")]
    return f"left several candidates, {', '.join(dict.fromkeys([*v.found, *left]))}"


def visible(r: Rehearsed) -> str:
    """Whether the readings could show it at all."""
    if r.world.code == NOTHING:
        return "There was nothing to find."
    if r.is_visible:
        return (
            f"These readings can show it: springs leave a chi-square of {significant(r.excess)} "
            f"({significant(DETECTABLE, 2)} or more counts as visible)."
        )
    return (
        "These readings can hardly show it: even without other errors, springs leave only a chi-square of "
        f"{significant(r.excess)} ({significant(DETECTABLE, 2)} or more would count as visible)."
    )


def gap(r: Rehearsed) -> str:
    """The gap before and after, on poses held out."""
    if r.gap_mm is None:
        return "No poses were held out: within the measured angles the arm can take no others."
    before, after = (MM.text(1e-3 * v, unit=True) for v in r.gap_mm)
    text = f"At held-out poses, against the true values without noise, the error is {before} RMS with springs alone"
    return f"{text} and {after} with the effects found." if r.verdict.found else f"{text}; nothing was added."


def _right(draws: Sequence[Rehearsed]) -> tuple[Share, Share]:
    """How many were right by the blind study's measure: of all draws, and of those that the readings could show."""
    seen = [r for r in draws if r.is_visible]
    return Share(sum(r.is_right for r in draws), len(draws)), Share(sum(r.is_right for r in seen), len(seen))


def _share(s: Share) -> str:
    """``17 of 20 (85 %; 95 % interval 62 to 97 %)``."""
    if s.of == 0:
        return "none of none"
    low, high = s.interval95
    return f"{s.count} of {s.of} ({percent(s.count / s.of)}; 95 % interval {ranged(100 * low, 100 * high, '%')})"


def _tally(draws: Sequence[Rehearsed]) -> Table:
    every, seen = (Counter(map(outcome, some)) for some in (draws, [r for r in draws if r.is_visible]))
    names = [name for name, _ in every.most_common()]
    counts = np.array([every[name] for name in names], dtype=np.float64)
    return Table(
        "tally",
        "Outcomes",
        {"outcome": names},
        {
            Quantity("draws"): counts,
            Quantity("share", "%", 100.0, digits=2): counts / len(draws),
            Quantity("visible", label="of them visible"): np.array([float(seen[name]) for name in names]),
        },
    )


def _draws(draws: Sequence[Rehearsed]) -> Table:
    gaps = np.array([r.gap_mm or (np.nan, np.nan) for r in draws]) * 1e-3
    verdicts = [r.verdict for r in draws]
    return Table(
        "draws",
        "Draw by draw",
        {
            "draw": [str(k + 1) for k in range(len(draws))],
            "hidden": [r.world.code for r in draws],
            "diagnosis": [_verdict(r) for r in draws],
            "in_words": [outcome(r) for r in draws],
            "visible": [r.is_visible for r in draws],
            "right_family_first": [r.is_right for r in draws],
        },
        {length("before", "error at poses held out, before"): gaps[:, 0], length("after"): gaps[:, 1]},
        in_files={Quantity("excess_chi2", stored=4): np.array([r.excess for r in draws])},
        extra={
            "law": [None if r.world.code == NOTHING else r.world.truth.effects[0]["law"] for r in draws],
            "verdict": [v.kind for v in verdicts],
            "found": [list(v.found) for v in verdicts],
            "sure": [list(v.found[: v.sure]) for v in verdicts],
            "set95": [list(r.diagnosed.credible) for r in draws],
            "outcome": [r.outcome for r in draws],
            "not_testable": [r.world.code in v.not_testable for r, v in zip(draws, verdicts, strict=True)],
        },
        folded=len(draws) == 1,
    )


def _parameters(draws: Sequence[Rehearsed]) -> Iterator[Table]:
    """True numbers beside those found, where the hidden laws have numbers of a model file."""
    some = [(str(k), n) for k, r in enumerate(draws, start=1) for n in r.numbers]
    if not some:
        return
    found = Quantity("found")
    ends = np.array([n.interval95 or (np.nan, np.nan) for _, n in some])
    yield Table(
        "parameters",
        "Parameters, hidden and found",
        {
            "name": [n.name for _, n in some],
            "unit": [n.unit for _, n in some],
            "inside_interval": [UNKNOWN if n.is_inside is None else "yes" if n.is_inside else "no" for _, n in some],
            "draw": [k for k, _ in some],
        },
        {
            Quantity("true", label="hidden"): np.array([n.true for _, n in some]),
            found: np.array([np.nan if n.found is None else n.found for _, n in some]),
        },
        {found: (ends[:, 0], ends[:, 1])},
    )


def _drawings(r: Rehearsed) -> Iterator[Drawing]:
    """The gap, the numbers, and the hidden one among the candidates."""
    yield Drawing(
        "gap",
        "RMS errors with springs alone, and with what was found. Held-out readings have no noise in them.",
        "errors before and after",
        partial(_gap_figure, r),
    )
    if any(n.found is not None and n.true != 0.0 for n in r.numbers):
        caption = "On the line, what was found is what was hidden."
        yield Drawing("numbers", caption, "numbers found over those hidden", partial(_numbers_figure, r.numbers))
    if r.diagnosed.tells:
        caption = "The candidates as the diagnosis ranked them at its first look."
        yield Drawing("candidates", caption, "the hidden one among the candidates", partial(_candidates_figure, r))


def _gap_figure(r: Rehearsed) -> Figure:
    from stiffarm.commands.diagnose.figures import gap_figure

    d = r.diagnosed.found
    rows = {"readings fitted": (d.before.fit_rms_mm, d.after.fit_rms_mm)}
    if r.gap_mm is not None:
        rows["poses held out,\nwithout noise"] = r.gap_mm
    if not r.verdict.found:
        rows = {name: (before, np.nan) for name, (before, _) in rows.items()}
    return gap_figure(rows, noise_floor_mm(d), least_rms_mm(d))


def _numbers_figure(numbers: Sequence[Number]) -> Figure:
    from stiffarm.commands.rehearse.figures import numbers_figure

    return numbers_figure(numbers)


def _candidates_figure(r: Rehearsed) -> Figure:
    from stiffarm.commands.diagnose.figures import Bar, ranking_figure

    ranking = r.diagnosed.found.rankings[0].hypotheses
    open_ones = ("none", "unknown")
    kinds = {name: name for name in open_ones} | dict.fromkeys(r.verdict.found, "chosen")
    bars = [
        Bar(
            f"{h.code} (hidden)" if h.code == r.world.code and h.code not in open_ones else h.code,
            h.probability,
            kinds.get(h.code, "effect"),
        )
        for k, h in enumerate(ranking)
        if k < DRAWN or h.code in (r.world.code, *open_ones)
    ]
    return ranking_figure(bars, "The hidden one among the candidates")


def _tally_drawing(draws: Sequence[Rehearsed]) -> Iterator[Drawing]:
    def draw() -> Figure:
        from stiffarm.commands.rehearse.figures import tally_figure

        every, seen = Counter(map(outcome, draws)), Counter(outcome(r) for r in draws if r.is_visible)
        return tally_figure(dict(every), dict(seen))

    yield Drawing("tally", "Outcomes of all draws, as they are.", "how many draws came out how", draw)


def _key(draws: Sequence[Rehearsed]) -> Iterator[KeyFigure]:
    if len(draws) > 1:
        every, seen = _right(draws)
        yield KeyFigure(f"{every.count} of {every.of}", "draws with the right family first")
        yield KeyFigure(f"{seen.count} of {seen.of}", "of those that the readings could show")
        return
    r = draws[0]
    yield KeyFigure(r.world.code, "hidden")
    yield KeyFigure(outcome(r), "outcome")
    if r.gap_mm is not None:
        before, after = (1e-3 * v for v in r.gap_mm)
        yield KeyFigure(f"{MM.text(before)} → {MM.text(after, unit=True)}", "RMS at poses held out, before and after")


def _how(r: Rehearsed) -> Section:
    """How the readings were made, and what a rehearsal cannot say."""
    bullets = (
        "Readings come from mechanics written a second time, with laws of their own (kinks, power laws, extra "
        "harmonics) where the catalogue has smooth ones.",
        "True springs are the model's times a factor of a half to two, drawn from the class of arm where the model has "
        "none; link moduli are off by up to 5 %, lengths by 1 mm, joint zeros by 0.03 deg, loads by 0.5 %, each weight "
        "by 0.1 %.",
        f"Noise: {r.set_ups.words}; set-ups differ by {100 * r.world.noise.setup:g} %; readings are rounded to "
        f"{1e6 * r.world.noise.resolution_m:g} um.",
        "The diagnosis saw readings.csv and the model as given, nothing else. truth.json has all that was hidden.",
        "A rehearsal says what these set-ups can tell of such an arm. It does not say that the real arm has one of "
        "these effects.",
    )
    return Section("How it was done", (Bullets(bullets),), folded=True)
