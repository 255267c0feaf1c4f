"""Laws of the table and the load: what is written down is not what stood or pulled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.worlds.shopfloor.arms import Floats, Robot
from benchmarks.worlds.shopfloor.campaign import Timeline
from benchmarks.worlds.shopfloor.law import Law, Rig, Sizes, at, at_joints, either, log_uniform


def _size(force: Floats) -> Floats:
    return np.asarray(np.linalg.norm(force, axis=1, keepdims=True))


def _way(force: Floats) -> Floats:
    return np.asarray(force / np.maximum(_size(force), 1e-9))


def payload(rig: Rig, line: Timeline, k: int, v: Sizes) -> Rig:
    """Hook and chain come with the weights and are not counted."""
    return replace(rig, force=rig.force + v["force_N"] * _way(rig.force))


def misaligned(rig: Rig, line: Timeline, k: int, v: Sizes) -> Rig:
    turn = Rotation.from_rotvec([v["about_x_rad"], v["about_y_rad"], 0.0])
    return replace(rig, force=turn.apply(rig.force))


def beside(rig: Rig, line: Timeline, k: int, v: Sizes) -> Rig:
    return replace(rig, arm_of_force=rig.arm_of_force + np.array([v["x_m"], v["y_m"], v["z_m"]]))


def elsewhere(rig: Rig, line: Timeline, k: int, v: Sizes) -> Rig:
    return replace(rig, shift=rig.shift + np.array([v["x_m"], v["y_m"], v["z_m"]]))


def zero_off(rig: Rig, line: Timeline, k: int, v: Sizes) -> Rig:
    q = rig.q.copy()
    q[:, k] += v["angle_rad"]
    return replace(rig, q=q)


def other_sign(rig: Rig, line: Timeline, k: int, v: Sizes) -> Rig:
    q = rig.q.copy()
    q[:, k] = -q[:, k]
    return replace(rig, q=q)


def from_the_horizontal(rig: Rig, line: Timeline, k: int, v: Sizes) -> Rig:
    """The written angle counts in the room: the joint before is in it."""
    q = rig.q.copy()
    q[:, k] -= v["way"] * q[:, k - 1]
    return replace(rig, q=q)


def turned(rig: Rig, line: Timeline, k: int, v: Sizes) -> Rig:
    """The tracker's axes are not the base's: forces and displacements are written in turned axes."""
    turn = Rotation.from_rotvec([v["about_x_rad"], v["about_y_rad"], v["about_z_rad"]])
    return replace(rig, force=turn.apply(rig.force), frame=turn.as_matrix() @ rig.frame)


def parallelogram(rig: Rig, line: Timeline, k: int, v: Sizes) -> Rig:
    return replace(rig, loop=True)


def cell_lags(rig: Rig, line: Timeline, k: int, v: Sizes) -> Rig:
    """A load cell reads less coming down than going up, most in the middle of its range."""
    x = _size(rig.force) / v["range_N"]
    back = (line.phase < 0)[:, None] * v["share"] * v["range_N"] * np.clip(4.0 * x * (1.0 - x), 0.0, 1.0)
    return replace(rig, force=rig.force + back * _way(rig.force))


def pulley(rig: Rig, line: Timeline, k: int, v: Sizes) -> Rig:
    """The rope runs over a pulley that rubs: less arrives while pulling, more stays while letting go."""
    return replace(rig, force=rig.force * (1.0 - v["share"] * line.phase[:, None]))


def _aside(rng: np.random.Generator, arm: Robot, k: int) -> dict[str, float]:
    way = rng.normal(size=3)
    x, y, z = rng.uniform(0.015, 0.045) * way / np.linalg.norm(way)
    return {"x_m": float(x), "y_m": float(y), "z_m": float(z)}


def _slant(rng: np.random.Generator, arm: Robot, k: int) -> dict[str, float]:
    size, way = np.radians(rng.uniform(1.5, 4.5)), rng.uniform(0, 2 * np.pi)
    return {"about_x_rad": float(size * np.cos(way)), "about_y_rad": float(size * np.sin(way))}


def _axes(rng: np.random.Generator, arm: Robot, k: int) -> dict[str, float]:
    """Level to a degree or two, or out in azimuth by some degrees."""
    if rng.random() < 0.5:
        return {"about_x_rad": 0.0, "about_y_rad": 0.0, "about_z_rad": either(rng) * np.radians(rng.uniform(2, 8))}
    x, y = np.radians(rng.uniform(0.6, 2.0, 2)) * rng.choice([-1.0, 1.0], 2)
    return {"about_x_rad": float(x), "about_y_rad": float(y), "about_z_rad": 0.0}


def _parallel(arm: Robot) -> tuple[str, ...]:
    """Joints whose axis is parallel to that of the joint before."""
    found = [k for k in range(1, arm.dof) if abs(np.array(arm.axes[k].turn)[2, 2]) > 0.999]
    return tuple(arm.names[k] for k in found if k >= 2 and arm.axes[k].axis[2] != 0 and np.hypot(*arm.axes[k].xyz[:2]))


def _serial_in_the_model(arm: Robot) -> tuple[str, ...]:
    return ("arm",) if arm.parallelogram else ()


BOTH = ("pose", "load")
LAWS = (
    Law("payload", ("load",), at("load"), lambda rng, arm, k: {"force_N": rng.uniform(20, 60)}, rig=payload),
    Law("load-point-offset", BOTH, at("load"), _aside, rig=beside),
    Law("load-misalignment", ("pose", "load", "direction"), at("load"), _slant, rig=misaligned),
    Law(
        "joint-zero-offset",
        BOTH,
        at_joints(1, 2, 3, 4),
        lambda rng, arm, k: {"angle_rad": either(rng) * np.radians(log_uniform(rng, 0.3, 3.0))},
        rig=zero_off,
    ),
    Law("turned-frame", ("pose", "direction"), at("base"), _axes, rig=turned),
    Law("tool-point-offset", BOTH, at("tool"), _aside, rig=elsewhere),
    Law("angle-sign", ("pose",), at_joints(2, 3, 4), lambda rng, arm, k: {}, rig=other_sign),
    Law(
        "angle-offset",
        ("pose",),
        at_joints(1, 2, 3, 4),
        lambda rng, arm, k: {"angle_rad": float(rng.choice([-0.5, 0.5, 1.0])) * np.pi},
        rig=zero_off,
    ),
    Law("angle-coupling", ("pose",), _parallel, lambda rng, arm, k: {"way": either(rng)}, rig=from_the_horizontal),
    Law("load-path", BOTH, _serial_in_the_model, lambda rng, arm, k: {}, rig=parallelogram),
)
OUTSIDE = (
    Law(
        "other:load-cell-hysteresis",
        ("load history",),
        at("load"),
        lambda rng, arm, k: {"share": rng.uniform(0.01, 0.03), "range_N": arm.payload * 9.81 * 0.7},
        rig=cell_lags,
        steady=False,
    ),
    Law(
        "other:pulley-friction",
        ("load history",),
        at("load"),
        lambda rng, arm, k: {"share": rng.uniform(0.015, 0.05)},
        rig=pulley,
        steady=False,
    ),
)
