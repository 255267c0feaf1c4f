"""The report's section on studies pose by pose: the springs of each pose, and their laws over the angle."""

from __future__ import annotations

import numpy as np

from doe.published.parametric import PoseFit
from stiffarm.commands.calibrate.figures.laws import laws_figure
from stiffarm.commands.calibrate.laws import study_curves
from stiffarm.commands.calibrate.step import Calibrated
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Block, Bullets, Section, Table
from stiffarm.session.spring_words import mega


def study_section(c: Calibrated, pictures: Pictures) -> Section:
    """Table, laws and remarks of the studies of one calibration."""
    return Section("Level studies pose by pose", tuple(study_blocks(c, pictures)))


def study_blocks(c: Calibrated, pictures: Pictures) -> list[Block]:
    """The same as blocks."""
    studies, path = c.found.studies, c.model.load_path
    heads = ("stage", "pose", "springs (1e6 N m/rad)", "error (mm)", "runs", "would match as well (1e6 N m/rad)")
    rows = tuple(_row(s.stage.name, fit) for s in studies for fit in s.fits)
    title = f"Staged scheme, {path} load path: {c.found.count}, RMS {c.found.rms_mm:.3f} mm"
    caption = (
        f"{path.capitalize()} load path: regression of each spring over its angles. Filled points were calibrated, "
        "hollow ones mirrored, grey ones held at the start value during an earlier stage."
    )
    blocks: list[Block] = [
        Table(title, heads, rows, text_columns=(0, 2, 5)),
        pictures.add(laws_figure(study_curves(studies, c.model.robot)), f"springs_against_angle_{path}", caption),
    ]
    return [*blocks, Bullets(c.remarks)] if c.remarks else blocks


def _row(stage: str, fit: PoseFit) -> tuple[str, ...]:
    springs = ", ".join(f"{j} {mega(k)}" for j, k in zip(fit.joints, fit.stiffness, strict=True))
    ranges = ", ".join(
        f"{j} {mega(a)} to {mega(b)}" if np.isfinite(a) else f"{j}: nothing matches"
        for j, (a, b) in zip(fit.joints, fit.equivalent, strict=True)
    )
    return stage, fit.pose, springs, f"{fit.error_mm:+.3f}", str(fit.runs), ranges
