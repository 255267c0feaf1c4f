"""Laws of structure, of what the table says, and of gauges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..shared import log_uniform, sign
from .arms import Floats, Robot, beams
from .law import Law, Rig, Scene, Sizes, Timeline, at, at_joints


def _diagonal(*values: float) -> Floats:
    return np.diag(np.array(values))


def base_tilt(scene: Scene, k: int, v: Sizes) -> Floats:
    """The foot gives about x and y, unequally: two bolts sit on a joint of the floor slab."""
    kx = v["stiffness_Nm_per_rad"]
    return scene.part(-2, _diagonal(0.0, 0.0, 0.0, 1.0 / kx, v["ratio"] / kx, 0.0))


def base_vertical(scene: Scene, k: int, v: Sizes) -> Floats:
    return scene.part(-2, _diagonal(0.0, 0.0, 1.0 / v["stiffness_N_per_m"], 0.0, 0.0, 0.0))


def tool(scene: Scene, k: int, v: Sizes) -> Floats:
    """The adapter bends across the flange axis, a little more one way than the other."""
    c = v["compliance_m_per_N"]
    return scene.part(-1, _diagonal(c, c * v["ratio"], 0.0, 0.0, 0.0, 0.0))


def lifting(scene: Scene, k: int, v: Sizes) -> Floats:
    """Anchor bolts stretch once the foot has lifted: beyond a moment the base tilts, about each axis by itself."""
    moment = scene.carried(-2)[:, 3:5]
    beyond = np.sign(moment) * np.maximum(np.abs(moment) - v["lifts_at_Nm"], 0.0)
    angle = np.zeros((len(moment), 6))
    angle[:, 3:5] = beyond / v["stiffness_Nm_per_rad"]
    return np.asarray(np.einsum("nij,nj->ni", scene.at.parts[scene.pose, -2], angle))


def sinking(scene: Scene, k: int, v: Sizes) -> Floats:
    """The slab creeps: the base goes on tilting with the logarithm of the time since the weights went on."""
    hung = np.linalg.norm(scene.wrench[:, :3], axis=1) > 0.0
    since, first = np.zeros(len(hung)), 0.0
    for i in range(len(hung)):
        first = first if hung[i] else float(scene.line.time[i])
        since[i] = scene.line.time[i] - first
    c = np.log10(1.0 + since / 20.0) / v["stiffness_Nm_per_rad"]
    return np.asarray(scene.part(-2, _diagonal(0.0, 0.0, 0.0, 1.0, 1.0, 0.0)) * c[:, None])


def fixture_slip(scene: Scene, part: int, length: float, hold: float) -> Floats:
    """Past a force the fixture slips along it, once in a set-up, and stays until the arm drives on."""
    force = scene.wrench[:, :3]
    size = np.linalg.norm(force, axis=1)

    def gone(f: Floats, _: Floats) -> Floats:
        return np.maximum.accumulate((f > hold).astype(float))

    slipped = scene.by_visit(gone, size)
    way = np.zeros((len(size), 3))
    last = np.array([0.0, 0.0, -1.0])
    for i in range(len(size)):
        last = force[i] / size[i] if size[i] > hold else last
        way[i] = last
    move = np.zeros((len(size), 6))
    if part == -1:
        move[:, :3] = slipped[:, None] * length * way
        return move
    # The foot slides and rocks about the edge it slides on, half a metre from its middle.
    rock = np.cross(np.tile([0.0, 0.0, 1.0], (len(size), 1)), way + np.array([1e-3, 0.0, 0.0]))
    tilt = np.cross(scene.at.tool[scene.pose], force)
    norm = np.maximum(np.linalg.norm(tilt, axis=1, keepdims=True), 1e-9)
    move[:, 3:] = slipped[:, None] * length / 0.5 * (tilt / norm + 0.1 * rock)
    return np.asarray(np.einsum("nij,nj->ni", scene.at.parts[scene.pose, -2], move))


def cable(scene: Scene, k: int, v: Sizes) -> Floats:
    """A hose pack from shoulder to wrist: a spring in tension only, which stiffens the joints between when taut."""
    at = scene.at
    span = at.centres[:, 4] - at.centres[:, 1]
    length = np.linalg.norm(span, axis=1)
    way = span / length[:, None]
    pull = np.zeros((len(length), scene.arm.dof))
    for j in range(1, 4):
        pull[:, j] = np.einsum("ni,ni->n", way, np.cross(at.turns[:, j, 3:], at.centres[:, 4] - at.centres[:, j]))
    taut = v["stiffness_N_per_m"] * np.clip((length - v["slack_m"]) / 0.06, 0.0, 1.0)
    c = scene.compliance
    lever, size = (c * pull)[scene.pose], taut / (1.0 + taut * np.einsum("nj,j,nj->n", pull, c, pull))
    turn = -lever * (size[scene.pose] * np.einsum("nj,nj->n", lever, scene.torque))[:, None]
    return np.asarray(np.einsum("nji,nj->ni", at.turns[scene.pose], turn))


def thin(scene: Scene, k: int, v: Sizes) -> Floats:
    """A link cast with a thinner wall of a softer alloy: torsion and bending give in shares of their own."""
    name = scene.arm.name
    plain, cast = beams(name)[k], beams(name, 1.0 - v["wall_share"], 1.0 - v["modulus_share"])[k]
    return scene.part(plain.body, cast.flexibility - plain.flexibility)


def _slender(arm: Robot) -> tuple[str, ...]:
    """Links of arms without a parallelogram, by their names; the wrist's stub is none."""
    return () if arm.parallelogram else tuple(b.name for b in beams(arm.name)[:-1])


