"""Laws of gears: springs, and what lags behind the load."""

from __future__ import annotations

import numpy as np

from ..shared import log_uniform, sign
from .arms import Floats, Robot, lateral
from .law import Law, Scene, Sizes, at_joints, rating

# Angle of joint 2 at which the upper arm stands, rad; of others 0.
UPRIGHT = {"kr60-3": -np.pi / 2}


def _linear(scene: Scene, k: int) -> Floats:
    return np.asarray(scene.compliance[k] * scene.torque[:, k])


def _total(scene: Scene, k: int) -> Floats:
    return scene.torque[:, k] + scene.weight[:, k]


def spring(scene: Scene, k: int, v: Sizes) -> Floats:
    """A spring that the model does not have."""
    return scene.torque[:, k] / v["stiffness_Nm_per_rad"]


def tilting(scene: Scene, k: int, v: Sizes) -> Floats:
    """Two springs across the axis, one softer, turned by an angle about it."""
    across = lateral(scene.arm, k)
    turn, k1 = v["turn_rad"], v["stiffness_Nm_per_rad"]
    first = np.cos(turn) * across[0] + np.sin(turn) * across[1]
    second = -np.sin(turn) * across[0] + np.cos(turn) * across[1]
    flexibility = np.zeros((6, 6))
    flexibility[3:, 3:] = np.outer(first, first) / k1 + np.outer(second, second) / (k1 * v["ratio"])
    return scene.part(k, flexibility)


def lobed(scene: Scene, k: int, v: Sizes) -> Floats:
    """Compliance over the angle: one wave a turn and a triangle wave of two, as of worn sectors."""
    q = scene.q[scene.pose, k] - v["phase_rad"]
    triangle = 2.0 / np.pi * np.arcsin(np.sin(2.0 * q + v["second_phase_rad"]))
    return np.asarray(_linear(scene, k) * v["share"] * (0.75 * np.cos(q) + 0.25 * triangle))


def three_slopes(scene: Scene, k: int, v: Sizes) -> Floats:
    """A maker's curve: each of two knees takes a share of the compliance away."""
    t = _total(scene, k)
    beyond = sum(v[f"share{i}"] * np.maximum(np.abs(t) - v[f"knee{i}_Nm"], 0.0) for i in (1, 2))
    return np.asarray(-scene.compliance[k] * np.sign(t) * beyond)


def lost_preload(scene: Scene, k: int, v: Sizes) -> Floats:
    """Bearings lose their preload: past a rounded knee the compliance is greater by a share."""
    t, knee = _total(scene, k), v["knee_Nm"]
    round_, x = 0.15 * knee, np.abs(t) - knee
    bent = 0.5 * (x + np.hypot(x, round_)) - 0.5 * (np.hypot(knee, round_) - knee)
    return np.asarray(scene.compliance[k] * v["share"] * np.sign(t) * bent)


def meshing(scene: Scene, k: int, v: Sizes) -> Floats:
    """Compliance that waves with the teeth, with an overtone."""
    wave = v["teeth"] * scene.q[scene.pose, k] + v["phase_rad"]
    return np.asarray(_linear(scene, k) * v["share"] * (np.sin(wave) + 0.35 * np.sin(2.0 * wave + 1.0)))


def strut(scene: Scene, k: int, v: Sizes) -> Floats:
    """A coil spring between two pins beside the joint: stiffness added in parallel, from the pins' geometry.

    It pulls the upper arm upright, where it adds most; the pins stand by up to 0.3 rad off that.
    """
    grid = np.linspace(-np.pi, np.pi, 721)
    length = np.sqrt(1.0 + v["pins"] ** 2 + 2.0 * v["pins"] * np.cos(grid))
    slope = np.gradient(np.sin(grid) * (1.0 - 0.5 * (1.0 - v["pins"]) / length), grid)
    angle = np.mod(scene.q[scene.pose, k] - v["phase_rad"] + np.pi, 2.0 * np.pi) - np.pi
    g = np.interp(angle, grid, slope / np.max(np.abs(slope)))
    return np.asarray(_linear(scene, k) * (1.0 / (1.0 + v["share"] * g) - 1.0))


def wrist(scene: Scene, k: int, v: Sizes) -> Floats:
    """Two wrist gears on nested shafts: each turns with the other's torque."""
    c = v["share"] * np.sqrt(scene.compliance[k] * scene.compliance[k + 1])
    return scene.turned(k, c * scene.torque[:, k + 1]) + scene.turned(k + 1, c * scene.torque[:, k])


def _six(arm: Robot) -> tuple[str, ...]:
    return (arm.names[3],) if arm.dof == 6 else ()


def _looped(arm: Robot) -> tuple[str, ...]:
    return (arm.names[2],) if arm.parallelogram else ()


def bar(scene: Scene, k: int, v: Sizes) -> Floats:
    """The parallelogram's bar gives along itself; its lever about the elbow is the pin's distance times a sine."""
    lever = scene.arm.pin_behind * np.sin(scene.q[scene.pose, 2])
    return np.asarray(scene.torque[:, 2] / (v["stiffness_N_per_m"] * np.maximum(lever**2, 1e-4)))


