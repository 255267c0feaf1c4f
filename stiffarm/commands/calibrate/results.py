"""A calibration as a result: its parameters, the calibrated arm, how sure it is, pictures and what its page says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from doe.absolute.identified import Finding
from doe.certainty.doubts import CODES
from doe.certainty.identifiability import correlations
from doe.certainty.lack_of_fit import outliers
from doe.tables.joined import files_of
from doe.tables.loaded import rms_mm, spring_parts
from fem.arm import Arm as BuiltArm
from robots import InputError, Remark, require_one_of, save_description
from robots.arrays import Array, Bools, Integers
from robots.quantities import significant
from stiffarm.arm import Arm, as_face
from stiffarm.commands.calibrate import payload, tables, words
from stiffarm.commands.calibrate.step import Calibrated, StageFindings
from stiffarm.pages.report import Block, Bullets, Fold, KeyFigure, Note, Section, Table, Text, data_words
from stiffarm.result import Drawing, Result
from stiffarm.session.caution import caveats
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.words.directions import direction_words
from stiffarm.session.words.loads import loads_words
from stiffarm.session.words.noise import scatter_name

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from doe.absolute.calibrate import Positions
    from stiffarm.pages.blocks import Pictures


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
    sections, drawings = _illustrated(
        [*(section for s in c.stages for section in stage_sections(c, s)), *last_sections(c)], list(_drawings(c))
    )
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
        drawings=drawings,
        key=tuple(_key_figures(c)),
        sections=sections,
        warnings=(*(Remark(one.words, code=CODES[one.code]) for one in c.doubts), *filter(None, (caveats(arm),))),
        caution="",
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


# Beginnings of the sections that pictures stand in, by picture.
_PLACES: Final = {
    "intervals": "What these readings can",
    "residuals": "Outliers",
    "checks": "Outliers",
    "predictions": "Prediction",
}


def _illustrated(
    sections: Sequence[Section], drawings: Sequence[Drawing]
) -> tuple[tuple[Section, ...], tuple[Drawing, ...]]:
    """Sections with their pictures, each in the first section that is its own; and the pictures that have none."""
    left = list(drawings)
    out = []
    for section in sections:
        own = [one for one in left if section.title.startswith(_PLACES.get(one.name, "\0"))]
        left = [one for one in left if one not in own]
        out.append(replace(section, blocks=(*section.blocks, *own)))
    return tuple(out), tuple(left)


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
        return replace(c, sections=(Section(title, (Text(text),)), *c.story))
    text = f"{workspace_answer.lede(found)} {workspace_answer.interval_remark(found)}"
    caption = "Dot: stiffness; bar: its 95 % interval; next to the name, the part that deflects most."
    draw = partial(workspace_answer.answer_figure, found)
    return replace(
        c,
        key=(*workspace_answer.key_figures(found), *c.key[:1]),
        drawings=(Drawing("stiffness_at_the_tool", caption, "stiffness at the tool", draw), *c.drawings),
        sections=(Section(title, (Text(text),)), *c.story),
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
                    "Residuals; the band is twice their standard deviation, short bars are means, diamonds outliers "
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


_BLIND = 1e-9
# Correlations from this size on are worth a line, and so many of them.
TOGETHER, MOST_PAIRS = 0.5, 10
# So many lines of a list are seen before it is unfolded, of sentences that are no longer than this together.
FEW_LINES, MOST_LETTERS = 3, 600
# More different loads or directions are no groups: loads then make an axis.
MOST_GROUPS = 12
_AXES = ("X", "Y", "Z", "about X", "about Y", "about Z")


def stage_sections(c: Calibrated, s: StageFindings) -> list[Section]:
    """Sections of one stage."""
    of = f", stage {s.result.stage.name}" if len(c.stages) > 1 else ""
    r, blocks = s.result, identified_blocks(c, s)
    if (pairs := _moves_together(s)) is not None:
        blocks.append(pairs)
    if r.study is not None:
        blocks.insert(0, Text(f"A parametric study: {r.study.runs} runs in {r.study.rounds} rounds of finer levels."))
    scatter = scatter_name(r.estimate.problem)
    return [
        Section(f"What these readings can and cannot identify{of}", tuple(blocks)),
        Section(f"{scatter[0].upper()}{scatter[1:]}, and whether the model holds{of}", tuple(_noise(c, s))),
        Section(f"Outliers{of}", tuple(_outliers(c, s))),
    ]


def study_blocks(c: Calibrated, pictures: Pictures) -> list[Block]:
    """Table, laws and remarks of the studies pose by pose of a calibration."""
    picture = pictures.add(studies_figure(c), f"springs_against_angle_{c.model.load_path}", words.STUDIES)
    blocks: list[Block] = [tables.springs_at_poses(c).block(), picture]
    return [*blocks, Bullets(c.remarks)] if c.remarks else blocks


def studies_figure(c: Calibrated) -> Figure:
    """Springs studied pose by pose, and the laws through them."""
    from doe.calibration.laws import study_curves
    from stiffarm.commands.calibrate.figures.laws import laws_figure

    return laws_figure(study_curves(c.found.studies, c.model.robot))


def identified_blocks(c: Calibrated, s: StageFindings) -> list[Block]:
    """Which parameters the readings of a stage determine, which not, and what would help."""
    r = s.result
    blocks: list[Block] = [Bullets((*words.identified_text(r.certainty.estimates), *_held(c)))]
    if r.trade_offs:
        texts = tuple(t.words for t in r.trade_offs)
        blocks.append(Note(f"Some parameters are seen only together, in {len(texts)} groups."))
        if sum(map(len, texts[:FEW_LINES])) < MOST_LETTERS:
            blocks.append(Bullets(texts[:FEW_LINES]))
        if len(texts) > FEW_LINES or len(blocks) < 3:
            blocks.append(Fold("Groups of parameters that are seen only together", (Bullets(texts),)))
    if r.unseen:
        blocks.append(Text(f"No reading depends on {', '.join(r.unseen)}; other loads, directions or poses may."))
    if any(e.status != "determined" for e in r.certainty.estimates):
        blocks.append(Text("`stiffarm plan` chooses the poses, loads and directions that identify the rest best."))
    return blocks


def _held(c: Calibrated) -> list[str]:
    """Joint springs that were not set free in any stage, and whether readings would have moved with them."""
    free = {
        e.parameter.place
        for s in c.found.stages
        for e in s.certainty.estimates
        if e.parameter.kind.of_law or e.parameter.spring_of is not None
    }
    influence = np.abs(spring_parts(c.found.model, c.data)[0][c.data.used]).max(axis=0)
    out = []
    for what, mine in (
        ("no reading moves with them", influence <= _BLIND * influence.max()),
        ("the readings move with them, so they were taken as known", influence > _BLIND * influence.max()),
    ):
        names = [n for n, m in zip(c.found.model.robot.joint_names, mine, strict=True) if m and n not in free]
        if names:
            out.append(f"Springs not set free, held as the model has them: {', '.join(names)} ({what}).")
    return out


def _moves_together(s: StageFindings) -> Block | None:
    """The pairs of estimates that move together most; None where none do."""
    e = s.result.estimate
    correlation, _, index = correlations(e)
    names = [e.problem.parameters[k].name for k in index]
    rows, columns = np.triu_indices(len(names), 1)
    size = np.abs(correlation[rows, columns])
    order = [k for k in np.argsort(-size, kind="stable")[:MOST_PAIRS] if size[k] >= TOGETHER]
    if not order:
        return None
    cells = tuple(
        (f"{names[rows[k]]} and {names[columns[k]]}", significant(correlation[rows[k], columns[k]], 2)) for k in order
    )
    more = int(np.count_nonzero(size >= TOGETHER)) - len(order)
    beside = f"; {more} more pairs above {TOGETHER:g}" if more else ""
    return Table(
        f"Estimates that move together most (correlation, bounds ignored, of compliances where a stiffness was "
        f"estimated{beside})",
        ("parameters", "correlation"),
        cells,
        folded=True,
    )


def _noise(c: Calibrated, s: StageFindings) -> list[Block]:
    r, test = s.result, s.result.lack_of_fit
    judged, why = words.verdict(r, c.request.campaign.noise.gauge_mm)
    parts = tuple(words.noise_parts(r.estimate.noise, r.estimate.problem))
    blocks: list[Block] = [
        Table("Standard deviations found", ("scatter of", "size"), parts, text_columns=(0,)),
        Text(words.setups_text(r, s.independent)),
        Note(why) if judged == "refuted" else Text(why),
    ]
    if test.chi_dof > 0:
        close = " (close to one another by construction, for it was estimated from the same residuals)"
        blocks.append(
            Text(
                f"Chi-square of the residuals against this scatter: {significant(test.chi_square)} on {test.chi_dof} "
                f"degrees of freedom{close if np.isnan(r.estimate.problem.sigma).any() else ''}."
            )
        )
    return blocks


def residual_groups(s: StageFindings) -> dict[str, list[str]]:
    """Labels of each component read, by what it may depend on."""
    p = s.result.estimate.problem
    force = p.free.at.wrench[p.row, :3]
    size = np.linalg.norm(force, axis=1, keepdims=True)
    unit = np.divide(force, size, out=np.zeros_like(force), where=size > 0.0)
    pulls = [direction_words(d) if d.any() else "moment only" for d in np.round(unit, 2)]
    groups = {
        "pose": [p.poses[k] for k in p.pose],
        "load": [f"{significant(v)} N" for v in s.loads_N],
        "direction of the load": pulls,
        "component read": [_AXES[k] for k in p.component],
        "phase": [s.read.phase[row] or "not said" for row in p.row],
    }
    # Too many different loads or directions make no groups.
    return {n: labels for n, labels in groups.items() if n == "pose" or len(set(labels)) <= MOST_GROUPS}


def _outliers(c: Calibrated, s: StageFindings) -> list[Block]:
    e = s.result.estimate
    count, lost = len(outliers(e)), int(np.sum(e.weight < 1.0))
    if not c.request.campaign.noise.robust:
        return [Text("Outliers kept full weight, as asked.")] if count else []
    if not count:
        some = f" {lost} of {len(e.problem)} lost some weight." if lost else ""
        return [Text(f"No reading stands out by more than 4 of its standard deviations.{some}")]
    moved = words.full_weight_text(s.result, s.full_weight)
    return [Note(f"{count} of {len(e.problem)} readings stand out and lost weight. {moved}".rstrip())]


def last_sections(c: Calibrated) -> list[Section]:
    """How well it predicts, what was read, and how it was done."""
    return [_predictions(c), _readings(c), _ORIGIN]


def _predictions(c: Calibrated) -> Section:
    blocks: list[Block] = [
        Text(
            f"Each pose predicted by a calibration that has not seen it: RMS {words.mm(c.left_out_rms_mm)}, "
            f"against {words.mm(c.found.rms_mm)} in the fit."
        )
    ]
    if c.coverage.readings:
        blocks.append(Text(words.INTERVAL))
    h = c.holdout
    if h is not None:
        scatter = scatter_name(c.found.stages[-1].estimate.problem) if c.found.stages else "scatter"
        expected = float(np.sqrt(np.mean(h.expected[h.system.component < 3] ** 2))) * 1e3
        blocks.append(
            Text(
                f"{len(h.system)} readings of {h.data.source}, none of whose poses was used: RMS {words.mm(h.rms_mm)}. "
                f"The scatter found ({scatter}) would give {words.mm(expected)} by itself."
            )
        )
    reasons = [f"pose {label}, left out: {why}" for label, why in c.skipped.items()]
    reasons += [f"pose {label}, held out: {why}" for label, why in (h.blind if h is not None else {}).items()]
    if reasons:
        text = "Some poses are not predicted, for the rest of the readings cannot tell:"
        blocks += [Note(text), Bullets(tuple(reasons))]
    return Section("Prediction", tuple(blocks))


def errors_by_pose(c: Calibrated) -> dict[str, dict[str, float]]:
    """RMS errors in mm by pose: fitted, left out and held out."""
    system = c.found.overall
    errors = {"fitted": _by_pose(c.found.residual, system.pose, system.component, system.poses)}
    if np.isfinite(c.left_out_rms_mm):
        errors["left out"] = _by_pose(c.left_out, system.pose, system.component, system.poses)
    if c.holdout is not None:
        h = c.holdout
        # Labels of the two tables may be the same for different poses.
        labels = [f"{label} (held out)" for label in h.system.poses]
        errors["held out"] = _by_pose(h.error, h.system.pose, h.system.component, labels)
    return errors


def _by_pose(error: Array, pose: Integers, component: Integers, labels: Sequence[str]) -> dict[str, float]:
    known = ~np.isnan(error)
    return {label: rms_mm(error[(pose == k) & known], component[(pose == k) & known]) for k, label in enumerate(labels)}


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
    return Section("The readings", tuple(blocks))


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
