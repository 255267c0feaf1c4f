"""Laws of joints, bodies and loads that the catalogue has."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.special import erf

from .arm import Array, screw_through
from .mechanics import Chance, Effect, Situation, along_history, at, vector_turn


def joint_compliance(x: Chance) -> Effect:
    """A joint that the model holds rigid: 5e4 to 2e6 N m/rad, the large ones from 4e5."""
    j = x.joint(0.03)
    k = x.spread(4e5, 2e6) if j < 3 else x.spread(5e4, 2e6)
    facts = {"stiffness_Nm_per_rad": k}
    return Effect(f"joint-compliance:{x.name(j)}", ("pose", "load"), x.name(j), facts, softness=(j, 1.0 / k))


def angle_dependent(x: Chance) -> Effect:
    """Compliance that varies by 10 to 45 % with the angle: Fourier series, triangle, or a wave with a kink."""
    j, size, phase, kind = x.joint(0.08), x.between(0.10, 0.45), x.between(-np.pi, np.pi), int(x.rng.integers(3))
    mix, c = x.between(0.1, 0.5), float(x.soft[j])

    def wave(a: Array) -> Array:
        if kind == 0:
            return np.asarray((np.cos(a - phase) + mix * np.cos(2 * a + phase) + 0.3 * mix * np.sin(3 * a)) / (1 + mix))
        if kind == 1:
            return np.asarray(2 / np.pi * np.arcsin(np.sin(a - phase)))
        return np.asarray(2 * np.abs(np.sin(0.5 * (a - phase))) - 1.0)

    def joint(s: Situation) -> Array:
        return at(s, j, size * c * wave(np.deg2rad(s.campaign.q_deg[:, j])) * s.torque[:, j])

    facts = {"size": size, "phase_rad": phase, "shape": float(kind), "mix": mix}
    return Effect(f"angle-dependent-stiffness:{x.name(j)}", ("pose",), x.name(j), facts, joint=joint)


def hardening(x: Chance) -> Effect:
    """Compliance falls by 20 to 60 % with torque, from one plateau to another."""
    j, fall = x.joint(0.08), x.between(0.2, 0.6)
    t0, c = x.between(0.25, 0.6) * x.top(j), float(x.soft[j])

    def joint(s: Situation) -> Array:
        t = np.abs(s.torque[:, j]) / t0
        lost = t - np.arctan(t)  # its slope climbs from nothing to one
        return at(s, j, -fall * c * t0 * lost * np.sign(s.torque[:, j]))

    facts = {"fall": fall, "torque_Nm": t0}
    return Effect(f"hardening:{x.name(j)}", ("load",), x.name(j), facts, joint=joint)


def softening(x: Chance) -> Effect:
    """Angle ``c t (1 + s (t/t0)^p)``, s .2 to .7 at the largest torque, p 1.2 to 3."""
    j, size, power = x.joint(0.08), x.between(0.2, 0.7), x.between(1.2, 3.0)
    t0, c = x.top(j), float(x.soft[j])

    def joint(s: Situation) -> Array:
        t = s.torque[:, j]
        return at(s, j, c * t * size * (np.abs(t) / t0) ** power)

    facts = {"size": size, "power": power, "torque_Nm": t0}
    return Effect(f"softening:{x.name(j)}", ("load",), x.name(j), facts, joint=joint)


def backlash(x: Chance) -> Effect:
    """Gap of .3 to .9 mrad, closed by an error function of torque; a preload in half of them keeps it at one side."""
    j, gap, closing = x.joint(0.05), x.between(0.3e-3, 0.9e-3), x.between(0.02, 0.12) * x.top(x.joint(0.05))
    bias = x.between(0.3, 1.2) * closing * x.sign() if x.rng.random() < 0.5 else 0.0

    def joint(s: Situation) -> Array:
        return at(s, j, 0.5 * gap * (erf((s.torque[:, j] + bias) / closing) - erf(bias / closing)))

    facts = {"gap_rad": gap, "closing_torque_Nm": closing, "preload_Nm": bias}
    return Effect(f"backlash:{x.name(j)}", ("load",), x.name(j), facts, joint=joint)


def maxwell(k: float, limits: Array, stiffness: Array) -> Callable[[Array], Array]:
    """Law for :func:`along_history`: angle of a spring with Maxwell slip elements beside it, under a torque."""
    state: dict[str, Array] = {}

    def law(torque: Array) -> Array:
        z = state.setdefault("z", np.zeros((len(torque), len(limits))))
        reach = (np.abs(torque) + limits.sum()) / k + 1e-12
        low, high = -reach, reach.copy()
        for _ in range(48):
            angle = 0.5 * (low + high)
            resisting = k * angle + np.clip(stiffness * (angle[:, None] - z), -limits, limits).sum(axis=1)
            above = resisting > torque
            low, high = np.where(above, low, angle), np.where(above, angle, high)
        angle = 0.5 * (low + high)
        held = np.clip(stiffness * (angle[:, None] - z), -limits, limits)
        state["z"] = angle[:, None] - held / stiffness
        return np.asarray(angle)

    return law


def friction(x: Chance) -> Effect:
    """Six Maxwell slip elements of 60 to 225 N m together at a lifting joint, at most half of its largest torque."""
    j = x.joint(0.05, x.large())
    total = min(x.between(60.0, 225.0), 0.5 * x.top(j))
    part = x.rng.dirichlet(np.full(6, 3.0)) * total
    breaks = np.geomspace(0.02, x.between(0.2, 0.7), 6) * total * float(x.soft[j])
    k = 1.0 / float(x.soft[j])

    def joint(s: Situation) -> Array:
        angle = along_history(s.campaign, s.torque[:, j], maxwell(k, part, part / breaks))
        return at(s, j, angle - s.torque[:, j] / k)

    facts = {"torque_Nm": total, "last_break_rad": float(breaks[-1])}
    return Effect(f"friction:{x.name(j)}", ("load history", "load"), x.name(j), facts, joint=joint)


def gravity_compensator(x: Chance) -> Effect:
    """A gas spring beside the first lifting joint: 10 to 40 % of its stiffness, by the angle of its lever."""
    j, share, phase = x.large()[0], x.between(0.1, 0.4), x.between(-0.6, 0.6)
    ratio, k = x.between(0.2, 0.6), 1.0 / float(x.soft[x.large()[0]])

    def joint(s: Situation) -> Array:
        a = np.deg2rad(s.campaign.q_deg[:, j] - x.arm.box_deg[j].mean()) - phase
        lever = np.sin(a) / np.sqrt(1.0 + ratio**2 - 2 * ratio * np.cos(a))
        stiff = k * (1.0 + share * (1.0 - np.minimum(lever**2, 1.0)))
        return at(s, j, s.torque[:, j] * (1.0 / stiff - 1.0 / k))

    facts = {"share": share, "phase_rad": phase, "lever_ratio": ratio}
    return Effect(f"gravity-compensator:{x.name(j)}", ("pose",), x.name(j), facts, joint=joint)


def gear_ripple(x: Chance) -> Effect:
    """Mesh stiffness: compliance times 1 + a sin(N q + p) with a second wave; a 8 to 30 %, N 11 to 60."""
    j, size, teeth = x.joint(0.1), x.between(0.08, 0.30), int(x.rng.integers(11, 61))
    phase, second, c = x.between(-np.pi, np.pi), x.between(0.0, 0.5), float(x.soft[j])

    def joint(s: Situation) -> Array:
        a = np.deg2rad(s.campaign.q_deg[:, j]) * teeth + phase
        return at(s, j, c * s.torque[:, j] * size * (np.sin(a) + second * np.sin(2 * a)))

    facts = {"size": size, "waves_per_turn": float(teeth), "phase_rad": phase, "second": second}
    return Effect(f"gear-ripple:{x.name(j)}", ("pose",), x.name(j), facts, joint=joint)


def wrist_coupling(x: Chance) -> Effect:
    """Two neighbouring wrist joints turn each other: a compliance between them of .2 to .6 of their own."""
    n = x.arm.size
    a, b = (n - 3, n - 2) if n > 5 else (n - 2, n - 1)
    kappa = x.sign() * x.between(0.2, 0.6) * float(np.sqrt(x.soft[a] * x.soft[b]))

    def joint(s: Situation) -> Array:
        return at(s, a, kappa * s.torque[:, b]) + at(s, b, kappa * s.torque[:, a])

    return Effect("wrist-coupling", ("pose",), x.name(b), {"rad_per_Nm": kappa}, joint=joint)


def zero_offset(x: Chance) -> Effect:
    """Joint zero off by .1 to 3 deg."""
    j, off = x.joint(0.02), x.sign() * x.spread(0.1, 3.0)
    return _angles(x, "joint-zero-offset", j, {"offset_deg": off}, lambda q: q[:, j] + np.deg2rad(off))


def angle_offset(x: Chance) -> Effect:
    """The table counts a joint's angle from another zero: 30, 45 or 90 deg away."""
    j, off = x.joint(0.02), x.sign() * float(x.rng.choice([30.0, 45.0, 90.0]))
    return _angles(x, "angle-offset", j, {"offset_deg": off}, lambda q: q[:, j] + np.deg2rad(off))


