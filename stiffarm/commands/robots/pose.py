"""Where the tool is at a pose, as controllers show it: for comparison with a pendant."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from machining.programs.orientation import SPOKEN
from robots import ModelDescription, Robot, forward_kinematics
from robots.arrays import Array
from robots.controller import shown_base, shown_tool
from robots.frames import inverse
from robots.quantities import angle, rounded_all
from robots.robot import robot_from
from stiffarm.result import Result, Table
from stiffarm.session.outputs import OutputFolder

# Quaternions and vectors of rotation are shown with so many decimals, angles in deg with fewer.
DECIMALS = {"abb": 5, "ur": 5}


def of_pose(description: ModelDescription, robot: Robot, q: Array) -> Result:
    """The tool frame at q (dof,) rad, in the controller's robot frame and in the model's base frame."""
    T = forward_kinematics(robot, q[None]).T_flange[0] @ shown_tool(robot)
    seen = inverse(shown_base(robot)) @ T
    point = "flange" if description.tool is None else "tool"
    spoken = {one.code: one.orientation.write(seen[None, :3, :3])[0] for one in SPOKEN}
    facts: dict[str, Any] = {
        "robot": description.name,
        "pose_deg": _named(robot.coordinates, np.degrees(q)),
        "point": point,
        "position_mm": rounded_all(_plain(1e3 * seen[:3, 3], 4), 12),
        "base_position_mm": rounded_all(_plain(1e3 * T[:3, 3], 4), 12),
        "orientation": {one.code: _named(one.columns, spoken[one.code]) for one in SPOKEN},
    }
    remarks = []
    if robot.controller is not None and robot.controller.names != robot.coordinates:
        shown = robot.controller.controller(q[None])[0]
        facts["controller_deg"] = _named(robot.controller.names, np.degrees(shown))
        remarks.append(f"on the controller: {_listed(robot.controller.names, shown)}")
    rows = [("position, mm", "x y z", _figures(1e3 * seen[:3, 3], 3))]
    if not np.allclose(T[:3, 3], seen[:3, 3], rtol=0.0, atol=1e-9):
        rows.append(("position in the model's base frame, mm", "x y z", _figures(1e3 * T[:3, 3], 3)))
    rows += [
        (
            one.words,
            " ".join(c.partition("_")[0] for c in one.columns),
            _figures(spoken[one.code], DECIMALS.get(one.code, 3)),
        )
        for one in SPOKEN
    ]
    labels = dict(zip(("what", "in_this_order", "values"), map(list, zip(*rows, strict=True)), strict=True))
    return Result(
        name="pose",
        title=description.title,
        question="where is the tool?",
        answer=f"{description.title}: {point} at {_listed(robot.coordinates, q)}.",
        facts=facts,
        tables=(Table("frame", "In the controller's robot frame", labels, {}, is_extract=True),),
        remarks=tuple(remarks),
        caution="",
        more=partial(_picture, description, q),
    )


def _picture(description: ModelDescription, q: Array, folder: OutputFolder) -> Mapping[str, Any]:
    from stiffarm.pages.pose_pictures import pose_pictures

    (text,) = pose_pictures(description, robot_from(description), q[None], None)
    folder.path("pose.png").write_bytes(base64.b64decode(text))
    return {}


def _plain(values: Array, digits: int) -> list[float]:
    plain: list[float] = (np.round(values, digits) + 0.0).tolist()
    return plain


def _named(names: tuple[str, ...], values: Array) -> dict[str, Any]:
    return dict(zip(names, rounded_all(_plain(values, 6), 12), strict=True))


def _listed(names: tuple[str, ...], q: Array) -> str:
    shown = zip(names, q, strict=True)
    return ", ".join(f"{name.removesuffix('_deg')} = {angle(name).text(v, unit=True)}" for name, v in shown)


def _figures(values: Array, digits: int) -> str:
    """Numbers to type in at a pendant: all decimals, and a minus sign that it knows."""
    return "  ".join(f"{value:.{digits}f}" for value in _plain(values, digits))
