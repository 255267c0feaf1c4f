"""The robot's shape in a pose, for pictures: casings, joints, parallelogram and mounting plate.

Casings follow the description's centre lines and sections; how they are rounded off at the joints,
the base plate and the hubs are drawing only and enter no computation.
"""

from __future__ import annotations

import itertools
from types import MappingProxyType
from typing import Final, Literal, NamedTuple

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from meshes.beams import body_index
from meshes.sections import section_dimensions
from robots import InputError, ModelDescription, Robot, forward_kinematics, tool_position
from robots.arrays import Array
from robots.constants import M_TO_MM
from robots.kinematics import BodyFrames, moving_frames
from robots.robot import middle_pose
from robots.schema.description import BoxSection, Link, TubeSection

Role = Literal["base", "link", "joint", "parallelogram", "flange", "tool"]

# All near grey: colour in the picture means stiffness and nothing else.
ROBOT_COLOURS: Final = MappingProxyType(
    {
        "base": "#A3A9B0",
        "link": "#D3D6DA",
        "joint": "#6F757D",
        "parallelogram": "#93A5A8",
        "flange": "#3C4147",
        "tool": "#3C4147",
    }
)
_COINCIDENT_M = 1e-6
_ROUND = 32  # sides of a circle
_ROD = 0.03  # radius of a rod over the arm's size
_TRANSVERSE = 0.6  # below this cosine a joint axis counts as across the centre line


class DrawnBody(NamedTuple):
    """One piece of the picture: its name, its surface in mm in the base frame, what colour it takes.

    ``frame``: what it moves with, by its number in :func:`robots.kinematics.moving_frames`.
    """

    name: str
    mesh: trimesh.Trimesh
    role: Role
    frame: int


class _Outline(NamedTuple):
    """A section's outer size in m: ``width`` along the beam's y, ``height`` along its z."""

    width: float
    height: float
    round: bool


def draw_robot(description: ModelDescription, robot: Robot, pose: ArrayLike) -> list[DrawnBody]:
    """Surfaces of the robot in one pose; rods from joint to joint where its links have no sections (from a URDF).

    Parameters
    ----------
    description : links with sections, parallelogram
    robot : its kinematics
    pose : (dof,) joint coordinates in rad; limits are not checked

    Returns
    -------
    list of bodies, every mesh closed

    Raises
    ------
    InputError
        The pose has the wrong shape or is not finite.
    """
    q = np.asarray(pose, dtype=np.float64)
    if q.shape != (robot.dof,):
        raise InputError(
            f"pose to draw {robot.name} in", code="B002", value=f"shape {q.shape}", allowed=f"({robot.dof},)"
        )
    frames = forward_kinematics(robot, q[None])
    bodies = _base_plate(description)
    for link in description.link:
        bodies += _link(robot, frames, link)
    bodies += _joints(description, robot, frames)
    bodies += _parallelogram(description, robot, frames)
    bodies += _flange_and_tool(description, robot, frames)
    if not description.link:
        bodies += _rods(robot, frames)
    for body in bodies:
        body.mesh.vertices *= M_TO_MM
    return bodies


def framed_bodies(description: ModelDescription, robot: Robot) -> list[DrawnBody]:
    """The bodies of :func:`draw_robot` in the frames that they move with, in m, for pages that pose them themselves.

    The drawing turns the hub of the last wrist joint by how far the wrist is bent; here it stays as it is in the
    middle pose.
    """
    pose = middle_pose(robot)
    R, p = moving_frames(robot, pose[None])
    bodies = draw_robot(description, robot, pose)
    for body in bodies:
        body.mesh.vertices = (np.asarray(body.mesh.vertices) / M_TO_MM - p[0, body.frame]) @ R[0, body.frame]
    return bodies


def _outline(section: BoxSection | TubeSection) -> _Outline:
    size = section_dimensions(section)
    if isinstance(section, TubeSection):
        return _Outline(float(size[0]), float(size[0]), True)
    return _Outline(float(size[0]), float(size[1]), False)


