"""The command `verify`: a program replayed in its cell before the cell moves."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from machining.programs.formats import CONTROLLERS, neutral_twin, read_options, read_program
from machining.programs.write_options import WriteOptions
from machining.verification import Demands, Verification, verify
from machining.verification.offences import ORDER
from robots import content_hash
from robots.files.csv_text import columns_parts, records_text
from robots.joint_errors import designed
from robots.robot import robot_from
from stiffarm.commands.verify.payload import move_columns, offence_rows, payload
from stiffarm.commands.verify.words import REMEDIES, distance_words, offence_words, sentence, value_words
from stiffarm.session.console import EXIT_OTHER, progress, say, show_table
from stiffarm.session.frame import command
from stiffarm.session.options import Debug, Json, ModelArg, Out, Sets
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.parsing import parse_word
from stiffarm.session.table_kinds import PROGRAM, described, expect
from stiffarm.session.task_options import PartOpt, ToolOpt
from stiffarm.session.task_setup import BeamRadiusOpt, CellOpt, FloorOpt, bodies_of, read_cell_or_frames

# Offences shown on the screen.
SHOWN = 12


def verify_command(
    model: ModelArg,
    program: Annotated[
        Path,
        typer.Argument(
            metavar="PROGRAM",
            help="Program written by `stiffarm post`: JSON or CSV, or the main file of a controller's.",
        ),
    ],
    cell: CellOpt = None,
    floor: FloorOpt = None,
    beam_radius: BeamRadiusOpt = None,
    tool: ToolOpt = None,
    part: PartOpt = None,
    interpolation: Annotated[
        str,
        typer.Option(
            "--interpolation",
            help="Interpolation between points: joint (synchronised joint motion), linear (straight tool path)"
            " or mixed (linear while cutting).",
        ),
    ] = "joint",
    safety: Annotated[
        float | None,
        typer.Option(
            "--safety",
            metavar="MM",
            help="Distance to keep from the surroundings, in mm. Default: the cell's safety distance.",
            min=0.0,
        ),
    ] = None,
    resolution: Annotated[
        float,
        typer.Option("--resolution", metavar="MM", help="Resolution: moves are subdivided down to this motion, in mm."),
    ] = 1.0,
    tolerance: Annotated[
        float,
        typer.Option("--tolerance", metavar="MM", help="Allowed tool-tip deviation from the programmed path, in mm."),
    ] = 0.1,
    smoothing: Annotated[
        float, typer.Option("--smoothing", metavar="MS", help="Time over which the controller blends corners, in ms.")
    ] = 50.0,
    singular: Annotated[
        float, typer.Option("--singular", help="Least distance from singularities, 0 to 1.", min=0.0)
    ] = Demands.singular_least,
    jump: Annotated[
        float, typer.Option("--jump", metavar="DEG", help="Largest joint step without tool motion, in deg.")
    ] = 20.0,
    against: Annotated[
        Path | None,
        typer.Option(
            "--against",
            metavar="JSON",
            help="The neutral program of the same run, which a controller's program must agree with. "
            "Default: that in the folder json beside the program's folder.",
        ),
    ] = None,
    options: Annotated[
        Path | None,
        typer.Option("--options", help="Options that a controller's program was written with (TOML or JSON)."),
    ] = None,
    sets: Sets = None,
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Check a program for collisions, limits and singularities.

    Also for speeds, branch changes and path deviations, before the cell moves. Exit code 0: no offence (there may be
    warnings); 1: offences, the worst one is named; 2: bad input. Writes report.html, replay.html, verification.json,
    offences.csv and moves.csv into --out.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        demands = Demands(
            interpolation=parse_word(interpolation, ("joint", "linear", "mixed"), "--interpolation"),
            safety=None if safety is None else safety * 1e-3,
            resolution=resolution * 1e-3,
            tolerance=tolerance * 1e-3,
            smoothing=smoothing * 1e-3,
            singular_least=singular,
            jump=float(np.radians(jump)),
        )
        # Springs and effects move nothing here: the model as a whole is needed to name its parameters only.
        description = frame.model(model, sets=sets).description if sets else described(model)
        # Programs are the controller's, which computes with the arm as designed.
        as_built = designed(description)
        robot = robot_from(as_built)
        if program.suffix.lower() not in CONTROLLERS:
            expect(program, PROGRAM, model=model)
        where = read_cell_or_frames(robot, cell, tool, part, floor)
        told = WriteOptions() if options is None else read_options(options)
        beside = against or neutral_twin(program)
        checked = read_program(program, robot, where, told, beside)
        arm = bodies_of(model, as_built, checked.cell, beam_radius)
        frame.files |= {"model": content_hash(description), "program": program}
        frame.reads(cell=cell, options=options, against=beside)
        with frame.folder_if() as folder:
            with progress("moves checked") as bar:
                found = verify(checked, arm, demands, progress=bar)
            content = payload(found)
            if folder is not None:
                _write(folder, found, description.title.split(" (")[0], content)
        frame.answer(content, lambda: _show(found))
        if not found.clean:
            worst = found.ranked[0]
            say(f"stiffarm: this program must not run: {sentence(worst)}. To fix it: {REMEDIES[worst.kind]}")
            raise typer.Exit(EXIT_OTHER)


def _write(folder: OutputFolder, found: Verification, title: str, content: dict[str, Any]) -> None:
    from stiffarm.commands.verify.replay import replay_page
    from stiffarm.commands.verify.report import write_report

    folder.write_json("verification.json", content)
    folder.write_text("offences.csv", records_text(offence_rows(found)))
    folder.write_parts("moves.csv", columns_parts(move_columns(found)))
    source = found.program.motions.source
    folder.write_text("replay.html", replay_page(found, f"{title}, {source}" if source else title))
    write_report(found, title, folder)


def _show(found: Verification) -> None:
    say(f"{found.program.n} moves, {len(found.errors)} offences; least distance of bodies: {distance_words(found)}")
    if found.offences:
        rows = [
            [str(o.line), str(o.moves), f"{o.kind} ({o.severity})", offence_words(o), value_words(o)]
            for o in found.ranked[:SHOWN]
        ]
        show_table(f"offences, {ORDER}", ["line", "moves", "kind", "what", "value"], rows)
        if len(found.offences) > SHOWN:
            say(f"and {len(found.offences) - SHOWN} more")
    for text in found.not_looked_at:
        say(f"not checked: {text}")
