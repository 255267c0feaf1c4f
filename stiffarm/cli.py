"""The command line: thin, each command a step of the workflow."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from doe import bundled_scheme
from robots import InputError, bundled_names, content_hash, load_description
from stiffarm import __version__, inputs, payloads, steps
from stiffarm.console import emit_json, progress, say, show_table, user_errors
from stiffarm.outputs import OutputFolder

app = typer.Typer(
    name="stiffarm",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="How stiff is my robot arm, here, in this pose, and why does the model say something else than my gauge?",
)

ModelArg = Annotated[
    str, typer.Argument(metavar="MODEL", help="bundled name (see `stiffarm robots`) or a model TOML")
]
DataArg = Annotated[
    Path | None,
    typer.Argument(metavar="[DATA]", help="measurement table, CSV or XLSX; default: the bundled one"),
]
Links = Annotated[
    str | None, typer.Option("--links", help="beam or rigid; default: as calibrated, else beam")
]
LoadPathOpt = Annotated[
    str | None, typer.Option("--load-path", help="parallelogram or serial; default: the model's")
]
Out = Annotated[Path | None, typer.Option("--out", help="folder for results")]
Json = Annotated[bool, typer.Option("--json", help="one JSON object on stdout")]
Debug = Annotated[bool, typer.Option("--debug", help="show tracebacks")]
Joints = Annotated[
    str | None, typer.Option("--joints", help="joints, as in j2,j3; default: the scheme's or all that matter")
]
Loads = Annotated[
    str | None,
    typer.Option(
        "--loads", help="force magnitudes in N, as in 150,650, or all; default: the scheme's, else all"
    ),
]
Seed = Annotated[int, typer.Option("--seed", help="of the random numbers")]
SchemeFile = Annotated[
    Path | None, typer.Option("--scheme-file", help="calibration scheme TOML; default: the bundled one")
]


def _command() -> list[str]:
    return ["stiffarm", *sys.argv[1:]]


def _folder(out: Path, files: dict[str, Path | str], seed: int | None = None) -> OutputFolder:
    return OutputFolder(out, _command(), files, seed)


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
            show_table(
                f"{description.title}: joints",
                ["joint", "coordinate", "limits (deg)", "stiffness"],
                [
                    [j.name, j.coordinate, f"{j.limits.value[0]:g} to {j.limits.value[1]:g}", _spring_text(j)]  # type: ignore[index]
                    for j in description.joint
                ],
            )
            for coupling in description.coupling:
                terms = " ".join(f"{t.factor:+g} {t.coordinate}" for t in coupling.terms)
                low, high = np.degrees(coupling.limits.si_array)
                offset = 0.0 if coupling.offset is None else np.degrees(coupling.offset.si)
                say(
                    f"coupled limit {coupling.name}: {low:g} <= {offset:g} {terms} <= {high:g} deg ({coupling.limits.source})"
                )
            for note in description.notes:
                say(f"note: {note}")
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
        show_table(
            "Bundled robots", ["name", "title", "load path"], [[d.name, d.title, d.load_path] for d in found]
        )


def _spring_text(joint: Any) -> str:
    if joint.stiffness is None:
        return "not given (rigid)"
    if hasattr(joint.stiffness, "unit"):
        return f"{joint.stiffness.si:.4g} N m/rad ({joint.stiffness.source})"
    return f"depends on {', '.join(joint.stiffness.inputs)}"


@app.command()
def simulate(
    model: ModelArg,
    data: DataArg = None,
    pose: Annotated[
        str | None, typer.Option("--pose", help="as in q2_deg=5,q3real_deg=77.5; the rest is 0")
    ] = None,
    load: Annotated[
        str, typer.Option("--load", help="wrench at the tool point, as in fz_N=-650")
    ] = "fz_N=-650",
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
        if pose is not None and data is not None:
            raise InputError("simulate takes a pose or a measurement table, not both")
        result = (
            simulation.of_pose(
                given, inputs.parse_pose(given.robot, pose), inputs.parse_load(load), rigid_joints
            )
            if pose is not None
            else simulation.of_table(given, inputs.read_data(given.robot, model, data), rigid_joints)
        )
        if out is not None:
            with _folder(out, {"model": _model_hash(given)} | ({"data": data} if data else {})) as folder:
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
        table = inputs.read_data(given.robot, model, data)
        scheme = bundled_scheme(given.robot.name)
        chosen = inputs.parse_names(joints, given.robot.joint_names, "--joints")
        labels = inputs.parse_names(poses, tuple(dict.fromkeys(table.pose)), "--poses")
        chosen = chosen or (scheme.sensitivity.joints if scheme else steps.springs_seen(given, table))
        if labels is None:
            known = set(table.pose)
            planned = scheme.sensitivity.poses if scheme and set(scheme.sensitivity.poses) <= known else ()
            labels = planned or tuple(dict.fromkeys(table.pose))
        effects = steps.sensitivity(given, table, chosen, labels, low, high)
        result = {
            "robot": given.robot.name,
            "load_path": given.model.load_path,
            "links": given.model.link_kind,
            "low_Nm_per_rad": low,
            "high_Nm_per_rad": high,
            "effects": payloads.effects(effects),
        }
        if out is not None:
            from stiffarm.figures_calibration import sensitivity_figure
            from stiffarm.picture_style import save_png

            with _folder(out, {"model": _model_hash(given), "data": table.sha256}) as folder:
                folder.write_json("sensitivity.json", result)
                save_png(sensitivity_figure({given.model.load_path: effects}), folder.path("sensitivity.png"))
        if as_json:
            emit_json(result)
        else:
            show_table(
                f"Effect on dz (mm) of each spring from {low:g} to {high:g} N m/rad ({given.model.load_path})",
                ["pose", *chosen, "ranking"],
                [[e.pose, *(f"{v:+.3f}" for v in e.effect_mm), " > ".join(e.ranking)] for e in effects],
            )


@app.command()
def calibrate(
    model: ModelArg,
    data: DataArg = None,
    scheme: Annotated[
        str, typer.Option("--scheme", help="staged (published) or global (constant springs)")
    ] = "staged",
    joints: Joints = None,
    loads: Loads = None,
    spacing: Annotated[str, typer.Option("--spacing", help="of the levels: log or linear")] = "log",
    low: Annotated[float, typer.Option(help="first lower bound, N m/rad (global)")] = 1e5,
    high: Annotated[float, typer.Option(help="first upper bound, N m/rad (global)")] = 1e6,
    scheme_file: SchemeFile = None,
    links: Links = None,
    load_path: LoadPathOpt = None,
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Fit the joint springs to measured deflections; writes a new model TOML into --out."""
    with user_errors(debug):
        if scheme not in ("staged", "global"):
            raise InputError("--scheme", value=scheme, allowed="staged, global")
        if spacing not in ("log", "linear"):
            raise InputError("--spacing", value=spacing, allowed="log, linear")
        if not 0.0 < low < high:
            raise InputError("--low, --high", value=f"{low:g}, {high:g}", allowed="0 < low < high")
        given = inputs.read_model(model, links, load_path)
        table = inputs.read_data(given.robot, model, data)
        for note in table.notes:
            say(f"note: {note}")
        result = _calibrated(given, table, scheme, joints, loads, spacing, (low, high), scheme_file)
        content = payloads.variant(result)
        if out is not None:
            from robots import save_description

            with _folder(out, {"model": _model_hash(given), "data": table.sha256}) as folder:
                folder.write_json("calibration.json", content)
                save_description(result.description, folder.path("model.toml"))
            say(f"written: {out / 'model.toml'}, {out / 'calibration.json'}")
        if as_json:
            emit_json(content)
        else:
            _show_variant(result)


