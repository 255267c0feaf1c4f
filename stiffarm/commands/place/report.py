"""report.html of a placement: where the base should stand, what that gains, how axes and joints move, what to know."""

from __future__ import annotations

import numpy as np

from machining.placement import Along, Look
from machining.placement.study import PlacedStep
from stiffarm.commands.place.figures import along_figure, curve_figure, map_figure
from stiffarm.commands.place.payload import BEFORE, CHOSEN, FIXED, named, peak_rates
from stiffarm.commands.posture.figures.along_path import joints_picture, motion_figure
from stiffarm.pages.arm_uncertainty import error_remarks, sentence, share_remarks
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Bullets, KeyFigure, Note, Picture, Section, Table, Text, write_page
from stiffarm.session.outputs import OutputFolder

# Words and factor of the merit that the map shows.
AIM_WORDS = {
    "ksf": ("K_sf", 1.0),
    "mean": ("mean stiffness along the force, N/mm", 1e-3),
    "worst": ("stiffness of the softest point, N/mm", 1e-3),
    "error": ("RMS of the surface error, um", -1e6),
}
MEANINGS = {
    CHOSEN: "what was found in the mode that was asked for",
    FIXED: "the best single position of the base, with the best single gamma",
    BEFORE: "the linear axes at 0 (mid-range where 0 is out of their limits), gamma 0",
}


def write_report(step: PlacedStep, title: str, folder: OutputFolder) -> None:
    """Draw the figures and write report.html."""
    pictures = Pictures(folder)
    sections = [
        result_section(step),
        Section("What other positions are worth", (position_picture(step, pictures),)),
        along_section(step, pictures),
        motion_section(step, pictures),
        how_section(step),
    ]
    path = step.given.path
    lede = (
        f"Path of {path.n} points, {1e3 * path.arc_length[-1]:.4g} mm, in cell {step.cell.name}; aim: "
        f"{AIM_WORDS[step.placed.problem.goal.aim][0].split(',')[0]}; base: {step.placed.how.mode}."
    )
    write_page(folder, title, lede, _key_figures(step), sections, "where should the robot stand?")


def _key_figures(step: PlacedStep) -> list[KeyFigure]:
    after, before = step.placed.after, step.placed.before
    out = [
        KeyFigure(f"{after.k_sf:.4g}", "K_sf"),
        KeyFigure(f"{after.mean * 1e-3:.4g} N/mm", f"mean stiffness along the force (95 %: {_span(after, 'mean')})"),
        KeyFigure(f"{after.error_rms * 1e6:.3g} um", "RMS of the predicted surface error"),
    ]
    if before is not None:
        gain = after.gain(before)
        label = f"mean stiffness against as it stands (95 %: {gain.low:.3g} to {gain.high:.3g})"
        out.append(KeyFigure(f"{gain.value:.3g} x", label))
    return out


def _span(one: Along, statistic: str) -> str:
    """95 % interval of the mean or worst stiffness, N/mm."""
    found = one.estimated()[statistic]
    return f"{found.low * 1e-3:.3g} to {found.high * 1e-3:.3g}"


def table_rows(step: PlacedStep) -> list[tuple[str, ...]]:
    """One row a placement: what the result's table says."""
    rows: list[tuple[str, ...]] = []
    for name, one in named(step).items():
        statistics = one.error.statistics()
        rows.append(
            (
                name,
                where_words(step, one),
                f"{one.k_sf:.4g}",
                f"{float(one.terms.squares):.3g} + {float(one.terms.mean):.3g}",
                f"{one.mean * 1e-3:.4g}",
                _span(one, "mean"),
                f"{one.worst * 1e-3:.4g}",
                f"{statistics['rms'] * 1e6:.3g}",
                f"{statistics['worst'] * 1e6:.3g}",
            )
        )
    return rows


COLUMNS = (
    "placement", "base", "K_sf", "its terms", "mean, N/mm", "95 %", "worst, N/mm", "RMS error, um", "worst error, um",
)  # fmt: skip


def where_words(step: PlacedStep, one: Along) -> str:
    """Where the base stands, in words."""
    out = []
    for axis, column in zip(step.cell.linear_axes, one.e.T * 1e3, strict=True):
        still = np.ptp(column) < 1e-6
        out.append(f"{axis.name} {column[0]:.4g}" if still else f"{axis.name} {column.min():.4g} to {column.max():.4g}")
    words = ", ".join(out) + " mm" if out else ""
    if step.cell.turntable is not None:
        words += f"{'; ' if words else ''}turntable {np.degrees(one.table):.4g} deg"
    return words


def result_section(step: PlacedStep) -> Section:
    """What is recommended beside the other placements."""
    names = tuple(named(step))
    criterion = step.placed.after.criterion
    blocks: list[Text | Note | Table | Bullets] = [
        Table("Placements", COLUMNS, tuple(table_rows(step)), text_columns=(0, 1), best=0),
        Bullets(tuple(f"{name}: {MEANINGS[name]}." for name in names)),
        Text(sentence(step.placed.problem.uncertainty)),
        Text(
            f"K_sf = alpha sum k² + beta (mean k)⁴, k the directional stiffness along the cutting force; alpha "
            f"{criterion.alpha:.3g} mm²/N², beta {criterion.beta:.3g} mm⁴/N⁴. The published criterion gives no "
            "weights; unless they are given, those are taken that make both terms 1 at the largest mean stiffness of "
            "the coarse grid, so K_sf of two tasks cannot be compared."
        ),
    ]
    if len(step.placed.first) > 1:
        blocks.append(_pieces(step))
    blocks += [Note(text) for text in remarks(step)]
    return Section("Where to stand", tuple(blocks))


