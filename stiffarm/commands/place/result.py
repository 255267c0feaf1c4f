"""What a placement answers: where the base should stand, what that gains, how axes and joints move, what to know."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from fem.arm import Arm
from machining.cell import ArmBodies, clearance
from machining.cutting import Estimated
from machining.placement import Along, Look, Problem, Survey, axis_rates, placement_content
from machining.placement.between import placement_of
from machining.placement.freedom import STOPPED_BY
from machining.placement.search import COARSE_ROWS, stop_words
from machining.placement.study import PlacedStep
from machining.posture.posing import CHOSEN
from robots import Remark
from robots.arrays import Array
from robots.files.csv_text import columns_parts
from robots.quantities import Quantity, angle, change, length, stiffness, stored
from stiffarm.commands.posture.course import (
    ERROR_SD,
    GAMMA,
    PATH_LENGTH,
    angles_text,
    course_values,
    joints_drawing,
    prefixed,
)
from stiffarm.pages.arm_uncertainty import ERROR, error_remarks, figure, sentence, share_remarks, spread
from stiffarm.pages.arm_uncertainty import payload as arm_uncertainty
from stiffarm.pages.report import Bullets, KeyFigure, Section, Text
from stiffarm.path_request import path_remarks
from stiffarm.result import Drawing, Result, Table
from stiffarm.session.console import progress
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.stated import stated_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Every placement's error is drawn with the same arms and forces.
SEED: Final = 0
FIXED, STAYING, BEFORE = "best position at rest", "present place, best gamma", "as it stands"
MEANINGS: Final = {
    CHOSEN: "the best placement in the chosen mode",
    FIXED: "the best single position of the base, with the best single gamma",
    STAYING: "the base where it is now, with the best single gamma there",
    BEFORE: "the linear axes at 0 (mid-range where 0 is out of their limits), gamma 0",
}
# What the aim is called.
AIM_WORDS: Final = {
    "ksf": "the stiffness criterion K_sf",
    "mean": "the mean stiffness along the cutting force",
    "worst": "the stiffness of the softest point along the cutting force",
    "error": "the RMS of the surface error",
}
# Changes smaller than this share are not worth moving a base.
WORTHWHILE: Final = 0.02
# Distance (m) beyond the clearance to keep within which the pair that is too near is looked for.
BEYOND: Final = 1e-3
POSITIONS: Final = "positions.csv"
ALONG: Final = stiffness("stiffness", "stiffness along the force")
WORST: Final = stiffness("worst_stiffness", "softest point")
MEAN: Final = stiffness("mean_stiffness", "mean")
RMS: Final = length("rms_error", "RMS error", "um")
WORST_ERROR: Final = length("worst_error", "worst error", "um")
K_SF: Final = Quantity("K_sf")
TURNTABLE: Final = angle("turntable")
ALONG_CAPTION: Final = (
    "Above: force over displacement along the cutting force. Below: the error that it leaves on the surface, more than "
    "0 is material left; static, of the arm and its axes only."
)


def named(step: PlacedStep) -> dict[str, Along]:
    """The placements to compare, by what they are called; the recommended one first."""
    placed = step.placed
    found = {CHOSEN: placed.after, FIXED: placed.fixed, STAYING: placed.staying, BEFORE: placed.before}
    return {name: one for name, one in found.items() if one is not None}


def result(arm: Arm, step: PlacedStep, bodies: ArmBodies) -> Result:
    """The result of `place`."""
    title = arm.description.title.split(" (")[0]

    def more(folder: OutputFolder) -> Mapping[str, Any]:
        from stiffarm.commands.posture.axes_page import NAME, axes_page, placement_study

        with progress("map of positions"):
            folder.write_parts(POSITIONS, columns_parts(positions_table(step.map).columns()))
        study = placement_study(step, bodies)
        if study is not None:
            folder.write_text(NAME, axes_page(study, f"{title} in cell {step.cell.name}"))
        return {}

    return Result(
        name="placement",
        title=title,
        question="where should the robot stand?",
        answer=_answer(step),
        how_sure=_how_sure(step),
        what_next="Write the program for this place with `stiffarm post ... --placement` and placement.json, then "
        "check it with `stiffarm verify` before the cell moves. axes.html lets you drag gamma along the path at this "
        "place.",
        facts=_facts(step) | stated_table(arm.model),
        tables=(_points(step), _placements(step), _criterion(step), *_pieces(step), *_rates(step)),
        drawings=tuple(_drawings(step)),
        key=tuple(_key(step)),
        sections=_sections(step),
        remarks=(*path_remarks(arm, None, step.given.notes), *remarks(step)),
        arm=arm,
        found=step,
        more=more,
    )


def _facts(step: PlacedStep) -> dict[str, Any]:
    placed, problem, after = step.placed, step.placed.problem, step.placed.after
    space, not_found = problem.space, {BEFORE: placed.why_no_before, STAYING: placed.why_no_staying}
    not_found[FIXED] = placed.why_no_fixed
    content = placement_content(placement_of(problem, step.given, after.e, after.table, after.course, step.rapid))
    del content["schema"]
    axes = zip(space.names, space.units, space.shown, space.lower, space.upper, strict=True)
    return content | {
        "between_cuts_undriven": step.undriven,
        "aim": problem.goal.aim,
        "mode": placed.how.mode,
        "by_length": problem.goal.by_length,
        **stored(
            {
                Quantity("alpha", "mm2/N2"): after.criterion.alpha,
                Quantity("beta", "mm4/N4"): after.criterion.beta,
                PATH_LENGTH: problem.path.arc_length[-1],
            }
        ),
        "path_points": problem.path.n,
        "ranges": {
            name: stored({Quantity("from", unit, f): low, Quantity("to", unit, f): high})
            for name, unit, f, low, high in axes
        },
        "base_positions_looked_at": placed.evaluations,
        "pieces_start_at_point": placed.first.tolist(),
        "stiffness_uncertainty": arm_uncertainty(problem.uncertainty),
        "not_found": {name: why for name, why in not_found.items() if why is not None},
    }


def _points(step: PlacedStep) -> Table:
    """Where base, joints and tool are at the path's points, stiffness and error, and the same of the others."""
    given, after = step.given, step.placed.after
    values = {replace(length(f"e{j + 1}"), stored=9): column for j, column in enumerate(after.e.T)}
    values |= {TURNTABLE: np.full(given.path.n, after.table)}
    values |= course_values(step.placed.problem.model.robot, given.path, after.course)
    for name, one in named(step).items():
        values |= {prefixed(name, ALONG): one.stiffness, prefixed(name, ERROR): one.error.normal}
    labels = {
        "point": [str(k) for k in range(given.path.n)],
        "move": [str(k) for k in given.moves],
        "branch": [after.course.names[b] for b in after.course.branch],
    }
    return Table("path", "Points of the path", labels, values | {ERROR_SD: after.error.sd}, only_in="csv")