def _calibrated(
    given: inputs.ModelInput,
    table: Any,
    scheme: str,
    joints: str | None,
    loads: str | None,
    spacing: str,
    bounds: tuple[float, float],
    scheme_file: Path | None,
) -> steps.Variant:
    chosen_loads = inputs.parse_loads(loads)
    if scheme == "staged":
        plan = inputs.read_scheme(given.robot, scheme_file)
        used = plan.loads_N if chosen_loads is None else chosen_loads
        say(f"loads used: {', '.join(f'{v:g} N' for v in used) or 'all'}")
        return steps.calibrate_by_stages(given, table, plan, used, spacing, progress=say)
    bundled = bundled_scheme(given.robot.name)
    same_data = bundled is not None and table.sha256 == steps.bundled_sha256(given.robot.name)
    if chosen_loads is None:
        chosen_loads = bundled.loads_N if bundled is not None and same_data else ()
    say(f"loads used: {', '.join(f'{v:g} N' for v in chosen_loads) or 'all'}")
    names = inputs.parse_names(joints, given.robot.joint_names, "--joints")
    if names is None:
        names = (
            bundled.constant.joints if bundled is not None and same_data else steps.springs_seen(given, table)
        )
    return steps.calibrate_constant(given, table, names, chosen_loads, bounds)


