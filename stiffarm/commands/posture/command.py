"""The command `posture`: from a part's path to the posture along it, beside other courses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from fem.arm import Arm
from machining import INDICES, GammaRange, Objective, limit_distance, singular_distance
from machining.cutting import Estimated, SurfaceError, stiffness_uncertainty
from machining.posture import posing
from machining.posture.posing import BEFORE, CHOSEN, EACH, FIXED, Posed, map_of
from machining.programs.run import deflects
from machining.setup import Setup
from machining.stiffness.objective import DISPLACEMENTS, ROOM, shown
from machining.toolpaths.conversion import GivenPath
from robots import InputError, Remark
from robots.arrays import Array
from robots.inverse.following import is_redundant
from robots.quantities import QUANTITIES, Quantity, angle, change, count, length, stored
from stiffarm.capability import capability
from stiffarm.commands.posture.course import (
    ERROR_SD,
    PATH_LENGTH,
    angles_text,
    course_values,
    elbow_range,
    joints_drawing,
    prefixed,
)
from stiffarm.pages.arm_uncertainty import ERROR, error_remarks, figure, sentence, share_remarks, spread
from stiffarm.pages.arm_uncertainty import payload as arm_uncertainty
from stiffarm.pages.report import Bullets, KeyFigure, Section, Text
from stiffarm.path_request import GAMMA, CourseRequest, effects_left_out, path_remarks
from stiffarm.request import option, seed, word
from stiffarm.result import Drawing, Result, Table, plain
from stiffarm.session.console import progress
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.parsing import frame_words, tool_words
from stiffarm.session.softness import require_springs
from stiffarm.session.stated import stated_table
from stiffarm.session.task_options import gammas_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# A range so narrow (rad) is one angle.
FIXED_HALF_WIDTH = 1e-10
CHOICES = (*INDICES, *DISPLACEMENTS, ROOM)


@dataclass(frozen=True, kw_only=True)
class PostureRequest(CourseRequest):
    """Find the stiffest posture along a tool path.

    Chooses the angle gamma about the tool axis, branch and turns of the joints such that the arm can follow the path.
    Writes report.html, axes.html (an axes map in which you can drag the course), posture.csv and posture.json into
    --out.

    Examples
    --------
    >>> import stiffarm as sa
    >>> files = "docs/examples/kr60_posture"
    >>> found = sa.posture("kr60-3", f"{files}/path.csv", cell=f"{files}/cell.toml", gamma=(-180, 180, 30))
    >>> bool(found["mean_k_fs"][0] > 0)
    True
    """

    gamma: float | Sequence[float] = option(
        "Angles gamma about the tool axis, in deg; the two ends of a full turn count once.",
        GAMMA,
        default=(-180.0, 180.0, 5.0),
    )
    before: float = option("Gamma of the existing program, in deg, for comparison.", metavar="DEG", default=0.0)
    quantity: str | None = option(
        f"Quantity to optimise: {', '.join(CHOICES)} (to joint limits and singularities). Default: k_fs; {ROOM} for "
        "an arm of which no stiffness is known.",
        word(CHOICES),
        metavar="NAME",
    )
    aim: Literal["mean", "worst"] = option(
        "Optimise the mean over the points of the path, or the worst point: mean or worst.",
        word(("mean", "worst")),
        default="mean",
    )
    jump: float = option(
        "Maximum joint motion between two neighbouring points, in deg.", metavar="DEG", default=20.0, least=1e-6
    )
    gamma_step: float | None = option(
        "Maximum change of gamma from point to point, in deg; 0 for one gamma along the path. Default: no limit.",
        metavar="DEG",
        least=0.0,
    )
    limit_margin: float = option(
        "Distance to keep from the joint limits, in deg.", metavar="DEG", default=0.5, least=0.0
    )
    seed: int = seed()


def answer(given: Arm, asked: PostureRequest) -> Result:
    """The course along the path beside others, with intervals."""
    arm = asked.at_its_load(given.as_designed)
    setup = asked.setup(arm)
    springless = not deflects(arm.model)
    if springless and (asked.force is not None or asked.milling is not None or asked.quantity not in (None, ROOM)):
        require_springs(arm, "posture")
    path = asked.given_path()
    task = setup.task(path, asked.counts_from)
    cut = None if springless else asked.cut(setup.cell, path.motions)
    if cut is not None:
        cut = replace(cut, force=path.acting(cut.force), tool=path.bending(cut.tool))
    drive = asked.limits(
        arm.robot,
        jump=float(np.radians(asked.jump)),
        limit_least=float(np.radians(asked.limit_margin)),
        turn_gain=0.01 * asked.turn_gain,
        gamma_step=np.inf if asked.gamma_step is None else float(np.radians(asked.gamma_step)),
    )
    gammas = gammas_of(asked.gamma)
    request = posing.PostureRequest(
        task,
        _objective(asked, ROOM if springless else "k_fs", None if cut is None else cut.force.along(task).force),
        gammas
        if isinstance(gammas, GammaRange)
        else GammaRange(gammas - FIXED_HALF_WIDTH, gammas + FIXED_HALF_WIDTH, 2),
        setup.drive(drive, given=path),
        float(np.radians(asked.before)),
        asked.seed,
        cut,
        tuple(effects_left_out(arm)),
        stiffness_uncertainty(arm.model, arm.description, arm.own),
    )
    with progress("posture along the path") as bar:
        posed = posing.pose_along(arm.model, request, bar)
    return result(arm, posed, setup, path)


def _objective(asked: PostureRequest, usual: str, force: Array | None) -> Objective:
    name = asked.quantity or usual
    if force is None and name != ROOM and (name in DISPLACEMENTS or "force" in INDICES[name].uses):
        raise InputError(f"--quantity {name} needs a force", code="A003", remedy="give --force or --milling")
    return Objective(name, force, asked.aim)


MEANINGS: Final = {
    CHOSEN: "gamma, branch and turns of the joints chosen for the whole path at once, so that it can be driven",
    BEFORE: "the gamma that the program has now",
    FIXED: "the best single gamma that can be driven",
    EACH: "the paper's rule: every point its own best; nothing keeps it from jumping",
}
GAIN: Final = Quantity("gain", label="gain over it, mean: factor")
LIMIT: Final = QUANTITIES["joint_limit"]
SINGULARITY: Final = QUANTITIES["singularity"]
STEP: Final = angle("largest_step", "largest step")
SPEED: Final = Quantity("peak_speed", "deg/s", 180.0 / np.pi, "peak speed")
STATISTICS: Final = {
    "rms": "RMS",
    "worst": "worst",
    "mean": "mean",
    "peak_to_valley": "peak to valley",
}
MAP_CAPTION: Final = (
    "by path and gamma, the colour is the best branch's value. Grey and hatched zones are barred. Lines are the "
    "courses, below them their values. The map does not say between which cells the arm can be driven."
)


def result(arm: Arm, posed: Posed, setup: Setup, given: GivenPath) -> Result:
    """The result of `posture`."""
    request, path = posed.request, posed.request.task.path
    courses = {CHOSEN: posed.course} | posed.others
    heading = arm.description.title.split(" (")[0]

    def more(folder: OutputFolder) -> Mapping[str, Any]:
        from stiffarm.commands.posture.axes_page import NAME, axes_page, axes_study

        study = axes_study(posed, setup, given)
        if study is not None:
            folder.write_text(NAME, axes_page(study, heading))
        return {}

    drawings = [
        joints_drawing(path.arc_length, {name: courses[name].q for name in courses if name != FIXED}, arm.robot)
    ]
    if posed.milling is not None and path.n > 1:
        caption = "Predicted error along the path with 95 % bands."
        drawings.insert(0, Drawing("milling_error", caption, "predicted error", partial(_errors, posed)))
    if path.n > 1 and request.gammas.count > 2:
        caption = f"Axes map: {shown(request.objective.quantity).heading} {MAP_CAPTION}"
        drawings.insert(0, Drawing("axes_map", caption, "axes map", partial(_map, posed)))
    known = " Static stiffness of the arm only." if posed.stiffness.names else ""
    return Result(
        name="posture",
        title=heading,
        question="which posture along the path?",
        answer=_answer(posed),
        how_sure=sentence(posed.stiffness) + known,
        what_next="Write the program with these angles: `stiffarm post` chooses them the same way. Then check it with "
        "`stiffarm verify` before the cell moves. axes.html lets you drag the course and see what it costs; "
        "posture.csv has gamma, branch and joints of every point.",
        facts=_facts(arm, posed),
        tables=(_points(posed), _courses(posed), *_surface_errors(posed), _joints(posed)),
        drawings=tuple(drawings),
        key=tuple(_key(posed)),
        sections=_sections(posed),
        remarks=(*path_remarks(arm, setup, given.notes), *remarks(posed)),
        arm=arm,
        found=posed,
        more=more,
    )


def _map(posed: Posed) -> Figure:
    from stiffarm.commands.posture.figures.axes_map import course_lines, draw_axes_map

    made = map_of(posed)
    assert made is not None  # noqa: S101 - asked before
    return draw_axes_map(made, course_lines(posed.found, posed.before), title="", narrow=True)


def _errors(posed: Posed) -> Figure:
    from stiffarm.commands.posture.figures.along_path import milling_error_figure

    assert posed.milling is not None  # noqa: S101 - asked before
    return milling_error_figure(posed.milling.errors, posed.milling.comparison)


def _facts(arm: Arm, posed: Posed) -> dict[str, Any]:
    request = posed.request
    task, gammas = request.task, request.gammas
    not_found = {BEFORE: posed.why_no_before, FIXED: posed.found.why_no_fixed}
    facts = {
        "robot": arm.robot.name,
        "links": arm.model.link_kind,
        "load_path": arm.model.load_path,
        "effects_left_out": effects_left_out(arm),
        **stated_table(arm.model),
        "quantity": shown(request.objective.quantity).column,
        "aim": request.objective.aim,
        "path_points": task.path.n,
        **stored({PATH_LENGTH: task.path.arc_length[-1]}),
        "gamma_grid": stored({angle("from"): gammas.lower, angle("to"): gammas.upper}) | {"count": gammas.count},
        "gamma_counts_from": plain(np.asarray(task.reference)),
        "tool_on_flange": tool_words(task.T_flange_tool),
        "part_in_base": frame_words(task.T_base_part),
        **stored({angle("as_programmed_gamma"): request.before}),
        "all_solutions_found": posed.found.sure,
        "stiffness_uncertainty": arm_uncertainty(posed.stiffness),
        "not_found": {name: why for name, why in not_found.items() if why is not None},
    }
    if posed.milling is not None and posed.milling.comparison is not None:
        facts["surface_error_against"] = posed.milling.against
        facts["surface_error_rests_on"] = list(posed.milling.comparison.notes)
    return facts


def _points(posed: Posed) -> Table:
    """Where the path's points are, the recommended posture, and the quantity of every course."""
    course, robot, path = posed.course, posed.model.robot, posed.request.task.path
    quantity = shown(posed.request.objective.quantity)
    values = course_values(robot, path, course) | {quantity: course.value}
    values |= {prefixed(name, quantity): other.value for name, other in posed.others.items()}
    for name, error in _all_errors(posed).items():
        values |= {prefixed(name, ERROR): error.normal, prefixed(name, ERROR_SD): error.sd}
    values |= {LIMIT: limit_distance(robot, course.q), SINGULARITY: singular_distance(robot, course.q)}
    labels = {"point": [str(k) for k in range(path.n)], "branch": [course.names[b] for b in course.branch]}
    return Table("points", "Points of the path", labels, values, only_in="csv")