def _placements(step: PlacedStep) -> Table:
    """What is recommended beside the other placements."""
    some = list(named(step).values())
    after, errors = some[0], [one.error.estimated(np.random.default_rng(SEED)) for one in some]
    along = [one.estimated() for one in some]
    of_itself = Estimated(np.nan, np.nan, np.nan)
    shown = spread(
        {
            WORST: [one["worst"] for one in along],
            MEAN: [one["mean"] for one in along],
            RMS: [one["rms"] for one in errors],
            WORST_ERROR: [one["worst"] for one in errors],
        }
    )
    others = spread(
        {
            K_SF: [one["K_sf"] for one in along],
            Quantity("gain"): [of_itself, *(after.gain(one) for one in some[1:])],
            Quantity("gain_of_worst"): [of_itself, *(after.gain(one, "worst") for one in some[1:])],
        }
    )
    return Table(
        "placements",
        f"{step.given.path.n} points, {PATH_LENGTH.text(step.given.path.arc_length[-1], unit=True)}; "
        f"{step.placed.evaluations} base positions",
        {
            "placement": list(named(step)),
            "base": [where_words(step, one) for one in some],
            "gamma": [angles_text(one.course.gamma) for one in some],
        },
        shown["values"],
        shown["intervals"] | others["intervals"],
        {
            **others["values"],
            TURNTABLE: np.array([one.table for one in some]),
            angle("gamma_from"): np.array([one.course.gamma.min() for one in some]),
            angle("gamma_to"): np.array([one.course.gamma.max() for one in some]),
            angle("joint_travel"): np.array([np.abs(np.diff(one.course.q, axis=0)).sum() for one in some]),
        },
        {
            "axes_mm": [
                {
                    axis.name: length("at").stored_values((column.min(), column.max()))
                    for axis, column in zip(step.cell.linear_axes, one.e.T, strict=True)
                }
                for one in some
            ]
        },
    )


