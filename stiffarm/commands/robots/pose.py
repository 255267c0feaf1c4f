"""Where the tool is at a pose, as controllers show it: for comparison with a pendant."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from machining.programs.orientation import SPOKEN
from robots import ModelDescription, Robot, forward_kinematics
from robots.arrays import Array
from robots.controller import shown_base, shown_tool
from robots.frames import inverse
from robots.quantities import rounded
from robots.robot import robot_from
from stiffarm.session.console import say, show_table
from stiffarm.session.frame import Frame
from stiffarm.session.parsing import parse_pose


def answer_pose(frame: Frame, description: ModelDescription, pose: str) -> None:
    """Answer `robots NAME --pose ...`; with a folder, a picture of the arm too."""
    robot = robot_from(description)
    q = parse_pose(robot, pose)
    content = pose_payload(description, robot, q)
    with frame.folder_if() as folder:
        if folder is not None:
            from stiffarm.pages.pose_pictures import pose_pictures

            folder.write_json("pose.json", content)
            folder.path("pose.png").write_bytes(base64.b64decode(pose_pictures(description, robot, q[None], None)[0]))
    frame.answer(content, lambda: _show(description, content))


def pose_payload(description: ModelDescription, robot: Robot, q: Array) -> dict[str, Any]:
    """The tool frame at q (dof,) rad, in the controller's robot frame and in the model's base frame."""
    T = forward_kinematics(robot, q[None]).T_flange[0] @ shown_tool(robot)
    seen = inverse(shown_base(robot)) @ T
    content: dict[str, Any] = {
        "robot": description.name,
        "pose_deg": _named(robot.coordinates, np.degrees(q)),
        "point": "flange" if description.tool is None else "tool",
        "position_mm": _rounded(seen[:3, 3] * 1e3),
        "base_position_mm": _rounded(T[:3, 3] * 1e3),
        "orientation": {
            spoken.code: dict(
                zip(spoken.columns, _rounded(spoken.orientation.write(seen[None, :3, :3])[0], 6), strict=True)
            )
            for spoken in SPOKEN
        },
    }
    if robot.controller is not None and robot.controller.names != robot.coordinates:
        shown = np.degrees(robot.controller.controller(q[None])[0])
        content["controller_deg"] = _named(robot.controller.names, shown)
    return content


def _named(names: tuple[str, ...], values: Array) -> dict[str, Any]:
    return dict(zip(names, _rounded(values, 6), strict=True))


def _rounded(values: Array, digits: int = 4) -> list[Any]:
    return [rounded(v, 12) for v in (np.round(values, digits) + 0.0).tolist()]


def _show(description: ModelDescription, content: dict[str, Any]) -> None:
    say(f"{description.title}: {content['point']} at " + _listed(content["pose_deg"]))
    if "controller_deg" in content:
        say("on the controller: " + _listed(content["controller_deg"]))
    rows = [["position (mm)", "x y z", _figures(content["position_mm"], 3)]]
    if content["base_position_mm"] != content["position_mm"]:
        rows.append(["position in the model's base frame (mm)", "x y z", _figures(content["base_position_mm"], 3)])
    for spoken in SPOKEN:
        values = content["orientation"][spoken.code]
        names = " ".join(name.partition("_")[0] for name in values)
        rows.append([spoken.words, names, _figures(list(values.values()), 5 if spoken.code in ("abb", "ur") else 3)])
    show_table("In the controller's robot frame", ["what", "in this order", "values"], rows)


def _listed(angles: dict[str, float]) -> str:
    return ", ".join(f"{name.removesuffix('_deg')} = {value:g} deg" for name, value in angles.items())


def _figures(values: list[float], digits: int) -> str:
    return "  ".join(f"{value:.{digits}f}" for value in values)
