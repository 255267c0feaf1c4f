"""Torque of the arm's own weight at its joints: the preload that gears stand under before a load comes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fem.model import ArmModel
from fem.statics.transfers import axial_transfers
from robots.arrays import Array
from robots.constants import STANDARD_GRAVITY
from robots.kinematics import forward_kinematics


def gravity_torque(model: ArmModel, q: Array) -> Array:
    """Torque (n, dof) N m of the links' weight at the springs about the joints' axes; q (n, dof) rad.

    Weight acts along -Z of the base. Masses as declared (:attr:`ArmModel.masses`), without tool and payload; the bar
    of a parallelogram has none here. Zero where no masses are declared.
    """
    frames = forward_kinematics(model.robot, q)
    out = np.zeros((len(q), model.robot.dof))
    p = model.robot.parallelogram
    serial = replace(model, bar=None)
    for mass in model.masses:
        point = frames.p[:, mass.body] + frames.R[:, mass.body] @ mass.centre
        force = np.array([[0.0], [0.0], [-STANDARD_GRAVITY * mass.kg], [0.0], [0.0], [0.0]])
        # The bar holds what hangs on the driven link and beyond, nothing before it.
        beyond = p is not None and mass.body > p.driven
        for joint, torque in axial_transfers(model if beyond else serial, frames, point):
            if joint < mass.body:
                out[:, joint] += torque.carried(np.broadcast_to(force, (6, len(q))))[0]
    return out
