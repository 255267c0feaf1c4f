"""The report's sections on studies pose by pose, and on a stage: its numbers, what is told, noise, residuals."""

from __future__ import annotations

import numpy as np

from doe.certainty.identifiability import correlations
from doe.certainty.lack_of_fit import outliers
from doe.estimation.estimate import prior_residual, step_sizes
from doe.tables.loaded import spring_parts
from stiffarm.commands.calibrate import words
from stiffarm.commands.calibrate.figures.identifiability import determination_figure, intervals_figure
from stiffarm.commands.calibrate.figures.laws import laws_figure
from stiffarm.commands.calibrate.figures.residuals import checks_figure, residuals_figure
from stiffarm.commands.calibrate.laws import curves, study_curves
from stiffarm.commands.calibrate.payload import QUANTILES, bootstrap
from stiffarm.commands.calibrate.step import Calibrated, StageFindings
from stiffarm.commands.calibrate.tables import numbers_table, outlier_lines, studies_table
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Block, Bullets, Note, Picture, Section, Table, Text
from stiffarm.session.direction_words import direction_words
from stiffarm.session.noise_words import scatter_name

_BLIND = 1e-9
_AXES = ("X", "Y", "Z", "about X", "about Y", "about Z")


def stage_section(c: Calibrated, s: StageFindings, pictures: Pictures, suffix: str) -> list[Section]:
    """Sections of one stage; ``suffix`` keeps the pictures of stages apart."""
    of = "" if not suffix else f", stage {s.result.stage.name}"
    return [
        _numbers(s, pictures, suffix, of),
        _told(c, s, pictures, suffix, of),
        _noise(c, s, of),
        _residuals(c, s, pictures, suffix, of),
    ]


def study_blocks(c: Calibrated, pictures: Pictures) -> list[Block]:
    """Table, laws and remarks of the studies pose by pose of a calibration."""
    path = c.model.load_path
    caption = (
        f"{path.capitalize()} load path: regression of each spring over its angles. Filled points were calibrated, "
        "hollow ones mirrored, grey ones held at the start value during an earlier stage."
    )
    figure = laws_figure(study_curves(c.found.studies, c.model.robot))
    blocks: list[Block] = [studies_table(c), pictures.add(figure, f"springs_against_angle_{path}", caption)]
    return [*blocks, Bullets(c.remarks)] if c.remarks else blocks


def _numbers(s: StageFindings, pictures: Pictures, suffix: str, of: str) -> Section:
    blocks: list[Block] = [
        numbers_table(s),
        pictures.add(
            intervals_figure({"": s.result.certainty.estimates}), f"intervals{suffix}",
            "95 % intervals. A number without a marker stands at its bound or is not determined: it has no value.",
        ),
    ]  # fmt: skip
    if s.result.study is not None:
        study = s.result.study
        blocks.insert(0, Text(f"A parametric study: {study.runs} runs in {study.rounds} rounds of finer levels."))
    if s.result.laws:
        blocks.append(_laws(s, pictures, suffix))
    if s.drawn is not None:
        blocks.append(_bootstrap(s))
    return Section(f"What was found{of}", tuple(blocks))


def _laws(s: StageFindings, pictures: Pictures, suffix: str) -> Picture:
    return pictures.add(
        laws_figure(curves(s.result)), f"laws{suffix}",
        "Springs over their angles with pointwise 95 % bands; circles: angles read. Dashed: beyond them nothing was "
        "read, and the law goes on as its kind and the prior that keeps it flat say.",
    )  # fmt: skip


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
        ("number", *heads, "unit"), tuple(rows), folded=True,
    )  # fmt: skip


def _told(c: Calibrated, s: StageFindings, pictures: Pictures, suffix: str, of: str) -> Section:
    picture = _determination(s, pictures, suffix)
    blocks = [*told_blocks(c, s), *([] if picture is None else [picture])]
    return Section(f"What these readings can and cannot tell{of}", tuple(blocks))


