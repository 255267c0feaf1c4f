"""What each part of the arm carries: the wrench ``s = T(q) w`` for a wrench w at the tool.

The arm is statically determinate, so statics alone gives T. With a parallelogram the forearm's moment
about the elbow goes down the pinned bar to the third actuator, so joint 2 does not feel it; the bar's
force is one number N = row . w, and every part between the bar's ends carries it on top.
Arrays follow :mod:`fem.statics.vectors`: poses along the last axis.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np

from fem.model import ArmModel, LinkPart
from fem.statics.vectors import constant_times, cross, dot, poses_last, scaled, times_constant, to_base, to_local
from robots import InputError, Robot
from robots.arrays import Array
from robots.kinematics import BodyFrames, tool_position

# Below this sine of the angle between bar and lever the parallelogram is flat and carries nothing.
FLAT_SINE = 1e-3


@dataclass(frozen=True)
class Along:
    """What follows one force or torque: ``s = column (row . w)``; row (6, n), column (s, n) or (1, 1)."""

    row: Array
    column: Array

    def carried(self, w: Array) -> Array:
        """``T w`` (s, n)."""
        return scaled(self.column, dot(self.row, w))

    def displacement(self, h: Array) -> Array:
        """``T^T h`` (6, n)."""
        return scaled(self.row, dot(self.column, h))

    def matrix(self) -> Array:
        """T (s, 6, n)."""
        return np.asarray(self.column[:, None] * self.row)


@dataclass(frozen=True)
class Moved:
    """The whole wrench moved to a point: local axes R (3, 3, n); lever r (3, n) from there to the tool."""

    R: Array
    r: Array

    def carried(self, w: Array) -> Array:
        """``T w`` (6, n)."""
        force, moment = w[:3], w[3:] + cross(self.r, w[:3])
        return np.concatenate([to_local(self.R, force), to_local(self.R, moment)])

    def displacement(self, h: Array) -> Array:
        """``T^T h`` (6, n)."""
        turn = to_base(self.R, h[3:])
        return np.concatenate([to_base(self.R, h[:3]) + cross(turn, self.r), turn])

    def matrix(self) -> Array:
        """T (6, 6, n)."""
        T = np.zeros((6, 6, self.R.shape[2]))
        for k in range(3):
            axis = self.R[:, k]
            T[k, :3] = T[3 + k, 3:] = axis
            T[3 + k, :3] = cross(axis, self.r)
        return T


@dataclass(frozen=True)
class Transfer:
    """A compliant part: it carries ``s = T w``; deformed by h it moves the tool by ``d = T^T h``.

    T (s, 6) is never formed. Its first six rows are ``moved``; ``along`` comes on top (one may be None).
    ``compliance``: (s, s), or where it depends on the pose (n,) for a single spring, (s, s, n) for another part.
    ``joint``: index of the joint if the part is the spring about that joint's axis, else None.
    """

    name: str
    compliance: Array
    moved: Moved | None = None
    along: Along | None = None
    joint: int | None = None

    def carried(self, w: Array) -> Array:
        """Wrench, force or torque (s, n) in the part under ``w``, (6, n) or (6, 1), at the tool."""
        if self.along is None:
            assert self.moved is not None  # noqa: S101 - a part carries something
            return self.moved.carried(w)
        s = self.along.carried(w)
        if self.moved is not None:
            s[:6] += self.moved.carried(w)
        return s

    def deformation(self, s: Array) -> Array:
        """Deformation (s, n) of the part under what it carries."""
        if self.compliance.ndim == 3:
            return np.asarray(np.einsum("ijn,j...n->i...n", self.compliance, s))
        return s * self.compliance if self.compliance.ndim == 1 else constant_times(self.compliance, s)

    def displacement(self, h: Array) -> Array:
        """Displacement (6, n) of the tool point by the part's deformation ``h`` (s, n)."""
        if self.along is None:
            assert self.moved is not None  # noqa: S101 - as above
            return self.moved.displacement(h)
        d = self.along.displacement(h)
        return d if self.moved is None else d + self.moved.displacement(h[:6])

    def matrix(self) -> Array:
        """T (s, 6, n) in full, where six unit wrenches at once are cheaper than one after the other."""
        if self.along is None:
            assert self.moved is not None  # noqa: S101 - as above
            return self.moved.matrix()
        T = self.along.matrix()
        if self.moved is not None:
            T[:6] += self.moved.matrix()
        return T

    def share(self, w: Array) -> Array:
        """Displacement (6, n) of the tool point that this part contributes under ``w``."""
        return self.displacement(self.deformation(self.carried(w)))


