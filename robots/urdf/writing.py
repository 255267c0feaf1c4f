"""A URDF of an arm with its calibrated geometry: joints' frames and zeros as they really are.

Each link's frame is where its joint turns (after the joint's angle), so a joint's ``origin`` has everything up to its
axis: the errors of its frame, its design offset and its zero error. A URDF's joint turns by its value alone: ratios,
couplings and error curves of joints have no place in it (:meth:`robots.joint_errors.JointErrors.turned` gives the
values to move it by).
"""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from robots.arrays import Array
from robots.frames import framed, rotation_rpy, rpy_of
from robots.robot import Robot


def real_frame(robot: Robot, joint: int) -> Array:
    """Frame (4, 4) m of a joint in the body before it, with its errors: z is its axis, its angle not turned yet."""
    pre = robot.T_pre[joint]
    if robot.errors is None:
        return np.asarray(pre)
    error = robot.errors.frames[joint]
    turn = Rotation.from_rotvec([error[3], error[4], 0.0]).as_matrix()
    return np.asarray(pre @ framed(turn, error[:3]))


def urdf_text(robot: Robot, points: Mapping[str, Array] | None = None, comment: str = "") -> str:
    """The arm as URDF text: joints, limits, ``flange``, ``tool0`` where the model has a tool, no shapes and no masses.

    ``points`` (3,) m in the flange frame by the name of a link of their own, as targets of a tracker.
    """
    root = ET.Element("robot", name=robot.name)
    if comment:
        root.append(ET.Comment(f" {comment.replace('--', '- -')} "))
    ET.SubElement(root, "link", name="base_link")
    parent, after = "base_link", np.eye(4)
    for j, name in enumerate(robot.joint_names):
        turn = framed(rotation_rpy(np.array([0.0, 0.0, robot.offset[j]])), np.zeros(3))
        child = f"{name}_link"
        joint = _joint(root, name, "revolute", parent, child, after @ real_frame(robot, j) @ turn)
        ET.SubElement(joint, "axis", xyz=f"0 0 {int(robot.sign[j])}")
        low, high = robot.limits[j]
        # Effort and speed are required and not known here; 0 stands for that.
        ET.SubElement(joint, "limit", lower=f"{low:.17g}", upper=f"{high:.17g}", effort="0", velocity="0")
        parent, after = child, framed(robot.R_post[j], np.zeros(3))
    _joint(root, "flange_joint", "fixed", parent, "flange", after @ robot.T_last_flange)
    for name, point in (points or {}).items():
        _joint(root, f"{name}_joint", "fixed", "flange", name, framed(np.eye(3), np.asarray(point)))
    if not np.array_equal(robot.T_flange_tool, np.eye(4)):
        _joint(root, "tool0_joint", "fixed", "flange", "tool0", robot.T_flange_tool)
    ET.indent(root)
    return '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _joint(root: ET.Element, name: str, kind: str, parent: str, child: str, T: Array) -> ET.Element:
    ET.SubElement(root, "link", name=child)
    joint = ET.SubElement(root, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    xyz, rpy = (" ".join(f"{v:.17g}" for v in row) for row in (T[:3, 3], rpy_of(T[:3, :3])))
    ET.SubElement(joint, "origin", xyz=xyz, rpy=rpy)
    return joint
