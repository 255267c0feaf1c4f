"""Commands that meet measurements: `sensitivity`, `calibrate`."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
import typer

from doe import Measurements, Scheme, bundled_scheme
from robots import InputError, save_description
from stiffarm import inputs, payloads, steps, tables
from stiffarm.console import emit_json, say, user_errors
from stiffarm.options import (
    DataArg,
    Debug,
    Joints,
    Json,
    Links,
    LoadPathOpt,
    Loads,
    ModelArg,
    Out,
    SchemeFile,
    folder_if,
    open_measured,
)


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
        if not (0.0 < low < high and np.isfinite(high)):
            raise InputError(
                "--low, --high",
                value=f"{low:g}, {high:g}",
                allowed="0 < low < high, finite, N m/rad",
                remedy="give the range in which the springs are expected",
            )
        given, table, files = open_measured(model, data, links, load_path)
        scheme = bundled_scheme(given.robot.name)
        chosen = inputs.parse_names(joints, given.robot.joint_names, "--joints")
        labels = inputs.parse_names(poses, tuple(dict.fromkeys(table.pose)), "--poses")
        chosen = chosen or (scheme.sensitivity.joints if scheme else steps.springs_seen(given, table))
        if labels is None:
            known = set(table.pose)
            planned = scheme.sensitivity.poses if scheme and set(scheme.sensitivity.poses) <= known else ()
            labels = planned or tuple(dict.fromkeys(table.pose))
        with folder_if(out, files) as folder:
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
                from stiffarm.figures_sensitivity import sensitivity_figure
                from stiffarm.picture_style import save_png

                folder.write_json("sensitivity.json", result)
                save_png(sensitivity_figure({given.model.load_path: effects}), folder.path("sensitivity.png"))
        if as_json:
            emit_json(result)
        else:
            tables.sensitivity(effects, low, high, given.model.load_path)


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
        given, table, files = open_measured(model, data, links, load_path)
        names = inputs.parse_names(joints, given.robot.joint_names, "--joints")
        if scheme_file is not None:
            files["scheme"] = scheme_file
        plan: Scheme | None = None
        if scheme == "staged" or scheme_file is not None:
            plan = inputs.read_scheme(given.robot, scheme_file)
        elif table.sha256 == steps.bundled_sha256(given.robot.name):
            plan = bundled_scheme(given.robot.name)
        if chosen_loads is None:
            chosen_loads = plan.loads_N if plan is not None else ()
        with folder_if(out, files) as folder:
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
