"""The command `verify`: a program replayed in its cell before the cell moves, and what is wrong with it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from fem.arm import Arm
from machining.programs.formats import CONTROLLERS, neutral_twin, read_options, read_program
from machining.programs.write_options import WriteOptions
from machining.verification import (
    KIND_CODES,
    KIND_WORDS,
    Demands,
    Interpolation,
    Kind,
    MovingAxes,
    Offence,
    Verification,
)
from machining.verification import verify as verified
from machining.verification.offences import ORDER
from robots.quantities import Quantity, count, length, stored
from stiffarm.capability import capability
from stiffarm.commands.verify.words import (
    DISTANCE,
    REMEDIES,
    UNITS,
    counted,
    distance_words,
    kinds_words,
    offence_words,
    sentence,
    value_words,
    verdict,
)
from stiffarm.pages.report import Block, Bullets, KeyFigure, Note, Section
from stiffarm.path_request import FramesRequest, bodies_of
from stiffarm.request import ANY_PATH, argument, option, word
from stiffarm.result import Drawing, Result, Table
from stiffarm.session.console import progress
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.table_kinds import PROGRAM, expect

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, kw_only=True)
class VerifyRequest(FramesRequest):
    """Check a program for collisions, limits and singularities.

    Also for speeds, branch changes and path deviations, before the cell moves. Exit code 0: no offence (there may be
    warnings); 1: offences, the worst one is named; 2: bad input. Writes report.html, replay.html, verification.json,
    verification.csv (the offences) and moves.csv into --out.
    """

    program: Path | str = argument(
        "Program written by `stiffarm post`: JSON or CSV, or the main file of a controller's.",
        ANY_PATH,
        metavar="PROGRAM",
        required=True,
    )
    interpolation: Interpolation = option(
        "Interpolation between points: joint (synchronised joint motion), linear (straight tool path) or mixed (linear "
        "while cutting).",
        word(Interpolation),
        default="joint",
    )
    safety: float | None = option(
        "Distance to keep from the surroundings, in mm. Default: the cell's safety distance.", metavar="MM"
    )
    resolution: float = option(
        "Resolution: moves are subdivided down to this motion, in mm.", metavar="MM", default=1.0
    )
    tolerance: float = option("Allowed tool-tip deviation from the programmed path, in mm.", metavar="MM", default=0.1)
    smoothing: float = option("Time over which the controller blends corners, in ms.", metavar="MS", default=50.0)
    singular: float = option("Least distance from singularities, 0 to 1.", default=Demands.singular_least, least=0.0)
    jump: float = option("Largest joint step without tool motion, in deg.", metavar="DEG", default=20.0)
    against: Path | str | None = option(
        "The neutral program of the same run, which a controller's program must agree with. Default: that in the "
        "folder json beside the program's folder.",
        ANY_PATH,
        metavar="JSON",
    )
    options: Path | str | None = option(
        "Options that a controller's program was written with (TOML or JSON).", ANY_PATH
    )


def answer(given: Arm, asked: VerifyRequest) -> Result:
    """Whether the program may run, and what is wrong with it."""
    demands = Demands(
        interpolation=asked.interpolation,
        safety=None if asked.safety is None else 1e-3 * asked.safety,
        resolution=1e-3 * asked.resolution,
        tolerance=1e-3 * asked.tolerance,
        smoothing=1e-3 * asked.smoothing,
        singular_least=asked.singular,
        jump=float(np.radians(asked.jump)),
    )
    # Programs are the controller's, which computes with the arm as designed.
    arm, program = given.as_designed, Path(asked.program)
    if program.suffix.lower() not in CONTROLLERS:
        expect(program, PROGRAM)
    options = WriteOptions() if asked.options is None else read_options(Path(asked.options))
    twin = neutral_twin(program) if asked.against is None else Path(asked.against)
    checked = read_program(program, arm.robot, asked.described(arm.robot), options, twin)
    bodies = bodies_of(arm.source, arm.description, checked.cell)
    with progress("moves checked") as bar:
        return result(arm, verified(checked, bodies, demands, progress=bar))


# Offences that are drawn, one of a kind.
DRAWN: Final = 3
# Pairs of bodies that are listed.
NEAREST: Final = 12
INTERPOLATIONS: Final = {
    "joint": "between two points all axes move evenly and arrive together",
    "linear": "between two points the tool moves on a straight line and turns evenly; the joints follow",
    "mixed": "cutting moves are straight lines of the tool, in rapid moves all axes move evenly",
}
LINE, MOVE, MOVES = count("line"), count("move"), count("moves")
TIME: Final = Quantity("time", "s")
LINE_ERROR: Final = length("linearisation_error", "linearisation error", "um")
POINT_ERROR: Final = length("point_deviation", "deviation of points", "um")
SINGULAR: Final = Quantity("singular_distance", label="distance from singularities")
CLEARANCE_CAPTION: Final = (
    "Least distance of any two checked bodies in each move. Between the poses that were measured nothing comes nearer "
    "than the lower edge of the band: that is proven, or where it touches 0 it is not."
)
SPEED_CAPTION: Final = (
    "Speed that the feed asks of each axis, as a share of its greatest; rapid moves set their own pace."
)
LINE_CAPTION: Final = (
    "Greatest distance of the tip from the straight line between two programmed points, if all axes move evenly. A "
    "controller that runs straight lines does not have this error."
)


def result(arm: Arm, found: Verification) -> Result:
    """The result of `verify`."""
    title, source = arm.description.title.split(" (")[0], found.program.motions.source
    where = f", cell {found.program.cell.name}" if found.program.cell.name != "cell" else ""

    def more(folder: OutputFolder) -> Mapping[str, Any]:
        from stiffarm.commands.verify.replay import replay_page

        folder.write_text("replay.html", replay_page(found, f"{title}, {source}" if source else title))
        return {}

    return Result(
        name="verification",
        title=title,
        question="may this program run?",
        answer=f"{verdict(found)} Program {source or 'without a name'}, {found.program.n} moves{where}; least distance "
        f"of bodies: {distance_words(found)}.",
        how_sure=_how_sure(found),
        what_next=_what_next(found),
        facts=_facts(found),
        tables=(_offences(found), _worst(found), _counts(found), _nearest(found), _axes(found), _moves(found)),
        drawings=tuple(_drawings(found)),
        key=tuple(_key(found)),
        sections=(_path_section(found), _how_section(found)),
        remarks=(*(f"not checked: {text}" for text in found.not_looked_at), *found.notes),
        arm=arm,
        caution="",
        found=found,
        more=more,
        exit_code=0 if found.clean else 1,
    )


def drawn_offences(found: Verification) -> list[Offence]:
    """The worst offence, and the worst of other kinds, as far as they are drawn."""
    first: dict[Kind, Offence] = {}
    for offence in found.ranked:
        first.setdefault(offence.kind, offence)
    return list(first.values())[:DRAWN]


def _drawings(found: Verification) -> list[Drawing]:
    offences = drawn_offences(found)
    out = []
    for k, offence in enumerate(offences):
        name = "worst_offence" if k == 0 else f"offence_{k + 1}"
        alt = f"robot in its cell at line {offence.line}: {offence.kind}, {offence_words(offence)}"
        out.append(
            Drawing(name, f"{sentence(offence)}. Shown where it is worst.", alt, partial(_offence, found, offence))
        )
    curves = [("clearance", CLEARANCE_CAPTION)]
    with np.errstate(invalid="ignore"):
        has_speed = np.isfinite(found.timing.speed / found.axes.speed).any() and np.isfinite(found.axes.speed).any()
    curves += [("axis_speeds", SPEED_CAPTION)] if has_speed else []
    curves += [("linearisation", LINE_CAPTION)] if np.isfinite(found.path.line).any() else []
    for name, caption in curves:
        draw = partial(_curve, found, name, narrow=not offences)
        out.append(Drawing(name, caption, f"{name.replace('_', ' ')} along the program", draw))
    return out


def _offence(found: Verification, offence: Offence) -> Figure:
    from stiffarm.commands.verify.picture import draw_offence

    return draw_offence(found, offence)


def _curve(found: Verification, name: str, *, narrow: bool) -> Figure:
    from stiffarm.commands.verify import figures

    if name == "clearance":
        return figures.clearance_figure(found, narrow=narrow)
    return figures.speeds_figure(found) if name == "axis_speeds" else figures.straightness_figure(found)


def _facts(found: Verification) -> dict[str, Any]:
    program, demands, swept, path = found.program, found.demands, found.swept, found.path
    nearest = int(np.argmin(swept.distance))
    least = float(swept.distance[nearest])
    return {
        "robot": program.robot.name,
        "cell": program.cell.name,
        "source": program.motions.source,
        "moves": program.n,
        "clean": found.clean,
        "errors": len(found.errors),
        "warnings": len(found.offences) - len(found.errors),
        "interpolation": demands.interpolation,
        **stored(
            {
                length("safety"): found.safety,
                length("resolution"): demands.resolution,
                length("tolerance"): demands.tolerance,
                Quantity("smoothing", "ms", 1e3): demands.smoothing,
                length("least_distance"): least if least >= 0.0 else np.nan,
                length("distances_worked_out_up_to"): swept.within,
                TIME: _time(found),
                length("greatest_linearisation_error", unit="um"): _greatest(path.line),
                length("greatest_point_deviation", unit="um"): _greatest(path.point),
                Quantity("least_singular_distance"): path.singular.min(),
            }
        ),
        "poses_measured": swept.samples + (0 if found.rapid is None else found.rapid.samples),
        "least_distance_bodies": list(swept.names[swept.pair[nearest]]) if swept.pair[nearest] >= 0 else None,
        "least_distance_move": nearest,
        "not_looked_at": list(found.not_looked_at),
    }


def _time(found: Verification) -> float:
    return float(found.timing.total + found.program.motions.dwell.sum())


def _greatest(values: Any) -> float:
    return float(np.nanmax(values)) if np.isfinite(values).any() else np.nan


def _axis(axes: MovingAxes, j: int, what: str = "", per: str = "") -> Quantity:
    """A coordinate of an axis, or its rate, in deg or mm."""
    unit = UNITS[axes.unit(j, per)]
    return Quantity("_".join(filter(None, (axes.names[j], what))), unit.unit, unit.factor)


def _offences(found: Verification) -> Table:
    """All offences, the worst first; values are in the unit of their row."""
    ranked, axes = found.ranked, found.axes
    units = [UNITS[o.unit] for o in ranked]
    bodies = [o.bodies or ("", "") for o in ranked]
    return Table(
        "offences",
        "Offences",
        {
            "kind": [str(o.kind) for o in ranked],
            "code": [KIND_CODES[o.kind] for o in ranked],
            "severity": [str(o.severity) for o in ranked],
            "axis": [o.axis for o in ranked],
            "body_1": [a for a, _ in bodies],
            "body_2": [b for _, b in bodies],
            "words": [sentence(o) for o in ranked],
            "remedy": [REMEDIES[o.kind] for o in ranked],
            "unit": [unit.unit for unit in units],
        },
        {
            Quantity("value"): np.array([unit.factor * o.value for unit, o in zip(units, ranked, strict=True)]),
            Quantity("limit"): np.array([unit.factor * o.limit for unit, o in zip(units, ranked, strict=True)]),
        },
        in_files={
            LINE: np.array([o.line for o in ranked]),
            count("program_file_line"): np.array([np.nan if o.nc_line is None else o.nc_line for o in ranked]),
            MOVE: np.array([o.move for o in ranked]),
            MOVES: np.array([o.moves for o in ranked]),
            Quantity("share_of_move"): np.array([o.at for o in ranked]),
            **{_axis(axes, j): np.array([o.values[j] for o in ranked]) for j in range(axes.count)},
        },
        only_in="files",
    )


def _worst(found: Verification) -> Table:
    """The offences for people."""
    ranked = found.ranked
    return Table(
        "worst",
        f"Offences, {ORDER}",
        {
            "line": [str(o.line) if o.nc_line is None else f"{o.line} (file {o.nc_line})" for o in ranked],
            "kind": [str(o.kind) for o in ranked],
            "what": [offence_words(o) for o in ranked],
            "value": [value_words(o) for o in ranked],
            "severity": [str(o.severity) for o in ranked],
        },
        {MOVES: np.array([o.moves for o in ranked])},
        is_extract=True,
    )


def _counts(found: Verification) -> Table:
    moves = Counter[tuple[object, object]]()
    for o in found.offences:
        moves[o.kind, o.severity] += o.moves
    kinds = list(found.counts)
    return Table(
        "counts",
        "Offences by kind",
        {
            "kind": [str(kind) for kind, _ in kinds],
            "code": [KIND_CODES[kind] for kind, _ in kinds],
            "severity": [str(severity) for _, severity in kinds],
            "meaning": [KIND_WORDS[kind] for kind, _ in kinds],
        },
        {
            count("count", "places"): np.array([found.counts[key] for key in kinds]),
            MOVES: np.array([moves[key] for key in kinds]),
        },
        folded=True,
    )


def _nearest(found: Verification) -> Table:
    """Pairs of bodies that come nearest, each at its worst; 0 mm where they overlap."""
    swept = found.swept
    worst: dict[tuple[str, str], int] = {}
    for move in np.argsort(swept.distance, kind="stable"):
        if swept.pair[move] >= 0:
            worst.setdefault(swept.names[swept.pair[move]], int(move))
    rows = np.array(list(worst.values())[:NEAREST], dtype=np.int64)
    return Table(
        "nearest",
        "Pairs of bodies that are nearest somewhere, at their worst; 0 mm where they overlap",
        {"bodies": [f"{a} and {b}" for a, b in list(worst)[:NEAREST]]},
        {DISTANCE: np.maximum(swept.distance[rows], 0.0), LINE: found.program.motions.line[rows].astype(np.float64)},
        folded=True,
    )


def _axes(found: Verification) -> Table:
    """What the axes do within their limits; each row in the unit of its axis."""
    axes, timing = found.axes, found.timing
    factor = np.array([UNITS[axes.unit(j)].factor for j in range(axes.count)])
    points = found.courses.points
    columns = {
        "from": points.min(axis=0),
        "to": points.max(axis=0),
        "lower_limit": axes.lower,
        "upper_limit": axes.upper,
        "speed": np.array([_greatest(column) for column in timing.speed.T]),
        "speed_limit": axes.speed,
        "acceleration": np.array([_greatest(column) for column in timing.acceleration.T]),
        "acceleration_limit": axes.acceleration,
    }
    shares = {
        Quantity(f"{rate}_share", label=f"{rate}, share"): np.where(
            np.isfinite(columns[f"{rate}_limit"]), columns[rate] / columns[f"{rate}_limit"], np.nan
        )
        for rate in ("speed", "acceleration")
    }
    return Table(
        "axes",
        "Axes, in their units, per s and per s²",
        {"axis": axes.names, "unit": [UNITS[axes.unit(j)].unit for j in range(axes.count)]},
        {Quantity(name, label=name.replace("_", " ")): factor * values for name, values in columns.items()} | shares,
        folded=True,
    )


def _moves(found: Verification) -> Table:
    axes, timing, path, swept = found.axes, found.timing, found.path, found.swept
    rates = (("speed", "/s", timing.speed), ("acceleration", "/s^2", timing.acceleration))
    n = found.program.n
    return Table(
        "moves",
        "Moves",
        {"move": [str(k) for k in range(n)]},
        {
            LINE: found.program.motions.line.astype(np.float64),
            count("rapid"): found.program.motions.rapid.astype(np.float64),
            TIME: timing.time,
            DISTANCE: np.maximum(swept.distance, 0.0),
            length("proven_distance"): np.maximum(swept.proven, 0.0),
            count("overlap"): np.isfinite(swept.hit).astype(np.float64),
            LINE_ERROR: path.line,
            POINT_ERROR: path.point,
            SINGULAR: path.singular,
            **{_axis(axes, j, what, per): rate[:, j] for j in range(axes.count) for what, per, rate in rates},
        },
        only_in="csv",
    )


def _how_sure(found: Verification) -> str:
    """How far the verdict can be trusted."""
    unproven = sum(o.kind is Kind.UNPROVEN for o in found.offences)
    return (
        f"Bodies are checked on whole moves, not only at their points: distances at {found.swept.samples} poses, and "
        "what lies between follows from how far anything can have moved."
    ) + (f" {counted(unproven, 'place')} could not be decided." if unproven else "")


def _what_next(found: Verification) -> str:
    if found.clean:
        return "Look at replay.html once, then run the program slowly and without a tool first."
    worst = found.ranked[0]
    others = [kind for kind in dict.fromkeys(o.kind for o in found.ranked) if kind is not worst.kind]
    more = f" Then what is left: {', '.join(others)}." if others else ""
    return f"{REMEDIES[worst.kind]}{more} replay.html opens at the worst offence."


def _key(found: Verification) -> list[KeyFigure]:
    out = [KeyFigure("Yes" if found.clean else "No", "may it run, as far as was checked")]
    if found.ranked:
        worst, label = found.ranked[0], "the worst offence" if found.errors else "the worst warning"
        what = ", ".join(filter(None, (offence_words(worst), value_words(worst))))
        out.append(KeyFigure(str(worst.kind), f"{label}, line {worst.line}", what))
    if found.errors:
        out.append(KeyFigure(str(len(found.errors)), "offences", kinds_words(found)))
    if float(found.swept.distance.min()) >= 0.0:
        distance, _, bodies = distance_words(found).partition(" (")
        out.append(KeyFigure(distance, f"least distance of bodies{': ' + bodies[:-1] if bodies else ''}"))
    time = _time(found)
    known = TIME.text(time, unit=True) if np.isfinite(time) else "not known"
    return [*out, KeyFigure(known, "time at the programmed feeds")]


def _path_section(found: Verification) -> Section:
    """Deviation from the path, singularities, branches."""
    path, names, line = found.path, found.program.names, found.program.motions.line
    nearest = int(path.singular.argmin())
    facts = [
        f"Points: joints reach the programmed frames to {POINT_ERROR.text(path.point.max(), unit=True)} and "
        f"{UNITS['rad'].text(path.point_turn.max(), unit=True)}.",
        f"Nearest to a singularity: {SINGULAR.text(path.singular[nearest])} at line {line[nearest]} (allowed for "
        f"cutting moves: {found.demands.singular_least:g}; 1 is as far away as can be).",
        f"Largest joint step of a move: {UNITS['rad'].text(path.step.max(), unit=True)}.",
    ]
    # Solutions of a search have no names but their numbers, which mean nothing from one point to the next.
    if names[0] != "solution 1":
        branches = sorted({names[int(b)] for b in found.program.branch if int(b) < len(names)})
        facts.append(f"Branches used: {'; '.join(branches)}.")
    return Section("How it keeps to the path", (Bullets(tuple(facts)),))


def _how_section(found: Verification) -> Section:
    """What was assumed, and what the check does not see."""
    demands, swept = found.demands, found.swept
    blocks: list[Block] = [
        Bullets(
            (
                f"Moves: {INTERPOLATIONS[demands.interpolation]}.",
                f"Distances were measured at {swept.samples} poses, out to {DISTANCE.text(swept.within, unit=True)}. A "
                "move is decided when no body can have moved far enough between two poses to use up the distances at "
                f"both; if not it is halved, down to {DISTANCE.text(demands.resolution, unit=True)} of motion.",
                "Bodies: arm links as hulls around their sections or as the model's surfaces, tool, part, fixtures, "
                "carriages and floor as the cell file gives them. Cables, hoses and covers are in neither.",
                "The part does not change: what the cutter removes stays where it was. Cutter and part may touch in "
                "cutting moves; in rapid moves an overlap is an offence, and a warning where the tool draws straight "
                "out of a cut.",
                "Joint moves are decided for certain. For straight moves the way of the joints between two poses is "
                "taken from a third one in the middle; next to singularities that is an estimate.",
                "Accelerations are those of a controller that averages the course of each axis over "
                f"{1e3 * demands.smoothing:g} ms: the change of speed across that time, over it. Real controllers "
                "blend corners in their own way and slow down where they must; this finds corners, it does not plan.",
            )
        )
    ]
    unproven = sum(o.kind is Kind.UNPROVEN for o in found.offences)
    if unproven:
        blocks.append(Note(f"{unproven} places could not be decided; a finer --resolution may."))
    return Section("How it was checked", tuple(blocks), folded=True)


verify = capability("verify", VerifyRequest, answer, built=())
