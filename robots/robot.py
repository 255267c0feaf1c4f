"""The robot as arrays: what kinematics and mechanics compute with."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robots.arrays import Array, Bools
from robots.controller import ArmController, arm_controller
from robots.errors import InputError, require_one_of
from robots.frames import framed, rotation_rpy
from robots.joint_errors import JointErrors, joint_errors
from robots.schema.description import Joint, ModelDescription, Placed

# A pose on a limit must not fail by the rounding of deg -> rad -> sums of coordinates.
LIMIT_TOLERANCE_RAD = 1e-9


@dataclass(frozen=True)
class CouplingLimit:
    """``lower <= offset + factors . q <= upper`` (rad)."""

    name: str
    factors: Array
    offset: float
    lower: float
    upper: float


@dataclass(frozen=True)
class Parallelogram:
    """The bar that drives joint ``driven`` (index) from a crank about joint ``crank_about`` (index).

    ``pin`` is the bar's pin in the driven body's frame, (3,) m; the crank's pin is the same vector from
    the crank joint, because crank and lever stay parallel.
    """

    driven: int
    crank_about: int
    pin: Array


@dataclass(frozen=True, eq=False)
class Robot:
    """Kinematics and limits of a chain of revolute joints; SI, immutable.

    Body 0 is the base, body i moves with joint i (1-based). ``T_body[i] = T_body[i-1] @ T_pre[i]
    @ Rot_z(theta_i) @ T_post[i]`` with ``theta = sign * q + offset``; each joint turns about the z axis
    of its joint frame ``T_body[i-1] @ T_pre[i]``. ``T_post`` is a pure rotation. ``controller``: the angles that its
    controller shows, where these are others than q. ``errors``: what positions have told of its joints, which
    kinematics leave out but for their zeros (:mod:`robots.joint_errors`).
    """

    name: str
    coordinates: tuple[str, ...]
    joint_names: tuple[str, ...]
    T_pre: Array
    R_post: Array
    sign: Array
    offset: Array
    limits: Array
    couplings: tuple[CouplingLimit, ...]
    T_last_flange: Array
    T_flange_tool: Array
    parallelogram: Parallelogram | None
    controller: ArmController | None = None
    errors: JointErrors | None = None

    @property
    def dof(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def angle_names(self) -> tuple[str, ...]:
        """Names that an angle may bear where people give it: the coordinates, and the controller's angles."""
        return tuple(dict.fromkeys((*self.coordinates, *(self.controller.names if self.controller else ()))))

    def coordinate_index(self, coordinate: str) -> int:
        """Column of a joint coordinate in a pose array."""
        require_one_of(f"joint coordinate of {self.name}", coordinate, self.coordinates, code="B003")
        return self.coordinates.index(coordinate)

    def pose_batch(self, q: Array) -> Array:
        """Poses as a float array (n, dof); raises InputError for another shape."""
        q = np.asarray(q, dtype=np.float64)
        if q.ndim != 2 or q.shape[1] != self.dof:
            raise InputError(
                f"pose array for {self.name}",
                code="B001",
                value=f"shape {q.shape}",
                allowed=f"(n, {self.dof}) in rad",
                remedy="pass one row a pose",
            )
        return q

    def reachable(self, q: Array) -> Bools:
        """Which poses keep all joint limits and couplings; q (n, dof) rad -> (n,). NaN is not reachable.

        Raises
        ------
        InputError
            Wrong shape.
        """
        q = self.pose_batch(q)
        inside = np.all(
            (q >= self.limits[:, 0] - LIMIT_TOLERANCE_RAD) & (q <= self.limits[:, 1] + LIMIT_TOLERANCE_RAD),
            axis=1,
        )
        for c in self.couplings:
            value = c.offset + q @ c.factors
            inside &= (value >= c.lower - LIMIT_TOLERANCE_RAD) & (value <= c.upper + LIMIT_TOLERANCE_RAD)
        return np.asarray(inside, dtype=np.bool_)

    def violations(self, q: Array) -> list[str]:
        """Say what is wrong with one pose (dof,) rad, in words and degrees; empty if it can be taken."""
        out = []
        for name, value, (lower, upper) in zip(self.coordinates, q, self.limits, strict=True):
            if not lower - LIMIT_TOLERANCE_RAD <= value <= upper + LIMIT_TOLERANCE_RAD:
                out.append(f"{name} = {_deg(value)} is outside {_deg(lower)} to {_deg(upper)} deg")
        for c in self.couplings:
            value = c.offset + float(c.factors @ q)
            if not c.lower - LIMIT_TOLERANCE_RAD <= value <= c.upper + LIMIT_TOLERANCE_RAD:
                terms = " ".join(f"{f:+g} {n}" for n, f in zip(self.coordinates, c.factors, strict=True) if f != 0.0)
                out.append(
                    f"{c.name} = {_deg(value)} is outside {_deg(c.lower)} to {_deg(c.upper)} deg "
                    f"({c.name} = {_deg(c.offset)} {terms})"
                )
        return out


