"""A calibration from tables of absolute positions: how accurate the arm is, why, and what a controller takes."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from functools import partial
from typing import Any, Final

import numpy as np

from doe.absolute.calibrate import Positions, calibrate_positions
from doe.absolute.chain import flange_targets
from doe.absolute.identified import Curve, Finding
from doe.absolute.prediction import Predicted
from doe.absolute.regions import Regions, accuracy_regions, where
from doe.absolute.written import Written, written
from fem.arm import Arm
from machining.programs.controller_offsets import ControllerOffsets, controller_offsets, orientations
from robots import save_description
from robots.arrays import Array
from robots.frames import framed
from robots.quantities import Quantity, angle, length, rounded, significant
from robots.robot import robot_from
from robots.urdf.writing import urdf_text
from stiffarm.arm import as_face
from stiffarm.commands.calibrate.results import Calibration
from stiffarm.commands.calibrate.tables import POSES_OUT, RMS
from stiffarm.commands.calibrate.words import mm
from stiffarm.pages.report import Bullets, KeyFigure, Section, Text
from stiffarm.pages.report import Table as PageTable
from stiffarm.request import Readings, positions_asked
from stiffarm.result import Drawing, Number, Table
from stiffarm.session.console import progress
from stiffarm.session.outputs import OutputFolder

BEFORE: Final = length("before_rms", "RMS as described")
VALUE: Final = Quantity("value", label="value")
MEAN, P95, LARGEST = length("mean", "mean"), length("p95", "95 % are below"), length("largest", "largest")
# Regions that people see: so many of the most and of the least accurate.
SHOWN: Final = 5


def of_positions(
    given: Arm,
    data: Sequence[Readings],
    free: Sequence[str] | None,
    holdout: Readings | None,
    *,
    robust: bool,
    seed: int,
) -> Calibration:
    """Calibrate on tables of positions.

    Raises
    ------
    InputError
        A table, a name or readings that cannot be used.
    """
    table, kept = positions_asked(given, data), None if holdout is None else positions_asked(given, [holdout])
    with progress("steps") as bar:
        c = calibrate_positions(given.model, table, free, holdout=kept, robust=robust, seed=seed, progress=bar)
    made = written(c, given.description)
    taken, regions = offsets(c, made), accuracy_regions(c, seed=seed)
    links = "rigid" if made.fit.moving.of("spring") else given.model.link_kind
    notes = (*table.notes, *(() if kept is None else kept.notes))
    remarks = correction_remarks(c, made)
    return Calibration(
        name="positions",
        title=given.description.title.split(" (")[0],
        question="where is the tool really, and why?",
        answer=f"{accuracy_words(c)}.",
        how_sure=f"{sum(one.status == 'determined' for one in c.findings)} of {len(c.findings)} parameters are "
        f"identified. Of the coordinates of left-out readings, {_share(c)} lie in their 95 % intervals.",
        what_next="Measure where the robot will work: outside the measured angles the joints' errors are not "
        "identified."
        if c.curves
        else "Also free `periodic`: joint errors over their angles are often the largest part.",
        facts=_facts(given, c, regions) | {"corrections": corrections_json(c, made, taken)},
        numbers=dict(zip((BEFORE, RMS, POSES_OUT), map(Number, map(_rms, c.distances().values())), strict=True)),
        tables=(
            parameters_table(c.findings),
            _accuracy(c),
            *([_wrong(c)] if c.gross else []),
            *_regions(regions),
            *([_curves(c.curves)] if c.curves else []),
            _errors(c),
        ),
        drawings=_drawings(c, regions),
        key=(
            KeyFigure(mm(1e3 * _rms(c.distances()["before"])), "RMS with the arm as described"),
            KeyFigure(mm(1e3 * _rms(c.distances()["left out"])), "RMS of poses that the calibration has not seen"),
            KeyFigure(f"{len(c.gross)}", f"wrong reading{'s' * (len(c.gross) != 1)} found"),
        ),
        sections=_sections(c, regions, made, taken),
        remarks=(*notes, *c.remarks, *remarks),
        arm=as_face(Arm.of(made.description, links, given.model.load_path, given.own)),
        found=c,
        more=partial(_write, c, made, taken),
        made_of=f"{table.source}, {len(table)} positions",
        parameters=c.findings,
    )


def _share(c: Positions) -> str:
    return f"{significant(100.0 * c.left_out.take(c.right).coverage.share, 2)} %"


def _rms(distances: Array) -> float:
    return float(np.sqrt(np.mean(distances**2)))


def accuracy_words(c: Positions) -> str:
    """The answer in a sentence."""
    before, after, out = (mm(1e3 * _rms(d)) for d in c.distances().values())
    text = (
        f"{before} RMS with the arm as described, {after} calibrated; poses left out are predicted to {out} RMS, "
        f"{_share(c)} of their coordinates within the 95 % intervals"
    )
    if c.sessions_out is not None:
        text += f"; sessions left out, their frames fitted: {mm(1e3 * c.sessions_out.take(c.right).rms_m)} RMS"
    if c.holdout is not None:
        text += f"; held out: {mm(1e3 * c.holdout[1].rms_m)} RMS"
    if c.gross:
        count = "one wrong reading" if len(c.gross) == 1 else f"{len(c.gross)} wrong readings"
        text += f"; {count} found and left out"
    return text


def _facts(given: Arm, c: Positions, regions: Regions) -> dict[str, Any]:
    found, data, d = c.found, c.found.data, c.distances()
    out: dict[str, Any] = {
        "robot": given.description.name,
        "readings": len(data),
        "sessions": [
            {
                "name": name,
                "readings": int((data.session.number == s).sum()),
                "rotation": found.frames[s].R.tolist(),
                "position_mm": (1e3 * found.frames[s].t).tolist(),
            }
            for s, name in enumerate(data.session.names)
        ],
        "targets": list(data.target.names),
        "before": distances(d["before"]),
        "after": distances(d["after"]),
        "left_out": predicted(c.left_out.take(c.right)),
        "left_out_sessions": None if c.sessions_out is None else predicted(c.sessions_out.take(c.right)),
        "scatter_sd_mm": rounded(1e3 * found.variances.sigma),
        "scatter_tail": rounded(found.tail),
        "settled": found.settled,
        "not_told_apart_by_any_readings": [{"name": t.name, "moved_by": list(t.others)} for t in c.twins],
        "left_open_by_these_readings": [{"names": list(o.names), "combinations": o.directions} for o in c.open],
        "curves": [
            {
                "joint": one.joint,
                "identified_deg": [list(r) for r in one.ranges_deg],
                "rms_mrad": rounded(1e3 * _rms(one.error[one.known]) if one.is_known else math.nan),
                "prior_sd_mrad": rounded(1e3 * one.height),
            }
            for one in c.curves
        ],
        "wrong_readings": [
            {"line": g.line, "distance_mm": rounded(1e3 * g.distance), "cause": g.cause} for g in c.gross
        ],
        "regions_edge_mm": rounded(1e3 * regions.edge),
        "regions_in_words": regions.words,
    }
    if c.holdout is not None:
        table, there, _ = c.holdout
        new = [name for name in table.session.names if name not in data.session.names]
        out["holdout"] = {**predicted(there), "readings": len(table), "frames_fitted_anew": new}
    return out


def _four(d: Array) -> dict[Quantity, float]:
    """Mean, RMS, 95 % and largest of distances (n,) m."""
    return dict(zip((MEAN, RMS, P95, LARGEST), (d.mean(), _rms(d), np.quantile(d, 0.95), d.max()), strict=True))


def distances(d: Array) -> dict[str, float | None]:
    """The same for JSON."""
    return {quantity.column: quantity.stored_value(value) for quantity, value in _four(d).items()}


def predicted(p: Predicted) -> dict[str, Any]:
    """Distances of readings that were not used, and how many coordinates lie in their intervals."""
    return {**distances(p.distance), "in_interval95": {"inside": p.coverage.inside, "of": p.coverage.readings}}


def parameters_table(found: Sequence[Finding]) -> Table:
    """What was found, and how sure."""
    ends = np.array([one.interval95 for one in found]).reshape(-1, 2)
    return Table(
        "parameters",
        f"{len(found)} parameters, without error curves and frames",
        {key: [getattr(one, key) for one in found] for key in ("name", "unit", "status")},
        {VALUE: np.array([np.nan if one.value is None else one.value for one in found])},
        {VALUE: (ends[:, 0], ends[:, 1])},
    )


def _accuracy(c: Positions) -> Table:
    """Distances between read and predicted positions."""
    d = c.distances()
    rows = {
        "arm as described, frames and targets fitted": d["before"],
        "calibrated": d["after"],
        "calibrated, poses left out": d["left out"],
    }
    if c.sessions_out is not None:
        rows["calibrated, sessions left out, their frames fitted"] = c.sessions_out.distance[c.right]
    if c.holdout is not None:
        rows["held out, their frames fitted where new"] = c.holdout[1].distance
    four = [_four(one) for one in rows.values()]
    return Table(
        "accuracy",
        "Distance between measured and predicted targets",
        {"of": list(rows), "readings": [str(len(one)) for one in rows.values()]},
        {quantity: np.array([one[quantity] for one in four]) for quantity in four[0]},
        is_extract=True,
    )


def _wrong(c: Positions) -> Table:
    return Table(
        "wrong",
        "Readings that are wrong: they have almost no weight in the result",
        {"line": [str(g.line) for g in c.gross], "likely cause": [g.cause for g in c.gross]},
        {length("distance", "off by"): np.array([g.distance for g in c.gross])},
        is_extract=True,
    )


def _regions(r: Regions) -> list[Table]:
    """All regions, and for people the most and the least accurate ones."""
    kinds = {"before": "before", "after": "calibrated", "left_out": "left out"}

    def table(name: str, caption: str, rows: Sequence[Any], figures: dict[Quantity, str], few: bool) -> Table:
        def values(key: str) -> Array:
            kind, _, what = key.partition("/")
            return np.array([getattr(getattr(one, kind), what) for one in rows])

        labels = {"region": [where(one) for one in rows], "verdict": [one.verdict for one in rows]}
        counts = {Quantity("readings"): np.array([one.readings for one in rows], dtype=float)}
        ends = {
            length(f"{a}_{end}"): np.array([getattr(one, end)[k] for one in rows])
            for k, a in enumerate("xyz")
            for end in ("low", "high")
        }
        return Table(
            name,
            caption,
            labels,
            counts | {q: values(key) for q, key in figures.items()},
            {},
            ends,
            folded=not few,
            is_extract=few,
        )

    judged = r.judged
    ends = judged if len(judged) <= 2 * SHOWN else (*judged[:SHOWN], *judged[-SHOWN:])
    what = "Regions" if len(ends) == len(judged) else f"The {SHOWN} most and the {SHOWN} least accurate regions"
    every = {
        length(f"{kind}_{what}", f"{words}, {what}"): f"{kind}/{what}"
        for kind, words in kinds.items()
        for what in ("mean", "rms", "largest")
    }
    few = {q: key for q, key in every.items() if key in ("before/rms", "left_out/rms", "left_out/largest")}
    return [
        *([table("extreme_regions", what, ends, few, True)] if len(judged) > 1 else []),
        table("regions", "All regions", r.regions, every, False),
    ]


def _curves(curves: Sequence[Curve]) -> Table:
    """Every joint's error by the degree; none where it is not identified."""
    known = np.concatenate([one.known for one in curves])
    error, half = (np.concatenate([getattr(one, key) for one in curves]) for key in ("error", "half95"))
    return Table(
        "curves",
        "Error of each joint over its angle",
        {"joint": [one.joint for one in curves for _ in one.angle]},
        {
            angle("angle"): np.concatenate([one.angle for one in curves]),
            Quantity("error", "mrad", 1e3): np.where(known, error, np.nan),
            Quantity("half95", "mrad", 1e3): np.where(known, half, np.nan),
        },
        only_in="csv",
    )


