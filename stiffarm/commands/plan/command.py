"""The command `plan`: which set-ups to measure next, and a sheet to write the readings into."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from doe import Measurements, bundled_data
from doe.planning.optimal_choice import CRITERIA
from doe.planning.pose_designs import METHODS, Zone
from robots import InputError, Robot
from stiffarm.commands.plan import iso9283, sheets
from stiffarm.commands.plan import options as plan_options
from stiffarm.commands.plan import results as plan_results
from stiffarm.commands.plan.step import Planned, Request, make_plan
from stiffarm.session import inputs
from stiffarm.session.console import emit_json, progress, say, user_errors
from stiffarm.session.options import (
    ConfirmUnits,
    DataArg,
    Debug,
    Json,
    Links,
    LoadPathOpt,
    ModelArg,
    Out,
    Seed,
    folder_if,
    model_hash,
    open_table,
)
from stiffarm.session.outputs import OutputFolder

TABLE, PAGE, RESULT, FIGURE = "measurement_sheet.csv", "measurement_sheet.html", "plan.json", "plan.png"

Poses = Annotated[int | None, typer.Option("--poses", help="set-ups to choose: poses, each with a direction", min=1)]
DesignOnly = Annotated[
    int | None, typer.Option("--design-only", help="instead: all so many poses of a plain --design", min=1)
]
Iso = Annotated[bool, typer.Option("--iso9283", help="instead: a sheet for the static compliance test of ISO 9283")]
WithoutData = Annotated[
    bool, typer.Option("--without-data", help="a first campaign: heed no readings, not even bundled ones")
]
Free = Annotated[
    str | None,
    typer.Option("--free", help="numbers to be told, as in j2.stiffness,base.rx; default: the joint springs seen"),
]
Criteria = Annotated[str, typer.Option("--criterion", help="D: all parameters at once; A: their mean; I: predictions")]
Forces = Annotated[
    str | None, typer.Option("--loads", help="in N, as in 150,650; default: the data's, else 1/4, 1/2 and all payload")
]
Directions = Annotated[
    str | None, typer.Option("--directions", help="as in +x,-x,-z or 0,0,-1;1,0,-1; default: the data's, else -z")
]
Read = Annotated[str | None, typer.Option("--read", help="z, xyz, xyzr (r: rotations); default: the data's, else z")]
Repeats = Annotated[int, typer.Option("--repeats", help="readings of each load", min=1, max=100)]
Unloading = Annotated[bool, typer.Option("--unloading", help="read on the way down too")]
Candidates = Annotated[int, typer.Option("--candidates", help="poses to choose from", min=1, max=20_000)]
Design = Annotated[str, typer.Option("--design", help=f"of the candidates: {', '.join(METHODS)}")]
Levels = Annotated[int, typer.Option("--levels", help="of a full factorial", min=2, max=50)]
Vary = Annotated[
    str | None, typer.Option("--vary", help="coordinates that vary, as in q2_deg,q4_deg; default: all that matter")
]
Hold = Annotated[
    str | None, typer.Option("--hold", help="where others stand, as in q1_deg=30; default: 0 or mid-range")
]
Floor = Annotated[str, typer.Option("--floor-mm", help="height below which no part of the arm may be, or none")]
KeepOut = Annotated[list[str] | None, typer.Option("--keep-out", help="box x0,y0,z0:x1,y1,z1 in mm; repeatable")]
Clearance = Annotated[
    float | None,
    typer.Option("--clearance-mm", help="wrist and tool from base and upper arm; default: as the casings need; 0: any"),
]
RandomOrder = Annotated[bool, typer.Option("--random-order", help="against drift; default: a short way")]
Gauge = Annotated[float, typer.Option("--gauge-mm", help="smallest scatter of a reading, mm")]
GaugeTurn = Annotated[float, typer.Option("--gauge-mrad", help="smallest scatter of a rotation, mrad")]
IsoPose = Annotated[
    list[str] | None, typer.Option("--pose", help="for --iso9283, as in q2_deg=5,q3real_deg=77.5; repeatable")
]
Rated = Annotated[
    float | None, typer.Option("--rated-N", help="for --iso9283: rated load; default: the payload's weight")
]


def plan(
    model: ModelArg,
    data: DataArg = None,
    poses: Poses = None,
    design_only: DesignOnly = None,
    iso: Iso = False,
    without_data: WithoutData = False,
    free: Free = None,
    criterion: Criteria = "D",
    loads: Forces = None,
    directions: Directions = None,
    read: Read = None,
    repeats: Repeats = 3,
    unloading: Unloading = False,
    candidates: Candidates = 1500,
    design: Design = "sobol",
    levels: Levels = 3,
    vary: Vary = None,
    hold: Hold = None,
    floor: Floor = "0",
    keep_out: KeepOut = None,
    clearance: Clearance = None,
    random_order: RandomOrder = False,
    gauge: Gauge = 0.01,
    gauge_turn: GaugeTurn = 0.01,
    pose: IsoPose = None,
    rated: Rated = None,
    confirm_units: ConfirmUnits = False,
    links: Links = None,
    load_path: LoadPathOpt = None,
    out: Out = None,
    seed: Seed = 0,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Which poses, loads and directions to measure next; writes a sheet that can be filled in and read back."""
    with user_errors(debug):
        _check_kind(poses, design_only, iso)
        given = inputs.read_model(model, links, load_path, without="the plan")
        zone = plan_options.parse_zone(given.description, floor, keep_out or (), clearance)
        files: dict[str, Path | str] = {"model": model_hash(given)}
        if iso:
            _refuse({"DATA": data, "--directions": directions, "--loads": loads, "--read": read, "--free": free}, True)
            _iso_sheet(given, pose, rated, zone, out, files, as_json)
            return
        _refuse({"--pose": pose, "--rated-N": rated}, False)
        wanted = Request(
            poses=design_only or poses or 0, plain=design_only is not None, free=plan_options.parse_parameters(free),
            criterion=_criterion(criterion), forces=inputs.parse_loads(loads) or None,
            directions=None if directions is None else plan_options.parse_directions(directions),
            components=None if read is None else plan_options.parse_read(read), repeats=repeats, unloading=unloading,
            candidates=candidates, design=_design(design), levels=levels,
            vary=inputs.parse_names(vary, given.robot.coordinates, "--vary"), hold_deg=_held(given.robot, hold),
            zone=zone, random_order=random_order, gauge=_gauges(gauge, gauge_turn), seed=seed,
        )  # fmt: skip
        table = None if without_data else _readings(given, model, data, files, confirm_units)
        _plan(given, table, wanted, out, files, as_json)


