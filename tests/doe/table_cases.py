"""Small campaigns of bundled robots with rigid links, and what can be done to their readings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from doe.tables.measurements import Measurements
from fem import ArmModel, build_model, deflection
from robots import load_description

# The fixture that builds a model with beams for links.
Arm = Callable[..., ArmModel]
DOWN = ((0.0, 0.0, -1.0),)
THREE_WAYS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0))


@cache
def plain_arm(robot: str) -> ArmModel:
    return build_model(load_description(robot), "rigid")


def with_springs(robot: str, rng: np.random.Generator) -> ArmModel:
    """The arm with springs drawn about 1e6 N m/rad, two thirds of them within a factor of two."""
    model = plain_arm(robot)
    return model.with_springs({name: float(1e6 * np.exp(rng.normal(0.0, 0.7))) for name in model.robot.joint_names})


def table(model: ArmModel, q: np.ndarray, wrench: np.ndarray, read: np.ndarray) -> Measurements:
    """Readings (n, 6), NaN where nothing was read, of poses q (n, dof) under loads wrench (n, 6)."""
    n, unknown = len(q), np.full(len(q), np.nan)
    key = {row: k for k, row in enumerate(dict.fromkeys(map(tuple, q.tolist())))}
    pose = tuple(f"P{key[tuple(row)] + 1}" for row in q.tolist())
    return Measurements(
        source="made up",
        sha256="0" * 64,
        q=q,
        wrench=wrench,
        displacement=read,
        point=np.full((n, 3), np.nan),
        sigma=unknown,
        step=unknown,
        pose=pose,
        repeat=tuple(range(n)),
        phase=(None,) * n,
        row_numbers=tuple(range(2, n + 2)),
        extra={},
        notes=(),
    )


def campaign(
    seed: int,
    *,
    robot: str = "kr60-3",
    poses: int = 9,
    loads: tuple[float, ...] = (150.0, 375.0, 650.0),
    ways: tuple[tuple[float, float, float], ...] = DOWN,
    components: tuple[int, ...] = (2,),
    noise: float = 0.0,
) -> Measurements:
    """Readings of an arm with springs, with white noise of this share of their RMS."""
    rng = np.random.default_rng(seed)
    model = with_springs(robot, rng)
    low, high = model.robot.limits.T
    drawn = rng.uniform(0.7 * low, 0.7 * high, (50 * poses, len(low)))
    q = drawn[model.robot.reachable(drawn)][:poses]
    rows = [(k, load, way) for load in loads for k in range(len(q)) for way in ways]
    wrench = np.array([[*(load * v for v in way), 0.0, 0.0, 0.0] for _, load, way in rows])
    at = q[[k for k, _, _ in rows]]
    exact = deflection(model, at, wrench)
    read = np.where(np.isin(np.arange(6), components), exact, np.nan)
    size = float(np.sqrt(np.nanmean(read**2)))
    return table(model, at, wrench, read + noise * size * rng.normal(size=read.shape))


def spoilt(data: Measurements, how: str, seed: int = 0) -> Measurements:
    """The readings with every second row's sign flipped, or every second one's, drawn anew, or in another order."""
    rng, d = np.random.default_rng(seed), data.displacement
    second = np.where(np.arange(data.n) % 2 == 0, 1.0, -1.0)[:, None]
    k = np.cumsum(data.used.ravel()).reshape(d.shape)
    read = {
        "rows flipped": lambda: d * second,
        "cells flipped": lambda: d * np.where(k % 2 == 0, 1.0, -1.0),
        "random": lambda: np.where(data.used, rng.normal(size=d.shape) * np.nanstd(d), np.nan),
        "shuffled": lambda: d[rng.permutation(data.n)],
        "upside down": lambda: -d,
    }[how]()
    return replace(data, displacement=read)
