"""How a controller counts the joints of an arm: sign and zero of each, its base and flange frame, and its sides.

What the configurations of all controllers are made of are the sides of the same three singularities of an arm with a
spherical wrist. They come from :func:`robots.inverse.singularities.configuration`, so that they hold for arms with an
offset at the elbow too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any, Literal

import numpy as np
from pydantic import Field

from machining.cell.reading import frame
from machining.cell.schema import Placed, Strict
from robots import InputError, Robot
from robots.arrays import Array, Bools
from robots.files.reading import parse_toml
from robots.files.validated import tuples, validated
from robots.inverse.singularities import configuration
from robots.inverse.spherical_wrist import spherical_wrist_arm, why_not_spherical

SCHEMA: Literal["stiffarm-controller-arm/1"] = "stiffarm-controller-arm/1"


class ConventionTable(Strict):
    """A controller's angle is ``sign`` times this project's plus ``offset_deg``; frames as in cell files.

    ``base``: the controller's robot frame in the robot's base frame; left out where it is not known. ``flange``: the
    controller's flange frame in the robot's. ``external_sign`` and ``external_offset`` (mm, deg) likewise for linear
    axes and turntable, in that order.
    """

    schema_version: Literal["stiffarm-controller-arm/1"] = Field(default=SCHEMA, alias="schema")
    robot: str = ""
    formats: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    sign: tuple[Literal[-1, 1], ...]
    offset_deg: tuple[float, ...]
    base: Placed | None = None
    flange: Placed = Placed()
    external_sign: tuple[Literal[-1, 1], ...] = ()
    external_offset: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Convention:
    """Sign and offset (deg) of joints (dof,) and external axes (k,), frames (4, 4) m; ``T_base`` None: not known."""

    sign: Array
    offset: Array
    T_base: Array | None
    T_flange: Array
    external_sign: Array
    external_offset: Array

    def controller_deg(self, q: Array) -> Array:
        """Angles (n, dof) deg as the controller counts them, of q (n, dof) rad."""
        return np.asarray(self.sign * np.degrees(q) + self.offset)

    def radians(self, controller_deg: Array) -> Array:
        """Angles q (n, dof) rad of the controller's (n, dof) deg."""
        return np.asarray(np.radians(self.sign * (controller_deg - self.offset)))

    def external(self, values: Array) -> Array:
        """External axes (n, k) mm and deg as the controller counts them."""
        return np.asarray(self.external_sign * values + self.external_offset)

    def external_back(self, values: Array) -> Array:
        """External axes (n, k) mm and deg from the controller's."""
        return np.asarray(self.external_sign * (values - self.external_offset))


def convention_for(robot: Robot, externals: int, language: str, given: ConventionTable | None) -> Convention:
    """The convention given, else the bundled one of this robot and format.

    Raises
    ------
    InputError
        Neither is there, or its lists are not as long as the robot has joints.
    """
    known = [] if given is not None else _bundled()
    table = given or next((t for t in known if t.robot == robot.name and language in t.formats), None)
    if table is None:
        raise InputError(
            f"joint convention of {robot.name} on a controller for {language}",
            allowed="known for " + ", ".join(f"{t.robot} ({', '.join(t.formats)})" for t in known),
            remedy="give sign and offset_deg of each joint in [arm] of the options, or write json or csv",
        )
    for name, wanted in (("sign", robot.dof), ("offset_deg", robot.dof)):
        if len(getattr(table, name)) != wanted:
            raise InputError(f"[arm] {name}", value=len(getattr(table, name)), allowed=f"{wanted} numbers, one a joint")
    for name in ("external_sign", "external_offset"):
        if len(getattr(table, name)) not in (0, externals):
            allowed = f"{externals} numbers: linear axes, then the turntable"
            raise InputError(f"[arm] {name}", value=len(getattr(table, name)), allowed=allowed)
    return Convention(
        np.array(table.sign, dtype=np.float64),
        np.array(table.offset_deg),
        None if table.base is None else frame(table.base),
        frame(table.flange),
        np.array(table.external_sign or (1,) * externals, dtype=np.float64),
        np.array(table.external_offset or (0.0,) * externals),
    )


def _bundled() -> list[ConventionTable]:
    """The bundled conventions."""
    folder = files("machining.programs") / "conventions"
    found = sorted((f for f in folder.iterdir() if f.name.endswith(".toml")), key=lambda f: f.name)
    return [convention_table(parse_toml(f.read_text(encoding="utf-8"), f.name), f.name) for f in found]


def convention_table(data: Mapping[str, Any], where: str) -> ConventionTable:
    """Check a table of a TOML file.

    Raises
    ------
    InputError
        A key that does not fit.
    """
    return validated(ConventionTable, tuples(data), where)


def sides(robot: Robot, q: Array, controller_deg: Array) -> tuple[Bools, Bools, Bools]:
    """Whether poses stand behind axis 1, with the elbow backwards, with controller axis 5 negative, (n,) each.

    ``q`` (n, 6) rad, ``controller_deg`` (n, 6) the same as the controller counts them.

    Raises
    ------
    InputError
        The robot has no spherical wrist.
    """
    why = why_not_spherical(robot)
    if why is not None:
        raise InputError(
            f"configuration of {robot.name} in a Cartesian program: {why}",
            allowed="arms with a spherical wrist",
            remedy="write the joint program",
        )
    shoulder, elbow, _ = configuration(spherical_wrist_arm(robot), robot, q)
    wrist = controller_deg[:, 4] - 360.0 * np.round(controller_deg[:, 4] / 360.0)
    return shoulder < 0.0, elbow < 0.0, wrist < 0.0
