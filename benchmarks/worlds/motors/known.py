"""The families that a diagnosis could know, as rows of a table, and the physics behind each."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..shared import direction
from .arm import Brush, Clamp, Dahl, Kelvin, Law, Now, Spring, clamped, cross, direct, gap, hertz, then, turn, unloading
from .spec import ANGLE, ANYWHERE, LEVEL, Case, Machine, Numbers, Pick, Range, Rng, Row, Scene, follows

Array = NDArray[np.float64]
X, Y, Z = np.eye(3)
NONE = np.zeros(3)
ALMOST = 1e-9  # of a size: what is not there gives way by so much
HELD = 1e-14  # m/N


def some(size: float) -> float:
    return max(size, ALMOST)


def joint(m: Machine, place: str) -> tuple[int, Array]:
    """Its number and its drive's stiffness (B,)."""
    i = m.arm.joints.index(place)
    return i, m.spring[:, i]


# Joints: about their axes and across.


def compliance(m: Machine, n: Numbers, place: str) -> None:
    """A joint that the model holds rigid."""
    i, _ = joint(m, place)
    m.parts[i].law = Spring(np.full(len(m.q), n["k"] / some(n["size"])))


def tilt(m: Machine, n: Numbers, place: str) -> None:
    """A crossed-roller bearing gives way across its axis, softer towards the side that it is loaded from."""
    i, _ = joint(m, place)
    axis = direct(m.arm.fixed[i], m.arm.about[i])
    first = cross(axis, X if abs(axis[0]) < 0.8 else Y)
    for k, way in ((1.0, first), (n["other"], cross(axis, first))):
        m.free(i, m.arm.ends[i], way, Spring(k * n["k"] / some(n["size"])))


def by_angle(m: Machine, n: Numbers, place: str) -> None:
    """An eccentric wheel and an oval one on one shaft."""
    i, k = joint(m, place)
    a = m.turned[:, i]
    m.parts[i].law = Spring(k / (1 + n["size"] * (np.cos(a - n["one"]) + 0.3 * np.cos(2 * a - n["two"]))))


def ripple(m: Machine, n: Numbers, place: str) -> None:
    """Teeth in mesh, now one pair and now two: a wave with its octave."""
    i, k = joint(m, place)
    a = n["teeth"] * m.turned[:, i]
    m.parts[i].law = Spring(k / (1 + n["size"] * (np.sin(a - n["one"]) + 0.35 * np.sin(2 * a - n["two"]))))


def compensator(m: Machine, n: Numbers, place: str) -> None:
    """A spring between a pin on the carousel and one on the upper arm, always stretched: V = c (l - l0)^2 / 2."""
    i, k = joint(m, place)
    a, b = 1.0, n["ratio"]
    c, at, slack = n["size"] * k / b**2, m.turned[:, i] + n["at"], 0.9 * (a - b)

    def stretched(angle: Array) -> tuple[Array, Array]:
        length = np.sqrt(a**2 + b**2 - 2 * a * b * np.cos(angle))
        slope = a * b * np.sin(angle) / length
        bend = (a * b * np.cos(angle) - slope**2) / length
        return c * (length - slack) * slope, c * (slope**2 + (length - slack) * bend)

    class Pinned(Law):
        def pull(self, y: Array, kept: Array, now: Now) -> tuple[Array, Array]:
            torque, stiff = stretched(at + y)
            return torque - stretched(at)[0], stiff

    m.beside({i: 1.0}, Pinned())


def hardening(m: Machine, n: Numbers, place: str) -> None:
    """Balls in races, in a row with the gear: they give way at first, and less and less."""
    i, k = joint(m, place)
    m.behind(i, hertz(n["torque"], some(n["size"]) * n["torque"] / k))


def softening(m: Machine, n: Numbers, place: str) -> None:
    i, k = joint(m, place)
    m.parts[i].law = unloading(k, n["torque"], n["size"])


def backlash(m: Machine, n: Numbers, place: str) -> None:
    i, k = joint(m, place)
    m.parts[i].law = gap(k, n["size"], n["hangs"] * n["size"], n["soft"])


