"""Catalogue effects of load, gauge and frames."""

from __future__ import annotations

import numpy as np

from .chance import Chance
from .mechanics import Effect, Situation, vector_turn
from .screws import Array


def pull(force: Array) -> Array:
    """Directions (n, 3) of forces."""
    return np.asarray(force / np.maximum(np.linalg.norm(force, axis=1), 1e-9)[:, None])


def payload(x: Chance) -> Effect:
    """A hanger of 20 to 60 N that nobody counted, along the load."""
    more = x.between(20.0, 60.0)
    return Effect("payload", ("load",), "load", {"force_N": more}, force=lambda s: more * pull(s.force))


def load_point_offset(x: Chance) -> Effect:
    """The load hangs 15 to 45 mm beside the gauge's point, fixed to the flange."""
    side = x.direction() * np.array([1.0, 1.0, 0.3])
    away = x.arm.flange[:3, :3] @ (side / np.linalg.norm(side) * x.between(0.015, 0.045))
    facts = {f"{a}_m": float(v) for a, v in zip("xyz", x.arm.flange[:3, :3].T @ away, strict=True)}

    def offset(s: Situation) -> Array:
        return np.asarray(s.body(s.arm.size)[:, :3, :3] @ away)

    return Effect("load-point-offset", ("pose",), "load", facts, offset=offset)


def load_misalignment(x: Chance) -> Effect:
    """The load pulls 1.5 to 4.5 deg askew, about an axis across it."""
    angle, heading = np.deg2rad(x.between(1.5, 4.5)), x.between(-np.pi, np.pi)
    about = angle * np.array([np.cos(heading), np.sin(heading), 0.0])
    facts = {"angle_deg": float(np.rad2deg(angle)), "heading_rad": heading}
    return Effect("load-misalignment", ("pose",), "load", facts, force=lambda s: vector_turn(s.force, about) - s.force)


def gauge_zero(x: Chance) -> Effect:
    """The gauge shows 15 to 45 um too much, or too little, mostly along z."""
    size = x.between(15e-6, 45e-6) * x.sign()
    v = np.array([x.between(-0.7, 0.7), x.between(-0.7, 0.7), 1.0]) * size
    facts = {f"{a}_m": float(u) for a, u in zip("xyz", v, strict=True)}
    return Effect("gauge-zero", ("load",), "gauge", facts, read=lambda s, d: np.broadcast_to(v, d.shape))


def gauge_scale(x: Chance) -> Effect:
    """The gauge shows 2 to 8 % too much or too little of everything."""
    size = x.between(0.02, 0.08) * x.sign()
    return Effect("gauge-scale", ("load",), "gauge", {"scale": size}, read=lambda s, d: size * d)


def drift(x: Chance) -> Effect:
    """The gauge creeps away by 20 to 80 um over the campaign: towards an end, straight, with a wave of the day."""
    size, kind = x.between(20e-6, 80e-6) * x.sign(), float(x.rng.integers(3))
    span, wave = float(x.campaign.time_s[-1]), x.between(0.0, 0.3)
    lag, phase = x.between(0.1, 0.5) * span, x.between(-np.pi, np.pi)
    way = np.array([x.between(-0.8, 0.8), x.between(-0.8, 0.8), 1.0])

    def read(s: Situation, d: Array) -> Array:
        t = s.campaign.time_s
        course = {0.0: 1 - np.exp(-t / lag), 1.0: t / span, 2.0: np.sqrt(t / span)}[kind]
        course = course + wave * (np.sin(2 * np.pi * t / 86400.0 + phase) - np.sin(phase))
        return np.outer(size * course, way)

    facts = {"size_m": size, "shape": kind, "lag_s": lag, "day_wave": wave}
    return Effect("drift", ("clock",), "gauge", facts, read=read, gauge_only=True)


def turned_frame(x: Chance) -> Effect:
    """The frame of the table's forces and displacements is turned by 2 to 8 deg, mostly about one of its axes."""
    v = np.abs(x.rng.normal(size=3)) * np.array([0.1, 0.1, 0.1])
    v[int(x.rng.integers(3))] = 1.0
    v = v / np.linalg.norm(v) * np.deg2rad(x.between(2.0, 8.0)) * x.sign()
    facts = {f"about_{a}_rad": float(u) for a, u in zip("xyz", v, strict=True)}
    return Effect("turned-frame", ("direction",), "gauge", facts, turned=(float(v[0]), float(v[1]), float(v[2])))


def tool_point_offset(x: Chance) -> Effect:
    """Load and gauge are both 15 to 60 mm away from where the table has them, fixed to the flange."""
    v = x.direction() * x.between(0.015, 0.060)
    facts = {f"{a}_m": float(u) for a, u in zip("xyz", v, strict=True)}
    return Effect("tool-point-offset", ("pose",), "tool", facts, point=(float(v[0]), float(v[1]), float(v[2])))