def _show_variant(result: steps.Variant) -> None:
    if result.constant is not None:
        show_table(
            f"Constant springs, {result.model.load_path} load path",
            ["joint", "k (N m/rad)", "95 % interval", "status"],
            [
                [
                    s.joint,
                    "-" if np.isnan(s.stiffness) else f"{s.stiffness:.3g}",
                    _interval(s.interval),
                    s.status,
                ]
                for s in result.constant.springs
            ],
        )
    if result.staged is not None:
        show_table(
            f"Staged scheme, {result.model.load_path} load path",
            ["stage", "pose", "springs (N m/rad)", "error (mm)", "runs"],
            [
                [
                    stage,
                    fit.pose,
                    ", ".join(f"{j} {k:.3g}" for j, k in zip(fit.joints, fit.stiffness, strict=True)),
                    f"{fit.error_mm:+.3f}",
                    str(fit.runs),
                ]
                for stage, fits in result.staged.fits.items()
                for fit in fits
            ],
        )
    for remark in result.remarks:
        say(f"note: {remark}")
    say(
        f"RMS {result.rms_mm:.3f} mm on {len(result.system)} readings with {result.parameters} parameters; "
        f"poses left out one at a time are predicted to {result.left_out.rms_mm:.3f} mm RMS"
    )


def _interval(interval: tuple[float, float]) -> str:
    low, high = interval
    if np.isnan(low):
        return "-"
    return f">= {low:.3g}" if np.isinf(high) else f"{low:.3g} to {high:.3g}"


