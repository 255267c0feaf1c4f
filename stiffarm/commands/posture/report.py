"""report.html of a posture along a path: what is recommended, what it gains, how the joints move, what to know."""

from __future__ import annotations

import numpy as np

from machining.posture.posing import BEFORE, CHOSEN, EACH, FIXED, Posed, map_of
from machining.stiffness.objective import ROOM
from robots.quantities import known_to, ranged, significant, with_interval
from stiffarm.commands.posture.figures.along_path import joints_picture, milling_error_figure
from stiffarm.commands.posture.figures.axes_map import course_lines, draw_axes_map
from stiffarm.commands.posture.payload import course_cells, gain_words, quantity, remarks
from stiffarm.pages.arm_uncertainty import sentence
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Answer, Bullets, KeyFigure, Note, Picture, Section, Table, Text, write_page
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.parsing import frame_words, tool_words

MEANINGS = {
    CHOSEN: "gamma, branch and turns of the joints chosen for the whole path at once, so that it can be driven",
    BEFORE: "the gamma that the program has now",
    FIXED: "the best single gamma that can be driven",
    EACH: "the paper's rule: every point its own best; nothing keeps it from jumping",
}


def write_report(posed: Posed, title: str, folder: OutputFolder) -> None:
    """Draw the figures and write report.html."""
    pictures = Pictures(folder)
    sections = [courses_section(posed), *error_sections(posed, pictures)]
    sections += [motion_section(posed, pictures), how_section(posed)]
    missing = [text for text in remarks(posed) if "not checked" in text or "not included" in text]
    answer = Answer(
        sure=sentence(posed.stiffness) + (" Static stiffness of the arm only." if posed.stiffness.names else ""),
        todo=TODO,
        picture=map_picture(posed, pictures),
        warnings=tuple(missing),
    )
    write_page(
        folder, title, lede(posed), _key_figures(posed), sections, "which posture along the path?", answer=answer
    )


TODO = (
    "Write the program with these angles: `stiffarm post` chooses them the same way. Then check it with "
    "`stiffarm verify` before the cell moves. axes.html lets you drag the course and see what it costs; posture.csv "
    "has gamma, branch and joints of every point."
)


def lede(posed: Posed) -> str:
    """Which gamma, what that is worth at the worst point, and against what the program has now."""
    course = posed.course
    _, words, factor = quantity(posed.request.objective)
    low, high = np.degrees([course.gamma.min(), course.gamma.max()])
    angle = f"{low:.4g} deg" if high - low < 1e-6 else f"{low:.4g} to {high:.4g} deg"
    name, _, unit = words.partition(", ")
    path = posed.request.task.path
    out = (
        f"Gamma {angle} along the path: {name} {significant(course.worst * factor, 4)} {unit}".strip()
        + " at the worst point"
    )
    if BEFORE in posed.others:
        gamma = np.degrees(posed.request.before)
        out += f", the mean {gain_words(posed, BEFORE)} against gamma {gamma:.4g} deg as programmed"
    elif posed.why_no_before is not None:
        out += "; as programmed the arm cannot follow it"
    return f"{out}. Path of {path.n} points, {significant(1e3 * path.arc_length[-1])} mm."


def _key_figures(posed: Posed) -> list[KeyFigure]:
    _, words, factor = quantity(posed.request.objective)
    name, _, unit = words.partition(", ")
    mean, worst = posed.estimated(CHOSEN)
    known = posed.request.objective.quantity != ROOM
    out = [
        KeyFigure(
            f"{known_to(found.value * factor, found.low * factor, found.high * factor)} {unit}".strip()
            if known
            else significant(found.value * factor),
            f"{name}, {what}",
            f"95 %: {ranged(found.low * factor, found.high * factor, unit, 3)}" if known else "",
        )
        for found, what in ((worst, "worst point of the path"), (mean, "mean over the path"))
    ]
    for other in (BEFORE, FIXED):
        if other in posed.others:
            value, _, interval = gain_words(posed, other).partition(" (")
            out.append(KeyFigure(value, f"mean against {other}", f"95 %: {interval.rstrip(')')}" if interval else ""))
    if posed.milling is not None and posed.milling.comparison is not None:
        for statistic, what in (("rms", "RMS error"), ("peak_to_valley", "error from peak to valley")):
            change = posed.milling.comparison.changes[statistic]
            out.append(
                KeyFigure(
                    f"{change.before.value * 1e6:.3g} → {change.after.value * 1e6:.3g} um",
                    f"{what} under the cutting force, {posed.milling.against} and now",
                    f"95 % of now: {ranged(change.after.low * 1e6, change.after.high * 1e6, 'um')}",
                )
            )
    elif posed.milling is not None:
        rms = posed.milling.errors[CHOSEN].estimated(np.random.default_rng(posed.request.seed))["rms"]
        out.append(
            KeyFigure(
                f"{rms.value * 1e6:.3g} um",
                "RMS error under the cutting force",
                f"95 %: {ranged(rms.low * 1e6, rms.high * 1e6, 'um')}",
            )
        )
    return out


