"""report.html of a study: the scores first, then by effect and by tag, and every set."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from benchmarks.diagnosis.study import words
from benchmarks.diagnosis.study.figures import reliability_figure, scores_figure
from benchmarks.diagnosis.study.scores import KINDS, Row, reliability, scores
from rehearsal.scoring import DETECTABLE
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Answer, Block, Bullets, KeyFigure, Section, Table, Text, write_page
from stiffarm.session.outputs import OutputFolder

QUESTION = "how often is the diagnosis right?"


def write_report(rows: Sequence[Row], name: str, folder: OutputFolder) -> None:
    """Draw all figures and write report.html."""
    pictures = Pictures(folder)
    count = Counter(r.kind for r in rows)
    lede = (
        f"{len(rows)} sets, diagnosed blind: "
        + ", ".join(
            f"{count[k]} with {text}" if k != "outside" else f"{count[k]} with an effect {text}"
            for k, text in KINDS.items()
            if count[k]
        )
        + "."
    )
    by = {s.name: s.share for s in scores(rows)}
    key = [
        KeyFigure(words.rate(by[name]), label, f"95\u00a0%: {words.interval(by[name])}" if by[name].of else "")
        for name, label in (
            ("right family leads, detectable", "of detectable single effects: the right family leads"),
            ("named and right, detectable", "of these were named correctly"),
            ("a wrong name, all sets", "of all sets got a wrong name"),
        )
    ]
    picture = pictures.add(scores_figure(scores(rows)), "scores", "Scores, with the number of sets in brackets.")
    sections = [_short(rows), _groups(rows, pictures)]
    sections += [replace(_every(rows), folded=True), replace(_how(), folded=True)]
    sure = "Every set was diagnosed blind; the intervals of the rates are exact."
    write_page(folder, name, lede, key, sections, QUESTION, "", Answer(sure, words.todo(rows), picture))


def _short(rows: Sequence[Row]) -> Section:
    return Section(
        "In short",
        (
            Bullets(tuple(words.summary(rows))),
            Table("Scores", words.HEADS, _unbroken(words.lines(rows)), (0, 4, 5)),
        ),
    )


def _unbroken(lines: Sequence[tuple[str, ...]]) -> tuple[tuple[str, ...], ...]:
    """The same with percent signs that stay beside their numbers."""
    return tuple(tuple(cell.replace(" %", "\u00a0%") for cell in line) for line in lines)


def _groups(rows: Sequence[Row], pictures: Pictures) -> Section:
    blocks: list[Block] = []
    bins = reliability(rows)
    if bins:
        caption = "On the line, stated probabilities are right. Numbers: sets."
        blocks += [
            pictures.add(reliability_figure(bins), "reliability", caption),
            Table("Stated probability", words.RELIABILITY_HEADS, tuple(words.reliabilities(rows)), (0, 4)),
        ]
    if families := words.families(rows):
        blocks.append(Table("Single effects", words.FAMILY_HEADS, tuple(families)))
    if tags := words.tags(rows):
        blocks.append(Table("By tag of the key", words.TAG_HEADS, tuple(tags), (0, 1), folded=True))
    return Section("By probability, effect and condition", tuple(blocks) or (Text("No set has an effect."),))


def _every(rows: Sequence[Row]) -> Section:
    lines = tuple(
        (
            r.name,
            ", ".join(r.hidden) or "nothing",
            f"{r.excess:.0f}" if r.excess == r.excess else "-",
            r.verdict,
            ", ".join(r.named) or "-",
            "yes" if r.is_right else "no",
        )
        for r in rows
    )
    heads = ("set", "hidden", "chi-square", "verdict", "named", "right family leads")
    return Section("Every set", (Table("Set by set", heads, lines, (0, 1, 3, 4, 5), folded=True),))


def _how() -> Section:
    return Section(
        "How it was counted",
        (
            Bullets(
                (
                    "Detectable: springs alone cannot explain the hidden effect; according to the key, it raises "
                    f"chi-square by {DETECTABLE:.0f} or more. Of several effects, each must do so by itself.",
                    "Leads: the first name of a named verdict, or the most probable effect of an ambiguous one. The "
                    'verdicts "unknown" and "none" count as such, whatever was tried on the way.',
                    "Wrong name: an effect named as certain that is not in the family of any hidden effect.",
                    "Outside the catalogue: an effect that the present catalogue does not contain.",
                    "Refused readings count as wrong.",
                )
            ),
        ),
    )
