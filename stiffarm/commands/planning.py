"""The command `plan`: which set-ups to measure next, and a sheet to write the readings into."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from doe.pose_designs import METHODS
from stiffarm import inputs, plan_options, plan_results
from stiffarm.console import emit_json, progress, user_errors
from stiffarm.options import (
    DataArg,
    Debug,
    Json,
    Links,
    LoadPathOpt,
    ModelArg,
    Out,
    Seed,
    folder_if,
    model_hash,
)
from stiffarm.planning import make_plan

TABLE, PAGE, RESULT, FIGURE = "measurement_sheet.csv", "measurement_sheet.html", "plan.json", "plan.png"


def plan(
    model: ModelArg,
    data: DataArg = None,
    poses: Annotated[int | None, typer.Option("--poses", help="set-ups to choose (a pose with a direction)", min=1)] = None,
    design_only: Annotated[
        int | None, typer.Option("--design-only", help="instead: all so many poses of a plain --design", min=1)
    ] = None,
    iso: Annotated[
        bool, typer.Option("--iso9283", help="instead: a sheet for the static compliance test of ISO 9283")
    ] = False,
    without_data: Annotated[
        bool, typer.Option("--without-data", help="a first campaign: heed no readings, not even bundled ones")
    ] = False,
    free: Annotated[
        str | None,
        typer.Option("--free", help="numbers to be told, as in j2.stiffness,base.rx; default: the joint springs seen"),
    ] = None,
    criterion: Annotated[str, typer.Option(help="D: all parameters; A: their mean; I: predictions")] = "D",
    loads: Annotated[
        str | None, typer.Option("--loads", help="forces in N, as in 150,650; default: the data's, else 1/4, 1/2, 1 payload")
    ] = None,
    directions: Annotated[
        str | None, typer.Option("--directions", help="as in +x,-x,-z or 0,0,-1;1,0,-1; default: the data's, else -z")
    ] = None,
    read: Annotated[
        str | None, typer.Option("--read", help="z, xyz, xyzr (r: rotations); default: the data's, else z")
    ] = None,
    repeats: Annotated[int, typer.Option(help="readings of each load", min=1, max=100)] = 3,
    unloading: Annotated[bool, typer.Option("--unloading", help="read on the way down too")] = False,
    candidates: Annotated[int, typer.Option(help="poses to choose from", min=1, max=20_000)] = 1500,
    design: Annotated[str, typer.Option(help=f"of the candidates: {', '.join(METHODS)}")] = "sobol",
    levels: Annotated[int, typer.Option(help="of a full factorial", min=2, max=50)] = 3,
    vary: Annotated[
        str | None, typer.Option("--vary", help="coordinates that vary, as in q2_deg,q3_deg; default: all that matter")
    ] = None,
    hold: Annotated[
        str | None, typer.Option("--hold", help="where others stand, as in q1_deg=30; default: 0, else mid-range")
    ] = None,
    floor: Annotated[
        str, typer.Option("--floor-mm", help="height below which no part of the arm may be, or none")
    ] = "0",
    keep_out: Annotated[
        list[str] | None, typer.Option("--keep-out", help="box x0,y0,z0:x1,y1,z1 in mm; repeatable")
    ] = None,
    random_order: Annotated[bool, typer.Option("--random-order", help="against drift; default: a short way")] = False,
    gauge: Annotated[float, typer.Option("--gauge-mm", help="smallest scatter of a reading, mm")] = 0.01,
    gauge_turn: Annotated[float, typer.Option("--gauge-mrad", help="smallest scatter of a rotation, mrad")] = 0.01,
    pose: Annotated[
        list[str] | None, typer.Option("--pose", help="of --iso9283, as in q2_deg=5,q3real_deg=77.5; repeatable")
    ] = None,
    rated: Annotated[
        float | None, typer.Option("--rated-N", help="of --iso9283: rated load; default: the payload's weight")
    ] = None,
    links: Links = None,
    load_path: LoadPathOpt = None,
    out: Out = None,
    seed: Seed = 0,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Which poses, loads and directions to measure next; writes a sheet that can be filled in and read back."""
    with user_errors(debug):
        chosen = {"--poses": poses is not None, "--design-only": design_only is not None, "--iso9283": iso}
        _check_kind(chosen, {"--pose": pose, "--rated-N": rated})
        given = inputs.read_model(model, links, load_path)
        zone = plan_options.parse_zone(floor, keep_out or ())
        files: dict[str, Path | str] = {"model": model_hash(given)}
        if iso:
            _refuse_for_iso({"--directions": directions, "--loads": loads, "--read": read, "--free": free, "DATA": data})
            _iso_sheet(given, pose, rated, zone, out, files, as_json)
            return
        wanted = _request(
            given, design_only or poses or 0, design_only is not None, free, criterion, loads, directions, read,
            repeats, unloading, candidates, design, levels, vary, hold, zone, random_order,
            (gauge, gauge_turn), seed,
        )  # fmt: skip
        table = None if without_data else _table(given, data, files)
        with folder_if(out, files, seed) as folder, progress("choosing set-ups") as bar:
            planned = make_plan(given, table, wanted, bar)
            content = plan_results.payload(given, table, planned)
            if folder is not None:
                _write(given, table, planned, content, folder)
        if as_json:
            emit_json(content)
        else:
            plan_results.show(given, planned)
            _say_written(out, (TABLE, PAGE, RESULT, FIGURE))
