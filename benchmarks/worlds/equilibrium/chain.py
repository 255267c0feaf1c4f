"""The arm as a MuJoCo model whose hinges and slides are its springs, and its equilibrium at the deflected pose."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import mujoco
import numpy as np

from .arm import Arm, Vector

GRAVITY = 9.80665
DIRECTIONS = ("tx", "ty", "tz", "rx", "ry", "rz")
_AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
# Change of any deflection, in rad or m, at which an equilibrium has been found.
SETTLED = 1e-12
MOST_STEPS = 80

Law = Callable[[Vector], Vector]


def _text(values: Sequence[float] | Vector) -> str:
    return " ".join(f"{float(v):.17g}" for v in values)


def _freedoms(place: str, wanted: Mapping[str, Sequence[str]]) -> str:
    """Slides first, then hinges, all at the body's origin."""
    lines = []
    for direction in DIRECTIONS:
        if direction in wanted.get(place, ()):
            kind = "slide" if direction[0] == "t" else "hinge"
            lines.append(f'<joint name="{place}.{direction}" type="{kind}" axis="{_AXES[direction[1]]}"/>')
    return "".join(lines)


def _quaternion(rotation: Vector) -> Vector:
    out = np.zeros(4)
    mujoco.mju_mat2Quat(out, np.ascontiguousarray(rotation, dtype=float).ravel())
    return out


def mjcf(arm: Arm, wanted: Mapping[str, Sequence[str]], shifts: Vector, weigh: float) -> str:
    """Write the arm as MJCF: a body for the base, for each joint and for the flange.

    Parameters
    ----------
    wanted : directions that give way beside the gears, by place (``base``, a joint's name, ``tool``)
    shifts : (joints + 1, 3) m, by how far each body sits from where its drawing has it
    weigh : factor on the masses
    """
    steps = [*(joint.position for joint in arm.joints[1:]), arm.flange]
    masses = {link.body: link.mass * weigh for link in arm.links}
    text = [
        '<mujoco><compiler angle="radian"/>',
        f'<option gravity="0 0 {-GRAVITY}"/><worldbody><body name="base">',
        _freedoms("base", wanted),
        '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>',
    ]
    for joint, shift, step in zip(arm.joints, shifts, steps, strict=False):
        mass = max(masses.get(joint.name, 0.0), 1e-3)
        # A body of its own for what gives way before the joint: MuJoCo allows six freedoms a body.
        text.append(f'<body pos="{_text(joint.position + shift)}" quat="{_text(_quaternion(joint.rotation))}">')
        text.append(_freedoms(joint.name, wanted))
        text.append('<inertial pos="0 0 0" mass="1e-3" diaginertia="1e-4 1e-4 1e-4"/><body>')
        text.append(f'<joint name="{joint.name}" type="hinge" axis="{_text(joint.axis)}"/>')
        text.append(f'<inertial pos="{_text(step / 2)}" mass="{mass}" diaginertia="{_text([mass * 0.05] * 3)}"/>')
    text.append(f'<body name="flange" pos="{_text(arm.flange + shifts[-1])}">{_freedoms("tool", wanted)}')
    text.append('<inertial pos="0 0 0" mass="1e-3" diaginertia="1e-4 1e-4 1e-4"/></body>')
    return "".join(text) + "</body>" * (2 * len(arm.joints) + 1) + "</worldbody></mujoco>"


