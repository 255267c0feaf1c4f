"""Effects that no catalogue has, as rows of a table; more than half of them in time or behind the load."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arm import Bingham, Heated, Now, Spring, at, cross, direct, hertz
from .known import ALMOST, CLOCK, HELD, HISTORY, LAG, NONE, TORQUE, X, Y, Z, casing_name, joint, signs, some
from .spec import ANGLE, ANYWHERE, LEVEL, Case, Machine, Numbers, Pick, Range, Rng, Row, Scene, follows

Array = NDArray[np.float64]


# In time, or behind the load.


def brake(m: Machine, n: Numbers, place: str) -> None:
    """The arm hangs in its brake, which drags beyond a torque and does not come back."""
    i, k = joint(m, place)
    m.parts[i].law = Bingham(k, n["holds"], n["size"] / (k * n["time_s"]))


def in_order(c: Case, values: Array, stays: Array) -> Array:
    """Of each cycle, from 0: what of the last state stays, the rest is new."""
    out, last = np.empty_like(values), np.zeros_like(values[:, 0])
    for k in range(values.shape[1]):
        if k and c.cycle[0, k] != c.cycle[0, k - 1]:
            last = np.zeros_like(last)
        last = out[:, k] = values[:, k] + (last - values[:, k]) * stays[:, k, None]
    return out


def settling(c: Case, n: Numbers, moved: Array, place: str) -> Array:
    """A stylus that was set down creeps on, ever slower, from the moment of its zero."""
    return moved + n["size"] * np.log1p((c.time_s - c.zero_s) / n["time_s"])[..., None] * np.array(n["way"])


def slow_winch(c: Case, n: Numbers) -> None:
    """A chain hoist hands the load over bit by bit."""
    c.force = in_order(c, c.force, np.exp(-c.hold_s / some(n["size"])))


def pulley(c: Case, n: Numbers) -> None:
    """The rope runs over a pulley that rubs: less arrives while loads are put on, more while they are taken off."""
    c.force = c.force * np.where(c.up, 1 - n["size"], 1 + n["size"])[..., None]


def bow(c: Case, n: Numbers, moved: Array, place: str) -> Array:
    """One side of a casing warms up more than the other, and it bows."""
    assert c.machine is not None
    m = c.machine
    body = next(casing.body for casing in m.arm.casings if casing.name == place)
    middle, end = m.middles[body], m.arm.ends[body]
    here = m.first.bodies[:, body]
    about = direct(here, np.cross(end, n["way"]) / np.linalg.norm(np.cross(end, n["way"])))
    lever = cross(about, m.tip(m.first, c.read_at[:, 0]) - at(here, middle))
    return moved + n["size"] * follows(c.air, c.since_s, n["lag_s"])[..., None] * lever[:, None]


def heated(m: Machine, n: Numbers, place: str) -> None:
    i, k = joint(m, place)
    m.parts[i].law = Heated(k, n["torque"], n["size"], n["time_s"])


def loosens(m: Machine, n: Numbers, place: str) -> None:
    """A screw of the tool turns back a little with every load that is put on."""

    def softer(now: Now) -> Array:
        return np.asarray(ALMOST - np.expm1(-now.cycles / n["cycles"]))

    for way in (X, Y, Z):
        m.free(len(m.arm.joints), m.arm.flange, way, Spring(1 / max(n["size"], HELD), [softer]), slides=True)


def leaks(m: Machine, n: Numbers, place: str) -> None:
    """A gas cylinder beside the second joint loses its pressure in the course of a session."""
    i, k = joint(m, place)
    hold = n["size"] * k * np.sin(m.turned[:, i] - n["at"]) ** 2
    m.beside({i: 1.0}, Spring(hold, [lambda now: np.exp(np.maximum(now.since_s, 0) / n["time_s"])]))


def sun(c: Case, n: Numbers, moved: Array, place: str) -> Array:
    """The floor tilts with the sun, and the gauge stands outside."""
    assert c.machine is not None
    tip = c.machine.tip(c.machine.first, c.read_at[:, 0])
    wave = np.sin(2 * np.pi * c.time_s / n["period_s"] + n["phase"]) - np.sin(n["phase"])
    return moved + n["size"] * wave[..., None] * cross(np.array(n["about"]), tip)[:, None]


def hunting(c: Case, n: Numbers, moved: Array, place: str) -> Array:
    """A controller inside its dead band winds up and lets go: the joint goes to and fro like a saw."""
    assert c.machine is not None
    i = c.machine.arm.joints.index(place)
    lever = c.machine.lever(c.read_at[:, 0])[:, i]
    wave = (c.time_s / n["period_s"]) % 1 - (c.zero_s / n["period_s"]) % 1
    return moved + n["size"] * wave[..., None] * lever[:, None]


# In space or with the load.


def full_scale(c: Case, n: Numbers, moved: Array, place: str) -> Array:
    """A gauge near the end of its travel says less of what comes beyond."""
    over = np.sign(moved) * np.maximum(np.abs(moved) - n["limit"], 0)
    return moved - n["size"] * over


def crosstalk(c: Case, n: Numbers, moved: Array, place: str) -> Array:
    """A stylus that is pushed aside reads that as height."""
    return moved + n["size"] * (moved @ np.array(n["way"]))[..., None] * Z


def wrong_disc(c: Case, n: Numbers) -> None:
    """A weight that is put on from one load upwards is not what is stamped on it."""
    size = c.stated[..., None] + (c.stated == 0)[..., None]
    c.force = c.force * (1 + n["size"] * (c.stated >= n["from"])[..., None] / size)


def crossed(m: Machine, n: Numbers, place: str) -> None:
    """The forearm's belt runs over the elbow: what the fourth drive holds is a sum of both turns."""
    m.parts[3].over[2] = n["size"] * n["ratio"]


