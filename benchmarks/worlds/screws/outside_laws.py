"""Laws that no catalogue has, and which law belongs to which code."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .arm import Array
from .joint_laws import (
    angle_coupling,
    angle_dependent,
    angle_offset,
    angle_sign,
    backlash,
    base_tilt,
    base_vertical,
    drift,
    friction,
    gauge_scale,
    gauge_zero,
    gear_ripple,
    gravity_compensator,
    hardening,
    joint_compliance,
    joint_tilt,
    link_flexibility,
    load_misalignment,
    load_path,
    load_point_offset,
    parallelogram_bar,
    payload,
    softening,
    tool_compliance,
    tool_point_offset,
    turned_frame,
    wrist_coupling,
    zero_offset,
)
from .mechanics import Chance, Effect, Situation, along_history, at, heated, lagging


def creep(x: Chance) -> Effect:
    """A joint creeps on under load by 6 to 30 % with a time constant of 1 to 20 min, and recovers while unloaded."""
    j, share, lag = x.joint(0.08), x.between(0.06, 0.30), x.spread(60.0, 1200.0)
    c = float(x.soft[j])

    def joint(s: Situation) -> Array:
        return at(s, j, share * c * lagging(s.campaign, s.torque[:, j], lag))

    facts = {"share": share, "lag_s": lag}
    return Effect(f"creep:{x.name(j)}", ("clock", "load history"), x.name(j), facts, joint=joint)


def warming(x: Chance) -> Effect:
    """Oil and housing of a gear warm up by motor power, with 8 to 25 min and 1 to 3 h: 8 to 30 % softer when warm."""
    j, share, quick, slow = x.joint(0.08), x.between(0.08, 0.30), x.between(480.0, 1500.0), x.between(3600.0, 10800.0)
    weight, c = x.between(0.3, 0.7), float(x.soft[j])

    def joint(s: Situation) -> Array:
        power = 0.6 + 0.4 * (s.torque[:, j] / x.top(j)) ** 2
        warmth = weight * heated(s.campaign, power, quick) + (1 - weight) * heated(s.campaign, power, slow)
        return at(s, j, share * c * s.torque[:, j] * warmth)

    facts = {"share": share, "quick_s": quick, "slow_s": slow, "quick_weight": weight}
    return Effect(f"warming:{x.name(j)}", ("clock", "temperature"), x.name(j), facts, joint=joint)


def ratchet(limit: float) -> Callable[[Array], Array]:
    """Law for a history: what the largest input so far exceeds a limit by, on either side; it never comes back."""
    state: dict[str, Array] = {}

    def law(force: Array) -> Array:
        up = np.maximum(state.get("up", np.zeros_like(force)), np.maximum(force - limit, 0.0))
        down = np.maximum(state.get("down", np.zeros_like(force)), np.maximum(-force - limit, 0.0))
        state["up"], state["down"] = up, down
        return up - down

    return law


def slip(x: Chance) -> Effect:
    """A fixture slips beyond a load of .3 to .7 of the largest and stays there: base (rotation), joint or tool."""
    where = ("base", "joint", "tool")[int(x.rng.integers(3))]
    part, size = x.between(0.3, 0.7), x.between(0.1e-3, 0.5e-3)
    if where == "joint":
        j = x.joint(0.08)
        limit, top = part * x.top(j), x.top(j)

        def joint(s: Situation) -> Array:
            gone = along_history(s.campaign, s.torque[:, j], ratchet(limit))
            return at(s, j, size * gone / (top - limit))

        facts = {"from_Nm": limit, "angle_at_top_rad": size}
        return Effect(f"slip:{x.name(j)}", ("load history", "load"), x.name(j), facts, joint=joint)
    moment = np.linalg.norm(x.bare.wrench[:, :2], axis=1) if where == "base" else np.linalg.norm(x.bare.force, axis=1)
    top = float(moment.max())

    def twist(s: Situation) -> Array:
        felt = s.wrench[:, :2] if where == "base" else s.force
        much = np.linalg.norm(felt, axis=1)
        gone = along_history(s.campaign, much, ratchet(part * top)) / ((1 - part) * top)
        heading = felt / np.maximum(much, 1e-9)[:, None]
        out = np.zeros((len(much), 6))
        if where == "base":
            out[:, :2] = size * gone[:, None] * heading
        else:
            out[:, 3:] = 0.4 * size * gone[:, None] * heading  # 0.4 m/rad: a tenth of a millimetre or two
        return out

    facts = {"from": part * top, "size": size if where == "base" else 0.4 * size}
    return Effect(f"slip:{where}", ("load history", "load"), where, facts, twist=twist)


def stick_slip(x: Chance) -> Effect:
    """A lifting joint sticks up to 60 to 225 N m and then jumps to half of that (static and sliding friction)."""
    j = x.joint(0.05, x.large())
    stick, keep = min(x.between(60.0, 225.0), 0.4 * x.top(j)), x.between(0.3, 0.7)
    c = float(x.soft[j])
    state: dict[str, Array] = {}

    def law(torque: Array) -> Array:
        angle = state.get("angle", np.zeros_like(torque))
        held = torque - angle / c
        moved = np.where(np.abs(held) > stick, c * (torque - np.sign(held) * keep * stick), angle)
        state["angle"] = moved
        return moved

    def joint(s: Situation) -> Array:
        state.clear()
        return at(s, j, along_history(s.campaign, s.torque[:, j], law) - c * s.torque[:, j])

    facts = {"stick_Nm": stick, "slide_share": keep}
    return Effect(f"stick-slip:{x.name(j)}", ("load history", "load"), x.name(j), facts, joint=joint)


def load_cell_hysteresis(x: Chance) -> Effect:
    """The load cell remembers: the true load lags behind the shown one by 2 to 6 % of the largest, by Maxwell slip."""
    width, top = x.between(0.02, 0.06), float(np.linalg.norm(x.campaign.force, axis=1).max())
    limits = np.array([0.2, 0.3, 0.5]) * width * top
    breaks = np.array([0.1, 0.3, 0.7]) * top
    state: dict[str, Array] = {}

    def law(load: Array) -> Array:
        z = state.get("z", np.zeros((len(load), 3)))
        held = np.clip((load[:, None] - z) * limits / breaks, -limits, limits)
        state["z"] = load[:, None] - held * breaks / limits
        return np.asarray(held.sum(axis=1))

    def force(s: Situation) -> Array:
        state.clear()
        much = np.linalg.norm(s.force, axis=1)
        return np.asarray(-along_history(s.campaign, much, law)[:, None] * s.force / np.maximum(much, 1e-9)[:, None])

    facts = {"width": width, "full_load_N": top}
    return Effect("other:load-cell-hysteresis:load", ("load history", "load"), "load", facts, force=force)


def touched_gauge(x: Chance) -> Effect:
    """Somebody touched the gauge in the middle of the campaign: 25 to 90 um from then on."""
    size, when = x.between(25e-6, 90e-6) * x.sign(), x.between(0.3, 0.7) * float(x.campaign.time_s[-1])
    way = np.array([x.between(-0.7, 0.7), x.between(-0.7, 0.7), 1.0]) * size

    def read(s: Situation, d: Array) -> Array:
        return np.outer(s.campaign.time_s >= when, way)

    facts = {"size_m": size, "time_s": when}
    return Effect("other:touched-gauge:gauge", ("clock",), "gauge", facts, read=read, gauge_only=True)


def gauge_stick(x: Chance) -> Effect:
    """The gauge's stem sticks: it follows only beyond 10 to 40 um, along each axis."""
    play = x.between(10e-6, 40e-6)

    def read(s: Situation, d: Array) -> Array:
        out = np.zeros_like(d)
        for axis in range(3):
            state: dict[str, Array] = {}

            def law(u: Array, state: dict[str, Array] = state) -> Array:
                shown = np.clip(state.get("shown", np.zeros_like(u)), u - play, u + play)
                state["shown"] = shown
                return np.asarray(shown)

            out[:, axis] = along_history(s.campaign, d[:, axis], law) - d[:, axis]
        return out

    facts = {"play_m": play}
    return Effect("other:gauge-stick:gauge", ("load history",), "gauge", facts, read=read, gauge_only=True)


