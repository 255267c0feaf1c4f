"""Laws of what carries the arm and hangs on it: base on anchor bolts, floor, links, tool, cable package."""

from __future__ import annotations

import numpy as np

from benchmarks.worlds.shopfloor.arms import Floats, Robot
from benchmarks.worlds.shopfloor.beams import beams
from benchmarks.worlds.shopfloor.law import Law, Scene, Sizes, at, log_uniform


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


LAWS = (
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
OUTSIDE = (
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
