"""The command `sensitivity`."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import typer

from doe import bundled_scheme
from robots import InputError
from stiffarm import inputs, payloads, steps, tables
from stiffarm.console import emit_json, user_errors
from stiffarm.options import DataArg, Debug, Joints, Json, Links, LoadPathOpt, ModelArg, Out, folder_if, open_measured


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