def angle_sign(x: Chance) -> Effect:
    """The table counts a joint's angle the other way round."""
    j = x.joint(0.02)
    return _angles(x, "angle-sign", j, {}, lambda q: -q[:, j])


def angle_coupling(x: Chance) -> Effect:
    """The table's angle of the second lifting joint is counted from the horizon: it holds the first one's, too."""
    (a, j), sign = x.large(), x.sign()
    return _angles(x, "angle-coupling", j, {"factor": sign}, lambda q: q[:, j] + sign * q[:, a])


def _angles(x: Chance, code: str, j: int, facts: dict[str, float], law: Callable[[Array], Array]) -> Effect:
    def angles(q: Array) -> Array:
        out = q.copy()
        out[:, j] = law(q)
        return out

    return Effect(f"{code}:{x.name(j)}", ("pose",), x.name(j), facts, angles=angles)


POSE = ("pose", "load")


def joint_tilt(x: Chance) -> Effect:
    """A bearing tilts about the two axes across the joint's: 5e5 to 5e6 N m/rad, one up to three times the other."""
    j, k = int(x.rng.integers(1, x.arm.size - 1)), x.spread(5e5, 5e6)
    ratio, turned = x.between(1.0, 3.0), x.between(0.0, np.pi)
    axis, centre = x.arm.screws[:3, j], x.arm.centres[j]
    first = np.cross(axis, [axis[1], axis[2], axis[0]] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
    first = first / np.linalg.norm(first)
    second = np.cross(axis, first)
    one, two = np.cos(turned) * first + np.sin(turned) * second, np.cos(turned) * second - np.sin(turned) * first

    def twist(s: Situation) -> Array:
        weak = s.yielding(screw_through(one, centre), j + 1) / k
        return weak + s.yielding(screw_through(two, centre), j + 1) / (k * ratio)

    facts = {"stiffness_Nm_per_rad": k, "ratio": ratio, "turned_rad": turned}
    return Effect(f"joint-tilt:{x.name(j)}", POSE, x.name(j), facts, twist=twist)


def base_tilt(x: Chance) -> Effect:
    """The base rocks about two horizontal axes: 2e6 to 1e8 N m/rad, one up to 2.5 times as stiff, turned anyhow."""
    k, ratio, turned = x.spread(2e6, 1e8), x.between(1.0, 2.5), x.between(0.0, np.pi)
    one, two = np.array([np.cos(turned), np.sin(turned), 0.0]), np.array([-np.sin(turned), np.cos(turned), 0.0])

    def twist(s: Situation) -> Array:
        weak = s.yielding(screw_through(one, np.zeros(3)), 0) / k
        return weak + s.yielding(screw_through(two, np.zeros(3)), 0) / (k * ratio)

    facts = {"stiffness_Nm_per_rad": k, "ratio": ratio, "turned_rad": turned}
    return Effect("base-tilt", POSE, "base", facts, twist=twist)


def base_vertical(x: Chance) -> Effect:
    """The base gives way vertically: 2e6 to 1e8 N/m."""
    k = x.spread(2e6, 1e8)
    screw = np.array([0.0, 0, 0, 0, 0, 1.0])
    return Effect(
        "base-vertical", ("load",), "base", {"stiffness_N_per_m": k}, twist=lambda s: s.yielding(screw, 0) / k
    )


def parallelogram_bar(x: Chance) -> Effect:
    """The bar and its pins stretch: 10 to 60 % of joint 3's compliance where the bar's lever is longest."""
    share, c, slack = x.between(0.1, 0.6), float(x.soft[2]), 0.05

    def joint(s: Situation) -> Array:
        lever = np.sin(np.deg2rad(s.campaign.q_deg[:, 2]))
        return at(s, 2, share * c * s.torque[:, 2] / np.maximum(lever**2, slack))

    return Effect("parallelogram-bar", ("pose",), "link", {"share": share}, joint=joint)


def load_path(x: Chance) -> Effect:
    """The arm has no parallelogram after all (joint 2 carries the forearm's moment), or one unknown to the model."""
    return Effect("load-path", ("pose",), "link", {"bar_path": 1.0 - x.path}, bar_path=1.0 - x.path)


def link_flexibility(x: Chance) -> Effect:
    """One link gives .5 to 2 times its own beam more than the model has (thin wall, weak material, an opening)."""
    heavy = [link.name for link in x.arm.links if link.body > 0]
    name, extra = str(x.rng.choice(heavy)), x.between(0.5, 2.0)
    return Effect(f"link-flexibility:{name}", POSE, "link", {"extra": extra}, links_softer={name: extra})


def tool_compliance(x: Chance) -> Effect:
    """The tool gives way across its axis: 1.5e-7 to 6e-7 m/N one way, half to all of it the other."""
    c, ratio, turned = x.spread(1.5e-7, 6e-7), x.between(0.5, 1.0), x.between(0.0, np.pi)
    frame = x.arm.flange[:3, :3]
    one = frame @ np.array([np.cos(turned), np.sin(turned), 0.0])
    two = frame @ np.array([-np.sin(turned), np.cos(turned), 0.0])

    def twist(s: Situation) -> Array:
        soft = np.zeros((len(s.force), 6))
        for axis, much in ((one, c), (two, c * ratio)):
            across = s.body(s.arm.size)[:, :3, :3] @ axis
            soft[:, 3:] += much * across * np.einsum("ni,ni->n", across, s.force)[:, None]
        return soft

    facts = {"compliance_m_per_N": c, "ratio": ratio, "turned_rad": turned}
    return Effect("tool-compliance", POSE, "tool", facts, twist=twist)


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
