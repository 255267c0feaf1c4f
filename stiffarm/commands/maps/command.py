"""The command `map`: the arm over its joints or over points in space, or an index over a plane or box by gamma."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from typer.core import TyperGroup

from machining import INDICES
from machining.stiffness.objective import DISPLACEMENTS
from robots import InputError
from robots.constants import DOWN
from robots.library.models import bundled_names
from stiffarm.commands.maps import words
from stiffarm.commands.maps.options import FORMATS, POSES
from stiffarm.commands.maps.request import MERITS, SHORTS
from stiffarm.session.console import progress, say, say_notes, user_errors
from stiffarm.session.frame import Frame, command
from stiffarm.session.inputs import model_hash
from stiffarm.session.options import COMMON, Debug, Json, Links, LoadPathOpt, ModelArg, Seed, Sets
from stiffarm.session.parsing import tool_of
from stiffarm.session.stated import AtLoad, stated_table
from stiffarm.session.task_options import PartOpt, ToolOpt
from surrogate.maps.layouts import PLANES

Text = str | None
_FORM = "FROM:TO:STEP or one number"

Out = Annotated[
    Path, typer.Option("--out", rich_help_panel=COMMON, help="Folder for the map; it is created if needed.")
]
X = Annotated[Text, typer.Option("--x", metavar="MM", help=f"Values along x, in mm: {_FORM}. Default: all in reach.")]
Y = Annotated[Text, typer.Option("--y", metavar="MM", help=f"Values along y, in mm: {_FORM}. Default: all in reach.")]
Z = Annotated[Text, typer.Option("--z", metavar="MM", help=f"Values along z, in mm: {_FORM}. Default: all in reach.")]
Pose = Annotated[
    str,
    typer.Option(
        "--pose",
        help=f"Which pose to use at a point: {', '.join(POSES)}. The last two look at all orientations and branches.",
    ),
]
BestBy = Annotated[str, typer.Option("--best-by", help=f"Quantity by which --pose chooses: {', '.join(MERITS)}.")]
ToolAxis = Annotated[
    Text,
    typer.Option(
        "--tool-axis",
        metavar="X,Y,Z",
        help="Tool axis from the tip into the holder, in base axes, with --pose fixed or best-gamma. Default: 0,0,1.",
    ),
]
Gamma = Annotated[
    Text,
    typer.Option(
        "--gamma",
        metavar="FROM:TO:STEP",
        help="Angles gamma about the tool axis, in deg. Default: 0 with --pose fixed, -180:180:15 with best-gamma.",
    ),
]
Direction = Annotated[
    Text, typer.Option("--direction", metavar="X,Y,Z", help="Direction of the load in base axes. Default: 0,0,-1.")
]
Values = Annotated[
    Text,
    typer.Option(
        "--values", help=f"Quantities to map: {', '.join(SHORTS)}. Default: the usual ones the model can give."
    ),
]
Normal = Annotated[
    Text,
    typer.Option(
        "--normal", metavar="X,Y,Z", help="Surface normal of k_fs and other indices, in base axes. Default: 0,0,1."
    ),
]
Format = Annotated[
    Text,
    typer.Option(
        "--format",
        help=f"File formats of the map: {', '.join(FORMATS)}. Default: vti of a slice or box, otherwise vtu.",
    ),
]
Html = Annotated[bool, typer.Option("--html", help="Write an interactive page of the map, to turn it and pick points.")]
Pictures = Annotated[bool, typer.Option(help="Draw PNG pictures.")]
Dask = Annotated[
    Text, typer.Option("--dask", metavar="ADDRESS", help="Compute the map on a Dask cluster, as in tcp://host:8786.")
]
Work = Annotated[
    Path | None,
    typer.Option("--work", help="Folder for finished blocks; an interrupted run resumes from it."),
]


class _Maps(TyperGroup):
    """The kinds of maps. Whoever types the form of before, without a kind, is told the new one."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        old = any(word.split("=")[0] in ("--grid", "--quantity") for word in args) or Path(args[0]).suffix != ""
        if args[0] not in self.commands and (old or args[0] in bundled_names()):
            with user_errors(debug=False):
                raise InputError(
                    "`stiffarm map` needs to know what kind of map",
                    allowed=", ".join(self.commands),
                    remedy=f"type {new_form(args)}",
                )
        return super().resolve_command(ctx, args)


