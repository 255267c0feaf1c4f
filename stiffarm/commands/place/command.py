"""The command `place`: from a cell, a path and a force to where the robot's base should stand."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from fem.arm import Arm
from machining import Drive
from machining.cell import read_cell
from machining.cutting import stiffness_uncertainty
from machining.placement import AIMS, MODES, Goal, How, Problem, space_of
from machining.placement.study import PlacedStep, place_along, scene_for
from machining.setup import Setup
from machining.stiffness.criterion import Criterion
from machining.tooling import require_tools
from machining.toolpaths import read_given_path
from robots import InputError
from robots.files.csv_text import columns_parts
from stiffarm.commands.place import payload as placement_payload
from stiffarm.pages.arm_uncertainty import sentence
from stiffarm.session.console import progress, say, show_table
from stiffarm.session.frame import command
from stiffarm.session.options import Debug, Json, Links, LoadPathOpt, ModelArg, Out, Sets
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.parsing import parse_numbers, parse_word
from stiffarm.session.path_options import OperationOpt, ReadOpt, ToolNumberOpt, reading
from stiffarm.session.softness import require_springs
from stiffarm.session.stated import AtLoad, stated_table
from stiffarm.session.table_kinds import PATH, expect
from stiffarm.session.task_options import GammaOpt, parse_gammas
from stiffarm.session.task_setup import (
    BeamRadiusOpt,
    KindOpt,
    MillingOpt,
    RotaryOpt,
    SingularOpt,
    TcpOpt,
    UnitsOpt,
    cut_of,
    parse_speed,
    say_notes,
)


def place(
    model: ModelArg,
    path: Annotated[
        Path,
        typer.Argument(
            metavar="PATH", help="Tool path: APT, CLS, G-code, or CSV with the columns x_mm,y_mm,z_mm,nx,ny,nz."
        ),
    ],
    cell: Annotated[
        Path,
        typer.Option(
            "--cell", metavar="CELL.toml", help="Cell file (TOML): linear axes, turntable, part, tool and surroundings."
        ),
    ],
    force: Annotated[
        str | None,
        typer.Option("--force", metavar="X,Y,Z", help="Cutting force on the tool, in N, in the axes of --force-axes."),
    ] = None,
    force_axes: Annotated[
        str, typer.Option("--force-axes", help="Axes of --force: part, process (feed, cross-feed, tool axis) or base.")
    ] = "part",
    milling: MillingOpt = None,
    aim: Annotated[
        str | None,
        typer.Option(
            "--aim",
            help="What to optimise: error (surface error under the force), ksf (the criterion K_sf), or mean or worst "
            "(stiffness along the force). Default: error; ksf with --alpha and --beta.",
        ),
    ] = None,
    mode: Annotated[
        str,
        typer.Option(
            "--mode", help="Motion of the base: fixed, steps:N (at most N positions) or moving (along the path)."
        ),
    ] = "fixed",
    gamma: GammaOpt = "-180:180:10",
    gamma_course: Annotated[
        bool, typer.Option("--gamma-course", help="Let gamma vary along the path where that is better.")
    ] = False,
    ranges: Annotated[
        list[str] | None,
        typer.Option(
            "--range",
            metavar="AXIS=FROM:TO",
            help="Range of a linear axis to search, in mm. May be repeated. Default: the axis limits.",
        ),
    ] = None,
    table: Annotated[
        str, typer.Option("--table", metavar="DEG or FROM:TO", help="Turntable angle, or range to search, in deg.")
    ] = "0",
    alpha: Annotated[
        float | None,
        typer.Option(
            "--alpha",
            help="Weight of sum k^2 in K_sf, in mm^2/N^2; requires --beta. Default: chosen so that the terms "
            "are comparable.",
        ),
    ] = None,
    beta: Annotated[
        float | None,
        typer.Option(
            "--beta",
            help="Weight of (mean k)^4 in K_sf, in mm^4/N^4; requires --alpha. Default: chosen so that the "
            "terms are comparable.",
        ),
    ] = None,
    by_length: Annotated[
        bool, typer.Option("--by-length", help="Weight sums and means by path length instead of by points.")
    ] = False,
    anywhere: Annotated[
        bool,
        typer.Option(
            "--anywhere",
            help="With --mode steps: allow the base to move between any two points, not only on rapid moves.",
        ),
    ] = False,
    cost: Annotated[
        float,
        typer.Option(
            "--cost",
            metavar="PERCENT",
            help="With --mode steps: least improvement that justifies one more move of the base, in percent. With "
            "--mode moving: loss, in percent, accepted to keep axes still during each cut.",
        ),
    ] = 1.0,
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
    clearance: Annotated[
        float | None,
        typer.Option(
            "--clearance",
            metavar="MM",
            help="Distance to keep from the surroundings, in mm. Default: the cell's safety distance.",
        ),
    ] = None,
    collisions: Annotated[
        bool, typer.Option("--collisions/--no-collisions", help="Keep the arm clear of the cell and its surroundings.")
    ] = True,
    beam_radius: BeamRadiusOpt = None,
    singular: SingularOpt = Drive.singular_least,
    kind: KindOpt = None,
    units: UnitsOpt = None,
    rotary: RotaryOpt = "none",
    tcp: TcpOpt = False,
    read: ReadOpt = None,
    operation: OperationOpt = None,
    tool_number: ToolNumberOpt = None,
    at_load: AtLoad = None,
    links: Links = None,
    load_path: LoadPathOpt = None,
    sets: Sets = None,
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Find where the base should stand for the stiffest cut.

    The base stands or moves on the linear axes of the cell. Writes report.html, axes.html (an axes map in which you
    can drag gamma), placement.csv, positions.csv (the result at each base position, or what rules it out) and
    placement.json into --out.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        given = frame.model(model, links, load_path, sets=sets, shown=True).as_designed
        given = frame.at_load(given, at_load)
        require_springs(given, "placement")
        described = read_cell(cell)
        if beam_radius is not None:
            described = replace(described, beam_radius=beam_radius * 1e-3)
        drive = Drive(speed=parse_speed(given.robot, speed), jump=float(np.radians(jump)), singular_least=singular)
        expect(path, PATH, model=model)
        told = reading(kind, units, rotary, tcp, read, operation, tool_number)
        given_path = read_given_path(path, kind=told.kind, options=told.options, **told.choice)
        say_notes(given_path.notes, path)
        require_tools(described, given_path.motions)
        cut = cut_of(described, given_path.motions, force, force_axes, milling)
        if cut is None:
            raise InputError(
                "place needs a cutting force",
                code="A003",
                allowed="--force, --milling, or milling files of the cell's tools",
                remedy="give one of them",
            )
        cutting = given_path.drilling(cut.force)
        criterion = _criterion(alpha, beta)
        told_aim = aim or ("error" if criterion is None else "ksf")
        goal = Goal(parse_word(told_aim, AIMS, "--aim"), cutting, criterion, by_length)
        how = _how(mode, anywhere, cost, gamma_course)
        scene, notes = scene_for(described, model, given.description) if collisions else (None, ())
        problem = Problem(
            model=given.model,
            space=space_of(described, dict(_range(text) for text in ranges or []), table=_table(table)),
            path=given_path.path,
            goal=goal,
            gamma=parse_gammas(gamma),
            drive=Setup(described).drive(drive),
            scene=scene,
            clearance=described.safety if clearance is None else clearance * 1e-3,
            free=given_path.free,
            stiffness=stiffness_uncertainty(given.model, given.description, given.own),
            tools=Setup(described, None if scene is None else scene.arm).tools(given_path),
        )
        frame.reads(path=path, cell=cell, milling=milling)
        with frame.folder_if() as folder:
            with progress("place") as bar:
                step = place_along(
                    problem, given_path, how, notes, lambda _, done, total: bar(done, total), mapped=folder is not None
                )
            content = placement_payload.payload(step) | stated_table(given.model)
            if folder is not None:
                _write(folder, model, given, step, content)
        frame.answer(content, lambda: _show(step))


def _criterion(alpha: float | None, beta: float | None) -> Criterion | None:
    if (alpha is None) != (beta is None):
        raise InputError(
            "weights of K_sf",
            code="A001",
            value="one of --alpha and --beta",
            allowed="both or none",
            remedy="give both",
        )
    return None if alpha is None or beta is None else Criterion(alpha, beta)


def _how(mode: str, anywhere: bool, cost: float, course: bool) -> How:
    name, _, count = mode.partition(":")
    fits = name in MODES and (count.isdecimal() if name == "steps" else not count)
    if not fits:
        allowed = "fixed, steps:N or moving"
        raise InputError("--mode", code="A001", value=mode, allowed=allowed, remedy="as in --mode steps:3")
    found: Any = name
    return How(found, int(count) if count else 2, anywhere, cost * 1e-2, course)


def _range(text: str) -> tuple[str, tuple[float, float]]:
    name, found, values = text.partition("=")
    pair = _pair(values)
    if not found or not name or pair is None:
        raise InputError(
            "--range", code="A004", value=text, allowed="AXIS=FROM:TO in mm", remedy="as in --range rail=-500:1500"
        )
    return name, (pair[0] * 1e-3, pair[1] * 1e-3)


def _table(text: str) -> float | tuple[float, float]:
    pair = _pair(text)
    if pair is None:
        raise InputError(
            "--table", code="A004", value=text, allowed="one angle, or FROM:TO in deg", remedy="as in --table -90:90"
        )
    return math.radians(pair[0]) if ":" not in text else (math.radians(pair[0]), math.radians(pair[1]))


def _pair(text: str) -> tuple[float, float] | None:
    """Two finite numbers from ``a:b``, or one twice."""
    values = parse_numbers(text, ":")
    return None if values is None or len(values) > 2 else (values[0], values[-1])


def _write(folder: OutputFolder, model: str, given: Arm, step: PlacedStep, content: dict[str, Any]) -> None:
    from stiffarm.commands.place import positions
    from stiffarm.commands.place.axes import axes_study
    from stiffarm.commands.place.report import write_report
    from stiffarm.commands.posture.axes_page import NAME, axes_page

    folder.write_json("placement.json", content)
    folder.write_parts("placement.csv", columns_parts(placement_payload.columns(step)))
    folder.write_parts(positions.NAME, columns_parts(positions.position_columns(step.map)))
    title = given.description.title.split(" (")[0]
    study = axes_study(step, model, given.description)
    if study is not None:
        folder.write_text(NAME, axes_page(study, f"{title} in cell {step.cell.name}"))
    write_report(step, title, folder)


def _show(step: PlacedStep) -> None:
    from stiffarm.commands.place.report import COLUMNS, remarks, table_rows

    path = step.given.path
    title = f"{path.n} points, {1e3 * path.arc_length[-1]:.4g} mm; {step.placed.evaluations} base positions"
    show_table(title, list(COLUMNS), [list(row) for row in table_rows(step)])
    say(sentence(step.placed.problem.uncertainty))
    for text in remarks(step):
        say(f"note: {text}")