def _all_errors(posed: Posed) -> dict[str, SurfaceError]:
    return {} if posed.milling is None else posed.milling.errors


def _courses(posed: Posed) -> Table:
    """What is recommended beside the other choices."""
    quantity, known = shown(posed.request.objective.quantity), posed.request.objective.quantity != ROOM
    courses = {CHOSEN: posed.course} | posed.others
    moves = [course.smoothness for course in courses.values()]
    mean, worst = (
        replace(quantity, key=f"{what}_{quantity.key}", label=f"{quantity.name}, {what}") for what in ("mean", "worst")
    )
    found = dict(zip((mean, worst), zip(*(posed.estimated(name) for name in courses), strict=True), strict=True))
    of_itself = Estimated(np.nan, np.nan, np.nan)
    table = spread({**found, GAIN: [of_itself, *(posed.gain(name) for name in posed.others)]})
    return Table(
        "courses",
        f"Courses; the aim is the {posed.request.objective.aim} {quantity.name} along the path",
        {"course": list(courses)},
        table["values"]
        | {
            angle("gamma_from", "gamma from"): np.array([course.gamma.min() for course in courses.values()]),
            angle("gamma_to", "gamma to"): np.array([course.gamma.max() for course in courses.values()]),
            count("undrivable_segments", "undrivable segments"): np.array([len(one.undrivable) for one in moves]),
        },
        table["intervals"] if known else {},
        {
            count("branch_changes"): np.array([one.branch_changes for one in moves]),
            STEP: np.array([one.largest_step.max(initial=0.0) for one in moves]),
            angle("joint_travel"): np.array([one.travel for one in moves]),
            replace(LIMIT, key="least_joint_limit"): np.array([one.limit_distance for one in moves]),
            replace(SINGULARITY, key="least_singularity"): np.array([one.singular_distance for one in moves]),
        },
        {
            "branches": [sorted({course.names[b] for b in course.branch}) for course in courses.values()],
            **{
                key: [elbow_range(posed.model.robot, course.q)[key] for course in courses.values()]
                for key in elbow_range(posed.model.robot, posed.course.q)
            },
        },
    )


