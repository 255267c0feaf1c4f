"""What `calibrate` shows on stderr."""

from __future__ import annotations

import numpy as np

from doe.certainty.lack_of_fit import outliers
from doe.published.equations import COMPONENTS
from doe.tables.loaded import rms_mm
from stiffarm.commands.calibrate import words
from stiffarm.commands.calibrate.prediction import Holdout
from stiffarm.commands.calibrate.step import Calibrated, StageFindings
from stiffarm.session.console import say, show_table
from stiffarm.session.noise_words import scatter_name


def show(c: Calibrated) -> None:
    """Numbers of each stage, noise, outliers, remarks and how good the result predicts."""
    if c.found.studies:
        _studies(c)
    for s in c.stages:
        _numbers(s)
        for name, size in words.noise_parts(s.result.estimate.noise, s.result.estimate.problem):
            say(f"{scatter_name(s.result.estimate.problem)}, {name}: {size}")
        for text in outlier_lines(s):
            say(f"outlier: {text}")
    for remark in c.remarks:
        say(f"note: {remark}")
    say_errors(c)
    if c.holdout is not None:
        _holdout(c)


def show_answer(c: Calibrated) -> None:
    """Parameters of each stage, and how good the result fits and predicts: what every command says of it."""
    for s in c.stages:
        _numbers(s)
    say_errors(c)


def say_errors(c: Calibrated) -> None:
    """How good a calibration fits, and predicts poses that it has not seen."""
    missed = f" ({len(c.skipped)} not predicted)" if c.skipped else ""
    error = c.left_out_rms_mm
    predicted = f"to {error:.3f} mm RMS{missed}" if np.isfinite(error) else f"not at all{missed}"
    say(
        f"RMS {c.found.rms_mm:.3f} mm on {len(c.found.overall)} readings with {c.found.count}; "
        f"poses left out one at a time are predicted {predicted}"
    )


def _studies(c: Calibrated) -> None:
    show_table(
        f"Level studies pose by pose, {c.model.load_path} load path",
        ["stage", "pose", "springs (N m/rad)", "error (mm)", "runs"],
        [
            [s.stage.name, fit.pose, ", ".join(f"{j} {k:.3g}" for j, k in zip(fit.joints, fit.stiffness, strict=True)),
             f"{fit.error_mm:+.3f}", str(fit.runs)]
            for s in c.found.studies
            for fit in s.fits
        ],
    )  # fmt: skip


def _numbers(s: StageFindings) -> None:
    estimates = s.result.certainty.estimates
    show_table(
        f"Stage {s.result.stage.name}: {len(estimates)} parameters on {len(s.result.estimate.problem)} readings",
        ["parameter", "value", "95 % interval", "unit", "status"],
        [
            [e.parameter.name, words.value_text(e) if words.known(e) else "-", words.interval_text(e),
             words.shown_unit(e.parameter)[1], e.status if (b := words.bound_of(e)) is None else f"at bound ({b})"]
            for e in estimates
        ],
    )  # fmt: skip


def outlier_lines(s: StageFindings) -> list[str]:
    """Each outlier in words, farthest first."""
    e = s.result.estimate
    p = e.problem
    return [
        words.outlier_text(
            p.poses[p.pose[k]], _line(s, k), COMPONENTS[p.component[k]], float(s.loads_N[k]),
            f"{e.residual[k] * 1e3:+.3g} {'mm' if p.component[k] < 3 else 'mrad'}", float(e.own[k]),
        )
        for k in outliers(e)
    ]  # fmt: skip


def _line(s: StageFindings, k: int) -> str:
    return f"{s.lines[k]}" if s.files is None else f"{s.lines[k]} of {s.files[k]}"


def _holdout(c: Calibrated) -> None:
    h, fitted_mm = c.holdout, c.found.rms_mm
    assert h is not None  # noqa: S101 - asked before
    show_table(
        f"Poses held out ({h.data.source})",
        ["pose", "RMS (mm)", f"expected from {scatter_name(c.found.stages[-1].estimate.problem)} (mm)"],
        [list(row) for row in holdout_rows(h)],
    )
    for label, reason in h.blind.items():
        say(f"note: pose {label} held out is not predicted: {reason}")
    if np.isfinite(h.rms_mm):
        say(f"held out: RMS {h.rms_mm:.3f} mm, against {fitted_mm:.3f} mm in the fit")


def holdout_rows(h: Holdout) -> list[tuple[str, str, str]]:
    """Pose, RMS error and what the scatter found would give, in mm."""
    out = []
    for k, label in enumerate(h.system.poses):
        mine = (h.system.pose == k) & (h.system.component < 3)
        if not mine.any():
            continue
        error = rms_mm(h.error[mine], h.system.component[mine])
        expected = float(np.sqrt(np.mean(h.expected[mine] ** 2))) * 1e3
        out.append((label, f"{error:.3f}" if np.isfinite(error) else "not predicted", f"{expected:.3f}"))
    return out
