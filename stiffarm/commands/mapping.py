"""The command `map`: stiffness over the workspace, or with --quantity an index over a plane or a box by gamma."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from machining import INDICES
from machining.objective import DISPLACEMENTS
from robots import InputError
from stiffarm import inputs, steps
from stiffarm.console import emit_json, progress, say, show_table, user_errors
from stiffarm.machining_options import PartOpt, ToolOpt
from stiffarm.options import Debug, Json, Links, LoadPathOpt, ModelArg, Seed, model_hash, output_folder

_AXIS = "values in mm along the part's {0} axis: FROM:TO:STEP, or one number"
_OF_INDEX = "with --quantity: "


def map_command(
    model: ModelArg,
    out: Annotated[Path, typer.Option("--out", help="folder for the map")],
    surrogate_file: Annotated[
        Path | None, typer.Option("--surrogate", help="take the stiffness from this surrogate")
    ] = None,
    points: Annotated[
        int | None, typer.Option(help="values of each swept coordinate; default: 21", min=2, max=200)
    ] = None,
    layers: Annotated[
        str | None, typer.Option("--layers", help="values in deg of the coordinate that leaves the plane")
    ] = None,
    quantity: Annotated[
        str | None,
        typer.Option(
            "--quantity",
            help=f"map this over a plane or box for every gamma instead: {', '.join((*INDICES, *DISPLACEMENTS))}",
        ),
    ] = None,
    x: Annotated[str | None, typer.Option("--x", metavar="MM", help=_OF_INDEX + _AXIS.format("x"))] = None,
    y: Annotated[str | None, typer.Option("--y", metavar="MM", help=_OF_INDEX + _AXIS.format("y"))] = None,
    z: Annotated[str | None, typer.Option("--z", metavar="MM", help=_OF_INDEX + _AXIS.format("z"))] = None,
    tool: ToolOpt = None,
    part: PartOpt = None,
    normal: Annotated[
        str | None,
        typer.Option("--normal", metavar="X,Y,Z", help=_OF_INDEX + "surface normal, base axes; default: 0,0,1"),
    ] = None,
    tool_axis: Annotated[
        str | None,
        typer.Option(
            "--tool-axis",
            metavar="X,Y,Z",
            help=_OF_INDEX + "tool axis from the tip into the holder, base axes; default: the normal",
        ),
    ] = None,
    gamma: Annotated[
        str | None,
        typer.Option(
            "--gamma",
            metavar="FROM:TO:STEP",
            help=_OF_INDEX + "angles about the tool axis, deg, or one; a full turn counts its two ends once; "
            "default: -180:180:5",
        ),
    ] = None,
    show: Annotated[
        str | None,
        typer.Option(
            "--show", metavar="DEG,DEG", help=_OF_INDEX + "angles for pictures and .vtu; default: five, and the best"
        ),
    ] = None,
    force: Annotated[
        str | None, typer.Option("--force", metavar="X,Y,Z", help="N on the tool, base axes, where --quantity needs it")
    ] = None,
    workpiece: Annotated[
        str | None,
        typer.Option(
            "--workpiece",
            metavar="REGION",
            help=_OF_INDEX + "where the best gamma is sought, mm: x=-100:100,y=800:1000, or corners as in "
            "'-100,800;100,800;0,1000' along the grid's first two axes; default: the whole grid",
        ),
    ] = None,
    aim: Annotated[
        str | None, typer.Option("--aim", help=_OF_INDEX + "best gamma by the mean or the worst point; default: mean")
    ] = None,
    partly: Annotated[
        bool, typer.Option("--partly", help=_OF_INDEX + "also a gamma that does not reach all of the workpiece may win")
    ] = False,
    pictures: Annotated[bool, typer.Option(help="also draw PNGs")] = True,
    seed: Seed = 0,
    links: Links = None,
    load_path: LoadPathOpt = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """The 3-D stiffness map as a .vtu for ParaView, with pictures.

    With --quantity: an index over a plane or a box, at every angle gamma about the tool axis, and the best gamma.
    """
    with user_errors(debug):
        of_arm = {"--surrogate": surrogate_file, "--points": points, "--layers": layers}
        of_index: dict[str, str | None] = {
            "--x": x, "--y": y, "--z": z, "--tool": tool, "--part": part, "--normal": normal, "--gamma": gamma,
            "--tool-axis": tool_axis, "--show": show, "--force": force, "--workpiece": workpiece, "--aim": aim,
            "--partly": "" if partly else None,
        }  # fmt: skip
        if quantity is None:
            _refuse(of_index, "without --quantity", f"give --quantity, one of {', '.join(INDICES)}")
            content = _arm_map(model, out, surrogate_file, points or 21, layers, pictures, links, load_path)
        else:
            _refuse(of_arm, "with --quantity", "leave it out; the grid is --x, --y and --z")
            content = _index_map(model, out, of_index | {"--quantity": quantity}, pictures, seed, links, load_path)
        if as_json:
            emit_json(content)
            return
        if quantity is not None:
            _show(content)
        say(f"written: {', '.join(str(out / name) for name in content['files'])}")
        for message in content.get("messages", ()):
            say(f"note: {message}")


def _refuse(options: Mapping[str, object], when: str, remedy: str) -> None:
    given = [name for name, value in options.items() if value is not None]
    if given:
        raise InputError(f"{given[0]} {when}", allowed="nothing", remedy=remedy)


def _arm_map(
    model: str,
    out: Path,
    surrogate_file: Path | None,
    points: int,
    layers: str | None,
    pictures: bool,
    links: str | None,
    load_path: str | None,
) -> dict[str, Any]:
    """Structural stiffness over the joint coordinates."""
    from stiffarm import maps

    given = inputs.read_model(model, links, load_path, without="the map")
    learned = None if surrogate_file is None else inputs.read_surrogate_for_map(given, surrogate_file)
    if learned is not None and learned.model_hash != model_hash(given):
        say("note: the surrogate was fitted to another model than MODEL; the map's file has the stiffness of both")
    wanted = inputs.parse_layers(given.robot, layers)
    files: dict[str, Path | str] = {"model": model_hash(given)}
    if surrogate_file is not None:
        files["surrogate"] = surrogate_file
    with output_folder(out, files) as folder, progress("map poses") as bar:
        made = steps.stiffness_map(given.description, given.model, points, learned, wanted, progress=bar)
        return maps.write(made, given.description, given.robot, folder, pictures)


def _index_map(
    model: str,
    out: Path,
    options: Mapping[str, str | None],
    pictures: bool,
    seed: int,
    links: str | None,
    load_path: str | None,
) -> dict[str, Any]:
    """An index over a grid for every gamma."""
    from stiffarm import index_maps, index_request

    # Before the model: shells take a while, and a wrong option need not wait for them.
    asked = index_request.read_request(options)
    given = inputs.read_model(model, links, load_path, without="the map")
    with output_folder(out, {"model": model_hash(given)}, seed) as folder:
        with folder.timed("map"), progress("map points") as bar:
            made = index_request.map_of(given, asked, np.random.default_rng(seed), bar)
        with folder.timed("files"):
            return index_maps.write(made, folder, pictures)


def _show(content: Mapping[str, Any]) -> None:
    unit = "" if content["unit"] == "1" else f", {content['unit']}"

    def cell(value: float | None) -> str:
        return "" if value is None else f"{value:.4g}"

    rows = [
        [
            f"{one['gamma_deg']:g}",
            f"{100.0 * one['share_reached']:.4g} %",
            *(cell(one["reached"][name]) for name in ("mean", "standard_deviation", "peak_to_valley", "smallest")),
            cell(one["common"]["mean"]),
        ]
        for one in content["by_gamma"]
        if one["gamma_deg"] in content["drawn_gamma_deg"]
    ]
    columns = ["gamma, deg", "reached", "mean", "deviation", "peak to valley", "smallest", "mean, common points"]
    show_table(f"{content['quantity']} of the {content['robot']}{unit}", columns, rows)
    if len(rows) < len(content["by_gamma"]):
        say(f"(all {len(content['by_gamma'])} angles are in gamma_statistics.csv and with --json)")
    say(
        f"{content['points']} points, {content['points_reached']} reached at some gamma, "
        f"{content['points_every_gamma_reaches']} at every gamma"
    )
    best = content["best_gamma"]
    if best is None:
        say(f"note: no best gamma: {content['why_no_best_gamma']}")
    else:
        say(
            f"best gamma for the {best['aim']} over {content['workpiece_points']} points: {best['gamma_deg']:g} deg, "
            f"{content['quantity']} {best['value']:.4g}{unit.replace(',', '')}"
        )
    if not content["all_solutions_found"]:
        say("note: this arm's inverse kinematics is searched; postures may have been missed")
