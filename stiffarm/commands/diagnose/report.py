"""report.html of a diagnosis: what disagrees, where, what explains it, how sure, what cannot be told, what next."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from doe.diagnosis.diagnose import State
from doe.diagnosis.hypotheses import NONE, UNKNOWN, Ranking
from doe.diagnosis.where import labels_of, least_rms_mm, noise_floor_mm
from stiffarm.commands.calibrate.words import bound_of, noise_parts
from stiffarm.commands.diagnose import words
from stiffarm.commands.diagnose.check_words import check_sentences, check_table, last_doubt
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
from stiffarm.commands.diagnose.files import Written
from stiffarm.commands.diagnose.laws import curves_of, law_figure, numbers_figure
from stiffarm.commands.diagnose.model import springs_of
from stiffarm.commands.diagnose.space import space_blocks
from stiffarm.commands.diagnose.step import Diagnosed
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import (
    Answer,
    Block,
    Bullets,
    Fold,
    KeyFigure,
    Note,
    Picture,
    Section,
    Table,
    Text,
    data_words,
    write_page,
)
from stiffarm.session.noise_words import floor_name, scatter_name
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.spring_words import mega

# Candidates drawn: the most probable ones, and nothing missing and something unknown wherever they stand.
DRAWN = 10
VERDICTS = {
    "named": "named", "ambiguous": "not settled", "unknown": "unknown effect", "learned": "learned, no name",
    "none": "nothing missing", "uninformative": "readings tell nothing",
}  # fmt: skip


QUESTION = "where do model and robot disagree, and why?"


def write_report(d: Diagnosed, written: Written, folder: OutputFolder) -> None:
    """Draw all figures and write report.html."""
    pictures = Pictures(folder)
    gap = shrunk(d, pictures)
    first = next((block for block in gap.blocks if isinstance(block, Picture) and d.in_model), None)
    said = (Note(words.headline(d)), Text(words.how_sure(d)), Text(words.next_sentence(d)))
    sections = [
        Section("What speaks for it and against it", tuple(b for b in in_short(d).blocks if b not in said)),
        Section(gap.title, tuple(block for block in gap.blocks if block != first)),
    ]
    if d.tells:
        sections += [where(d, pictures), explained(d, pictures)]
    if d.in_model:
        sections.append(laws(d, pictures))
    sections.append(Section("Where in space", tuple(space_blocks(d, written.gaps, written.cost, pictures))))
    if d.tells:
        told = next_readings(d)
        after = tuple(block for block in told.blocks if block not in said)
        sections += [replace(told, blocks=after), replace(not_told(d), folded=True), replace(how(d), folded=True)]
    title = d.given.description.title.split(" (")[0]
    p = d.found.before.setting.data
    made_of = (
        f"{data_words(d.used)}; {len(p)} readings at {len(p.poses)} poses, {d.given.model.link_kind} links, "
        f"{d.given.model.load_path} load path, springs of {', '.join(d.found.before.setting.free)} fitted"
    )
    answer = Answer(words.how_sure(d), words.next_sentence(d), first)
    write_page(folder, title, words.headline(d), _key_figures(d), sections, QUESTION, made_of, answer)


def _key_figures(d: Diagnosed) -> list[KeyFigure]:
    found, h = d.found, d.held_out
    codes = ", ".join(f.code for f in found.effects)
    out = [
        KeyFigure(
            codes or ("nothing proven" if words.hints(d) else VERDICTS[found.verdict]),
            "verdict" if not codes else "what is missing",
        )
    ]
    far = d.unseen_rms_mm
    label = f"RMS at {words.unseen_poses(d)}" if h is None else f"RMS on {h.data.source}"
    if d.in_model:
        out.append(KeyFigure(f"{far[0]:.3f} → {far[1]:.3f} mm", f"{label}, before and after"))
    else:
        out.append(KeyFigure(f"{far[0]:.3f} mm", label))
    if d.tells:
        name = floor_name(found.after.setting.data)
        label = "RMS that noise alone would give" if name == "noise alone" else f"{name}, no repeats to tell the noise"
        out.append(KeyFigure(f"{noise_floor_mm(found):.3f} mm", label))
    if found.effects:
        label = f"probability of {found.effects[0].code} after its checks"
        out.append(KeyFigure(words.percent(found.stated), label))
    return out


def in_short(d: Diagnosed) -> Section:
    """The verdict, how sure, what speaks against it, what it did to the gap, what to do."""
    blocks: list[Block] = [Note(words.headline(d)), Text(words.how_sure(d))]
    if d.found.checks:
        blocks.append(Bullets((*check_sentences(d.found), *last_doubt(d.found))))
    blocks.append(Text(words.gap_sentence(d)))
    blocks += [Text(text) for text in words.odd_sentences(d)]
    for f in d.found.effects:
        blocks.append(Text(f"{f.code}: {words.numbers_sentence(d, f)}."))
    if d.found.provisional:
        codes = ", ".join(f.code for f in d.found.provisional)
        blocks.append(Text(f"In the new model for the time being, marked as provisional: {codes}."))
    blocks.append(Text(words.next_sentence(d)))
    if d.remarks:
        blocks.append(Bullets(d.remarks))
    if d.found.checks:
        blocks.append(check_table(d.found))
    return Section("In short", tuple(blocks))


def where(d: Diagnosed, pictures: Pictures) -> Section:
    """Where the disagreement lies, before anything was added."""
    groups = {kind: [(g.label, g.share, g.mean_square, g.share_sd) for g in some] for kind, some in d.where.items()}
    blocks: list[Block] = [
        Text(
            "Residuals of the model with its springs fitted, over the noise of a reading. A square above 1 is more "
            "than noise makes of it; a group's share is its part of all that is beyond the noise, ± one standard "
            "deviation by the uncertainty of the springs and effects found."
        ),
        Bullets(words.where_sentences(d)),
        pictures.add(
            where_figure(groups), "where",
            "Where the disagreement lies by pose, load, direction read and phase."
            + ("" if d.found.verdict != "none" else " Nothing here is beyond what noise makes of it by chance."),
        ),
    ]  # fmt: skip
    return Section("Where they disagree", tuple(blocks))


def explained(d: Diagnosed, pictures: Pictures) -> Section:
    """The ranking of every look that found something, and the twins."""
    found = d.found
    blocks: list[Block] = [
        Text(
            f"{len(found.start.known)} physical effects were tried, each fitted together with the springs, against "
            "“nothing is missing” and against something unknown that varies smoothly over poses and loads. Probable is "
            "what explains the readings with numbers that are plausible, not what has most numbers to turn."
        )
    ]
    taken = [f.code for f in d.in_model]
    for k, r in enumerate(found.rankings[: max(len(taken), 1)]):
        heading = "What explains the disagreement" if k == 0 else f"And with {', '.join(taken[:k])} in the model"
        blocks.append(
            pictures.add(
                ranking_figure(_bars(r, taken), heading), "ranking" if k == 0 else f"ranking_{k + 1}",
                "Probability of each candidate, and how far off it predicts poses that it has not seen.",
            )
        )  # fmt: skip
    if found.verdict == "named" and len(found.rankings) > len(taken):
        last = found.rankings[len(taken)].of(NONE)
        text = (
            f"Looked at once more with that in the model: {words.percent(last.probability)} for nothing else missing."
        )
        blocks.append(Text(text))
    more: list[Block] = []
    if d.twins:
        more += [Text("Twins, which these readings could not tell apart:"), Bullets(words.twin_sentences(d))]
    if any(d.twins.values()):
        more.append(
            pictures.add(
                twins_figure(d.twins), "twins",
                "Rows: an effect as large as fitted, or of usual size where it was not found. A dot: the effect in the "
                "column can imitate it to within the noise, whatever is measured in these poses.",
            )
        )  # fmt: skip
    if more:
        blocks.append(Fold("What could imitate it", tuple(more)))
    return Section("What explains it", tuple(blocks))


def _bars(r: Ranking, taken: list[str]) -> list[Bar]:
    shown = [h for k, h in enumerate(r.hypotheses) if k < DRAWN or h.code in (NONE, UNKNOWN)]
    kinds = {NONE: NONE, UNKNOWN: UNKNOWN} | dict.fromkeys(taken, "chosen")
    return [Bar(h.code, h.probability, h.lopo_rms_mm, kinds.get(h.code, "effect")) for h in shown]


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
            for n in numbers if n.code == f.code
        )  # fmt: skip
        if rows:
            heads = ("number", "value", "95 % interval", "thought plausible", "what it is")
            blocks.append(Table(f"Numbers of {f.code}", heads, rows, (0, 4), folded=True))
        if curve is not None:
            remembers = f.placed.effect.needs_history
            loop = "The way up differs from the way down by what the joint remembers. " if remembers else ""
            blocks.append(
                pictures.add(
                    law_figure(curve, f"{f.code}: {f.placed.effect.words}"), f"law_{number + 1}",
                    f"{loop}Band: 95 % of the laws that the readings leave possible, springs included. Dots: what "
                    "single readings imply for this joint if the rest is as the model says.",
                )
            )  # fmt: skip
        mine = [n for n in numbers if n.code == f.code and math.isfinite(n.value) and n.sd is not None]
        if curve is None and mine:
            blocks.append(
                pictures.add(
                    numbers_figure(mine), f"numbers_{number + 1}",
                    "Numbers of the effect with 95 % intervals. If one leaves the plausible range, look again.",
                )
            )  # fmt: skip
    return Section("What was found, and how well it is known", tuple(blocks))


def shrunk(d: Diagnosed, pictures: Pictures) -> Section:
    """Read against simulated, residuals, gap: before and after."""
    found = d.found
    fits = [_fit(d, found.before, "before")]
    if d.in_model:
        fits.append(_fit(d, found.after, "after"))
    rows = {"in the fit": _pair(d, found.before.fit_rms_mm, found.after.fit_rms_mm)}
    left = _pair(d, found.before.left_out_rms_mm, found.after.left_out_rms_mm)
    h, n = d.held_out, d.nested
    if n is None:
        rows["poses left out\none at a time"] = left
    else:
        rows["poses not seen,\neffects chosen anew"] = _pair(d, n.rms_before_mm, n.rms_after_mm)
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
            residuals_figure(fits), "residuals",
            "Each point is a reading. What is missing shows as a pattern; noise has none.",
        ),
    )  # fmt: skip
    blocks.append(Fold("Reading by reading", drawn))
    if n is not None:
        after = "-" if math.isnan(left[1]) else f"{left[1]:.4f}"
        blocks += [
            Text(words.nested_sentence(n)),
            Table(
                "Poses left out one at a time, effects chosen on all of them (mm RMS): flatters what was found",
                ("before", "after"), ((f"{left[0]:.4f}", after),), folded=True,
            ),
        ]  # fmt: skip
    if h is not None and h.remarks:
        blocks.append(Bullets(h.remarks))
    return Section("How the gap shrank" if d.in_model else "How large the gap is", tuple(blocks))


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


def not_told(d: Diagnosed) -> Section:
    """What these readings cannot judge, by reason."""
    reasons: dict[str, list[str]] = {}
    for code, reason in d.not_testable.items():
        kind = reason.split(":")[0] if "chi-square" in reason else reason
        kind = "an effect of usual size would hardly show" if "chi-square by" in reason else kind
        reasons.setdefault(kind, []).append(code)
    if not reasons:
        return Section("What these readings cannot tell", (Text("Every effect of the catalogue would have shown."),))
    rows = tuple((reason, ", ".join(codes)) for reason, codes in sorted(reasons.items(), key=lambda x: -len(x[1])))
    count = sum(map(len, reasons.values()))
    text = (
        f"{count} of {len(d.found.start.known)} effects could not be judged: that they were not found does not say "
        "that they are not there. Other poses, loads, directions or a second axis of the gauge would show some of them."
    )
    return Section(
        "What these readings cannot tell", (Text(text), Table("By reason", ("reason", "effects"), rows, (0, 1)))
    )


def next_readings(d: Diagnosed) -> Section:
    """What to measure next."""
    blocks: list[Block] = [Text(words.next_sentence(d))]
    if d.proposal is not None:
        blocks += words.proposal_blocks(d, d.proposal)
    return Section("What to measure next", tuple(blocks))


def how(d: Diagnosed) -> Section:
    """How it was done, with the looks, the springs and the whole ranking."""
    found = d.found
    looks = tuple(
        (str(k + 1), decision.kind, decision.hypothesis.code if decision.hypothesis else "-", decision.reason)
        for k, decision in enumerate(found.decisions)
    )
    springs = tuple(
        (s.parameter.place, mega(s.value), mega(s.interval[0]),
         "no upper limit" if math.isinf(s.interval[1]) else mega(s.interval[1]),
         "rigid fits best" if bound_of(s) else s.status)
        for s in springs_of(d)
    )  # fmt: skip
    ranked = tuple(
        (h.code, words.percent(h.probability), f"{h.log_evidence:.1f}", f"{h.bic:.1f}", f"{h.lopo_rms_mm:.4f}")
        for h in found.ranking.hypotheses
    )
    n = found.after.refit.noise
    name = scatter_name(found.after.setting.data)
    sizes = "; ".join(f"{what}: {size}" for what, size in noise_parts(n, found.after.setting.data))
    noise = f"{name[0].upper()}{name[1:]} by the best explanation. {sizes[0].upper()}{sizes[1:]}."
    blocks: list[Block] = [
        Text(
            "Each candidate's evidence is its probability of giving these readings, averaged over its plausible "
            "numbers and over plausible noise, with a term for set-ups that scatter as a whole. A name is given only "
            "if it also predicts poses left out better than nothing missing does. What was found goes into the model, "
            "and the rest is looked at again. The new model is model.toml; every number there says where it came from."
        ),
        Text(noise),
        Table("Looks at the readings", ("look", "decision", "candidate", "why"), looks, (1, 2, 3)),
        Table("Springs of the new model (1e6 N m/rad)", ("joint", "value", "from", "to (95 %)", "status"), springs,
              (0, 4)),
        Table("All candidates of the look that the verdict rests on",
              ("candidate", "probability", "log evidence", "BIC", "RMS of poses left out (mm)"), ranked, folded=True),
    ]  # fmt: skip
    return Section("How it was done", tuple(blocks))