def _errors(c: Positions) -> Table:
    """How far off each reading is before, after, and where it was left out."""
    data = c.found.data
    return Table(
        "errors",
        "Error of each reading",
        {
            "line": [str(line) for line in data.line],
            "session": [data.session.names[k] for k in data.session.number],
            "target": [data.target.names[k] for k in data.target.number],
        },
        {
            length("before"): np.linalg.norm(c.before.residual, axis=1),
            length("after"): np.linalg.norm(c.found.residual, axis=1),
            length("left_out"): c.left_out.distance,
            Quantity("weight"): np.minimum(c.found.weight, 1.0),
        },
        only_in="csv",
    )


def _drawings(c: Positions, regions: Regions) -> tuple[Drawing, ...]:
    from stiffarm.commands.calibrate.figures import positions as figures

    caption = "Left out: each reading predicted by a calibration that has not seen its pose."
    out = [Drawing("accuracy", caption, "accuracy", partial(figures.accuracy_figure, c))]
    if known := tuple(one for one in c.curves if one.is_known):
        caption = "Line: actual minus displayed joint angle; band: 95 %. Shown only where readings identify it."
        out.append(Drawing("joint_errors", caption, "joint errors", partial(figures.curves_figure, known)))
    caption = "Each square: all readings in a column of regions, and their number. Empty: not measured."
    return (*out, Drawing("regions", caption, "regions", partial(figures.regions_figure, regions)))


