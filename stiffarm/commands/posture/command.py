"""The command `posture`: from a part's path to the posture along it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from fem.arm import Arm
from machining import INDICES, Drive, GammaRange, Objective
from machining.cutting import stiffness_uncertainty
from machining.posture.posing import CHOSEN, Posed, PostureRequest, pose_along
from machining.programs.run import deflects
from machining.setup import Setup
from machining.stiffness.objective import DISPLACEMENTS, ROOM
from machining.toolpaths import read_given_path
from machining.toolpaths.conversion import GivenPath
from robots import InputError
from robots.arrays import Array
from robots.files.csv_text import columns_parts
from stiffarm.commands.posture import payload as posture_payload
from stiffarm.pages.arm_uncertainty import sentence
from stiffarm.session.console import progress, say, say_notes, show_table
from stiffarm.session.frame import command
from stiffarm.session.inputs import model_hash
from stiffarm.session.options import Debug, Json, Links, LoadPathOpt, ModelArg, Out, Seed, Sets
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.parsing import parse_word
from stiffarm.session.path_options import OperationOpt, ReadOpt, ToolNumberOpt, reading
from stiffarm.session.softness import require_springs
from stiffarm.session.stated import AtLoad, stated_table
from stiffarm.session.table_kinds import PATH, expect
from stiffarm.session.task_options import (
    GammaOpt,
    PartOpt,
    ReferenceOpt,
    ToolOpt,
    parse_gammas,
)
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
    say_path_notes,
)

# A range so narrow (rad) is one angle.
FIXED_HALF_WIDTH = 1e-10


def posture(
    model: ModelArg,
    path: Annotated[
        Path,
        typer.Argument(
            metavar="PATH", help="Tool path: APT, CLS, G-code, or CSV with the columns x_mm,y_mm,z_mm,nx,ny,nz."
        ),
    ],
    tool: ToolOpt = None,
    part: PartOpt = None,
    gamma: GammaOpt = "-180:180:5",
    before: Annotated[
        float, typer.Option("--before", metavar="DEG", help="Gamma of the existing program, in deg, for comparison.")
    ] = 0.0,
    quantity: Annotated[
        str | None,
        typer.Option(
            "--quantity",
            help=f"Quantity to optimise: {', '.join((*INDICES, *DISPLACEMENTS, ROOM))} (to joint limits and "
            f"singularities). Default: k_fs; {ROOM} for an arm of which no stiffness is known.",
        ),
    ] = None,
    aim: Annotated[
        str,
        typer.Option("--aim", help="Optimise the mean over the points of the path, or the worst point: mean or worst."),
    ] = "mean",
    reference: ReferenceOpt = None,
    cell: CellOpt = None,
    floor: FloorOpt = None,
    beam_radius: BeamRadiusOpt = None,
    turn_gain: TurnGainOpt = 10.0,
    force: ForceOpt = None,
    force_axes: ForceAxesOpt = "base",
    milling: MillingOpt = None,
    speed: Annotated[
        str | None,
        typer.Option(
            "--speed",
            metavar="DEG/S",
            help="Maximum joint speeds in deg/s: one for all joints, or one per joint separated by commas. "
            "Default: the cell's.",
        ),
    ] = None,
    jump: Annotated[
        float,
        typer.Option(
            "--jump", metavar="DEG", help="Maximum joint motion between two neighbouring points, in deg.", min=1e-6
        ),
    ] = 20.0,
    gamma_step: Annotated[
        float | None,
        typer.Option(
            "--gamma-step",
            metavar="DEG",
            help="Maximum change of gamma from point to point, in deg; 0 for one gamma along the path. "
            "Default: no limit.",
            min=0.0,
        ),
    ] = None,
    limit_margin: Annotated[
        float,
        typer.Option("--limit-margin", metavar="DEG", help="Distance to keep from the joint limits, in deg.", min=0.0),
    ] = 0.5,
    singular: SingularOpt = Drive.singular_least,
    kind: KindOpt = None,
    units: UnitsOpt = None,
    rotary: RotaryOpt = "none",
    tcp: TcpOpt = False,
    read: ReadOpt = None,
    operation: OperationOpt = None,
    tool_number: ToolNumberOpt = None,
    seed: Seed = 0,
    at_load: AtLoad = None,
    links: Links = None,
    load_path: LoadPathOpt = None,
    sets: Sets = None,
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Find the stiffest posture along a tool path.

    Chooses the angle gamma about the tool axis, branch and turns of the joints such that the arm can follow the path.
    Writes report.html, axes.html (an axes map in which you can drag the course), posture.csv and posture.json into
    --out.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        given = frame.model(model, links, load_path, sets=sets, shown=True).as_designed
        given = frame.at_load(given, at_load)
        expect(path, PATH, model=model)
        setup = read_setup(model, given, cell, tool, part, floor, beam_radius)
        springless = not deflects(given.model)
        if springless and (force is not None or milling is not None or quantity not in (None, ROOM)):
            require_springs(given, "posture")
        quantity = quantity or (ROOM if springless else "k_fs")
        told = reading(kind, units, rotary, tcp, read, operation, tool_number)
        tool_path = read_given_path(path, kind=told.kind, options=told.options, **told.choice)
        say_path_notes(tool_path.notes, path)
        task = setup.task(tool_path, parse_reference(reference))
        cut = None if springless else cut_of(setup.cell, tool_path.motions, force, force_axes, milling)
        if cut is not None:
            cut = replace(cut, force=tool_path.acting(cut.force), tool=tool_path.bending(cut.tool))
        drive = Drive(
            speed=parse_speed(given.robot, speed),
            jump=float(np.radians(jump)),
            singular_least=singular,
            limit_least=float(np.radians(limit_margin)),
            turn_gain=0.01 * turn_gain,
            gamma_step=np.inf if gamma_step is None else float(np.radians(gamma_step)),
        )
        request = PostureRequest(
            task,
            _objective(quantity, aim, None if cut is None else cut.force.along(task).force),
            _gammas(gamma),
            setup.drive(drive, given=tool_path),
            float(np.radians(before)),
            seed,
            cut,
            tuple(effects_left_out(given)),
            stiffness_uncertainty(given.model, given.description, given.own),
        )
        frame.reads(path=path, cell=cell, milling=milling)
        with frame.folder_if(seed) as folder:
            with progress("posture along the path") as bar:
                posed = pose_along(given.model, request, bar)
            content = posture_payload.payload(posed) | {
                "model_hash": model_hash(given),
                "links": given.model.link_kind,
                "load_path": given.model.load_path,
                "effects_left_out": effects_left_out(given),
                **stated_table(given.model),
            }
            if folder is not None:
                _write(folder, setup, model, given, posed, content, tool_path)
        frame.answer(content, lambda: _show(posed))


def _objective(quantity: str, aim: str, force: Array | None) -> Objective:
    parse_word(quantity, (*INDICES, *DISPLACEMENTS, ROOM), "--quantity")
    if force is None and quantity != ROOM and (quantity in DISPLACEMENTS or "force" in INDICES[quantity].uses):
        raise InputError(f"--quantity {quantity} needs a force", code="A003", remedy="give --force or --milling")
    return Objective(quantity, force, parse_word(aim, ("mean", "worst"), "--aim"))


def _gammas(text: str) -> GammaRange:
    gammas = parse_gammas(text)
    if isinstance(gammas, GammaRange):
        return gammas
    return GammaRange(gammas - FIXED_HALF_WIDTH, gammas + FIXED_HALF_WIDTH, 2)


def _write(
    folder: OutputFolder, setup: Setup, model: str, given: Arm, posed: Posed, content: dict[str, Any], path: GivenPath
) -> None:
    from stiffarm.commands.posture.axes import axes_study
    from stiffarm.commands.posture.axes_page import NAME, axes_page
    from stiffarm.commands.posture.report import write_report

    folder.write_json("posture.json", content)
    folder.write_parts("posture.csv", columns_parts(posture_payload.columns(posed)))
    title = given.description.title.split(" (")[0]
    study = axes_study(posed, setup, model, given.description, path)
    if study is not None:
        folder.write_text(NAME, axes_page(study, title))
    write_report(posed, title, folder)


def _show(posed: Posed) -> None:
    _, words, _ = posture_payload.quantity(posed.request.objective)
    rows = []
    for name, course in ({CHOSEN: posed.course} | posed.others).items():
        jumps = len(course.smoothness.undrivable)
        gain = "" if name == CHOSEN else posture_payload.gain_words(posed, name)
        drivable = f"no ({jumps} jumps)" if jumps else "yes"
        rows.append([*posture_payload.course_cells(posed, name, course), drivable, gain])
    path = posed.request.task.path
    title = f"{words} on {path.n} points, {1e3 * path.arc_length[-1]:.4g} mm"
    show_table(title, ["course", "mean", "95 %", "worst", "gamma, deg", "drivable", "gain"], rows)
    say(sentence(posed.stiffness))
    say_notes(posture_payload.remarks(posed))
    if posed.milling is not None and posed.milling.comparison is not None:
        say(f"Compared with {posed.milling.against}: {posed.milling.comparison.sentence}")
