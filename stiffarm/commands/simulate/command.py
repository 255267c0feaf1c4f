"""The command `simulate`."""

from __future__ import annotations

from typing import Annotated

import typer

from stiffarm.commands.simulate import step as simulation
from stiffarm.session import inputs, parsing
from stiffarm.session.caution import RIGID_AS_ASKED
from stiffarm.session.frame import command
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
    Sets,
)


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
    sets: Sets = None,
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Compute tool-point deflections at a pose or for a table.

    At one pose under one load, or for every reading of a measurement table.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        simulation.check_request(pose, data, load, out, field, scale, unload_from)
        asked = simulation.field_links(model, links) if field else links
        left = "the fields" if field else None
        given = frame.model(model, asked, load_path, effect=effect, without=left, sets=sets, shown=True)
        if rigid_joints:
            frame.caution = RIGID_AS_ASKED
        if pose is not None:
            q, wrench = parsing.parse_pose(given.robot, pose), parsing.parse_load("fz_N=-650" if load is None else load)
            before = None if unload_from is None else parsing.parse_load(unload_from, "--unload-from")
        else:
            from stiffarm.commands.simulate.readings import of_table

            table = frame.readings(given, data, confirm_units=confirm_units)
        with frame.folder_if() as folder:
            result = (
                of_table(given, table, rigid_joints)
                if pose is None
                else simulation.of_pose(given, q, wrench, rigid_joints, before)
            )
            for_fields = "as --field needs; without --field the model may use another link model"
            result["links_because"] = (
                for_fields if field and links is None else inputs.why_links(given.description, links)
            )
            if field and folder is not None:
                result["field"] = simulation.field_of_pose(given, q, wrench, rigid_joints, scale, folder)
            if folder is not None:
                folder.write_json("simulation.json", result)
                from stiffarm.commands.simulate import report
                from stiffarm.pages.report import data_words

                if pose is None:
                    report.write_table_report(given, result, data_words(table), folder, model)
                else:
                    report.write_pose_report(given, result, q, wrench, folder, model)
        frame.answer(result, lambda: simulation.show(result))
