"""What compliances make of the weight of links and payloads: displacement of the target for each unit of compliance.

A mass loads what comes before it; the target moves by what each spring gives way, ``T_target^T C T_mass w``, with T as
of :mod:`fem.statics.transfers`, the parallelogram's load path among them. It is linear in every compliance, and in a
payload's mass and first moments.
"""

from __future__ import annotations

from collections.abc import Sequence
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


@dataclass(frozen=True)
class Weight:
    """By place of a compliance among the unknowns: displacement (3, n) m for each unit, by the links' weight.

    ``payload``: the same by 1 kg at the flange's origin and by first moments of 1 kg m along its axes, (4, 3, n) each;
    ``held`` (n, 4): mass and first moments that the flange carries as the table says, ``which`` (n,) payload it is.
    """

    links: dict[int, Array]
    payload: dict[int, Array]
    held: Array
    which: Integers

    def add(self, layout: Layout, u: Array, J: Array) -> Array:
        """Displacements (3, n) m with variables u (p,); their derivatives go into J (p, 3, n) unless that is empty."""
        out = np.zeros((3, len(self.which)))
        held, free = self.held.copy(), layout.of("payload")
        for k, (number, part) in free:
            held[self.which == number, part] = u[k]
        for place, own in self.links.items():
            unit = own + np.einsum("kan,nk->an", self.payload[place], held) if place in self.payload else own
            out += u[place] * unit
            if len(J):
                J[place] = unit
                for k, (number, part) in free:
                    J[k] += u[place] * self.payload[place][part] * (self.which == number)
        return out


def weight(
    model: ArmModel, q: Array, target: Array, which: Array, payloads: Sequence[Payload], layout: Layout
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
    links = {index: np.zeros((3, len(q))) for index in wanted}
    for mass in model.masses:
        point = frames.p[:, mass.body] + np.einsum("nij,j->ni", frames.R[:, mass.body], mass.centre)
        for (joint, row), T in _rows(model, frames, point, wanted).items():
            if joint < mass.body:
                links[joint, row] += lever[joint, row][:3] * (-STANDARD_GRAVITY * mass.kg * T[2])
    held = np.array([[p.kg, *(p.kg * p.centre)] for p in payloads]).reshape(-1, 4)[which]
    carried: dict[tuple[int, ...], Array] = {}
    if held.any() or layout.of("payload"):
        # A force at a point is the force at the flange's origin, and its moment about that: linear in both.
        R, at_flange = poses_last(frames.R_flange), _rows(model, frames, frames.p_flange, wanted)
        down = np.array([0.0, 0.0, -STANDARD_GRAVITY])[:, None]
        moments = [cross(to_base(R, np.eye(3)[:, a, None]), down) for a in range(3)]
        for index, T in at_flange.items():
            parts = [T[2] * down[2], *(np.einsum("in,in->n", T[3:], m) for m in moments)]
            carried[index] = np.stack([lever[index][:3] * part for part in parts])
    return Weight(
        {k: links[index] for k, index in free},
        {k: carried[index] for k, index in free} if carried else {},
        held, which.astype(np.int64),
    )  # fmt: skip


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