def friction(m: Machine, n: Numbers, place: str) -> None:
    i, k = joint(m, place)
    m.beside(m.along(i), Dahl(n["size"], n["bristles"] * k))


def stick_slip(m: Machine, n: Numbers, place: str) -> None:
    i, k = joint(m, place)
    holds = n["size"] * np.array(n["shares"])
    m.beside(m.along(i), Brush(holds, k[:, None] * np.array(n["stiff"]), n["left"]))


def creep(m: Machine, n: Numbers, place: str) -> None:
    i, k = joint(m, place)
    m.parts[i].law = Kelvin(k, n["size"] * np.array(n["shares"]), np.array(n["times_s"]))


def slip(m: Machine, n: Numbers, place: str) -> None:
    """What was clamped settles under the first load that is too much for it."""
    law = Clamp(n["holds"], n["size"], n["lasting"])
    if place == "base":
        for way in (X, Y):
            m.free(0, NONE, way, law)
    elif place == "tool":
        for way in (X, Y, Z):
            m.free(len(m.arm.joints), m.arm.flange, way, law, slides=True)
    else:
        m.behind(m.arm.joints.index(place), law)


def slip_numbers(rng: Rng, scene: Scene, place: str) -> dict[str, float]:
    """Where it lets go, and rad per N m or m per N beyond."""
    at = rng.uniform(0.3, 0.7)
    if place == "tool":
        force = scene.unit("force", "")
        return {"holds": at * force, "size": rng.uniform(1e-4, 4e-4) / ((1 - at) * force)}
    if place == "base":
        gives = np.exp(rng.uniform(np.log(4e-8), np.log(2.5e-7)))
        return {"holds": at * scene.unit("weight", ""), "size": float(gives / scene.arm.size)}
    return {"holds": at * scene.unit("torque", place), "size": rng.uniform(0.4, 1.4) / scene.unit("spring", place)}


def warming(m: Machine, n: Numbers, place: str) -> None:
    """Oil and seals follow the hall by their lag."""
    i, k = joint(m, place)
    m.parts[i].law = Spring(k, [lambda now: 1 + n["size"] * follows(m.air, now.since_s, n["lag_s"])])


def wrist(m: Machine, n: Numbers, place: str) -> None:
    """The fifth motor's shaft runs through the fourth joint: what it holds is a sum of both."""
    m.parts[4].over[3] = n["size"] * n["ratio"]


def cables(m: Machine, n: Numbers, place: str) -> None:
    """A hose twisted from the forearm to the flange: the more turns are in it the more it holds."""
    _, k = joint(m, place)
    wound = np.abs(m.turned[:, 3] + 0.5 * m.turned[:, 5]) / np.pi
    m.beside({3: 1.0, 5: 0.5}, Spring(n["size"] * k * np.minimum(wound, 2) ** n["power"]))


# Bodies: the base, casings, the parallelogram, the tool.


def base_tilt(m: Machine, n: Numbers, place: str) -> None:
    """Its soft side looks anywhere."""
    soft = np.array([np.cos(n["at"]), np.sin(n["at"]), 0])
    m.free(0, NONE, soft, Spring(n["k"] / some(n["size"])))
    m.free(0, NONE, cross(Z, soft), Spring(n["other"] * n["k"] / some(n["size"])))


def base_vertical(m: Machine, n: Numbers, place: str) -> None:
    m.free(0, NONE, Z, Spring(n["k"] / some(n["size"])), slides=True)


def loose_base(m: Machine, n: Numbers, place: str) -> None:
    """A plate whose bolts were not tightened: when the clamping force is used up it rocks on its edge."""
    for way in (X, Y):
        m.free(0, NONE, way, clamped(n["k"] / some(n["size"]), n["holds"], n["left"]))


def tool(m: Machine, n: Numbers, place: str) -> None:
    side = np.array([np.cos(n["at"]), np.sin(n["at"]), 0])
    for k, way in ((1.0, side), (n["other"], cross(Z, side))):
        m.free(len(m.arm.joints), m.arm.flange, way, Spring(k / max(n["size"], HELD)), slides=True)