def _criterion(step: PlacedStep) -> Table:
    """K_sf of the placements, which ranks positions for one task and says nothing across tasks."""
    some = list(named(step).values())
    return Table(
        "criterion",
        "The criterion K_sf, which ranks positions for this task",
        {"placement": list(named(step))},
        {
            K_SF: np.array([one.k_sf for one in some]),
            Quantity("K_sf_squares", label="alpha sum k²"): np.array([float(one.terms.squares) for one in some]),
            Quantity("K_sf_mean", label="beta (mean k)⁴"): np.array([float(one.terms.mean) for one in some]),
        },
        folded=True,
    )


def _pieces(step: PlacedStep) -> list[Table]:
    """The pieces of the path where the base stands still; none where it is one."""
    placed, arc = step.placed, step.given.path.arc_length
    if len(placed.first) < 2:
        return []
    rows = list(zip(placed.first, [*placed.first[1:], placed.problem.path.n], strict=True))
    first, last = (np.array(some) for some in zip(*((a, b - 1) for a, b in rows), strict=True))
    return [
        Table(
            "pieces",
            "Pieces of the path",
            {"points": [f"{a} to {b - 1}" for a, b in rows]},
            {
                length("from"): arc[first],
                length("to"): arc[last],
                **{length(axis.name): placed.after.e[first, k] for k, axis in enumerate(step.cell.linear_axes)},
                GAMMA: np.array([placed.after.course.gamma[a:b].mean() for a, b in rows]),
                MEAN: np.array([placed.after.stiffness[a:b].mean() for a, b in rows]),
            },
        )
    ]


def _rates(step: PlacedStep) -> list[Table]:
    """Peak speed and acceleration of the axes that move along the path, NaN without a feed."""
    problem = step.placed.problem
    x = step.placed.after.e[:, list(problem.space.free)]
    if step.placed.how.mode != "moving" or not x.shape[1]:
        return []
    columns = [
        np.array([np.abs(column[np.isfinite(column)]).max(initial=-1.0) for column in rates.T])
        for rates in axis_rates(problem, x)
    ]
    names = (Quantity("peak_speed", "mm/s", 1e3, "peak"), Quantity("peak_acceleration", "mm/s2", 1e3, "peak"))
    values = {name: np.where(column < 0.0, np.nan, column) for name, column in zip(names, columns, strict=True)}
    axes = {"axis": problem.space.names[: x.shape[1]]}
    return [Table("axis_rates", "Linear axes at the path's feed", axes, values)]


