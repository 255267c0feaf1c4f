"""Answers `robots check`: what is wrong between a model and the controller, in words and as JSON."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from robots import ModelDescription, Robot, require_positive
from robots.arrays import Array
from robots.frames import rpy_of
from robots.pendant.check import PendantCheck, check_pendant
from robots.pendant.explanations import Explanation
from robots.pendant.slips import Slip
from robots.robot import robot_from
from stiffarm.commands.robots import check_words as words
from stiffarm.commands.robots.pendant_table import read_pendant
from stiffarm.session.console import say, say_notes, show_table
from stiffarm.session.frame import Frame
from stiffarm.session.json_text import number

# Explanations that are written out.
MOST_TOLD = 4
# An offset this near to a quarter turn is one, rad.
QUARTER_rad = float(np.radians(0.05))
# A pitch this near to 90 deg leaves roll and yaw to one another, deg.
GIMBAL_deg = 0.05


def answer_check(frame: Frame, description: ModelDescription, model: str, table: Path, tolerance_mm: float) -> None:
    """Compare, say, and write check.json where there is a folder."""
    require_positive("--tolerance-mm", tolerance_mm, "mm", code="R007")
    robot = robot_from(description)
    readings, convention, remarks = read_pendant(table, robot, model)
    frame.files["pendant"] = table
    say_notes(remarks)
    found = check_pendant(robot, readings, 1e-3 * tolerance_mm)
    content = check_payload(description, robot, found, convention)
    with frame.folder_if() as folder:
        if folder is not None:
            from stiffarm.commands.robots.check_report import write_report

            folder.write_json("check.json", content)
            write_report(description, robot, found, content, folder)
    frame.answer(content, lambda: _show(description.title, content))


def check_payload(
    description: ModelDescription, robot: Robot, found: PendantCheck, convention: str | None
) -> dict[str, Any]:
    """The whole answer; ``verdict``: agrees, explained, orientation, misread or unexplained."""
    told = found.explanations[:MOST_TOLD]
    positions_agree = bool(told) and told[0].things == 0
    verdict = "agrees" if found.agrees else "orientation" if positions_agree else "explained" if told else "unexplained"
    verdict = "misread" if found.misread else verdict
    turned = None
    if (compared := found.orientation) is not None:
        turn = None if compared.tool_turn is None else _plain_rpy(compared.tool_turn)
        turned = {
            "convention": convention,
            "agrees_as": compared.convention,
            "largest_deg": number(float(np.degrees(compared.angle.max()))),
            "constant_tool_turn_rpy_deg": None if turn is None else turn.tolist(),
        }
    return {
        "robot": description.name,
        "verdict": verdict,
        "poses": len(found.readings.q),
        "tolerance_mm": number(1e3 * found.tolerance),
        "frame": "controller" if robot.controller is not None and robot.controller.T_base is not None else "base",
        "largest_mm": number(float(1e3 * found.distance.max())),
        "by_pose": _by_pose(robot, found),
        "still_joints": list(found.still),
        "misread_poses": list(found.misread),
        "orientation": turned,
        "explanations": [_explanation(robot, e) for e in told],
        "more_explanations": len(found.explanations) - len(told),
        "closest": None if told or found.misread else _explanation(robot, found.best),
    }


def _plain_rpy(R: Array) -> Array:
    """Roll, pitch and yaw (3,) deg; near a pitch of 90 deg, where they are shared out at will, with no roll."""
    roll, pitch, yaw = np.degrees(rpy_of(R))
    if abs(pitch) > 90.0 - GIMBAL_deg:
        yaw, roll = (yaw - np.sign(pitch) * roll + 180.0) % 360.0 - 180.0, 0.0
    return np.asarray(np.round([roll, pitch, yaw], 3) + 0.0)


def _by_pose(robot: Robot, found: PendantCheck) -> list[dict[str, Any]]:
    """Each pose: angles, what the controller shows, readings less model, and what the first explanation leaves."""
    then = np.linalg.norm(found.left if found.misread else found.best.fit.left, axis=1)
    given = found.readings
    return [
        {
            "pose": given.labels[k],
            "angles_deg": dict(
                zip(robot.coordinates, map(number, np.degrees(given.q[k]).round(6).tolist()), strict=True)
            ),
            "read_mm": [number(v) for v in (1e3 * given.position[k]).tolist()],
            "read_less_model_mm": [number(v) for v in ((1e3 * found.left[k]).round(6) + 0.0).tolist()],
            "distance_mm": number(float(1e3 * found.distance[k])),
            "then_mm": number(float(1e3 * then[k])),
        }
        for k in range(len(given.q))
    ]


def _explanation(robot: Robot, e: Explanation) -> dict[str, Any]:
    changes = [_slip(robot, slip, e.fit.sizes.get(slip.code)) for slip in e.chosen]
    changes += [_frame(name, e.fit.shift[name]) for name in e.frames]
    if not e.base_known:
        changes.append(
            {
                "code": "model-base",
                "size": None,
                "unit": None,
                "words": "positions are in the model's base frame, not in the controller's robot frame of the file",
                "remedy": "nothing, if the controller's world frame was set so; else read positions in its robot frame",
            }
        )
    return {"largest_mm": number(1e3 * e.fit.worst), "changes": changes}


def _slip(robot: Robot, slip: Slip, size: float | None) -> dict[str, Any]:
    words, remedy, unit = slip.words, slip.remedy, None
    if slip.kind == "offset" and size is not None:
        quarter = round(size / (0.5 * np.pi)) * 0.5 * np.pi
        size = quarter if abs(size - quarter) < QUARTER_rad else size
        degrees, unit = float(np.degrees(size)), "deg"
        name, total = robot.joint_names[slip.joint], float(np.degrees(robot.offset[slip.joint]))
        total = (total + robot.sign[slip.joint] * degrees + 180.0) % 360.0 - 180.0
        words = f"{name} counts from another zero: {degrees:+.4g} deg"
        remedy = f'in [[joint]] {name}: offset = {{ value = {total:.6g}, unit = "deg", source = "derived" }}'
        size = degrees
    elif slip.kind == "length" and size is not None:
        axis, joint = "xyz"[slip.along], robot.joint_names[slip.joint]
        words, unit, size = f"{words}: {1e3 * size:+.4g} mm", "mm", 1e3 * size
        remedy = f"check a, d or xyz of [[joint]] {joint} (here along {axis}) against the data sheet"
    return {
        "code": slip.code,
        "words": words,
        "size": None if size is None else number(size),
        "unit": unit,
        "remedy": remedy,
    }


def _frame(name: str, shift: Array) -> dict[str, Any]:
    words = {
        "base": "the controller's robot frame is elsewhere",
        "tool": "the tool point is elsewhere",
        "turned-base": "the controller's robot frame is elsewhere and turned",
    }[name]
    mm = (1e3 * shift[-3:]).round(3) + 0.0
    size: list[float] = mm.tolist()
    text = ", ".join(f"{v:g}" for v in size)
    if name == "tool":
        remedy = f"[tool] xyz: add [{text}] mm (flange axes), or choose the tool on the controller that the model has"
    elif name == "base":
        remedy = f"[controller] base xyz: add [{', '.join(f'{0.0 - v:g}' for v in size)}] mm"
    else:
        turn = np.degrees(shift[:3]).round(3) + 0.0
        text += f" mm, turned by {', '.join(f'{v:g}' for v in turn.tolist())} deg about the base's x, y, z"
        remedy = "set [controller] base to where the controller's robot frame is"
    shown = text if name == "turned-base" else f"{text} mm"
    return {"code": name, "words": f"{words}: by {shown}", "size": size, "unit": "mm", "remedy": remedy}


def _show(title: str, content: dict[str, Any]) -> None:
    say(words.headline(title, content))
    if content["verdict"] not in ("agrees", "orientation"):
        short = [[row[k] for k in words.SHORT] for row in (words.HEADS, *words.rows(content))]
        show_table("Difference as the model stands, and with what is named below put right", short[0], short[1:])
    for line in words.told(content):
        say(line)
