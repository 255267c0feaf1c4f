"""Commands about models: `robots`, `simulate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robots import InputError, bundled_names, load_description
from stiffarm import inputs, tables
from stiffarm.console import emit_json, show_table, user_errors
from stiffarm.options import (
    DataArg,
    Debug,
    Json,
    Links,
    LoadPathOpt,
    ModelArg,
    Out,
    folder_if,
    model_hash,
    say_notes,
)


def robots(
    name: Annotated[str | None, typer.Argument(help="show one robot in detail")] = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """List the bundled robots, or show one with its figures and their sources."""
    with user_errors(debug):
        if name is not None:
            description = load_description(name)
            if as_json:
                emit_json(description.model_dump(mode="json", by_alias=True, exclude_none=True))
                return
            tables.robot(description)
            return
        found = [load_description(bundled) for bundled in bundled_names()]
        if as_json:
            emit_json(
                {
                    "robots": [
                        {"name": d.name, "title": d.title, "joints": len(d.joint), "load_path": d.load_path}
                        for d in found
                    ]
                }
            )
            return
        show_table("Bundled robots", ["name", "title", "load path"], [[d.name, d.title, d.load_path] for d in found])


def simulate(
    model: ModelArg,
    data: DataArg = None,
    pose: Annotated[str | None, typer.Option("--pose", help="as in q2_deg=5,q3real_deg=77.5; the rest is 0")] = None,
    load: Annotated[
        str | None,
        typer.Option("--load", help="wrench at the tool point for --pose, as in fz_N=-650 (the default)"),
    ] = None,
    rigid_joints: Annotated[bool, typer.Option("--rigid-joints", help="only the links give way")] = False,
    links: Links = None,
    load_path: LoadPathOpt = None,
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Deflection of the tool point: for one pose and load, or for every reading of a measurement table."""
    with user_errors(debug):
        from stiffarm import simulation

        given = inputs.read_model(model, links, load_path)
        files: dict[str, Path | str] = {"model": model_hash(given)}
        if pose is not None:
            if data is not None:
                raise InputError(
                    "simulate takes a pose or a measurement table, not both", remedy="leave out --pose or DATA"
                )
            q, wrench = inputs.parse_pose(given.robot, pose), inputs.parse_load("fz_N=-650" if load is None else load)
        else:
            if load is not None:
                raise InputError(
                    "--load", value=load, allowed="only with --pose: a measurement table has its own loads"
                )
            table = inputs.read_data(given.robot, model, data)
            say_notes(table.notes)
            files["data"] = table.sha256
        with folder_if(out, files) as folder:
            result = (
                simulation.of_table(given, table, rigid_joints)
                if pose is None
                else simulation.of_pose(given, q, wrench, rigid_joints)
            )
            if folder is not None:
                folder.write_json("simulation.json", result)
        if as_json:
            emit_json(result)
        else:
            simulation.show(result)