def _answer(step: PlacedStep) -> str:
    """Where the base should stand and what that is worth."""
    after, placed = step.placed.after, step.placed
    worst = figure(WORST, after.estimated()["worst"], "").value
    then = f"the softest point of the path then has {worst} along the cutting force"
    if placed.problem.goal.minimised:
        then = f"the predicted surface error is then {RMS.text(after.error_rms, unit=True)} RMS"
    lead = "Let the base move over" if placed.how.mode == "moving" else "Put the base at"
    out = f"{lead} {where_words(step, after)} with gamma {angles_text(after.course.gamma)}: {then}."
    if placed.staying is not None:
        out += f" {_against(after, placed.staying, placed.problem.goal.minimised)}"
    elif placed.why_no_staying is not None:
        out += " From where it stands now, the arm cannot follow the whole path at any gamma."
    where = f", cell {step.cell.name}" if step.cell.name != "cell" else ""
    path = step.given.path
    return f"{out} Path of {path.n} points, {PATH_LENGTH.text(path.arc_length[-1], unit=True)}{where}."


def _against(after: Along, now: Along, by_error: bool) -> str:
    """The error, or the softest point and the mean, against the present place with its best gamma."""
    if by_error:
        factors = [after.error_rms / now.error_rms]
        gains = f"the error by {change(factors[0])}"
    else:
        factors = [after.gain(now, "worst").value, after.gain(now).value]
        gains = f"{change(factors[0])} at the softest point, {change(factors[1])} on average"
    gamma = angles_text(now.course.gamma)
    if max(abs(factor - 1.0) for factor in factors) < WORTHWHILE:
        return f"Its present place is as good, with gamma {gamma}: moving the base changes {gains}."
    verb = "changes" if by_error else "is"
    return f"Compared with its present place and the best gamma there ({gamma}) that {verb} {gains}."


def _how_sure(step: PlacedStep) -> str:
    """How far the figures can be trusted."""
    looked = "Collisions are checked at the points of the path." if step.placed.problem.scene is not None else ""
    rests = sentence(step.placed.problem.uncertainty)
    return f"{rests} Static stiffness of the arm and its axes only. {looked}".strip()


def _key(step: PlacedStep) -> list[KeyFigure]:
    after, placed = step.placed.after, step.placed
    found = after.estimated()
    at = PATH_LENGTH.text(step.given.path.arc_length[int(after.stiffness.argmin())], unit=True)
    out = [
        figure(WORST, found["worst"], f"softest point of the path, along the cutting force, at {at}"),
        KeyFigure(where_words(step, after), "where the base should stand"),
        KeyFigure(angles_text(after.course.gamma), "gamma there, the angle about the tool axis"),
    ]
    now = next(((n, one) for n, one in ((STAYING, placed.staying), (BEFORE, placed.before)) if one is not None), None)
    if now is None:
        out.append(KeyFigure("not at all", "can the arm follow the path from where the robot stands now"))
    else:
        gain = after.gain(now[1], "worst")
        ends = [change(v) for v in (gain.low, gain.high)]
        interval = "" if ends[0] == ends[1] else f"95 %: {ends[0]} to {ends[1]}"
        out.append(KeyFigure(change(gain.value), f"stiffness of the softest point, compared with: {now[0]}", interval))
    error = after.error.estimated(np.random.default_rng(SEED))["rms"]
    return [
        *out,
        figure(MEAN, found["mean"], "mean stiffness along the cutting force"),
        figure(RMS, error, "RMS of the predicted surface error"),
    ]


def where_words(step: PlacedStep, one: Along) -> str:
    """Where the base stands, or between which places it moves, to 0.1 mm."""
    out = []
    for axis, column in zip(step.cell.linear_axes, 1e3 * one.e.T, strict=True):
        ends = (column[0],) if np.ptp(column) < 1e-6 else (column.min(), column.max())
        out.append(f"{axis.name} {' to '.join(f'{round(v, 1) + 0.0:.1f}'.removesuffix('.0') for v in ends)}")
    words = f"{', '.join(out)} mm" if out else ""
    if step.cell.turntable is not None:
        words += f"{'; ' if words else ''}turntable {TURNTABLE.text(one.table, unit=True)}"
    return words


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