def _pieces(step: PlacedStep) -> Table:
    placed, arc_mm = step.placed, 1e3 * step.given.path.arc_length
    ends = [*placed.first[1:], placed.problem.path.n]
    rows = []
    for a, b in zip(placed.first, ends, strict=True):
        where = ", ".join(f"{v:.4g}" for v in placed.after.e[a] * 1e3)
        gamma = np.degrees(placed.after.course.gamma[a:b])
        rows.append(
            (f"{a} to {b - 1}", f"{arc_mm[a]:.4g} to {arc_mm[b - 1]:.4g}", where, f"{gamma.mean():.4g}",
             f"{placed.after.stiffness[a:b].mean() * 1e-3:.4g}")
        )  # fmt: skip
    axes = ", ".join(axis.name for axis in step.cell.linear_axes)
    columns = ("points", "path, mm", f"{axes}, mm", "gamma, deg", "mean stiffness, N/mm")
    return Table("Pieces of the path", columns, tuple(rows))


def remarks(step: PlacedStep) -> list[str]:
    """What a user must know about the result."""
    placed = step.placed
    out = list(placed.notes)
    if placed.why_no_before is not None:
        out.append(f"As it stands the path cannot be driven: {placed.why_no_before}.")
    if placed.why_no_fixed is not None:
        out.append(f"No single position takes the whole path: {placed.why_no_fixed}.")
    if placed.problem.scene is None and not any("Collisions" in note for note in step.notes):
        out.append("Collisions were not looked at.")
    if np.isnan(placed.problem.path.times).any():
        out.append("Points without a feed: there no speeds and accelerations were looked at.")
    out += share_remarks(placed.after.drawn.matters, "the mean stiffness along the force")
    return [*out, *error_remarks(placed.after.error), *step.notes]


def position_picture(step: PlacedStep, pictures: Pictures) -> Picture:
    """Curve or map of the goal; of three coordinates or more the best over those that are not drawn."""
    space, grid = step.placed.problem.space, step.map
    words, factor = AIM_WORDS[step.placed.problem.goal.aim]
    value = np.array([look.merit * factor if np.isfinite(look.merit) else np.nan for look in grid.grid])
    why = [zone(look) for look in grid.grid]
    labels = tuple(f"{name}, {unit}" for name, unit in zip(space.names, space.units, strict=True))
    lines = [
        np.linspace(a, b, n) * f for a, b, n, f in zip(space.lower, space.upper, grid.counts, space.shown, strict=True)
    ]
    caption = (
        f"{words.split(',')[0]} of the whole path, the base at rest, each position with its best angle gamma. "
        "Where nothing is drawn, no angle of the grid lets the base stand there for the whole path; an angle between "
        "them may, as where the recommended position stands in such a zone."
    )
    spots = {name: space.coordinates(one.e.mean(axis=0), one.table) * space.shown for name, one in _marked(step)}
    if space.d == 1:
        figure = curve_figure(
            lines[0], value, why, labels[0], words, {name: float(spot[0]) for name, spot in spots.items()}
        )
        return pictures.add(figure, "positions", caption)
    shape = (grid.counts[0], grid.counts[1], -1)
    sign = -1.0 if factor < 0.0 else 1.0
    good = np.where(np.isnan(value), -np.inf, sign * value).reshape(shape)
    best = good.argmax(axis=2)[..., None]
    flat = np.take_along_axis(value.reshape(shape), best, axis=2)[..., 0]
    reasons = np.take_along_axis(np.array(why, dtype=object).reshape(shape), best, axis=2)[..., 0]
    if space.d > 2:
        caption += f" The best over {', '.join(space.names[2:])}."
    figure = map_figure(
        lines[0], lines[1], flat, reasons.ravel().tolist(), (labels[0], labels[1]), words,
        {name: (float(spot[0]), float(spot[1])) for name, spot in spots.items()},
    )  # fmt: skip
    return pictures.add(figure, "positions", caption)


def _marked(step: PlacedStep) -> list[tuple[str, Along]]:
    """Placements that are one position, and so can be marked on a map."""
    return [(name, one) for name, one in named(step).items() if not np.ptp(one.e, axis=0).any()]


def zone(look: Look) -> str:
    """Why a position cannot be taken, as :data:`stiffarm.commands.place.figures.ZONES` names it."""
    if look.why != "reach":
        return look.why
    beyond = look.shortfall is not None and look.shortfall.distance == 0.0
    return "limit" if beyond else "reach"


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
            1e3 * arc, {CHOSEN: after.e * 1e3}, [f"{axis.name} (mm)" for axis in cell.linear_axes],
            1e3 * np.array([axis.limits for axis in cell.linear_axes]), "Linear axes along the path", whole=True,
        )  # fmt: skip
        caption = "Where the linear axes stand; beyond the dotted lines are their limits."
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
            placed.problem.space.names, placed.problem.space.units, placed.problem.space.shown,
            placed.problem.space.lower, placed.problem.space.upper, strict=True,
        )
    )  # fmt: skip
    return Section(
        "How it was found",
        (
            Text(
                f"Base positions in {ranges}; {placed.evaluations} of them looked at, each over the path with "
                f"{len(placed.problem.angles)} angles gamma and all branches. A coarse grid, its best basins by "
                "pattern search; steps and motion along the path by dynamic programming on a grid, then finer about "
                "the result."
            ),
            Bullets(
                (
                    f"Model: {model.link_kind} links, {model.load_path} load path, unloaded arm; compliance "
                    "of linear axes acts at the base's origin, where the cell file gives one.",
                    "Static stiffness only: chatter, servo lag and the tool's own bending are not in it.",
                    "Between path points and between positions of the base collisions are not looked at.",
                )
            ),
        ),
    )
