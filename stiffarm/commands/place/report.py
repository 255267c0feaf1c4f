"""report.html of a placement: where the base should stand, what that gains, how axes and joints move, what to know."""

from __future__ import annotations

import numpy as np

from machining.cutting import Estimated
from machining.placement import Along
from machining.placement.study import PlacedStep
from robots import Remark
from robots.quantities import known_to, ranged, significant, with_interval
from stiffarm.commands.place.figures import along_figure
from stiffarm.commands.place.payload import BEFORE, CHOSEN, FIXED, SEED, STAYING, named, peak_rates
from stiffarm.commands.place.positions import position_picture, position_values
from stiffarm.commands.posture.figures.along_path import joints_picture, motion_figure
from stiffarm.pages.arm_uncertainty import error_remarks, sentence, share_remarks
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import (
    Answer,
    Block,
    Bullets,
    Fold,
    KeyFigure,
    Note,
    Picture,
    Section,
    Table,
    Text,
    write_page,
)
from stiffarm.session.outputs import OutputFolder

# What the aim is called.
AIM_WORDS = {
    "ksf": "the stiffness criterion K_sf",
    "mean": "the mean stiffness along the cutting force",
    "worst": "the stiffness of the softest point along the cutting force",
    "error": "the RMS of the surface error",
}
# Changes smaller than this share are not worth moving a base.
WORTHWHILE = 0.02
MEANINGS = {
    CHOSEN: "the best placement in the chosen mode",
    FIXED: "the best single position of the base, with the best single gamma",
    STAYING: "the base where it is now, with the best single gamma there",
    BEFORE: "the linear axes at 0 (mid-range where 0 is out of their limits), gamma 0",
}


def write_report(step: PlacedStep, title: str, folder: OutputFolder) -> None:
    """Draw the figures and write report.html."""
    pictures = Pictures(folder)
    position = position_picture(step, pictures)
    sections = [
        result_section(step),
        along_section(step, pictures),
        motion_section(step, pictures),
        how_section(step),
    ]
    missing = [text for text in remarks(step) if "not checked" in text]
    answer = Answer(sure=sure_words(step), todo=TODO + other_aim_words(step), picture=position, warnings=tuple(missing))
    write_page(folder, title, lede(step), _key_figures(step), sections, "where should the robot stand?", answer=answer)


TODO = (
    "Write the program for this place with `stiffarm post ... --placement` and placement.json, then check it with "
    "`stiffarm verify` before the cell moves. axes.html lets you drag gamma along the path at this place."
)


def lede(step: PlacedStep) -> str:
    """Where the base should stand and what that is worth, in two sentences."""
    after, placed = step.placed.after, step.placed
    then = f"the softest point of the path then has {_stiffness(after.estimated()['worst'])} along the cutting force"
    if placed.problem.goal.minimised:
        then = f"the predicted surface error is then {significant(after.error_rms * 1e6)} um RMS"
    out = f"Put the base at {where_words(step, after)} with gamma {gamma_words(after)}: {then}."
    if step.placed.how.mode == "moving":
        out = out.replace("Put the base at", "Let the base move over")
    if placed.staying is not None:
        out += f" {_against(after, placed.staying, placed.problem.goal.minimised)}"
    elif placed.why_no_staying is not None:
        out += " From where it stands now, the arm cannot follow the whole path at any gamma."
    path, where = step.given.path, f", cell {step.cell.name}" if step.cell.name != "cell" else ""
    return f"{out} Path of {path.n} points, {significant(1e3 * path.arc_length[-1])} mm{where}."


def _against(after: Along, now: Along, by_error: bool) -> str:
    """The error, or the softest point and the mean, against the present place with its best gamma."""
    if by_error:
        factors = [after.error_rms / now.error_rms]
        gains = f"the error by {percent_more(factors[0])}"
    else:
        factors = [after.gain(now, "worst").value, after.gain(now).value]
        gains = f"{percent_more(factors[0])} at the softest point, {percent_more(factors[1])} on average"
    if max(abs(factor - 1.0) for factor in factors) < WORTHWHILE:
        return f"Its present place is as good, with gamma {gamma_words(now)}: moving the base changes {gains}."
    there = f"its present place and the best gamma there ({gamma_words(now)})"
    if by_error:
        return f"Compared with {there} that changes {gains}."
    return f"Compared with {there} that is {gains}."


