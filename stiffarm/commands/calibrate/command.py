"""The command `calibrate`: the published scheme, or any numbers of the model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from doe.tables.loaded import history_of
from stiffarm.commands.calibrate import general as general_calibration
from stiffarm.commands.calibrate import payload as calibration_payload
from stiffarm.commands.calibrate import tables as calibration_tables
from stiffarm.commands.calibrate.general import MOST_DRAWS, Options
from stiffarm.session import inputs, parsing
from stiffarm.session.console import say_notes
from stiffarm.session.frame import command
from stiffarm.session.options import (
    ConfirmUnits,
    Debug,
    EffectFile,
    Joints,
    Json,
    Links,
    LoadPathOpt,
    Loads,
    ModelArg,
    Out,
    SchemeFile,
    Seed,
    Sets,
    TablesArg,
)
from stiffarm.session.reading_checks import history_notes
from stiffarm.session.table_kinds import are_positions

Free = Annotated[
    str | None,
    typer.Option(
        "--free",
        help="Parameters to identify, separated by commas, as in j2.stiffness,j3.rx,forearm.modulus; "
        "replaces --joints.",
    ),
]


def calibrate(
    model: ModelArg,
    data: TablesArg = None,
    scheme: Annotated[
        str | None,
        typer.Option(
            "--scheme",
            help="Calibration scheme: staged (the published one) or global (all parameters at once). Default: "
            "staged if a scheme is known for the robot.",
        ),
    ] = None,
    joints: Joints = None,
    free: Free = None,
    campaign: Annotated[
        Path | None,
        typer.Option(
            "--campaign", help="Campaign file (TOML): parameters to identify, their ranges, priors, laws and stages."
        ),
    ] = None,
    effect: EffectFile = None,
    loads: Loads = None,
    spacing: Annotated[
        str | None,
        typer.Option(
            "--spacing", help="Spacing of the factor levels in a staged calibration: log or linear. Default: log."
        ),
    ] = None,
    low: Annotated[
        float | None,
        typer.Option(
            help="Lower bound for joint stiffnesses in a global calibration, in N m/rad. Default: the "
            "scheme's, otherwise that of arms of this size."
        ),
    ] = None,
    high: Annotated[
        float | None,
        typer.Option(
            help="Upper bound for joint stiffnesses in a global calibration, in N m/rad. Default: the "
            "scheme's, otherwise that of arms of this size."
        ),
    ] = None,
    holdout: Annotated[
        Path | None,
        typer.Option(
            "--holdout",
            help="Measurement table of other poses (CSV/XLSX), kept out of the calibration to test its prediction.",
        ),
    ] = None,
    robust: Annotated[bool, typer.Option("--robust/--no-robust", help="Give outliers less weight.")] = True,
    bootstrap: Annotated[
        int,
        typer.Option(
            "--bootstrap",
            help="Number of bootstrap samples of the poses (drawn with replacement); 0 for none.",
            min=0,
            max=MOST_DRAWS,
        ),
    ] = 0,
    seed: Seed = 0,
    confirm_units: ConfirmUnits = False,
    scheme_file: SchemeFile = None,
    links: Links = None,
    load_path: LoadPathOpt = None,
    sets: Sets = None,
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Identify parameters from measured deflections.

    Tables with x_mm, y_mm and z_mm hold absolute positions in a tracker's frame; --free then takes geometry, zeros,
    ratios, coupling, periodic, springs, tilts, base, rail, payload, or single parameters.

    Writes the calibrated model, the parameters with their intervals and a report into --out.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        staged_only = {"--spacing": spacing}
        global_only = {"--joints": joints, "--free": free, "--campaign": campaign, "--low": low, "--high": high}
        global_only |= {"--holdout": holdout, "--bootstrap": bootstrap or None, "--no-robust": None if robust else ""}
        parsing.parse_word("staged" if scheme is None else scheme, ("staged", "global"), "--scheme")
        parsing.parse_word("log" if spacing is None else spacing, ("log", "linear"), "--spacing")
        parsing.refuse_together({"--joints": joints, "--free": free, "--campaign": campaign})
        parsing.refuse_together({"--campaign": campaign, "--low or --high": low or high})
        chosen_loads = parsing.parse_loads(loads)
        given = frame.model(model, links, load_path, effect=effect, sets=sets)
        if are_positions(data):
            from stiffarm.commands.calibrate.positions.run import calibrate_tables

            refused = {
                **staged_only,
                "--scheme": scheme,
                "--joints": joints,
                "--campaign": campaign,
                "--loads": loads,
                "--low": low,
                "--high": high,
                "--bootstrap": bootstrap or None,
                "--scheme-file": scheme_file,
                "--effect": effect,
            }
            calibrate_tables(frame, given, data or (), refused, free=free, holdout=holdout, robust=robust, seed=seed)
            return
        table = frame.readings(given, data, confirm_units=confirm_units)
        staged = general_calibration.is_staged(
            scheme, given, scheme_file, named=free is not None or campaign is not None
        )
        if staged:
            inputs.refuse_effects(given, "the staged scheme", "give --scheme global, which takes them in")
        elif given.description.effect:
            codes = ", ".join(described.code for described in given.description.effect)
            say_notes((f"with effects: {codes}", *history_notes(given.effects, history_of(table))))
        if staged:
            parsing.refuse_given(global_only, "no option of --scheme staged", "give --scheme global")
        else:
            remedy = "give --scheme staged, or leave it out"
            parsing.refuse_given(staged_only, "no option of --scheme global", remedy)
        frame.reads(scheme_file=scheme_file, campaign=campaign)
        names = parsing.parse_names(joints, given.robot.joint_names, "--joints")
        plan = general_calibration.plan_of(given, table, scheme_file, staged=staged)
        options = Options(
            names,
            parsing.parse_names(free, None, "--free"),
            campaign,
            chosen_loads,
            low,
            high,
            staged,
            spacing or "log",
            robust,
            bootstrap,
            seed,
            parsing.typed_again(
                "stiffarm diagnose",
                (model, *(data or ())),
                {
                    "--effect": effect,
                    "--loads": loads,
                    "--links": links,
                    "--load-path": load_path,
                    "--set": sets,
                    "--confirm-units": confirm_units,
                },
            ),
        )
        kept = frame.held_out(given, holdout, confirm_units=confirm_units)
        with frame.folder_if(seed if bootstrap else None) as folder:
            found = general_calibration.run(given, table, plan, options, kept)
            content = calibration_payload.calibration(found)
            if folder is not None:
                general_calibration.write(found, content, folder)
        frame.answer(content, lambda: calibration_tables.show(found))