def _surface_errors(posed: Posed) -> list[Table]:
    """The predicted surface error of courses, and how it changes; none without a cutting force."""
    if posed.milling is None:
        return []
    errors, comparison = posed.milling.errors, posed.milling.comparison
    found = [error.estimated(np.random.default_rng(posed.request.seed)) for error in errors.values()]
    out = [
        Table(
            "surface_error",
            "Predicted displacement along the surface normal under the cutting force, static; above 0 is material left",
            {"course": list(errors)},
            **spread({length(s, words, "um"): [one[s] for one in found] for s, words in STATISTICS.items()}),
        )
    ]
    if comparison is not None:
        changes = comparison.changes
        differences = {
            length("difference", unit="um"): [changes[name].difference for name in changes],
            Quantity("factor", label="times smaller"): [changes[name].factor for name in changes],
        }
        labels = {"statistic": list(changes), "verdict": [str(change.verdict) for change in changes.values()]}
        caption = f"How the surface error changes against: {posed.milling.against}"
        out.append(Table("change", caption, labels, **spread(differences)))
    return out


def _joints(posed: Posed) -> Table:
    """How the joints move along each course."""
    robot, courses = posed.model.robot, {CHOSEN: posed.course} | posed.others
    low, high = (np.tile(ends, len(courses)) for ends in robot.limits.T)
    each = courses.values()
    return Table(
        "joints",
        "The courses, joint by joint",
        {
            "course": [name for name in courses for _ in robot.coordinates],
            "joint": [name.removesuffix("_deg") for name in robot.coordinates] * len(courses),
        },
        {
            angle("from"): np.concatenate([course.q.min(axis=0) for course in each]),
            angle("to"): np.concatenate([course.q.max(axis=0) for course in each]),
            angle("lower_limit", "lower limit"): low,
            angle("upper_limit", "upper limit"): high,
            STEP: np.concatenate([course.smoothness.largest_step for course in each]),
            SPEED: np.concatenate([course.smoothness.peak_speed for course in each]),
        },
        folded=True,
    )


