"""The report's sections on studies pose by pose, and on a stage: its numbers, what is told, noise, residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from doe.certainty.identifiability import correlations
from doe.certainty.lack_of_fit import outliers
from doe.tables.loaded import spring_parts
from stiffarm.commands.calibrate import words
from stiffarm.commands.calibrate.figures.identifiability import intervals_figure
from stiffarm.commands.calibrate.figures.laws import laws_figure
from stiffarm.commands.calibrate.figures.residuals import checks_figure, residuals_figure
from stiffarm.commands.calibrate.laws import curves, study_curves
from stiffarm.commands.calibrate.payload import QUANTILES, bootstrap
from stiffarm.commands.calibrate.step import Calibrated, StageFindings
from stiffarm.commands.calibrate.tables import numbers_table, outlier_lines, studies_table
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Block, Bullets, Fold, Note, Picture, Section, Table, Text
from stiffarm.session.words.directions import direction_words
from stiffarm.session.words.noise import scatter_name

_BLIND = 1e-9
# Correlations from this size on are worth a line, and so many of them.
TOGETHER, MOST_PAIRS = 0.5, 10
# So many lines of a list are seen before it is unfolded, of sentences that are no longer than this together.
FEW_LINES, MOST_LETTERS = 3, 600
# More different loads or directions are no groups: loads then make an axis.
MOST_GROUPS = 12
_AXES = ("X", "Y", "Z", "about X", "about Y", "about Z")


def stage_section(c: Calibrated, s: StageFindings, pictures: Pictures, suffix: str) -> list[Section]:
    """Sections of one stage; ``suffix`` keeps the pictures of stages apart."""
    of = "" if not suffix else f", stage {s.result.stage.name}"
    return [
        _numbers(s, pictures, suffix, of),
        _told(c, s, of),
        _noise(c, s, of),
        _residuals(c, s, pictures, suffix, of),
    ]


def study_blocks(c: Calibrated, pictures: Pictures) -> list[Block]:
    """Table, laws and remarks of the studies pose by pose of a calibration."""
    path = c.model.load_path
    caption = (
        f"{path.capitalize()} load path: regression of each spring over its angles. Filled points were calibrated, "
        "hollow ones mirrored, grey ones held at the start value during an earlier stage. Strokes and band: what would "
        "match the readings as well, to within the gauge, with the other springs of the stage free; a law with a point "
        "that nothing matches has no band."
    )
    figure = laws_figure(study_curves(c.found.studies, c.model.robot))
    blocks: list[Block] = [studies_table(c), pictures.add(figure, f"springs_against_angle_{path}", caption)]
    return [*blocks, Bullets(c.remarks)] if c.remarks else blocks


def _numbers(s: StageFindings, pictures: Pictures, suffix: str, of: str) -> Section:
    caption = "95 % intervals. A parameter without a marker stands at its bound: it has no value."
    blocks: list[Block] = [
        pictures.add(intervals_figure({"": s.result.certainty.estimates}), f"intervals{suffix}", caption),
        _folded_if_long(numbers_table(s)),
    ]
    if s.result.study is not None:
        study = s.result.study
        blocks.insert(0, Text(f"A parametric study: {study.runs} runs in {study.rounds} rounds of finer levels."))
    if s.result.laws:
        blocks.append(_laws(s, pictures, suffix))
    if s.drawn is not None:
        blocks.append(_bootstrap(s))
    return Section(f"What was found{of}", tuple(blocks))


def _folded_if_long(table: Table) -> Table:
    return replace(table, folded=len(table.rows) > MOST_GROUPS)


def _laws(s: StageFindings, pictures: Pictures, suffix: str) -> Picture:
    return pictures.add(
        laws_figure(curves(s.result)),
        f"laws{suffix}",
        "Springs over their angles with pointwise 95 % bands; circles: angles read. Dashed: beyond them nothing was "
        "read, and the law goes on as its kind and the prior that keeps it flat say.",
    )


def _bootstrap(s: StageFindings) -> Table:
    drawn, rows = bootstrap(s), []
    for e in s.result.certainty.estimates:
        one, (factor, unit) = drawn[e.parameter.name], words.shown_unit(e.parameter)
        cells = ["not identified"] * len(QUANTILES)
        if one is not None:
            cells = ["at a bound" if v is None else f"{v * factor:.3g}" for v in one["values"]]
        rows.append((e.parameter.name, *cells, unit))
    heads = tuple(f"{q * 100:g} %" for q in QUANTILES)
    return Table(
        f"Bootstrap: quantiles of {drawn['draws_that_tell']} draws of poses with replacement",
        ("number", *heads, "unit"),
        tuple(rows),
        folded=True,
    )


def _told(c: Calibrated, s: StageFindings, of: str) -> Section:
    pairs = _moves_together(s)
    blocks = [*told_blocks(c, s), *([] if pairs is None else [pairs])]
    return Section(f"What these readings can and cannot tell{of}", tuple(blocks))


def told_blocks(c: Calibrated, s: StageFindings) -> list[Block]:
    """Which parameters the readings of a stage determine, which not, and what would help."""
    r = s.result
    blocks: list[Block] = [Bullets((*words.told_and_untold(r.certainty.estimates), *_held(c)))]
    if r.trade_offs:
        first = r.trade_offs[:FEW_LINES] if sum(len(t.words) for t in r.trade_offs[:FEW_LINES]) < MOST_LETTERS else ()
        blocks.append(Note(f"Some parameters are seen only together, in {len(r.trade_offs)} groups."))
        blocks += _with_rest(
            "Groups of parameters that are seen only together", [t.words for t in r.trade_offs], len(first)
        )
    if r.unseen:
        blocks.append(Text(f"No reading depends on {', '.join(r.unseen)}; other loads, directions or poses may."))
    if any(e.status != "determined" for e in r.certainty.estimates):
        blocks.append(Text("`stiffarm plan` chooses the poses, loads and directions that identify the rest best."))
    return blocks


def _with_rest(title: str, lines: Sequence[str], few: int) -> list[Block]:
    """The first few lines, and under a title all of them where there are more."""
    shown: list[Block] = [Bullets(tuple(lines[:few]))] if few else []
    return [*shown, Fold(title, (Bullets(tuple(lines)),))] if len(lines) > few else shown


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
        (f"{names[rows[k]]} and {names[columns[k]]}", f"{correlation[rows[k], columns[k]]:+.2f}") for k in order
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


def _noise(c: Calibrated, s: StageFindings, of: str) -> Section:
    r = s.result
    gauge = c.request.campaign.noise.gauge_mm
    judged, why = words.verdict(r, gauge)
    heading = {"refuted": "The model is refuted. ", "not refuted": "", "not testable": ""}[judged]
    blocks: list[Block] = [
        Table(
            "Standard deviations found",
            ("scatter of", "size"),
            tuple(words.noise_parts(r.estimate.noise, r.estimate.problem)),
            text_columns=(0,),
        ),
        Text(words.setups_text(r, s.independent)),
        Note(why) if heading else Text(why),
        Text(_chi_square(s)),
    ]
    scatter = scatter_name(r.estimate.problem)
    return Section(
        f"{scatter[0].upper()}{scatter[1:]}, and whether the model holds{of}", tuple(b for b in blocks if not _empty(b))
    )


def _empty(block: Block) -> bool:
    return isinstance(block, Text) and not block.text


def _chi_square(s: StageFindings) -> str:
    test = s.result.lack_of_fit
    if test.chi_dof <= 0:
        return ""
    free = np.isnan(s.result.estimate.problem.sigma).any()
    return (
        f"Chi-square of the residuals against this scatter: {test.chi_square:.3g} on {test.chi_dof} degrees of freedom"
        + (" (close to one another by construction, for it was estimated from the same residuals)." if free else ".")
    )


def _residuals(c: Calibrated, s: StageFindings, pictures: Pictures, suffix: str, of: str) -> Section:
    e = s.result.estimate
    p = e.problem
    flagged = np.zeros(len(p), dtype=np.bool_)
    flagged[outliers(e)] = True
    sd = e.noise.spread(p, e.prediction)
    blocks: list[Block] = []
    checks: list[Block] = []
    for kind, unit, name in ((False, "mm", ""), (True, "mrad", "_rotations")):
        mine = (p.component >= 3) == kind
        if not mine.any():
            continue
        groups = {n: [labels[k] for k in np.flatnonzero(mine)] for n, labels in _groups(s).items()}
        groups = {n: labels for n, labels in groups.items() if n == "pose" or len(set(labels)) > 1}
        loads = s.loads_N[mine] if "load" not in groups and np.ptp(s.loads_N[mine]) > 0.0 else None
        figure = residuals_figure(e.residual[mine] * 1e3, unit, groups, flagged[mine], sd[mine] * 1e3, loads)
        caption = "Residuals; the band is twice their standard deviation, black bars are means, diamonds outliers "
        caption += "(triangles: beyond the axis). "
        caption += "A pattern over poses, loads or directions is something the model lacks."
        blocks.append(pictures.add(figure, f"residuals{name}{suffix}", caption))
        measured, predicted = p.value[mine] * 1e3, e.prediction[mine] * 1e3
        figure = checks_figure(predicted, measured, e.own[mine], unit, flagged[mine])
        caption = "Measured against predicted; residuals against predicted; standardised residuals on a normal law."
        checks.append(pictures.add(figure, f"checks{name}{suffix}", caption))
    more = Fold("Measured against predicted, and the distribution of residuals", tuple(checks))
    return Section(f"Residuals and outliers{of}", (*_outliers(c, s), *blocks, more))


def _groups(s: StageFindings) -> dict[str, list[str]]:
    """Labels of each component read, by what it may depend on."""
    p = s.result.estimate.problem
    force = p.free.at.wrench[p.row, :3]
    size = np.linalg.norm(force, axis=1, keepdims=True)
    unit = np.divide(force, size, out=np.zeros_like(force), where=size > 0.0)
    pulls = [direction_words(d) if d.any() else "moment only" for d in np.round(unit, 2)]
    groups = {
        "pose": [p.poses[k] for k in p.pose],
        "load": [f"{v:.3g} N" for v in s.loads_N],
        "direction of the load": pulls,
        "component read": [_AXES[k] for k in p.component],
        "phase": [s.read.phase[row] or "not said" for row in p.row],
    }
    # Too many different loads or directions make no groups.
    return {n: labels for n, labels in groups.items() if n == "pose" or len(set(labels)) <= MOST_GROUPS}


def _outliers(c: Calibrated, s: StageFindings) -> list[Block]:
    lines = outlier_lines(s)
    e = s.result.estimate
    lost = int(np.sum(e.weight < 1.0))
    if not c.request.campaign.noise.robust:
        return [Text("Outliers kept full weight, as asked."), Bullets(tuple(lines))] if lines else []
    if not lines:
        some = f" {lost} of {len(e.problem)} lost some weight." if lost else ""
        return [Text(f"No reading stands out by more than 4 of its standard deviations.{some}")]
    out: list[Block] = [
        Note(f"{len(lines)} of {len(e.problem)} readings stand out and lost weight. Look at them at the robot:"),
        *_with_rest("All readings that stand out", lines, FEW_LINES),
    ]
    moved = words.full_weight_text(s.result, s.full_weight)
    return [*out, Text(moved)] if moved else out
