"""How a controller counts the joints of an arm: sign and zero of each, its base and flange frame, and its sides.

What the configurations of all controllers are made of are the sides of the same three singularities of an arm with a
spherical wrist. They come from :func:`robots.inverse.singularities.configuration`, so that they hold for arms with an
offset at the elbow too.
"""

from __future__ import annotations

from importlib.resources import files
from typing import Literal

import numpy as np
from pydantic import Field

from machining.cell.reading import frame
from machining.cell.schema import Placed, Strict
from robots import InputError, Robot
from robots.arrays import Array, Bools
from robots.controller import ArmController
from robots.files.reading import parse_toml
from robots.files.validated import tuples, validated
from robots.frames import rpy_of
from robots.inverse.singularities import configuration
from robots.inverse.spherical_wrist import spherical_wrist_arm, why_not_spherical
from robots.library.models import library_table

SCHEMA: Literal["stiffarm-controller-arm/1"] = "stiffarm-controller-arm/1"


class Convention(Strict):
    """A controller's angle is ``sign`` times this project's plus ``offset_deg``; frames as in cell files.

    ``matrix``: where angles are coupled, a row of factors for each of the controller's angles, in place of ``sign``.

    ``base``: the controller's robot frame in the robot's base frame; left out where it is not known. ``flange``: the
    controller's flange frame in the robot's. ``external_sign`` and ``external_offset`` (mm, deg) likewise for linear
    axes and turntable, in that order; left out where they are as in this project.
    """

    schema_version: Literal["stiffarm-controller-arm/1"] = Field(default=SCHEMA, alias="schema")
    robot: str = ""
    formats: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    sign: tuple[Literal[-1, 1], ...]
    offset_deg: tuple[float, ...]
    matrix: tuple[tuple[float, ...], ...] = ()
    base: Placed | None = None
    flange: Placed = Placed()
    external_sign: tuple[Literal[-1, 1], ...] = ()
    external_offset: tuple[float, ...] = ()

    @property
    def T_base(self) -> Array | None:  # noqa: N802 - letters of the matrix
        """Transform (4, 4) m of ``base``; None: not known."""
        return None if self.base is None else frame(self.base)

    @property
    def T_flange(self) -> Array:  # noqa: N802
        """Transform (4, 4) m of ``flange``."""
        return frame(self.flange)

    def controller_deg(self, q: Array) -> Array:
        """Angles (n, dof) deg as the controller counts them, of q (n, dof) rad."""
        if self.matrix:
            return np.asarray(np.degrees(q) @ np.array(self.matrix).T + self.offset_deg)
        return np.asarray(np.degrees(q) * self.sign + self.offset_deg)

    def radians(self, controller_deg: Array) -> Array:
        """Angles q (n, dof) rad of the controller's (n, dof) deg."""
        if self.matrix:
            return np.asarray(np.radians(np.linalg.solve(self.matrix, (controller_deg - self.offset_deg).T).T))
        return np.asarray(np.radians((controller_deg - self.offset_deg) * self.sign))

    def external(self, values: Array) -> Array:
        """External axes (n, k) mm and deg as the controller counts them."""
        return np.asarray(values * (self.external_sign or 1.0) + (self.external_offset or 0.0))

    def external_back(self, values: Array) -> Array:
        """External axes (n, k) mm and deg from the controller's."""
        return np.asarray((values - (self.external_offset or 0.0)) * (self.external_sign or 1.0))


def convention_for(robot: Robot, externals: int, language: str, given: Convention | None) -> Convention:
    """The convention given, else the bundled one of this robot and format, else that of the model's [controller].

    Raises
    ------
    InputError
        Neither is there, or its lists are not as long as the robot has joints.
    """
    known = [] if given is not None else _bundled()
    found = given or next((c for c in known if c.robot == robot.name and language in c.formats), None)
    if found is None and robot.controller is not None and language in robot.controller.formats:
        found = of_the_model(robot.controller, robot.name)
    if found is None:
        arms = {c.robot: c.formats for c in known} | {row["name"]: row["formats"] for row in library_table()}
        raise InputError(
            f"joint convention of {robot.name} on a controller for {language}",
            code="Q003",
            allowed="known for " + ", ".join(sorted(name for name, formats in arms.items() if language in formats)),
            remedy="give sign and offset_deg of each joint in [arm] of the file of --options, or formats "
            "in [controller] of the model file, or write json or csv",
        )
    rows = {("matrix", len(row)) for row in (found.matrix, *found.matrix) if found.matrix}
    for name, count in (("sign", len(found.sign)), ("offset_deg", len(found.offset_deg)), *rows):
        if count != robot.dof:
            raise InputError(f"[arm] {name}", code="Q003", value=count, allowed=f"{robot.dof} numbers, one a joint")
    for name, count in (
        ("external_sign", len(found.external_sign)),
        ("external_offset", len(found.external_offset)),
    ):
        if count not in (0, externals):
            allowed = f"{externals} numbers: linear axes, then the turntable"
            raise InputError(f"[arm] {name}", code="Q003", value=count, allowed=allowed)
    return found


def of_the_model(controller: ArmController, name: str) -> Convention:
    """The [controller] table of a model file as a convention."""
    back, dof = np.linalg.inv(controller.matrix), len(controller.names)
    coupled = bool(controller.coupled) or not np.array_equal(np.abs(back), np.eye(dof))
    return Convention(
        robot=name,
        sign=tuple(1 if coupled or back[i, i] > 0.0 else -1 for i in range(dof)),
        offset_deg=tuple(np.degrees(-back @ controller.offset).tolist()),
        matrix=tuple(map(tuple, back.tolist())) if coupled else (),
        base=None if controller.T_base is None else _placed(controller.T_base),
        flange=_placed(controller.T_flange),
    )


def _placed(T: Array) -> Placed:
    x, y, z = (T[:3, 3] * 1e3).tolist()
    roll, pitch, yaw = np.degrees(rpy_of(T[:3, :3])).tolist()
    return Placed(position_mm=(x, y, z), rpy_deg=(roll, pitch, yaw))


def _bundled() -> list[Convention]:
    """The bundled conventions."""
    folder = files("machining.programs") / "conventions"
    found = sorted((f for f in folder.iterdir() if f.name.endswith(".toml")), key=lambda f: f.name)
    tables = {f.name: parse_toml(f.read_text(encoding="utf-8"), f.name) for f in found}
    return [validated(Convention, tuples(table), name) for name, table in tables.items()]


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
            code="R004",
            allowed="arms with a spherical wrist",
            remedy="write the joint program",
        )
    shoulder, elbow, _ = configuration(spherical_wrist_arm(robot), robot, q)
    wrist = controller_deg[:, 4] - 360.0 * np.round(controller_deg[:, 4] / 360.0)
    return shoulder < 0.0, elbow < 0.0, wrist < 0.0
