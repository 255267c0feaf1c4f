"""report.html of a study: the scores first, then by effect and by tag, and every set."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from rehearsal.scoring import DETECTABLE, Share
from robots.files.csv_text import rows_text
from robots.quantities import rounded
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.figure_parts import above, drawing, named_rows, note
from stiffarm.pages.report import Answer, Block, Bullets, KeyFigure, Section, Table, Text, write_page
from stiffarm.pages.style import FAINT, INK, OKABE_ITO
from stiffarm.session.json_text import share
from stiffarm.session.outputs import OutputFolder

from .scores import KINDS, SHRINK, Reliability, Row, Score, by_family, by_tag, reliability, scores, shrinkage

# Looks by whether an aim is met: told apart by their markers, not by colour alone.
_LOOKS: Final[dict[bool | None, dict[str, Any]]] = {
    True: {"color": OKABE_ITO["blue"], "marker": "o"},
    False: {"color": OKABE_ITO["vermillion"], "marker": "X"},
    None: {"color": FAINT, "marker": "D"},
}
_MARK: Final[dict[str, Any]] = {"linestyle": "none", "markersize": 8.0}
_SAID: Final = {True: "aim met", False: "aim missed", None: "no aim"}


def scores_figure(found: Sequence[Score]) -> Figure:
    """Draw each share with its exact 95 % interval and its aim."""
    shown = [s for s in found if s.share.of]
    with drawing("Scores with 95 % intervals", (10.0, 1.6 + 0.34 * len(shown))) as (figure, (ax,)):
        for row, s in enumerate(shown):
            low, high = (100.0 * v for v in s.share.interval95)
            look = _LOOKS[s.is_met]
            ax.hlines(row, low, high, color=look["color"], linewidth=2.5)
            ax.plot(100.0 * s.share.count / s.share.of, row, **look, **_MARK)
            if s.aim is not None:
                ax.plot(100.0 * s.aim, row, "|", color=INK, markersize=16, markeredgewidth=2.0)
        named_rows(ax, [f"{s.name} ({s.share.of})" for s in shown])
        ax.set_xlim(-1.0, 101.0)
        ax.set_xlabel("share of sets (%)")
        keys = [Line2D([], [], label=text, **_LOOKS[met], **_MARK) for met, text in _SAID.items()]
        keys.append(
            Line2D([], [], color=INK, linestyle="none", marker="|", markersize=14, markeredgewidth=2.0, label="aim")
        )
        figure.legend(handles=keys, loc="outside lower left", ncols=4)
    return figure


def reliability_figure(bins: Sequence[Reliability]) -> Figure:
    """Draw the share right over the probability stated: on the line, what was stated is what holds."""
    with drawing("Stated probability and share right", (7.0, 5.6)) as (figure, (ax,)):
        ax.plot([0, 100], [0, 100], color=INK, linewidth=1.0, label="stated = right")
        for many, label in ((True, f"{TELLING} sets and more"), (False, f"fewer than {TELLING} sets")):
            mine = [b for b in bins if (b.right.of >= TELLING) == many]
            if not mine:
                continue
            x = 100.0 * np.array([b.stated for b in mine])
            y = 100.0 * np.array([b.right.count / b.right.of for b in mine])
            ends = 100.0 * np.array([b.right.interval95 for b in mine]).T
            look: dict[str, Any] = {"color": OKABE_ITO["blue"]} if many else {"color": INK, "markerfacecolor": "white"}
            ax.errorbar(x, y, yerr=[y - ends[0], ends[1] - y], fmt="o" if many else "s", label=label, capsize=3, **look)
            for at, b in zip(zip(x, y, strict=True), mine, strict=True):
                note(ax, str(b.right.of), at, (8, -8), ha="left", size=8.5)
        ax.set(xlim=(0, 101), ylim=(0, 103), xlabel="probability stated for what leads (%)", ylabel="right family (%)")
        above(ax, ax.get_legend_handles_labels()[0], 3)
    return figure


HEADS = ("of", "share", "sets", "95 % interval", "target", "met")
FAMILY_HEADS = ("effect", "sets", "detectable", "right family", "exact", "named and right")
TAG_HEADS = ("tag", "value", "right family leads, detectable singles", "a wrong name, all sets")
# Shares of fewer sets than this are counts.
FEW = 10
# Rates of fewer sets than this tell little.
TELLING = 50
RELIABILITY_HEADS = ("stated", "mean stated", "right", "95 % interval", "holds")


def rate(s: Share) -> str:
    """``85.0 % of 20``; of a few ``2 of 3``, for percents say too much of them; a dash where there is none."""
    if not s.of:
        return "-"
    return f"{100 * s.count / s.of:.1f} % of {s.of}" if s.of >= FEW else f"{s.count} of {s.of}"


def _counted(s: Share) -> str:
    if not s.count or s.of < FEW:
        return str(s.count or "none")
    return f"{s.count} ({100 * s.count / s.of:.1f} %)"


def _sets(count: int) -> str:
    return f"{count} set" if count == 1 else f"{count} sets"


def interval(s: Share) -> str:
    """The exact interval, in percent."""
    low, high = s.interval95
    return f"{100 * low:.0f} to {100 * high:.0f} %" if s.of else "-"


def score_lines(rows: Sequence[Row]) -> list[tuple[str, ...]]:
    """The table of scores; scores of no set are left out."""
    found = [_line(s) for s in scores(rows) if s.share.of]
    for kind, (median, count) in shrinkage(rows).items():
        aim = SHRINK.get(kind)
        goal, met = ("", "") if aim is None else (f"at most {aim:.2f}", "yes" if median <= aim else "no")
        name = f"held-out error after / before, median; {KINDS[kind]}"
        found.append((name, f"{median:.2f}", str(count), "", goal, met))
    return found


def _line(s: Score) -> tuple[str, ...]:
    aim = "" if s.aim is None else f"{'at most' if s.at_most else 'at least'} {100 * s.aim:.0f} %"
    met = {None: "", True: "yes", False: "no"}[s.is_met]
    share = f"{100 * s.share.count / s.share.of:.1f} %" if s.share.of >= FEW else rate(s.share)
    return (s.name, share, str(s.share.of), interval(s.share), aim, met)


def family_lines(rows: Sequence[Row]) -> list[tuple[str, ...]]:
    """Single effects by family."""
    return [
        (name, str(count), str(right.of), *(str(s.count) if s.of else "-" for s in (right, exact, named)))
        for name, count, right, exact, named in by_family(rows)
    ]


def tag_lines(rows: Sequence[Row]) -> list[tuple[str, ...]]:
    """By each tag's value."""
    return [(tag, value, rate(right), rate(wrong)) for tag, value, right, wrong in by_tag(rows)]


