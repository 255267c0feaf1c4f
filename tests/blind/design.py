"""The campaign of a set: its poses and the loads measured at them."""

from __future__ import annotations

import numpy as np

from rehearsal.arm import Arm
from rehearsal.design import filling, repeated, up_and_down
from rehearsal.kinematics import frames
from rehearsal.readings import Readings
from robots.arrays import Array

from .model_files import LOADS
from .spec import SetSpec

# The paper's nine seed poses, degrees: q2, q3real, q4, q5.
PAPER = [
    (-35, 40, -200, 100),
    (-35, 40, 0, -100),
    (-35, 40, 0, 0),
    (5, 77.5, -200, 100),
    (5, 77.5, 0, -100),
    (5, 77.5, 0, 0),
    (45, 115, -200, 100),
    (45, 115, 0, -100),
    (45, 115, 0, 0),
]


def poses(arm: Arm, n: int, rng: np.random.Generator, kind: str = "filling") -> Array:
    """Poses (n, 6) in rad: filling the space, or the paper's."""
    if kind == "paper":
        if arm.name != "xr701" or n != len(PAPER):
            raise ValueError("the paper's design is nine poses of the xr701")
        return np.radians(np.array([(0, *row, 0) for row in PAPER], dtype=float))
    return filling(arm, n, rng)


def cycles(arm: Arm, spec: SetSpec) -> list[tuple[Array, list[bool]]]:
    """Load vectors (m, 3) of each cycle and which of them are unloading."""
    directions = [np.array([0, 0, -1.0])]
    if spec.load_axes == "xyz":
        directions += [np.array([1.0, 0, 0]), np.array([0, 1.0, 0])]
    both = [up_and_down(LOADS[arm.name], direction) for direction in directions]
    up = len(LOADS[arm.name])
    return both if spec.up_down else [(loads[:up], down[:up]) for loads, down in both]


def campaign(arm: Arm, spec: SetSpec, rng: np.random.Generator) -> Readings:
    """All readings in the order of time."""
    q = poses(arm, spec.poses, rng, spec.design)
    order = rng.permutation(len(q))
    if spec.order == "sorted":
        tool = frames(arm, q).tool
        order = np.argsort(np.hypot(tool[:, 0], tool[:, 1]))
    return repeated(q[order], cycles(arm, spec), spec.repeats)
