"""report.html of a general calibration: what was found, what not, how sure, and how well it predicts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from doe.tables.joined import files_of
from doe.tables.loaded import rms_mm
from fem.arm import Arm
from robots import InputError
from robots.arrays import Array, Integers
from stiffarm.commands.calibrate import words
from stiffarm.commands.calibrate.sections import stage_section, study_blocks
from stiffarm.commands.calibrate.step import Calibrated
from stiffarm.commands.calibrate.tables import holdout_table
from stiffarm.pages import workspace_answer
from stiffarm.pages.bars import bars_figure
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.numbers import naturally
from stiffarm.pages.report import Answer, Block, Bullets, KeyFigure, Note, Section, Table, Text, data_words, write_page
from stiffarm.session.caution import uncalibrated
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.words.loads import loads_words
from stiffarm.session.words.noise import scatter_name
from stiffarm.session.workspace import workspace_stiffness

QUESTION = "which springs explain the readings?"


def write_report(c: Calibrated, folder: OutputFolder) -> None:
    """Draw all figures and write report.html."""
    pictures = Pictures(folder)
    key, answer = _key_figures(c), Answer(_sure(c), _todo(c), warnings=words.doubt_sentences(c.doubts))
    try:
        stiffness = workspace_stiffness(c.description, c.model)
    except InputError as hindrance:
        lede = f"{c.found.count}. The stiffness over the workspace is not known: {hindrance.prose}."
    else:
        lede = workspace_answer.lede(stiffness)
        caption = "Dot: stiffness; bar: its 95 % interval; next to the name, the part that deflects most."
        picture = pictures.add(workspace_answer.answer_figure(stiffness), "stiffness_at_the_tool", caption)
        key = [*workspace_answer.key_figures(stiffness), key[0]]
        sure = f"{answer.sure} {workspace_answer.interval_remark(stiffness)}"
        answer = replace(answer, sure=sure, picture=picture, warnings=(*words.doubt_sentences(c.doubts), *_rigid(c)))
    sections: list[Section] = []
    for number, s in enumerate(c.stages):
        sections += stage_section(c, s, pictures, "" if len(c.stages) == 1 else f"_{number + 1}")
    if c.found.studies:
        sections.append(Section("Level studies pose by pose", tuple(study_blocks(c, pictures))))
    sections += [_predictions(c, pictures), _readings(c), _ORIGIN]
    title = c.description.title.split(" (")[0]
    write_page(folder, title, lede, key, sections, QUESTION, data_words(c.data), answer)


def _key_figures(c: Calibrated) -> list[KeyFigure]:
    n = c.found.count
    bound = f" ({n.at_bound} at a bound)" if n.at_bound else ""
    return [
        KeyFigure(f"{n.identified} of {n.free}", f"parameters identified{bound}"),
        KeyFigure(_mm(c.left_out_rms_mm), "RMS at poses the calibration has not seen (left out one at a time)"),
    ]


def _sure(c: Calibrated) -> str:
    text = f"{len(c.found.overall)} readings are met to {_mm(c.found.rms_mm)} RMS"
    if np.isfinite(c.left_out_rms_mm):
        text += f", poses that the calibration has not seen to {_mm(c.left_out_rms_mm)}"
    if c.holdout is not None:
        text += f", poses held out to {_mm(c.holdout.rms_mm)}"
    return f"{text}."


def _todo(c: Calibrated) -> str:
    n, robot = c.found.count, c.description.name
    if n.identified < n.free:
        return (
            f"{n.free - n.identified} of {n.free} parameters are not identified: `stiffarm plan {robot} --poses 6` "
            "names the set-ups that tell them best. Take model.toml for every other command."
        )
    return (
        "Take model.toml for every other command: `stiffarm map`, `posture`, `place`. `stiffarm diagnose` says whether "
        "anything is missing in it."
    )


def _rigid(c: Calibrated) -> tuple[str, ...]:
    said = uncalibrated(Arm(c.description, c.model.robot, c.model))
    return (said,) if said else ()


def _mm(value: float) -> str:
    return f"{value:.3f} mm" if np.isfinite(value) else "not known"


def _readings(c: Calibrated) -> Section:
    data = c.data
    names = np.array(["X", "Y", "Z", "rotation about X", "rotation about Y", "rotation about Z"])
    read = ", ".join(names[data.used.any(axis=0)])
    repeats = len(c.found.overall) - len(np.unique(c.found.overall.replicate))
    text = (
        f"{data.n} readings at {len(data.pose_groups())} poses under {loads_words(data.levels_N)}; read were {read}. "
        f"{repeats if repeats else 'None'} of the {len(c.found.overall)} numbers read "
        f"{'is a repeat' if repeats == 1 else 'are repeats'} of another."
    )
    blocks: list[Block] = [Text(text)]
    files = files_of(data)
    if files is not None:
        poses = {name: {p for p, file in zip(data.pose, files, strict=True) if file == name} for name in files}
        rows = [(name, str(files.count(name)), ", ".join(sorted(poses[name]))) for name in dict.fromkeys(files)]
        blocks.append(Table("Tables, as one", ("table", "readings", "poses"), tuple(rows), text_columns=(0, 2)))
    return Section("The readings", (*blocks, Bullets(data.notes)) if data.notes else tuple(blocks))


def _predictions(c: Calibrated, pictures: Pictures) -> Section:
    system = c.found.overall
    errors = {"fitted": _by_pose(c.found.residual, system.pose, system.component, system.poses)}
    if np.isfinite(c.left_out_rms_mm):
        errors["left out"] = _by_pose(c.left_out, system.pose, system.component, system.poses)
    blocks: list[Block] = [
        Text(
            f"Each pose predicted by a calibration that has not seen it: RMS {_mm(c.left_out_rms_mm)}, "
            f"against {_mm(c.found.rms_mm)} in the fit."
        )
    ]
    if c.coverage.readings:
        blocks.append(Text(f"{_sentence(words.coverage_text(c.coverage, 'poses left out'))}. {words.INTERVAL}"))
    last = c.found.stages[-1].estimate if c.found.stages else None
    h, scatter = c.holdout, "scatter" if last is None else scatter_name(last.problem)
    if h is not None:
        # Labels of the two tables may be the same for different poses.
        labels = tuple(f"{label} (held out)" for label in h.system.poses)
        errors["held out"] = _by_pose(h.error, h.system.pose, h.system.component, labels)
        expected = float(np.sqrt(np.mean(h.expected[h.system.component < 3] ** 2))) * 1e3
        blocks.append(
            Text(
                f"{len(h.system)} readings of {h.data.source}, none of whose poses was used: RMS {_mm(h.rms_mm)}. "
                f"The scatter found ({scatter}) would give {_mm(expected)} by itself."
            )
        )
        if h.coverage.readings:
            blocks.append(Text(f"{_sentence(words.coverage_text(h.coverage, 'poses held out'))}."))
        blocks.append(holdout_table(h, scatter))
    if any(np.isfinite(v) for one in errors.values() for v in one.values()):
        noise = {}
        if last is not None and (system.component < 3).any():
            noise[f"{scatter}, a reading"] = last.noise.white[0] * 1e3
        blocks.append(
            pictures.add(
                bars_figure("", _sorted(errors), "RMS error (mm)", "pose", noise),
                "predictions",
                "RMS error by pose. Bars of poses left out or held out that are far above the fitted ones: the "
                "fit has adapted itself to these readings.",
            )
        )
    reasons = [f"pose {label}, left out: {why}" for label, why in c.skipped.items()]
    reasons += [f"pose {label}, held out: {why}" for label, why in (h.blind if h is not None else {}).items()]
    if reasons:
        blocks += [
            Note("Some poses are not predicted, for the rest of the readings cannot tell:"),
            Bullets(tuple(reasons)),
        ]
    return Section("Prediction", tuple(blocks))


def _sorted(errors: dict[str, dict[str, float]]) -> dict[str, dict[str, float]]:
    """The poses in the order in which people count; of those held out behind them."""
    order = naturally(label for one in errors.values() for label in one)
    order.sort(key=lambda label: label.endswith("(held out)"))
    return {name: {label: one.get(label, float("nan")) for label in order} for name, one in errors.items()}


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _by_pose(error: Array, pose: Integers, component: Integers, labels: tuple[str, ...]) -> dict[str, float]:
    out = {}
    for k, label in enumerate(labels):
        mine = (pose == k) & ~np.isnan(error)
        out[label] = rms_mm(error[mine], component[mine])
    return out


_ORIGIN = Section(
    "How it was done",
    (
        Text(
            "Compliances enter deflections linearly, so for given noise the optimum over stiffnesses is global. "
            "Intervals are those of the profile likelihood where the parabola would not do; the scatter is estimated "
            "by restricted likelihood, and without repeats it is what the model leaves, noise or not. The calibrated "
            "model is model.toml; every number there says where it came from."
        ),
    ),
    folded=True,
)