def reliabilities(rows: Sequence[Row]) -> list[tuple[str, ...]]:
    """Stated probabilities beside shares right."""
    return [
        (
            f"{100 * b.low:.0f} to {100 * b.high:.0f} %",
            f"{100 * b.stated:.1f} %",
            rate(b.right),
            interval(b.right),
            "yes" if b.holds else "no",
        )
        for b in reliability(rows)
    ]


def summary(rows: Sequence[Row]) -> list[str]:
    """The answer in a few sentences."""
    by = {s.name: s.share for s in scores(rows)}
    out = []
    led, named = by["right family leads, detectable"], by["named and right, detectable"]
    if named.of:
        out.append(
            f"{_sets(named.of)} with one effect that the readings can show (chi-square {DETECTABLE:.0f} and more): the "
            f"right family leads in {_counted(led)}, and {_counted(named)} {'was' if named.count == 1 else 'were'} "
            "named correctly."
        )
    wrong, calm = by["a wrong name, all sets"], by["nothing hidden: a name"]
    out.append(f"A wrong name was given in {_counted(wrong)} of {_sets(wrong.of)}.")
    if calm.of:
        out.append(f"With nothing hidden, {_counted(calm)} of {_sets(calm.of)} got a name.")
    refused = by["refused, all sets"]
    if refused.count:
        out.append(f"{refused.count} of {refused.of} sets were refused, which counts as wrong; rows.csv says why.")
    failed = by["failed, all sets"]
    if failed.count:
        out.append(f"The program failed on {failed.count} sets: please report what rows.csv says about them.")
    return out


