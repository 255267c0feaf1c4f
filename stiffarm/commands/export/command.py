"""The arm for other programs: `export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from fem.arm import Arm
from robots import InputError
from stiffarm import __version__
from stiffarm.session import parsing
from stiffarm.session.console import say, say_notes
from stiffarm.session.frame import command
from stiffarm.session.inputs import model_hash
from stiffarm.session.json_text import number
from stiffarm.session.options import Debug, Json, LoadPathOpt, ModelArg, Sets

DEFAULT_LOAD = "fz_N=-650"


def export(
    model: ModelArg,
    out: Annotated[Path, typer.Option("--out", help="Folder for arm.inp and export.json; it is created if needed.")],
    pose: Annotated[
        list[str] | None,
        typer.Option(
            "--pose", help="Joint coordinates in deg, as in q2_deg=5,q3real_deg=77.5; coordinates not given are 0."
        ),
    ] = None,
    load: Annotated[
        str, typer.Option("--load", help="Load at the tool point in base axes, in N and N m, as in fz_N=-650,mx_Nm=10.")
    ] = (DEFAULT_LOAD),
    links: Annotated[
        str,
        typer.Option(
            "--links",
            help="Link model: shell or solid (flanges as in the model), shell:rigid, shell:distributing and so on.",
        ),
    ] = "shell",
    load_path: LoadPathOpt = None,
    sets: Sets = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Write the shell model in one pose for CalculiX.

    The input file arm.inp runs as it is; our own solution is printed for comparison and written into export.json.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        if links.partition(":")[0] not in ("shell", "solid"):
            raise InputError(
                "--links",
                code="M003",
                value=links,
                allowed="shell, shell:rigid, shell:distributing, solid, solid:rigid, solid:distributing",
                remedy="leave it out: beams and rigid links have no mesh to write",
            )
        if pose is None or len(pose) != 1:
            raise InputError(
                "--pose: an export is one pose",
                code="M003",
                value=f"{len(pose or ())} of them",
                allowed="exactly one",
                remedy="give one --pose, as in --pose q2_deg=5; run the command again for another",
            )
        wrench = parsing.parse_load(load)
        given = frame.model(model, links, load_path, without="the export", sets=sets)
        q = parsing.parse_pose(given.robot, pose[0])
        with frame.folder() as folder:
            from fem.reference.calculix.arm import arm_deck
            from fem.reference.shell_arm import all_links

            say(f"writing {len(given.model.links)} links as CalculiX shells")
            with folder.timed("deck"):
                deck = arm_deck(given.model, q, wrench, title=_title(given, q))
            folder.write_text("arm.inp", deck.text)
            content: dict[str, Any] = {
                "schema": "stiffarm-export/1",
                "file": "arm.inp",
                "run": "ccx arm",
                "format": "CalculiX 2.20",
                "units": "mm, N, MPa, rad; base axes",
                "robot": given.robot.name,
                "model_sha256": model_hash(given),
                "links": given.model.link_kind,
                "flanges": {link.name: dict(link.flanges) for link in all_links(given.model)},
                "load_path": given.model.load_path,
                "joints_without_spring": list(given.joints_without_springs),
                "pose_deg": {n: number(v) for n, v in zip(given.robot.coordinates, np.degrees(q), strict=True)},
                "load": {n: number(v) for n, v in zip(parsing.WRENCH_NAMES, wrench, strict=True)},
                "tool_node": deck.tool[0],
                "tool_rotation_node": deck.tool[1],
                "stiffarm": {
                    n: number(1e3 * v) for n, v in zip(parsing.DISPLACEMENT_NAMES, deck.displacement, strict=True)
                },
                "nodes": deck.nodes,
                "elements": deck.elements,
                "equations": deck.equations,
                "sets": deck.sets,
            }
            folder.write_json("export.json", content)
        say_notes(_notes(given))
        d = content["stiffarm"]
        say(f"the shell arm has {deck.nodes} nodes and {deck.elements} elements")
        say(f"stiffarm's own solution: {', '.join(f'{name} = {value:.4g}' for name, value in d.items())}")
        say("run `ccx arm` in the output folder; arm.dat then holds the tool-point displacement (sets TOOL, TOOL_ROT)")
        frame.answer(content)


def _title(given: Arm, q: np.ndarray[Any, np.dtype[np.float64]]) -> list[str]:
    """What the header says about model and pose."""
    pose = ", ".join(f"{n} = {v:g}" for n, v in zip(given.robot.coordinates, np.degrees(q), strict=True))
    return [
        f"stiffarm {__version__}: {given.robot.name}, {given.description.title}",
        f"model sha256 {model_hash(given)}",
        f"load path {given.model.load_path}, links {given.model.link_kind}",
        f"pose: {pose}",
        *(f"note: {note}" for note in _notes(given)),
    ]


def _notes(given: Arm) -> list[str]:
    stiff = list(given.joints_without_springs)
    out = [f"no spring is given for {', '.join(stiff)}: held rigid until calibrated"] if stiff else []
    calibration = given.description.calibration
    if calibration is not None and calibration.links != given.model.link_kind:
        out.append(f"the springs were calibrated with {calibration.links} links; here they are {given.model.link_kind}")
    return out