def _gain(posed: Posed, name: str) -> tuple[str, str]:
    """By how much the recommended course is better in the mean than another, and the interval of that."""
    gain = posed.gain(name)
    known = posed.request.objective.quantity != ROOM
    return change(gain.value), f"95 %: {change(gain.low)} to {change(gain.high)}" if known else ""


def _answer(posed: Posed) -> str:
    """Which gamma, what that is worth at the worst point, and against what the program has now."""
    course, path, quantity = posed.course, posed.request.task.path, shown(posed.request.objective.quantity)
    worst = quantity.text(course.worst, unit=True)
    out = f"Gamma {angles_text(course.gamma)} along the path: {quantity.name} {worst} at the worst point"
    if BEFORE in posed.others:
        gamma = angles_text(np.array([posed.request.before]))
        out += f", the mean {_gain(posed, BEFORE)[0]} against gamma {gamma} as programmed"
    elif posed.why_no_before is not None:
        out += "; as programmed the arm cannot follow it"
    return f"{out}. Path of {path.n} points, {PATH_LENGTH.text(path.arc_length[-1], unit=True)}."


def _key(posed: Posed) -> list[KeyFigure]:
    quantity = shown(posed.request.objective.quantity)
    mean, worst = posed.estimated(CHOSEN)
    out = [figure(quantity, worst, f"{quantity.name}, worst point of the path")]
    out.append(figure(quantity, mean, f"{quantity.name}, mean over the path"))
    for other in (BEFORE, FIXED):
        if other in posed.others:
            value, interval = _gain(posed, other)
            out.append(KeyFigure(value, f"mean against: {other}", interval))
    for name, error in _all_errors(posed).items():
        rms = error.estimated(np.random.default_rng(posed.request.seed))["rms"]
        out.append(figure(ERROR, rms, f"RMS error under the cutting force, {name}"))
    return out


