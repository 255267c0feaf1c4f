"""report.html of a posture along a path: what is recommended, what it gains, how the joints move, what to know."""

from __future__ import annotations

import datetime as dt

import numpy as np

from machining import Course
from stiffarm import __version__
from stiffarm.figures_posture import joints_figure
from stiffarm.machining_options import frame_words
from stiffarm.outputs import OutputFolder
from stiffarm.posing import BEFORE, CHOSEN, EACH, FIXED, Posed, gain
from stiffarm.posture_payload import quantity
from stiffarm.report import Bullets, KeyFigure, Note, Section, Table, Text, render
from stiffarm.story_blocks import Pictures

MEANINGS = {
    CHOSEN: "gamma, branch and turns of the joints chosen for the whole path at once, so that it can be driven",
    BEFORE: "the gamma that the program has now",
    FIXED: "the best single gamma that can be driven",
    EACH: "the paper's rule: every point its own best; nothing keeps it from jumping",
}


def write_report(posed: Posed, title: str, folder: OutputFolder, extra: tuple[Section, ...] = ()) -> None:
    """Draw the figures and write report.html; ``extra`` sections stand after the courses."""
    pictures = Pictures(folder)
    sections = [courses_section(posed), *extra, motion_section(posed, pictures), how_section(posed)]
    request = posed.request
    lede = (
        f"Posture along a path of {request.task.path.n} points, {posed.arc_mm[-1]:.4g} mm; tool on the flange "
        f"{frame_words(request.task.T_flange_tool)}; part in the base frame {frame_words(request.task.T_base_part)}."
    )
    footer = f"stiffarm {__version__}, {dt.datetime.now(dt.UTC):%Y-%m-%d %H:%M} UTC. Versions and command: run.json."
    question = "which posture along the path?"
    folder.write_text("report.html", render(title, lede, _key_figures(posed), sections, footer, question))


def _key_figures(posed: Posed) -> list[KeyFigure]:
    _, words, factor = quantity(posed.request.objective)
    out = [
        KeyFigure(f"{posed.course.mean * factor:.4g}", f"mean {words}"),
        KeyFigure(f"{posed.course.worst * factor:.4g}", f"{words}, worst point"),
    ]
    for name in (BEFORE, FIXED):
        if name in posed.others:
            out.append(KeyFigure(gain_words(posed, posed.others[name]), f"mean against {name}"))
    return out


def gain_words(posed: Posed, other: Course) -> str:
    """By how much the recommended course is better in the mean."""
    factor = gain(posed.request.objective, posed.course, other)
    if not np.isfinite(factor) or factor >= 3.0:
        return f"{factor:.3g} times better"
    return f"{100.0 * (factor - 1.0):+.1f} %"


def courses_section(posed: Posed) -> Section:
    """What is recommended beside the other choices."""
    _, words, factor = quantity(posed.request.objective)
    rows = []
    for name, course in ({CHOSEN: posed.course} | posed.others).items():
        moves = course.smoothness
        rows.append(
            (
                name,
                f"{course.mean * factor:.4g}",
                f"{course.worst * factor:.4g}",
                f"{np.degrees(course.gamma.min()):.4g} to {np.degrees(course.gamma.max()):.4g}",
                str(moves.branch_changes),
                f"{np.degrees(moves.largest_step.max(initial=0.0)):.3g}",
                "yes" if not moves.undrivable else f"no, {len(moves.undrivable)} segments",
            )
        )
    columns = (
        "course",
        f"mean {words}",
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


def remarks(posed: Posed) -> list[str]:
    """What a user must know about the result."""
    request, moves = posed.request, posed.course.smoothness
    out = []
    if posed.why_no_before is not None:
        out.append(
            f"As programmed (gamma {np.degrees(request.before):.4g} deg) it cannot be driven: {posed.why_no_before}."
        )
    if posed.found.why_no_fixed is not None:
        out.append(f"No single gamma can be driven along the whole path: {posed.found.why_no_fixed}.")
    if request.drive.speed is None:
        out.append("Joint speeds were not looked at: give --speed, or a cell file with joint speeds.")
    elif np.isnan(request.task.path.times).any():
        out.append("Points without a feed: between them joint speeds could not be looked at.")
    if request.drive.clearance_of is None:
        out.append("Collisions were not looked at: give a cell file with --cell.")
    if not posed.found.sure:
        out.append("This arm's inverse kinematics is searched; some postures may have been missed.")
    if moves.singular_distance < request.drive.singular_zone:
        out.append(f"The course comes near a singularity (distance {moves.singular_distance:.2g}).")
    if moves.limit_distance < request.drive.limit_zone:
        out.append(f"The course comes within {np.degrees(moves.limit_distance):.3g} deg of a joint limit.")
    if moves.branch_changes:
        out.append(
            f"The course changes its branch {moves.branch_changes} times, through poses where two branches meet."
        )
    return out


def motion_section(posed: Posed, pictures: Pictures) -> Section:
    """How the joints move."""
    robot = posed.model.robot
    drawn = {CHOSEN: posed.course} | {n: c for n, c in posed.others.items() if n in (BEFORE, EACH)}
    figure = joints_figure(
        posed.arc_mm,
        {name: np.degrees(course.q) for name, course in drawn.items()},
        robot.coordinates,
        np.degrees(robot.limits),
    )
    caption = "Joint angles along the path; beyond the dotted lines are the limits."
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
        (pictures.add(figure, "joints", caption), Table("The recommended course, joint by joint", columns, rows)),
    )


def how_section(posed: Posed) -> Section:
    """How it was found, and what that leaves out."""
    request, drive = posed.request, posed.request.drive
    reference = ", ".join(f"{v:.3g}" for v in np.asarray(request.task.reference))
    return Section(
        "How it was found",
        (
            Text(
                f"{request.gammas.count} angles gamma, all branches and turns of the joints at every point; the course "
                "through them by dynamic programming, then on finer grids about it. Costs beside the objective: "
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
    )
