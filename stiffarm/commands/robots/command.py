"""The command `robots`: the bundled robots and the library's arms, one with its figures, its poses, its kinematics."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from typer.core import TyperGroup

from doe import bundled_data
from meshes import RobotMasses, robot_masses
from robots import InputError, ModelDescription, Robot, bundled_names, load_description
from robots.arm_class import ArmClass, arm_class
from robots.joint_errors import designed
from robots.library.models import library_table
from robots.robot import robot_from
from robots.schema.description import Joint
from robots.schema.quantities import RotationalStiffness
from stiffarm.session.console import say, show_table
from stiffarm.session.frame import command
from stiffarm.session.json_text import number
from stiffarm.session.options import Debug, Json, ModelArg
from stiffarm.session.table_kinds import described


class _Robots(TyperGroup):
    """`stiffarm robots NAME` is short for `stiffarm robots show NAME`."""

    def parse_args(self, ctx: Any, args: list[str]) -> Any:
        named = bool(args) and (args[0] in self.commands or args[0] == "--help")
        return super().parse_args(ctx, args if named else ["show", *args])


robots = typer.Typer(
    cls=_Robots,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="""List robots, show one, or check its kinematics.

    `stiffarm robots` lists all; `stiffarm robots NAME` is short for `stiffarm robots show NAME`.
    """,
)


@robots.command("show")
def show_command(
    name: Annotated[
        str | None, typer.Argument(help="Show this robot in detail: a name of the list, a model TOML or a URDF.")
    ] = None,
    pose: Annotated[
        str | None,
        typer.Option(
            "--pose",
            help="Joint angles in deg, as in q2_deg=-90,q3_deg=90 (others 0), or the controller's angles. Shows where "
            "the tool is, in the usual controllers' conventions.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", help="With --pose: folder for the answer and a picture of the arm (pose.json, pose.png)."
        ),
    ] = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """List the robots, or show one in detail.

    Details are joint limits, stiffnesses and masses, with their sources. With --pose: where the tool is.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        if name is None and (pose or out):
            raise InputError(
                "--pose, --out" if pose and out else "--pose" if pose else "--out",
                code="A003",
                value=pose or str(out),
                allowed="with a robot's name",
                remedy="name the robot first, as in `stiffarm robots kr60-3 --pose q2_deg=-90,q3_deg=90`",
            )
        if name is not None and out is not None and pose is None:
            raise InputError(
                "--out",
                code="A003",
                value=str(out),
                allowed="together with --pose",
                remedy="give a pose, or leave it out",
            )
        if name is not None and pose is not None:
            from stiffarm.commands.robots.pose import answer_pose

            answer_pose(frame, designed(described(name)), pose)
            return
        if name is not None:
            description = described(name)
            robot = robot_from(description)
            masses, prior = robot_masses(description, robot), arm_class(description, robot)
            figures = description.model_dump(mode="json", by_alias=True, exclude_none=True)
            extra = {"masses": _masses_payload(masses), "class_prior": _class_payload(robot, prior)}
            frame.answer(figures | extra, lambda: _show(description, masses, prior))
            return
        found = [load_description(bundled) for bundled in bundled_names()]
        content = [
            {
                "name": d.name,
                "title": d.title,
                "joints": len(d.joint),
                "load_path": d.load_path,
                "readings": _readings(d.name),
            }
            for d in found
        ]
        rows = [[d.name, d.title, d.load_path, _readings(d.name) or "-"] for d in found]
        heads = ["name", "title", "load path", "measured readings"]
        library = library_table()
        others = [
            [
                a["name"],
                a["title"],
                _marked(a["payload_kg"]),
                _marked(a["mass_kg"], mark=not a["mass_verified"]),
                ", ".join(a["formats"]) or "-",
            ]
            for a in library
        ]

        def show() -> None:
            show_table("Bundled robots", heads, rows)
            kinds = ["name", "title", "payload (kg)", "mass (kg)", "programs"]
            show_table("Library: kinematics, limits and conventions, no springs", kinds, others)
            say("*: not found published; recalled from data sheets and not verified")

        frame.answer({"robots": content, "library": library}, show)


