"""What a posted program is like: how it was read back, its posture, and what was taken off the path."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from fem.arm import Arm
from machining import singular_distance
from machining.programs.approach import Approach, Approached
from machining.programs.calibrated_arm import Corrected
from machining.programs.compensation import Compensated
from machining.programs.formats import FORMATS
from machining.programs.run import PostRun
from machining.stiffness.objective import shown
from machining.toolpaths.events import ordered
from robots import Remark
from robots.arrays import Array, Bools
from robots.constants import NORMAL_95
from robots.inverse.following import is_redundant
from robots.quantities import QUANTITIES, Quantity, angle, length, stored
from robots.schema.joint_errors import Positions
from stiffarm.commands.posture.course import GAMMA, angles_text, elbow_range, joints_drawing
from stiffarm.pages.arm_uncertainty import BY_ROOM, error_remarks, sentence, share_remarks
from stiffarm.pages.arm_uncertainty import payload as arm_uncertainty
from stiffarm.pages.report import Bullets, KeyFigure, Section, Text
from stiffarm.path_request import effects_left_out, path_remarks
from stiffarm.result import Drawing, Number, Result, Table, plain
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.stated import stated_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

UNVERIFIED: Final = Remark(
    "Nothing has been checked for collisions, speeds and singularities between points: run `stiffarm verify`.",
    code="W031",
)
CONTROLLER: Final = (
    "Joint and Cartesian targets are both moved, for a controller that computes with the arm as designed. Where its "
    "maker's own calibration is switched on (absolute accuracy), or joint zeros or lengths were corrected in it, the "
    "correction would count twice: calibrate and run with the same settings. Ratios, couplings and curves of joints "
    "are in the targets alone; between targets the controller goes straight, or joint by joint, as it always does."
)
PARTS: Final = ("geometry", "weight", "force")
SIGNS: Final = {1.0: "+", -1.0: "-", 0.0: "0"}
# Remarks and words of the tool path's file on the page.
MOST_READ: Final = 40
OFF_PATH, OFF_TURN = (Quantity("off_path", unit, 1e6, "off path", digits=2) for unit in ("um", "urad"))
LARGEST: Final = length("largest", unit="um")
MEAN: Final = length("mean", unit="um")
LEFT: Final = length("left", unit="um")
TURN: Final = Quantity("turn", "mrad", 1e3)
FAR: Final = length("far")
SINGULARITY: Final = QUANTITIES["singularity"]


def result(arm: Arm, run: PostRun, remarks: Sequence[str]) -> Result:
    """The result of `post`."""
    program, positions = run.program, arm.description.positions

    def more(folder: OutputFolder) -> Mapping[str, Any]:
        run.save(folder.path)
        return {}

    corrected = None if run.corrected is None or positions is None else (run.corrected, positions)
    taken_off = [] if run.compensated is None else [_compensation_words(run.compensated)]
    taken_off += [] if corrected is None else [_correction_words(*corrected)]
    return Result(
        name="post",
        title=arm.description.title.split(" (")[0],
        question="does the program follow the tool path?",
        answer=" ".join([_answer(run, "tool path" if corrected is None else "moved targets"), *taken_off]),
        how_sure=_how_sure(run),
        what_next=_what_next(run),
        facts=_facts(arm, run, corrected),
        numbers=_numbers(run),
        tables=(_programs(run), *([] if corrected is None else [_parts(corrected[0])])),
        drawings=tuple(_drawings(run)),
        key=tuple(_key(run)),
        sections=_sections(run),
        remarks=(
            *path_remarks(arm, run.request.setup, program.motions.notes),
            *remarks,
            *dict.fromkeys(note for target in run.trips for note in run.written[target].notes),
            *([] if corrected is None else _correction_remarks(run, corrected[0])),
            *_approach_words(run),
            UNVERIFIED,
        ),
        arm=arm,
        found=run,
        more=more,
    )


def _answer(run: PostRun, path: str) -> str:
    """How far the programs leave the path that they were written from, and how many points they have."""
    tips = max(trip.tip for trip in run.trips.values())
    inserted = int(run.posted.program.inserted.sum())
    aside = "" if run.approached is None else f", {len(run.approached.moves)} to come from the calibrated side"
    return (
        f"{len(run.trips)} program{'s' if len(run.trips) > 1 else ''} written from {run.program.motions.source}; read "
        f"back, none leaves the {path} by more than {OFF_PATH.text(max(tips, 1e-9), unit=True)}. "
        f"{run.request.motions.n} moves read, {run.program.n} written: {inserted} points put in so that joint motion "
        f"stays within {OFF_PATH.text(run.request.settings.tolerance, unit=True)} of the straight line{aside}."
    )


def _facts(arm: Arm, run: PostRun, corrected: tuple[Corrected, Positions] | None) -> dict[str, Any]:
    program, request, posted = run.program, run.request, run.posted
    facts: dict[str, Any] = {
        "robot": run.model.robot.name,
        "source": program.motions.source,
        "effects_left_out": effects_left_out(arm),
        **stated_table(arm.model),
        "moves_read": request.motions.n,
        "moves_written": program.n,
        "inserted": int(posted.program.inserted.sum()),
        **stored(
            {
                length("tolerance", unit="um"): request.settings.tolerance,
                length("largest_bend", unit="um"): posted.bend.max(initial=0.0),
                length("largest_bend_of_cuts", unit="um"): posted.bend_of_cuts,
                length("largest_bend_of_rapids", unit="um"): posted.bend_of_rapids,
                Quantity("least_distance_to_singularity"): singular_distance(run.model.robot, program.q).min(),
            }
        ),
        "gamma_counts_from": plain(np.asarray(posted.state.reference)),
        GAMMA.column: GAMMA.stored_values((program.gamma.min(), program.gamma.max())),
        "branches": sorted({program.names[b] for b in program.branch}),
        **elbow_range(run.model.robot, program.q),
        "gain_of_turning_gamma": posted.course.forgone,
        "chosen_by": posted.settings.objective.quantity,
        "commands": dict(Counter(event.kind for event in ordered(program.motions) if event.kind)),
    }
    if run.stiffness is not None:
        facts["stiffness_uncertainty"] = arm_uncertainty(run.stiffness)
    if run.approached is not None and request.approach is not None:
        facts["approach"] = _approach(run.approached, request.approach)
    if run.compensated is not None:
        facts["compensation"] = _compensation(run.compensated)
    if corrected is not None:
        facts["correction"] = _correction(*corrected)
    return facts


def _numbers(run: PostRun) -> dict[Quantity, Number]:
    """What the posture was chosen by: its mean and its worst value, with intervals where something deflects."""
    objective, posted = run.posted.settings.objective, run.posted
    quantity, worst = shown(objective.quantity), np.max if objective.minimised else np.min
    out = {}
    for what, value, of in (("worst", posted.worst, worst), ("mean", posted.mean, np.mean)):
        name = Quantity(f"{what}_{quantity.key}", quantity.unit, quantity.factor, f"{quantity.name}, {what}")
        found = None if run.drawn is None else run.drawn.estimated(lambda v, of=of: np.asarray(of(v, axis=-1)))  # type: ignore[misc]
        out[name] = Number(value) if found is None else Number(value, found.low, found.high)
    return out


def _programs(run: PostRun) -> Table:
    written = [run.written[target] for target in run.trips]
    return Table(
        "programs",
        "Programs, read back and compared with the tool path",
        {
            "program": [target.folder for target in run.trips],
            "format": [FORMATS[target.name].title for target in run.trips],
            "coordinates": ["both" if FORMATS[target.name].neutral else target.kind for target in run.trips],
            "files": [
                ", ".join(file.name for file in one.files[:3]) + (" ..." if len(one.files) > 3 else "")
                for one in written
            ],
        },
        {
            OFF_PATH: np.array([trip.tip for trip in run.trips.values()]),
            OFF_TURN: np.array([trip.turned for trip in run.trips.values()]),
        },
        extra={
            "sha256": [run.digests.get(target, {}) for target in run.trips],
            "notes": [list(one.notes) for one in written],
            "undefined_commands": [
                [{"what": u.what, "count": u.count, "first_line": u.line} for u in one.undefined] for one in written
            ],
        },
    )


def _how_sure(run: PostRun) -> str:
    """What intervals rest on and what they do not hold."""
    if run.stiffness is None or run.drawn is None:
        return BY_ROOM
    error = [] if run.compensated is None else error_remarks(run.compensated.error)
    what = f"the mean {run.request.settings.objective.quantity}"
    return " ".join([sentence(run.stiffness), *share_remarks(run.drawn.matters, what), *error])


def _what_next(run: PostRun) -> str:
    """What to do before the cell moves, with the file to check where there is one."""
    for target in run.trips:
        if FORMATS[target.name].neutral:
            file = f"{target.folder}/{run.written[target].files[0].name}"
            return f"Check {file} in its cell with `stiffarm verify`, then the notes below on frames and signs of axes."
    return "Write the neutral program too (`--format json`) and check it in its cell with `stiffarm verify`."


def _key(run: PostRun) -> list[KeyFigure]:
    posted, worst = run.posted, max(trip.tip for trip in run.trips.values())
    rapids = LARGEST.text(posted.bend_of_rapids, unit=True)
    out = [
        KeyFigure(LARGEST.text(worst, unit=True), "programs read back, farthest from the tool path"),
        KeyFigure(
            LARGEST.text(posted.bend_of_cuts, unit=True),
            f"joint motion off the straight line of cuts, at most; of rapids {rapids}",
        ),
    ]
    for quantity, one in _numbers(run).items() if run.drawn else ():
        interval = f"95 %: {quantity.between(*one.ends)}"
        out.append(KeyFigure(quantity.text(one.value, unit=True), quantity.name, interval))
    return out


def _drawings(run: PostRun) -> list[Drawing]:
    """Pictures along the program: joints, linear axes, what was taken off the path."""
    program = run.program
    steps = np.linalg.norm(np.diff(program.motions.points, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    out = [joints_drawing(way, {"program": program.q}, run.model.robot, narrow=True)]

    def add(name: str, caption: str, x: Array, lines: Mapping[str, Array], labels: tuple[str, str], what: str) -> None:
        out.append(Drawing(name, caption, what, partial(_lines, x, lines, labels, what)))

    if program.travel.shape[1]:
        travels = {axis.name: 1e3 * program.travel[:, k] for k, axis in enumerate(program.cell.linear_axes)}
        add("axes", "Linear axes along the program.", 1e3 * way, travels, ("path, mm", "travel, mm"), "Linear axes")
    if run.compensated is not None:
        moved = dict(zip("xyz", 1e6 * run.compensated.moved.T, strict=True))
        x, labels = np.arange(len(run.compensated.moved), dtype=np.float64), ("move", "taken off, um")
        add("compensation", "What was taken off each point of the path.", x, moved, labels, "Compensation, part axes")
    if run.corrected is not None:
        sizes = {name: np.linalg.norm(getattr(run.corrected, name), axis=1) for name in PARTS}
        lines = {name: 1e6 * size for name, size in ({"all": run.corrected.moved} | sizes).items()}
        caption = "By the calibrated model, at the targets as designed; compensation takes it off."
        x = np.arange(len(run.corrected.moved), dtype=np.float64)
        add("correction", caption, x, lines, ("move", "off, um"), "How far the tool would be off the path")
    return out


def _lines(x: Array, lines: Mapping[str, Array], labels: tuple[str, str], text: str) -> Figure:
    """Lines over one another along the program; ``labels`` of the axes."""
    from stiffarm.pages.figure_parts import LINES, SERIES, drawing

    with drawing(text, (10.0, 3.3)) as (figure, (ax,)):
        for k, (name, values) in enumerate(lines.items()):
            look = {"color": SERIES[k % len(SERIES)], "linestyle": LINES[k % len(LINES)], "linewidth": 1.4}
            ax.plot(x, values, label=name, **look)
        ax.set(xlabel=labels[0], ylabel=labels[1])
        ax.legend(loc="upper right", ncols=4)
    return figure


def _sections(run: PostRun) -> tuple[Section, ...]:
    program, robot, motions = run.program, run.model.robot, run.posted.program.motions
    reference = ", ".join(f"{v:.3g}" for v in np.asarray(run.posted.state.reference))
    names = "; ".join(sorted({program.names[b] for b in program.branch}))
    posture = f"branches: {names}"
    if is_redundant(robot):
        posture = (
            f"{names} about the line from shoulder to wrist, 0 on top: postures were followed along the path, and the "
            "elbow was turned for the objective, least joint travel, and room to limits and singularities"
        )
    least = SINGULARITY.text(singular_distance(robot, program.q).min())
    words = (
        f"Gamma (counted from the part's direction {reference}): {angles_text(program.gamma)}; {posture}. Distance to "
        f"the nearest singularity at least {least}."
    )
    counted = Counter(event.word for event in motions.events)
    read = ", ".join(f"{word} {n}" for word, n in sorted(counted.items())[:MOST_READ])
    notes = () if run.compensated is None else run.compensated.error.uncertain.notes
    return (
        Section("Posture", (Text(words), Bullets(tuple(notes)))),
        Section("What was read", (Text(f"Words that are no motion: {read or 'none'}."),), folded=True),
    )


def _sizes(moved: Array, judged: Bools | None = None) -> dict[str, float | None]:
    """Largest and mean size of displacements (n, 3) m; the mean of ``judged`` rows."""
    size = np.linalg.norm(moved, axis=1)
    some = size if judged is None else size[judged]
    return stored({LARGEST: size.max(initial=0.0), MEAN: some.mean() if len(some) else 0.0})


def _compensation(found: Compensated) -> dict[str, Any]:
    sd = found.error.sd.max()
    return {
        **_sizes(found.moved, found.engaged),
        **stored(
            {
                length("error_sd", unit="um"): sd,
                length("unknown_95", unit="um"): NORMAL_95 * sd,
                LEFT: np.linalg.norm(found.left, axis=1).max(),
            }
        ),
        "capped_moves": int(found.capped.sum()),
        "rounds": found.rounds,
        "rests_on": list(found.error.uncertain.notes),
    }


def _compensation_words(found: Compensated) -> str:
    """What compensation changes, in some sentences."""
    size, left = np.linalg.norm(found.moved, axis=1), np.linalg.norm(found.left, axis=1)
    milled = size[found.engaged]
    capped = int(found.capped.sum())
    return (
        "The predicted deflection under the cutting force is taken off the path: up to "
        f"{LARGEST.text(size.max(), unit=True)}, in the mean {LARGEST.text(milled.mean() if len(milled) else 0.0)} um. "
        "What is left is what is not known of it, up to "
        f"±{LARGEST.text(NORMAL_95 * found.error.sd.max(), unit=True)} (95 %), and what the model leaves out (the "
        f"search itself came to rest within {LARGEST.text(max(left.max(), 1e-8), unit=True)})."
        + (f" At {capped} moves the cap was reached: there the rest stays." if capped else "")
    )


def _correction(found: Corrected, positions: Positions) -> dict[str, Any]:
    nan = np.nan
    return {
        **stored({LARGEST: found.moved.max(initial=0.0), MEAN: found.moved.mean()}),
        "by": {name: _sizes(getattr(found, name)) for name in PARTS},
        "turns_corrected": found.turns,
        **stored(
            {
                length("place_sd", unit="um"): found.place_sd,
                Quantity("turn_sd", "urad", 1e6): found.turn_sd,
                Quantity("largest_turn", "urad", 1e6): found.turned.max(initial=0.0),
                LEFT: found.left.max(initial=0.0),
                length("error_sd", unit="um"): nan if found.error is None else found.error.sd.max(),
            }
        ),
        "between_points_um": {name: LARGEST.stored_value(v) for name, v in found.between.items()},
        "targets_where_a_joint_error_is_not_identified": dict(found.unread),
        "calibrated_rms_mm": {"readings_left_out": positions.left_out_rms_mm, "before": positions.before_rms_mm},
        "rounds": found.rounds,
        "controller": CONTROLLER,
    }


def _parts(found: Corrected) -> Table:
    sizes = np.stack([np.linalg.norm(getattr(found, name), axis=1) for name in PARTS])
    values = {LARGEST: sizes.max(axis=1, initial=0.0), MEAN: sizes.mean(axis=1)}
    return Table("correction_by_part", "What the correction is made of", {"part": PARTS}, values, is_extract=True)


def _correction_words(found: Corrected, positions: Positions) -> str:
    """The correction in some sentences."""
    parts = ", ".join(
        f"{name} up to {LARGEST.text(np.linalg.norm(getattr(found, name), axis=1).max(initial=0.0), unit=True)}"
        for name in PARTS
    )
    known = LARGEST.text(found.place_sd, unit=True)
    straight, joint = (LARGEST.text(found.between[kind], unit=True) for kind in ("cartesian", "joint"))
    return (
        "Targets are moved so that the calibrated arm reaches the path: up to "
        f"{LARGEST.text(found.moved.max(initial=0.0), unit=True)}, in the mean "
        f"{LARGEST.text(found.moved.mean(), unit=True)} ({parts}). By the model "
        f"{LARGEST.text(max(found.left.max(initial=0.0), 1e-9), unit=True)} is left at the targets, and half-way "
        f"between them up to {straight} (joint program: {joint}). How right the model is: readings that its "
        f"calibration had not seen are predicted to {positions.left_out_rms_mm:.3g} mm RMS (as described: "
        f"{positions.before_rms_mm:.3g})."
        + (
            ""
            if np.isnan(found.place_sd)
            else f" In the arm's base frame it knows this tool point to {known} (standard deviation)."
        )
    )


def _correction_remarks(run: PostRun, found: Corrected) -> list[str]:
    """What must be known before a corrected program runs."""
    out = [CONTROLLER]
    if found.unread:
        where = ", ".join(f"{joint} at {n}" for joint, n in found.unread.items())
        out.append(
            f"of {run.posted.program.n} targets, error curves of joints are not identified for {where}: there the "
            "correction lacks them; another gamma or branch may stand where the arm was read"
        )
    if not found.turns:
        out.append(
            f"the tool's axes are not corrected: the readings tell them to {TURN.text(2.0 * found.turn_sd, unit=True)} "
            f"only (95 %), for errors of up to {TURN.text(found.turned.max(initial=0.0), unit=True)}; several targets, "
            "far apart, tell them"
        )
    out.append("part and tool frames must be measured on the same arm: an error of theirs moves the whole path")
    if run.request.payload is not None and run.request.payload.kg == 0.0:
        out.append("the flange carries nothing by this: give spindle and tool with --payload KG,X,Y,Z")
    return out


def _approach(found: Approached, approach: Approach) -> dict[str, Any]:
    return {
        "signs": "".join(SIGNS[float(way)] for way in approach.ways),
        **stored(
            {
                angle("angle"): approach.angle,
                length("farthest_from_target"): found.away,
                length("deepest_beyond_target"): found.deeper,
            }
        ),
        "positioning_moves": found.targets,
        "points_put_in": len(found.moves),
        "no_room_within_limits": dict(found.left_out),
    }


def _approach_words(run: PostRun) -> list[str]:
    """What was put in to come from one side, and what must be known of it; nothing where nothing was asked for."""
    found, approach = run.approached, run.request.approach
    if found is None or approach is None:
        return []
    signs = "".join(SIGNS[float(way)] for way in approach.ways)
    out = [
        f"{len(found.moves)} of {found.targets} positioning moves that end where something begins come from the side "
        f"of `--approach {signs}` in their last {angle('angle').text(approach.angle, unit=True)}: by points up to "
        f"{FAR.text(found.away, unit=True)} from their targets, up to {FAR.text(found.deeper, unit=True)} deeper along "
        "the tool. Moves at feed are not changed."
    ]
    if found.left_out:
        lacks = ", ".join(f"{joint} at {n}" for joint, n in found.left_out.items())
        out.append(f"not from that side, for want of room within the joints' limits: {lacks} of {found.targets} moves")
    return out
