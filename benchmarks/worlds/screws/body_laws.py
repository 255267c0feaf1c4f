"""Catalogue effects beside the joints' springs: base, bearings, bar, links, tool. Twists about screws of their own."""

from __future__ import annotations

import numpy as np

from .chance import Chance, at
from .mechanics import Effect, Situation
from .screws import Array, screw_through

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
