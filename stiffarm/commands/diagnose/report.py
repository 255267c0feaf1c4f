"""report.html of a diagnosis: what disagrees, where, what explains it, how sure, what cannot be told, what next."""

from __future__ import annotations

import math
from dataclasses import replace

from doe.diagnosis.where import noise_floor_mm
from fem.arm import Arm
from robots.quantities import percent, significant
from stiffarm.commands.calibrate.words import bound_of, doubt_sentences, noise_parts
from stiffarm.commands.diagnose import words
from stiffarm.commands.diagnose.files import Written
from stiffarm.commands.diagnose.model import described, springs_of
from stiffarm.commands.diagnose.next_words import advice, proposal_blocks
from stiffarm.commands.diagnose.sections import explained, ladder_section, laws, shrunk, where
from stiffarm.commands.diagnose.space import campaign_picture, cost_blocks
from stiffarm.commands.diagnose.step import Diagnosed
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Answer, Block, KeyFigure, Picture, Section, Table, Text, data_words, write_page
from stiffarm.session.caution import uncalibrated
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.words.noise import floor_name, scatter_name
from stiffarm.session.words.springs import mega

QUESTION = "where do model and robot disagree, and why?"


def write_report(d: Diagnosed, written: Written, folder: OutputFolder) -> None:
    """Draw all figures and write report.html."""
    pictures = Pictures(folder)
    sections = [shrunk(d, pictures)]
    if d.tells:
        sections = [ladder_section(d, pictures), where(d, written.gaps, pictures), *sections, explained(d, pictures)]
    elif len(written.gaps.pose):
        sections.append(Section("The campaign in space", (campaign_picture(d, written.gaps, pictures),)))
    if d.in_model:
        sections.append(laws(d, pictures))
    sections.append(Section("What leaving it out would cost", tuple(cost_blocks(d, written.cost, pictures))))
    if d.tells:
        sections += [next_readings(d), replace(not_told(d), folded=True), replace(how(d), folded=True)]
    # The first screen shows the first picture: the ladder, or the arm where the model was most wrong.
    pictured = (block for section in sections[:2] for block in section.blocks if isinstance(block, Picture))
    first = next(pictured, None) if d.tells else None
    sections = [replace(s, blocks=tuple(b for b in s.blocks if b is not first)) for s in sections]
    title = d.given.description.title.split(" (")[0]
    p = d.found.before.setting.data
    made_of = (
        f"{data_words(d.used)}; {len(p)} readings at {len(p.poses)} poses, {d.given.model.link_kind} links, "
        f"{d.given.model.load_path} load path, springs of {', '.join(d.found.before.setting.free)} fitted"
    )
    answer = Answer(words.how_sure(d), advice(d).text, first, (*doubt_sentences(d.doubts), *_rigid(d)))
    write_page(folder, title, words.headline(d), _key_figures(d), sections, QUESTION, made_of, answer)


def _rigid(d: Diagnosed) -> tuple[str, ...]:
    """The warning of a new model with joints held rigid for want of a spring."""
    if not d.tells:
        return ()
    said = uncalibrated(Arm(described(d), d.given.robot, d.found.after.setting.arm))
    return (said,) if said else ()


def _key_figures(d: Diagnosed) -> list[KeyFigure]:
    found, h = d.found, d.held_out
    codes = ", ".join(f.code for f in found.effects)
    out = [
        KeyFigure(
            codes or ("nothing proven" if words.hints(d) else words.VERDICTS[found.verdict]),
            "what is missing" if codes else "verdict",
        )
    ]
    far = d.unseen_rms_mm
    label = f"RMS at {words.unseen_poses(d)}" if h is None else f"RMS on {h.data.source}"
    if d.in_model:
        out.append(KeyFigure(f"{significant(far[0])} → {significant(far[1])} mm", f"{label}, before and after"))
    else:
        out.append(KeyFigure(f"{significant(far[0])} mm", label))
    if d.tells:
        name = floor_name(found.after.setting.data)
        label = (
            "RMS that noise alone would give"
            if name == "noise alone"
            else f"{name}; without repeats its noise is not known"
        )
        out.append(KeyFigure(f"{significant(noise_floor_mm(found))} mm", label))
    if found.effects or found.learned:
        label = f"probability of {found.found[0].code} after its checks"
        out.append(KeyFigure(percent(found.stated), label))
    return out


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
    blocks: list[Block] = [Text(advice(d).text)]
    if d.proposal is not None:
        blocks += proposal_blocks(d, d.proposal)
    return Section("What to measure next", tuple(blocks))


def how(d: Diagnosed) -> Section:
    """How it was done, with the looks, the springs and the whole ranking."""
    found = d.found
    springs = tuple(
        (
            s.parameter.place,
            mega(s.value),
            mega(s.interval[0]),
            "no upper limit" if math.isinf(s.interval[1]) else mega(s.interval[1]),
            "rigid fits best" if bound_of(s) else s.status,
        )
        for s in springs_of(d)
    )
    ranked = tuple(
        (h.code, percent(h.probability), f"{h.log_evidence:.1f}", f"{h.bic:.1f}", f"{h.lopo_rms_mm:.4f}")
        for h in found.ranking.hypotheses
    )
    n = found.after.refit.noise
    name = scatter_name(found.after.setting.data)
    sizes = "; ".join(f"{what}: {size}" for what, size in noise_parts(n, found.after.setting.data))
    noise = f"{name[0].upper()}{name[1:]} by the best explanation. {sizes[0].upper()}{sizes[1:]}."
    blocks: list[Block] = [
        Text(
            "Each candidate's evidence is its probability of giving these readings, averaged over its plausible "
            "numbers and over plausible noise, with a term for set-ups that scatter as a whole. A name is given "
            "only if it also predicts poses left out better than nothing missing does. What was found goes into "
            "the model, and the remaining candidates are tested again. The new model is model.toml; every number "
            "there says where it came from."
        ),
        Text(noise),
        Table(
            "Springs of the new model (1e6 N m/rad)", ("joint", "value", "from", "to (95 %)", "status"), springs, (0, 4)
        ),
        Table(
            "All candidates of the look that the verdict rests on",
            ("candidate", "probability", "log evidence", "BIC", "RMS of poses left out, at its own noise (mm)"),
            ranked,
            folded=True,
        ),
    ]
    return Section("How it was done", tuple(blocks))
