"""What deflects under the weight of links and payloads: turns of joints about their axes, displacements by the rest.

A mass loads what comes before it, by the wrenches of :mod:`fem.statics.transfers`. A spring about a serial joint's axis
turns that joint by compliance times torque: finite turns, for half the square of a sag of five milliradians already
shortens an arm of a metre by twelve micrometres. What deflects in other directions, and all of an arm with a
parallelogram, whose actuator sits elsewhere, moves the target linearly, ``T_target^T C T_mass w``. Both are linear in
every compliance, and in a payload's mass and first moments.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from doe.absolute.readings import Payload
from doe.absolute.unknowns import Layout
from fem import ArmModel
from fem.statics.transfers import joint_rows
from fem.statics.vectors import cross, poses_last, to_base
from robots.arrays import Array, Integers
from robots.constants import STANDARD_GRAVITY
from robots.kinematics import BodyFrames, forward_kinematics, tool_position

# Row of a joint's axes that its spring acts in.
AXIAL = 5


def has_weight(model: ArmModel, payloads: Sequence[Payload]) -> bool:
    """Whether anything that is known to weigh loads the arm's springs."""
    return bool(model.masses) or any(p.kg > 0.0 for p in payloads)


@dataclass(frozen=True)
class Weight:
    """By place of a compliance among the unknowns: displacement (3, n) m for each unit, by the links' weight.

    ``payload``: the same by 1 kg at the flange's origin and by first moments of 1 kg m along its axes, (4, 3, n) each;
    ``torque``: of springs that turn their joint: the joint, and what turns it (5, n) N m by the links, by 1 kg and by
    first moments; ``held`` (n, 4): mass and first moments that the flange carries as the table says, ``which`` (n,)
    payload it is. ``heavier``: by place of a mass among the unknowns, what of ``links`` (or of the torques) comes of
    it, by place of the compliance.
    """

    links: dict[int, Array]
    payload: dict[int, Array]
    torque: dict[int, tuple[int, Array]]
    held: Array
    which: Integers
    heavier: dict[int, dict[int, Array]]

    def turns(self, layout: Layout, u: Array) -> Iterator[tuple[int, int, Array, float]]:
        """Columns ``(place, joint, rate (n,))`` of turns, and by what share of the variable they turn a joint."""
        held, free = self.held.copy(), layout.of("payload")
        for k, (number, part) in free:
            held[self.which == number, part] = u[k]
        for place, (joint, torque) in self.torque.items():
            more = sum(u[k] * own[place] for k, own in self.heavier.items())
            yield place, joint, torque[0] + np.einsum("kn,nk->n", torque[1:], held) + more, 1.0
            for k, (number, part) in free:
                yield k, joint, u[place] * torque[1 + part] * (self.which == number), 0.0
            for k, own in self.heavier.items():
                yield k, joint, u[place] * own[place], 0.0

    def add(self, layout: Layout, u: Array, J: Array) -> Array:
        """Displacements (3, n) m with variables u (p,); their derivatives go into J (p, 3, n) unless that is empty."""
        out = np.zeros((3, len(self.which)))
        held, free = self.held.copy(), layout.of("payload")
        for k, (number, part) in free:
            held[self.which == number, part] = u[k]
        for place, own in self.links.items():
            unit = own + np.einsum("kan,nk->an", self.payload[place], held)
            unit = unit + sum(u[k] * mine[place] for k, mine in self.heavier.items())
            out += u[place] * unit
            if len(J):
                J[place] = unit
                for k, mine in self.heavier.items():
                    J[k] += u[place] * mine[place]
                for k, (number, part) in free:
                    J[k] += u[place] * self.payload[place][part] * (self.which == number)
        return out


def weight(
    model: ArmModel, q: Array, target: Array, which: Integers, payloads: Sequence[Payload], layout: Layout
) -> Weight | None:
    """What the free compliances make of weight at poses q (n, dof), of targets (n, 3) m in the flange frame.

    None without a compliance that is free.
    """
    free = layout.of("spring")
    if not free:
        return None
    frames = forward_kinematics(model.robot, q)
    wanted = [index for _, index in free]
    lever = _rows(model, frames, tool_position(model.robot, frames, target), wanted)
    own = {index: np.zeros(len(q)) for index in wanted}
    by_mass = {k: {index: np.zeros(len(q)) for index in wanted} for k, _ in layout.of("mass")}
    place_of = {body: k for k, (body,) in layout.of("mass")}
    for mass in model.masses:
        point = frames.p[:, mass.body] + np.einsum("nij,j->ni", frames.R[:, mass.body], mass.centre)
        for (joint, row), T in _rows(model, frames, point, wanted).items():
            if joint < mass.body:
                carried = -STANDARD_GRAVITY * mass.kg * T[2]
                own[joint, row] += carried
                if mass.body - 1 in place_of:
                    by_mass[place_of[mass.body - 1]][joint, row] += carried
    held = np.array([[p.kg, *(p.kg * p.centre)] for p in payloads]).reshape(-1, 4)[which]
    parts = {index: np.zeros((4, len(q))) for index in wanted}
    if held.any() or layout.of("payload"):
        # A force at a point is the force at the flange's origin, and its moment about that: linear in both.
        R, at_flange = poses_last(frames.R_flange), _rows(model, frames, frames.p_flange, wanted)
        down = np.array([0.0, 0.0, -STANDARD_GRAVITY])[:, None]
        moments = [cross(to_base(R, np.eye(3)[:, a, None]), down) for a in range(3)]
        for index, T in at_flange.items():
            parts[index] = np.stack([T[2] * down[2], *(np.einsum("in,in->n", T[3:], m) for m in moments)])
    spun = {k: index for k, index in free if index[1] == AXIAL and index[0] >= 0 and model.bar is None}
    moved = {k: index for k, index in free if k not in spun}
    sign = model.robot.sign
    heavier = {
        m: {k: lever[index][:3] * mine[index] for k, index in moved.items()}
        | {k: sign[index[0]] * mine[index] for k, index in spun.items()}
        for m, mine in by_mass.items()
    }
    return Weight(
        {k: lever[index][:3] * own[index] for k, index in moved.items()},
        {k: lever[index][:3] * parts[index][:, None] for k, index in moved.items()},
        {k: (j, sign[j] * np.vstack([own[j, row], parts[j, row]])) for k, (j, row) in spun.items()},
        held,
        which.astype(np.int64),
        heavier,
    )


def _rows(
    model: ArmModel, frames: BodyFrames, point: Array, wanted: Sequence[tuple[int, ...]]
) -> dict[tuple[int, ...], Array]:
    """Rows (6, n) of what joints (the base: -1) carry for a wrench at points (n, 3) m, by joint and row."""
    out: dict[tuple[int, ...], Array] = {}
    for joint, T in joint_rows(model, frames, point):
        out |= {(j, row): T[row] for j, row in wanted if j == joint}
    r = poses_last(point)
    for j, row in wanted:
        if j < 0:
            axis = np.repeat(np.eye(3)[:, row % 3, None], len(point), axis=1)
            none = np.zeros_like(axis)
            out[j, row] = np.vstack([axis, none] if row < 3 else [cross(axis, r), axis])
    return out