def _direction(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


def _cylinder(centre: Array, axis: Array, radius: float, length: float) -> trimesh.Trimesh:
    half = 0.5 * length * _direction(axis)
    mesh: trimesh.Trimesh = trimesh.creation.cylinder(
        radius=radius, sections=_ROUND, segment=np.stack([centre - half, centre + half])
    )
    return mesh


def _profile(centre: Array, normal: Array, up: Array, outline: _Outline) -> Array:
    """Points on the outline (rounded at the corners) in the plane across ``normal``."""
    z = up - (up @ normal) * normal
    if np.linalg.norm(z) < 1e-6:
        z = np.cross(normal, [0.0, 1.0, 0.0] if abs(normal[1]) < 0.9 else [1.0, 0.0, 0.0])
    z = _direction(z)
    y = np.cross(z, normal)
    a = np.linspace(0.0, 2.0 * np.pi, 4 * _ROUND // 2, endpoint=False) + np.pi / (2 * _ROUND)
    radius = 0.5 * min(outline.width, outline.height) * (1.0 if outline.round else 0.35)
    flat_y = np.sign(np.cos(a)) * (0.5 * outline.width - radius)
    flat_z = np.sign(np.sin(a)) * (0.5 * outline.height - radius)
    across = flat_y + radius * np.cos(a), flat_z + radius * np.sin(a)
    return np.asarray(centre + across[0][:, None] * y + across[1][:, None] * z)


def _rounded_end(centre: Array, axis: Array, along: Array, outline: _Outline, up: Array) -> Array:
    """Points of a link's end at a joint: a hub across the link, or a flat face across the axis."""
    if abs(axis @ along) < _TRANSVERSE:
        width, height = outline.width, outline.height
        if abs(_direction(up) @ axis) > _TRANSVERSE:
            width, height = height, width
        return np.asarray(_cylinder(centre, axis, 0.5 * height, width).vertices)
    normal = axis if axis @ along > 0 else -axis
    return _profile(centre, normal, up, outline)


def _hull(*parts: Array) -> trimesh.Trimesh:
    mesh: trimesh.Trimesh = trimesh.convex.convex_hull(np.vstack(parts))
    return mesh


def _mixed(a: _Outline, b: _Outline, t: float) -> _Outline:
    return _Outline(a.width + t * (b.width - a.width), a.height + t * (b.height - a.height), a.round)


def _next_origin(robot: Robot, frames: BodyFrames, body: int) -> tuple[Array, int]:
    """Where a body's link ends (3,) and the index of the joint there (dof at the flange)."""
    for j in range(body + 1, robot.dof + 1):
        if np.linalg.norm(frames.p[0, j] - frames.p[0, body]) > _COINCIDENT_M:
            return frames.p[0, j], j - 1
    return frames.p_flange[0], robot.dof


def _link(robot: Robot, frames: BodyFrames, link: Link) -> list[DrawnBody]:
    body = body_index(robot, link.body)
    R, p = frames.R[0, body], frames.p[0, body]
    tip, joint = _next_origin(robot, frames, body)
    path = np.stack([p, *[p + R @ via.si_array for via in link.via], tip])
    steps = np.diff(path, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    if not (lengths > _COINCIDENT_M).all():
        return []
    start = _outline(link.section)
    end = start if link.section_end is None else _outline(link.section_end)
    up = R @ np.array(link.beam_up)
    own_axis = frames.axis[0, body - 1] if body > 0 else _direction(steps[0])
    tip_axis = frames.axis[0, joint] if joint < robot.dof else frames.R_flange[0][:, 2]
    fractions = np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum()
    pieces: list[DrawnBody] = []
    for i, step in enumerate(steps):
        along = _direction(step)
        axes = own_axis, (tip_axis if i == len(steps) - 1 else own_axis)
        # An oblique segment (a carousel reaching up and forward) gets a flat foot across its own axis.
        ends = [_rounded_end(path[i + k], axes[k], along, _mixed(start, end, fractions[i + k]), up) for k in (0, 1)]
        name = link.name if len(steps) == 1 else f"{link.name} {i + 1}"
        pieces.append(DrawnBody(name, _hull(*ends), "base" if body == 0 else "link", body))
    return pieces


def _base_plate(description: ModelDescription) -> list[DrawnBody]:
    radius = 0.68 * max((_outline(k.section).width for k in description.link if k.body == "base"), default=0.3)
    thickness = 0.04
    plate = _cylinder(np.array([0.0, 0.0, 0.5 * thickness]), np.array([0.0, 0.0, 1.0]), radius, thickness)
    return [DrawnBody("base plate", plate, "joint", 0)]


def _rods(robot: Robot, frames: BodyFrames) -> list[DrawnBody]:
    """A rod from each joint that is not where the next one is: ``rod 0`` moves with the base, ``rod 1`` with body 1."""
    line = np.vstack([frames.p[0], frames.p_flange, tool_position(robot, frames)])
    radius = _ROD * float(np.ptp(line, axis=0).max())
    rods = []
    for i, ends in enumerate(itertools.pairwise(line)):
        if np.linalg.norm(ends[1] - ends[0]) > 1e-3 * radius:
            rod = trimesh.creation.cylinder(radius=radius, sections=_ROUND, segment=np.stack(ends))
            rods.append(DrawnBody(f"rod {i}", rod, "link", i))
    return rods


def _size_at(description: ModelDescription, robot: Robot, frames: BodyFrames, joint: int) -> _Outline:
    """Return the larger outline of the links that meet at a joint."""
    here = frames.p[0, joint + 1]
    met: list[_Outline] = []
    for link in description.link:
        body = body_index(robot, link.body)
        tip, _ = _next_origin(robot, frames, body)
        end = link.section if link.section_end is None else link.section_end
        if body > 0 and np.linalg.norm(frames.p[0, body] - here) < _COINCIDENT_M:
            met.append(_outline(link.section))
        if np.linalg.norm(tip - here) < _COINCIDENT_M:
            met.append(_outline(end))
    if not met:
        return _Outline(0.2, 0.2, True)
    return _Outline(max(o.width for o in met), max(o.height for o in met), True)


def _arrival(robot: Robot, frames: BodyFrames, joint: int) -> Array:
    """Direction in which the chain arrives at a joint (unit vector)."""
    here = frames.p[0, joint + 1]
    for j in range(joint, -1, -1):
        step = here - frames.p[0, j]
        if np.linalg.norm(step) > _COINCIDENT_M:
            return _direction(step)
    return np.asarray(frames.axis[0, joint])


def _joints(description: ModelDescription, robot: Robot, frames: BodyFrames) -> list[DrawnBody]:
    """Make a hub for each joint across the arm, a collar for each joint along it."""
    hubs = []
    for joint, name in enumerate(robot.joint_names):
        axis, centre = frames.axis[0, joint], frames.p[0, joint + 1]
        size = _size_at(description, robot, frames, joint)
        if abs(axis @ _arrival(robot, frames, joint)) < _TRANSVERSE:
            mesh = _cylinder(centre, axis, 0.40 * size.height, 1.16 * size.width)
        else:
            mesh = _cylinder(centre, axis, 0.54 * size.width, 0.14 * size.width)
        hubs.append(DrawnBody(name, mesh, "joint", joint + 1))
    return hubs


def _parallelogram(description: ModelDescription, robot: Robot, frames: BodyFrames) -> list[DrawnBody]:
    """Crank, lever and bar: a parallelogram, so crank and lever stand in the same direction."""
    p = robot.parallelogram
    if p is None or description.parallelogram is None:
        return []
    axis = frames.axis[0, p.driven]
    lever = frames.R[0, p.driven + 1] @ p.pin
    crank_joint, driven_joint = frames.p[0, p.crank_about + 1], frames.p[0, p.driven + 1]
    crank_pin, lever_pin = crank_joint + lever, driven_joint + lever
    crank = _outline(description.parallelogram.crank)
    bar = _outline(description.parallelogram.bar)

    def arm(root: Array, pin: Array) -> trimesh.Trimesh:
        return _hull(
            np.asarray(_cylinder(root, axis, 0.65 * crank.height, crank.width).vertices),
            np.asarray(_cylinder(pin, axis, 0.42 * crank.height, crank.width).vertices),
        )

    rod = _cylinder(
        0.5 * (crank_pin + lever_pin),
        lever_pin - crank_pin,
        0.5 * bar.width,
        float(np.linalg.norm(lever_pin - crank_pin)),
    )
    pins = [_cylinder(x, axis, 0.28 * crank.height, 1.5 * crank.width) for x in (crank_pin, lever_pin)]
    return [
        DrawnBody("crank", arm(crank_joint, crank_pin), "parallelogram", robot.dof + 2),
        DrawnBody("lever", arm(driven_joint, lever_pin), "parallelogram", p.driven + 1),
        DrawnBody("bar", rod, "parallelogram", robot.dof + 3),
        DrawnBody("crank pin", pins[0], "joint", robot.dof + 2),
        DrawnBody("lever pin", pins[1], "joint", p.driven + 1),
    ]


def _flange_and_tool(description: ModelDescription, robot: Robot, frames: BodyFrames) -> list[DrawnBody]:
    centre, R = frames.p_flange[0], frames.R_flange[0]
    last = [k for k in description.link if body_index(robot, k.body) == robot.dof]
    width = max((_outline(k.section).width for k in last), default=0.12)
    plate = _cylinder(centre - 0.0105 * R[:, 2], R[:, 2], 0.6 * width, 0.025)
    bodies = [DrawnBody("mounting plate", plate, "flange", robot.dof + 1)]
    tip = tool_position(robot, frames)[0]
    if np.linalg.norm(tip - centre) > 0.01:
        root = np.asarray(_cylinder(centre, R[:, 2], 0.3 * width, 0.01).vertices)
        end = np.asarray(trimesh.creation.icosphere(subdivisions=1, radius=0.06 * width).vertices) + tip
        bodies.append(DrawnBody("tool", _hull(root, end), "tool", robot.dof + 1))
    return bodies
