"""The report's story, in order: data, first model, sensitivity, calibration, comparison, surrogate, maps."""

from __future__ import annotations

import datetime as dt
from typing import Any

import numpy as np

from stiffarm import __version__
from stiffarm.commands.run.findings import Findings
from stiffarm.commands.run.story import calibration as story_calibration
from stiffarm.commands.run.story import links as story_links
from stiffarm.commands.run.story import results as story_results
from stiffarm.commands.run.story.words import short_title
from stiffarm.pages.blocks import Pictures, percent
from stiffarm.pages.report import KeyFigure, render
from stiffarm.session.outputs import OutputFolder


def write_report(findings: Findings, drawn: dict[str, Any], folder: OutputFolder) -> None:
    """Draw all figures and write report.html."""
    pictures = Pictures(folder)
    sections = [
        story_calibration.data_section(findings, pictures),
        story_calibration.first_model_section(findings, pictures),
        story_calibration.sensitivity_section(findings, pictures),
        story_calibration.staged_section(findings, pictures),
        story_calibration.comparison_section(findings, pictures),
        story_links.links_section(findings, pictures),
        story_results.budget_section(findings, pictures),
        story_results.effects_section(findings, pictures),
        story_results.surrogate_section(findings, pictures),
        story_results.map_section(findings, drawn, pictures),
        story_results.assumptions_section(findings),
    ]
    lede = (
        f"{len(findings.data.pose_groups())} measured poses, {len(findings.variants)} calibrated variants, a "
        "surrogate and a map. Recommended is the variant that best predicts poses left out of its fit: "
        f"{findings.best.name} springs."
    )
    footer = (
        f"stiffarm {__version__}, {dt.datetime.now(dt.UTC):%Y-%m-%d %H:%M} UTC, data {findings.data.source} "
        f"(SHA-256 {findings.data.sha256[:12]}...), seed {findings.seed}. Versions, command and timings: run.json."
    )
    page = render(short_title(findings), lede, _key_figures(findings), sections, footer)
    folder.write_text("report.html", page)


def _key_figures(f: Findings) -> list[KeyFigure]:
    error = f.surrogate.errors
    return [
        KeyFigure(
            f"{np.median(f.rigid.factor):.0f} times",
            "measured over simulated deflection with rigid joints (median)",
        ),
        KeyFigure(
            f"{f.best.rms_mm:.3f} mm",
            f"RMS of the recommended model ({f.best.name} springs) on {len(f.best.found.overall)} readings",
        ),
        KeyFigure(f"{f.best.left_out_rms_mm:.3f} mm", "RMS when it predicts poses it has not seen"),
        KeyFigure(
            percent(error.max_relative),
            f"worst held-out error of the surrogate ({percent(error.rms_relative)} RMS)",
        ),
    ]
