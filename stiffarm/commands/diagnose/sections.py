"""The story of a diagnosis in sections: the ladder, where the arm was when it was wrong, what explains it, the laws."""

from __future__ import annotations

import math

import numpy as np

from doe.diagnosis.diagnose import State
from doe.diagnosis.hypotheses import NONE, UNKNOWN, Ranking
from doe.diagnosis.space import Gaps
from doe.diagnosis.where import labels_of, least_rms_mm, noise_floor_mm
from stiffarm.commands.diagnose import words
from stiffarm.commands.diagnose.arms import pose_errors_mm, stands
from stiffarm.commands.diagnose.arms_figure import arms_figure
from stiffarm.commands.diagnose.check_words import check_sentences, check_table
from stiffarm.commands.diagnose.effect_numbers import numbers_of
from stiffarm.commands.diagnose.figures import (
    Bar,
    Fit,
    gap_figure,
    match_figure,
    ranking_figure,
    residuals_figure,
    twins_figure,
    where_figure,
)
from stiffarm.commands.diagnose.ladder import Ladder, ladder_of, ladder_sentence, ladder_table
from stiffarm.commands.diagnose.ladder_figure import ladder_figure
from stiffarm.commands.diagnose.laws import curves_of, law_figure, numbers_figure
from stiffarm.commands.diagnose.space import campaign_picture
from stiffarm.commands.diagnose.step import Diagnosed
from stiffarm.commands.diagnose.traces import traces_of
from stiffarm.commands.diagnose.traces_figure import traces_figure
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.dumbbells import dumbbells_figure
from stiffarm.pages.report import Block, Bullets, Fold, Section, Table, Text
from stiffarm.session.words.noise import floor_name

# Candidates drawn: the most probable ones, and nothing missing and something unknown wherever they stand.
DRAWN = 10
# Poses drawn unfolded, in one folded picture, and altogether.
WORST, IN_ONE, MOST_ARMS = 9, 36, 117


def ladder_section(d: Diagnosed, pictures: Pictures) -> Section:
    """Each look: what was taken up, how the error fell, how probable it was and is, and what is still in doubt."""
    of = ladder_of(d.found)
    blocks: list[Block] = []
    if of.rungs:
        blocks.append(
            pictures.add(
                ladder_figure(of, (floor_name(d.found.after.setting.data), noise_floor_mm(d.found))),
                "ladder",
                "Left: the error at poses left out one at a time, with all effects known. Right: how probable "
                "each name was among all candidates when it was accepted, and after its checks.",
            )
        )
    blocks += [Text(ladder_sentence(of)), ladder_table(of), *_said(d, of)]
    return Section("How it was found, look by look", tuple(blocks))


def _said(d: Diagnosed, of: Ladder) -> list[Block]:
    """What the ladder's rows rest on."""
    failed = check_sentences(d.found)
    blocks: list[Block] = [Bullets(failed)] if failed else []
    if d.nested is not None and of.rungs:
        blocks.append(Text(words.chosen_anew(d.nested)))
    if d.found.provisional:
        codes = ", ".join(f.code for f in d.found.provisional)
        blocks.append(Text(f"In the new model for the time being, marked as provisional: {codes}."))
    if d.found.checks:
        blocks.append(check_table(d.found))
    if d.remarks:
        blocks.append(Bullets(d.remarks))
    return blocks


def arms(d: Diagnosed, found: Gaps, pictures: Pictures) -> list[Block]:
    """The arm in its measured poses with what was read, simulated and left over; nothing of rotations alone."""
    some = stands(found)
    if not some:
        return []
    robot, poses = d.given.robot, len(some)
    heading = "Where the arm was when the model was wrong: the worst poses first"
    caption = (
        "Each arm under the load where the model with springs alone was most wrong; arrows are larger than the arm by "
        "the factors given."
    )
    blocks: list[Block] = [pictures.add(arms_figure(some[:WORST], robot, heading, some), "arms", caption)]
    rest: list[Block] = []
    for first in range(WORST, min(poses, MOST_ARMS), IN_ONE):
        part = some[first : min(first + IN_ONE, MOST_ARMS)]
        title = f"Poses {first + 1} to {first + len(part)} of {poses} by what is left over"
        rest.append(pictures.add(arms_figure(part, robot, title, some), f"arms_{first + 1}", caption))
    if poses > MOST_ARMS:
        rest.append(Text(f"The {poses - MOST_ARMS} poses with the least left over are not drawn."))
    if rest:
        blocks.append(Fold(f"The other {poses - WORST} poses", tuple(rest)))
    return blocks


