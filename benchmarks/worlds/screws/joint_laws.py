"""Catalogue effects at a joint: springs that vary, play, friction, teeth, couplings. Angles in rad, torques in N m."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.special import erf

from .campaign import along_history
from .chance import Chance, at
from .mechanics import Effect, Situation
from .screws import Array


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
