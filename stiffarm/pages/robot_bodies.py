"""The drawn robot as bodies in the frames that they move with, for pages that pose it themselves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from meshes.beams import body_index
from robots import ModelDescription, Robot, forward_kinematics
from robots.arrays import Array, Integers
from robots.constants import M_TO_MM
from robots.frames import framed
from robots.kinematics import BodyFrames
from robots.robot import middle_pose
from stiffarm.pages.robot_drawing import DrawnBody, Role, draw_robot


class FramedBody(NamedTuple):
    """A body: name, colour role, number of its frame (:func:`frame_transforms`), triangles in m in that frame."""

    name: str
    role: Role
    frame: int
    vertices: Array
    triangles: Integers


def frame_transforms(robot: Robot, frames: BodyFrames, pose: int = 0) -> Array:
    """Frames of one pose as transforms (k, 4, 4): base, bodies, flange; with a parallelogram crank and bar too.

    Crank and lever stay parallel, so the crank has the driven body's orientation at its own joint; the bar stays
    parallel to the body between, and begins at the crank's pin.
    """
    R = np.concatenate([frames.R[pose], frames.R_flange[pose][None]])
    p = np.concatenate([frames.p[pose], frames.p_flange[pose][None]])
    para = robot.parallelogram
    if para is not None:
        own, driven = R[para.crank_about + 1], R[para.driven + 1]
        root = p[para.crank_about + 1]
        R = np.concatenate([R, driven[None], own[None]])
        p = np.concatenate([p, root[None], (root + driven @ para.pin)[None]])
    return framed(R, p)


def framed_bodies(description: ModelDescription, robot: Robot) -> list[FramedBody]:
    """The bodies of :func:`stiffarm.pages.robot_drawing.draw_robot` in the middle pose.

    That drawing turns the hub of the last wrist joint by how far the wrist is bent; here it stays as it is.
    """
    pose = middle_pose(robot)
    frames = forward_kinematics(robot, pose[None])
    transforms = frame_transforms(robot, frames)
    out = []
    for body in draw_robot(description, robot, pose):
        frame = _frame(description, robot, body)
        T = transforms[frame]
        vertices = (np.asarray(body.mesh.vertices) / M_TO_MM - T[:3, 3]) @ T[:3, :3]
        out.append(FramedBody(body.name, body.role, frame, vertices, np.asarray(body.mesh.faces, dtype=np.int64)))
    return out


def _frame(description: ModelDescription, robot: Robot, body: DrawnBody) -> int:
    """Number of the frame that a drawn body moves with."""
    crank = robot.dof + 2
    driven = 0 if robot.parallelogram is None else robot.parallelogram.driven + 1
    special = {"crank": crank, "crank pin": crank, "bar": crank + 1, "lever": driven, "lever pin": driven}
    if body.role in ("flange", "tool"):
        return robot.dof + 1
    if body.role == "base" or body.name == "base plate":
        return 0
    if body.role == "parallelogram" or (body.role == "joint" and body.name in special):
        return special[body.name]
    if body.role == "joint":
        return robot.joint_names.index(body.name) + 1
    if not description.link:
        return int(body.name.removeprefix("rod "))
    links = {link.name: body_index(robot, link.body) for link in description.link}
    # A link with bends is drawn in pieces: "forearm 1", "forearm 2".
    return links[body.name] if body.name in links else links[body.name.rpartition(" ")[0]]