@robots.command("check")
def check_command(
    model: ModelArg,
    table: Annotated[
        Path,
        typer.Argument(
            metavar="PENDANT",
            help="Table (CSV/XLSX) with a row for each pose: joint angles in deg, x_mm, y_mm, z_mm of the tool as "
            "the controller shows them, and optionally an orientation (a_deg b_deg c_deg, w_deg p_deg r_deg, "
            "qw qx qy qz and others).",
        ),
    ],
    tolerance_mm: Annotated[
        float, typer.Option("--tolerance-mm", help="Positions closer than this agree, in mm.")
    ] = 1.0,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for the answer (check.json) and a report with pictures.")
    ] = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Compare a model's kinematics with positions read at the controller, and name what is wrong.

    Finds a wrong sign or zero of a joint, a coupled joint, a wrong length, another base or tool frame, and radians in
    place of degrees.
    """
    with command(out, as_json=as_json, debug=debug) as frame:
        from stiffarm.commands.robots.check import answer_check

        answer_check(frame, designed(described(model)), model, table, tolerance_mm)


def _marked(value: float | None, *, mark: bool = False) -> str:
    return "-" if value is None else f"{value:g}{' *' if mark else ''}"


def _readings(name: str) -> str | None:
    """The file of the measured readings that come with a robot; None without any."""
    try:
        return bundled_data(name).name
    except InputError:
        return None


def _masses_payload(masses: RobotMasses) -> dict[str, Any]:
    """Masses of the parts; null where nothing is declared."""
    links = {
        link.name: {
            "casing_kg": number(link.casing.kg),
            "declared_kg": link.declared_kg,
            "rest_kg": None if link.rest_kg is None else number(link.rest_kg),
        }
        for link in masses.links
    }
    sums = {
        "bar_kg": masses.bar_kg,
        "crank_kg": None if masses.crank is None else masses.crank.kg,
        "sum_kg": masses.sum_kg,
        "robot_kg": masses.robot_kg,
        "difference_kg": masses.difference_kg,
    }
    return {"links": links} | {name: None if kg is None else number(kg) for name, kg in sums.items()}


def _class_payload(robot: Robot, prior: ArmClass) -> dict[str, Any]:
    """Stiffnesses that arms of this size have: no measurement of this one."""
    return {
        "size": prior.size,
        "stiffness_Nm_per_rad": {
            name: [number(low), number(high)]
            for name, low, high in zip(robot.joint_names, prior.low.tolist(), prior.high.tolist(), strict=True)
        },
    }


def _show(description: ModelDescription, masses: RobotMasses, prior: ArmClass) -> None:
    """Joints, limits, springs, masses and notes of one robot."""
    rows = []
    for joint, least, most in zip(description.joint, prior.low, prior.high, strict=True):
        low, high = np.degrees(joint.limits.si_array)
        usual = "" if joint.stiffness is not None else f"; class: {least:.2g} to {most:.2g} N m/rad"
        rows.append([joint.name, joint.coordinate, f"{low:g} to {high:g}", _spring(joint) + usual])
    show_table(f"{description.title}: joints", ["joint", "coordinate", "limits (deg)", "stiffness"], rows)
    for coupling in description.coupling:
        terms = " ".join(f"{t.factor:+g} {t.coordinate}" for t in coupling.terms)
        low, high = np.degrees(coupling.limits.si_array)
        offset = 0.0 if coupling.offset is None else np.degrees(coupling.offset.si)
        say(f"coupled limit {coupling.name}: {low:g} <= {offset:g} {terms} <= {high:g} deg ({coupling.limits.source})")
    if any(joint.stiffness is None for joint in description.joint):
        say(f"class: the range that arms of this size have ({prior.size}), a prior and no measurement of this arm")
    if description.controller is not None:
        for angle in description.controller.angle:
            terms = " ".join(f"{t.factor:+g} {t.axis}" for t in angle.terms)
            offset = 0.0 if angle.offset is None else np.degrees(angle.offset.si)
            say(f"controller: {angle.coordinate} = {offset:g} {terms}")
    if masses.links:
        _show_masses(description, masses)
    for note in description.notes:
        say(f"note: {note}")


def _show_masses(description: ModelDescription, masses: RobotMasses) -> None:
    """Table of masses: casings and what the file declares, up to the robot's own mass."""
    rows = [[link.name, *map(_kg, (link.casing.kg, link.rest_kg, link.declared_kg))] for link in masses.links]
    own = [] if masses.crank is None else [("bar", masses.bar_kg), ("crank", masses.crank.kg)]
    rows += [[name, _kg(mass), "", _kg(mass)] for name, mass in own]
    rows += [["all parts", "", "", _kg(masses.sum_kg)], ["the robot", "", "", _kg(masses.robot_kg)]]
    show_table(
        f"{description.title}: masses",
        ["part", "casing (kg)", "drives and the rest (kg)", "declared (kg)"],
        rows,
    )
    if own:
        say("bar and crank declare no mass: they weigh what their sections do")
    light = [link.name for link in masses.links if link.rest_kg is not None and link.rest_kg < 0.0]
    if light:
        say(f"warning: declared lighter than the casing: {', '.join(light)}")


def _kg(mass: float | None) -> str:
    return "-" if mass is None else f"{mass:.1f}"


def _spring(joint: Joint) -> str:
    if joint.stiffness is None:
        return "not given (rigid)"
    if isinstance(joint.stiffness, RotationalStiffness):
        return f"{joint.stiffness.si:.4g} N m/rad ({joint.stiffness.source})"
    return f"depends on {', '.join(joint.stiffness.inputs)}"
