"""Laws of joints with memory or a clock: play, Bouc-Wen, sticking, creep, warming, settling.

Memory is that of one set-up: while the arm drives to the next, servo and brakes shake friction loose. What is slow
(warmth, settling) goes on over the whole campaign.
"""

from __future__ import annotations

import numpy as np

from benchmarks.worlds.shopfloor.arms import Floats, Robot
from benchmarks.worlds.shopfloor.law import Law, Scene, Sizes, at_joints, log_uniform, rating


def backlash(scene: Scene, k: int, v: Sizes) -> Floats:
    """Teeth cross the gap over a narrow band of torque, with play inside it; link weights hold them on a flank."""
    band, play = v["closing_Nm"], v["play_Nm"]

    def crossing(torque: Floats, _: Floats) -> Floats:
        at, out = float(np.clip(torque[0] / band, -1.0, 1.0)), np.empty(len(torque))
        for i, t in enumerate(torque):
            at = float(np.clip(np.clip(at, (t - play) / band, (t + play) / band), -1.0, 1.0))
            out[i] = at
        return out

    return 0.5 * v["gap_rad"] * scene.by_visit(crossing, scene.torque[:, k] + scene.weight[:, k])


def held_back(torque: Floats, rise: float, most: tuple[float, float]) -> Floats:
    """Bouc-Wen's force (n = 1, beta = gamma) in closed form from turning point to turning point.

    ``dz/dt = rise (1 - |z| / most)`` while z grows, ``rise`` while it falls; ``most`` is for z > 0 and z < 0.
    """
    z, last, out = 0.0, 0.0, np.empty(len(torque))
    for i, t in enumerate(torque):
        step, last = t - last, t
        way = np.sign(step)
        if z * way < 0.0:
            back = min(abs(step), abs(z) / rise)
            z, step = z + way * rise * back, step - way * back
        limit = most[0] if way > 0 else most[1]
        if step:
            z = way * (limit - (limit - min(abs(z), limit)) * np.exp(-rise * abs(step) / limit))
        out[i] = z
    return out


def friction(scene: Scene, k: int, v: Sizes) -> Floats:
    most = (v["torque_Nm"] * (1.0 + v["asymmetry"]), v["torque_Nm"] * (1.0 - v["asymmetry"]))
    z = scene.by_visit(lambda torque, _: held_back(torque, v["rise"], most), scene.torque[:, k])
    return np.asarray(-scene.compliance[k] * z)


def sticking(scene: Scene, k: int, v: Sizes) -> Floats:
    """The joint sticks until the torque has changed by a threshold, then catches up at once."""

    def lag(torque: Floats, _: Floats) -> Floats:
        held, out = 0.0, np.empty(len(torque))
        for i, t in enumerate(torque):
            if abs(t - held) > v["threshold_Nm"] * (1.0 if t > held else v["back"]):
                held = float(t)
            out[i] = t - held
        return out

    return np.asarray(-v["share"] * scene.compliance[k] * scene.by_visit(lag, scene.torque[:, k]))


def creep(scene: Scene, k: int, v: Sizes) -> Floats:
    """Each change of torque goes on by a power of time (exponent near zero: nearly the logarithm); so does recovery."""
    n = v["exponent"]

    def goes_on(torque: Floats, time: Floats) -> Floats:
        change = np.diff(torque, prepend=0.0)
        age = np.maximum(time[:, None] - time[None, :], 0.0)
        grown = ((1.0 + age / v["time_s"]) ** n - 1.0) / n
        return np.asarray(np.sum(np.tril(grown) * change, axis=1))

    return np.asarray(v["share"] * scene.compliance[k] * scene.by_visit(goes_on, scene.torque[:, k]))


def warming(scene: Scene, k: int, v: Sizes) -> Floats:
    """Grease and preload: the joint gives more as it warms."""
    return np.asarray(scene.compliance[k] * scene.torque[:, k] * v["share"] * scene.warm)