def _sections(c: Positions, r: Regions, made: Written, taken: tuple[ControllerOffsets, ...]) -> tuple[Section, ...]:
    out = [
        Section(
            "Where the arm is accurate",
            (
                Text(
                    f"{r.words[0].upper()}{r.words[1:]}. Ranges are in the arm's base frame. A region counts as better "
                    "or worse only if the difference is more than chance: readings shuffled at random over the regions "
                    "seldom differ as much. regions.csv lists all regions: place a part where the arm is accurate and "
                    "was measured."
                ),
            ),
        )
    ]
    if c.curves:
        text = (
            "Actual minus displayed angle of each joint, as a smooth function of its angle that repeats every turn. "
            "Constant parts belong to the zero. Smoothness and height of the curves are estimated from the readings. "
            "Outside the measured angles a curve is not identified, and predictions there include its height as an "
            "uncertainty."
        )
        out.append(Section("Errors of the joints over their angles", (Text(text),)))
    if c.twins:
        text = "No readings can separate the following; each is held at the model's value."
        twins = Bullets(tuple(f"{one.words}." for one in c.twins))
        out.append(Section("Parameters that are held", (Text(text), twins)))
    data = c.found.data
    tail = "" if math.isinf(c.found.tail) else f", with tails of Student's t of {c.found.tail:g} degrees of freedom"
    text = (
        f"{len(data)} positions of {len(data.target.names)} target(s) in {len(data.session.names)} session(s), each "
        f"with a frame of its own. A coordinate scatters by {mm(1e3 * c.found.variances.sigma)}{tail}."
    )
    return (*out, _corrections(c, made, taken), Section("The readings", (Text(text),), folded=True))