def frame_temperature(x: Chance) -> Effect:
    """The frame of the gauge grows with the air, 6 to 20 um/K, half an hour to two hours behind it."""
    size, lag = x.between(6e-6, 20e-6) * x.sign(), x.between(1800.0, 7200.0)
    way = np.array([x.between(-0.5, 0.5), x.between(-0.5, 0.5), 1.0]) * size

    def read(s: Situation, d: Array) -> Array:
        c = s.campaign
        warm, now, out = 0.0, 0.0, np.zeros(len(c))
        for i, (t, air) in enumerate(zip(c.time_s.tolist(), (c.air_celsius - c.air_celsius[0]).tolist(), strict=True)):
            warm = air + (warm - air) * float(np.exp(-(t - now) / lag))
            now, out[i] = t, warm
        return np.outer(out, way)

    facts = {"size_m_per_K": size, "lag_s": lag}
    return Effect("other:frame-temperature:gauge", ("clock", "temperature"), "gauge", facts, read=read, gauge_only=True)


def bearing_settling(x: Chance) -> Effect:
    """A bearing settles with each load cycle: 15 to 50 % softer at first, dying away over a sixth of the campaign."""
    j, size = x.joint(0.08), x.between(0.15, 0.5)
    cycles, c = max(3.0, float(x.campaign.cycle.max()) * x.between(0.08, 0.25)), float(x.soft[j])

    def joint(s: Situation) -> Array:
        count = np.full(len(s.campaign), 1e9) if s.campaign.rested else s.campaign.cycle.astype(float)
        return at(s, j, size * c * s.torque[:, j] * np.exp(-count / cycles))

    facts = {"size": size, "cycles": cycles}
    code = f"other:bearing-settling:{x.name(j)}"
    return Effect(code, ("clock", "load history"), x.name(j), facts, joint=joint)