def where(d: Diagnosed, found: Gaps, pictures: Pictures, before: str = "") -> Section:
    """Where the disagreement lies: the arm in its poses, errors by pose before and after, shares by group.

    ``before``: what file names begin with.
    """
    groups = {kind: [(g.label, g.share, g.mean_square, g.share_sd) for g in some] for kind, some in d.where.items()}
    blocks = [*arms(d, found, pictures), Bullets(words.where_sentences(d))]
    blocks += [Text(text) for text in words.odd_sentences(d)]
    if (by_pose := pose_errors_mm(d.found)) and d.in_model:
        figure = dumbbells_figure(
            "Each pose before and after, the worst first",
            by_pose,
            "RMS error in the fit (mm)",
            below="pose",
            lines={floor_name(d.found.after.setting.data): noise_floor_mm(d.found)},
            ends=("springs alone", "with what was found"),
        )
        blocks.append(pictures.add(figure, "poses", "A pose that hardly moves is not explained by what was found."))
    if len(found.pose):
        blocks.append(campaign_picture(d, found, pictures, before))
    drawn = pictures.add(
        where_figure(groups),
        "where",
        "Where the disagreement lies by pose, load, direction read and phase."
        + ("" if d.found.verdict != "none" else " Nothing here is beyond what noise makes of it by chance."),
    )
    text = Text(
        "Residuals of the model with its springs fitted, over the noise of a reading. A mean square above 1 is "
        "more than noise explains; a group's share is its part of all that is beyond the noise, ± one standard "
        "deviation by the uncertainty of the springs and effects found."
    )
    blocks.append(Fold("Shares by pose, load, direction and phase", (text, drawn)))
    return Section("Poses with the largest error", tuple(blocks))


def explained(d: Diagnosed, pictures: Pictures) -> Section:
    """The traces of what is credible, the ranking of every look that found something, and the twins."""
    found = d.found
    blocks: list[Block] = [
        Text(
            f"{len(found.start.known)} physical effects were tried, each fitted together with the springs, against "
            "“nothing is missing” and against something unknown that varies smoothly over poses and loads. A "
            "candidate is probable if it explains the readings with plausible parameters, not because it has many."
        )
    ]
    if (traces := traces_of(d)) is not None:
        caption = (
            "Readings sorted by direction, pose and load. Dots: residuals with springs alone. Line: what the "
            "effect explains of them, with springs refitted. A twin whose trace is the same to within the noise "
            "cannot be separated from it by these readings."
        )
        blocks.append(pictures.add(traces_figure(traces), "traces", caption))
    blocks.append(Fold("All candidates, look by look", tuple(_rankings(d, pictures))))
    more: list[Block] = []
    if d.twins:
        more += [Text("Twins, which these readings cannot separate:"), Bullets(words.twin_sentences(d))]
    if any(d.twins.values()):
        more.append(
            pictures.add(
                twins_figure(d.twins),
                "twins",
                "Rows: an effect as large as fitted, or of usual size where it was not found. A dot: the effect in the "
                "column can imitate it to within the noise, whatever is measured in these poses.",
            )
        )
    if more:
        blocks.append(Fold("What could imitate it", tuple(more)))
    return Section("What explains it", tuple(blocks))


def _rankings(d: Diagnosed, pictures: Pictures) -> list[Block]:
    """The candidates of each look, as probable as they were then."""
    blocks: list[Block] = []
    taken = [f.code for f in d.in_model_in_order]
    for k, r in enumerate(d.found.rankings[: len(taken) + 1]):
        heading = "Candidates of the first look" if k == 0 else f"And with {', '.join(taken[:k])} in the model"
        caption = "Probability of each candidate in this look, before any check."
        name = "ranking" if k == 0 else f"ranking_{k + 1}"
        blocks.append(pictures.add(ranking_figure(_bars(r, taken), heading), name, caption))
    return blocks


def _bars(r: Ranking, taken: list[str]) -> list[Bar]:
    shown = [h for k, h in enumerate(r.hypotheses) if k < DRAWN or h.code in (NONE, UNKNOWN)]
    kinds = {NONE: NONE, UNKNOWN: UNKNOWN} | dict.fromkeys(taken, "chosen")
    return [Bar(h.code, h.probability, kinds.get(h.code, "effect")) for h in shown]


