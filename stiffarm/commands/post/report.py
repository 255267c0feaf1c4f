"""What a posted program is like: post.json and report.html."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from machining import singular_distance
from machining.cutting import Estimated
from machining.cutting.force import NORMAL_95
from machining.programs.compensation import Compensated
from machining.programs.formats import FORMATS
from machining.programs.run import PostRun
from machining.stiffness.objective import shown
from machining.toolpaths.events import ordered
from robots import Remark
from robots.arrays import Array
from robots.inverse.following import is_redundant
from robots.quantities import ranged, rounded
from robots.schema.joint_errors import Positions
from stiffarm.commands.post import approach, corrected
from stiffarm.commands.posture.figures.along_path import joints_picture
from stiffarm.commands.posture.payload import elbow_range
from stiffarm.pages import arm_uncertainty
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.figure_parts import LINES, SERIES, drawing
from stiffarm.pages.report import Answer, Bullets, KeyFigure, Note, Picture, Section, Table, Text, write_page
from stiffarm.session.outputs import OutputFolder

SCHEMA = "stiffarm-post-run/1"
UNVERIFIED = Remark(
    "Nothing has been checked for collisions, speeds and singularities between points: run `stiffarm verify`.",
    code="W031",
)


def payload(run: PostRun, positions: Positions | None = None) -> dict[str, Any]:
    """Figures of the run, keys with units; ``positions``: where the geometry of a calibrated arm came from."""
    program, request = run.program, run.request
    objective = shown(run.posted.settings.objective.quantity)
    posted = run.posted
    out: dict[str, Any] = {
        "schema": SCHEMA,
        "robot": run.model.robot.name,
        "source": program.motions.source,
        "moves_read": request.motions.n,
        "moves_written": program.n,
        "inserted": int(run.posted.program.inserted.sum()),
        "tolerance_um": rounded(request.settings.tolerance * 1e6),
        "largest_bend_um": rounded(float(run.posted.bend.max(initial=0.0)) * 1e6),
        "largest_bend_of_cuts_um": rounded(run.posted.bend_of_cuts * 1e6),
        "largest_bend_of_rapids_um": rounded(run.posted.bend_of_rapids * 1e6),
        "gamma_counts_from": [rounded(float(v)) for v in np.asarray(run.posted.state.reference)],
        "gamma_deg": [rounded(float(v)) for v in np.degrees([program.gamma.min(), program.gamma.max()])],
        "branches": sorted({program.names[b] for b in program.branch}),
        **elbow_range(run.model.robot, program.q),
        "gain_of_turning_gamma": None if posted.course.forgone is None else rounded(posted.course.forgone),
        "chosen_by": posted.settings.objective.quantity,
        f"mean_{objective.column}": rounded(posted.mean * objective.factor),
        f"worst_{objective.column}": rounded(posted.worst * objective.factor),
        **_uncertain(run, objective.column, objective.factor),
        "least_distance_to_singularity": rounded(float(singular_distance(run.model.robot, program.q).min())),
        "commands": dict(Counter(event.kind for event in ordered(program.motions) if event.kind)),
        "reading_notes": [str(note) for note in program.motions.notes],
        "programs": {
            target.folder: {
                "files": [file.name for file in run.written[target].files],
                "sha256": run.digests.get(target, {}),
                "off_path_um": rounded(trip.tip * 1e6),
                "off_path_urad": rounded(trip.turned * 1e6),
                "notes": list(run.written[target].notes),
                "undefined_commands": [
                    {"what": one.what, "count": one.count, "first_line": one.line}
                    for one in run.written[target].undefined
                ],
            }
            for target, trip in run.trips.items()
        },
    }
    if run.approached is not None and request.approach is not None:
        out["approach"] = approach.payload(run.approached, request.approach)
    if run.compensated is not None:
        out["compensation"] = _compensation(run.compensated)
    if run.corrected is not None and positions is not None:
        out["correction"] = corrected.payload(run.corrected, positions)
    return out


def _uncertain(run: PostRun, column: str, factor: float) -> dict[str, Any]:
    """What the stiffness rests on, and 95 % intervals of its mean and worst value; nothing for a rigid arm."""
    if run.stiffness is None or run.drawn is None:
        return {}
    worst = np.max if run.request.settings.objective.minimised else np.min
    return {
        "stiffness_uncertainty": arm_uncertainty.payload(run.stiffness),
        f"mean_{column}_95": arm_uncertainty.interval(run.drawn.estimated(lambda v: v.mean(axis=-1)), factor),
        f"worst_{column}_95": arm_uncertainty.interval(run.drawn.estimated(lambda v: worst(v, axis=-1)), factor),
    }


def uncertainty_words(run: PostRun) -> list[str]:
    """What intervals rest on and what they do not hold."""
    if run.stiffness is None or run.drawn is None:
        return [arm_uncertainty.BY_ROOM]
    error = [] if run.compensated is None else arm_uncertainty.error_remarks(run.compensated.error)
    what = f"the mean {run.request.settings.objective.quantity}"
    return [arm_uncertainty.sentence(run.stiffness), *arm_uncertainty.share_remarks(run.drawn.matters, what), *error]


def _compensation(found: Compensated) -> dict[str, Any]:
    length = np.linalg.norm(found.moved, axis=1) * 1e6
    left, milled = np.linalg.norm(found.left, axis=1) * 1e6, length[found.engaged]
    return {
        "largest_um": rounded(float(length.max())),
        "mean_um": rounded(float(milled.mean()) if len(milled) else 0.0),
        "error_sd_um": rounded(float(found.error.sd.max()) * 1e6),
        "unknown_95_um": rounded(NORMAL_95 * float(found.error.sd.max()) * 1e6),
        "capped_moves": int(found.capped.sum()),
        "left_um": rounded(float(left.max())),
        "rounds": found.rounds,
        "rests_on": list(found.error.uncertain.notes),
    }


def write_report(run: PostRun, heading: str, folder: OutputFolder, positions: Positions | None = None) -> None:
    """Draw the figures and write report.html."""
    pictures = Pictures(folder)
    program, between = run.program, int(run.posted.program.inserted.sum())
    sections = [_programs(run), _posture(run, pictures)]
    if run.compensated is not None:
        sections.append(_compensated(run.compensated, pictures))
    if run.corrected is not None and positions is not None:
        sections.append(corrected.section(run, run.corrected, positions, pictures))
    sections.append(_reading(run))
    worst = max(trip.tip for trip in run.trips.values()) * 1e6
    path = "tool path" if run.corrected is None else "moved targets"
    aside = "" if run.approached is None else f", {len(run.approached.moves)} to come from the calibrated side"
    lede = (
        f"{len(run.trips)} program{'s' if len(run.trips) > 1 else ''} written from {program.motions.source}; read "
        f"back, none leaves the {path} by more than {max(worst, 1e-3):.2g} um. {run.request.motions.n} moves read, "
        f"{program.n} written: {between} points put in so that joint motion stays within "
        f"{run.request.settings.tolerance * 1e6:.3g} um of the straight line{aside}."
    )
    answer = Answer(
        sure=" ".join(uncertainty_words(run)), todo=_todo(run), picture=_motion(run, pictures), warnings=(UNVERIFIED,)
    )
    write_page(folder, heading, lede, _key(run), sections, "does the program follow the tool path?", answer=answer)


def _todo(run: PostRun) -> str:
    """What to do before the cell moves, with the file to check where there is one."""
    neutral = [
        f"{target.folder}/{file.name}"
        for target in run.trips
        if FORMATS[target.name].neutral
        for file in run.written[target].files[:1]
    ]
    if neutral:
        return (
            f"Check {neutral[0]} in its cell with `stiffarm verify`, then the notes below on frames and signs of axes."
        )
    return "Write the neutral program too (`--format json`) and check it in its cell with `stiffarm verify`."


def _motion(run: PostRun, pictures: Pictures) -> Picture:
    program = run.program
    return joints_picture(pictures, _way(run), {"program": program.q}, run.model.robot, narrow=True)


def _way(run: PostRun) -> Array:
    """Length along the program (n,) m."""
    steps = np.linalg.norm(np.diff(run.program.motions.points, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _key(run: PostRun) -> list[KeyFigure]:
    it = shown(run.request.settings.objective.quantity)
    posted = run.posted
    worst = max(trip.tip for trip in run.trips.values()) * 1e6
    span = None if run.drawn is None else run.drawn.estimated(lambda v: v.mean(axis=-1))
    least = np.max if run.request.settings.objective.minimised else np.min
    softest = None if run.drawn is None else run.drawn.estimated(lambda v: least(v, axis=-1))

    def within(found: Estimated | None) -> str:
        return "" if found is None else f"95 %: {ranged(found.low * it.factor, found.high * it.factor, it.unit, 3)}"

    stiffness = [
        KeyFigure(f"{posted.worst * it.factor:.4g} {it.unit}", f"{it.name}, worst point", within(softest)),
        KeyFigure(f"{posted.mean * it.factor:.4g} {it.unit}", f"{it.name}, mean", within(span)),
    ]
    return [
        KeyFigure(f"{worst:.2g} um", "programs read back, farthest from the tool path"),
        KeyFigure(
            f"{posted.bend_of_cuts * 1e6:.3g} um",
            f"joint motion off the straight line of cuts, at most; of rapids {posted.bend_of_rapids * 1e6:.3g} um",
        ),
        *(stiffness if run.drawn else []),
    ]


def _programs(run: PostRun) -> Section:
    rows = tuple(
        (
            FORMATS[target.name].title,
            "both" if FORMATS[target.name].neutral else target.kind,
            ", ".join(f"{target.folder}/{file.name}" for file in run.written[target].files[:3])
            + (" ..." if len(run.written[target].files) > 3 else ""),
            f"{trip.tip * 1e6:.2g}",
            f"{trip.turned * 1e6:.2g}",
        )
        for target, trip in run.trips.items()
    )
    notes = {note: None for target in run.trips for note in run.written[target].notes}
    columns = ("format", "coordinates", "files", "off path, um", "off path, urad")
    blocks: list[Text | Note | Table | Bullets] = [
        Table("Programs, read back and compared with the tool path", columns, rows, text_columns=(0, 1, 2)),
    ]
    if notes:
        blocks += [Text("Before they run:"), Bullets(tuple(notes))]
    return Section("Programs", tuple(blocks))


def _posture(run: PostRun, pictures: Pictures) -> Section:
    program, robot = run.program, run.model.robot
    way = _way(run) * 1e3
    reference = ", ".join(f"{v:.3g}" for v in np.asarray(run.posted.state.reference))
    names = "; ".join(sorted({program.names[b] for b in program.branch}))
    posture = f"branches: {names}"
    if is_redundant(robot):
        posture = (
            f"{names} about the line from shoulder to wrist, 0 on top: postures were followed along the path, and the "
            "elbow was turned for the objective, least joint travel, and room to limits and singularities"
        )
    blocks: list[Text | Picture] = [
        Text(
            f"Gamma (counted from the part's direction {reference}) from {np.degrees(program.gamma.min()):.4g} to "
            f"{np.degrees(program.gamma.max()):.4g} deg; {posture}. Distance to the nearest singularity at "
            f"least {singular_distance(robot, program.q).min():.2g}."
        ),
        *(Text(f"{text[0].upper()}{text[1:]}") for text in approach.words(run)),
    ]
    if program.travel.shape[1]:
        travels = {axis.name: program.travel[:, k] * 1e3 for k, axis in enumerate(program.cell.linear_axes)}
        figure = _lines(way, travels, ("path, mm", "travel, mm"), "Linear axes")
        blocks.append(pictures.add(figure, "axes", "Linear axes along the program."))
    return Section("Posture", tuple(blocks))


def _lines(x: Array, lines: Mapping[str, Array], labels: tuple[str, str], text: str) -> Figure:
    """Lines over one another along the program; ``labels`` of the axes."""
    with drawing(text, (10.0, 3.3)) as (figure, (ax,)):
        for k, (name, values) in enumerate(lines.items()):
            ax.plot(
                x, values, color=SERIES[k % len(SERIES)], linestyle=LINES[k % len(LINES)], linewidth=1.4, label=name
            )
        ax.set(xlabel=labels[0], ylabel=labels[1])
        ax.legend(loc="upper right", ncols=3)
    return figure


def compensation_words(found: Compensated) -> str:
    """What compensation changes, in one sentence or two."""
    content = _compensation(found)
    return (
        "The predicted deflection under the cutting force is taken off the path: "
        f"up to {content['largest_um']:.3g} um, in the mean {content['mean_um']:.3g} um. What is left is what is not "
        f"known of it, up to +-{content['unknown_95_um']:.3g} um (95 %), and what the model leaves out "
        f"(the search itself came to rest within {max(content['left_um'], 0.01):.3g} um)."
    )


def _compensated(found: Compensated, pictures: Pictures) -> Section:
    moved = dict(zip("xyz", found.moved.T * 1e6, strict=True))
    figure = _lines(
        np.arange(len(found.moved), dtype=np.float64), moved, ("move", "taken off, um"), "Compensation, part axes"
    )
    blocks: list[Text | Note | Bullets | Picture] = [
        Text(compensation_words(found)),
        pictures.add(figure, "compensation", "What was taken off each point of the path."),
        Bullets(found.error.uncertain.notes),
    ]
    if found.capped.any():
        blocks.append(Note(f"At {int(found.capped.sum())} moves the cap was reached: there the rest stays."))
    return Section("Compensation", tuple(blocks))


def _reading(run: PostRun) -> Section:
    motions = run.posted.program.motions
    events: dict[str, int] = {}
    for event in motions.events:
        events[event.word] = events.get(event.word, 0) + 1
    counted = ", ".join(f"{word} {count}" for word, count in sorted(events.items())[:40])
    blocks: list[Text | Bullets] = [Text(f"Words that are no motion: {counted or 'none'}.")]
    if motions.notes:
        blocks.append(Bullets(tuple(str(note) for note in motions.notes[:40])))
    return Section("What was read", tuple(blocks), folded=True)