def _sections(step: PlacedStep) -> tuple[Section, ...]:
    placed, model = step.placed, step.placed.problem.model
    space, criterion = placed.problem.space, placed.after.criterion
    ranges = f"{space.words(np.asarray(space.lower))} to {space.words(np.asarray(space.upper))}"
    return (
        Section("What the placements are", (Bullets(tuple(f"{name}: {MEANINGS[name]}." for name in named(step))),)),
        Section(
            "How it was found",
            (
                Text(
                    f"Aim: {AIM_WORDS[placed.problem.goal.aim]}; base: {placed.how.mode}. Base positions from "
                    f"{ranges}; {placed.evaluations} of them were evaluated, each over the path with "
                    f"{len(placed.problem.angles)} angles gamma and all branches. A coarse grid, its best basins by "
                    "pattern search; steps and motion along the path by dynamic programming on a grid, then finer "
                    "about the result."
                ),
                Bullets(
                    (
                        f"Model: {model.link_kind} links, {model.load_path} load path, unloaded arm; compliance of "
                        "linear axes acts at the base's origin, where the cell file gives one.",
                        "Static stiffness only: chatter, servo lag and the tool's own bending are not in it.",
                        "Collisions between path points and between base positions are not checked.",
                        "K_sf = alpha sum k² + beta (mean k)⁴, k the directional stiffness along the cutting force; "
                        f"alpha {criterion.alpha:.3g} mm²/N², beta {criterion.beta:.3g} mm⁴/N⁴. The published "
                        "criterion gives no weights; by default they make both terms 1 at the largest mean stiffness "
                        "of the coarse grid, so K_sf of two tasks cannot be compared.",
                    )
                ),
            ),
            folded=True,
        ),
    )


def _drawings(step: PlacedStep) -> list[Drawing]:
    """Pictures: what positions are worth, stiffness and error along the path, axes and joints."""
    cell = step.cell
    out = [
        Drawing("positions", caption_of(step.placed.survey), "what positions are worth", partial(_positions, step)),
        Drawing("along", ALONG_CAPTION, "stiffness and error along the path", partial(_along, step)),
    ]
    if cell.linear_axes:
        caption = "Where the linear axes stand. Shaded: beyond their limits."
        out.append(Drawing("axes", caption, "linear axes along the path", partial(_axes, step)))
    joints = {name: one.course.q for name, one in named(step).items()}
    return [*out, joints_drawing(step.given.path.arc_length, joints, step.placed.problem.model.robot)]


def _along(step: PlacedStep) -> Figure:
    from stiffarm.commands.place.figures import along_figure

    return along_figure(named(step))


def _axes(step: PlacedStep) -> Figure:
    from stiffarm.commands.posture.figures.along_path import motion_figure

    axes = step.cell.linear_axes
    return motion_figure(
        1e3 * step.given.path.arc_length,
        {CHOSEN: 1e3 * step.placed.after.e},
        [f"{axis.name} (mm)" for axis in axes],
        1e3 * np.array([axis.limits for axis in axes]),
        "Linear axes along the path",
        whole=True,
    )


def _positions(step: PlacedStep) -> Figure:
    """Curve or map of what positions are worth; of three coordinates or more the best over those that are not drawn."""
    from stiffarm.commands.place.figures import curve_figure, map_figure

    space, grid = step.placed.problem.space, step.map
    values = {quantity.name: quantity.factor * value for quantity, value in position_values(grid).items()}
    label = next(iter(position_values(grid))).unit
    label = (
        f"predicted surface error, {label}" if grid.problem.goal.minimised else f"stiffness along the force, {label}"
    )
    why = [look.why for look in grid.grid]
    labels = tuple(f"{name}, {unit}" for name, unit in zip(space.names, space.units, strict=True))
    lines = [
        np.linspace(a, b, n) * f for a, b, n, f in zip(space.lower, space.upper, grid.counts, space.shown, strict=True)
    ]
    # Placements that are one position can be marked.
    still = {name: one for name, one in named(step).items() if not np.ptp(one.e, axis=0).any()}
    spots = {name: space.coordinates(one.e.mean(axis=0), one.table) * space.shown for name, one in still.items()}
    if space.d == 1:
        marks = {name: float(spot[0]) for name, spot in spots.items()}
        return curve_figure(lines[0], values, why, labels[0], label, marks)
    shape = (grid.counts[0], grid.counts[1], -1)
    best = np.array([look.merit for look in grid.grid]).reshape(shape).argmax(axis=2)[..., None]
    name, value = next(iter(values.items()))
    flat = np.take_along_axis(value.reshape(shape), best, axis=2)[..., 0]
    reasons = np.take_along_axis(np.array(why, dtype=object).reshape(shape), best, axis=2)[..., 0]
    pairs = {name: (float(spot[0]), float(spot[1])) for name, spot in spots.items()}
    axis = f"{name}, {label.split(', ')[-1]}"
    return map_figure(lines[0], lines[1], flat, reasons.ravel().tolist(), (labels[0], labels[1]), axis, pairs)