class Chain:
    """An arm that gives way at its gears, and at whatever else is wanted.

    Deflections are ordered: gears of all joints first, then the other freedoms by place. ``share`` is the part of an
    ideal parallelogram in how the elbow follows the shoulder: 1 keeps the forearm's direction when the shoulder's gear
    gives way, 0 is the plain chain.
    """

    def __init__(
        self,
        arm: Arm,
        wanted: Mapping[str, Sequence[str]] | None = None,
        shifts: Vector | None = None,
        weigh: float = 1.0,
        share: float | None = None,
    ) -> None:
        wanted = wanted or {}
        count = len(arm.joints)
        shifts = np.zeros((count + 1, 3)) if shifts is None else shifts
        self.model = mujoco.MjModel.from_xml_string(mjcf(arm, wanted, shifts, weigh))
        self.data = mujoco.MjData(self.model)
        self.flange = int(self.model.body("flange").id)
        places = ("base", *arm.names, "tool")
        more = [f"{place}.{d}" for place in places for d in DIRECTIONS if d in wanted.get(place, ())]
        self.names = [*arm.names, *more]
        self.where = {name: i for i, name in enumerate(self.names)}
        self._slots = np.array([int(self.model.joint(name).qposadr[0]) for name in self.names])
        self.size, self._joints = len(self.names), count
        self.mix = np.eye(self.size)
        share = float(arm.parallelogram) if share is None else share
        if arm.parallelogram and share:
            self.mix[2, 1] = -share
        self._bias, self._jacobian = np.zeros(self.size), np.zeros((3, self.size))

    def pose(self, angles: Vector, deflection: Vector) -> None:
        """Bring all bodies to where these angles and deflections put them."""
        turned = self.mix @ deflection
        turned[: self._joints] += angles
        self.data.qpos[self._slots] = turned
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def point(self, lever: Vector) -> Vector:
        """Where a point of the flange's frame is."""
        return np.asarray(self.data.xpos[self.flange] + self.data.xmat[self.flange].reshape(3, 3) @ lever)

    def jacobian(self, lever: Vector) -> Vector:
        """Motion (3, freedoms) of a point of the flange's frame by deflections."""
        mujoco.mj_jac(self.model, self.data, self._jacobian, None, self.point(lever), self.flange)
        return np.asarray(self._jacobian[:, self._slots] @ self.mix)

    def torque(self, force: Vector, lever: Vector) -> Vector:
        """What the load and the arm's own weight do on each freedom, N m or N."""
        mujoco.mj_rne(self.model, self.data, 0, self._bias)
        return np.asarray(force @ self.jacobian(lever) - self._bias[self._slots] @ self.mix)

    def settle(self, angles: Vector, force: Vector, lever: Vector, law: Law, start: Vector) -> tuple[Vector, Vector]:
        """Find the equilibrium: each freedom deflected as its law says for the torque at the deflected pose.

        Newton's method on the complementary form ``deflection - law(torque(deflection)) = 0``. The residual is that
        of the deflected pose; in the tangent the change of torques with the pose is left out, which is some 0.3 % of it
        for arms, so that each step wins two to three digits.

        Returns
        -------
        deflection, torque : (freedoms,) each; the bodies stay where the equilibrium has them
        """
        deflection = start
        for _ in range(MOST_STEPS):
            self.pose(angles, deflection)
            torque = self.torque(force, lever)
            found = law(torque)
            change = float(np.max(np.abs(found - deflection)))
            deflection = found
            if change < SETTLED:
                self.pose(angles, deflection)
                return deflection, torque
        raise ArithmeticError(f"no equilibrium within {MOST_STEPS} steps: the last one still moved {change:g}")


def beam(length: Vector, bending: float, twisting: float, stretching: float) -> Vector:
    """Flexibility (6, 6) of a straight Euler-Bernoulli cantilever at its tip, about the axes of its root."""
    size = float(np.linalg.norm(length))
    along = length / size
    across = np.eye(3) - np.outer(along, along)
    cross = np.array([[0, -along[2], along[1]], [along[2], 0, -along[0]], [-along[1], along[0], 0]])
    out = np.zeros((6, 6))
    out[:3, :3] = size / stretching * np.outer(along, along) + size**3 / (3 * bending) * across
    out[3:, 3:] = size / twisting * np.outer(along, along) + size / bending * across
    out[3:, :3] = size**2 / (2 * bending) * cross
    out[:3, 3:] = out[3:, :3].T
    return out
