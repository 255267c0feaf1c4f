"""What the page of a calibration says besides its tables: what is identified, scatter, prediction, readings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from doe.certainty.identifiability import correlations
from doe.certainty.lack_of_fit import outliers
from doe.tables.joined import files_of
from doe.tables.loaded import rms_mm, spring_parts
from robots.arrays import Array, Integers
from robots.quantities import significant
from stiffarm.commands.calibrate import tables, words
from stiffarm.commands.calibrate.step import Calibrated, StageFindings
from stiffarm.pages.report import Block, Bullets, Fold, Note, Section, Table, Text
from stiffarm.session.words.directions import direction_words
from stiffarm.session.words.loads import loads_words
from stiffarm.session.words.noise import scatter_name

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stiffarm.pages.blocks import Pictures

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
    r, told = s.result, told_blocks(c, s)
    if (pairs := _moves_together(s)) is not None:
        told.append(pairs)
    if r.study is not None:
        told.insert(0, Text(f"A parametric study: {r.study.runs} runs in {r.study.rounds} rounds of finer levels."))
    scatter = scatter_name(r.estimate.problem)
    return [
        Section(f"What these readings can and cannot identify{of}", tuple(told)),
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


def told_blocks(c: Calibrated, s: StageFindings) -> list[Block]:
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