def settling(scene: Scene, k: int, v: Sizes) -> Floats:
    """New bearings bed in: the further compliance dies out with the number of load cycles."""
    beats = np.full(len(scene.torque), np.inf) if scene.fresh else scene.line.count.astype(float)
    return np.asarray(scene.compliance[k] * scene.torque[:, k] * v["share"] * np.exp(-beats / v["cycles"]))


def winding(scene: Scene, k: int, v: Sizes) -> Floats:
    """The gear winds up: a share of the greatest twist of the set-up stays until the arm drives on."""

    def greatest(torque: Floats, _: Floats) -> Floats:
        at = np.maximum.accumulate(np.abs(torque))
        signs = np.sign(torque[np.argmax(np.abs(torque))])
        return np.asarray(signs * at)

    return np.asarray(v["share"] * scene.compliance[k] * scene.by_visit(greatest, scene.torque[:, k]))


def joint_slip(scene: Scene, k: int, v: Sizes) -> Floats:
    """A clamp ring slips once the torque passes its hold, and stays there for the rest of the set-up."""

    def gone(torque: Floats, _: Floats) -> Floats:
        passed = np.abs(torque) > v["hold_Nm"]
        way = np.sign(torque[np.argmax(passed)]) if passed.any() else 0.0
        return np.asarray(way * np.maximum.accumulate(passed).astype(float))

    return v["slip_rad"] * scene.by_visit(gone, scene.torque[:, k])


def _gap(rng: np.random.Generator, arm: Robot, k: int) -> dict[str, float]:
    band = rating(arm, k) * rng.uniform(0.03, 0.1)
    return {"gap_rad": rng.uniform(3e-4, 9e-4), "closing_Nm": band, "play_Nm": band * rng.uniform(0.1, 0.6)}


def _bouc_wen(rng: np.random.Generator, arm: Robot, k: int) -> dict[str, float]:
    return {
        "torque_Nm": rng.uniform(60.0, 225.0),
        "asymmetry": rng.uniform(-0.25, 0.25),
        "rise": rng.uniform(0.7, 0.97),
    }


LAWS = (
    Law("backlash", ("load", "load history"), at_joints(1, 2, 3, 4), _gap, theta=backlash, steady=False),
    Law("friction", ("load history",), at_joints(1, 2), _bouc_wen, theta=friction, steady=False),
)
OUTSIDE = (
    Law(
        "creep",
        ("clock", "load history"),
        at_joints(1, 2),
        lambda rng, arm, k: {
            "share": rng.uniform(0.03, 0.10),
            "time_s": log_uniform(rng, 4.0, 20.0),
            "exponent": rng.uniform(0.02, 0.15),
        },
        theta=creep,
        steady=False,
    ),
    Law(
        "stick-slip",
        ("load history", "load"),
        at_joints(1, 2),
        lambda rng, arm, k: {
            "threshold_Nm": rating(arm, k) * rng.uniform(0.08, 0.3),
            "back": rng.uniform(0.7, 1.4),
            "share": rng.uniform(0.4, 0.9),
        },
        theta=sticking,
        steady=False,
    ),
    Law(
        "warming",
        ("clock", "temperature", "load"),
        at_joints(1, 2),
        lambda rng, arm, k: {"share": rng.uniform(0.08, 0.25)},
        theta=warming,
        slow=True,
    ),
    Law(
        "other:bearing-settling",
        ("clock", "load"),
        at_joints(1, 2, 3),
        lambda rng, arm, k: {"share": rng.uniform(0.15, 0.5), "cycles": log_uniform(rng, 5.0, 40.0)},
        theta=settling,
        slow=True,
    ),
    Law(
        "other:wind-up",
        ("load history",),
        at_joints(1, 2),
        lambda rng, arm, k: {"share": rng.uniform(0.05, 0.2)},
        theta=winding,
        steady=False,
    ),
    Law(
        "slip",
        ("load", "load history"),
        at_joints(1, 2),
        lambda rng, arm, k: {
            "hold_Nm": rating(arm, k) * rng.uniform(0.2, 0.5),
            "slip_rad": log_uniform(rng, 3e-5, 2e-4),
        },
        theta=joint_slip,
        steady=False,
    ),
)