MODEL, URDF, CONTROLLER = "model.toml", "calibrated.urdf", "controller.json"
SCHEMA = "stiffarm-controller-offsets/1"
ZERO_WORDS = (
    "The actual angle of an axis is the angle that the controller shows plus this correction: enter the actual angle "
    "when mastering. These readings do not identify the zeros of axes without a value."
)


def offsets(c: Positions, w: Written) -> tuple[ControllerOffsets, ...]:
    """What controllers of the arm take."""
    sessions = {
        name: framed(frame.R, frame.t) for name, frame in zip(c.found.data.session.names, w.fit.frames, strict=True)
    }
    at = flange_targets(w.fit.layout, w.fit.u)
    targets = {name: at[k] for k, name in enumerate(c.found.data.target.names)}
    known = np.array([_is_known(c, joint.name, joint.zero_error is not None) for joint in w.description.joint])
    return controller_offsets(robot_from(w.description), sessions, targets, known)


def _is_known(c: Positions, joint: str, described: bool) -> bool:
    """Whether a joint's zero is known: identified, or not asked for and in the model already."""
    free = next((f for f in c.findings if f.name == f"{joint}.zero"), None)
    return described if free is None else free.value is not None


def correction_remarks(c: Positions, w: Written) -> tuple[str, ...]:
    """What the files cannot hold."""
    kinds = {one.kind for one in w.fit.layout.unknowns if one.kind not in ("target", "rail", "payload")}
    out = list(w.notes)
    turning = {"ratio": "ratios", "coupling": "couplings", "periodic": "error curves"}
    lost = [words for kind, words in turning.items() if kind in kinds]
    if kinds & {"spring"}:
        lost.append("springs")
    if lost:
        out.append(f"{URDF} has the joints' frames and zeros; a URDF cannot hold {', '.join(lost)}: see {MODEL}")
    if "frame" in kinds and "zero" in kinds:
        out.append(
            "zeros found together with frames are valid only with these frames: for a controller that takes zeros "
            "alone, calibrate again with --free zeros"
        )
    return tuple(out)


