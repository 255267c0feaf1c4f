"""report.html of a verified program: may it run, what is wrong where, how near it gets, how it was looked at."""

from __future__ import annotations

from collections import Counter

import numpy as np

from machining.verification import KIND_WORDS, Kind, Offence, Verification
from machining.verification.offences import ORDER
from robots.arrays import Array
from stiffarm.commands.verify.figures import clearance_figure, speeds_figure, straightness_figure
from stiffarm.commands.verify.picture import OffencePicture, offence_picture
from stiffarm.commands.verify.spot import Spot
from stiffarm.commands.verify.words import (
    REMEDIES,
    counted,
    distance_words,
    kinds_words,
    offence_words,
    sentence,
    shown,
    value_words,
    verdict,
)
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
from stiffarm.session.console import say
from stiffarm.session.outputs import OutputFolder

# Offences that the page lists; offences.csv has all.
LISTED = 60
# Offences that are drawn, one of a kind.
DRAWN = 3
INTERPOLATIONS = {
    "joint": "between two points all axes move evenly and arrive together",
    "linear": "between two points the tool moves on a straight line and turns evenly; the joints follow",
    "mixed": "cutting moves are straight lines of the tool, in rapid moves all axes move evenly",
}


def write_report(found: Verification, title: str, folder: OutputFolder) -> None:
    """Draw the figures and write report.html."""
    pictures = Pictures(folder)
    clearance = clearance_picture(found, pictures, narrow=not found.offences)
    drawn = [_picture(found, offence, k, folder) for k, offence in enumerate(drawn_offences(found))]
    sections = [
        offences_section(found, [picture for picture, _ in drawn[1:]]),
        clearance_section(found, [clearance] if drawn else []),
        rates_section(found, pictures),
        path_section(found, pictures),
        how_section(found),
    ]
    program = found.program
    source = program.motions.source or "without a name"
    where = f", cell {program.cell.name}" if program.cell.name != "cell" else ""
    lede = f"{verdict(found)} Program {source}, {program.n} moves{where}."
    worst = drawn[0][1].spot if drawn else None
    answer = Answer(
        sure=sure_words(found),
        todo=todo_words(found),
        picture=drawn[0][0] if drawn else clearance,
        warnings=(f"Not checked: {' '.join(found.not_looked_at)}",) if found.not_looked_at else (),
    )
    write_page(folder, title, lede, _key_figures(found, worst), sections, "may this program run?", answer=answer)


def drawn_offences(found: Verification) -> list[Offence]:
    """The worst offence, and the worst of other kinds, as far as they are drawn."""
    first: dict[Kind, Offence] = {}
    for offence in found.ranked:
        first.setdefault(offence.kind, offence)
    return list(first.values())[:DRAWN]


def sure_words(found: Verification) -> str:
    """How far the verdict can be trusted."""
    unproven = sum(o.kind is Kind.UNPROVEN for o in found.offences)
    said = (
        f"Bodies are checked on whole moves, not only at their points: distances at {found.swept.samples} poses, and "
        "what lies between follows from how far anything can have moved."
    )
    return said + (f" {counted(unproven, 'place')} could not be decided." if unproven else "")


def todo_words(found: Verification) -> str:
    """What to do next."""
    if found.clean:
        return "Look at replay.html once, then run the program slowly and without a tool first."
    worst = found.ranked[0]
    others = [kind for kind in dict.fromkeys(o.kind for o in found.ranked) if kind is not worst.kind]
    more = f" Then what is left: {', '.join(others)}." if others else ""
    return f"{REMEDIES[worst.kind]}{more} replay.html opens at the worst offence."