def new_form(args: list[str]) -> str:
    """The command of today that does what arguments of `stiffarm map` without a kind did."""
    words, kind = [part for word in args for part in word.split("=", 1)], "joints"
    if "--grid" in words:
        at = words.index("--grid")
        kind = words[at + 1] if at + 1 < len(words) else kind
        del words[at : at + 2]
    kind = "index" if "--quantity" in words else kind
    return "`" + shlex.join(["stiffarm", "map", kind, *words]) + "`"


map_command = typer.Typer(
    cls=_Maps,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Map the stiffness over joints or over points in space.",
)


@map_command.command("joints")
def joints_command(
    model: ModelArg,
    out: Out,
    surrogate_file: Annotated[
        Path | None,
        typer.Option("--surrogate", help="Take the stiffness from this surrogate; the model's own is mapped as well."),
    ] = None,
    points: Annotated[
        int, typer.Option(help="Number of values of each coordinate that is swept.", min=2, max=1000)
    ] = 21,
    layers: Annotated[
        Text,
        typer.Option(
            "--layers",
            help="Values of the fourth coordinate, which turns the arm out of its plane, in deg, separated by commas.",
        ),
    ] = None,
    direction: Direction = None,
    values: Values = None,
    tool: ToolOpt = None,
    normal: Normal = None,
    file_format: Format = None,
    html: Html = False,
    pictures: Pictures = True,
    dask: Dask = None,
    work: Work = None,
    at_load: AtLoad = None,
    links: Links = None,
    load_path: LoadPathOpt = None,
    sets: Sets = None,
    seed: Seed = 0,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Map the arm over its joint angles: three coordinates swept over their limits, a fourth in layers."""
    own = {"--points": str(points), "--layers": layers}
    shared = _shared(direction, values, tool, normal, file_format, dask, work, load_path, at_load)
    with command(out, as_json=as_json, debug=debug) as frame:
        if surrogate_file is not None:
            refused = {**shared, "--load-path": None, "--html": html or None}
            for name in (name for name, value in refused.items() if value is not None):
                raise InputError(f"{name} cannot be combined with --surrogate", remedy="leave one of them out")
            content = _surrogate_map(model, frame, surrogate_file, points, layers, pictures, links, load_path, sets)
        else:
            content = _arm_map("joints", model, frame, own | shared, (html, pictures), seed, links, sets)
        _say(content, frame)


@map_command.command("slice")
def slice_command(
    model: ModelArg,
    out: Out,
    plane: Annotated[str, typer.Option("--plane", help=f"Plane of the slice: {', '.join(PLANES)}.")] = "xz",
    at: Annotated[
        Text,
        typer.Option(
            "--at",
            metavar="MM",
            help="Position of the plane along its normal, in mm. Default: 0; for xy half the reachable height.",
        ),
    ] = None,
    x: X = None,
    y: Y = None,
    z: Z = None,
    pose: Pose = "stiffest",
    best_by: BestBy = "stiffness",
    tool_axis: ToolAxis = None,
    gamma: Gamma = None,
    direction: Direction = None,
    values: Values = None,
    tool: ToolOpt = None,
    normal: Normal = None,
    file_format: Format = None,
    html: Html = False,
    pictures: Pictures = True,
    dask: Dask = None,
    work: Work = None,
    at_load: AtLoad = None,
    links: Links = None,
    load_path: LoadPathOpt = None,
    sets: Sets = None,
    seed: Seed = 0,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Map the arm over tool points in a plane of the base frame."""
    own = {"--plane": plane, "--at": at, "--x": x, "--y": y, "--z": z} | _posed(pose, best_by, tool_axis, gamma)
    shared = _shared(direction, values, tool, normal, file_format, dask, work, load_path, at_load)
    with command(out, as_json=as_json, debug=debug) as frame:
        _say(_arm_map("slice", model, frame, own | shared, (html, pictures), seed, links, sets), frame)


@map_command.command("box")
def box_command(
    model: ModelArg,
    out: Out,
    x: X = None,
    y: Y = None,
    z: Z = None,
    pose: Pose = "stiffest",
    best_by: BestBy = "stiffness",
    tool_axis: ToolAxis = None,
    gamma: Gamma = None,
    direction: Direction = None,
    values: Values = None,
    tool: ToolOpt = None,
    normal: Normal = None,
    file_format: Format = None,
    html: Html = False,
    pictures: Pictures = True,
    dask: Dask = None,
    work: Work = None,
    at_load: AtLoad = None,
    links: Links = None,
    load_path: LoadPathOpt = None,
    sets: Sets = None,
    seed: Seed = 0,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Map the arm over tool points in a box along the base's axes."""
    own = {"--x": x, "--y": y, "--z": z} | _posed(pose, best_by, tool_axis, gamma)
    shared = _shared(direction, values, tool, normal, file_format, dask, work, load_path, at_load)
    with command(out, as_json=as_json, debug=debug) as frame:
        _say(_arm_map("box", model, frame, own | shared, (html, pictures), seed, links, sets), frame)


@map_command.command("cylinder")
def cylinder_command(
    model: ModelArg,
    out: Out,
    r: Annotated[
        Text,
        typer.Option("--r", metavar="MM", help=f"Distances from the z axis, in mm: {_FORM}. Default: all in reach."),
    ] = None,
    phi: Annotated[
        Text, typer.Option("--phi", metavar="DEG", help=f"Angles from x, in deg: {_FORM}. Default: -180:180:15.")
    ] = None,
    z: Z = None,
    pose: Pose = "stiffest",
    best_by: BestBy = "stiffness",
    tool_axis: ToolAxis = None,
    gamma: Gamma = None,
    direction: Direction = None,
    values: Values = None,
    tool: ToolOpt = None,
    normal: Normal = None,
    file_format: Format = None,
    html: Html = False,
    pictures: Pictures = True,
    dask: Dask = None,
    work: Work = None,
    at_load: AtLoad = None,
    links: Links = None,
    load_path: LoadPathOpt = None,
    sets: Sets = None,
    seed: Seed = 0,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Map the arm over tool points in a cylinder about the base's z axis."""
    own = {"--r": r, "--phi": phi, "--z": z} | _posed(pose, best_by, tool_axis, gamma)
    shared = _shared(direction, values, tool, normal, file_format, dask, work, load_path, at_load)
    with command(out, as_json=as_json, debug=debug) as frame:
        _say(_arm_map("cylinder", model, frame, own | shared, (html, pictures), seed, links, sets), frame)


_PART = f"Values along {{0}} of the part, in mm: {_FORM}. One of --x, --y and --z may be one number."


@map_command.command("index")
def index_command(
    model: ModelArg,
    out: Out,
    x: Annotated[str, typer.Option("--x", metavar="MM", help=_PART.format("x"))],
    y: Annotated[str, typer.Option("--y", metavar="MM", help=_PART.format("y"))],
    z: Annotated[str, typer.Option("--z", metavar="MM", help=_PART.format("z"))],
    quantity: Annotated[
        str, typer.Option("--quantity", help=f"What to map: {', '.join((*INDICES, *DISPLACEMENTS))}.")
    ] = "k_fs",
    tool: ToolOpt = None,
    part: PartOpt = None,
    normal: Annotated[str, typer.Option("--normal", metavar="X,Y,Z", help="Surface normal in base axes.")] = "0,0,1",
    tool_axis: Annotated[
        Text,
        typer.Option(
            "--tool-axis",
            metavar="X,Y,Z",
            help="Tool axis from the tip into the holder, in base axes. Default: along the normal.",
        ),
    ] = None,
    gamma: Annotated[
        str,
        typer.Option(
            "--gamma",
            metavar="FROM:TO:STEP",
            help="Angles gamma about the tool axis, in deg, or one; the two ends of a full turn count once.",
        ),
    ] = "-180:180:5",
    show: Annotated[
        Text,
        typer.Option(
            "--show",
            metavar="DEG,DEG",
            help="Angles gamma to draw and to write to the map's file, in deg. Default: five, and the best.",
        ),
    ] = None,
    force: Annotated[
        Text,
        typer.Option("--force", metavar="X,Y,Z", help="Force on the tool in base axes, in N, where needed."),
    ] = None,
    workpiece: Annotated[
        Text,
        typer.Option(
            "--workpiece",
            metavar="REGION",
            help="Where the best gamma is sought, in mm: x=-100:100,y=800:1000, or corners as in "
            "'-100,800;100,800;0,1000' along the grid's first two axes. The best gamma reaches all of it. "
            "Default: the whole grid; a point that the best gamma misses counts as zero stiffness.",
        ),
    ] = None,
    aim: Annotated[str, typer.Option("--aim", help="Best gamma by the mean or the worst point: mean, worst.")] = "mean",
    partly: Annotated[
        bool,
        typer.Option(
            "--partly",
            help="Also allow a gamma that does not reach all of the workpiece; each point missed counts as zero "
            "stiffness.",
        ),
    ] = False,
    file_format: Format = None,
    html: Html = False,
    pictures: Pictures = True,
    dask: Dask = None,
    work: Work = None,
    at_load: AtLoad = None,
    links: Links = None,
    load_path: LoadPathOpt = None,
    sets: Sets = None,
    seed: Seed = 0,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Map an index over a plane or a box of the part at every angle gamma about the tool axis, and find the best."""
    from stiffarm.commands.maps.files import Files
    from stiffarm.commands.maps.index import files
    from stiffarm.commands.maps.index import request as asking
    from stiffarm.commands.maps.options import formats_of

    options = {
        "--quantity": quantity,
        "--x": x,
        "--y": y,
        "--z": z,
        "--tool": tool,
        "--part": part,
        "--normal": normal,
        "--tool-axis": tool_axis,
        "--gamma": gamma,
        "--show": show,
        "--force": force,
        "--workpiece": workpiece,
        "--aim": aim,
        "--partly": "" if partly else None,
        "--format": file_format,
    }
    with command(out, as_json=as_json, debug=debug) as frame:
        # Before the model: shells take a while, and a wrong option need not wait for them.
        asked, formats = asking.read_request(options), formats_of("index", options)
        given = frame.model(model, links, load_path, sets=sets, shown=True)
        wanted = Files(formats, pictures=pictures, html=html, dask=dask, work=work)
        along = asked.objective.force
        given = frame.at_load(given, at_load, DOWN if along is None else along, tool_of(given.robot, tool)[:3, 3])
        with frame.folder(seed) as folder, progress("map points") as bar:
            content = files.make_index_map(given, asked, folder, wanted, seed, bar) | stated_table(given.model)
        _say(content, frame)


def _posed(pose: str, best_by: str, tool_axis: Text, gamma: Text) -> dict[str, Text]:
    return {"--pose": pose, "--best-by": best_by, "--tool-axis": tool_axis, "--gamma": gamma}


def _shared(
    direction: Text,
    values: Text,
    tool: Text,
    normal: Text,
    file_format: Text,
    dask: Text,
    work: Path | None,
    load_path: Text,
    at_load: float | None,
) -> dict[str, Text]:
    return {
        "--at-load": None if at_load is None else repr(at_load),
        "--direction": direction,
        "--values": values,
        "--tool": tool,
        "--normal": normal,
        "--format": file_format,
        "--dask": dask,
        "--work": None if work is None else str(work),
        "--load-path": load_path,
    }


def _say(content: Mapping[str, Any], frame: Frame) -> None:
    frame.answer(content, lambda: _show(content))


def _show(content: Mapping[str, Any]) -> None:
    if "by_gamma" in content:
        words.show_index_map(content)
    elif "quantities" in content:
        words.show_map(content)
    say_notes(content["messages"])


def _arm_map(
    kind: str,
    model: str,
    frame: Frame,
    options: Mapping[str, Text],
    drawn: tuple[bool, bool],
    seed: int,
    links: Text,
    sets: list[str] | None,
) -> dict[str, Any]:
    """Quantities of the arm over joints or space, from the model."""
    from stiffarm.commands.maps import step
    from stiffarm.commands.maps.files import Files
    from stiffarm.commands.maps.options import check_options, read_map_options
    from stiffarm.session.softness import require_springs

    # Before the model: shells take a while, and a wrong option need not wait for them.
    check_options(kind, options)
    given = frame.model(model, links, options["--load-path"], sets=sets, shown=True)
    require_springs(given, "map")
    asked = read_map_options(given, kind, options, seed)
    given = frame.at_load(given, asked.request.at_load, asked.request.direction, np.array(asked.request.tool)[:3, 3])
    html, pictures = drawn
    work = options["--work"]
    wanted = Files(
        asked.formats,
        figures=options["--values"] is not None,
        pictures=pictures,
        html=html,
        dask=options["--dask"],
        work=None if work is None else Path(work),
    )
    with frame.folder(seed) as folder, progress("map points") as bar:
        return step.make_map(given, asked, folder, wanted, bar)


def _surrogate_map(
    model: str,
    frame: Frame,
    file: Path,
    points: int,
    layers: Text,
    pictures: bool,
    links: Text,
    load_path: Text,
    sets: list[str] | None,
) -> dict[str, Any]:
    """Structural stiffness over the joint coordinates, from a surrogate."""
    from stiffarm.commands.maps import sweep

    given = frame.model(model, links, load_path, sets=sets, shown=True)
    learned = sweep.read_surrogate_for_map(given, file)
    if learned.model_hash != model_hash(given):
        say("note: the surrogate was fitted to another model than MODEL; the map's file has the stiffness of both")
    wanted = sweep.parse_layers(given.robot, layers)
    frame.reads(surrogate=file)
    with frame.folder() as folder, progress("map poses") as bar:
        made = sweep.learned_map(given, learned, points, wanted, bar)
        return sweep.write(made, given, folder, pictures)
