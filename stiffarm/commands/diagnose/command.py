"""The command `diagnose`: what the model is missing, by measured deflections."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from doe.diagnosis.nested import FOLDS
from doe.diagnosis.scatter import SETUP
from stiffarm.commands.calibrate import tables as calibration_tables
from stiffarm.commands.diagnose import payload as diagnosis_payload
from stiffarm.commands.diagnose import step as diagnosing
from stiffarm.commands.diagnose import words as diagnosis_words
from stiffarm.commands.diagnose.next_words import advice
from stiffarm.commands.diagnose.step import Diagnosed, Request
from stiffarm.session import parsing
from stiffarm.session.console import progress, say, say_notes, show_table
from stiffarm.session.frame import command
from stiffarm.session.options import (
    Clearance,
    ConfirmUnits,
    Debug,
    EffectFile,
    Floor,
    Json,
    KeepOut,
    Links,
    LoadPathOpt,
    Loads,
    ModelArg,
    Out,
    Seed,
    Sets,
    TablesArg,
)
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.table_kinds import are_positions
from stiffarm.session.zones import FLOOR, parse_zone


def diagnose(
    model: ModelArg,
    data: TablesArg = None,
    holdout: Annotated[
        Path | None,
        typer.Option(
            "--holdout",
            help="Measurement table of other poses (CSV/XLSX), kept out of the diagnosis to test its result.",
        ),
    ] = None,
    effect: EffectFile = None,
    free: Annotated[
        str | None,
        typer.Option(
            "--free",
            help="Joints whose stiffness is fitted, separated by commas, as in j2,j3. Default: all joints with"
            " a spring.",
        ),
    ] = None,
    next_poses: Annotated[
        int,
        typer.Option(
            "--next",
            help="Number of further set-ups to propose if the readings leave something open; 0 for none.",
            min=0,
            max=30,
        ),
    ] = 3,
    floor: Floor = FLOOR,
    keep_out: KeepOut = None,
    clearance: Clearance = None,
    folds: Annotated[
        int,
        typer.Option(
            "--folds",
            help="Number of parts into which the poses are split at random; for each part the diagnosis is "
            "repeated without it and then predicts it. Fewer than ten poses are left out one at a time; 0 "
            "for none.",
            min=0,
            max=50,
        ),
    ] = FOLDS,
    setup_percent: Annotated[
        float,
        typer.Option(
            "--setup-percent",
            help="Expected scatter between set-ups, in percent of the deflection. More than twice as much "
            "counts as an unknown effect.",
            min=0.05,
            max=20.0,
        ),
    ] = 100.0 * SETUP,
    seed: Seed = 0,
    loads: Loads = None,
    confirm_units: ConfirmUnits = False,
    links: Links = None,
    load_path: LoadPathOpt = None,
    sets: Sets = None,
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Find out what the model is missing, and how sure that is.

    Shows where the model disagrees with the readings, which physical effect explains it, and which set-ups to measure
    next. Writes diagnosis.json, the model with the identified effects and a report into --out.

    Tables with x_mm, y_mm and z_mm hold absolute positions in a tracker's frame: geometry, frames and targets are
    then fitted together with every candidate.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        chosen_loads = parsing.parse_loads(loads) or ()
        given = frame.model(model, links, load_path, effect=effect, sets=sets)
        zone = parse_zone(given.description, floor, keep_out or (), clearance)
        names = parsing.parse_names(free, given.robot.joint_names, "--free")
        if are_positions(data):
            from stiffarm.commands.diagnose.positions.run import diagnose_tables

            refused = {
                "--free": free,
                "--effect": effect,
                "--loads": loads,
                "--keep-out": keep_out or None,
                "--clearance": clearance,
            }
            diagnose_tables(frame, given, data or (), refused, holdout=holdout, seed=seed)
            return
        table = frame.readings(given, data, confirm_units=confirm_units)
        other = frame.held_out(given, holdout, confirm_units=confirm_units)
        with frame.folder_if(seed) as folder:
            request = Request(chosen_loads, names, next_poses, seed, setup_percent / 100.0, folds, zone)
            with frame.timed("diagnosis"), progress("this step of the diagnosis") as bar:
                found = diagnosing.diagnose(given, table, request, holdout=other, say=say, progress=bar)
            say_notes(found.remarks)
            content = diagnosis_payload.diagnosis(found) if folder is None else _write(found, folder)
        frame.answer(content, lambda: _show(found))


def _write(found: Diagnosed, folder: OutputFolder) -> dict[str, Any]:
    """All files, the report last; returns what diagnosis.json holds."""
    from stiffarm.commands.diagnose.files import write_files
    from stiffarm.commands.diagnose.report import write_report

    written = write_files(found, folder)
    with folder.timed("report"):
        write_report(found, written, folder)
    return written.content


def _show(found: Diagnosed) -> None:
    for line in diagnosis_words.summary(found):
        say(line)
    say(f"What to do next: {advice(found).text}")
    if not found.tells:
        return
    if found.calibrated is not None:
        calibration_tables.show_answer(found.calibrated)
    rows = [
        [h.code, f"{100.0 * h.probability:.1f} %", f"{h.log_evidence:.1f}", f"{h.lopo_rms_mm:.4f}"]
        for h in found.found.ranking.hypotheses[:8]
    ]
    show_table(
        "Candidates", ["code", "probability", "log evidence", "RMS of poses left out, at its own noise (mm)"], rows
    )