def percent_more(factor: float) -> str:
    """A factor as a change, as in "+12 %"."""
    change = 100.0 * (factor - 1.0)
    return f"{change:+.0f} %" if abs(change) >= 9.5 else f"{change:+.1f} %"


def other_aim_words(step: PlacedStep) -> str:
    """Where the softest point would be stiffer, if another aim decides where to stand."""
    values, _ = position_values(step.map)
    worst, goal = values.get("softest point"), step.placed.problem.goal
    if worst is None or goal.aim == "worst" or not np.isfinite(worst).any():
        return ""
    best = int(np.nanargmax(worst))
    if worst[best] < (1.0 + 2.0 * WORTHWHILE) * step.placed.after.worst * 1e-3:
        return ""
    where = step.placed.problem.space.words(step.map.grid[best].x)
    return (
        f" The target was {AIM_WORDS[goal.aim]}; if the softest point decides, `--aim worst` does better: about "
        f"{significant(worst[best])} N/mm near {where}."
    )


def sure_words(step: PlacedStep) -> str:
    """How far the figures can be trusted."""
    collisions = step.placed.problem.scene is not None
    looked = "Collisions are checked at the points of the path." if collisions else ""
    return (
        f"{sentence(step.placed.problem.uncertainty)} Static stiffness of the arm and its axes only. {looked}".strip()
    )


def gamma_words(one: Along) -> str:
    """The angle gamma, or its range, in deg."""
    low, high = np.degrees([one.course.gamma.min(), one.course.gamma.max()])
    return f"{low:.4g} deg" if high - low < 1e-6 else f"{low:.4g} to {high:.4g} deg"


def _key_figures(step: PlacedStep) -> list[KeyFigure]:
    after, placed = step.placed.after, step.placed
    found = after.estimated()
    at = 1e3 * step.given.path.arc_length[int(after.stiffness.argmin())]
    out = [
        KeyFigure(
            _stiffness(found["worst"]),
            f"softest point of the path, along the cutting force, at {significant(at)} mm",
            _span(after, "worst"),
        ),
        KeyFigure(where_words(step, after), "where the base should stand"),
        KeyFigure(gamma_words(after), "gamma there, the angle about the tool axis"),
    ]
    now = next((pair for pair in ((STAYING, placed.staying), (BEFORE, placed.before)) if pair[1] is not None), None)
    if now is None or now[1] is None:
        out.append(KeyFigure("not at all", "can the arm follow the path from where the robot stands now"))
    else:
        gain = after.gain(now[1], "worst")
        ends = [percent_more(v) for v in (gain.low, gain.high)]
        interval = "" if ends[0] == ends[1] else f"95 %: {ends[0]} to {ends[1]}"
        out.append(
            KeyFigure(percent_more(gain.value), f"stiffness of the softest point, compared with: {now[0]}", interval)
        )
    error = after.error.estimated(np.random.default_rng(SEED))["rms"]
    return [
        *out,
        KeyFigure(_stiffness(found["mean"]), "mean stiffness along the cutting force", _span(after, "mean")),
        KeyFigure(
            f"{significant(error.value * 1e6)} um",
            "RMS of the predicted surface error",
            f"95 %: {ranged(error.low * 1e6, error.high * 1e6, 'um')}",
        ),
    ]


def _stiffness(found: Estimated) -> str:
    return f"{known_to(found.value * 1e-3, found.low * 1e-3, found.high * 1e-3)} N/mm"


def _span(one: Along, statistic: str) -> str:
    """95 % interval of the mean or worst stiffness, N/mm."""
    found = one.estimated()[statistic]
    return f"95 %: {ranged(found.low * 1e-3, found.high * 1e-3, 'N/mm', 3)}"


def table_rows(step: PlacedStep) -> list[tuple[str, ...]]:
    """One row a placement: what the result's table says."""
    rows: list[tuple[str, ...]] = []
    for name, one in named(step).items():
        statistics = one.error.statistics()
        rows.append(
            (
                name,
                where_words(step, one),
                gamma_words(one).removesuffix(" deg"),
                _within(one, "worst"),
                _within(one, "mean"),
                significant(statistics["rms"] * 1e6),
                significant(statistics["worst"] * 1e6),
            )
        )
    return rows