def link(m: Machine, n: Numbers, place: str) -> None:
    """A tapered beam: hinges at Gauss's two points bend as it does under any load at its end."""
    casing = next(c for c in m.arm.casings if c.name == place)
    end = m.arm.ends[casing.body]
    long = float(np.linalg.norm(end))
    side = cross(end / long, X if abs(end[0]) < 0.8 * long else Y)
    for at in (0.5 - np.sqrt(1 / 12), 0.5 + np.sqrt(1 / 12)):
        bend, twist = (a + at * (b - a) for a, b in (casing.bending, casing.torsion))
        for k, way in ((bend, side), (bend, cross(end / long, side)), (twist, end)):
            m.free(casing.body, at * end, way, Spring(2 * k / long / some(n["size"])))


def bar(m: Machine, n: Numbers, place: str) -> None:
    """It holds the forearm's pin by its lever about the elbow, which shrinks as the parallelogram flattens."""
    assert m.arm.pin is not None
    pin = direct(then(m.arm.fixed[2], turn(m.arm.about[2], NONE, m.turned[:, 2])), m.arm.pin)
    along = m.arm.ends[2] / np.linalg.norm(m.arm.ends[2])
    lever = np.linalg.norm(np.cross(pin, along), axis=1)
    m.behind(2, Spring(n["k"] * lever**2 / some(n["size"])))


def path(m: Machine, n: Numbers, place: str) -> None:
    """A share of the forearm's moment goes the way that the model does not have."""
    m.divide(1 - n["size"] if 1 in m.parts[2].over else n["size"])


# The set-up and the gauge.


def payload(c: Case, n: Numbers) -> None:
    """A hook that nobody weighed, or a rope that takes some: gravity's, wherever the load pulls."""
    c.force = c.force - n["size"] * (c.stated > 0)[..., None] * Z


def beside_load(c: Case, n: Numbers) -> None:
    c.load_at = c.load_at + n["size"] * np.array(n["way"])


def beside_both(c: Case, n: Numbers) -> None:
    beside_load(c, n)
    c.read_at = c.read_at + n["size"] * np.array(n["way"])


def turned(n: Numbers) -> Array:
    return turn(np.array(n["about"]), NONE, np.radians(n["size"]))


def leaning(c: Case, n: Numbers) -> None:
    c.force, c.moment = direct(turned(n), c.force), direct(turned(n), c.moment)


def read_turned(c: Case, n: Numbers, moved: Array, place: str) -> Array:
    return direct(turned(n | {"size": -n["size"]}), moved)


def drift(c: Case, n: Numbers, moved: Array, place: str) -> Array:
    """The gauge's post follows the hall's warmth."""
    return moved + n["size"] * follows(c.air, c.since_s, n["lag_s"])[..., None] * np.array(n["way"])


def frame_numbers(rng: Rng, scene: Scene, place: str) -> Any:
    return [0.0, 0.0, 1.0] if rng.random() < 0.6 else direction(rng, True)


def counted(q: Array, i: int, value: Array) -> Array:
    out = q.copy()
    out[..., i] = value
    return out


def other_zero(rng: Rng, scene: Scene, place: str) -> float:
    i = scene.arm.joints.index(place)
    fits = [o for o in (45, 90, 180) if o < 0.62 * (scene.arm.high - scene.arm.low)[i]]
    return float(rng.choice(fits) * rng.choice([-1, 1]))


def both_ways(rng: Rng, scene: Scene) -> str:
    arm = scene.arm
    far = zip(arm.joints[1:-1], arm.low[1:-1], arm.high[1:-1], strict=True)
    return scene.joint(rng, tuple(j for j, low, high in far if min(-low, high) > 25))


def casing_name(rng: Rng, scene: Scene) -> str:
    return str(rng.choice([c.name for c in scene.arm.casings if 0 < c.body < len(scene.arm.joints)]))


def k_missing(rng: Rng, scene: Scene, place: str) -> float:
    usual = scene.unit("spring", place)
    return float(np.clip(np.exp(rng.uniform(np.log(5e4), np.log(2e6))), 0.4 * usual, 1.6 * usual))