def told_blocks(c: Calibrated, s: StageFindings) -> list[Block]:
    """Which parameters the readings of a stage determine, which not, and what would help."""
    r = s.result
    blocks: list[Block] = [Bullets((*words.told_and_untold(r.certainty.estimates), *_held(c)))]
    if r.trade_offs:
        blocks += [Note("Some numbers are seen only together:"), Bullets(tuple(t.words for t in r.trade_offs))]
    if r.unseen:
        blocks.append(Text(f"No reading moves with {', '.join(r.unseen)}: other loads, directions or poses would."))
    if any(e.status != "determined" for e in r.certainty.estimates):
        blocks.append(Text("`stiffarm plan` names the poses, loads and directions that would tell the rest best."))
    return blocks


def _held(c: Calibrated) -> list[str]:
    """Joint springs that were not set free in any stage, and whether readings would have moved with them."""
    free = {e.parameter.place for s in c.found.stages for e in s.certainty.estimates
            if e.parameter.kind.of_law or e.parameter.spring_of is not None}  # fmt: skip
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


def _determination(s: StageFindings, pictures: Pictures, suffix: str) -> Picture | None:
    e = s.result.estimate
    correlation, _, index = correlations(e)
    if len(index) < 2:
        return None
    A = np.vstack([e.whitened, prior_residual(e.problem, e.u)[1]])[:, index]
    A = A * step_sizes(e.problem)[index]
    _, singular, V = np.linalg.svd(A / np.linalg.norm(A, axis=0), full_matrices=True)
    singular = np.concatenate([singular, np.zeros(len(V) - len(singular))])
    names = [e.problem.parameters[k].name for k in index]
    return pictures.add(
        determination_figure(names, correlation, singular, V), f"determination{suffix}",
        "Left: estimates that move together (of compliances, where a stiffness was estimated). Right: combinations "
        "in order of how well the readings tell them; the last ones are told worst.",
    )  # fmt: skip


def _noise(c: Calibrated, s: StageFindings, of: str) -> Section:
    r = s.result
    gauge = c.request.campaign.noise.gauge_mm
    judged, why = words.verdict(r, gauge)
    heading = {"refuted": "The model is refuted. ", "not refuted": "", "not testable": ""}[judged]
    blocks: list[Block] = [
        Table("Standard deviations found", ("scatter of", "size"),
              tuple(words.noise_parts(r.estimate.noise, r.estimate.problem)), text_columns=(0,)),
        Text(words.setups_text(r, s.independent)),
        Note(why) if heading else Text(why),
        Text(_chi_square(s)),
    ]  # fmt: skip
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
    for kind, unit, name in ((False, "mm", ""), (True, "mrad", "_rotations")):
        mine = (p.component >= 3) == kind
        if not mine.any():
            continue
        groups = {n: [labels[k] for k in np.flatnonzero(mine)] for n, labels in _groups(s).items()}
        groups = {n: labels for n, labels in groups.items() if n == "pose" or len(set(labels)) > 1}
        figure = residuals_figure(e.residual[mine] * 1e3, unit, groups, flagged[mine], sd[mine] * 1e3)
        caption = "Residuals; the band is twice their standard deviation, black bars are means, diamonds outliers "
        caption += "(triangles: beyond the axis). "
        caption += "A pattern over poses, loads or directions is something the model lacks."
        blocks.append(pictures.add(figure, f"residuals{name}{suffix}", caption))
        measured, predicted = p.value[mine] * 1e3, e.prediction[mine] * 1e3
        figure = checks_figure(predicted, measured, e.own[mine], unit, flagged[mine])
        caption = "Measured against predicted; residuals against predicted; standardised residuals on a normal law."
        blocks.append(pictures.add(figure, f"checks{name}{suffix}", caption))
    return Section(f"Residuals and outliers{of}", (*_outliers(c, s), *blocks))


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
    return {n: labels for n, labels in groups.items() if n == "pose" or len(set(labels)) <= 12}


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
        Bullets(tuple(lines)),
    ]
    moved = words.full_weight_text(s.result, s.full_weight)
    return [*out, Text(moved)] if moved else out
