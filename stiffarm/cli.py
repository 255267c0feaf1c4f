"""The command line: thin, each command a step of the workflow."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from doe import Measurements, Scheme, bundled_scheme
from robots import InputError, bundled_names, content_hash, load_description, save_description
from stiffarm import __version__, inputs, payloads, steps, tables
from stiffarm.console import emit_json, progress, say, show_table, user_errors
from stiffarm.outputs import OutputFolder
from stiffarm.pose_tables import query_poses

app = typer.Typer(
    name="stiffarm",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="How stiff is my robot arm, here, in this pose, and why does the model say something else than my gauge?",
)

ModelArg = Annotated[str, typer.Argument(metavar="MODEL", help="bundled name (see `stiffarm robots`) or a model TOML")]
DataArg = Annotated[
    Path | None,
    typer.Argument(metavar="[DATA]", help="measurement table, CSV or XLSX; default: the bundled one"),
]
Links = Annotated[str | None, typer.Option("--links", help="beam, shell or rigid; default: as calibrated, else beam")]
LoadPathOpt = Annotated[str | None, typer.Option("--load-path", help="parallelogram or serial; default: the model's")]
Out = Annotated[Path | None, typer.Option("--out", help="folder for results")]
Json = Annotated[bool, typer.Option("--json", help="one JSON object on stdout")]
Debug = Annotated[bool, typer.Option("--debug", help="show tracebacks")]
Joints = Annotated[
    str | None, typer.Option("--joints", help="joints, as in j2,j3; default: the scheme's or all that matter")
]
Loads = Annotated[
    str | None,
    typer.Option("--loads", help="force magnitudes in N, as in 150,650, or all; default: the scheme's, else all"),
]
Seed = Annotated[int, typer.Option("--seed", help="of the random numbers", min=0)]
SchemeFile = Annotated[
    Path | None, typer.Option("--scheme-file", help="calibration scheme TOML; default: the bundled one")
]


def _command() -> list[str]:
    return ["stiffarm", *sys.argv[1:]]


def _folder(out: Path, files: dict[str, Path | str], seed: int | None = None) -> OutputFolder:
    return OutputFolder(out, _command(), files, seed)


def _folder_if(out: Path | None, files: dict[str, Path | str]) -> AbstractContextManager[OutputFolder | None]:
    return nullcontext() if out is None else _folder(out, files)


def _model_hash(given: inputs.ModelInput) -> str:
    return content_hash(given.description)


@app.command()
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


@app.command()
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
        files: dict[str, Path | str] = {"model": _model_hash(given)}
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
            _say_notes(table.notes)
            files["data"] = table.sha256
        with _folder_if(out, files) as folder:
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


@app.command()
def sensitivity(
    model: ModelArg,
    data: DataArg = None,
    poses: Annotated[str | None, typer.Option("--poses", help="pose labels, as in 5,41,77")] = None,
    joints: Joints = None,
    low: Annotated[float, typer.Option(help="low level, N m/rad")] = 1e5,
    high: Annotated[float, typer.Option(help="high level, N m/rad")] = 1e6,
    links: Links = None,
    load_path: LoadPathOpt = None,
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Two-level factorial of the joint springs: effects with signs, ranked."""
    with user_errors(debug):
        given = inputs.read_model(model, links, load_path)
        if not (0.0 < low < high and np.isfinite(high)):
            raise InputError(
                "--low, --high",
                value=f"{low:g}, {high:g}",
                allowed="0 < low < high, finite, N m/rad",
                remedy="give the range in which the springs are expected",
            )
        table = inputs.read_data(given.robot, model, data)
        _say_notes(table.notes)
        scheme = bundled_scheme(given.robot.name)
        chosen = inputs.parse_names(joints, given.robot.joint_names, "--joints")
        labels = inputs.parse_names(poses, tuple(dict.fromkeys(table.pose)), "--poses")
        chosen = chosen or (scheme.sensitivity.joints if scheme else steps.springs_seen(given, table))
        if labels is None:
            known = set(table.pose)
            planned = scheme.sensitivity.poses if scheme and set(scheme.sensitivity.poses) <= known else ()
            labels = planned or tuple(dict.fromkeys(table.pose))
        with _folder_if(out, {"model": _model_hash(given), "data": table.sha256}) as folder:
            effects = steps.sensitivity(given, table, chosen, labels, low, high)
            result = {
                "robot": given.robot.name,
                "load_path": given.model.load_path,
                "links": given.model.link_kind,
                "low_Nm_per_rad": low,
                "high_Nm_per_rad": high,
                "effects": payloads.effects(effects),
            }
            if folder is not None:
                from stiffarm.figures_calibration import sensitivity_figure
                from stiffarm.picture_style import save_png

                folder.write_json("sensitivity.json", result)
                save_png(sensitivity_figure({given.model.load_path: effects}), folder.path("sensitivity.png"))
        if as_json:
            emit_json(result)
        else:
            tables.sensitivity(effects, low, high, given.model.load_path)


