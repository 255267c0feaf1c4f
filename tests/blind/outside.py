"""Effects that no part of the catalogue can imitate exactly. Each works at one place of the chain of ``evaluate``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rehearsal.effects import Context
from rehearsal.evaluate import Truth
from rehearsal.kinematics import Frames
from rehearsal.readings import Readings
from robots.arrays import Array


def unit(truth: Truth, q: Array, joint: int) -> Array:
    """Coordinate ``joint`` scaled to -1..1 over 80 % of its limits."""
    low, high = truth.arm.limits[joint]
    return np.asarray((q[:, joint] - (low + high) / 2) / (0.4 * (high - low)))


def draw_cable(c: Context) -> dict[str, Any]:
    return {
        "law": "cable-package",
        "force_N": c.between(60, 160),
        "angle_rad": c.angle(),
        "full_at_N": c.between(150, 400),
    }


def draw_product(c: Context) -> dict[str, Any]:
    # The parallelogram leaves joint 2 little to do: there it is joint 3, with q2 in place of q3.
    joint, other = (2, 1) if c.arm.name == "xr701" else (1, 2)
    return {
        "law": "two-joint-stiffness",
        "joint": joint,
        "other": other,
        "amplitude": c.between(0.15, 0.4),
        "phase_rad": c.angle(),
    }


def draw_stop(c: Context) -> dict[str, Any]:
    return {"law": "stop-contact", "from_N": c.between(0.25, 0.45), "kept": c.between(0.5, 0.8), "side": c.sign()}


def draw_warm(c: Context) -> dict[str, Any]:
    return {"law": "warming-springs", "gain": c.between(0.25, 0.5), "memory": c.between(0.05, 0.15)}


def draw_reach(c: Context) -> dict[str, Any]:
    return {"law": "load-1.5-reach-2", "size_m": c.between(0.25e-3, 0.6e-3)}


def draw_column(c: Context) -> dict[str, Any]:
    return {"law": "compressed-forearm", "at_N": c.between(1500, 3500)}


KINDS: dict[str, Callable[[Context], dict[str, Any]]] = {
    "cable-package": draw_cable,
    "two-joint-stiffness": draw_product,
    "stop-contact": draw_stop,
    "warming-springs": draw_warm,
    "load-1.5-reach-2": draw_reach,
    "compressed-forearm": draw_column,
}


# Along what each acts, and where, as a study's key says it.
WHERE: dict[str, tuple[list[str], str]] = {
    "cable-package": (["pose", "load"], "tool"),
    "two-joint-stiffness": (["pose"], "j2"),
    "stop-contact": (["pose", "load"], "j3"),
    "warming-springs": (["clock", "load history"], "j2"),
    "load-1.5-reach-2": (["pose", "load"], "base"),
    "compressed-forearm": (["pose", "load"], "j3"),
}


def warmth(r: Readings, memory: float) -> Array:
    """Temperature 0..1: each move heats by its length, and it cools with the clock."""
    moves = np.zeros(len(r))
    moves[1:] = np.abs(np.diff(r.q, axis=0)).sum(1)
    steps = np.diff(r.clock, prepend=r.clock[0])
    heat, out = 0.0, np.zeros(len(r))
    for k in range(len(r)):
        heat = heat * np.exp(-abs(steps[k]) / memory) + moves[k]
        out[k] = heat
    return out / (out + 4.0)


class Strangers:
    """All of them, each where it acts."""

    def wrench(self, truth: Truth, r: Readings, at: Frames, w: Array) -> Array:
        """Cable package: it pulls at the tool while loaded, with the product of q2 and q3, and turns with q1."""
        for e in truth.of("cable-package"):
            load = np.linalg.norm(r.force, axis=1)
            size = e["force_N"] * unit(truth, r.q, 1) * unit(truth, r.q, 2) * np.tanh(load / e["full_at_N"])
            out, up = np.cos(e["angle_rad"]), np.sin(e["angle_rad"])
            pull = np.stack([out * np.cos(r.q[:, 0]), out * np.sin(r.q[:, 0]), np.full(len(r), up)], 1)
            w = w.copy()
            w[:, :3] += size[:, None] * pull
        return w

    def factors(self, truth: Truth, r: Readings, tau: Array) -> Array:
        """A product of two other joints' angles, and warmth left by the moves and work before (on all springs)."""
        f = np.ones((len(r), 6))
        for e in truth.of("two-joint-stiffness"):
            other = np.sin(np.pi / 2 * unit(truth, r.q, e["other"]))
            f[:, e["joint"]] *= 1 + e["amplitude"] * other * np.cos(2 * r.q[:, 3] - e["phase_rad"])
        for e in truth.of("warming-springs"):
            f *= 1 + e["gain"] * warmth(r, e["memory"])[:, None]
        return f

    def twists(self, truth: Truth, r: Readings, at: Frames, w: Array, tau: Array, theta: Array) -> Array:
        """Joint 3 meets a stop in some poses; the forearm's thrust amplifies joints 2 and 3 like a column's."""
        for e in truth.of("stop-contact"):
            inside = (e["side"] * unit(truth, r.q, 3) > -0.1) & (unit(truth, r.q, 2) > -0.5)
            load = np.linalg.norm(r.force, axis=1)
            share = np.where(load > 0, np.minimum(1, e["from_N"] * 650 / np.maximum(load, 1e-9)), 1)
            kept = share + (1 - share) * e["kept"]
            theta = theta * np.where(inside, kept, 1)[:, None]
        for e in truth.of("compressed-forearm"):
            along = at.origins[:, 4] - at.origins[:, 3]
            along = along / np.linalg.norm(along, axis=1, keepdims=True)
            thrust = -np.einsum("ni,ni->n", along, w[:, :3])
            theta = theta.copy()
            theta[:, 1:3] *= (1 / (1 - np.clip(thrust / e["at_N"], -2, 0.6)))[:, None]
        return theta

    def shift(self, truth: Truth, r: Readings, at: Frames, w: Array, d: Array) -> Array:
        """A give along the load that grows like F^1.5 and reach squared."""
        for e in truth.of("load-1.5-reach-2"):
            size = np.linalg.norm(w[:, :3], axis=1)
            reach = np.hypot(at.tool[:, 0], at.tool[:, 1])
            d = d + w[:, :3] / size[:, None] * (e["size_m"] * (size / 650) ** 1.5 * (reach / 2.0) ** 2)[:, None]
        return d


STRANGERS = Strangers()
