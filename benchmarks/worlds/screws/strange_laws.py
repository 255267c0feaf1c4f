"""Effects along pose and load that the catalogue does not have: gaps, cables, couplings, columns."""

from __future__ import annotations

import numpy as np

from .chance import Chance, at
from .mechanics import Effect, Situation
from .screws import Array


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