def middle_pose(robot: Robot) -> Array:
    """Middle of the joint ranges (dof,) rad; moved along couplings until these hold too."""
    q = robot.limits.mean(axis=1)
    for _ in range(100):
        if robot.reachable(q[None])[0]:
            break
        for c in robot.couplings:
            value = c.offset + float(c.factors @ q)
            q = q - c.factors * (value - np.clip(value, c.lower, c.upper)) / (c.factors @ c.factors)
        q = np.clip(q, robot.limits[:, 0], robot.limits[:, 1])
    return np.asarray(q)


def trial_poses(robot: Robot, drawn: int, most: int) -> Array:
    """Poses (n, dof) rad to try something at, the same each time: the first that can be taken of some drawn at random.

    Joints turn by half a turn either way at most. Of ``drawn`` no more than ``most`` are taken; there may be none.
    """
    low, high = np.clip(robot.limits, -np.pi, np.pi).T
    q = np.random.default_rng(0).uniform(low, high, (drawn, robot.dof))
    return np.asarray(q[robot.reachable(q)][:most])


def _deg(angle: float) -> str:
    return f"{np.degrees(angle):.6g}"


def robot_from(description: ModelDescription) -> Robot:
    """Turn a validated description into arrays.

    Raises
    ------
    InputError
        The parallelogram's two axes are not parallel, or its pin lies on the driven axis.
    """
    joints = description.joint
    placements = [_placement(joint) for joint in joints]
    robot = Robot(
        name=description.name,
        coordinates=tuple(joint.coordinate for joint in joints),
        joint_names=tuple(joint.name for joint in joints),
        T_pre=np.stack([pre for pre, _ in placements]),
        R_post=np.stack([post for _, post in placements]),
        sign=np.array([float(joint.sign) for joint in joints]),
        offset=np.array([_offset(joint) for joint in joints]),
        limits=np.stack([joint.limits.si_array for joint in joints]),
        couplings=tuple(_coupling(description, i) for i in range(len(description.coupling))),
        T_last_flange=_transform(description.flange),
        T_flange_tool=np.eye(4) if description.tool is None else _transform(description.tool),
        parallelogram=_parallelogram(description),
        controller=arm_controller(description.controller, [joint.coordinate for joint in joints], description.name),
        errors=joint_errors(description),
    )
    _check_parallelogram(robot)
    return robot


def _offset(joint: Joint) -> float:
    """Angle of the joint where its coordinate reads zero; the zero error counts like the coordinate."""
    nominal = 0.0 if joint.offset is None else joint.offset.si
    return nominal + joint.sign * (0.0 if joint.zero_error is None else joint.zero_error.si)


def with_zero_errors(robot: Robot, more: Array) -> Robot:
    """The robot with ``more`` (dof,) rad added to its joints' zero errors."""
    return replace(robot, offset=robot.offset + robot.sign * more)


