"""The command `plan`: which set-ups to measure next, and a sheet to write the readings into."""

from __future__ import annotations

from pathlib import Path
from shlex import join
from typing import Annotated, Any

import typer

from doe import Measurements, bundled_data
from doe.planning.optimal_choice import CRITERIA
from doe.planning.pose_designs import METHODS
from fem.arm import Arm
from robots import InputError
from stiffarm.commands.plan import options as plan_options
from stiffarm.commands.plan import results as plan_results
from stiffarm.commands.plan import sheets
from stiffarm.commands.plan.step import Planned, Request, make_plan
from stiffarm.session import parsing
from stiffarm.session.console import progress
from stiffarm.session.frame import Frame, command
from stiffarm.session.options import (
    Clearance,
    ConfirmUnits,
    DataArg,
    Debug,
    Floor,
    Json,
    KeepOut,
    Links,
    LoadPathOpt,
    ModelArg,
    Out,
    Seed,
    Sets,
)
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.parsing import parse_payload
from stiffarm.session.zones import FLOOR, parse_zone

TABLE, PAGE, RESULT, FIGURE = "measurement_sheet.csv", "measurement_sheet.html", "plan.json", "plan.png"


def plan(
    model: ModelArg,
    data: DataArg = None,
    poses: Annotated[
        int | None,
        typer.Option("--poses", help="Number of set-ups to choose; a set-up is a pose with a load direction.", min=1),
    ] = None,
    design_only: Annotated[
        int | None,
        typer.Option(
            "--design-only",
            help="Instead of --poses: plan this many poses straight from --design, without choosing.",
            min=1,
        ),
    ] = None,
    positions: Annotated[
        int | None,
        typer.Option(
            "--positions",
            help="Instead of --poses: choose this many poses to read targets at with a tracker, for a calibration from "
            "positions.",
            min=4,
            max=1000,
        ),
    ] = None,
    tracker: Annotated[
        str | None,
        typer.Option(
            "--tracker",
            metavar="X,Y,Z",
            help="With --positions: position of the tracker in the arm's base frame, in mm.",
        ),
    ] = None,
    target: Annotated[
        list[str] | None,
        typer.Option(
            "--target",
            metavar="NAME:X,Y,Z[,DX,DY,DZ]",
            help="With --positions: a target in the flange frame, in mm, and the direction in which it faces. May "
            "be repeated.",
        ),
    ] = None,
    carried: Annotated[
        str | None,
        typer.Option(
            "--payload",
            metavar="KG[,X,Y,Z]",
            help="With --positions: what the flange carries: mass in kg and its centre in the flange frame, in mm.",
        ),
    ] = None,
    without_data: Annotated[
        bool,
        typer.Option("--without-data", help="Plan from scratch; ignore all existing readings, including bundled ones."),
    ] = False,
    free: Annotated[
        str | None,
        typer.Option(
            "--free",
            help="Parameters to identify, separated by commas, as in j2.stiffness,base.rx. Default: the joint "
            "stiffnesses that the readings can show.",
        ),
    ] = None,
    criterion: Annotated[
        str,
        typer.Option(
            "--criterion",
            help="Design criterion: D (all parameters jointly), A (their mean variance) or I (prediction variance).",
        ),
    ] = "D",
    loads: Annotated[
        str | None,
        typer.Option(
            "--loads",
            help="Loads, in N, separated by commas, as in 150,650. Default: those of the readings, otherwise "
            "1/4, 1/2 and all of the payload.",
        ),
    ] = None,
    directions: Annotated[
        str | None,
        typer.Option(
            "--directions",
            help="Load directions in base axes, as in +x,-x,-z or 0,0,-1;1,0,-1. Default: those of the readings "
            "(if there are many, the axes nearest to them), otherwise -z.",
        ),
    ] = None,
    read: Annotated[
        str | None,
        typer.Option(
            "--read",
            help="Components to read: z, xyz or xyzr (r: the three rotations). Default: those of the readings,"
            " otherwise z.",
        ),
    ] = None,
    repeats: Annotated[int, typer.Option("--repeats", help="Number of readings at each load.", min=1, max=100)] = 3,
    unloading: Annotated[bool, typer.Option("--unloading", help="Read during unloading too.")] = False,
    candidates: Annotated[
        int, typer.Option("--candidates", help="Number of candidate poses to choose from.", min=1, max=20_000)
    ] = 1500,
    design: Annotated[
        str, typer.Option("--design", help=f"Design of the candidate poses: {', '.join(METHODS)}.")
    ] = "sobol",
    levels: Annotated[
        int, typer.Option("--levels", help="Number of levels of a full factorial design.", min=2, max=50)
    ] = 3,
    vary: Annotated[
        str | None,
        typer.Option(
            "--vary",
            help="Joint coordinates to vary, separated by commas, as in q2_deg,q4_deg. Default: all that matter.",
        ),
    ] = None,
    hold: Annotated[
        str | None,
        typer.Option(
            "--hold",
            help="Values of the other joint coordinates in deg, as in q1_deg=30. Default: 0, or mid-range if 0"
            " is out of range.",
        ),
    ] = None,
    floor: Floor = FLOOR,
    keep_out: KeepOut = None,
    clearance: Clearance = None,
    random_order: Annotated[
        bool,
        typer.Option(
            "--random-order",
            help="Randomise the order of the set-ups, against drift. Default: ordered for a short path.",
        ),
    ] = False,
    gauge: Annotated[
        float, typer.Option("--gauge-mm", help="Smallest standard deviation of a displacement reading, in mm.")
    ] = 0.01,
    gauge_turn: Annotated[
        float, typer.Option("--gauge-mrad", help="Smallest standard deviation of a rotation reading, in mrad.")
    ] = 0.01,
    confirm_units: ConfirmUnits = False,
    links: Links = None,
    load_path: LoadPathOpt = None,
    sets: Sets = None,
    out: Out = None,
    seed: Seed = 0,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Choose what to measure next and write a sheet to fill in.

    Chooses poses, loads and load directions; the filled-in sheet is read back by calibrate and diagnose.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        _check_kind(poses, design_only, positions)
        given = frame.model(model, links, load_path, without="the plan", sets=sets)
        zone = parse_zone(given.description, floor, keep_out or (), clearance)
        if positions is None:
            why = "only with --positions"
            parsing.refuse_given({"--tracker": tracker, "--target": target, "--payload": carried}, why, "leave it out")
        else:
            others = {
                "DATA": data,
                "--directions": directions,
                "--loads": loads,
                "--read": read,
                "--vary": vary,
                "--hold": hold,
                "--unloading": unloading or None,
            }
            parsing.refuse_given(others, "no option of --positions", "leave it out")
            from doe.absolute.campaign import Wanted
            from stiffarm.commands.plan import positions as positions_plan

            asked = Wanted(
                positions,
                positions_plan.parse_targets(target or ()),
                positions_plan.parse_tracker(tracker),
                free=parsing.parse_names(free, None, "--free"),
                sigma=_gauges(gauge, gauge_turn)[0],
                candidates=candidates,
                payload=None if carried is None else parse_payload(carried),
                zone=zone,
                seed=seed,
            )
            positions_plan.plan_positions(given, asked, frame)
            return
        wanted = Request(
            poses=design_only or poses or 0,
            plain=design_only is not None,
            free=parsing.parse_names(free, None, "--free"),
            criterion=parsing.parse_word(criterion, CRITERIA, "--criterion"),
            forces=parsing.parse_loads(loads) or None,
            directions=None if directions is None else plan_options.parse_directions(directions),
            components=None if read is None else plan_options.parse_read(read),
            repeats=repeats,
            unloading=unloading,
            candidates=candidates,
            design=parsing.parse_word(design, METHODS, "--design"),
            levels=levels,
            vary=parsing.parse_names(vary, given.robot.coordinates, "--vary"),
            hold_deg={} if hold is None else parsing.parse_pairs(hold, "--hold", given.robot.coordinates),
            zone=zone,
            random_order=random_order,
            gauge=_gauges(gauge, gauge_turn),
            seed=seed,
        )
        table = None if without_data else _readings(frame, given, data, confirm_units)
        _plan(given, table, data, wanted, frame)


def _plan(given: Arm, table: Measurements | None, data: Path | None, wanted: Request, frame: Frame) -> None:
    with frame.folder_if(wanted.seed) as folder:
        with progress("choosing set-ups") as bar:
            planned = make_plan(given, table, wanted, bar)
        content = plan_results.payload(given, table, planned)
        if folder is not None:
            before = () if table is None else (str(data or "bundled"),)
            reads_it = join(["stiffarm", "calibrate", frame.named, *before, str(Path(frame.out or "") / TABLE)])
            _write(given, table, planned, content, folder, reads_it)
    frame.answer(content, lambda: plan_results.show(given, planned))


def _write(
    given: Arm,
    table: Measurements | None,
    planned: Planned,
    content: dict[str, Any],
    folder: OutputFolder,
    calibrate: str,
) -> None:
    from stiffarm.commands.plan.figures import plan_figure
    from stiffarm.commands.plan.report import write_report
    from stiffarm.pages.style import save_png

    folder.write_json(RESULT, content)
    _write_sheet(given, plan_results.plan_sheet(given, table, planned), folder)
    save_png(plan_figure(planned.made, planned.found, given.robot.name), folder.path(FIGURE))
    write_report(given, table, planned, FIGURE, folder, calibrate)


def _write_sheet(given: Arm, sheet: sheets.Sheet, folder: OutputFolder) -> None:
    from stiffarm.pages.pose_pictures import pose_pictures

    sheets.write_table(sheet, folder.path(TABLE))
    with progress("pictures of the set-ups") as bar:
        pictures = pose_pictures(given.description, given.robot, sheet.q, sheet.direction, bar)
    folder.write_text(PAGE, sheets.render_sheet(sheet, pictures))


def _check_kind(poses: int | None, design_only: int | None, positions: int | None) -> None:
    tasks = {
        "--poses": poses is not None,
        "--design-only": design_only is not None,
        "--positions": positions is not None,
    }
    asked = [name for name, there in tasks.items() if there]
    if len(asked) != 1:
        raise InputError(
            "plan",
            code="A003",
            value=" with ".join(asked) or "no task",
            allowed="one of --poses N, --design-only N, --positions N",
            remedy="say how many set-ups to choose, as in --poses 6",
        )


def _gauges(length: float, turn: float) -> tuple[float, float]:
    for name, value in (("--gauge-mm", length), ("--gauge-mrad", turn)):
        if not 0.0 < value <= 1e3:
            raise InputError(
                name,
                code="C006",
                value=value,
                allowed="more than 0, at most 1000",
                remedy="give the gauge's resolution",
            )
    return length * 1e-3, turn * 1e-3


def _readings(frame: Frame, given: Arm, data: Path | None, confirm_units: bool) -> Measurements | None:
    """The table given, else the bundled one, else none: a first campaign."""
    if data is None:
        try:
            bundled_data(given.robot.name)
        except InputError:
            return None
    return frame.readings(given, data, confirm_units=confirm_units)
