"""The command `new`: a model file of an arm, with what it takes to check and to measure it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from robots import ModelDescription
from stiffarm.session.console import say
from stiffarm.session.frame import Frame, command
from stiffarm.session.options import Debug, Json
from stiffarm.session.parsing import parse_word, refuse_given

TABLE = "dh.csv"


def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the new model, as in my-arm.")],
    mdh: Annotated[
        Path | None,
        typer.Option(
            "--mdh",
            help="Table of modified Denavit-Hartenberg parameters (Craig's; CSV/XLSX): joint, alpha_deg, a_mm, d_mm, "
            "theta_deg, lower_deg, upper_deg, sign; last row flange.",
        ),
    ] = None,
    dh: Annotated[
        Path | None,
        typer.Option("--dh", help="The same columns with standard Denavit-Hartenberg parameters; flange row optional."),
    ] = None,
    urdf: Annotated[
        Path | None,
        typer.Option(
            "--urdf",
            help="URDF or xacro file (xacro: with the extra `xacro`): kinematics and limits. "
            "`stiffarm import` takes meshes too.",
        ),
    ] = None,
    like: Annotated[
        str | None, typer.Option("--like", help="Begin with this arm: a name of `stiffarm robots`, or a model TOML.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for the files. Default: NAME.")] = None,
    title: Annotated[str | None, typer.Option("--title", help="Full name, for pages. Default: NAME.")] = None,
    payload_kg: Annotated[float | None, typer.Option("--payload-kg", help="Rated payload, in kg.")] = None,
    mass_kg: Annotated[float | None, typer.Option("--mass-kg", help="Mass of the arm, in kg.")] = None,
    springs: Annotated[
        str,
        typer.Option(
            "--springs",
            help="Springs of joints that have none: none (rigid until calibrated), or class (the middle of the "
            "range for arms of this size, marked as a prior).",
        ),
    ] = "none",
    tip: Annotated[
        str | None,
        typer.Option(
            "--tip", help="With --urdf: link at the end of the arm. Default: where most revolute joints lead."
        ),
    ] = None,
    base: Annotated[
        str | None, typer.Option("--base", help="With --urdf: link at the base of the arm. Default: the root link.")
    ] = None,
    controller: Annotated[
        str | None,
        typer.Option(
            "--controller",
            metavar="FORMAT,...",
            help="Program formats of its controller (see `stiffarm post --format`), which counts the joints as this "
            "model does; another sign, zero or coupling goes into [controller] of the model file.",
        ),
    ] = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Make a model file of a new arm, and tables to check it with.

    Give one of --mdh, --dh, --urdf and --like. Without any, an empty table is written to fill in. The folder gets the
    model with every key explained, a table of poses to read at the pendant (for `stiffarm robots check`), a first
    measuring sheet, and a JSON schema for editors.
    """
    with command(out or Path(name), as_json=as_json, debug=debug) as frame:
        from stiffarm.commands.new.step import (
            check_masses,
            checked_name,
            described,
            given_of,
            with_class_springs,
            with_controller,
            write_files,
        )

        checked_name(name)
        check_masses({"--payload-kg": payload_kg, "--mass-kg": mass_kg})
        prior = parse_word(springs, ("none", "class"), "--springs") == "class"
        given = given_of({"--mdh": mdh, "--dh": dh, "--urdf": urdf, "--like": like})
        if urdf is None:
            refuse_given({"--tip": tip, "--base": base}, "only with --urdf", "leave it out")
        if not given:
            refuse_given(
                {
                    "--title": title,
                    "--payload-kg": payload_kg,
                    "--mass-kg": mass_kg,
                    "--springs": springs if prior else None,
                    "--controller": controller,
                },
                "nothing to apply it to yet",
                "give --mdh, --dh, --urdf or --like too",
            )
            _write_table(frame, name)
            return
        description = described(name, given, title, payload_kg, mass_kg, tip, base)
        frame.files |= {"urdf" if key == "--urdf" else "table": Path(v) for key, v in given.items() if key != "--like"}
        if prior:
            description = with_class_springs(description)
        if controller is not None:
            description = with_controller(description, controller)
        with frame.folder() as folder:
            content = write_files(folder, description, name)
        frame.answer(content, lambda: _say(description, content, frame.out or Path(name)))


def _write_table(frame: Frame, name: str) -> None:
    from stiffarm.commands.new.dh_table import empty_table

    with frame.folder() as folder:
        folder.write_text(TABLE, empty_table())
    assert frame.out is not None  # noqa: S101 - it has a default
    path = frame.out / TABLE
    again = f"stiffarm new {name} --mdh {path}"

    def show() -> None:
        say(f"an empty table to fill in: {path}")
        say(
            "one row per joint: alpha_deg and a_mm from the previous axis, d_mm along its own axis (modified "
            "Denavit-Hartenberg parameters), theta_deg where its coordinate reads 0, its limits; last row: the flange"
        )
        say(f"then: {again}")
        say(
            "for standard parameters (alpha_deg and a_mm to the next axis) use --dh in place of --mdh, and remove the "
            "row flange unless there is an offset after the last joint"
        )

    frame.answer({"name": name, "table": str(path), "next": [again]}, show)


def _say(description: ModelDescription, content: dict[str, Any], out: Path) -> None:
    model = out / content["model"]
    joints = f"{content['joints']} joint{'s' * (content['joints'] != 1)}"
    say(f"{description.title}: {joints}; model {model}, every key explained")
    say(
        f"next: drive to the poses of {out / 'pendant.csv'}, fill in what the controller shows, then: "
        f"stiffarm robots check {model} {out / 'pendant.csv'}"
    )
    loads = ", ".join(f"{force:g}" for force in content["sheet_loads_N"])
    say(
        f"then measure: {out / 'sheet.csv'} is a first sheet ({loads} N); stiffarm plan {model} --poses 10 --out plan "
        "chooses set-ups that tell more"
    )
    if not content["controller_formats"]:
        say(
            "programs for its controller need its joint convention: which formats does it read, and does it count the "
            "angles as this model? If so, give --controller FORMAT; if not, fill in [controller] of the model file"
        )
    if content["joints_without_springs"]:
        say(
            f"no springs yet, rigid until calibrated: {', '.join(content['joints_without_springs'])} "
            "(--springs class takes the middle of the arm's class, marked as a prior)"
        )
