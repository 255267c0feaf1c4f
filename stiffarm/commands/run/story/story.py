"""The report's story, in order: data, first model, sensitivity, calibration, comparison, surrogate, maps."""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffarm.commands.run.findings import Findings
from stiffarm.commands.run.story import calibration, results
from stiffarm.commands.run.story.budget import budget_section
from stiffarm.commands.run.story.links import links_section
from stiffarm.pages.blocks import Pictures, percent
from stiffarm.pages.report import KeyFigure, data_words, write_page
from stiffarm.session.outputs import OutputFolder


def write_report(findings: Findings, drawn: dict[str, Any], folder: OutputFolder) -> None:
    """Draw all figures and write report.html."""
    pictures = Pictures(folder)
    sections = [
        calibration.data_section(findings, pictures),
        calibration.first_model_section(findings, pictures),
        calibration.sensitivity_section(findings, pictures),
        calibration.staged_section(findings, pictures),
        calibration.comparison_section(findings, pictures),
        links_section(findings),
        budget_section(findings, pictures),
        results.effects_section(findings, pictures),
        results.surrogate_section(findings, pictures),
        results.map_section(findings, drawn, pictures),
        results.assumptions_section(findings),
    ]
    lede = (
        f"{len(findings.data.pose_groups())} measured poses, {len(findings.variants)} calibrated variants, a "
        "surrogate and a map. Recommended is the variant that best predicts poses left out of its fit: "
        f"{findings.best.name} springs."
    )
    made_of = f"{data_words(findings.data)}, seed {findings.seed}"
    write_page(folder, findings.title, lede, _key_figures(findings), sections, made_of=made_of)


def _key_figures(f: Findings) -> list[KeyFigure]:
    error = f.surrogate.errors
    return [
        KeyFigure(
            f"{np.median(f.rigid.factor):.0f} times",
            "measured over simulated deflection with rigid joints (median)",
        ),
        KeyFigure(
            f"{f.best.found.rms_mm:.3f} mm",
            f"RMS of the recommended model ({f.best.name} springs) on {len(f.best.found.overall)} readings",
        ),
        KeyFigure(f"{f.best.left_out_rms_mm:.3f} mm", "RMS when it predicts poses it has not seen"),
        KeyFigure(
            percent(error.max_relative),
            f"worst held-out error of the surrogate ({percent(error.rms_relative)} RMS)",
        ),
    ]
