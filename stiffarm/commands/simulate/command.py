"""The command `simulate`."""

from __future__ import annotations

from typing import Annotated

import typer

from stiffarm.commands.simulate import step as simulation
from stiffarm.session import inputs, parsing
from stiffarm.session.console import emit_json, user_errors
from stiffarm.session.options import (
    ConfirmUnits,
    DataArg,
    Debug,
    EffectFile,
    Json,
    Links,
    LoadPathOpt,
    ModelArg,
    Out,
    folder_if,
    model_hash,
)
from stiffarm.session.own_effects import own_effects, own_files


def simulate(
    model: ModelArg,
    data: DataArg = None,
    pose: Annotated[
        str | None,
        typer.Option(
            "--pose", help="Joint coordinates in deg, as in q2_deg=5,q3real_deg=77.5; coordinates not given are 0."
        ),
    ] = None,
    load: Annotated[
        str | None,
        typer.Option(
            "--load",
            help="With --pose: load at the tool point in base axes, in N and N m, as in fz_N=-650,mx_Nm=10. "
            "Default: fz_N=-650.",
        ),
    ] = None,
    unload_from: Annotated[
        str | None,
        typer.Option(
            "--unload-from", help="With --pose: --load is reached by unloading from this larger load, as in fz_N=-1300."
        ),
    ] = None,
    rigid_joints: Annotated[
        bool,
        typer.Option("--rigid-joints", help="Treat the joints as rigid: only the links deflect and no effect acts."),
    ] = False,
    effect: EffectFile = None,
    field: Annotated[
        bool,
        typer.Option(
            "--field",
            help="With --pose and --out: write the deformed arm (.vtu, .png) and the share of each part in the"
            " deflection.",
        ),
    ] = False,
    scale: Annotated[
        float | None,
        typer.Option(
            "--scale", help="With --field: magnification of the drawn deflection; 1 is true scale. Default: automatic."
        ),
    ] = None,
    confirm_units: ConfirmUnits = False,
    links: Links = None,
    load_path: LoadPathOpt = None,
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Compute tool-point deflections at a pose or for a table.

    At one pose under one load, or for every reading of a measurement table.
    """
    with user_errors(debug):
        simulation.check_request(pose, data, load, out, field, scale, unload_from)
        own, files = own_effects(effect), own_files(effect)
        asked = simulation.field_links(model, links) if field else links
        given = inputs.read_model(model, asked, load_path, own=own, without="the fields" if field else None)
        files["model"] = model_hash(given)
        if pose is not None:
            q, wrench = parsing.parse_pose(given.robot, pose), parsing.parse_load("fz_N=-650" if load is None else load)
            before = None if unload_from is None else parsing.parse_load(unload_from, "--unload-from")
        else:
            from stiffarm.commands.simulate.readings import of_table
            from stiffarm.session.readings import open_table

            table = open_table(given, model, data, files, confirm_units=confirm_units)
        with folder_if(out, files) as folder:
            result = (
                of_table(given, table, rigid_joints)
                if pose is None
                else simulation.of_pose(given, q, wrench, rigid_joints, before)
            )
            if field and folder is not None:
                result["field"] = simulation.field_of_pose(given, q, wrench, rigid_joints, scale, folder)
            if folder is not None:
                folder.write_json("simulation.json", result)
        if as_json:
            emit_json(result)
        else:
            simulation.show(result)
