"""The pages of a run: the answer, what is missing, readings, calibration, compliance, map; method folds away."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from robots import InputError
from stiffarm.commands.rehearse.step import Rehearsed
from stiffarm.commands.run.findings import Findings
from stiffarm.commands.run.missing import headlines
from stiffarm.commands.run.proof import proof_section
from stiffarm.commands.run.story import calibration, results
from stiffarm.commands.run.story.budget import budget_section
from stiffarm.commands.run.story.cover import write_card, write_index
from stiffarm.commands.run.story.links import links_section
from stiffarm.commands.run.story.missing import missing_section, next_words
from stiffarm.pages import workspace_answer
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Answer, KeyFigure, Picture, data_words, write_page
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.workspace import WorkspaceStiffness


def write_report(
    findings: Findings,
    drawn: Mapping[str, Any],
    views: Sequence[Picture],
    told: Rehearsed | InputError | None,
    stiffness: WorkspaceStiffness,
    folder: OutputFolder,
) -> tuple[str, Answer]:
    """Draw all figures, write report.html, index.html that leads to all, and the card; returns what they say.

    ``drawn``: JSON of the map, ``views``: its pictures.
    """
    f, pictures = findings, Pictures(folder)
    answer, key = _answer(f, stiffness, pictures), _key_figures(f, stiffness)
    sections = [
        missing_section(f.looks, pictures),
        calibration.data_section(f, pictures),
        calibration.comparison_section(f, pictures),
        budget_section(f, pictures),
        results.map_section(f, drawn, views),
    ]
    if told is not None:
        sections.append(proof_section(told, pictures))
    if f.rigid is not None:
        sections.append(calibration.first_model_section(f, f.rigid))
    if f.published is not None:
        sections.append(calibration.staged_section(f, pictures))
    sections.append(calibration.sensitivity_section(f, pictures))
    if f.link_models is not None:
        sections.append(links_section(f, f.link_models))
    sections += [
        results.effects_section(f, pictures),
        results.surrogate_section(f, pictures),
        results.assumptions_section(f),
    ]
    made_of = f"{data_words(f.data)}, seed {f.seed}"
    lede = workspace_answer.lede(stiffness)
    write_page(folder, f.title, lede, key, sections, made_of=made_of, answer=answer)
    write_index(f, lede, key, answer, made_of, folder)
    write_card(f, lede, key, answer, made_of, folder)
    return lede, answer


def _key_figures(f: Findings, stiffness: WorkspaceStiffness) -> list[KeyFigure]:
    told = [KeyFigure(look.value, look.label) for look in headlines(f.looks)]
    return [*workspace_answer.key_figures(stiffness), *told]


def _answer(f: Findings, stiffness: WorkspaceStiffness, pictures: Pictures) -> Answer:
    # Of single components, as the error is.
    read = 1e3 * float(np.sqrt(np.nanmean(f.used.displacement[:, :3] ** 2)))
    share = f" ({100.0 * f.best.left_out_rms_mm / read:.2g}\u00a0% of what was read)" if read else ""
    sure = (
        f"The recommended model ({f.best.name}) is {f.best.left_out_rms_mm:.3f} mm RMS off{share} at poses that it has "
        f"not seen. {workspace_answer.interval_remark(stiffness)}"
    )
    rigid = f.rigid_warning
    picture = pictures.add(
        workspace_answer.answer_figure(stiffness),
        "stiffness_at_the_tool",
        "Dot: stiffness; bar: its 95 % interval; next to the name, the part that deflects most. The map itself is in "
        "map.html.",
    )
    return Answer(sure, next_words(f.looks[-1]), picture, (rigid,) if rigid else ())