def ratio(rng: Rng, scene: Scene, place: str) -> float:
    k = scene.spec.springs
    return float(np.sqrt(k[3] / k[4]))


def signs(rng: Rng, scene: Scene, place: str) -> list[float]:
    return [float(x) for x in rng.choice([-1, 1], 3) * rng.uniform(0.4, 1.0, 3)]


def shares(count: int) -> Pick:
    return Pick(lambda rng, scene, place: [float(x) for x in rng.dirichlet(np.full(count, 4.0))])


def several(low: float, high: float, count: int) -> Pick:
    logs = np.log([low, high])
    return Pick(lambda rng, scene, place: sorted(float(np.exp(rng.uniform(*logs))) for _ in range(count)))


ONCE, FRICTION = Range(1, 1), Range(60, 225, "arm")
TORQUE, LAG = Range(0.8, 1.2, "torque"), Range(0.1, 0.6, "span")
SIDE = {"at": ANGLE, "other": Range(0.6, 1.6)}
MIDDLE = "j2 j3 j4 j5"
HISTORY, CLOCK, PINS, POISED = (frozenset({need}) for need in ("history", "clock", "pins", "poised"))

KNOWN_ROWS = (
    Row("joint-compliance", "pose", "joint", {"size": ONCE, "k": Pick(k_missing)}, compliance, rigid=True),
    Row("joint-tilt", "pose", "joint", {"size": ONCE, "k": Range(5e5, 5e6, "arm", log=True), **SIDE}, tilt),
    Row("angle-dependent-stiffness", "pose", "joint", {"size": Range(0.1, 0.45), "one": ANGLE, "two": ANGLE}, by_angle),
    Row(
        "gear-ripple",
        "pose",
        "joint",
        {"size": Range(0.08, 0.3), "teeth": Pick(lambda r, s, p: int(r.integers(11, 50))), "one": ANGLE, "two": ANGLE},
        ripple,
    ),
    Row(
        "gravity-compensator",
        "pose",
        "j2",
        {"size": Range(0.1, 0.4), "ratio": Range(0.35, 0.7), "at": ANGLE},
        compensator,
    ),
    Row("hardening", "load", "joint", {"size": Range(0.3, 1.0), "torque": TORQUE}, hardening, needs=POISED),
    Row("softening", "load", "joint", {"size": Range(0.2, 0.7), "torque": TORQUE}, softening),
    Row(
        "backlash",
        "load",
        "joint",
        {"size": Range(3e-4, 9e-4), "hangs": Range(-0.35, 0.35), "soft": Range(0.04, 0.15)},
        backlash,
        needs=POISED,
    ),
    Row(
        "friction",
        "load history",
        "j2 j3",
        {"size": FRICTION, "bristles": Range(2, 10, log=True)},
        friction,
        needs=HISTORY,
    ),
    Row(
        "stick-slip",
        "load history",
        "j1 j2 j3 j4",
        {"size": FRICTION, "shares": shares(4), "stiff": several(0.1, 1, 4), "left": Range(0.1, 0.4)},
        stick_slip,
        needs=HISTORY,
    ),
    Row(
        "creep",
        "load history",
        "joint",
        {"size": Range(0.1, 0.45), "shares": shares(3), "times_s": several(15, 1500, 3)},
        creep,
        needs=HISTORY,
    ),
    Row(
        "slip",
        "load history",
        lambda r, s: str(r.choice([s.joint(r), "base", "tool"])),
        {"": Pick(slip_numbers), "lasting": Pick(lambda r, s, p: bool(r.random() < 0.5))},
        slip,
        needs=HISTORY,
    ),
    Row("warming", "clock", "joint", {"size": Range(0.12, 0.45), "lag_s": LAG}, warming, needs=CLOCK),
    Row("wrist-coupling", "pose", "j5", {"size": Range(0.2, 0.6, signed=True), "ratio": Pick(ratio)}, wrist, bare=True),
    Row("cable-package", "pose", "j4", {"size": Range(0.3, 1.2), "power": Range(1, 2.5)}, cables, bare=True),
    Row(
        "base-tilt", "pose", "base", {"size": ONCE, "k": Range(2e6, 4e7, "arm", log=True), **SIDE}, base_tilt, bare=True
    ),
    Row(
        "base-vertical", "pose", "base", {"size": ONCE, "k": Range(2e6, 2e7, "arm", log=True)}, base_vertical, bare=True
    ),
    Row(
        "loose-base",
        "load",
        "base",
        {
            "size": ONCE,
            "k": Range(1e7, 5e7, "arm", log=True),
            "holds": Range(0.5, 1.0, "weight"),
            "left": Range(0.08, 0.3),
        },
        loose_base,
        bare=True,
    ),
    Row("tool-compliance", "pose", "tool", {"size": Range(1.5e-7, 6e-7), **SIDE}, tool, bare=True),
    Row("link-flexibility", "pose", casing_name, {"size": Range(2, 7, log=True)}, link),
    Row(
        "parallelogram-bar",
        "pose",
        "j3",
        {"size": ONCE, "k": Pick(lambda r, s, p: float(np.exp(r.uniform(np.log(12), np.log(90)))) * s.spec.springs[2])},
        bar,
        bare=True,
        needs=PINS,
    ),
    Row("load-path", "pose", "j3", {"size": ONCE}, path, bare=True, needs=frozenset({"pins", "both"})),
    Row(
        "partial-load-path",
        "pose",
        "j3",
        {"size": Range(0.25, 0.75)},
        path,
        bare=True,
        needs=frozenset({"pins", "both"}),
    ),
    Row("payload", "load", "load", {"size": Range(20, 60, "payload", signed=True)}, load=payload, bare=True),
    Row(
        "load-point-offset",
        "pose",
        "load",
        {"size": Range(0.015, 0.045), "way": ANYWHERE},
        load=beside_load,
        bare=True,
    ),
    Row("tool-point-offset", "pose", "tool", {"size": Range(0.02, 0.06), "way": ANYWHERE}, load=beside_both, bare=True),
    Row(
        "load-misalignment",
        "pose",
        "load",
        {"size": Range(1.5, 4.5), "about": LEVEL},
        load=leaning,
        bare=True,
    ),
    Row(
        "joint-zero-offset",
        "pose",
        "joint",
        {"size": Range(0.1, 3, log=True, signed=True)},
        angles=lambda q, n, i: counted(q, i, q[..., i] + n["size"]),
    ),
    Row(
        "turned-frame",
        "direction",
        "gauge",
        {"size": Range(2, 12, signed=True), "about": Pick(frame_numbers)},
        load=leaning,
        read=read_turned,
        bare=True,
    ),
    Row(
        "angle-sign",
        "pose",
        both_ways,
        {"size": ONCE},
        angles=lambda q, n, i: counted(q, i, q[..., i] * (1 - 2 * n["size"])),
    ),
    Row(
        "angle-offset",
        "pose",
        MIDDLE,
        {"size": Pick(other_zero)},
        angles=lambda q, n, i: counted(q, i, q[..., i] + n["size"]),
    ),
    Row(
        "angle-coupling",
        "pose",
        MIDDLE,
        {"size": Range(1, 1, signed=True)},
        angles=lambda q, n, i: counted(q, i, q[..., i] + n["size"] * q[..., i - 1]),
    ),
    Row(
        "gauge-zero",
        "load",
        "gauge",
        {"size": Range(15e-6, 45e-6), "way": Pick(signs)},
        read=lambda c, n, moved, p: moved + n["size"] * np.array(n["way"]),
        bare=True,
    ),
    Row(
        "gauge-scale",
        "load",
        "gauge",
        {"size": Range(0.03, 0.1, signed=True)},
        read=lambda c, n, moved, p: moved * (1 + n["size"]),
        bare=True,
    ),
    Row(
        "drift",
        "clock",
        "gauge",
        {"size": Range(25e-6, 120e-6, log=True), "lag_s": LAG, "way": Pick(signs)},
        read=drift,
        bare=True,
        needs=CLOCK,
    ),
)
# A table in another convention, or all springs at once, leaves nothing to tell two effects apart by.
ALONE = {"gauge-scale", "angle-sign", "angle-offset", "angle-coupling", "load-path"}