def corrections_json(c: Positions, w: Written, found: tuple[ControllerOffsets, ...]) -> dict[str, Any]:
    """What positions.json says of it."""
    return {
        "model": MODEL,
        "urdf": URDF,
        "controller": CONTROLLER,
        "model_rms_mm": rounded(1e3 * float(np.sqrt(np.mean(np.sum(w.fit.residual[c.right] ** 2, axis=1))))),
        "springs_without_value": list(w.silent),
        "leaving_them_out_moves_rms_mm": rounded(1e3 * w.moved_m),
        "found_without_place_in_the_model": list(w.elsewhere),
        "remarks": list(correction_remarks(c, w)),
        "controllers": [controller(one) for one in found],
    }


def controller(one: ControllerOffsets) -> dict[str, Any]:
    """What one controller takes, keys with units."""
    return {
        "formats": list(one.formats),
        "joint_zeros": [
            {"axis": name, "really_beyond_shown_deg": rounded(float(v))}
            for name, v in zip(one.axes, one.zeros_deg, strict=True)
        ],
        "robot_frame": "the controller's" if one.knows_robot_frame else "the model's base frame",
        "robot_frame_in_tracker": [
            {"session": name, "position_mm": (1e3 * T[:3, 3]).tolist(), "orientation": orientations(T[:3, :3])}
            for name, T in one.T_tracker_robot.items()
        ],
        "tools": [
            {"target": name, "x_mm": 1e3 * float(p[0]), "y_mm": 1e3 * float(p[1]), "z_mm": 1e3 * float(p[2])}
            for name, p in one.tools.items()
        ],
    }


def _write(c: Positions, w: Written, found: tuple[ControllerOffsets, ...], folder: OutputFolder) -> dict[str, Any]:
    """model.toml, calibrated.urdf, controller.json."""
    save_description(w.description, folder.path(MODEL))
    at = flange_targets(w.fit.layout, w.fit.u)
    links = _link_names(c.found.data.target.names)
    comment = f"stiffarm: calibrated from positions {c.found.data.source}, SHA-256 {c.found.data.sha256}"
    points = {link: at[k] for k, link in enumerate(links)}
    folder.write_text(URDF, urdf_text(robot_from(w.description), points, comment))
    folder.write_json(
        CONTROLLER,
        {
            "schema": SCHEMA,
            "robot": w.description.name,
            "zeros": ZERO_WORDS,
            "controllers": [controller(one) for one in found],
        },
    )
    return {}


def _link_names(targets: tuple[str, ...]) -> list[str]:
    """Names of links for targets: letters, digits and underscores, each once."""
    out: list[str] = []
    for k, name in enumerate(targets, start=1):
        link = "target_" + (re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_") or str(k))
        out.append(link if link not in out else f"{link}_{k}")
    return out


def _corrections(c: Positions, w: Written, found: tuple[ControllerOffsets, ...]) -> Section:
    """The page's part on what to do with the result."""
    tables = []
    for one in found:
        who = f"for {', '.join(one.formats)}" if one.formats else "as tables of this model count the angles"
        rows = tuple((name, significant(v, 4)) for name, v in zip(one.axes, one.zeros_deg, strict=True))
        tables.append(PageTable(f"Joint zeros, {who}", ("axis", "actual minus shown (deg)"), rows, text_columns=(0,)))
        tools = tuple((name, *(significant(1e3 * v, 6) for v in p)) for name, p in one.tools.items())
        heads = ("target", "x (mm)", "y (mm)", "z (mm)")
        tables.append(PageTable(f"Targets in the flange frame, {who}", heads, tools, text_columns=(0,)))
    text = (
        f"{MODEL} is the arm with its errors, for every other command; {URDF} has the calibrated frames and zeros; "
        f"{CONTROLLER} has what a controller can use, including the robot's base frames in the tracker's frame. Errors "
        "of joint frames, ratios, couplings and curves cannot be entered in a controller: `stiffarm post --compensate` "
        f"with this model corrects them in programs. {ZERO_WORDS}"
    )
    return Section("Corrections", (Text(text), *tables))
