"""The command `index`: stiffness indices of a machining pose."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from fem import ArmModel
from fem.arm import Arm
from fem.effects.structure import joint_is_rigid
from machining import INDICES
from robots import InputError
from robots.arrays import Array
from robots.constants import DOWN
from robots.files.csv_text import records_text
from stiffarm.commands.index import results as index_results
from stiffarm.session import parsing
from stiffarm.session.console import say, say_notes, show_table
from stiffarm.session.frame import command
from stiffarm.session.inputs import with_links
from stiffarm.session.options import Debug, Json, Links, LoadPathOpt, ModelArg, Out, Sets
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.parsing import frame_words, parse_vector, tool_of
from stiffarm.session.stated import AtLoad, interval_json, intervals_at, stated_table
from stiffarm.session.task_options import NormalOpt, ToolOpt

# Rows of the table on the screen; files have all.
SHOWN = 30


def index(
    model: ModelArg,
    table: Annotated[
        Path | None,
        typer.Argument(
            metavar="[POSES]", help="Table of poses (CSV/XLSX) with one column per joint coordinate, in deg."
        ),
    ] = None,
    pose: Annotated[
        list[str] | None,
        typer.Option(
            "--pose",
            help="Joint coordinates in deg, as in q2_deg=5,q3_deg=77; coordinates not given are 0. May be repeated.",
        ),
    ] = None,
    normal: NormalOpt = "0,0,1",
    force: Annotated[
        str | None,
        typer.Option(
            "--force",
            metavar="X,Y,Z",
            help="Force on the tool in base axes, in N; needed for NSPI and the Rayleigh quotient.",
        ),
    ] = None,
    tool: ToolOpt = None,
    load: Annotated[
        str | None,
        typer.Option(
            "--load",
            help="Load that the arm carries, in N and N m, as in fz_N=-650; adds the stiffness K_C due to the "
            "load. Default: no load.",
        ),
    ] = None,
    at_load: AtLoad = None,
    links: Links = None,
    load_path: LoadPathOpt = None,
    sets: Sets = None,
    out: Out = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Compute stiffness indices at poses, such as k_fs and NSPI.

    Also the Rayleigh quotient, directional stiffness, weakest and stiffest direction, and isotropy.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        given = frame.model(model, links, load_path, sets=sets, shown=True)
        q, labels = _poses(given, pose, table)
        question = index_results.IndexQuestion(
            q,
            labels,
            tool_of(given.robot, tool)[:3, 3],
            parse_vector(normal, "--normal", "a direction in base axes"),
            None if force is None else parse_vector(force, "--force", "N in base axes"),
            None if load is None else parsing.parse_load(load),
        )
        along = next((v[:3] for v in (question.force, question.load) if v is not None and v[:3].any()), DOWN)
        given = frame.at_load(given, at_load, along, question.tip)
        found = index_results.answer(given.model, question, _joints_alone(given))
        content = index_results.payload(given.robot, found) | stated_table(given.model)
        values = np.array([one["indices"]["directional_N_per_mm"] or np.nan for one in content["poses"]])
        ends = intervals_at(given.description, given.model, q, question.normal, values, question.tip)
        for one, low, high in zip(content["poses"], *ends, strict=True):
            one["directional_interval95_N_per_mm"] = interval_json(low, high)
        frame.reads(poses=table)
        with frame.folder_if() as folder:
            if folder is not None:
                _write(folder, content, found, given)
        frame.answer(content, lambda: _show(given, content, found, tool_of(given.robot, tool)))


def _joints_alone(given: Arm) -> ArmModel | None:
    """The arm with rigid links; None where they are rigid anyway, or nothing would give way without them."""
    if given.model.link_kind == "rigid":
        return None
    model = with_links(given, "rigid").model
    joints = not all(joint_is_rigid(joint, model.robot.dof) for joint in model.joints)
    return model if joints or model.base.any() or model.tool.any() else None


def _poses(given: Arm, pose: list[str] | None, table: Path | None) -> tuple[Array, tuple[str, ...]]:
    if (table is None) == (not pose):
        raise InputError(
            "index needs poses",
            code="A003",
            allowed="either --pose (one or more) or a table of poses",
            remedy=f"give one of the two, as in --pose {given.robot.coordinates[0]}=5",
        )
    if table is None:
        q = np.stack([parsing.parse_pose(given.robot, text) for text in pose or ()])
        return q, tuple(str(i + 1) for i in range(len(q)))
    from stiffarm.session.pose_tables import read_pose_table

    degrees, labels, remarks = read_pose_table(given.robot.coordinates, {}, table)
    say_notes(tuple(remarks))
    q = np.radians(degrees)
    outside = np.flatnonzero(~given.robot.reachable(q))
    if len(outside):
        first = int(outside[0])
        raise InputError(
            f"pose table {table}: {len(outside)} of {len(q)} poses cannot be taken; the first is pose {labels[first]}",
            code="A005",
            value="; ".join(given.robot.violations(q[first])),
            remedy="correct or remove them",
        )
    return q, tuple(labels)


def _write(folder: OutputFolder, content: dict[str, Any], found: index_results.IndexAnswer, given: Arm) -> None:
    from stiffarm.commands.index.report import write_report

    folder.write_json("index.json", content)
    folder.write_text("index.csv", records_text(index_results.rows(given.robot, found)))
    write_report(folder, content, found, given)


def _show(given: Arm, content: dict[str, Any], found: index_results.IndexAnswer, T_flange_tool: Array) -> None:
    poses = content["poses"]
    names = list(poses[0]["indices"])
    shown = poses[:SHOWN]
    words = index_results.alone_words(found)
    title = f"{given.robot.name}, N/mm{f'; {words}' if words else ''}"
    say(f"tool on the flange: {frame_words(T_flange_tool)}")
    columns = ["index", *(f"pose {one['pose']}" for one in shown[:6])]
    if len(shown) <= 6:
        cells = [[_short(name), *(index_results.cell(one, name) for one in shown)] for name in names]
        show_table(title, columns, cells)
    else:
        show_table(
            title,
            ["pose", *map(_short, names)],
            [[one["pose"], *(index_results.cell(one, name) for name in names)] for one in shown],
        )
    if len(poses) > SHOWN:
        say(f"({len(poses) - SHOWN} more poses are in the files of --out and with --json)")
    for one in poses:
        if one["distances"]["singularity"] is not None and one["distances"]["singularity"] < 0.05:
            distance = f"smallest singular value {one['distances']['singularity']:.2g}"
            say(f"note: pose {one['pose']} is close to a singularity ({distance})")
    for name, why in content["not_computed"].items():
        say(f"note: {name} ({INDICES[name].formula}) {why}")


def _short(key: str) -> str:
    return key.removesuffix("_N_per_mm")