@dataclass(frozen=True)
class _Arm:
    """Geometry at n poses: bodies' R (b, 3, 3, n) and p (b, 3, n), joint axes (dof, 3, n), tool (3, n)."""

    model: ArmModel
    R: Array
    p: Array
    axis: Array
    tool: Array


@dataclass(frozen=True)
class _Loop:
    """The parallelogram: bar direction ``u``, its pin on the forearm (3, n), force N = row . w, row (6, n).

    u points from the crank to the forearm; N is positive when the bar pushes.
    """

    u: Array
    pin: Array
    row: Array

    def at(self, R: Array, point: Array, sign: float = 1.0) -> Along:
        """Move the bar's force on the forearm to ``point``: a wrench in local axes."""
        wrench = [to_local(R, self.u), to_local(R, cross(self.pin - point, self.u))]
        return Along(self.row, sign * np.concatenate(wrench))


def transfers(model: ArmModel, frames: BodyFrames, q: Array, tool: Array, first: int = 0) -> Iterator[Transfer]:
    """Every compliant part with what it carries; q (n, dof), tool (n, 3) in the base frame.

    ``first`` is the number of the first pose, for messages.

    Raises
    ------
    InputError
        The parallelogram is flat at one of the poses.
    """
    arm = _arm(model, frames, tool)
    loop = _loop(arm, first)
    if model.base.any():
        yield Transfer("base", model.base, Moved(arm.R[0], arm.tool - arm.p[0]))
    for link in model.links:
        yield _link(arm, loop, link)
    for joint in model.joints:
        compliance = joint.axial.compliance(q)
        if compliance.any():
            yield Transfer(joint.name, compliance, along=_axial(arm, loop, joint.joint), joint=joint.joint)
        if joint.bearing.any():
            yield _bearing(arm, loop, joint.joint, joint.bearing)
        if joint.housing.any():
            yield _bearing(arm, loop, joint.joint, joint.housing, turns=False)
        for row, law in joint.laws:
            carried = _bearing(arm, loop, joint.joint, joint.bearing).matrix()[row]
            yield Transfer(f"{joint.name} law {row + 1}", law.compliance(q), along=Along(carried, np.ones((1, 1))))
    if model.tool.any():
        R_flange = poses_last(frames.R_flange)
        own = poses_last(tool_position(model.robot, frames))
        yield Transfer("tool", model.tool, Moved(R_flange, arm.tool - own))
    for part in () if model.secants is None else model.secants.further:
        at = poses_last(tool_position(model.robot, frames, part.load.point))
        straight = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, len(q)))
        yield Transfer(part.name, poses_last(part.compliance(q)), Moved(straight, arm.tool - at))
    if loop is None or model.bar is None:
        return
    if model.bar.compliance > 0.0:
        yield Transfer("bar", np.array([[model.bar.compliance]]), along=Along(loop.row, np.ones((1, 1))))
    if model.bar.crank is not None:
        # The crank's pin carries the opposite force; its axes are the forearm's.
        crank = model.bar.crank
        force = loop.at(arm.R[crank.body], loop.pin, -1.0)
        yield Transfer("crank", crank.element.flexibility, along=force)


def axial_transfers(model: ArmModel, frames: BodyFrames, tool: Array, first: int = 0) -> Iterator[tuple[int, Along]]:
    """Torque about each joint's axis with the joint's index, rigid joints too; see :func:`transfers`."""
    arm = _arm(model, frames, tool)
    loop = _loop(arm, first)
    for joint in model.joints:
        yield joint.joint, _axial(arm, loop, joint.joint)


