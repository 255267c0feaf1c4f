"""Made-up campaigns of positions with the truth known; a pose at a time, by code that shares nothing with the estimate.

The arm is a product of 4 x 4 matrices; joints turn by what they say, their errors, and what their springs give way
under the weight of links and payload at the angles that come of it (a fixed point, not one linear step).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from doe.absolute.readings import AbsoluteReadings, Labels, Payload
from fem import ArmModel
from robots.arrays import Array

GRAVITY = 9.80665


def matrix(R: Array, p: Array) -> Array:
    """A frame (4, 4)."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    return T


def turn(axis: int, angle: float) -> Array:
    """A rotation (3, 3) about a coordinate axis."""
    c, s = np.cos(angle), np.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[i, i], R[i, j], R[j, i], R[j, j] = c, -s, s, c
    return R


def small(w: Array) -> Array:
    """The rotation (3, 3) of a rotation vector (3,), by its power series."""
    if not w.any():
        return np.eye(3)
    K = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    R, term = np.eye(3), np.eye(3)
    for k in range(1, 18):
        term = term @ K / k
        R = R + term
    return R


@dataclass(frozen=True)
class Truth:
    """True numbers by name, as the program names them, in SI (compliances of springs)."""

    numbers: dict[str, float]

    def get(self, name: str) -> float:
        """A number, zero where nothing is said."""
        return self.numbers.get(name, 0.0)


def position(
    model: ArmModel, truth: Truth, q: Array, target: str, payload: Payload, rail: float, span: tuple[float, float]
) -> Array:
    """Where a target is in the frame of the rail (or the base); q (dof,) rad."""
    robot = model.robot
    theta = true_angles(model, truth, q)
    given = theta.copy()
    for _ in range(4):
        frames = chain(model, truth, given)
        given = theta + sag(model, truth, frames, payload)
    flange = chain(model, truth, given)[-1] @ robot.T_last_flange
    p = flange[:3, :3] @ np.array([truth.get(f"target.{target}.{a}") for a in "xyz"]) + flange[:3, 3]
    if span[0] == span[1]:
        return np.asarray(p)
    x = (2.0 * rail - span[0] - span[1]) / (span[1] - span[0])
    P = [x, 0.5 * (3 * x**2 - 1), 0.5 * (5 * x**3 - 3 * x), (35 * x**4 - 30 * x**2 + 3) / 8]
    P += [(63 * x**5 - 70 * x**3 + 15 * x) / 8, (231 * x**6 - 315 * x**4 + 105 * x**2 - 5) / 16]
    w = np.array([sum(truth.get(f"rail.turn{n}.{a}") * P[n - 1] for n in range(1, 7)) for a in "xyz"])
    d = np.array([truth.get(f"rail.{a}") * rail for a in "xyz"])
    d += [sum(truth.get(f"rail.bow{n}.{a}") * P[n - 1] for n in range(2, 7)) for a in "xyz"]
    return np.asarray(small(w) @ p + d)


def true_angles(model: ArmModel, truth: Truth, q: Array) -> Array:
    """What the joints really turn before they give way."""
    out = q.copy()
    for j, name in enumerate(model.robot.joint_names):
        out[j] += truth.get(f"{name}.zero") + truth.get(f"{name}.ratio") * q[j]
        for n in range(1, 5):
            out[j] += truth.get(f"{name}.sin{n}") * np.sin(n * q[j]) + truth.get(f"{name}.cos{n}") * np.cos(n * q[j])
        for k, other in enumerate(model.robot.joint_names):
            out[j] += truth.get(f"{name}.per.{other}") * q[k]
    return out


def chain(model: ArmModel, truth: Truth, angles: Array) -> list[Array]:
    """Frames (4, 4) of the bodies, the base first."""
    robot, T = model.robot, np.eye(4)
    out = [T]
    for j, name in enumerate(robot.joint_names):
        error = matrix(
            small(np.array([truth.get(f"{name}.frame.rx"), truth.get(f"{name}.frame.ry"), 0.0])),
            np.array([truth.get(f"{name}.frame.{a}") for a in "xyz"]),
        )
        spin = matrix(turn(2, robot.sign[j] * angles[j] + robot.offset[j]) @ robot.R_post[j], np.zeros(3))
        T = T @ robot.T_pre[j] @ error @ spin
        out.append(T)
    return out


def sag(model: ArmModel, truth: Truth, frames: list[Array], payload: Payload) -> Array:
    """What the joints' springs give way (dof,) rad, in the joints' own coordinates."""
    robot, out = model.robot, np.zeros(model.robot.dof)
    flange = frames[-1] @ robot.T_last_flange
    masses = [(m.body, m.kg, frames[m.body][:3, :3] @ m.centre + frames[m.body][:3, 3]) for m in model.masses]
    masses.append((robot.dof, payload.kg, flange[:3, :3] @ payload.centre + flange[:3, 3]))
    for j, name in enumerate(robot.joint_names):
        axis = frames[j + 1][:3, :3] @ robot.R_post[j].T[:, 2]
        origin = frames[j + 1][:3, 3]
        levers = ((at - origin, GRAVITY * kg) for body, kg, at in masses if body > j)
        torque = sum(weight * float(axis[1] * r[0] - axis[0] * r[1]) for r, weight in levers)
        out[j] = robot.sign[j] * truth.get(f"{name}.stiffness") * torque
    return out


@dataclass(frozen=True)
class Plan:
    """A campaign to make up: poses, sessions, targets, payloads, rail's length m, noise m."""

    poses: int
    sessions: int = 1
    targets: int = 1
    payloads: tuple[Payload, ...] = (Payload(0.0, np.zeros(3)),)
    rail: float = 0.0
    noise: float = 5e-5


def campaign(model: ArmModel, truth: Truth, plan: Plan, rng: np.random.Generator) -> AbsoluteReadings:
    """Readings of a plan at poses drawn from the joints' ranges (within half a turn), in frames drawn at random."""
    low, high = np.clip(model.robot.limits, -np.pi, np.pi).T
    n = plan.poses
    q = rng.uniform(low, high, (n, model.robot.dof))
    session, target = np.arange(n) % plan.sessions, rng.integers(0, plan.targets, n)
    payload = rng.integers(0, len(plan.payloads), n)
    rail = rng.uniform(0.0, plan.rail, n)
    if plan.rail:
        rail[:2] = 0.0, plan.rail
    span = float(rail.min()), float(rail.max())
    y = np.empty((n, 3))
    frames = [(small(rng.normal(size=3)), rng.uniform(-5.0, 5.0, 3)) for _ in range(plan.sessions)]
    for k in range(n):
        p = position(model, truth, q[k], "abc"[target[k]], plan.payloads[payload[k]], float(rail[k]), span)
        R, t = frames[session[k]]
        y[k] = R @ p + t + plan.noise * rng.normal(size=3)
    return AbsoluteReadings(
        "made-up",
        "",
        q,
        y,
        Labels(tuple(f"s{k}" for k in range(plan.sessions)), session.astype(np.int64)),
        Labels(tuple("abc"[: plan.targets]), target.astype(np.int64)),
        payload.astype(np.int64),
        plan.payloads,
        rail,
        np.full(n, np.nan),
        np.arange(n, dtype=np.int64) + 2,
    )