def _key_figures(found: Verification, worst: Spot | None) -> list[KeyFigure]:
    total = found.timing.total + float(found.program.motions.dwell.sum())
    out = [KeyFigure("Yes" if found.clean else "No", "may it run, as far as was checked")]
    if worst is not None:
        label = "the worst offence" if found.errors else "the worst warning"
        out.append(KeyFigure(str(worst.offence.kind), f"{label}, line {worst.line}", worst.sentence))
    if found.errors:
        out.append(KeyFigure(str(len(found.errors)), "offences", kinds_words(found)))
    if float(found.swept.distance.min()) >= 0.0:
        distance, _, bodies = distance_words(found).partition(" (")
        out.append(KeyFigure(distance, f"least distance of bodies{': ' + bodies[:-1] if bodies else ''}"))
    return [
        *out,
        KeyFigure(f"{total:.3g} s" if np.isfinite(total) else "not known", "time at the programmed feeds"),
    ]


def offences_section(found: Verification, pictures: list[Picture]) -> Section:
    """All offences, the worst first; pictures of those of other kinds."""
    if not found.offences:
        return Section("Offences", (Text("Nothing was found in what was checked."),))
    moves = Counter[tuple[object, object]]()
    for o in found.offences:
        moves[o.kind, o.severity] += o.moves
    kinds = Counter((o.kind, o.severity) for o in found.ranked)
    rows = tuple(
        (str(kind), str(severity), str(count), str(moves[kind, severity]), KIND_WORDS[kind])
        for (kind, severity), count in kinds.items()
    )
    listed = tuple(_row(o) for o in found.ranked[:LISTED])
    left = len(found.offences) - len(listed)
    caption = f"Offences, {ORDER}" + (f"; {left} more are in offences.csv" if left else "")
    columns = ("line", "moves", "kind", "what", "value", "severity")
    blocks: list[Block] = [
        Table(caption, columns, listed, text_columns=(0, 2, 3, 4, 5)),
        Table("By kind", ("kind", "severity", "places", "moves", "meaning"), rows, text_columns=(0, 1, 4), folded=True),
    ]
    if pictures:
        blocks.append(Fold("The worst of other kinds", tuple(pictures)))
    return Section("Offences", tuple(blocks))


def _row(offence: Offence) -> tuple[str, ...]:
    line = str(offence.line) if offence.nc_line is None else f"{offence.line} (file {offence.nc_line})"
    what, value = offence_words(offence), value_words(offence)
    return line, str(offence.moves), str(offence.kind), what, value, str(offence.severity)


def _picture(found: Verification, offence: Offence, place: int, folder: OutputFolder) -> tuple[Picture, OffencePicture]:
    """The picture of an offence; ``place``: 0 is the worst."""
    path = folder.path("figures/worst_offence.png" if place == 0 else f"figures/offence_{place + 1}.png")
    drawn = offence_picture(found, offence, path)
    if drawn.message and place == 0:
        say(f"note: {drawn.message}")
    spot, pose = drawn.spot, []
    for j, name in enumerate(found.axes.names):
        value, unit = shown(float(spot.values[j]), found.axes.unit(j))
        pose.append(f"{name} {value:.2f} {unit}")
    hidden = (
        f" Left out of the near view, because it would hide the place: {', '.join(drawn.left_out)}."
        if drawn.left_out
        else ""
    )
    caption = f"{sentence(offence)}. Shown where it is worst, line {spot.line}: {', '.join(pose)}.{hidden}"
    alt = f"robot in its cell at line {spot.line}: {offence.kind}, {spot.sentence}"
    return Picture(path, caption, alt), drawn


def clearance_picture(found: Verification, pictures: Pictures, *, narrow: bool = False) -> Picture:
    """Least distances over the program."""
    caption = (
        "Least distance of any two checked bodies in each move. Between the poses that were measured nothing comes "
        "nearer than the lower edge of the band: that is proven, or where it touches 0 it is not."
    )
    return pictures.add(clearance_figure(found, narrow=narrow), "clearance", caption)


def clearance_section(found: Verification, pictures: list[Picture]) -> Section:
    """How near bodies come to each other."""
    swept = found.swept
    blocks: list[Block] = [*pictures]
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
    names = found.program.names
    # Solutions of a search have no names but their numbers, which mean nothing from one point to the next.
    branches = (
        sorted({names[int(b)] for b in found.program.branch if int(b) < len(names)}) if names[0] != "solution 1" else []
    )
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
    return Section("How it was checked", tuple(blocks), folded=True)