COLUMNS = (
    "placement",
    "base",
    "gamma, deg",
    "softest point, N/mm",
    "mean, N/mm",
    "RMS error, um",
    "worst error, um",
)


def _within(one: Along, statistic: str) -> str:
    found = one.estimated()[statistic]
    return with_interval(1e-3 * found.value, 1e-3 * found.low, 1e-3 * found.high, 4)


def _mm(value: float) -> str:
    """A position in mm, to 0.1 mm where it has that."""
    return f"{round(value, 1) + 0.0:.1f}".removesuffix(".0")


def where_words(step: PlacedStep, one: Along) -> str:
    """Where the base stands, in words."""
    out = []
    for axis, column in zip(step.cell.linear_axes, one.e.T * 1e3, strict=True):
        still = np.ptp(column) < 1e-6
        out.append(
            f"{axis.name} {_mm(column[0])}" if still else f"{axis.name} {_mm(column.min())} to {_mm(column.max())}"
        )
    words = ", ".join(out) + " mm" if out else ""
    if step.cell.turntable is not None:
        words += f"{'; ' if words else ''}turntable {np.degrees(one.table):.4g} deg"
    return words


def result_section(step: PlacedStep) -> Section:
    """What is recommended beside the other placements."""
    names = tuple(named(step))
    caption = "Placements; in brackets 95 % intervals"
    blocks: list[Block] = [
        Table(caption, COLUMNS, tuple(table_rows(step)), text_columns=(0, 1), best=0),
        Bullets(tuple(f"{name}: {MEANINGS[name]}." for name in names)),
    ]
    if len(step.placed.first) > 1:
        blocks.append(_pieces(step))
    blocks += [Note(text) for text in remarks(step)]
    return Section("Where to stand", (*blocks, criterion_fold(step)))


def criterion_fold(step: PlacedStep) -> Fold:
    """K_sf of the placements, which ranks positions for one task and says nothing across tasks."""
    criterion = step.placed.after.criterion
    rows = tuple(
        (name, f"{one.k_sf:.4g}", f"{float(one.terms.squares):.3g}", f"{float(one.terms.mean):.3g}")
        for name, one in named(step).items()
    )
    return Fold(
        "The criterion K_sf, which ranks positions for this task",
        (
            Table("K_sf and its two terms", ("placement", "K_sf", "alpha sum k²", "beta (mean k)⁴"), rows),
            Text(
                "K_sf = alpha sum k² + beta (mean k)⁴, k the directional stiffness along the cutting force; alpha "
                f"{criterion.alpha:.3g} mm²/N², beta {criterion.beta:.3g} mm⁴/N⁴. The published criterion gives no "
                "weights; by default they make both terms 1 at the largest mean stiffness of the coarse grid, so "
                "K_sf of two tasks cannot be compared."
            ),
        ),
    )


def _pieces(step: PlacedStep) -> Table:
    placed, arc_mm = step.placed, 1e3 * step.given.path.arc_length
    ends = [*placed.first[1:], placed.problem.path.n]
    rows = []
    for a, b in zip(placed.first, ends, strict=True):
        where = ", ".join(_mm(v) for v in placed.after.e[a] * 1e3)
        gamma = np.degrees(placed.after.course.gamma[a:b])
        rows.append(
            (
                f"{a} to {b - 1}",
                f"{_mm(arc_mm[a])} to {_mm(arc_mm[b - 1])}",
                where,
                f"{gamma.mean():.4g}",
                significant(placed.after.stiffness[a:b].mean() * 1e-3, 4),
            )
        )
    axes = ", ".join(axis.name for axis in step.cell.linear_axes)
    columns = ("points", "path, mm", f"{axes}, mm", "gamma, deg", "mean stiffness, N/mm")
    return Table("Pieces of the path", columns, tuple(rows))


