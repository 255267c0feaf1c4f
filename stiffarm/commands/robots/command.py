"""The command `robots`: the bundled robots, or one with its figures and their sources."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
import typer

from doe import bundled_data
from meshes import RobotMasses, robot_masses
from robots import InputError, ModelDescription, bundled_names, load_description
from robots.robot import robot_from
from robots.schema.description import Joint
from robots.schema.quantities import RotationalStiffness
from stiffarm.session.console import say, show_table
from stiffarm.session.frame import command
from stiffarm.session.json_text import number
from stiffarm.session.options import Debug, Json


def robots(
    name: Annotated[
        str | None, typer.Argument(help="Show this robot in detail: a bundled name, a model TOML or a URDF.")
    ] = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """List the bundled robots, or show one in detail.

    Details are joint limits, stiffnesses and masses, with their sources.
    """
    with command(as_json=as_json, debug=debug) as frame:
        if name is not None:
            description = load_description(name)
            masses = robot_masses(description, robot_from(description))
            described = description.model_dump(mode="json", by_alias=True, exclude_none=True)
            frame.answer(described | {"masses": _masses_payload(masses)}, lambda: _show(description, masses))
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
        frame.answer({"robots": content}, lambda: show_table("Bundled robots", heads, rows))


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


def _show(description: ModelDescription, masses: RobotMasses) -> None:
    """Joints, limits, springs, masses and notes of one robot."""
    rows = []
    for joint in description.joint:
        low, high = np.degrees(joint.limits.si_array)
        rows.append([joint.name, joint.coordinate, f"{low:g} to {high:g}", _spring(joint)])
    show_table(f"{description.title}: joints", ["joint", "coordinate", "limits (deg)", "stiffness"], rows)
    for coupling in description.coupling:
        terms = " ".join(f"{t.factor:+g} {t.coordinate}" for t in coupling.terms)
        low, high = np.degrees(coupling.limits.si_array)
        offset = 0.0 if coupling.offset is None else np.degrees(coupling.offset.si)
        say(f"coupled limit {coupling.name}: {low:g} <= {offset:g} {terms} <= {high:g} deg ({coupling.limits.source})")
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