def floor_lag(x: Chance) -> Effect:
    """The floor under the base sinks slowly under the moment: 2e6 to 2e7 N m/rad at last, 2 to 15 min behind it."""
    k, lag = x.spread(2e6, 2e7), x.between(120.0, 900.0)

    def twist(s: Situation) -> Array:
        out = np.zeros((len(s.force), 6))
        for axis in (0, 1):
            out[:, axis] = lagging(s.campaign, s.wrench[:, axis], lag) / k
        return out

    facts = {"stiffness_Nm_per_rad": k, "lag_s": lag}
    return Effect("other:floor-lag:base", ("clock", "pose", "load history"), "base", facts, twist=twist)


def retensioned(x: Chance) -> Effect:
    """A belt was tightened in the campaign: a joint is 15 to 40 % stiffer from a certain session, or hour, on."""
    j, size = x.joint(0.08), x.between(0.15, 0.40)
    c, when = float(x.soft[j]), x.between(0.35, 0.65) * float(x.campaign.time_s[-1])

    def joint(s: Situation) -> Array:
        return at(s, j, -size * c * s.torque[:, j] * (s.campaign.time_s >= when))

    facts = {"size": size, "time_s": when}
    return Effect(f"other:belt-retensioned:{x.name(j)}", ("clock", "session"), x.name(j), facts, joint=joint)


def partial_load_path(x: Chance) -> Effect:
    """The parallelogram takes only .3 to .8 of the forearm's moment past joint 2; the rest goes down the upper arm."""
    part = x.between(0.3, 0.8)
    return Effect("partial-load-path", ("pose",), "link", {"bar_path": part}, bar_path=part)