def remarks(step: PlacedStep) -> list[str]:
    """What a user must know about the result."""
    placed = step.placed
    out = list(placed.notes)
    if step.undriven is not None:
        out.append(
            f"Between its cuts the tool path cannot be driven from there, so `stiffarm post` refuses this placement: "
            f"{step.undriven}. Place again with another --range of the axes, --gamma or --aim."
        )
    if step.rapid == "joint":
        out.append("With straight rapid moves the program cannot be driven from there: `post` makes them joint motion.")
    if placed.why_no_before is not None:
        able = ", with another gamma it can" if placed.staying is not None else ""
        out.append(f"With gamma 0 the arm cannot follow the path from its present place{able}: {placed.why_no_before}.")
    if placed.why_no_fixed is not None:
        out.append(f"From no single position can the arm follow the whole path: {placed.why_no_fixed}.")
    if placed.problem.scene is None and not any("Collisions" in note for note in step.notes):
        out.append(Remark("Collisions were not checked.", code="W033"))
    if np.isnan(placed.problem.path.times).any():
        out.append(Remark("Some points have no feed: there speeds and accelerations were not checked.", code="W034"))
    out += share_remarks(placed.after.drawn.matters, "the mean stiffness along the force")
    return [*out, *error_remarks(placed.after.error), *step.notes]


def along_section(step: PlacedStep, pictures: Pictures) -> Section:
    """Stiffness and error along the path, before and after."""
    caption = (
        "Above: force over displacement along the cutting force. Below: the error that it leaves on the surface, more "
        "than 0 is material left; static, of the arm and its axes only."
    )
    return Section("Along the path", (pictures.add(along_figure(named(step)), "along", caption),))


def motion_section(step: PlacedStep, pictures: Pictures) -> Section:
    """How axes and joints move."""
    arc, after, cell = step.given.path.arc_length, step.placed.after, step.cell
    blocks: list[Text | Picture | Table] = []
    if cell.linear_axes:
        figure = motion_figure(
            1e3 * arc,
            {CHOSEN: after.e * 1e3},
            [f"{axis.name} (mm)" for axis in cell.linear_axes],
            1e3 * np.array([axis.limits for axis in cell.linear_axes]),
            "Linear axes along the path",
            whole=True,
        )
        caption = "Where the linear axes stand. Shaded: beyond their limits."
        blocks.append(pictures.add(figure, "axes", caption))
        rows = tuple(
            (name, *(("no feed given",) * 2 if np.isnan(speed) else (f"{speed * 1e3:.3g}", f"{rate * 1e3:.3g}")))
            for name, speed, rate in peak_rates(step)
        )
        if step.placed.how.mode == "moving" and rows:
            blocks.append(Table("Linear axes at the path's feed", ("axis", "peak mm/s", "peak mm/s²"), rows))
    joints = {name: one.course.q for name, one in named(step).items()}
    blocks.append(joints_picture(pictures, arc, joints, step.placed.problem.model.robot))
    return Section("How axes and joints move", tuple(blocks))


def how_section(step: PlacedStep) -> Section:
    """How it was found, and what that leaves out."""
    placed, model = step.placed, step.placed.problem.model
    ranges = ", ".join(
        f"{name} {a * f:.4g} to {b * f:.4g} {unit}"
        for name, unit, f, a, b in zip(
            placed.problem.space.names,
            placed.problem.space.units,
            placed.problem.space.shown,
            placed.problem.space.lower,
            placed.problem.space.upper,
            strict=True,
        )
    )
    aim = AIM_WORDS[placed.problem.goal.aim]
    return Section(
        "How it was found",
        (
            Text(
                f"Aim: {aim}; base: {placed.how.mode}. Base positions in {ranges}; {placed.evaluations} of them "
                f"were evaluated, each over the path with {len(placed.problem.angles)} angles gamma and all "
                "branches. A coarse grid, its best basins by pattern search; steps and motion along the path by "
                "dynamic programming on a grid, then finer about the result."
            ),
            Bullets(
                (
                    f"Model: {model.link_kind} links, {model.load_path} load path, unloaded arm; compliance "
                    "of linear axes acts at the base's origin, where the cell file gives one.",
                    "Static stiffness only: chatter, servo lag and the tool's own bending are not in it.",
                    "Collisions between path points and between base positions are not checked.",
                )
            ),
        ),
        folded=True,
    )