def feet(m: Machine, n: Numbers, place: str) -> None:
    """Rubber under the base, pressed harder and harder."""
    for way in (X, Y):
        m.free(0, NONE, way, hertz(n["moment"], some(n["size"])))


def one_floor(c: Case, n: Numbers, moved: Array, place: str) -> Array:
    """The gauge's post stands on the floor that the arm tilts."""
    assert c.machine is not None
    tip = c.machine.tip(c.machine.first, c.read_at[:, 0])
    tilts = n["size"] * np.cross(tip[:, None], c.force) * [1, 1, 0]
    return moved - np.cross(tilts, np.array(n["post"]))


def saddle(c: Case, n: Numbers) -> None:
    """The hook's saddle slides to the same side of the hall, however the tool is turned."""
    assert c.machine is not None
    back = c.machine.first.bodies[:, -1] * np.array([1, -1, -1, -1, 1, -1, -1, -1])
    c.load_at = c.load_at + n["size"] * direct(back, np.array(n["way"]))[:, None]


def post(rng: Rng, scene: Scene, place: str) -> list[float]:
    at = rng.uniform(-np.pi, np.pi)
    return [float(x) for x in scene.arm.reach * rng.uniform(0.4, 0.7) * np.array([np.cos(at), np.sin(at), 0.8])]


def a_load(rng: Rng, scene: Scene, place: str) -> Any:
    loads = sorted(scene.spec.loads)
    return float(rng.choice(loads[1:] or loads)) - 1e-6


def travel(rng: Rng, scene: Scene, place: str) -> float:
    usual = max(scene.spec.loads) * float(np.sum(scene.levers**2 / np.array(scene.spec.springs)))
    return float(usual * rng.uniform(0.3, 0.7))


def belt(rng: Rng, scene: Scene, place: str) -> float:
    k = scene.spec.springs
    return float(np.sqrt(k[2] / k[3]))


MINUTES = Range(60, 400, log=True)
BASE_AT = Range(1, 2.5, "moment")
LEVELS = frozenset({"levels"})