def position_values(grid: Survey) -> dict[Quantity, Array]:
    """What each position looked at is worth (p,), NaN where none is."""
    problem = grid.problem
    share = problem.share_of(problem.sure_rows(COARSE_ROWS))
    looks = [look.values for look in grid.grid]

    def each(of: Callable[[Array], float]) -> Array:
        return np.array([np.nan if values is None else of(values) for values in looks])

    if problem.goal.minimised:
        return {RMS: each(lambda v: float(np.sqrt(v**2 @ share)))}
    return {WORST: each(lambda v: float(v.min())), MEAN: each(lambda v: float(v @ share))}


def caption_of(grid: Survey) -> str:
    """What the picture of positions shows, and what a shaded position means."""
    space, rows = grid.problem.space, len(grid.problem.sure_rows(COARSE_ROWS))
    worth = f"What the base's positions are worth, each at rest with its best gamma, on {rows} points of the path."
    best = f" The best over {', '.join(space.names[2:])}." if space.d > 2 else ""
    if not grid.angles:
        return f"{worth} Shaded: no posture was found that takes the whole path, and what stops the nearest.{best}"
    moves = "" if grid.problem.links is None else " and at the moves between its cuts"
    angles = f"none of {grid.angles} angles gamma, and of more about the nearest, takes"
    if grid.angles == 1:
        angles = "the one angle gamma does not take"
    return (
        f"{worth} Open positions are free at all points of the path{moves}. Shaded: {angles} the whole path with any "
        f"branch, and what stops the posture that comes nearest; {POSITIONS} names it.{best}"
    )


def why_words(problem: Problem, look: Look) -> str:
    """What stops the posture of a position that comes nearest, and where."""
    stopped = look.stopped
    if stopped is None:
        return look.shortfall.words if look.shortfall is not None else ""
    if stopped.why:
        return stop_words(look)
    where = f"at point {stopped.point} with gamma {GAMMA.text(stopped.gamma, unit=True)}"
    scenes = problem.by_scene(np.array([stopped.point]))
    if look.why != "collision" or not scenes:
        return f"near a singularity {where}"
    e, table = problem.space.sites(look.x[None])
    pair = clearance(scenes[0][1], stopped.q[None], e, table, within=problem.clearance + BEYOND).nearest(0)
    return f"collision {where}" if pair is None else f"{pair[0]} and {pair[1]} too near {where}"


def positions_table(grid: Survey) -> Table:
    """The positions of the picture: where, the best gamma, its worth; or what stops it, and where."""
    space = grid.problem.space
    places = zip(space.names, space.units, space.shown, np.array([look.x for look in grid.grid]).T, strict=True)
    return Table(
        "positions",
        "Base positions",
        {
            "stopped_by": [STOPPED_BY[look.why] if look.why else "" for look in grid.grid],
            "nearest_posture": [why_words(grid.problem, look) if look.why else "" for look in grid.grid],
        },
        {Quantity(name, unit, factor, stored=9): x for name, unit, factor, x in places}
        | {GAMMA: np.array([np.nan if look.why else look.gamma for look in grid.grid])}
        | position_values(grid),
    )