def laws(d: Diagnosed, pictures: Pictures) -> Section:
    """The effects of the new model: their laws drawn, their numbers with intervals."""
    after = d.found.after
    given = len(after.setting.accepted) - len(d.in_model)
    curves = curves_of(after, given)
    numbers = numbers_of(after)
    provisional = {f.code for f in d.found.provisional}
    blocks: list[Block] = []
    for number, (f, curve) in enumerate(zip(d.in_model_in_order, curves, strict=True)):
        head = " (provisional)" if f.code in provisional else ""
        blocks.append(Text(f"{f.placed.effect.words[0].upper()}{f.placed.effect.words[1:]} ({f.code}){head}."))
        rows = tuple(
            (n.name, words.value_text(n), words.interval_text(n), words.plausible_text(n), n.meaning)
            for n in numbers
            if n.code == f.code
        )
        blocks.append(Text(f"{f.code}: {words.numbers_sentence(d, f)}."))
        if rows:
            heads = ("parameter", "value", "95 % interval", "plausible", "what it is")
            blocks.append(Table(f"Parameters of {f.code}", heads, rows, (0, 4), folded=True))
        if curve is not None:
            remembers = f.placed.effect.needs_history
            loop = "The way up differs from the way down by what the joint remembers. " if remembers else ""
            blocks.append(
                pictures.add(
                    law_figure(curve, f"{f.code}: {f.placed.effect.words}"),
                    f"law_{number + 1}",
                    f"{loop}Band: 95 % of the laws that the readings leave possible, springs included. Dots: what "
                    "single readings imply for this joint if the rest is as the model says.",
                )
            )
        mine = [n for n in numbers if n.code == f.code and math.isfinite(n.value) and n.sd is not None]
        if curve is None and mine:
            blocks.append(
                pictures.add(
                    numbers_figure(mine),
                    f"numbers_{number + 1}",
                    "Parameters of the effect with 95 % intervals. Doubt the effect if one leaves its plausible range.",
                )
            )
    return Section("What was found, and how well it is known", tuple(blocks))


def shrunk(d: Diagnosed, pictures: Pictures) -> Section:
    """Read against simulated, residuals, gap: before and after."""
    found = d.found
    fits = [_fit(d, found.before, "before")]
    if d.in_model:
        fits.append(_fit(d, found.after, "after"))
    rows = {"in the fit": _pair(d, found.before.fit_rms_mm, found.after.fit_rms_mm)}
    rows["poses left out one at a time"] = _pair(d, found.before.left_out_rms_mm, found.after.left_out_rms_mm)
    h, n = d.held_out, d.nested
    if n is not None:
        rows["poses not seen, effects chosen anew"] = _pair(d, n.rms_before_mm, n.rms_after_mm)
    if h is not None:
        rows["readings held out"] = _pair(d, h.rms_before_mm, h.rms_after_mm)
    blocks: list[Block] = [Text(words.gap_sentence(d))]
    # Without a second model there is nothing to compare: the sentence says it all.
    if d.in_model:
        figure = gap_figure(rows, noise_floor_mm(found), least_rms_mm(found), floor_name(found.after.setting.data))
        caption = "RMS errors. What counts is the error at poses that the fit has not seen."
        blocks.append(pictures.add(figure, "gap", caption))
    drawn = (
        pictures.add(match_figure(fits), "match", "On the line, simulation and measurement are the same."),
        pictures.add(
            residuals_figure(fits),
            "residuals",
            "Each point is a reading. What is missing shows as a pattern; noise has none.",
        ),
    )
    blocks.append(Fold("Reading by reading", drawn))
    if h is not None and h.remarks:
        blocks.append(Bullets(h.remarks))
    return Section(words.gap_title(*_pair(d, *d.unseen_rms_mm)), tuple(blocks))


def _pair(d: Diagnosed, before: float, after: float) -> tuple[float, float]:
    return before, after if d.in_model else float("nan")


def _fit(d: Diagnosed, state: State, name: str) -> Fit:
    """Translations in mm; rotations only where nothing else was read."""
    p = state.setting.data
    linear = p.component < 3
    mine = np.flatnonzero((linear if linear.any() else ~linear) & d.found.counts)
    labels = labels_of(state.setting)
    noise = noise_floor_mm(d.found) if linear.any() else state.refit.noise.white[1] * 1e3
    of = {kind: [labels[kind][i] for i in mine] for kind in ("pose", "load", "phase")}
    order = sorted(dict.fromkeys(of["load"]), key=lambda text: float(text.split()[0]))
    by_load = sorted(range(len(mine)), key=lambda i: order.index(of["load"][i]))
    mine, of = mine[by_load], {kind: [some[i] for i in by_load] for kind, some in of.items()}
    unit = "mm" if linear.any() else "mrad"
    return Fit(name, 1e3 * p.value[mine], 1e3 * state.setting.prediction[mine], noise, **of, unit=unit)