def _plan(
    given: inputs.ModelInput, table: Measurements | None, wanted: Request, out: Path | None,
    files: dict[str, Path | str], as_json: bool,
) -> None:  # fmt: skip
    with folder_if(out, files, wanted.seed) as folder:
        with progress("choosing set-ups") as bar:
            planned = make_plan(given, table, wanted, bar)
        content = plan_results.payload(given, table, planned)
        if folder is not None:
            _write(given, table, planned, content, folder)
    if as_json:
        emit_json(content)
        return
    plan_results.show(given, planned)
    if out is not None:
        say(f"written: {', '.join(str(out / name) for name in (TABLE, PAGE, RESULT, FIGURE))}")


def _write(
    given: inputs.ModelInput, table: Measurements | None, planned: Planned, content: dict[str, Any],
    folder: OutputFolder,
) -> None:  # fmt: skip
    from stiffarm.commands.plan.figures import plan_figure
    from stiffarm.pages.style import save_png

    folder.write_json(RESULT, content)
    _write_sheet(given, plan_results.plan_sheet(given, table, planned), folder)
    save_png(plan_figure(planned.made, planned.found, given.robot.name), folder.path(FIGURE))


def _write_sheet(given: inputs.ModelInput, sheet: sheets.Sheet, folder: OutputFolder) -> None:
    from stiffarm.pages.pose_pictures import pose_pictures

    sheets.write_table(sheet, folder.path(TABLE))
    q, direction = np.array([s.q for s in sheet.setups]), np.array([s.direction for s in sheet.setups])
    with progress("pictures of the set-ups") as bar:
        pictures = pose_pictures(given.description, given.robot, q, direction, bar)
    folder.write_text(PAGE, sheets.render_sheet(sheet, pictures))


def _iso_sheet(
    given: inputs.ModelInput, pose: list[str] | None, rated: float | None, zone: Zone, out: Path | None,
    files: dict[str, Path | str], as_json: bool,
) -> None:  # fmt: skip
    load = plan_options.rated_load(given.description, rated, "--rated-N", "give the rated load, as in --rated-N 1300")
    if pose:
        q = np.array([inputs.parse_pose(given.robot, text) for text in pose])
    else:
        q = iso9283.middle_pose(given.robot, zone)[None]
    sheet = iso9283.sheet(given.robot, plan_results.robot_title(given), q, load, usual=not pose)
    content = iso9283.payload(given.robot, q, load)
    with folder_if(out, files) as folder:
        if folder is not None:
            folder.write_json(RESULT, content)
            _write_sheet(given, sheet, folder)
    if as_json:
        emit_json(content)
        return
    for fact in sheet.facts:
        say(": ".join(fact))
    if out is not None:
        say(f"written: {', '.join(str(out / name) for name in (TABLE, PAGE, RESULT))}")


def _check_kind(poses: int | None, design_only: int | None, iso: bool) -> None:
    asked = [
        name
        for name, there in (
            ("--poses", poses is not None), ("--design-only", design_only is not None), ("--iso9283", iso)
        )
        if there
    ]  # fmt: skip
    if len(asked) != 1:
        raise InputError(
            "plan", value=" with ".join(asked) or "no task", allowed="one of --poses N, --design-only N, --iso9283",
            remedy="say how many set-ups to choose, as in --poses 6",
        )  # fmt: skip


def _refuse(options: dict[str, Any], iso: bool) -> None:
    """Refuse options that this kind of plan would not heed."""
    given = [name for name, value in options.items() if value]
    if given:
        raise InputError(
            f"{', '.join(given)}: {'not with' if iso else 'only with'} --iso9283",
            remedy="leave it out: the standard fixes loads, directions and readings" if iso else "leave it out",
        )


def _criterion(text: str) -> Any:
    if text not in CRITERIA:
        raise InputError("--criterion", value=text, allowed=", ".join(CRITERIA))
    return text


def _design(text: str) -> Any:
    if text not in METHODS:
        raise InputError("--design", value=text, allowed=", ".join(METHODS))
    return text


def _held(robot: Robot, text: str | None) -> dict[str, float]:
    return {} if text is None else inputs.parse_pairs(text, "--hold", robot.coordinates)


def _gauges(length: float, turn: float) -> tuple[float, float]:
    for name, value in (("--gauge-mm", length), ("--gauge-mrad", turn)):
        if not 0.0 < value <= 1e3:
            raise InputError(
                name, value=value, allowed="more than 0, at most 1000", remedy="give the gauge's resolution"
            )
    return length * 1e-3, turn * 1e-3


def _readings(
    given: inputs.ModelInput, model: str, data: Path | None, files: dict[str, Path | str], confirm_units: bool
) -> Measurements | None:
    """The table given, else the bundled one, else none: a first campaign."""
    if data is None:
        try:
            bundled_data(given.robot.name)
        except InputError:
            return None
    return open_table(given, model, data, files, confirm_units=confirm_units)