def mixed_path(scene: Scene, k: int, v: Sizes) -> Floats:
    """A worn bar: a share of the forearm's moment still goes through the second spring."""
    turns = scene.at.turns[scene.pose]
    way = float(np.dot(scene.arm.axes[1].axis, scene.arm.axes[2].axis))
    serial, own = turns[:, 1] + way * turns[:, 2], turns[:, 1]
    carried = [np.einsum("ni,ni->n", a, scene.wrench)[:, None] * a for a in (serial, own)]
    return np.asarray(v["share"] * scene.compliance[1] * (carried[0] - carried[1]))


def neighbours(scene: Scene, k: int, v: Sizes) -> Floats:
    """Two joints in one casing: each gives a little with the other's torque."""
    c = v["share"] * np.sqrt(scene.compliance[k] * scene.compliance[k + 1])
    return scene.turned(k, c * scene.torque[:, k + 1]) + scene.turned(k + 1, c * scene.torque[:, k])


def _phase(rng: np.random.Generator) -> float:
    return float(rng.uniform(-np.pi, np.pi))


def _knees(rng: np.random.Generator, arm: Robot, k: int) -> dict[str, float]:
    t = rating(arm, k)
    return {
        "knee1_Nm": t * rng.uniform(0.1, 0.3),
        "share1": rng.uniform(0.15, 0.35),
        "knee2_Nm": t * rng.uniform(0.35, 0.6),
        "share2": rng.uniform(0.05, 0.25),
    }


GEARS = (
    Law(
        "joint-compliance",
        ("pose", "load"),
        at_joints(),
        lambda rng, arm, k: {"stiffness_Nm_per_rad": log_uniform(rng, 5e4, 2e6)},
        theta=spring,
    ),
    Law(
        "joint-tilt",
        ("pose", "load"),
        at_joints(),
        lambda rng, arm, k: {
            "stiffness_Nm_per_rad": log_uniform(rng, 5e5, 4e6),
            "ratio": rng.uniform(1.0, 1.8),
            "turn_rad": _phase(rng),
        },
        gives=tilting,
    ),
    Law(
        "angle-dependent-stiffness",
        ("pose", "load"),
        at_joints(1, 2, 3, 4),
        lambda rng, arm, k: {
            "share": rng.uniform(0.10, 0.45),
            "phase_rad": _phase(rng),
            "second_phase_rad": _phase(rng),
        },
        theta=lobed,
    ),
    Law("hardening", ("load",), at_joints(1, 2, 3, 4), _knees, theta=three_slopes),
    Law(
        "softening",
        ("load",),
        at_joints(1, 2, 3, 4),
        lambda rng, arm, k: {"share": rng.uniform(0.2, 0.7), "knee_Nm": rating(arm, k) * rng.uniform(0.15, 0.4)},
        theta=lost_preload,
    ),
    Law(
        "gear-ripple",
        ("pose", "load"),
        at_joints(1, 2, 3),
        lambda rng, arm, k: {
            "share": rng.uniform(0.05, 0.25),
            "teeth": float(rng.integers(20, 90)),
            "phase_rad": _phase(rng),
        },
        theta=meshing,
    ),
    Law(
        "gravity-compensator",
        ("pose", "load"),
        at_joints(1),
        lambda rng, arm, k: {
            "share": rng.uniform(0.10, 0.40),
            "pins": rng.uniform(0.2, 0.7),
            "phase_rad": UPRIGHT.get(arm.name, 0.0) + rng.uniform(-0.3, 0.3),
        },
        theta=strut,
    ),
    Law(
        "wrist-coupling",
        ("pose", "load"),
        _six,
        lambda rng, arm, k: {"share": sign(rng) * rng.uniform(0.2, 0.6)},
        gives=wrist,
    ),
    Law(
        "parallelogram-bar",
        ("pose", "load"),
        _looped,
        lambda rng, arm, k: {"stiffness_N_per_m": log_uniform(rng, 5e6, 4e7)},
        theta=bar,
    ),
)
GEARS_OUTSIDE = (
    Law(
        "partial-load-path",
        ("pose", "load"),
        _looped,
        lambda rng, arm, k: {"share": rng.uniform(0.15, 0.5)},
        gives=mixed_path,
    ),
    Law(
        "other:joints-coupled",
        ("pose", "load"),
        at_joints(1),
        lambda rng, arm, k: {"share": sign(rng) * rng.uniform(0.15, 0.5)},
        gives=neighbours,
    ),
)


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


LAGS = (
    Law("backlash", ("load", "load history"), at_joints(1, 2, 3, 4), _gap, theta=backlash, steady=False),
    Law("friction", ("load history",), at_joints(1, 2), _bouc_wen, theta=friction, steady=False),
)
LAGS_OUTSIDE = (
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