def loose_base(x: Chance) -> Effect:
    """The base rocks in a gap of .1 to .4 mrad that closes with the moment, on both horizontal axes together."""
    gap = x.between(0.1e-3, 0.4e-3)
    closing = x.between(0.03, 0.2) * float(np.linalg.norm(x.bare.wrench[:, :2], axis=1).max())

    def twist(s: Situation) -> Array:
        moment = np.linalg.norm(s.wrench[:, :2], axis=1)
        much = gap * (1 - np.exp(-moment / closing)) / np.maximum(moment, 1e-9)
        out = np.zeros((len(moment), 6))
        out[:, :2] = much[:, None] * s.wrench[:, :2]
        return out

    facts = {"gap_rad": gap, "closing_Nm": closing}
    return Effect("loose-base", ("load", "pose"), "base", facts, twist=twist)


def cable_package(x: Chance) -> Effect:
    """Cables along the wrist pull beside two joints: up to 20 to 60 % of their stiffness where they are wound up."""
    a, b = (x.arm.size - 3, x.arm.size - 2)
    share, power = x.between(0.2, 0.6), x.between(1.5, 4.0)

    def joint(s: Situation) -> Array:
        out = np.zeros_like(s.torque)
        wound = np.zeros(len(s.force))
        for j in (a, b):
            half = 0.5 * np.ptp(x.arm.box_deg[j])
            wound += 0.5 * np.abs((s.campaign.q_deg[:, j] - x.arm.box_deg[j].mean()) / half) ** power
        for j in (a, b):
            out[:, j] = s.torque[:, j] * x.soft[j] * (1 / (1 + share * wound) - 1)
        return out

    facts = {"share": share, "power": power}
    return Effect("cable-package", ("pose",), x.name(a), facts, joint=joint)


def coupled_joints(x: Chance) -> Effect:
    """The two lifting joints turn each other (a common casing): .15 to .5 of the mean of their compliances."""
    a, b = x.large()
    kappa = x.sign() * x.between(0.15, 0.5) * float(np.sqrt(x.soft[a] * x.soft[b]))

    def joint(s: Situation) -> Array:
        return at(s, a, kappa * s.torque[:, b]) + at(s, b, kappa * s.torque[:, a])

    code = f"other:joints-coupled:{x.name(b)}"
    return Effect(code, ("pose",), x.name(b), {"rad_per_Nm": kappa}, joint=joint)


def floor_sag(x: Chance) -> Effect:
    """The floor sags under the base by load times the square of the reach: .1 to .5 um/N at the largest reach."""
    size = x.between(1e-7, 5e-7)
    far = float(np.hypot(x.bare.point[:, 0], x.bare.point[:, 1]).max())

    def twist(s: Situation) -> Array:
        reach = np.hypot(s.point[:, 0], s.point[:, 1]) / far
        out = np.zeros((len(reach), 6))
        out[:, 5] = size * reach**2 * s.force[:, 2]
        return out

    facts = {"size_m_per_N": size, "reach_m": far}
    return Effect("other:floor-sag:base", ("pose", "load"), "base", facts, twist=twist)


def column(x: Chance) -> Effect:
    """The upper arm as a column near its limit: joint 2 gives more by P / (Pc - P), P the load along the upper arm."""
    a, b = x.large()
    critical = x.between(2.0, 5.0) * float(np.linalg.norm(x.campaign.force, axis=1).max())
    home, c = x.arm.centres[b] - x.arm.centres[a], float(x.soft[a])
    home = home / np.linalg.norm(home)

    def joint(s: Situation) -> Array:
        along = s.body(a + 1)[:, :3, :3] @ home
        pressed = -np.einsum("ni,ni->n", along, s.force) / critical
        return at(s, a, c * s.torque[:, a] * pressed / (1.0 - np.minimum(pressed, 0.9)))

    facts = {"critical_N": critical}
    return Effect("other:column-buckling:link", ("load", "pose"), "link", facts, joint=joint)