@app.command()
def fit(
    model: ModelArg,
    out: Annotated[Path, typer.Option("--out", help="folder for the surrogate")],
    basis: Annotated[str, typer.Option(help="best, polynomial or trigonometric")] = "best",
    degree: Annotated[int, typer.Option(help="total degree of the polynomial", min=1, max=12)] = 6,
    order: Annotated[
        int, typer.Option(help="order of the trigonometric basis in each angle", min=1, max=4)
    ] = 2,
    runs: Annotated[int, typer.Option(help="model runs to fit on", min=1, max=1_000_000)] = 4096,
    over: Annotated[
        str | None, typer.Option("--inputs", help="joint coordinates, as in q2_deg,q3real_deg")
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
            raise InputError("--basis", value=basis, allowed="best, polynomial, trigonometric")
        given = inputs.read_model(model, links, load_path)
        names = inputs.parse_names(over, given.robot.coordinates, "--inputs") or steps.default_inputs(
            given.model
        )
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
                direction=_direction(direction),
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
            _show_surrogates(content)
            say(f"written: {out / 'surrogate.json'} ({content['best']})")


def _direction(text: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError as error:
        raise InputError("--direction", value=text, allowed="three numbers, as in 0,0,-1") from error
    if not np.isfinite([x, y, z]).all() or (x, y, z) == (0.0, 0.0, 0.0):
        raise InputError("--direction", value=text, allowed="three finite numbers, not all zero")
    return x, y, z


def _show_surrogates(content: dict[str, Any]) -> None:
    show_table(
        "Relative error of compliance on runs kept out",
        ["basis", "terms", "RMS", "95 %", "worst"],
        [
            [
                f"{s['basis']} {s['degree_or_order']}",
                str(s["terms"]),
                f"{s['rms_relative_error']:.2e}",
                f"{s['p95_relative_error']:.2e}",
                f"{s['max_relative_error']:.2e}",
            ]
            for s in content["surrogates"]
        ],
    )


@app.command()
def query(
    surrogate_file: Annotated[Path, typer.Argument(metavar="SURROGATE", help="surrogate.json")],
    table: Annotated[Path | None, typer.Argument(metavar="[POSES]", help="CSV with joint columns")] = None,
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
        degrees, labels, remarks = _query_poses(learned.inputs, pose, table)
        for remark in remarks:
            say(f"note: {remark}")
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

            with _folder(out, {"surrogate": surrogate_file}) as folder:
                folder.write_json("query.json", content)
                folder.write_text("query.csv", pd.DataFrame(rows).to_csv(index=False))
        if as_json:
            emit_json(content)
        else:
            show_table(
                f"Structural stiffness of {learned.robot}",
                ["pose", *learned.inputs, "N/mm", "rel. error (RMS)", "in domain"],
                [
                    [
                        r["pose"],
                        *(f"{r[n]:g}" for n in learned.inputs),
                        f"{r['stiffness_N_per_mm']:.2f}",
                        "unknown" if r["relative_error_rms"] is None else f"{r['relative_error_rms']:.1e}",
                        "yes" if r["inside_domain"] and r["reachable"] else "NO",
                    ]
                    for r in rows
                ],
            )


def _query_poses(
    names: tuple[str, ...], pose: list[str] | None, table: Path | None
) -> tuple[Any, list[str], list[str]]:
    if (table is None) == (not pose):
        raise InputError("query needs poses", allowed="either --pose (one or more) or a CSV of poses")
    if table is not None:
        return inputs.read_pose_table(names, table)
    values = [inputs.parse_pairs(text, "--pose", names) for text in pose or ()]
    remarks = [
        f"pose {i + 1}: {name} is not given and taken as 0"
        for i, v in enumerate(values)
        for name in names
        if name not in v
    ]
    return (
        np.array([[v.get(name, 0.0) for name in names] for v in values]),
        [str(i + 1) for i in range(len(values))],
        remarks,
    )


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
        from surrogate import load_surrogate

        given = inputs.read_model(model, links, load_path)
        learned = None if surrogate_file is None else load_surrogate(surrogate_file)
        if learned is not None and learned.robot != given.robot.name:
            raise InputError(
                f"surrogate {surrogate_file} is of robot", value=learned.robot, allowed=given.robot.name
            )
        files: dict[str, Path | str] = {"model": _model_hash(given)}
        if surrogate_file is not None:
            files["surrogate"] = surrogate_file
        with _folder(out, files) as folder, progress("map poses") as bar:
            made = steps.stiffness_map(
                given.description, given.model, points, learned, _layers(layers), progress=bar
            )
            content = maps.write(made, given.description, given.robot, folder, pictures)
        if as_json:
            emit_json(content)
        else:
            say(f"written: {', '.join(str(out / name) for name in content['files'])}")
            for message in content["messages"]:
                say(f"note: {message}")


def _layers(text: str | None) -> tuple[float, ...] | None:
    if text is None:
        return None
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise InputError(
            "--layers", value=text, allowed="degrees separated by commas, as in -90,0,90"
        ) from error


@app.command()
def run(
    model: Annotated[
        str, typer.Argument(metavar="[MODEL]", help="a robot with a bundled or given scheme")
    ] = "xr701",
    data: DataArg = None,
    scheme_file: SchemeFile = None,
    links: Links = None,
    out: Annotated[Path, typer.Option("--out", help="folder for results")] = Path("out"),
    points: Annotated[
        int, typer.Option(help="values of each swept coordinate of the map", min=2, max=200)
    ] = 21,
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
    """Entry point of the ``stiffarm`` command."""
    app()