def courses_section(posed: Posed) -> Section:
    """What is recommended beside the other choices."""
    _, words, _ = quantity(posed.request.objective)
    rows = []
    for name, course in ({CHOSEN: posed.course} | posed.others).items():
        moves = course.smoothness
        undrivable = len(moves.undrivable)
        rows.append(
            (
                *course_cells(posed, name, course),
                str(moves.branch_changes),
                f"{np.degrees(moves.largest_step.max(initial=0.0)):.3g}",
                f"no, {undrivable} segments" if undrivable else "yes",
            )
        )
    columns = (
        "course",
        f"mean {words}",
        "95 % of the mean",
        "worst point",
        "gamma, deg",
        "branch changes",
        "largest step, deg",
        "drivable",
    )
    blocks: list[Text | Note | Table | Bullets] = [
        Text(f"The aim is the {posed.request.objective.aim} {words.split(',')[0]} along the path."),
        Table("Courses along the path", columns, tuple(rows), best=0),
        Bullets(tuple(f"{name}: {MEANINGS[name]}." for name in (CHOSEN, *posed.others))),
    ]
    blocks += [Note(text) for text in remarks(posed)]
    return Section("Which posture", tuple(blocks))


def map_picture(posed: Posed, pictures: Pictures) -> Picture | None:
    """The axes map with the courses; nothing for a path of one point."""
    made = map_of(posed)
    if made is None:
        return None
    _, words, _ = quantity(posed.request.objective)
    figure = draw_axes_map(made, course_lines(posed.found, posed.before), title="", narrow=True)
    caption = (
        f"Axes map: {words} by path and gamma, the colour is the best branch's value. Grey and hatched zones are "
        "barred. Lines are the courses, below them their values. The map does not say between which cells the arm can "
        "be driven."
    )
    return pictures.add(figure, "axes_map", caption)


def error_sections(posed: Posed, pictures: Pictures) -> list[Section]:
    """The predicted surface error before and after; nothing without a cutting force."""
    milling = posed.milling
    if milling is None:
        return []
    columns = ("course", "RMS, um", "worst, um", "mean, um", "peak to valley, um")
    rows = []
    for name, error in milling.errors.items():
        found = error.estimated(np.random.default_rng(posed.request.seed))
        cells = [
            with_interval(1e6 * found[s].value, 1e6 * found[s].low, 1e6 * found[s].high)
            for s in ("rms", "worst", "mean", "peak_to_valley")
        ]
        rows.append((name, *cells))
    blocks: list[Text | Note | Table | Picture] = [
        Text(
            "Displacement of the tool along the surface normal under the cutting force, statics only; more than 0 "
            "leaves material standing. In brackets: 95 % intervals."
        ),
        Table("Predicted surface error", columns, tuple(rows), best=len(rows) - 1),
    ]
    if posed.request.task.path.n > 1:
        figure = milling_error_figure(milling.errors, milling.comparison)
        blocks.append(pictures.add(figure, "milling_error", "Predicted error along the path with 95 % bands."))
    if milling.comparison is not None:
        blocks.append(Text(f"Compared with {milling.against}: {milling.comparison.sentence}"))
    else:
        blocks.append(Note("There is no other course that can be driven, so nothing to compare with."))
    return [Section("What error the cutting force leaves", tuple(blocks))]


def motion_section(posed: Posed, pictures: Pictures) -> Section:
    """How the joints move."""
    robot = posed.model.robot
    drawn = {CHOSEN: posed.course} | {n: c for n, c in posed.others.items() if n in (BEFORE, EACH)}
    joints = {name: course.q for name, course in drawn.items()}
    picture = joints_picture(pictures, posed.request.task.path.arc_length, joints, robot)
    moves = posed.course.smoothness
    peak = np.degrees(moves.peak_speed)
    rows = tuple(
        (
            name.removesuffix("_deg"),
            f"{np.degrees(posed.course.q[:, j].min()):.1f} to {np.degrees(posed.course.q[:, j].max()):.1f}",
            f"{np.degrees(robot.limits[j, 0]):.4g} to {np.degrees(robot.limits[j, 1]):.4g}",
            f"{np.degrees(moves.largest_step[j]):.3g}",
            "no feed given" if np.isnan(peak[j]) else f"{peak[j]:.3g}",
        )
        for j, name in enumerate(robot.coordinates)
    )
    columns = ("joint", "moves over, deg", "limits, deg", "largest step, deg", "peak speed, deg/s")
    return Section(
        "How the joints move",
        (picture, Table("The recommended course, joint by joint", columns, rows)),
    )


def how_section(posed: Posed) -> Section:
    """How it was found, and what that leaves out."""
    request, drive = posed.request, posed.request.drive
    reference = ", ".join(f"{v:.3g}" for v in np.asarray(request.task.reference))
    task = request.task
    return Section(
        "How it was found",
        (
            Text(
                f"Tool on the flange {tool_words(task.T_flange_tool)}; part in the base frame "
                f"{frame_words(task.T_base_part)}. {request.gammas.count} angles gamma, all branches and turns of the "
                "joints at every point; the course through them by dynamic programming, then on finer grids about it. "
                "Costs beside the objective: "
                f"motion {drive.motion:g}, nearness of limits {drive.limit:g} within "
                f"{np.degrees(drive.limit_zone):.3g} deg, of singularities {drive.singular:g} within "
                f"{drive.singular_zone:g}. No joint steps by more than {np.degrees(drive.jump):.3g} deg at once."
            ),
            Bullets(
                (
                    f"Model: {posed.model.link_kind} links, {posed.model.load_path} load path, unloaded arm.",
                    "Static stiffness only: chatter, servo lag and the tool's own bending are not in it.",
                    "Gamma is right-handed about the tool axis, which leads from the tip into the holder; at 0 the "
                    f"tool frame's x axis is the part's direction ({reference}), laid across the tool axis.",
                )
            ),
        ),
        folded=True,
    )