def joint_rows(
    model: ArmModel, frames: BodyFrames, tool: Array, first: int = 0, only: Collection[str] | None = None
) -> Iterator[tuple[int, Array]]:
    """What each joint (of ``only``) carries in its own axes, T (6, 6, n): forces and moments; see :func:`transfers`.

    The last row is the torque that the joint's axial spring feels. Behind a parallelogram that is the torque of
    the crank's actuator, and the joint's own bearing feels none.
    """
    arm = _arm(model, frames, tool)
    loop = _loop(arm, first)
    for joint in model.joints:
        if only is not None and joint.name not in only:
            continue
        T = _bearing(arm, loop, joint.joint, np.zeros((6, 6))).matrix()
        T[5] = _axial(arm, loop, joint.joint).row
        yield joint.joint, T


def _arm(model: ArmModel, frames: BodyFrames, tool: Array) -> _Arm:
    return _Arm(model, poses_last(frames.R), poses_last(frames.p), poses_last(frames.axis), poses_last(tool))


def _loop(arm: _Arm, first: int) -> _Loop | None:
    p = arm.model.robot.parallelogram
    if arm.model.bar is None or p is None:
        return None
    elbow = arm.p[p.driven + 1]
    span = elbow - arm.p[p.crank_about + 1]
    u = span / np.sqrt(dot(span, span))
    rho = to_base(arm.R[p.driven + 1], p.pin[:, None])
    e = arm.axis[p.driven]
    lever = dot(e, cross(rho, u))
    flat = np.abs(lever) < FLAT_SINE * np.linalg.norm(p.pin)
    if flat.any():
        raise flat_parallelogram(arm.model.robot, first + int(np.flatnonzero(flat)[0]))
    moment = np.concatenate([cross(e, arm.tool - elbow), e])
    return _Loop(u, elbow + rho, -moment / lever)


def flat_parallelogram(robot: Robot, pose: int) -> InputError:
    """What to raise where bar and lever are in line."""
    return InputError(
        f"pose {pose}: the parallelogram of {robot.name} is "
        "flat (bar and lever in line), so the bar cannot carry the forearm's moment",
        code="M007",
        allowed="poses away from that singularity",
        remedy="check the joint angles",
    )


def _link(arm: _Arm, loop: _Loop | None, link: LinkPart) -> Transfer:
    R, origin, flexibility = arm.R[link.body], arm.p[link.body], link.element.flexibility
    tip = origin + to_base(R, link.element.points[1][:, None])
    along = None
    p = arm.model.robot.parallelogram
    if loop is not None and p is not None and link.body == p.driven:
        along = loop.at(R, tip)
    if "pin" in link.element.interfaces:
        if loop is None:
            # Nothing hangs on the lever of the serial load path.
            flexibility = flexibility[:6, :6]
        else:
            at_pin = loop.at(R, loop.pin)
            along = Along(at_pin.row, np.concatenate([np.zeros_like(at_pin.column), at_pin.column]))
    return Transfer(link.name, flexibility, Moved(R, arm.tool - tip), along)


def _axial(arm: _Arm, loop: _Loop | None, joint: int) -> Along:
    """Torque about a joint's axis."""
    e, origin = arm.axis[joint], arm.p[joint + 1]
    row = np.concatenate([cross(e, arm.tool - origin), e])
    p = arm.model.robot.parallelogram
    if loop is not None and p is not None and joint == p.crank_about:
        row = row + dot(e, cross(loop.pin - origin, loop.u)) * loop.row
    # The driven joint's own row needs no change: the crank's torque equals the forearm's moment.
    return Along(row, np.ones((1, 1)))


def _bearing(arm: _Arm, loop: _Loop | None, joint: int, compliance: Array, *, turns: bool = True) -> Transfer:
    """All six directions of a joint, in the axes of its frame turned with it, or of its frame at zero."""
    part, robot = arm.model.joints[joint], arm.model.robot
    if turns:
        R = times_constant(arm.R[joint + 1], robot.R_post[joint].T)
    else:
        R = times_constant(arm.R[joint], robot.T_pre[joint][:3, :3])
    origin = arm.p[joint + 1]
    p = robot.parallelogram
    along = None
    if loop is not None and p is not None and joint in (p.crank_about, p.driven):
        along = loop.at(R, origin)
    return Transfer(
        f"{part.name} {'other directions' if turns else 'housing'}", compliance, Moved(R, arm.tool - origin), along
    )