STRANGE_ROWS = (
    Row(
        "dragging-brake",
        "load history",
        "joint",
        {"size": Range(0.3, 1.2), "holds": Range(0.1, 0.5, "torque"), "time_s": MINUTES},
        brake,
        needs=HISTORY,
    ),
    Row(
        "settling-stylus",
        "clock",
        "gauge",
        {"size": Range(8e-6, 25e-6), "time_s": Range(10, 60, log=True), "way": Pick(signs)},
        read=settling,
        bare=True,
        needs=HISTORY | CLOCK,
    ),
    Row("slow-winch", "load history", "load", {"size": Range(4, 15)}, load=slow_winch, bare=True, needs=HISTORY),
    Row("pulley-friction", "load history", "load", {"size": Range(0.02, 0.06)}, load=pulley, bare=True, needs=HISTORY),
    Row(
        "self-heating",
        "load history",
        "joint",
        {"size": Range(0.2, 0.6), "torque": TORQUE, "time_s": Range(60, 300, log=True)},
        heated,
        needs=HISTORY,
    ),
    Row(
        "loosening-screw",
        "clock, load history",
        "tool",
        {
            "size": Range(2e-7, 8e-7),
            "cycles": Pick(lambda r, s, p: s.spec.poses * s.spec.repeats * r.uniform(0.2, 0.8)),
        },
        loosens,
        bare=True,
        needs=CLOCK,
    ),
    Row(
        "thermal-bow",
        "clock, pose",
        casing_name,
        {"size": Range(4e-5, 2e-4), "lag_s": LAG, "way": ANYWHERE},
        read=bow,
        needs=CLOCK,
    ),
    Row(
        "gain-drift",
        "clock",
        "gauge",
        {"size": Range(0.04, 0.12, signed=True), "lag_s": LAG},
        read=lambda c, n, moved, p: moved * (1 + n["size"] * follows(c.air, c.since_s, n["lag_s"])[..., None]),
        bare=True,
        needs=CLOCK,
    ),
    Row(
        "leaking-cylinder",
        "clock, pose",
        "j2",
        {"size": Range(0.3, 0.9), "at": ANGLE, "time_s": Range(0.2, 0.7, "span")},
        leaks,
        needs=CLOCK,
    ),
    Row(
        "sun-on-floor",
        "clock, pose",
        "base",
        {"size": Range(2e-5, 1e-4), "about": LEVEL, "period_s": Range(0.5, 2.5, "span"), "phase": ANGLE},
        read=sun,
        bare=True,
        needs=CLOCK,
    ),
    Row(
        "hunting-servo",
        "clock",
        "joint",
        {"size": Range(5e-5, 3e-4), "period_s": Range(40, 400, log=True)},
        read=hunting,
        needs=CLOCK,
    ),
    Row("full-scale", "load", "gauge", {"size": Range(0.15, 0.5), "limit": Pick(travel)}, read=full_scale, bare=True),
    Row(
        "gauge-crosstalk",
        "direction",
        "gauge",
        {"size": Range(0.06, 0.2), "way": LEVEL},
        read=crosstalk,
        bare=True,
    ),
    Row(
        "wrong-disc",
        "load",
        "load",
        {"size": Range(0.04, 0.1, "force", signed=True), "from": Pick(a_load)},
        load=wrong_disc,
        bare=True,
        needs=LEVELS,
    ),
    Row("crossed-drive", "pose", "j4", {"size": Range(0.25, 0.7, signed=True), "ratio": Pick(belt)}, crossed),
    Row("rubber-feet", "load", "base", {"size": Range(2e-4, 8e-4), "moment": BASE_AT}, feet, bare=True),
    Row("one-floor", "pose", "gauge", {"size": Range(2e-8, 1.2e-7), "post": Pick(post)}, read=one_floor, bare=True),
    Row("saddle-hook", "pose", "load", {"size": Range(0.02, 0.06), "way": LEVEL}, load=saddle, bare=True),
)