def as_designed(robot: Robot) -> Robot:
    """The robot without errors of zeros and geometry: what its controller computes with."""
    if robot.errors is None:
        return robot
    return replace(robot, offset=robot.offset - robot.sign * robot.errors.zero, errors=None)


def _rotation_z_to(axis: Array) -> Array:
    """Turn z into ``axis`` by the shortest way; below the xy plane by half a turn about x first."""
    a = axis / np.linalg.norm(axis)
    if a[2] < 0.0:  # Near -z the shortest way divides by almost nothing.
        half_turn = np.diag([1.0, -1.0, -1.0])
        return np.asarray(half_turn @ _rotation_z_to(half_turn @ a))
    v = np.array([-a[1], a[0], 0.0])
    vx = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.asarray(np.eye(3) + vx + vx @ vx / (1.0 + a[2]))


def _transform(part: Placed) -> Array:
    rpy = np.zeros(3) if part.rpy is None else part.rpy.si_array
    return framed(rotation_rpy(rpy), part.xyz.si_array)


def _placement(joint: Joint) -> tuple[Array, Array]:
    if joint.dh is not None:
        alpha, a, d = joint.dh.alpha.si, joint.dh.a.si, joint.dh.d.si
        # Rot_z and Trans_z commute, so d can be done before the joint turns.
        xyz = np.array([a, -d * np.sin(alpha), d * np.cos(alpha)])
        return framed(rotation_rpy(np.array([alpha, 0.0, 0.0])), xyz), np.eye(3)
    assert joint.frame is not None  # noqa: S101 - the schema guarantees one of the two
    pre = _transform(joint.frame)
    to_axis = _rotation_z_to(np.array(joint.frame.axis))
    pre[:3, :3] = pre[:3, :3] @ to_axis
    return pre, to_axis.T


def _coupling(description: ModelDescription, index: int) -> CouplingLimit:
    coupling = description.coupling[index]
    names = [joint.coordinate for joint in description.joint]
    factors = np.zeros(len(names))
    for term in coupling.terms:
        factors[names.index(term.coordinate)] += term.factor
    lower, upper = coupling.limits.si_array
    offset = 0.0 if coupling.offset is None else coupling.offset.si
    return CouplingLimit(coupling.name, factors, offset, float(lower), float(upper))


def _parallelogram(description: ModelDescription) -> Parallelogram | None:
    p = description.parallelogram
    if p is None:
        return None
    names = [joint.name for joint in description.joint]
    return Parallelogram(names.index(p.driven), names.index(p.crank_about), p.pin.si_array)


def _check_parallelogram(robot: Robot) -> None:
    p = robot.parallelogram
    if p is None:
        return
    where = f"{robot.name}: [parallelogram]"
    if p.driven != p.crank_about + 1:
        raise InputError(
            f"{where} driven joint",
            code="R002",
            value=robot.joint_names[p.driven],
            allowed=f"the joint right after {robot.joint_names[p.crank_about]}, which the crank turns about",
            remedy="name that joint as 'driven', or another as 'crank_about'",
        )
    # Axis of the driven joint in the frame of the body before it, against that body's own joint axis.
    axis = robot.T_pre[p.driven][:3, 2]
    own = robot.R_post[p.crank_about].T[:, 2]
    if not np.allclose(axis, own, atol=1e-9):
        raise InputError(
            f"{where} joint axes",
            code="R002",
            value=f"{np.round(own, 6).tolist()} and {np.round(axis, 6).tolist()}",
            allowed="parallel, in the same direction",
            remedy="check the axes of both joints",
        )
    # The pin is given in the driven body's frame, so the lever is measured from the axis in that frame.
    driven_axis = robot.R_post[p.driven].T[:, 2]
    lever = p.pin - (p.pin @ driven_axis) * driven_axis
    if np.linalg.norm(lever) < 1e-6:
        raise InputError(
            f"{where} pin",
            code="R002",
            value=p.pin.tolist(),
            allowed="a point off the driven joint's axis",
            remedy="check the pin's position",
        )