def _open_chain(arm: Robot) -> tuple[str, ...]:
    return () if arm.parallelogram else ("arm",)


def _pack(rng: np.random.Generator, arm: Robot, k: int) -> dict[str, float]:
    stretched = sum(float(np.linalg.norm(a.xyz)) for a in arm.axes[2:5])
    return {"stiffness_N_per_m": log_uniform(rng, 3e5, 3e6), "slack_m": stretched * rng.uniform(0.6, 0.85)}


STRUCTURE = (
    Law(
        "link-flexibility",
        ("pose", "load"),
        _slender,
        lambda rng, arm, k: {"wall_share": rng.uniform(0.1, 0.35), "modulus_share": rng.uniform(0.0, 0.1)},
        gives=thin,
    ),
    Law(
        "base-tilt",
        ("pose", "load"),
        at("base"),
        lambda rng, arm, k: {"stiffness_Nm_per_rad": log_uniform(rng, 2e6, 1e8), "ratio": rng.uniform(0.5, 1.5)},
        gives=base_tilt,
    ),
    Law(
        "base-vertical",
        ("load",),
        at("base"),
        lambda rng, arm, k: {"stiffness_N_per_m": log_uniform(rng, 2e6, 1e8)},
        gives=base_vertical,
    ),
    Law(
        "tool-compliance",
        ("pose", "load"),
        at("tool"),
        lambda rng, arm, k: {"compliance_m_per_N": rng.uniform(1.5e-7, 6e-7), "ratio": rng.uniform(0.8, 1.25)},
        gives=tool,
    ),
)
STRUCTURE_OUTSIDE = (
    Law(
        "loose-base",
        ("pose", "load"),
        at("base"),
        lambda rng, arm, k: {
            "lifts_at_Nm": arm.payload * 9.81 * rng.uniform(0.2, 0.6),
            "stiffness_Nm_per_rad": log_uniform(rng, 1.5e6, 1e7),
        },
        gives=lifting,
    ),
    Law("cable-package", ("pose",), _open_chain, _pack, gives=cable),
    Law(
        "slip",
        ("load", "load history"),
        at("tool"),
        lambda rng, arm, k: {
            "hold_N": arm.payload * 9.81 * rng.uniform(0.2, 0.45),
            "slip_m": rng.uniform(1.5e-5, 8e-5),
        },
        gives=lambda scene, k, v: fixture_slip(scene, -1, v["slip_m"], v["hold_N"]),
        steady=False,
    ),
    Law(
        "slip",
        ("load", "load history"),
        at("base"),
        lambda rng, arm, k: {"hold_N": arm.payload * 9.81 * rng.uniform(0.2, 0.45), "slip_m": rng.uniform(1e-5, 5e-5)},
        gives=lambda scene, k, v: fixture_slip(scene, -2, v["slip_m"], v["hold_N"]),
        steady=False,
    ),
    Law(
        "other:floor-creep",
        ("clock", "load history", "pose"),
        at("base"),
        lambda rng, arm, k: {"stiffness_Nm_per_rad": log_uniform(rng, 4e6, 3e7)},
        gives=sinking,
        steady=False,
    ),
)


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
        return {"about_x_rad": 0.0, "about_y_rad": 0.0, "about_z_rad": sign(rng) * np.radians(rng.uniform(2, 8))}
    x, y = np.radians(rng.uniform(0.6, 2.0, 2)) * rng.choice([-1.0, 1.0], 2)
    return {"about_x_rad": float(x), "about_y_rad": float(y), "about_z_rad": 0.0}


def _parallel(arm: Robot) -> tuple[str, ...]:
    """Joints whose axis is parallel to that of the joint before."""
    found = [k for k in range(1, arm.dof) if abs(np.array(arm.axes[k].turn)[2, 2]) > 0.999]
    return tuple(arm.names[k] for k in found if k >= 2 and arm.axes[k].axis[2] != 0 and np.hypot(*arm.axes[k].xyz[:2]))