@app.command()
def calibrate(
    model: ModelArg,
    data: DataArg = None,
    scheme: Annotated[str, typer.Option("--scheme", help="staged (published) or global (constant springs)")] = "staged",
    joints: Joints = None,
    loads: Loads = None,
    spacing: Annotated[
        str | None, typer.Option("--spacing", help="of the levels (staged): log or linear; default: log")
    ] = None,
    low: Annotated[
        float | None, typer.Option(help="first lower bound (global), N m/rad; default: the scheme's, or 1e5")
    ] = None,
    high: Annotated[
        float | None, typer.Option(help="first upper bound (global), N m/rad; default: the scheme's, or 1e6")
    ] = None,
    scheme_file: SchemeFile = None,
    links: Links = None,
    load_path: LoadPathOpt = None,
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Fit the joint springs to measured deflections; writes a new model TOML into --out."""
    with user_errors(debug):
        staged_only = {"--spacing": spacing}
        global_only = {"--joints": joints, "--low": low, "--high": high}
        if scheme not in ("staged", "global"):
            raise InputError("--scheme", value=scheme, allowed="staged, global", remedy="choose one of them")
        _refuse(global_only if scheme == "staged" else staged_only, scheme)
        if spacing not in (None, "log", "linear"):
            raise InputError("--spacing", value=spacing, allowed="log, linear", remedy="choose one of them")
        chosen_loads = inputs.parse_loads(loads)
        given = inputs.read_model(model, links, load_path)
        names = inputs.parse_names(joints, given.robot.joint_names, "--joints")
        table = inputs.read_data(given.robot, model, data)
        _say_notes(table.notes)
        files: dict[str, Path | str] = {"model": _model_hash(given), "data": table.sha256}
        if scheme_file is not None:
            files["scheme"] = scheme_file
        plan: Scheme | None = None
        if scheme == "staged" or scheme_file is not None:
            plan = inputs.read_scheme(given.robot, scheme_file)
        elif table.sha256 == steps.bundled_sha256(given.robot.name):
            plan = bundled_scheme(given.robot.name)
        if chosen_loads is None:
            chosen_loads = plan.loads_N if plan is not None else ()
        with _folder_if(out, files) as folder:
            say(f"loads used: {', '.join(f'{v:g} N' for v in chosen_loads) or 'all'}")
            if scheme == "staged" and plan is not None:
                result = steps.calibrate_by_stages(given, table, plan, chosen_loads, spacing or "log", progress=say)
            else:
                result = _constant_springs(given, table, plan, names, chosen_loads, low, high)
            content = payloads.variant(result)
            if folder is not None:
                folder.write_json("calibration.json", content)
                save_description(result.description, folder.path("model.toml"))
        if out is not None:
            say(f"written: {out / 'model.toml'}, {out / 'calibration.json'}")
        if as_json:
            emit_json(content)
        else:
            tables.variant(result)


def _refuse(options: dict[str, Any], scheme: str) -> None:
    """Refuse options that this calibration would not heed."""
    given = [name for name, value in options.items() if value is not None]
    if given:
        raise InputError(
            f"{', '.join(given)}: no option of --scheme {scheme}",
            remedy="give --scheme global" if scheme == "staged" else "give --scheme staged, or leave it out",
        )


def _say_notes(notes: tuple[str, ...]) -> None:
    for note in notes:
        say(f"note: {note}")


def _constant_springs(
    given: inputs.ModelInput,
    table: Measurements,
    plan: Scheme | None,
    names: tuple[str, ...] | None,
    loads: tuple[float, ...],
    low: float | None,
    high: float | None,
) -> steps.Variant:
    usual = steps.DEFAULT_BOUNDS_Nm_per_rad
    gauge = steps.DEFAULT_GAUGE_mm
    if plan is not None:
        names = names or plan.constant.joints
        usual, gauge = (plan.low_Nm_per_rad, plan.high_Nm_per_rad), plan.gauge_mm
    first, last = usual[0] if low is None else low, usual[1] if high is None else high
    if not (0.0 < first < last and np.isfinite(last)):
        raise InputError(
            "--low, --high",
            value=f"{first:g}, {last:g}",
            allowed="0 < low < high, finite, N m/rad",
            remedy="give the range in which the springs are expected; it is widened where the data ask for it",
        )
    return steps.calibrate_constant(
        given, table, names or steps.springs_seen(given, table), loads, (first, last), gauge
    )


@app.command()
def fit(
    model: ModelArg,
    out: Annotated[Path, typer.Option("--out", help="folder for the surrogate")],
    basis: Annotated[str, typer.Option(help="best, polynomial or trigonometric")] = "best",
    degree: Annotated[int, typer.Option(help="total degree of the polynomial", min=1, max=12)] = 6,
    order: Annotated[int, typer.Option(help="order of the trigonometric basis in each angle", min=1, max=4)] = 2,
    runs: Annotated[int, typer.Option(help="model runs to fit on", min=1, max=1_000_000)] = 4096,
    over: Annotated[str | None, typer.Option("--inputs", help="joint coordinates, as in q2_deg,q3real_deg")] = None,
    fixed: Annotated[
        str | None, typer.Option(help="where the other coordinates stand, as in q5_deg=30; default: 0")
    ] = None,
    direction: Annotated[str, typer.Option(help="load direction in base axes")] = "0,0,-1",
    links: Links = None,
    load_path: LoadPathOpt = None,
    seed: Seed = 0,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Learn a surrogate from joint angles to structural stiffness, judged on runs it has not seen."""
    with user_errors(debug):
        from surrogate import save_surrogate

        if basis not in ("best", "polynomial", "trigonometric"):
            raise InputError(
                "--basis", value=basis, allowed="best, polynomial, trigonometric", remedy="choose one of them"
            )
        given = inputs.read_model(model, links, load_path)
        names = inputs.parse_names(over, given.robot.coordinates, "--inputs") or steps.default_inputs(given.model)
        others = inputs.fixed_coordinates(given.robot, names, fixed)
        along = inputs.parse_direction(direction)
        with _folder(out, {"model": _model_hash(given)}, seed) as folder, progress("model runs") as bar:
            trained = steps.learn(
                given.description,
                given.model,
                names,
                seed,
                basis=basis,  # type: ignore[arg-type]
                degree=degree,
                order=order,
                runs=runs,
                fixed_deg=others,
                direction=along,
                progress=bar,
            )
            for one in trained.surrogates:
                save_surrogate(one, folder.path(f"surrogate_{one.basis.name}.json"))
            save_surrogate(trained.best, folder.path("surrogate.json"))
            content = payloads.trained(trained)
            folder.write_json("surrogate_errors.json", content)
        if as_json:
            emit_json(content)
        else:
            tables.surrogates(content)
            say(f"written: {out / 'surrogate.json'} ({content['best']})")


@app.command()
def query(
    surrogate_file: Annotated[Path, typer.Argument(metavar="SURROGATE", help="surrogate.json")],
    table: Annotated[
        Path | None, typer.Argument(metavar="[POSES]", help="table with joint columns, CSV or XLSX")
    ] = None,
    pose: Annotated[
        list[str] | None, typer.Option("--pose", help="as in q2_deg=5,q3real_deg=77.5; may be repeated")
    ] = None,
    extrapolate: Annotated[
        bool, typer.Option("--extrapolate", help="answer outside the fitted domain too, flagged")
    ] = False,
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Structural stiffness at poses, from a surrogate, with its error."""
    with user_errors(debug):
        from surrogate import load_surrogate
        from surrogate import query as ask

        learned = load_surrogate(surrogate_file)
        degrees, labels, remarks = query_poses(learned, pose, table)
        _say_notes(tuple(remarks))
        answer = ask(learned, np.radians(degrees), extrapolate=extrapolate)
        rows = payloads.query_rows(learned, degrees, labels, answer)
        content = {
            "robot": learned.robot,
            "load_direction": list(learned.load_direction),
            "fixed_deg": dict(learned.fixed_deg),
            "errors": payloads.surrogate_errors(learned),
            "answers": rows,
        }
        if out is not None:
            import pandas as pd

            files = {"surrogate": surrogate_file} | ({} if table is None else {"poses": table})
            with _folder(out, dict(files)) as folder:
                folder.write_json("query.json", content)
                folder.write_text("query.csv", pd.DataFrame(rows).to_csv(index=False))
        if as_json:
            emit_json(content)
        else:
            tables.answers(learned.robot, learned.inputs, rows)


@app.command("map")
def map_command(
    model: ModelArg,
    out: Annotated[Path, typer.Option("--out", help="folder for the map")],
    surrogate_file: Annotated[
        Path | None, typer.Option("--surrogate", help="take the stiffness from this surrogate")
    ] = None,
    points: Annotated[int, typer.Option(help="values of each swept coordinate", min=2, max=200)] = 21,
    layers: Annotated[
        str | None, typer.Option("--layers", help="values in deg of the coordinate that leaves the plane")
    ] = None,
    pictures: Annotated[bool, typer.Option(help="also draw PNGs")] = True,
    links: Links = None,
    load_path: LoadPathOpt = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """The 3-D stiffness map as a .vtu for ParaView, with pictures."""
    with user_errors(debug):
        from stiffarm import maps

        given = inputs.read_model(model, links, load_path)
        learned = None if surrogate_file is None else inputs.read_surrogate_for_map(given, surrogate_file)
        if learned is not None and learned.model_hash != _model_hash(given):
            say("note: the surrogate was fitted to another model than MODEL; the map's file has the stiffness of both")
        wanted = inputs.parse_layers(given.robot, layers)
        files: dict[str, Path | str] = {"model": _model_hash(given)}
        if surrogate_file is not None:
            files["surrogate"] = surrogate_file
        with _folder(out, files) as folder, progress("map poses") as bar:
            made = steps.stiffness_map(given.description, given.model, points, learned, wanted, progress=bar)
            content = maps.write(made, given.description, given.robot, folder, pictures)
        if as_json:
            emit_json(content)
        else:
            say(f"written: {', '.join(str(out / name) for name in content['files'])}")
            for message in content["messages"]:
                say(f"note: {message}")


@app.command()
def run(
    model: Annotated[str, typer.Argument(metavar="[MODEL]", help="a robot with a bundled or given scheme")] = "xr701",
    data: DataArg = None,
    scheme_file: SchemeFile = None,
    links: Links = None,
    out: Annotated[Path, typer.Option("--out", help="folder for results")] = Path("out"),
    points: Annotated[int, typer.Option(help="values of each swept coordinate of the map", min=2, max=200)] = 21,
    seed: Seed = 0,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """The whole chain: data, first model, sensitivity, calibration, surrogate, maps, report."""
    with user_errors(debug):
        from stiffarm.workflow import run_all

        content = run_all(model, data, scheme_file, links, out, points, seed, _command())
        if as_json:
            emit_json(content)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(__version__)
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="print the version")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Entry point; :mod:`stiffarm.__main__` is the one that also catches Ctrl-C during the imports."""
    app()