def _sections(posed: Posed) -> tuple[Section, ...]:
    request, drive = posed.request, posed.request.drive
    task = request.task
    reference = ", ".join(f"{v:.3g}" for v in np.asarray(task.reference))
    milling = posed.milling
    compared = "" if milling is None or milling.comparison is None else milling.comparison.sentence
    return (
        Section(
            "What the courses are",
            (
                Bullets(tuple(f"{name}: {MEANINGS[name]}." for name in (CHOSEN, *posed.others))),
                *(
                    [Text(f"Surface error compared with: {milling.against}. {compared}")]
                    if milling and compared
                    else []
                ),
            ),
        ),
        Section(
            "How it was found",
            (
                Text(
                    f"Tool on the flange {tool_words(task.T_flange_tool)}; part in the base frame "
                    f"{frame_words(task.T_base_part)}. {request.gammas.count} angles gamma, all branches and turns of "
                    "the joints at every point; the course through them by dynamic programming, then on finer grids "
                    "about it. Costs beside the objective: "
                    f"motion {drive.motion:g}, nearness of limits {drive.limit:g} within "
                    f"{LIMIT.text(drive.limit_zone, unit=True)}, of singularities {drive.singular:g} within "
                    f"{drive.singular_zone:g}. No joint steps by more than {STEP.text(drive.jump, unit=True)} at once."
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
        ),
    )


def remarks(posed: Posed) -> list[str]:
    """What a user must know about the result."""
    request, moves = posed.request, posed.course.smoothness
    out: list[str] = []
    if posed.why_no_before is not None:
        out.append(
            Remark(
                f"As programmed (gamma {angles_text(np.array([request.before]))}) the arm cannot follow the path: "
                f"{posed.why_no_before}.",
                code="W049",
            )
        )
    if posed.found.why_no_fixed is not None:
        out.append(f"With no single gamma can the arm follow the whole path: {posed.found.why_no_fixed}.")
    if posed.course.forgone is not None:
        out.append(
            f"Gamma is constant: turning it along the path would gain {100.0 * posed.course.forgone:.2g} % only "
            f"(--turn-gain {100.0 * request.drive.turn_gain:.3g})."
        )
    if request.left_out:
        out.append(f"Effects of the model that are not included: {', '.join(request.left_out)}.")
    if request.drive.speed is None:
        out.append(
            Remark("Joint speeds were not checked: give --speed, or a cell file with joint speeds.", code="W034")
        )
    elif np.isnan(request.task.path.times).any():
        out.append(Remark("Some points have no feed: between them joint speeds could not be checked.", code="W034"))
    if request.drive.clearance_of is None and request.drive.clearance_at is None:
        out.append(Remark("Collisions were not checked: no shape of the arm is known.", code="W033"))
    if posed.milling is None and request.objective.quantity != ROOM:
        out.append("No error was predicted: give --force or --milling.")
    if is_redundant(posed.model.robot):
        out.append(
            Remark(
                f"This arm reaches each point in postures without number: some of them, found from random starts, were "
                f"followed along the path, and the {posed.course.names[0]} was chosen together with gamma; some "
                "postures may have been missed.",
                code="W044",
            )
        )
    elif not posed.found.sure:
        out.append(
            Remark("This arm's inverse kinematics is searched; some postures may have been missed.", code="W044")
        )
    if moves.singular_distance < request.drive.singular_zone:
        out.append(
            Remark(
                f"The course comes near a singularity (distance {SINGULARITY.text(moves.singular_distance)}).",
                code="W035",
            )
        )
    if moves.limit_distance < request.drive.limit_zone:
        out.append(
            Remark(
                f"The course comes within {LIMIT.text(moves.limit_distance, unit=True)} of a joint limit.", code="W036"
            )
        )
    compared = None if posed.milling is None else posed.milling.comparison
    if compared is not None and compared.changes["rms"].verdict == "larger" and not request.objective.minimised:
        out.append(
            Remark(
                f"This course is better in {request.objective.quantity} and yet leaves a larger error under the force "
                'given: to optimise the error itself, use --quantity "normal displacement".',
                code="W046",
            )
        )
    out += share_remarks(posed.drawn[CHOSEN].matters, f"the mean {request.objective.quantity}")
    out += [] if posed.milling is None else error_remarks(posed.milling.errors[CHOSEN])
    if moves.branch_changes:
        out.append(
            Remark(
                f"The course changes its branch {moves.branch_changes} times, through poses where two branches meet.",
                code="W035",
            )
        )
    return out


posture = capability("posture", PostureRequest, answer)
