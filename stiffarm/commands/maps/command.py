"""The command `map`: the arm over joints or space, or with --quantity an index over a plane or a box by gamma."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from machining import INDICES
from machining.stiffness.objective import DISPLACEMENTS
from robots import InputError
from stiffarm.commands.maps import surrogate_input
from stiffarm.commands.maps import words as map_words
from stiffarm.commands.maps.options import FORMATS, GRIDS, POSES
from stiffarm.session import inputs, steps
from stiffarm.session.console import emit_json, progress, say, user_errors
from stiffarm.session.options import Debug, Json, Links, LoadPathOpt, ModelArg, Seed, model_hash, output_folder
from stiffarm.session.task_options import PartOpt, ToolOpt
from surrogate.maps.layouts import PLANES
from surrogate.maps.quantities import MERITS, SHORTS

_AXIS = "values in mm along the {0} axis of the base, with --quantity of the part: FROM:TO:STEP, or one number"
_OF_INDEX = "with --quantity: "
_OF_GRID = "with --grid {0}: "
# Options of the map of an arm that one from a surrogate, or of an index, does not have.
_OF_ARM = (
    "--grid", "--plane", "--at", "--r", "--phi", "--pose", "--best-by", "--direction", "--values", "--format",
    "--dask", "--work",
)  # fmt: skip


def map_command(
    model: ModelArg,
    out: Annotated[Path, typer.Option("--out", help="folder for the map")],
    grid: Annotated[
        str | None,
        typer.Option("--grid", help=f"where the map is: {', '.join(GRIDS)} of tool points; default: joints"),
    ] = None,
    surrogate_file: Annotated[
        Path | None, typer.Option("--surrogate", help="take the stiffness over joints from this surrogate")
    ] = None,
    points: Annotated[
        int | None,
        typer.Option(help="with --grid joints: values of each swept coordinate; default: 21", min=2, max=1000),
    ] = None,
    layers: Annotated[
        str | None,
        typer.Option("--layers", help="with --grid joints: values in deg of the coordinate that leaves the plane"),
    ] = None,
    quantity: Annotated[
        str | None,
        typer.Option(
            "--quantity",
            help=f"map this over a plane or box for every gamma instead: {', '.join((*INDICES, *DISPLACEMENTS))}",
        ),
    ] = None,
    plane: Annotated[
        str | None, typer.Option("--plane", help=_OF_GRID.format("slice") + f"{', '.join(PLANES)}; default: xz")
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(
            "--at",
            metavar="MM",
            help=_OF_GRID.format("slice") + "where the plane is; default: 0, of xy half the height in reach",
        ),
    ] = None,
    x: Annotated[str | None, typer.Option("--x", metavar="MM", help=_AXIS.format("x"))] = None,
    y: Annotated[str | None, typer.Option("--y", metavar="MM", help=_AXIS.format("y"))] = None,
    z: Annotated[str | None, typer.Option("--z", metavar="MM", help=_AXIS.format("z"))] = None,
    r: Annotated[
        str | None, typer.Option("--r", metavar="MM", help=_OF_GRID.format("cylinder") + "distances from the z axis")
    ] = None,
    phi: Annotated[
        str | None,
        typer.Option("--phi", metavar="DEG", help=_OF_GRID.format("cylinder") + "angles from x; default: -180:180:15"),
    ] = None,
    pose: Annotated[
        str | None,
        typer.Option(
            "--pose",
            help=f"of --grid slice, box, cylinder: {', '.join(POSES)}, of all orientations the last two; "
            "default: stiffest",
        ),
    ] = None,
    best_by: Annotated[
        str | None,
        typer.Option("--best-by", help=f"what --pose goes by: {', '.join(MERITS)}; default: stiffness"),
    ] = None,
    direction: Annotated[
        str | None, typer.Option("--direction", metavar="X,Y,Z", help="of the load, base axes; default: 0,0,-1")
    ] = None,
    values: Annotated[
        str | None,
        typer.Option("--values", help=f"what to map, of {', '.join(SHORTS)}; default: all that the model can give"),
    ] = None,
    tool: ToolOpt = None,
    part: PartOpt = None,
    normal: Annotated[
        str | None,
        typer.Option("--normal", metavar="X,Y,Z", help="surface normal of k_fs, base axes; default: 0,0,1"),
    ] = None,
    tool_axis: Annotated[
        str | None,
        typer.Option(
            "--tool-axis",
            metavar="X,Y,Z",
            help="tool axis from the tip into the holder, base axes, with --pose fixed or best-gamma; default: 0,0,1; "
            "with --quantity the normal",
        ),
    ] = None,
    gamma: Annotated[
        str | None,
        typer.Option(
            "--gamma",
            metavar="FROM:TO:STEP",
            help="angles about the tool axis, deg, or one; a full turn counts its two ends once; default: 0 with "
            "--pose fixed, -180:180:15 with best-gamma, -180:180:5 with --quantity",
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
    file_format: Annotated[
        str | None,
        typer.Option("--format", help=f"of the map's file: {', '.join(FORMATS)}; default: vti of slice and box, vtu"),
    ] = None,
    html: Annotated[bool, typer.Option("--html", help="also a page to turn the map and pick points in")] = False,
    svg: Annotated[bool, typer.Option("--svg", help="also figures as SVG")] = False,
    pictures: Annotated[bool, typer.Option(help="also draw PNGs")] = True,
    dask: Annotated[
        str | None,
        typer.Option("--dask", metavar="ADDRESS", help="have a Dask cluster do it, as in tcp://host:8786"),
    ] = None,
    work: Annotated[
        Path | None,
        typer.Option("--work", help="folder for the blocks while they are made; an interrupted run goes on with it"),
    ] = None,
    seed: Seed = 0,
    links: Links = None,
    load_path: LoadPathOpt = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """The stiffness map of an arm, over its joints or over points in space, as files for ParaView, with pictures.

    With --quantity: an index over a plane or a box, at every angle gamma about the tool axis, and the best gamma.
    """
    with user_errors(debug):
        of_arm = {
            "--grid": grid, "--plane": plane, "--at": at, "--r": r, "--phi": phi, "--pose": pose,
            "--best-by": best_by, "--direction": direction, "--values": values, "--format": file_format,
            "--dask": dask, "--work": None if work is None else str(work),
            "--points": None if points is None else str(points), "--layers": layers,
        }  # fmt: skip
        both = {
            "--x": x, "--y": y, "--z": z, "--tool": tool, "--normal": normal, "--tool-axis": tool_axis,
            "--gamma": gamma,
        }  # fmt: skip
        of_index: dict[str, str | None] = {
            "--part": part, "--show": show, "--force": force, "--workpiece": workpiece, "--aim": aim,
            "--partly": "" if partly else None,
        }  # fmt: skip
        drawn = {"--html": "" if html else None, "--svg": "" if svg else None}
        if quantity is not None:
            given = {"--surrogate": surrogate_file, **of_arm, **drawn}
            _refuse(given, "with --quantity", "leave it out; the grid is --x, --y and --z")
            options = both | of_index | {"--quantity": quantity}
            content = _index_map(model, out, options, pictures, seed, links, load_path)
        else:
            _refuse(of_index, "without --quantity", f"give --quantity, one of {', '.join(INDICES)}")
            if surrogate_file is not None:
                of_model = {name: of_arm[name] for name in _OF_ARM} | both | drawn
                _refuse(of_model, "with --surrogate", "leave it out; a surrogate's map is over the joints")
                content = _surrogate_map(model, out, surrogate_file, points or 21, layers, pictures, links, load_path)
            else:
                files = {"svg": svg, "html": html, "pictures": pictures}
                content = _arm_map(model, out, of_arm | both, files, seed, links, load_path)
        if as_json:
            emit_json(content)
            return
        if quantity is not None:
            map_words.show_index_map(content)
        elif surrogate_file is None:
            map_words.show_map(content)
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
    options: Mapping[str, str | None],
    files: Mapping[str, bool],
    seed: int,
    links: str | None,
    load_path: str | None,
) -> dict[str, Any]:
    """Quantities of the arm over joints or space, from the model."""
    from stiffarm.commands.maps import options as map_options
    from stiffarm.commands.maps import step as map_run
    from stiffarm.commands.maps.files import Files
    from stiffarm.session.task_setup import require_springs

    # Before the model: shells take a while, and a wrong option need not wait for them.
    map_options.check_options(options)
    given = inputs.read_model(model, links, load_path, without="the map")
    require_springs(given, "map")
    asked = map_options.read_map_options(given, {**options, "--load-path": load_path}, seed)
    work = options["--work"]
    wanted = Files(
        asked.formats,
        figures=options["--values"] is not None or files["svg"],
        dask=options["--dask"],
        work=None if work is None else Path(work),
        **files,
    )
    with output_folder(out, {"model": model_hash(given)}, seed) as folder, progress("map points") as bar:
        return map_run.make_map(given, asked, folder, wanted, bar)


def _surrogate_map(
    model: str,
    out: Path,
    surrogate_file: Path,
    points: int,
    layers: str | None,
    pictures: bool,
    links: str | None,
    load_path: str | None,
) -> dict[str, Any]:
    """Structural stiffness over the joint coordinates, from a surrogate."""
    from stiffarm.commands.maps import sweep as maps

    given = inputs.read_model(model, links, load_path, without="the map")
    learned = surrogate_input.read_surrogate_for_map(given, surrogate_file)
    if learned.model_hash != model_hash(given):
        say("note: the surrogate was fitted to another model than MODEL; the map's file has the stiffness of both")
    wanted = surrogate_input.parse_layers(given.robot, layers)
    files: dict[str, Path | str] = {"model": model_hash(given), "surrogate": surrogate_file}
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
    from stiffarm.commands.maps.index import files as index_maps
    from stiffarm.commands.maps.index import request as index_request

    # Before the model: shells take a while, and a wrong option need not wait for them.
    asked = index_request.read_request(options)
    given = inputs.read_model(model, links, load_path, without="the map")
    with output_folder(out, {"model": model_hash(given)}, seed) as folder:
        with folder.timed("map"), progress("map points") as bar:
            made = index_request.map_of(given, asked, np.random.default_rng(seed), bar)
        with folder.timed("files"):
            return index_maps.write(made, folder, pictures)
