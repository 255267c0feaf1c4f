"""The command `post`: from a tool path to programs for the robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from machining import Drive, Objective
from machining.cell import Cell
from machining.cutting import stiffness_uncertainty
from machining.placement import Placement, read_placement
from machining.programs.compensation import RAMP
from machining.programs.formats import FORMATS, read_options
from machining.programs.posting import PostSettings
from machining.programs.program import JointProgram, frame_distance, tool_in_part
from machining.programs.run import PostRequest, PostRun, run_post
from machining.programs.write_options import WriteOptions
from machining.toolpaths import Motions, read_toolpath
from machining.toolpaths.selection import select
from robots import InputError
from robots.arrays import Array
from robots.schema.joint_errors import Positions
from stiffarm.commands.post import approach as coming
from stiffarm.commands.post import report as post_report
from stiffarm.commands.post.corrected import not_corrected, payload_of, remarks, words
from stiffarm.commands.post.targets import parse_targets
from stiffarm.session.console import progress, say, show_table
from stiffarm.session.frame import command
from stiffarm.session.options import Debug, Json, Links, LoadPathOpt, ModelArg, Seed, Sets
from stiffarm.session.parsing import parse_numbers, parse_word
from stiffarm.session.path_options import OperationOpt, ReadOpt, ToolNumberOpt, reading
from stiffarm.session.stated import AtLoad, stated_table
from stiffarm.session.table_kinds import PATH, expect
from stiffarm.session.task_options import PartOpt, ReferenceOpt, ToolOpt, parse_gammas
from stiffarm.session.task_setup import (
    BeamRadiusOpt,
    CellOpt,
    FloorOpt,
    ForceAxesOpt,
    ForceOpt,
    KindOpt,
    MillingOpt,
    RotaryOpt,
    SingularOpt,
    TcpOpt,
    TurnGainOpt,
    UnitsOpt,
    cut_of,
    effects_left_out,
    parse_reference,
    parse_speed,
    read_setup,
    say_notes,
)

# Tool frames (m, rad) that a placement and the program made with it may differ by, and joint angles (rad).
SAME_FRAME, SAME_POSTURE = 1e-5, 1e-4


def post(
    model: ModelArg,
    path: Annotated[
        Path,
        typer.Argument(
            metavar="PATH", help="Tool path: APT, CLS, G-code, or CSV with the columns x_mm,y_mm,z_mm,nx,ny,nz."
        ),
    ],
    out: Annotated[Path, typer.Option("--out", help="Folder for the programs; it is created if needed.")],
    cell: CellOpt = None,
    floor: FloorOpt = None,
    beam_radius: BeamRadiusOpt = None,
    turn_gain: TurnGainOpt = 10.0,
    tool: ToolOpt = None,
    part: PartOpt = None,
    formats: Annotated[
        str,
        typer.Option("--format", help=f"Program formats, separated by commas: {', '.join(FORMATS)}."),
    ] = "json",
    coordinates: Annotated[
        str, typer.Option("--coordinates", help="Coordinates of the programs: cartesian, joint or both.")
    ] = "both",
    gamma: Annotated[
        str | None,
        typer.Option(
            "--gamma",
            metavar="DEG|FROM:TO:STEP",
            help="Angle gamma about the tool axis, in deg, or a range from which the best is chosen. Default: 0.",
        ),
    ] = None,
    placement: Annotated[
        Path | None,
        typer.Option(
            "--placement", help="Result of `stiffarm place` (placement.json): use its linear axes, turntable and gamma."
        ),
    ] = None,
    travel: Annotated[
        str | None,
        typer.Option(
            "--travel", metavar="MM,...", help="Positions of the linear axes, in mm, separated by commas. Default: 0."
        ),
    ] = None,
    table: Annotated[float, typer.Option("--table", metavar="DEG", help="Turntable angle, in deg.")] = 0.0,
    reference: ReferenceOpt = None,
    tolerance: Annotated[
        float,
        typer.Option("--tolerance-um", help="Maximum deviation from a straight line between points, in um.", min=0.1),
    ] = 10.0,
    rapid: Annotated[
        str, typer.Option("--rapid", help="Rapid moves: linear, or joint: point-to-point joint interpolation.")
    ] = "linear",
    compensate: Annotated[
        bool,
        typer.Option(
            "--compensate",
            help="Correct the path for the deflection under --force or --milling and, with a model calibrated "
            "from positions, for the arm's geometry, joint errors and own weight.",
        ),
    ] = False,
    payload: Annotated[
        str | None,
        typer.Option(
            "--payload",
            metavar="KG[,X,Y,Z]",
            help="What the flange carries (spindle and tool), for the arm's sag: mass in kg and its centre in the "
            "flange frame, in mm. Default: nothing.",
        ),
    ] = None,
    cap: Annotated[
        float | None,
        typer.Option(
            "--cap-um",
            help="Maximum correction of a point, in um. Default: 1000; 5000 with a calibrated geometry, where more is "
            "refused.",
            min=0.1,
        ),
    ] = None,
    ramp: Annotated[
        float,
        typer.Option(
            "--ramp-mm",
            help="Length of path before and after a cut over which its correction fades in and out, in mm; 0 for "
            "one step.",
            min=0.0,
        ),
    ] = RAMP * 1e3,
    approach: Annotated[
        str | None,
        typer.Option(
            "--approach",
            metavar="SIGNS",
            help="End positioning moves from the side that was calibrated: for each joint + or -, the way it turns "
            "last, or 0 where it does not matter, as in +-+00+. Moves at feed are not changed. Default: from any side.",
        ),
    ] = None,
    approach_deg: Annotated[
        float | None,
        typer.Option(
            "--approach-deg",
            help=f"Angle of that last turn, in deg, up to {coming.LARGEST_DEG:g}. Default: {coming.DEGREES:g}.",
        ),
    ] = None,
    force: ForceOpt = None,
    force_axes: ForceAxesOpt = "base",
    force_measured: Annotated[
        float | None,
        typer.Option(
            "--force-measured",
            metavar="N",
            help="Standard deviation of each component of --force, where it was measured, in N. "
            "Default: assumed, 10 %.",
            min=0.0,
        ),
    ] = None,
    milling: MillingOpt = None,
    options: Annotated[
        Path | None, typer.Option("--options", help="Options of the program formats (TOML or JSON).")
    ] = None,
    templates: Annotated[
        Path | None, typer.Option("--template", help="Folder with your own program templates.")
    ] = None,
    speed: Annotated[
        str | None,
        typer.Option(
            "--speed",
            metavar="DEG/S",
            help="Maximum joint speeds in deg/s: one for all joints, or one per joint separated by commas. "
            "Default: the cell's.",
        ),
    ] = None,
    kind: KindOpt = None,
    units: UnitsOpt = None,
    rotary: RotaryOpt = "none",
    tcp: TcpOpt = False,
    read: ReadOpt = None,
    operation: OperationOpt = None,
    tool_number: ToolNumberOpt = None,
    singular: SingularOpt = Drive.singular_least,
    seed: Seed = 0,
    at_load: AtLoad = None,
    links: Links = None,
    load_path: LoadPathOpt = None,
    sets: Sets = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Write robot programs from a tool path and read them back.

    Cartesian and joint programs come from one run. Writes the programs, post.json and a report into --out.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        targets = parse_targets(formats, coordinates)
        given = frame.model(model, links, load_path, sets=sets, shown=True)
        given = frame.at_load(given, at_load)
        expect(path, PATH, model=model)
        setup = read_setup(model, given, cell, tool, part, floor, beam_radius)
        carried = payload_of(given.description, payload, compensate=compensate)
        side = coming.parse_approach(approach, approach_deg, given.robot)
        if (force or milling) and not compensate:
            raise InputError(
                "--force or --milling without --compensate",
                code="A003",
                remedy="add --compensate, or leave the force out; `stiffarm posture` predicts the error it leaves",
            )
        told = reading(kind, units, rotary, tcp, read, operation, tool_number)
        motions = select(read_toolpath(path, kind=told.kind, options=told.options), **told.choice)
        say_notes(motions.notes, path)
        cut = cut_of(setup.cell, motions, force, force_axes, milling, force_measured) if compensate else None
        if compensate and cut is None and carried is None:
            raise InputError(
                "--compensate needs a cutting force",
                code="A003",
                remedy="give --force or --milling, or a model that positions have calibrated",
            )
        alone = {"--travel": travel, "--gamma": gamma}
        followed = None if placement is None else _followed(placement, setup.cell, motions, alone)
        written = WriteOptions() if options is None else read_options(options)
        settings = PostSettings(
            gamma=parse_gammas("0" if gamma is None else gamma),
            objective=Objective(),
            drive=setup.drive(
                Drive(speed=parse_speed(given.robot, speed), singular_least=singular, turn_gain=0.01 * turn_gain),
                clear=False,
            ),
            travel=_travel(setup.cell, travel),
            table=float(np.radians(table)),
            tolerance=tolerance * 1e-6,
            rapid=parse_word(rapid, ("linear", "joint"), "--rapid"),
            reference=parse_reference(reference),
            seed=seed,
        )
        if followed is not None:
            settings = replace(settings, **followed.at_every_move(motions.rapid))
        settings = replace(settings, clearance=setup.clearance(motions, settings.table))
        request = PostRequest(
            motions,
            setup,
            settings,
            targets,
            written.model_copy(update={"rapid": settings.rapid}),
            templates,
            cut if compensate else None,
            None if cap is None else cap * 1e-6,
            ramp * 1e-3,
            stiffness=stiffness_uncertainty(given.model.as_designed, given.description, given.own),
            payload=carried,
            approach=side,
        )
        frame.reads(path=path, cell=cell, milling=milling, options=options, placement=placement)
        with frame.folder() as folder:
            with progress("posture along the path") as bar:
                run = run_post(given.model, request, folder.path, bar)
            if followed is not None:
                _check(run.posted.program, followed)
            positions = given.description.positions
            content = post_report.payload(run, positions) | {"effects_left_out": effects_left_out(given)}
            content |= stated_table(given.model)
            folder.write_json("post.json", content)
            post_report.write_report(run, given.description.title.split(" (")[0], folder, positions)
        for note in not_corrected(given.description, compensate=compensate):
            say(f"note: {note}")
        frame.answer(content, lambda: _show(run, positions))


def _followed(file: Path, cell: Cell, motions: Motions, options: Mapping[str, str | None]) -> Placement:
    """The placement of a file for this cell and path, which leaves nothing for some ``options`` to say."""
    for option, value in options.items():
        if value is not None:
            raise InputError(
                f"{option} with --placement", code="A002", value=value, remedy="the placement says it; leave one out"
            )
    found = read_placement(file)
    names = tuple(axis.name for axis in cell.linear_axes)
    if found.axes != names or found.count != motions.n:
        raise InputError(
            f"placement {file}",
            code="A010",
            value=f"axes {', '.join(found.axes)}, {found.count} moves",
            allowed=f"axes {', '.join(names)}, {motions.n} moves: those of this cell and path",
            remedy="run `stiffarm place` again with this path and cell",
        )
    return found


def _check(program: JointProgram, followed: Placement) -> None:
    """Raise InputError unless the placement's tool frames are the program's; say where its branches are not."""
    given = np.flatnonzero(~program.inserted)[followed.moves]
    axes = followed.q, followed.travel, program.table[given]
    wanted = tool_in_part(program.robot, program.cell, *axes, program.tool_at(given))
    away, turned = frame_distance(wanted, program.T_part_tool[given])
    if max(away.max(), turned.max()) > SAME_FRAME:
        raise InputError(
            "--placement: its postures are not those of this path in this cell",
            code="A010",
            value=f"tool {away.max() * 1e3:.3g} mm and {np.degrees(turned.max()):.3g} deg away",
            allowed=f"{SAME_FRAME * 1e3:g} mm, {np.degrees(SAME_FRAME):.2g} deg",
            remedy="run `stiffarm place` again with this path, cell and tool",
        )
    other = int((np.abs(program.q[given] - followed.q).max(axis=1) > SAME_POSTURE).sum())
    if other:
        say(
            f"note: {other} of {len(given)} points take another branch or turn than the placement, which jumps on "
            "a rapid move; with --rapid joint its own are taken"
        )


def _travel(cell: Cell, text: str | None) -> Array | None:
    """Travels (k,) m of ``--travel``."""
    if text is None:
        return None if not cell.linear_axes else np.zeros(len(cell.linear_axes))
    values = parse_numbers(text)
    if values is None or len(values) != len(cell.linear_axes):
        names = ", ".join(axis.name for axis in cell.linear_axes) or "the cell has no linear axis"
        raise InputError("--travel", code="A004", value=text, allowed=f"one number (mm) for each of: {names}")
    return np.array(values) * 1e-3


def _show(run: PostRun, positions: Positions | None) -> None:
    rows = [
        [target.folder, str(len(run.written[target].files)), f"{trip.tip * 1e6:.2g}", f"{trip.turned * 1e6:.2g}"]
        for target, trip in run.trips.items()
    ]
    title = f"{run.request.motions.n:,} moves read, {run.program.n:,} written"
    show_table(title, ["program", "files", "off path, um", "off path, urad"], rows)
    for note in {note: None for target in run.trips for note in run.written[target].notes}:
        say(f"note: {note}")
    if run.compensated is not None:
        say(post_report.compensation_words(run.compensated))
    if run.corrected is not None and positions is not None:
        say(words(run.corrected, positions))
        for note in remarks(run, run.corrected):
            say(f"note: {note}")
    for text in coming.words(run):
        say(f"note: {text}")
    for text in post_report.uncertainty_words(run):
        say(text)
    say(f"note: {post_report.UNVERIFIED}")
