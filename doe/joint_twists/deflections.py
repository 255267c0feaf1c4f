"""Tool deflections in place of joint twists: which stiffnesses of joints they can determine together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from doe.estimation.problem import Problem, problem
from doe.tables.measurements import Measurements, largest_rows, load_size
from fem.arm import Arm
from fem.free.parameters import Parameter, parameter
from robots import InputError
from robots.arm_class import arm_class
from robots.arrays import Array

# A stiffness is named where readings determine it to so large a share (standard deviation).
KNOWN_TO = 0.5
# What a reading is worth: 3 % of the deflection, and 3 um or 3 urad.
PERCENT, FLOOR = 0.03, 3e-6
# Gears tilt so many times stiffer than they twist (catalogues of RV gears: 5 to 9).
TILT = 6.0
ROWS = ("rz", "rx", "ry")


def determined_together(given: Arm, data: Sequence[Measurements]) -> list[str]:
    """Names of stiffnesses about the joints' axes and across them, in the order of joints, that readings determine.

    At each pose its largest load counts: more loads show no other directions.
    """
    free = list(_parameters(given))
    rows = [_rows(given, one, free) for one in data]
    S = np.vstack(rows) if rows else np.zeros((0, len(free)))
    chosen: list[int] = []
    left = S.copy()
    while len(chosen) < min(len(S) - 1, len(free)):
        size = np.sum(left**2, axis=0)
        k = int(np.argmax(size))
        if size[k] <= KNOWN_TO**-2 or not _is_determined(S[:, [*chosen, k]]):
            break
        chosen.append(k)
        unit = left[:, k] / np.sqrt(size[k])
        left = left - np.outer(unit, unit @ left)
        left[:, chosen] = 0.0
    return [free[k][0].name for k in sorted(chosen)]


def _is_determined(S: Array) -> bool:
    G = S.T @ S
    return bool(np.linalg.cond(G) < 1e12 and np.sqrt(np.diag(np.linalg.inv(G))).max() < KNOWN_TO)


def _parameters(given: Arm) -> Iterator[tuple[Parameter, float]]:
    """Stiffnesses that can be free, each with a value to expect; those with a law over angles cannot."""
    usual = arm_class(given.description, given.robot)
    middle = np.sqrt(usual.low * usual.high)
    for k, joint in enumerate(given.robot.joint_names):
        about = float(middle[k])
        for row in ROWS:
            try:
                p = parameter(given.model, f"{joint}.{row}")
            except InputError:
                continue
            if row == "rz" and np.isfinite(p.value):
                about = p.value
            yield p, p.value if np.isfinite(p.value) else about * (1.0 if row == "rz" else TILT)


def _rows(given: Arm, data: Measurements, free: Sequence[tuple[Parameter, float]]) -> Array:
    """Change of readings (m, p), in standard deviations, by the logarithm of each stiffness."""
    mask = np.zeros(data.n, dtype=np.bool_)
    mask[largest_rows(data.pose, load_size(data.wrench))] = True
    p: Problem = problem(given.model, data.select(mask), [one for one, _ in free])
    u = np.array([1.0 / value for _, value in free])
    f, J = p.evaluate(u)
    return np.asarray(J * u / np.hypot(PERCENT * f, FLOOR)[:, None])