def todo(rows: Sequence[Row]) -> str:
    """What to do with such a result."""
    missed = [s.name for s in scores(rows) if s.is_met is False]
    if missed:
        return (
            f"Targets missed: {'; '.join(missed)}. rows.csv lists every set: start with those that have a wrong name."
        )
    if len(rows) < TELLING:
        return (
            f"{_sets(len(rows))} are too few to trust a rate: look at the intervals, and use {TELLING} sets or more. "
            "rows.csv lists every set."
        )
    return "All targets are met. rows.csv lists every set."


SCHEMA = "stiffarm-study/1"
COLUMNS = (
    "set",
    "world",
    "kind",
    "hidden",
    "excess_chi2",
    "detectable",
    "verdict",
    "named",
    "found",
    "probability",
    "set95",
    "right",
    "named_right",
    "wrong_names",
    "before_mm",
    "after_mm",
    "seconds",
    "reason",
)


def study(rows: Sequence[Row]) -> dict[str, Any]:
    """Scores, and every set."""
    return {
        "schema": SCHEMA,
        "detectable_chi2": DETECTABLE,
        "sets": len(rows),
        "kinds": dict(Counter(r.kind for r in rows)),
        "scores": [
            {"name": s.name, **share(s.share), "aim": s.aim, "at_most": s.at_most, "met": s.is_met}
            for s in scores(rows)
        ],
        "held_out_after_over_before": {
            kind: {"median": rounded(median), "sets": count} for kind, (median, count) in shrinkage(rows).items()
        },
        "by_effect": {
            name: {"sets": count, "right_family": share(right), "exact": share(exact), "named_right": share(named)}
            for name, count, right, exact, named in by_family(rows)
        },
        "by_tag": [
            {"tag": tag, "value": value, "right_family": share(right), "wrong_name": share(wrong)}
            for tag, value, right, wrong in by_tag(rows)
        ],
        "reliability": [
            {"from": b.low, "to": b.high, "stated": rounded(b.stated), "right": share(b.right), "holds": b.holds}
            for b in reliability(rows)
        ],
        "rows": [one(r) for r in rows],
    }


def one(r: Row) -> dict[str, Any]:
    """One set, unveiled."""
    return {
        "set": r.name,
        "world": r.world,
        "kind": r.kind,
        "hidden": list(r.hidden),
        "axes": list(r.axes),
        "places": list(r.places),
        "excess_chi2": rounded(r.excess, 5),
        "detectable": r.is_detectable,
        "tags": dict(r.tags),
        "verdict": r.verdict,
        "reason": r.reason,
        "named": list(r.named),
        "found": list(r.found),
        "probability": rounded(r.probability, 5),
        "set95": list(r.set95),
        "learned": [list(one) for one in r.learned],
        "right": r.is_right,
        "named_right": r.is_named_right,
        "wrong_names": list(r.wrong_names),
        "before_mm": rounded(r.before_mm),
        "after_mm": rounded(r.after_mm),
        "seconds": rounded(r.seconds, 3),
    }


def as_csv(rows: Sequence[Row]) -> str:
    """One line a set."""
    table: list[Sequence[object]] = [COLUMNS]
    for r in rows:
        found = one(r)
        found |= {key: " ".join(value) for key, value in found.items() if isinstance(value, list) and key != "learned"}
        table.append([found[key] for key in COLUMNS])
    return rows_text(table)


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
        KeyFigure(rate(by[name]), label, f"95\u00a0%: {interval(by[name])}" if by[name].of else "")
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
    write_page(folder, name, lede, key, sections, QUESTION, "", Answer(sure, todo(rows), picture))


def _short(rows: Sequence[Row]) -> Section:
    return Section(
        "In short",
        (
            Bullets(tuple(summary(rows))),
            Table("Scores", HEADS, _unbroken(score_lines(rows)), (0, 4, 5)),
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
            Table("Stated probability", RELIABILITY_HEADS, tuple(reliabilities(rows)), (0, 4)),
        ]
    if families := family_lines(rows):
        blocks.append(Table("Single effects", FAMILY_HEADS, tuple(families)))
    if tags := tag_lines(rows):
        blocks.append(Table("By tag of the key", TAG_HEADS, tuple(tags), (0, 1), folded=True))
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
