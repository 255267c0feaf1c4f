"""Where targets really are: Pinocchio's kinematics and gravity, springs, errors of joints, rails and surroundings."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin

from .arms import Floats, SurveyArm

# Rounds of "go there and ask again" until springs and weights agree; what is left then is below a nanometre.
ROUNDS = 6
# Of Pinocchio's 20 coordinates: the base's two tilts, then each joint's two tilts and its own turn.
OWN = np.arange(6) * 3 + 4


@dataclass(frozen=True)
class Truth:
    """All that is true of one arm.

    ``frames`` (6, 6): shift (m) and turn (rad) of each joint's frame; ``zeros``, ``ratios`` (6,); ``coupling`` (6, 6):
    how much the row's joint turns with the column's; ``run_out`` (6, 2): size (rad) and where (rad); ``compliance``
    (20,) rad/(N m); ``centres`` (6,): where along its link a mass sits; ``weight``: factor on the payload; ``growth``
    1/K; ``drift``, ``bump`` (6,): shift and turn after an hour, and at once after ``bumped`` s; ``bow`` (2,) m and
    ``sway`` rad of the rail.
    """

    frames: Floats
    zeros: Floats
    compliance: Floats
    centres: Floats
    ratios: Floats = field(default_factory=lambda: np.zeros(6))
    coupling: Floats = field(default_factory=lambda: np.zeros((6, 6)))
    run_out: Floats = field(default_factory=lambda: np.zeros((6, 2)))
    weight: float = 1.0
    growth: float = 0.0
    drift: Floats = field(default_factory=lambda: np.zeros(6))
    bump: Floats = field(default_factory=lambda: np.zeros(6))
    bumped: float = np.inf
    bow: Floats = field(default_factory=lambda: np.zeros(2))
    sway: float = 0.0


@dataclass(frozen=True)
class Visit:
    """n readings: ``q`` (n, 6) rad, ``target`` and ``kg`` of the payload (n,), ``rail`` m, ``time`` s, ``warm`` K."""

    q: Floats
    target: np.ndarray
    kg: Floats
    rail: Floats
    time: Floats
    warm: Floats

    def __len__(self) -> int:
        return len(self.q)


def built(arm: SurveyArm, t: Truth, kg: float, targets: Floats) -> tuple[pin.Model, list[int]]:
    """Pinocchio's model of the arm with a payload at the flange, and its frames at the targets."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "base.x")
    joint = model.addJoint(joint, pin.JointModelRY(), pin.SE3.Identity(), "base.y")
    grown = 1.0 + t.growth
    places = []
    for j in range(6):
        alpha, a, d, _ = arm.dh[j]
        turn = pin.exp3(np.array([alpha, 0.0, 0.0]))
        place = pin.SE3(turn, grown * (np.array([a, 0.0, 0.0]) + turn @ np.array([0.0, 0.0, d])))
        places.append(place * pin.SE3(pin.exp3(t.frames[j, 3:]), t.frames[j, :3]))
    for j in range(6):
        joint = model.addJoint(joint, pin.JointModelRX(), places[j], f"j{j}.x")
        joint = model.addJoint(joint, pin.JointModelRY(), pin.SE3.Identity(), f"j{j}.y")
        joint = model.addJoint(joint, pin.JointModelRZ(), pin.SE3.Identity(), f"j{j}.z")
        along = places[j + 1].translation if j < 5 else np.zeros(3)
        ball = pin.Inertia(float(arm.kg[j]), t.centres[j] * along, 1e-3 * np.eye(3))
        model.appendBodyToJoint(joint, ball, pin.SE3.Identity())
    model.appendBodyToJoint(
        joint, pin.Inertia(kg * t.weight, np.array([0.0, 0.0, 0.1]), 1e-3 * np.eye(3)), pin.SE3.Identity()
    )
    frames = [
        model.addFrame(pin.Frame(f"target.{k}", joint, 0, pin.SE3(np.eye(3), grown * at), pin.FrameType.OP_FRAME))
        for k, at in enumerate(targets)
    ]
    return model, frames


def turned(arm: SurveyArm, t: Truth, q: Floats) -> Floats:
    """What the joints really turn (6,) before they give way."""
    out = q + t.zeros + t.ratios * q + t.coupling @ q + arm.dh[:, 3]
    for j in range(6):
        size, where = t.run_out[j]
        if size:
            # A wheel off its centre by half its radius: the angle seen from the centre that it should have.
            x = q[j] - where
            out[j] += size * np.arctan2(0.5 * np.sin(x), 1.0 + 0.5 * np.cos(x)) / 0.5
    return np.asarray(out)


def positions(arm: SurveyArm, t: Truth, v: Visit, targets: Floats, rail: float) -> Floats:
    """Positions (n, 3) m in the frame of the floor; ``rail`` m: its length."""
    out = np.empty((len(v), 3))
    models = {}
    for k in range(len(v)):
        key = float(v.kg[k]), float(v.warm[k])
        if key not in models:
            model, frames = built(arm, replace(t, growth=t.growth * v.warm[k]), v.kg[k], targets)
            models[key] = model, model.createData(), frames
        model, data, frames = models[key]
        given = np.zeros(20)
        given[OWN] = turned(arm, t, v.q[k])
        there = given
        for _ in range(ROUNDS):
            there = given - t.compliance * pin.computeGeneralizedGravity(model, data, there)
        pin.framesForwardKinematics(model, data, there)
        p = data.oMf[frames[int(v.target[k])]].translation
        out[k] = _on_rail(t, p, v.rail[k], rail)
        hours = v.time[k] / 3600.0
        move = t.drift * np.sqrt(max(hours, 0.0)) + t.bump * (v.time[k] >= t.bumped)
        out[k] = pin.exp3(move[3:]) @ out[k] + move[:3]
    return out


def _on_rail(t: Truth, p: Floats, at: float, length: float) -> Floats:
    if not length:
        return p
    s = np.pi * at / length
    turn = pin.exp3(np.array([0.0, t.sway * np.cos(s), t.sway * np.sin(2.0 * s)]))
    return np.asarray(turn @ p + np.array([at, t.bow[0] * np.sin(s), t.bow[1] * np.sin(2.0 * s)]))
