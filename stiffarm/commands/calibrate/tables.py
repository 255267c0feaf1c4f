"""Tables of a calibration, for its page and for the screen, and what `calibrate` shows there."""

from __future__ import annotations

import numpy as np

from doe.certainty.doubts import CODES
from doe.certainty.lack_of_fit import FLAGGED, outliers
from doe.published.parametric import PoseFit
from doe.published.pose_studies import IDENTIFIED_WITHIN
from doe.tables.columns import COMPONENTS
from doe.tables.joined import files_of
from doe.tables.loaded import rms_mm
from stiffarm.commands.calibrate import words
from stiffarm.commands.calibrate.prediction import Holdout
from stiffarm.commands.calibrate.step import Calibrated, StageFindings
from stiffarm.pages.report import Table
from stiffarm.session.console import say, say_notes
from stiffarm.session.words.noise import scatter_name
from stiffarm.session.words.springs import mega


def show(c: Calibrated) -> None:
    """Parameters of each stage, noise, outliers, remarks and how good the result predicts."""
    say_doubts(c)
    if c.found.studies:
        studies_table(c).show()
    for s in c.stages:
        numbers_table(s).show()
        for name, size in words.noise_parts(s.result.estimate.noise, s.result.estimate.problem):
            say(f"{scatter_name(s.result.estimate.problem)}, {name}: {size}")
        for text in outlier_lines(s):
            say(f"outlier: {text}")
    say_notes(c.remarks[len(c.doubts) :])
    say_errors(c)
    if c.holdout is not None:
        _show_holdout(c.holdout, c)


def show_answer(c: Calibrated) -> None:
    """Parameters of each stage, and how good the result fits and predicts: what every command says of it."""
    for s in c.stages:
        numbers_table(s).show()
    say_errors(c)


def say_doubts(c: Calibrated) -> None:
    """What the readings say against a calibration, or against themselves."""
    for doubt in c.doubts:
        say(f"warning: {doubt.words}", code=CODES[doubt.code])


def say_errors(c: Calibrated) -> None:
    """How good a calibration fits, and predicts poses that it has not seen."""
    missed = f" ({len(c.skipped)} not predicted)" if c.skipped else ""
    error = c.left_out_rms_mm
    predicted = f"to {error:.3f} mm RMS{missed}" if np.isfinite(error) else f"not at all{missed}"
    say(
        f"RMS {c.found.rms_mm:.3f} mm on {len(c.found.overall)} readings with {c.found.count}; "
        f"poses left out one at a time are predicted {predicted}"
    )
    if c.coverage.readings:
        say(words.coverage_text(c.coverage, "poses left out"))


def studies_table(c: Calibrated) -> Table:
    """The springs of every pose that was studied by itself."""
    return Table(
        f"Level studies pose by pose, {c.model.load_path} load path: {c.found.count}, RMS {c.found.rms_mm:.3f} mm",
        ("stage", "pose", "spring", "value (1e6 N m/rad)", "would match as well", "identified", "error (mm)", "runs"),
        tuple(row for s in c.found.studies for fit in s.fits for row in _study_rows(s.stage.name, fit)),
        text_columns=(0, 2, 4, 5),
    )


def _study_rows(stage: str, fit: PoseFit) -> list[tuple[str, ...]]:
    """A row for each spring: its value at this pose, what would match as well, and whether that identifies it."""
    rows: list[tuple[str, ...]] = []
    for joint, k, (low, high) in zip(fit.joints, fit.stiffness, fit.equivalent, strict=True):
        matching = f"{mega(low)} to {mega(high)}" if np.isfinite(low) else "nothing matches"
        known = "yes" if high < IDENTIFIED_WITHIN * low else "no"
        rows.append((stage, fit.pose, joint, mega(k), matching, known, f"{fit.error_mm:+.3f}", str(fit.runs)))
    return rows


def numbers_table(s: StageFindings) -> Table:
    """The parameters of a stage: what was found, how sure, and what was known before."""
    estimates = s.result.certainty.estimates
    return Table(
        f"Stage {s.result.stage.name}: {len(estimates)} parameters on {len(s.result.estimate.problem)} readings",
        ("parameter", "value", "95 % interval", "unit", "status", "model had", "prior"),
        tuple(
            (
                e.parameter.name,
                words.value_text(e),
                words.interval_text(e),
                words.shown_unit(e.parameter)[1],
                e.status,
                words.before_text(e.parameter),
                words.prior_text(e.parameter),
            )
            for e in estimates
        ),
        text_columns=(0, 1, 4, 6),
    )


def outlier_lines(s: StageFindings) -> list[str]:
    """Each outlier by the line of the table it stands in, with the table's name where there are several."""
    e, files, out = s.result.estimate, files_of(s.read), []
    p = e.problem
    for k in outliers(e):
        row, own = p.row[k], abs(e.own[k])
        line = f"{s.read.row_numbers[row]}" + ("" if files is None else f" of {files[row]}")
        size = f"{own:.3g} of its standard deviations" if own < 1e3 else "over 1000 of its standard deviations"
        residual = f"{e.residual[k] * 1e3:+.3g} {'mm' if p.component[k] < 3 else 'mrad'}"
        what = f"pose {p.poses[p.pose[k]]}, {COMPONENTS[p.component[k]]} at {s.loads_N[k]:g} N"
        out.append(f"line {line}: {what} is off by {residual}, {size} (beyond {FLAGGED:g})")
    return out


def _show_holdout(h: Holdout, c: Calibrated) -> None:
    holdout_table(h, scatter_name(c.found.stages[-1].estimate.problem)).show()
    for label, reason in h.blind.items():
        say(f"note: pose {label} held out is not predicted: {reason}")
    if np.isfinite(h.rms_mm):
        say(f"held out: RMS {h.rms_mm:.3f} mm, against {c.found.rms_mm:.3f} mm in the fit")
    if h.coverage.readings:
        say(words.coverage_text(h.coverage, "poses held out"))


def holdout_table(h: Holdout, scatter: str) -> Table:
    """RMS error at each pose held out, and what the scatter found, by its name, would give."""
    rows = []
    for k, label in enumerate(h.system.poses):
        mine = (h.system.pose == k) & (h.system.component < 3)
        if not mine.any():
            continue
        error = rms_mm(h.error[mine], h.system.component[mine])
        expected = float(np.sqrt(np.mean(h.expected[mine] ** 2))) * 1e3
        rows.append((label, f"{error:.3f}" if np.isfinite(error) else "not predicted", f"{expected:.3f}"))
    heads = ("pose", "RMS (mm)", f"expected from {scatter} (mm)")
    return Table(f"Poses held out ({h.data.source})", heads, tuple(rows))