def one_sided(x: Chance) -> Effect:
    """A joint is 25 to 60 % softer under torque of one sign than of the other (worn flanks of its teeth)."""
    j, size, side = x.joint(0.04, x.swinging()), x.between(0.25, 0.6), x.sign()
    c = float(x.soft[j])

    def joint(s: Situation) -> Array:
        return at(s, j, size * c * np.maximum(side * s.torque[:, j], 0.0) * side)

    facts = {"size": size, "side": side}
    return Effect(f"other:one-sided-stiffness:{x.name(j)}", ("load", "pose"), x.name(j), facts, joint=joint)


def approach(x: Chance) -> Effect:
    """Lost motion wound up by the way there: .1 to .4 mrad, gone under load, by which side the joint came from."""
    j, size = x.joint(0.06, x.moved()), x.between(0.1e-3, 0.4e-3)
    closing = x.between(0.1, 0.4) * x.top(j)

    def joint(s: Situation) -> Array:
        q, stay = s.campaign.q_deg[:, j], s.campaign.stay
        first = np.flatnonzero(np.diff(stay, prepend=-1))
        came = np.sign(np.diff(q[first], prepend=q[0]))
        side = came[np.searchsorted(stay[first], stay)] if not s.campaign.rested else np.zeros(len(q))
        against = side * s.torque[:, j] > 0.0
        return at(s, j, size * side * against * (1 - np.exp(-np.abs(s.torque[:, j]) / closing)))

    facts = {"size_rad": size, "closing_Nm": closing}
    return Effect(f"other:wind-up:{x.name(j)}", ("load history", "pose"), x.name(j), facts, joint=joint)


Family = Callable[[Chance], Effect]

CATALOGUE: dict[str, Family] = {
    "joint-compliance": joint_compliance,
    "joint-tilt": joint_tilt,
    "angle-dependent-stiffness": angle_dependent,
    "hardening": hardening,
    "softening": softening,
    "backlash": backlash,
    "friction": friction,
    "payload": payload,
    "gravity-compensator": gravity_compensator,
    "base-tilt": base_tilt,
    "base-vertical": base_vertical,
    "parallelogram-bar": parallelogram_bar,
    "load-path": load_path,
    "link-flexibility": link_flexibility,
    "tool-compliance": tool_compliance,
    "load-point-offset": load_point_offset,
    "load-misalignment": load_misalignment,
    "joint-zero-offset": zero_offset,
    "gauge-zero": gauge_zero,
    "gauge-scale": gauge_scale,
    "drift": drift,
    "gear-ripple": gear_ripple,
    "wrist-coupling": wrist_coupling,
    "turned-frame": turned_frame,
    "tool-point-offset": tool_point_offset,
    "angle-sign": angle_sign,
    "angle-offset": angle_offset,
    "angle-coupling": angle_coupling,
}
# Twelve of these nineteen act along time or lag, the others along pose and load.
OUTSIDE: dict[str, Family] = {
    "creep": creep,
    "warming": warming,
    "slip": slip,
    "stick-slip": stick_slip,
    "load-cell-hysteresis": load_cell_hysteresis,
    "touched-gauge": touched_gauge,
    "gauge-stick": gauge_stick,
    "frame-temperature": frame_temperature,
    "bearing-settling": bearing_settling,
    "floor-lag": floor_lag,
    "belt-retensioned": retensioned,
    "wind-up": approach,
    "partial-load-path": partial_load_path,
    "loose-base": loose_base,
    "cable-package": cable_package,
    "joints-coupled": coupled_joints,
    "floor-sag": floor_sag,
    "column-buckling": column,
    "one-sided-stiffness": one_sided,
}
BAR = ("parallelogram-bar", "load-path", "partial-load-path")
# Whole tables that are counted otherwise, or scaled, are no half of a pair; links need another model.
ALONE = ("gauge-scale", "angle-sign", "angle-offset", "angle-coupling", "link-flexibility", *BAR)
PAIRED = tuple(name for name in CATALOGUE if name not in ALONE)
