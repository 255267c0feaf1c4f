"""report.html of a verified program: may it run, what is wrong where, how near it gets, how it was looked at."""

from __future__ import annotations

from collections import Counter

import numpy as np

from machining.verification import KIND_WORDS, Kind, Offence, Verification
from robots.arrays import Array
from stiffarm.commands.verify.figures import clearance_figure, speeds_figure, straightness_figure
from stiffarm.commands.verify.words import (
    distance_words,
    offence_words,
    place_words,
    sentence,
    shown,
    value_words,
    verdict,
)
from stiffarm.commands.verify.picture import offence_picture
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Block, Bullets, KeyFigure, Note, Picture, Section, Table, Text, write_page
from stiffarm.session.console import say
from stiffarm.session.outputs import OutputFolder

# Offences that the page lists; offences.csv has all.
LISTED = 60
INTERPOLATIONS = {
    "joint": "between two points all axes move evenly and arrive together",
    "linear": "between two points the tool moves on a straight line and turns evenly; the joints follow",
    "mixed": "cutting moves are straight lines of the tool, in rapid moves all axes move evenly",
}


def write_report(found: Verification, title: str, folder: OutputFolder) -> None:
    """Draw the figures and write report.html."""
    pictures = Pictures(folder)
    sections = [
        offences_section(found, folder),
        clearance_section(found, pictures),
        rates_section(found, pictures),
        path_section(found, pictures),
        how_section(found),
    ]
    program = found.program
    source = program.motions.source or "program"
    lede = f"{verdict(found)} {source}, {program.n} moves, cell {program.cell.name}. replay.html shows it in motion."
    question = "may this program run?"
    write_page(folder, title, lede, _key_figures(found), sections, question)


def _key_figures(found: Verification) -> list[KeyFigure]:
    total = found.timing.total + float(found.program.motions.dwell.sum())
    out = [
        KeyFigure("yes" if found.clean else "no", "may it run, as far as was looked at"),
        KeyFigure(str(len(found.errors)), "offences"),
        KeyFigure(distance_words(found), "least distance of bodies"),
        KeyFigure(f"{total:.3g} s" if np.isfinite(total) else "not known", "time at the programmed feeds"),
    ]
    if found.errors:
        out.insert(2, KeyFigure(str(found.errors[0].line), "line of the first offence"))
    return out


def offences_section(found: Verification, folder: OutputFolder) -> Section:
    """Verdict, picture of the first offence, list of offences."""
    if not found.offences:
        return Section("May it run", (Text("Nothing was found in what was looked at."), *_open_questions(found)))
    first = found.errors[0] if found.errors else found.offences[0]
    moves = Counter[tuple[object, object]]()
    for o in found.offences:
        moves[o.kind, o.severity] += o.moves
    rows = tuple(
        (str(kind), str(severity), str(count), str(moves[kind, severity]), KIND_WORDS[kind])
        for (kind, severity), count in found.counts.items()
    )
    listed = tuple(_row(o) for o in found.offences[:LISTED])
    left = len(found.offences) - len(listed)
    caption = "Offences in the order of the program" + (f"; {left} more are in offences.csv" if left else "")
    columns = ("line", "moves", "kind", "what", "value", "severity")
    blocks: list[Block] = [
        *_open_questions(found),
        _picture(found, first, folder),
        Table("By kind", ("kind", "severity", "places", "moves", "meaning"), rows, text_columns=(0, 1, 4)),
        Table(caption, columns, listed, text_columns=(0, 2, 3, 4, 5)),
    ]
    return Section("May it run", tuple(blocks))


def _open_questions(found: Verification) -> tuple[Block, ...]:
    if not found.not_looked_at:
        return ()
    return (Note("Not looked at: " + " ".join(found.not_looked_at)),)


def _row(offence: Offence) -> tuple[str, ...]:
    line = str(offence.line) if offence.nc_line is None else f"{offence.line} (file {offence.nc_line})"
    what, value = offence_words(offence), value_words(offence)
    return line, str(offence.moves), str(offence.kind), what, value, str(offence.severity)


def _picture(found: Verification, offence: Offence, folder: OutputFolder) -> Picture:
    path = folder.path("figures/first_offence.png")
    picture = offence_picture(found, offence, path)
    if picture.message:
        say(f"note: {picture.message}")
    pose = []
    for j, name in enumerate(found.axes.names):
        value, unit = shown(float(offence.values[j]), found.axes.unit(j))
        pose.append(f"{name} {value:.2f} {unit}")
    caption = (
        f"{sentence(offence)}. Left the cell, right what the frame on the left holds. "
        f"After {100.0 * offence.at:.0f} % of the move: {', '.join(pose)}."
    )
    return Picture(path, caption, f"robot in its cell at {place_words(offence)}")


