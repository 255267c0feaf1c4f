"""report.html of a rehearsal: what was hidden, what was found, whether it could be seen, how the gap shrank."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from matplotlib.figure import Figure

from doe.diagnosis.where import least_rms_mm, noise_floor_mm
from stiffarm.commands.diagnose.figures import Bar, gap_figure, ranking_figure
from stiffarm.commands.diagnose.words import gap_title
from stiffarm.commands.rehearse import words
from stiffarm.commands.rehearse.figures import numbers_figure, tally_figure
from stiffarm.commands.rehearse.step import Rehearsed
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Answer, Block, Bullets, KeyFigure, Note, Section, Table, Text, write_page
from stiffarm.session.outputs import OutputFolder

QUESTION = "does the diagnosis find what is hidden?"
# Candidates drawn beside the hidden one.
DRAWN = 8


def write_report(draws: Sequence[Rehearsed], folder: OutputFolder) -> None:
    """Draw all figures and write report.html."""
    pictures = Pictures(folder)
    first = draws[0]
    sections = one(first, pictures) if len(draws) == 1 else many(draws, pictures)
    given = first.diagnosed.given
    lede = (
        f"Rehearsal with made-up readings: {first.set_ups.source}; {given.model.link_kind} links, "
        f"{given.model.load_path} load path. Noise: {first.set_ups.words}."
    )
    sections.append(replace(how(first), folded=True))
    title = given.description.title.split(" (")[0]
    if len(draws) == 1:
        lede, made = words.headline(first), lede
        more = "One draw is an anecdote: `--draws 40` counts."
        answer = Answer(words.visible(first), more)
    else:
        answer, made = Answer("Each draw hides another effect, at these set-ups and with this noise."), ""
    write_page(folder, title, lede, _key_figures(draws), sections, QUESTION, made.rstrip("."), answer)


def _key_figures(draws: Sequence[Rehearsed]) -> list[KeyFigure]:
    if len(draws) > 1:
        every, seen = words.right(draws)
        return [
            KeyFigure(f"{every.count} of {every.of}", "draws with the right family first"),
            KeyFigure(f"{seen.count} of {seen.of}", "of those that the readings could show"),
        ]
    r = draws[0]
    out = [KeyFigure(r.world.code, "hidden"), KeyFigure(words.outcome(r), "outcome")]
    if r.gap_mm is not None:
        out.append(KeyFigure(f"{r.gap_mm[0]:.3f} → {r.gap_mm[1]:.3f} mm", "RMS at poses held out, before and after"))
    return out


def one(r: Rehearsed, pictures: Pictures) -> list[Section]:
    """The sections of a single draw."""
    return [
        compared(r, pictures),
        shrunk(r, pictures),
    ]


def compared(r: Rehearsed, pictures: Pictures) -> Section:
    """The hidden and the found."""
    blocks: list[Block] = []
    if r.numbers:
        heads = ("parameter", "hidden", "found", "95 % interval", "hidden value inside")
        blocks.append(Table(f"Parameters of {r.world.code}", heads, tuple(words.numbers(r)), (0, 4)))
    elif r.world.truth.effects:
        law = r.world.truth.effects[0]["law"]
        blocks.append(Text(f"The hidden law ({law}) has no number of the same meaning in a model file."))
    figure = numbers_figure(r.numbers)
    if figure is not None:
        blocks.append(pictures.add(figure, "numbers", "On the line, what was found is what was hidden."))
    if r.diagnosed.tells:
        ranking = r.diagnosed.found.rankings[0].hypotheses
        shown = [h for k, h in enumerate(ranking) if k < DRAWN or h.code in (r.world.code, "none", "unknown")]
        kinds = {"none": "none", "unknown": "unknown"} | dict.fromkeys(r.verdict.found, "chosen")
        names = {r.world.code: f"{r.world.code} (hidden)"}
        bars = [
            Bar(
                h.code if h.code in ("none", "unknown") else names.get(h.code, h.code),
                h.probability,
                kinds.get(h.code, "effect"),
            )
            for h in shown
        ]
        caption = "The candidates as the diagnosis ranked them at its first look."
        blocks.append(pictures.add(ranking_figure(bars, "The hidden one among the candidates"), "candidates", caption))
    return Section("The hidden and the found", tuple(blocks))


def shrunk(r: Rehearsed, pictures: Pictures) -> Section:
    """The gap before and after."""
    caption = "RMS errors with springs alone, and with what was found. Held-out readings have no noise in them."
    before, after = r.gap_mm or (math.nan, math.nan)
    title = gap_title(before, after if r.verdict.found else math.nan)
    return Section(title, (Text(words.gap(r)), pictures.add(answer_figure([r]), "gap", caption)))


def answer_figure(draws: Sequence[Rehearsed]) -> Figure:
    """Draw the gap before and after of one draw, the tally of several."""
    if len(draws) > 1:
        every, seen = Counter(map(words.outcome, draws)), Counter(words.outcome(r) for r in draws if r.is_visible)
        return tally_figure(dict(every), dict(seen))
    r = draws[0]
    d, nan = r.diagnosed.found, float("nan")
    rows = {"readings fitted": (d.before.fit_rms_mm, d.after.fit_rms_mm)}
    if r.gap_mm is not None:
        rows["poses held out,\nwithout noise"] = r.gap_mm
    if not r.verdict.found:
        rows = {name: (before, nan) for name, (before, _) in rows.items()}
    return gap_figure(rows, noise_floor_mm(d), least_rms_mm(d))


def many(draws: Sequence[Rehearsed], pictures: Pictures) -> list[Section]:
    """The sections of several draws: the tally, and each as it is."""
    rows = tuple(
        (
            str(k),
            r.world.code,
            words.said(r),
            words.outcome(r),
            "yes" if r.is_visible else "no",
            "-" if r.gap_mm is None else f"{r.gap_mm[0]:.3f} → {r.gap_mm[1]:.3f}",
        )
        for k, r in enumerate(draws, start=1)
    )
    heads = ("draw", "hidden", "the diagnosis", "outcome", "visible", "error at poses held out (mm)")
    return [
        Section(
            "In short",
            (
                *(Note(text) for text in words.summary(draws)),
                Table("Outcomes", ("outcome", "draws", "share", "of them visible"), tuple(words.tally(draws))),
                pictures.add(answer_figure(draws), "tally", "Outcomes of all draws, as they are."),
            ),
        ),
        Section("Every draw", (Table("Draw by draw", heads, rows, (1, 2, 3, 4)),)),
    ]


def how(r: Rehearsed) -> Section:
    """How the readings were made, and what a rehearsal cannot say."""
    return Section(
        "How it was done",
        (
            Bullets(
                (
                    "Readings come from mechanics written a second time, with laws of their own (kinks, power laws, "
                    "extra harmonics) where the catalogue has smooth ones.",
                    "True springs are the model's times a factor of a half to two, drawn from the class of arm where "
                    "the model has none; link moduli are off by up to 5 %, lengths by 1 mm, joint zeros by 0.03 deg, "
                    "loads by 0.5 %, each weight by 0.1 %.",
                    f"Noise: {r.set_ups.words}; set-ups differ by {100 * r.world.noise.setup:g} %; readings are "
                    f"rounded to {1e6 * r.world.noise.resolution_m:g} um.",
                    "The diagnosis saw readings.csv and the model as given, nothing else. truth.json has all that was "
                    "hidden.",
                    "A rehearsal says what these set-ups can tell of such an arm. It does not say that the real arm "
                    "has one of these effects.",
                )
            ),
        ),
    )
