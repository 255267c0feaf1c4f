"""A calibration as a result: its parameters, the calibrated arm, how sure it is and how well it predicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from doe.absolute.identified import Finding
from doe.certainty.doubts import CODES
from doe.certainty.lack_of_fit import outliers
from fem.arm import Arm as BuiltArm
from robots import InputError, Remark, require_one_of, save_description
from robots.arrays import Array, Bools
from stiffarm.arm import Arm, as_face
from stiffarm.commands.calibrate import payload, tables, words
from stiffarm.commands.calibrate.sections import (
    errors_by_pose,
    last_sections,
    residual_groups,
    stage_sections,
    studies_figure,
)
from stiffarm.commands.calibrate.step import Calibrated, StageFindings
from stiffarm.pages.report import KeyFigure, Section, Text, data_words
from stiffarm.result import Drawing, Result
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.words.noise import scatter_name

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from doe.absolute.calibrate import Positions


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Calibration(Result):
    """A finished calibration. ``calibration["j2.stiffness"]`` is one of its parameters.

    ``arm``: the calibrated arm; ``parameters``: each with ``name``, ``value`` in ``unit`` (None where it is not
    identified or stands at a bound), ``interval95`` and ``status``; ``covariance_of``: names of the estimator's
    variables and their covariance; ``loads``: those of the readings used, N, each once. ``found`` has everything else.
    """

    arm: Arm
    found: Calibrated | Positions
    parameters: tuple[Finding, ...]
    loads: tuple[float, ...] = ()
    covariance_of: tuple[tuple[str, ...], Array] | None = None

    def __getitem__(self, name: str) -> Any:
        known = {one.name: one for one in self.parameters}
        if name in known:
            return known[name]
        try:
            return super().__getitem__(name)
        except InputError:
            require_one_of("parameter", name, known, code="B003")
            raise

    def interval(self, name: str) -> tuple[Array, Array]:
        """Ends of the 95 % interval of a parameter in its unit, or as :meth:`stiffarm.Result.interval`."""
        for one in self.parameters:
            if one.name == name:
                low, high = one.interval95
                return np.array(low), np.array(high)
        return super().interval(name)

    @property
    def covariance(self) -> pd.DataFrame:
        """Covariance of the estimator's variables of the last stage (1/value of a stiffness, see ``variable`` in JSON).

        Raises
        ------
        InputError
            Springs matched pose by pose have none.
        """
        import pandas as pd

        if self.covariance_of is None:
            raise InputError("covariance of springs pose by pose", code="B003", allowed="scheme='global'")
        names, values = self.covariance_of
        return pd.DataFrame(values, index=list(names), columns=list(names))

    @property
    def rms_mm(self) -> float:
        """RMS error of the readings that it was made of."""
        return float(super().__getitem__("rms_mm"))

    @property
    def left_out_rms_mm(self) -> float:
        """RMS error at poses predicted by a calibration that has not seen them."""
        return float(super().__getitem__(tables.POSES_OUT.column))

    @property
    def holdout_rms_mm(self) -> float | None:
        """RMS error at readings kept out; None without any."""
        held = self.facts.get("holdout")
        return None if held is None else held["rms_mm"]

    def write(self, folder: OutputFolder) -> dict[str, Any]:
        """As :meth:`stiffarm.Result.write`; the page begins with the stiffness over the workspace."""
        return Result.write(_with_workspace(self), folder)


def of_deflections(given: BuiltArm, c: Calibrated, notes: Sequence[str] = (), diagnose: str = "") -> Calibration:
    """The result of a calibration from deflections; ``diagnose``: the command that asks what is missing."""
    found, estimates = c.found, [e for s in c.found.stages for e in s.certainty.estimates]
    arm = as_face(given.of(c.description, given.model.link_kind, given.model.load_path, given.own))
    last = found.stages[-1] if found.stages else None
    return Calibration(
        name="calibration",
        title=c.description.title.split(" (")[0],
        question="which springs explain the readings?",
        answer=f"{words.errors_text(c)}.",
        how_sure=_how_sure(c),
        what_next=_what_next(c, diagnose),
        facts=payload.facts(c),
        numbers=tables.numbers_of(c),
        tables=tables.tables_of(c),
        drawings=tuple(_drawings(c)),
        key=tuple(_key_figures(c)),
        sections=tuple(section for s in c.stages for section in stage_sections(c, s)) + tuple(last_sections(c)),
        warnings=tuple(Remark(one.words, code=CODES[one.code]) for one in c.doubts),
        remarks=(*notes, *c.remarks[len(c.doubts) :]),
        arm=arm,
        found=c,
        more=partial(_model, c),
        made_of=data_words(c.data),
        parameters=tuple(
            Finding(e.parameter.name, e.parameter.unit, e.value if words.known(e) else None, e.interval, e.status)
            for e in estimates
        ),
        loads=c.data.levels_N,
        covariance_of=None
        if last is None
        else (tuple(e.parameter.name for e in last.certainty.estimates), last.certainty.covariance),
    )


def _model(c: Calibrated, folder: OutputFolder) -> dict[str, Any]:
    save_description(c.description, folder.path("model.toml"))
    return {}


def _key_figures(c: Calibrated) -> list[KeyFigure]:
    n = c.found.count
    bound = f" ({n.at_bound} at a bound)" if n.at_bound else ""
    return [
        KeyFigure(f"{n.identified} of {n.free}", f"parameters identified{bound}"),
        KeyFigure(words.mm(c.left_out_rms_mm), "RMS at poses the calibration has not seen (left out one at a time)"),
    ]


def _how_sure(c: Calibrated) -> str:
    if not c.coverage.readings:
        return "No reading is to spare for intervals of predictions."
    text = words.coverage_text(c.coverage, "poses left out")
    if c.holdout is not None and c.holdout.coverage.readings:
        text += f"; {words.coverage_text(c.holdout.coverage, 'poses held out')}"
    return f"{text[:1].upper()}{text[1:]}."


def _what_next(c: Calibrated, diagnose: str) -> str:
    n, robot = c.found.count, c.description.name
    if c.doubts and diagnose:
        return f"Find out what the model is missing: `{diagnose}`."
    if n.identified < n.free:
        return (
            f"{n.free - n.identified} of {n.free} parameters are not identified: `stiffarm plan {robot} --poses 6` "
            "names the set-ups that tell them best. Take model.toml for every other command."
        )
    return (
        "Take model.toml for every other command: `stiffarm map`, `posture`, `place`. `stiffarm diagnose` says whether "
        "anything is missing in it."
    )


def _with_workspace(c: Calibration) -> Calibration:
    """The result with key figures, a picture and a section on the stiffness over the workspace, where it is known."""
    from stiffarm.pages import workspace_answer
    from stiffarm.session.workspace import workspace_stiffness

    title = "How stiff the arm is at its tool"
    try:
        found = workspace_stiffness(c.arm.description, c.arm.model)
    except InputError as hindrance:
        text = f"The stiffness over the workspace is not known: {hindrance.prose}."
        return replace(c, sections=(Section(title, (Text(text),)), *c.sections))
    text = f"{workspace_answer.lede(found)} {workspace_answer.interval_remark(found)}"
    caption = "Dot: stiffness; bar: its 95 % interval; next to the name, the part that deflects most."
    draw = partial(workspace_answer.answer_figure, found)
    return replace(
        c,
        key=(*workspace_answer.key_figures(found), *c.key[:1]),
        drawings=(Drawing("stiffness_at_the_tool", caption, "stiffness at the tool", draw), *c.drawings),
        sections=(Section(title, (Text(text),)), *c.sections),
    )


def _drawings(c: Calibrated) -> list[Drawing]:
    """Intervals, laws and residuals of each stage, springs pose by pose, and predictions."""
    out = []
    for number, s in enumerate(c.stages):
        out += _stage_drawings(c, s, "" if len(c.stages) == 1 else f"_{number + 1}")
    if c.found.studies:
        path = c.model.load_path
        out.append(Drawing(f"springs_against_angle_{path}", words.STUDIES, "springs", partial(studies_figure, c)))
    if any(np.isfinite(v) for one in errors_by_pose(c).values() for v in one.values()):
        caption = (
            "RMS error by pose. Bars of poses left out or held out that are far above the fitted ones: the fit has "
            "adapted itself to these readings."
        )
        out.append(Drawing("predictions", caption, "predictions", partial(_predictions_figure, c)))
    return out


def _stage_drawings(c: Calibrated, s: StageFindings, suffix: str) -> list[Drawing]:
    out = [
        Drawing(
            f"intervals{suffix}",
            "95 % intervals. A parameter without a marker stands at its bound: it has no value.",
            "intervals",
            partial(_intervals_figure, s),
        )
    ]
    if s.result.laws:
        caption = (
            "Springs over their angles with pointwise 95 % bands; circles: angles read. Dashed: beyond them nothing "
            "was read, and the law goes on as its kind and the prior that keeps it flat say."
        )
        out.append(Drawing(f"laws{suffix}", caption, "laws", partial(_laws_figure, s)))
    component = s.result.estimate.problem.component
    for of_rotations, name in ((False, ""), (True, "_rotations")):
        if ((component >= 3) == of_rotations).any():
            out += [
                Drawing(
                    f"residuals{name}{suffix}",
                    "Residuals; the band is twice their standard deviation, black bars are means, diamonds outliers "
                    "(triangles: beyond the axis). A pattern over poses, loads or directions is something the model "
                    "lacks.",
                    "residuals",
                    partial(_residuals_figure, s, of_rotations),
                ),
                Drawing(
                    f"checks{name}{suffix}",
                    "Measured against predicted; residuals against predicted; standardised residuals on a normal law.",
                    "checks",
                    partial(_checks_figure, s, of_rotations),
                ),
            ]
    return out


def _intervals_figure(s: StageFindings) -> Figure:
    from stiffarm.commands.calibrate.figures.identifiability import intervals_figure

    return intervals_figure({"": s.result.certainty.estimates})


def _laws_figure(s: StageFindings) -> Figure:
    from doe.calibration.laws import curves
    from stiffarm.commands.calibrate.figures.laws import laws_figure

    return laws_figure(curves(s.result))


def _residuals_figure(s: StageFindings, of_rotations: bool) -> Figure:
    from stiffarm.commands.calibrate.figures.residuals import residuals_figure

    e = s.result.estimate
    mine, flagged = _of_kind(s, of_rotations)
    groups = {n: [labels[k] for k in np.flatnonzero(mine)] for n, labels in residual_groups(s).items()}
    groups = {n: labels for n, labels in groups.items() if n == "pose" or len(set(labels)) > 1}
    loads = s.loads_N[mine] if "load" not in groups and np.ptp(s.loads_N[mine]) > 0.0 else None
    sd = e.noise.spread(e.problem, e.prediction)[mine] * 1e3
    unit = "mrad" if of_rotations else "mm"
    return residuals_figure(e.residual[mine] * 1e3, unit, groups, flagged, sd, loads)


def _checks_figure(s: StageFindings, of_rotations: bool) -> Figure:
    from stiffarm.commands.calibrate.figures.residuals import checks_figure

    e = s.result.estimate
    mine, flagged = _of_kind(s, of_rotations)
    unit = "mrad" if of_rotations else "mm"
    return checks_figure(e.prediction[mine] * 1e3, e.problem.value[mine] * 1e3, e.own[mine], unit, flagged)


def _of_kind(s: StageFindings, of_rotations: bool) -> tuple[Bools, Bools]:
    """Which components read are of this kind, and which of these stand out."""
    e = s.result.estimate
    mine = (e.problem.component >= 3) == of_rotations
    flagged = np.zeros(len(e.problem), dtype=np.bool_)
    flagged[outliers(e)] = True
    return mine, flagged[mine]


def _predictions_figure(c: Calibrated) -> Figure:
    from stiffarm.pages.bars import bars_figure
    from stiffarm.pages.numbers import naturally

    errors = errors_by_pose(c)
    # Poses in the order in which people count; those held out behind the others.
    order = naturally(label for one in errors.values() for label in one)
    order.sort(key=lambda label: label.endswith("(held out)"))
    shown = {name: {label: one.get(label, np.nan) for label in order} for name, one in errors.items()}
    noise = {}
    if c.found.stages and (c.found.overall.component < 3).any():
        last = c.found.stages[-1].estimate
        noise[f"{scatter_name(last.problem)}, a reading"] = last.noise.white[0] * 1e3
    return bars_figure("", shown, "RMS error (mm)", "pose", noise)
