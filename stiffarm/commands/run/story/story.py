"""The report's story, in order: the answer, what is missing, then data, calibration, sensitivity, surrogate, maps."""

from __future__ import annotations

from typing import Any

from robots import InputError
from stiffarm.commands.diagnose.report import VERDICTS
from stiffarm.commands.diagnose.words import gap_sentence, headline
from stiffarm.commands.rehearse.step import Rehearsed
from stiffarm.commands.run.findings import Findings
from stiffarm.commands.run.proof import proof_section
from stiffarm.commands.run.story import calibration, results
from stiffarm.commands.run.story.budget import budget_section
from stiffarm.commands.run.story.links import links_section
from stiffarm.commands.run.story.missing import missing_section, next_words
from stiffarm.pages.blocks import Pictures, percent
from stiffarm.pages.report import Bullets, KeyFigure, Section, data_words, write_page
from stiffarm.session.outputs import OutputFolder


def write_report(
    findings: Findings, drawn: dict[str, Any], told: Rehearsed | InputError | None, folder: OutputFolder
) -> None:
    """Draw all figures and write report.html: the answer, what is missing, then how it was found."""
    f, pictures = findings, Pictures(folder)
    sections = [in_short(f, drawn)]
    sections += [missing_section(look, pictures, last=look is f.looks[-1]) for look in f.looks]
    sections.append(calibration.data_section(f, pictures))
    if f.rigid is not None:
        sections.append(calibration.first_model_section(f, f.rigid, pictures))
    if f.published is not None:
        sections.append(calibration.staged_section(f, pictures))
    sections += [calibration.comparison_section(f, pictures), calibration.sensitivity_section(f, pictures)]
    if f.link_models is not None:
        sections.append(links_section(f, f.link_models))
    sections += [
        budget_section(f, pictures),
        results.effects_section(f, pictures),
        results.surrogate_section(f, pictures),
        results.map_section(f, drawn, pictures),
        results.assumptions_section(f),
    ]
    if told is not None:
        sections.append(proof_section(told, pictures))
    lede = (
        f"{len(f.data.pose_groups())} measured poses: what the model is missing, how it was calibrated, a surrogate "
        f"and a map. Recommended is the model that best predicts poses it has not seen: {f.best.name}."
    )
    made_of = f"{data_words(f.data)}, seed {f.seed}"
    write_page(folder, f.title, lede, _key_figures(f, drawn), sections, made_of=made_of)


def _key_figures(f: Findings, drawn: dict[str, Any]) -> list[KeyFigure]:
    k, d = drawn["stiffness_N_per_mm"], f.looks[-1].found
    codes = [e.code for e in d.found.effects]
    named = codes[0] + (f" and {len(codes) - 1} more" if len(codes) > 1 else "") if codes else ""
    return [
        KeyFigure(f"{k['median']:.0f} N/mm", f"stiffness, median of the workspace ({k['min']:.0f} to {k['max']:.0f})"),
        KeyFigure(f"{f.best.left_out_rms_mm:.3f} mm", "RMS error at poses that the recommended model has not seen"),
        KeyFigure(named or VERDICTS[d.found.verdict], "what is missing, by all readings"),
        KeyFigure(
            "nothing open" if d.proposal is None else f"{len(d.proposal.labels)} set-ups", "what to measure next"
        ),
    ]


def in_short(f: Findings, drawn: dict[str, Any]) -> Section:
    """How stiff, how sure, what is missing, what to measure next: a sentence each."""
    k, error = drawn["stiffness_N_per_mm"], f.surrogate.errors
    rows = [
        f"How stiff: {k['min']:.0f} to {k['max']:.0f} N/mm along a vertical load, median {k['median']:.0f} N/mm over "
        f"{drawn['points']:,} poses of the workspace.",
        f"How sure: the recommended model ({f.best.name}) is {f.best.rms_mm:.3f} mm (RMS) off its {f.best.count} "
        f"readings, and {f.best.left_out_rms_mm:.3f} mm off poses that it has not seen; the surrogate adds at most "
        f"{percent(error.max_relative)} of the compliance.",
    ]
    rows += [f"{look.title}: {headline(look.found)} {gap_sentence(look.found)}" for look in f.looks]
    rows.append(f"What to measure next: {next_words(f.looks[-1])}")
    still = calibration.idle_joints(f)
    if still:
        rows.append(f"Not known: {', '.join(still)}; no reading moves with their springs.")
    return Section("In short", (Bullets(tuple(rows)),))