def clearance_section(found: Verification, pictures: Pictures) -> Section:
    """How near bodies come to each other."""
    swept = found.swept
    caption = (
        "Least distance of any two checked bodies in each move. Between the poses that were measured nothing comes "
        "nearer than the lower edge of the band: that is proven, or where it touches 0 it is not."
    )
    blocks: list[Block] = [pictures.add(clearance_figure(found), "clearance", caption)]
    worst: dict[tuple[str, str], int] = {}
    for move in np.argsort(swept.distance, kind="stable"):
        if swept.pair[move] >= 0:
            worst.setdefault(swept.names[swept.pair[move]], int(move))
    if worst:
        rows = tuple(
            (
                f"{a} and {b}",
                "overlap" if swept.distance[move] < 0.0 else f"{swept.distance[move] * 1e3:.3g}",
                str(int(found.program.motions.line[move])),
            )
            for (a, b), move in list(worst.items())[:12]
        )
        caption = "Pairs that are nearest somewhere, at their worst"
        blocks.append(Table(caption, ("bodies", "distance, mm", "line"), rows))
    blocks.append(
        Text(
            f"Distances were measured at {swept.samples} poses, out to {swept.within * 1e3:g} mm. A move is decided "
            "when no body can have moved far enough between two poses to use up the distances at both; if not it is "
            f"halved, down to {found.demands.resolution * 1e3:g} mm of motion."
        )
    )
    return Section("How near it gets", tuple(blocks))


def rates_section(found: Verification, pictures: Pictures) -> Section:
    """Speeds and accelerations of the axes."""
    axes, timing = found.axes, found.timing
    blocks: list[Block] = []
    figure = speeds_figure(found)
    if figure is not None:
        caption = "Speed that the feed asks of each axis, as a share of its greatest; rapid moves set their own pace."
        blocks.append(pictures.add(figure, "axis_speeds", caption))
    rows = []
    for j, name in enumerate(axes.names):
        values = found.courses.points[:, j]
        scale, unit = shown(1.0, axes.unit(j))
        span = f"{values.min() * scale:.1f} to {values.max() * scale:.1f}"
        bounds = "endless" if np.isinf(axes.lower[j]) else f"{axes.lower[j] * scale:.4g} to {axes.upper[j] * scale:.4g}"
        rates = [
            _rate(column, limit, scale)
            for column, limit in (
                (timing.speed[:, j], axes.speed[j]),
                (timing.acceleration[:, j], axes.acceleration[j]),
            )
        ]
        rows.append((f"{name}, {unit}", span, bounds, *rates))
    columns = ("axis", "moves over", "limits", "peak speed per s", "peak acceleration per s\u00b2")
    blocks.append(Table("Axes; in brackets the greatest allowed", columns, tuple(rows)))
    blocks.append(
        Text(
            "Accelerations are those of a controller that averages the course of each axis over "
            f"{found.demands.smoothing * 1e3:g} ms: the change of speed across that time, over it. Real controllers "
            "blend corners in their own way and slow down where they must; this finds corners, it does not plan."
        )
    )
    return Section("How fast the axes move", tuple(blocks))


def _rate(column: Array, limit: float, scale: float) -> str:
    peak = f"{np.nanmax(column) * scale:.3g}" if np.isfinite(column).any() else "not known"
    return f"{peak} ({'not given' if np.isinf(limit) else f'{limit * scale:.4g}'})"


def path_section(found: Verification, pictures: Pictures) -> Section:
    """Deviation from the path, singularities, branches."""
    path = found.path
    blocks: list[Block] = []
    figure = straightness_figure(found)
    if figure is not None:
        caption = (
            "Greatest distance of the tip from the straight line between two programmed points, if all axes move "
            "evenly. A controller that runs straight lines does not have this error."
        )
        blocks.append(pictures.add(figure, "linearisation", caption))
    branches = sorted({found.program.names[int(b)] for b in found.program.branch if int(b) < len(found.program.names)})
    facts = [
        f"Points: joints reach the programmed frames to {path.point.max() * 1e6:.3g} um and "
        f"{np.degrees(path.point_turn.max()):.2g} deg.",
        f"Nearest to a singularity: {path.singular.min():.3g} at line "
        f"{int(found.program.motions.line[path.singular.argmin()])} (allowed for cutting moves: "
        f"{found.demands.singular_least:g}; 1 is as far away as can be).",
        f"Largest joint step of a move: {np.degrees(path.step.max()):.3g} deg.",
    ]
    if branches:
        facts.append(f"Branches used: {'; '.join(branches)}.")
    blocks.append(Bullets(tuple(facts)))
    return Section("How it keeps to the path", tuple(blocks))


def how_section(found: Verification) -> Section:
    """What was assumed, and what the check does not see."""
    demands = found.demands
    said = [
        f"Moves: {INTERPOLATIONS[demands.interpolation]}.",
        "Bodies: arm links as hulls around their sections or as the model's surfaces, tool, part, fixtures, carriages "
        "and floor as the cell file gives them. Cables, hoses and covers are in neither.",
        "The part does not change: what the cutter removes stays where it was. Cutter and part may touch in cutting "
        "moves; in rapid moves an overlap is an offence, and a warning where the tool draws straight out of a cut.",
        "Joint moves are decided for certain. For straight moves the way of the joints between two poses is taken from "
        "a third one in the middle; next to singularities that is an estimate.",
    ]
    blocks: list[Block] = [Bullets(tuple(said))]
    if found.notes:
        blocks.append(Bullets(found.notes))
    unproven = sum(o.kind is Kind.UNPROVEN for o in found.offences)
    if unproven:
        blocks.append(Note(f"{unproven} places could not be decided; a finer --resolution may."))
    return Section("How it was looked at", tuple(blocks))
