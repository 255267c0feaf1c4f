"""The command `identify`: six stiffnesses at every joint from displacements and twists between neighbouring arms."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, get_args

import numpy as np
import typer

from doe.joint_twists import LAWS, TwistReadings, write_twists
from doe.joint_twists.cycles import Branches
from doe.joint_twists.substitute import ORIGIN_M, SIZE_M, Orientation
from doe.joint_twists.synthetic import Campaign, draw_truth, make_readings, truth_table
from fem.arm import Arm
from robots import InputError, save_description
from stiffarm.commands.identify import payload as joint_twist_payload
from stiffarm.commands.identify import step as joint_twist_run
from stiffarm.commands.identify.step import JointTwists, Request
from stiffarm.session import inputs
from stiffarm.session.console import say, say_notes, show_table
from stiffarm.session.frame import command
from stiffarm.session.options import ConfirmUnits, Debug, Json, LoadPathOpt, ModelArg, Out, Seed, Sets
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.parsing import parse_numbers, parse_word

SYNTHETIC = "synthetic_joint_twists.csv"
DEFAULT_WINDOW = ",".join(f"{1e3 * v:g}" for v in (*ORIGIN_M, *SIZE_M))


def identify(
    model: ModelArg,
    tables: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="TABLE",
            help="One or more tables (CSV/XLSX) of relative displacements and rotations of neighbouring links,"
            " or of reflector coordinates.",
        ),
    ] = None,
    law: Annotated[
        str | None,
        typer.Option(
            "--law",
            help="Law of each stiffness over its joint angle: constant, fourier-1, fourier-2 or table. "
            "Default: chosen by cross-validation, leaving out one angle at a time.",
        ),
    ] = None,
    branches: Annotated[
        str,
        typer.Option("--branches", help="Readings used: mean (of loading and unloading) or loading (loading only)."),
    ] = "mean",
    holdout: Annotated[
        Path | None,
        typer.Option(
            "--holdout", help="Measurement table of flange deflections (CSV/XLSX), used only to test the prediction."
        ),
    ] = None,
    flange: Annotated[
        str,
        typer.Option(
            "--flange",
            help="Flange orientation over the map: forward (Z along base X), base (parallel to the base) or down.",
        ),
    ] = "forward",
    window: Annotated[
        str,
        typer.Option(
            "--window", help="Window of the map in the plane Y = 0: X and Z of its corner, width and height, in mm."
        ),
    ] = DEFAULT_WINDOW,
    synthetic: Annotated[
        bool,
        typer.Option(
            "--synthetic", help="Simulate a measurement campaign for this model and identify from it. Requires --out."
        ),
    ] = False,
    confirm_units: ConfirmUnits = False,
    seed: Seed = 0,
    load_path: LoadPathOpt = None,
    sets: Sets = None,
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Identify six stiffnesses per joint from joint twists.

    Joint twists are relative displacements and rotations of the two links of a joint. Each stiffness may vary with the
    joint angle. Writes the model with six springs per joint, identification.json, stiffnesses.csv, a map and a report
    into --out.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        request = _request(law, branches, flange, window, seed)
        _check_tables(tables, out, synthetic=synthetic)
        # The two arms of a joint are taken as rigid: what they give way by is in the joint's stiffnesses.
        given = frame.model(model, "rigid", load_path, sets=sets)
        inputs.refuse_effects(given, "identification", "remove the [[effect]] tables: joints are identified anew")
        other = frame.held_out(given, holdout, confirm_units=confirm_units)
        data = None if synthetic else joint_twist_run.read_tables(given, tables or (), frame.named)
        if data is not None:
            for number, table in enumerate(tables or (), start=1):
                frame.files["synthetic_data" if data.synthetic else "data" if number == 1 else f"data_{number}"] = table
        with frame.folder_if(seed) as folder:
            if data is None:
                data = _make_up(given, seed, folder)
                frame.files["synthetic_data"] = data.sha256
            say_notes(data.notes)
            with frame.timed("identification"):
                found = joint_twist_run.run(given, data, request, holdout=other, say=say)
            content = joint_twist_payload.identification(found)
            if folder is not None:
                _write(found, content, folder)
        frame.answer(content, lambda: _show(found))


def _request(law: str | None, branches: str, flange: str, window: str, seed: int) -> Request:
    chosen = None if law is None else parse_word(law, LAWS, "--law")
    ways = parse_word(branches, get_args(Branches), "--branches")
    turned = parse_word(flange, get_args(Orientation), "--flange")
    numbers = parse_numbers(window) or ()
    if len(numbers) != 4 or not all(0.0 < size < 1e5 for size in numbers[2:]):
        raise InputError(
            "--window",
            code="A004",
            value=window,
            allowed="four numbers in mm: X, Z, width and height above 0",
            remedy=f"write them as in {DEFAULT_WINDOW}",
        )
    x, z, width, height = (1e-3 * number for number in numbers)
    return Request(chosen, ways, turned, (x, z), (width, height), seed)


def _check_tables(tables: list[Path] | None, out: Path | None, *, synthetic: bool) -> None:
    if synthetic and tables:
        raise InputError("--synthetic and TABLE: one of them at a time", code="A002", remedy="leave one out")
    if synthetic and out is None:
        raise InputError(
            "--synthetic without --out", code="A003", remedy="name a folder for the made-up table with --out"
        )
    if not synthetic and not tables:
        raise InputError(
            "TABLE",
            code="A003",
            value="none",
            allowed="one or more tables of joint twists, CSV or XLSX",
            remedy="give your readings, or try --synthetic, which makes some up",
        )


def _make_up(given: Arm, seed: int, folder: OutputFolder | None) -> TwistReadings:
    """Write a synthetic table and its truth, and read the table back: identification sees nothing else."""
    if folder is None:  # refused before
        raise InputError("--synthetic without --out", code="A003")
    rng = np.random.default_rng(seed)
    truth = draw_truth(given.model, rng)
    path = folder.path(SYNTHETIC)
    write_twists(make_readings(given.model, truth, Campaign(), rng), path, given.robot)
    folder.write_json(
        "synthetic_truth.json",
        {
            "synthetic": True,
            "seed": seed,
            "ln_k": "c0 + c1 cos q + c2 sin q, N/m or N m/rad",
            "springs": truth_table(truth),
            "friction_Nm": truth.friction.tolist(),
        },
    )
    return joint_twist_run.read_tables(given, [path])


def _write(found: JointTwists, content: dict[str, Any], folder: OutputFolder) -> None:
    """identification.json, model.toml, CSV tables, pictures and report.html."""
    from stiffarm.commands.identify.report import write_report

    folder.write_json("identification.json", content)
    save_description(found.description, folder.path("model.toml"))
    folder.write_text("stiffnesses.csv", joint_twist_payload.stiffness_table(found))
    if found.window is not None:
        folder.write_text("stiffness_map.csv", joint_twist_payload.map_table(found.window))
    with folder.timed("report"):
        write_report(found, folder)


def _show(found: JointTwists) -> None:
    from stiffarm.commands.identify.report import stiffness_rows, summary

    show_table(
        "Six stiffnesses of each joint, mid-angle: N/um and 1e6 N m/rad, 95 % intervals",
        ["joint", "tx", "ty", "tz", "rx", "ry", "rz"],
        [list(row) for row in stiffness_rows(found)],
    )
    for line in summary(found):
        say(line)