def _serial_in_the_model(arm: Robot) -> tuple[str, ...]:
    return ("arm",) if arm.parallelogram else ()


BOTH = ("pose", "load")
TABLE = (
    Law("payload", ("load",), at("load"), lambda rng, arm, k: {"force_N": rng.uniform(20, 60)}, rig=payload),
    Law("load-point-offset", BOTH, at("load"), _aside, rig=beside),
    Law("load-misalignment", ("pose", "load", "direction"), at("load"), _slant, rig=misaligned),
    Law(
        "joint-zero-offset",
        BOTH,
        at_joints(1, 2, 3, 4),
        lambda rng, arm, k: {"angle_rad": sign(rng) * np.radians(log_uniform(rng, 0.3, 3.0))},
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
    Law("angle-coupling", ("pose",), _parallel, lambda rng, arm, k: {"way": sign(rng)}, rig=from_the_horizontal),
    Law("load-path", BOTH, _serial_in_the_model, lambda rng, arm, k: {}, rig=parallelogram),
)
TABLE_OUTSIDE = (
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


def _vector(v: Sizes) -> Floats:
    return np.array([v["x_m"], v["y_m"], v["z_m"]])


def zero(scene: Scene, d: Floats, v: Sizes) -> Floats:
    return d + _vector(v)


def scale(scene: Scene, d: Floats, v: Sizes) -> Floats:
    return d * (1.0 + v["share"])


def drift(scene: Scene, d: Floats, v: Sizes) -> Floats:
    """The tracker's stand moves after switching on, fast and then slowly; it is set up anew every morning."""
    hours = (scene.clock - scene.line.morning) / 3600.0
    grown = 0.6 * (1.0 - np.exp(-hours / v["time_h"])) + 0.4 * np.minimum(hours, 8.0) / 8.0
    return np.asarray(d + grown[:, None] * _vector(v))


def touched(scene: Scene, d: Floats, v: Sizes) -> Floats:
    """Someone leaned on the stand: from then on all readings are off, until the stand is set up again days later."""
    after = (scene.clock > v["when"] * scene.span) & (scene.clock < scene.span + 1.0)
    return np.asarray(d + after[:, None] * _vector(v))


def warm_frame(scene: Scene, d: Floats, v: Sizes) -> Floats:
    """The measuring frame grows with the hall's temperature since the morning's zero."""
    _, first, day = np.unique(scene.line.session, return_index=True, return_inverse=True)
    return np.asarray(d + (scene.air - scene.air[first][day])[:, None] * _vector(v))


def sticky(scene: Scene, d: Floats, v: Sizes) -> Floats:
    """The plunger lags by up to a length: a play operator on each axis."""
    out = np.empty_like(d)
    for axis in range(3):

        def lag(x: Floats, _: Floats) -> Floats:
            at, held = 0.0, np.empty(len(x))
            for i, value in enumerate(x):
                at = min(max(at, value - v["play_m"]), value + v["play_m"])
                held[i] = at
            return held

        out[:, axis] = scene.by_visit(lag, d[:, axis])
    return out


def _offsets(rng: np.random.Generator, low: float, high: float) -> dict[str, float]:
    return {name: sign(rng) * rng.uniform(low, high) for name in ("x_m", "y_m", "z_m")}


def _drifts(rng: np.random.Generator, arm: Robot, k: int) -> dict[str, float]:
    return {**_offsets(rng, 2e-5, 8e-5), "time_h": rng.uniform(0.5, 3.0)}


GAUGES = (
    Law("gauge-zero", ("load",), at("gauge"), lambda rng, arm, k: _offsets(rng, 15e-6, 45e-6), reads=zero),
    Law(
        "gauge-scale",
        ("load",),
        at("gauge"),
        lambda rng, arm, k: {"share": sign(rng) * rng.uniform(0.02, 0.08)},
        reads=scale,
    ),
    Law("drift", ("clock",), at("gauge"), _drifts, reads=drift, slow=True),
)
GAUGES_OUTSIDE = (
    Law(
        "other:gauge-touched",
        ("clock",),
        at("gauge"),
        lambda rng, arm, k: {**_offsets(rng, 2e-5, 8e-5), "when": rng.uniform(0.3, 0.7)},
        reads=touched,
        slow=True,
    ),
    Law(
        "other:frame-temperature",
        ("temperature", "clock"),
        at("gauge"),
        lambda rng, arm, k: _offsets(rng, 3e-6, 1.2e-5),
        reads=warm_frame,
        slow=True,
    ),
    Law(
        "other:gauge-stick",
        ("load history",),
        at("gauge"),
        lambda rng, arm, k: {"play_m": rng.uniform(8e-6, 3e-5)},
        reads=sticky,
        steady=False,
    ),
)
