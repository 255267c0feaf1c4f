"""What an exact gauge would read: the truth, from the loads of the sheet to the displacement."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from rehearsal import laws, nuisance
from rehearsal.arm import Arm
from rehearsal.effects import FACTOR_LAWS, TORQUE_LAWS, wrist
from rehearsal.kinematics import Frames, frames, rotation_of
from rehearsal.links import MODES, described_bar, link_compliances
from rehearsal.readings import Readings, path_index
from rehearsal.springs import shapes, stiffness_at
from rehearsal.statics import bar_row, base_rows, bearing_rows, hand_rows, joint_rows, tilt_rows, tool_rows, transfer
from robots.arrays import Array, Indices

DOWN = np.array([0.0, 0.0, -1.0])


class Strange(Protocol):
    """What is hidden and in no catalogue: it may act on loads, compliances, twists and displacements."""

    def wrench(self, truth: Truth, r: Readings, at: Frames, w: Array) -> Array:
        """Wrenches (n, 6) with it."""
        ...

    def factors(self, truth: Truth, r: Readings, tau: Array) -> Array:
        """Factors (n, dof) on the joints' compliances."""
        ...

    def twists(self, truth: Truth, r: Readings, at: Frames, w: Array, tau: Array, theta: Array) -> Array:
        """Twists (n, dof) with it."""
        ...

    def shift(self, truth: Truth, r: Readings, at: Frames, w: Array, d: Array) -> Array:
        """Displacements (n, 3) with it."""
        ...


@dataclass(frozen=True)
class Truth:
    """Everything hidden: the arm, its springs, nuisance and effects as plain values."""

    arm: Arm
    compliance: Array  # (dof,) rad/(N m), 0 where rigid
    links: str
    nuisance: dict[str, Any]
    effects: tuple[dict[str, Any], ...]  # each with code, kind, where and its parameters
    seed: int  # for scatter that belongs to a set-up
    strange: Strange | None = None

    def of(self, *kinds: str) -> list[dict[str, Any]]:
        """The hidden effects of some kinds."""
        return [e for e in self.effects if e["kind"] in kinds]

    def at_joints(self, *kinds: str) -> list[tuple[int, dict[str, Any]]]:
        """Joint and values of the hidden effects of some kinds that sit at a joint."""
        return [(self.arm.index(e["where"]), e) for e in self.of(*kinds)]

    def on_springs(self, compliance: Array) -> Truth:
        """The same hidden effects, and nothing else, in an arm of springs ``compliance`` (dof,) rad/(N m).

        A joint that is hidden to give way does so as before.
        """
        springs = compliance.copy()
        for j, e in self.at_joints("joint-compliance"):
            springs[j] = 1.0 / e["k_Nm_per_rad"]
        return dataclasses.replace(self, nuisance=nuisance.nothing(self.arm), compliance=springs)


def built(truth: Truth) -> Arm:
    """The arm as it stands there: nuisance and load path."""
    arm = nuisance.bent(truth.arm, truth.nuisance)
    for e in truth.of("load-path"):
        arm = dataclasses.replace(arm, parallelogram=e["law"] == "parallelogram")
    return arm


def angles(truth: Truth, q: Array) -> Array:
    """Where the joints really stand (n, dof) when the table says ``q``."""
    q = q + np.array(truth.nuisance["zeros_rad"])
    for j, e in truth.at_joints("joint-zero-offset"):
        q[:, j] += e["zero_rad"]
    for j, _ in truth.at_joints("angle-sign"):
        q[:, j] = -q[:, j]
    for j, e in truth.at_joints("angle-offset"):
        q[:, j] += e["offset_rad"]
    for j, e in truth.at_joints("angle-coupling"):
        q[:, j] += e["share"] * q[:, j - 1]
    return q


def points(truth: Truth, r: Readings) -> Array | None:
    """Where in the flange frame (n, 3) loads really act and displacements are really read; None: at the tool point."""
    given, off = r.point, truth.arm.give.load_point
    if given is not None and off.any():
        given = given + off
    wrong = [np.array(e["at_flange_m"]) for e in truth.of("tool-point-offset")]
    if not wrong:
        return given
    stated = np.full((len(r), 3), np.nan) if given is None else given
    return np.asarray(np.where(np.isnan(stated), truth.arm.tool, stated) + sum(wrong))


def wrenches(truth: Truth, r: Readings, at: Frames) -> Array:
    """True wrench (n, 6) at the tool point."""
    sizes = np.linalg.norm(r.force, axis=1)
    scale = {size: nuisance.weight_scale(truth.nuisance, size) for size in np.unique(sizes)}
    gain = np.array([scale[size] for size in sizes])[:, None]
    force = r.force * gain
    moment = np.zeros_like(force) if r.moment is None else r.moment * gain
    for e in truth.of("turned-frame"):
        # What the sheet calls x, y and z are the axes of the measurement frame.
        turned = rotation_of(np.array(e["turn_rad"])).T
        force, moment = force @ turned, moment @ turned
    for e in truth.of("load-misalignment"):
        azimuth = e["azimuth_rad"] + e["per_q1"] * r.q[:, 0]
        # Turned about a horizontal axis across the azimuth (Rodrigues).
        k = np.stack([-np.sin(azimuth), np.cos(azimuth), np.zeros_like(azimuth)], 1)
        c, s = np.cos(e["tilt_rad"]), np.sin(e["tilt_rad"])
        along = np.einsum("ni,ni->n", k, force)[:, None]
        force = force * c + np.cross(k, force) * s + k * along * (1 - c)
    force, moment = as_modelled(truth.arm, at, force, moment)
    for e in truth.of("load-point-offset"):
        moment = moment + np.cross(at.hand @ np.array(e["at_flange_m"]), force)
    for e in truth.of("payload"):
        weight = np.tile(e["weight_N"] * DOWN, (len(force), 1))
        force = force + weight
        moment = moment + np.cross(at.hand @ np.array(e["at_flange_m"]), weight)
    return np.concatenate([force, moment], 1)


def as_modelled(arm: Arm, at: Frames, force: Array, moment: Array) -> tuple[Array, Array]:
    """Loads (n, 3) at the tool point that act as the model says: tilted, and beside it."""
    give = arm.give
    if give.load_tilt.any():
        R = rotation_of(give.load_tilt)
        force, moment = force @ R.T, moment @ R.T
    if give.load_offset.any():
        moment = moment + np.cross(at.hand @ give.load_offset, force)
    return force, moment


def on_paths(law: Any, tau: Array, c: Array, peak: Array, r: Readings) -> Array:
    """A law along each cycle; ``peak`` (cycles,) is the torque a cycle had reached before its first reading."""
    row, column = path_index(r.cycle)
    path = np.zeros((len(peak), column.max() + 1))
    path[:, 0] = peak
    compliance = np.zeros((len(peak), 1))
    path[row, column] = tau
    compliance[row, 0] = c
    last = np.zeros(len(peak), dtype=int)
    np.maximum.at(last, row, column)
    # Short cycles stay at their last torque.
    path = np.take_along_axis(path, np.minimum(np.arange(path.shape[1]), last[:, None]), 1)
    return np.asarray(law(path, compliance)[row, column])


def factors(truth: Truth, q: Array) -> Array:
    """Factors (n, dof) on the joints' compliances at the stated angles."""
    f = shapes(truth.arm, q)
    for j, e in truth.at_joints(*FACTOR_LAWS):
        f[:, j] *= laws.FACTORS[e["law"]](q[:, j], e)
    return f


def twists(truth: Truth, r: Readings, tau: Array, c: Array, start: Array) -> Array:
    """Angles (n, dof) of the joints, rad."""
    theta = c * tau
    for j, e in truth.at_joints(*TORQUE_LAWS):
        name = {"kink": "gap", "preloaded": "gap", "jenkins": "play"}.get(e["law"], e["law"])

        def law(path: Array, own: Array, name: str = name, e: dict[str, Any] = e) -> Array:
            return laws.LAWS[name](path, own, e)

        theta[:, j] = on_paths(law, tau[:, j], c[:, j], start[:, j], r)
    for e in truth.of("wrist-coupling"):
        a, b = e["per_Nm"]
        k = wrist(theta.shape[1])
        theta[:, k + 1] += a * tau[:, k]
        theta[:, k] += b * tau[:, k + 1]
    return theta


def extra_parts(truth: Truth, arm: Arm, at: Frames, w: Array) -> Array:
    """Displacement (n, 3) of compliant parts beside joints and links."""
    d = np.zeros((len(w), 6))

    def give(rows: Array, c: Array) -> None:
        d[:] += np.einsum("npi,p,npj,nj->ni", rows, c, rows, w)

    for e in truth.of("joint-tilt"):
        give(tilt_rows(at, truth.arm.index(e["where"])), 1 / np.array(e["k_Nm_per_rad"]))
    for e in truth.of("base-tilt"):
        give(base_rows(at)[:, :2], 1 / np.array(e["k_Nm_per_rad"]))
    for e in truth.of("base-vertical"):
        # What carries thousands of newtons goes on giving way.
        stiffening = np.maximum(1 - e["loss_at_1kN"] * np.abs(w[:, 2]) / 1000, 0.4)
        d[:, 2] += w[:, 2] / e["k_N_per_m"] * stiffening
    for e in truth.of("parallelogram-bar"):
        row = bar_row(arm, at)
        N = np.einsum("ni,ni->n", row, w)
        d += row * (N / e["k_N_per_m"] * (1 - e["loss_at_3kN"] * np.minimum(np.abs(N) / 3000, 2)))[:, None]
    for e in truth.of("tool-compliance"):
        give(tool_rows(at), np.array(e["c_m_per_N"]))
    return d[:, :3]


def described_part(arm: Arm, at: Frames, q: Array, w: Array) -> Array:
    """Displacement (n, 3) of what the model itself has besides joints and links: base, bearings, tool."""
    d, give = np.zeros((len(w), 6)), arm.give
    if not give.anything:
        return d[:, :3]

    def add(rows: Array, C: Array) -> None:
        d[:] += np.einsum("npi,pq,nqj,nj->ni", rows, C, rows, w, optimize=True)

    if give.base.any():
        add(transfer(np.zeros_like(at.tool), at.tool), give.base)
    for j in range(arm.dof):
        own = [(row, law) for joint, row, law in give.bearing_laws if joint == j]
        if not (give.bearings[j].any() or own):
            continue
        rows = bearing_rows(arm, at, j)
        add(rows, give.bearings[j])
        for row, law in own:
            t = rows[:, row]
            d += t * (np.einsum("ni,ni->n", t, w) / stiffness_at(law, arm.coordinates, q))[:, None]
    if give.tool.any():
        add(hand_rows(at), give.tool)
    return d[:, :3]


def link_compliance(arm: Arm, poses: Frames, links: str, more: dict[str, dict[str, float]] | None = None) -> Array:
    """Compliance (m, 6, 6) of all links at the poses; ``more``: shares on top by link and mode."""
    if links == "rigid":
        return described_bar(arm, poses)
    total = np.zeros((len(poses.tool), 6, 6))
    for name, C in link_compliances(arm, poses).items():
        gain = np.array([1 + (more or {}).get(name, {}).get(mode, 0.0) for mode in MODES])
        total += np.einsum("m,mnij->nij", gain, C)
    return total


def link_part(truth: Truth, arm: Arm, poses: Frames, pose: Indices, w: Array) -> Array:
    """Displacement (n, 3) of the links; compliances once a pose."""
    more = {e["where"]: e["modes"] for e in truth.of("link-flexibility")}
    total = link_compliance(arm, poses, truth.links, more)
    return np.asarray(np.einsum("nij,nj->ni", total[pose][:, :3], w))


def gauge(truth: Truth, r: Readings, d: Array) -> Array:
    """What the gauge makes of displacements (n, 3)."""
    for e in truth.of("gauge-scale"):
        d = d * (1 + e["scale"])
    for e in truth.of("gauge-zero"):
        scatter = np.array([np.random.default_rng([truth.seed, 77, int(s)]).normal() for s in range(r.setup.max() + 1)])
        d = d + e["zero_m"] * (1 + e["scatter"] * scatter[r.setup])[:, None]
    for e in truth.of("drift"):
        t = r.clock
        if e["law"] == "exponential":
            shape = (1 - np.exp(-t / e["T"])) / (1 - np.exp(-1 / e["T"]))
        else:
            shape = t + e["share"] * np.sin(2 * np.pi * e["turns"] * t)
        d = d + (e["size_m"] * shape)[:, None]
    return d


def exact(truth: Truth, r: Readings) -> Array:
    """Noise-free readings (n, 3) in m."""
    arm = built(truth)
    r = dataclasses.replace(r, point=points(truth, r))
    unique, index, point = r.kinds
    poses = frames(arm, angles(truth, unique), point)
    at = poses.at(index)
    w = wrenches(truth, r, at)
    rows = joint_rows(arm, poses)[index]
    if truth.strange is not None:
        w = truth.strange.wrench(truth, r, at, w)
    tau = np.einsum("nji,ni->nj", rows, w)
    c = truth.compliance * factors(truth, r.q)
    if truth.strange is not None:
        c = c * truth.strange.factors(truth, r, tau)
    theta = twists(truth, r, tau, c, _start(arm, r, tau))
    if truth.strange is not None:
        theta = truth.strange.twists(truth, r, at, w, tau, theta)
    d = np.einsum("nji,nj->ni", rows[:, :, :3], theta)
    d = d + extra_parts(truth, arm, at, w) + link_part(truth, arm, poses, index, w)
    if truth.arm.give.anything:
        d = d + described_part(arm, at, r.q, w)
    if truth.strange is not None:
        d = truth.strange.shift(truth, r, at, w, d)
    for e in truth.of("turned-frame"):
        d = d @ rotation_of(np.array(e["turn_rad"]))
    return gauge(truth, r, d)


def _start(arm: Arm, r: Readings, tau: Array) -> Array:
    """Torques (cycles, dof) that each cycle had reached before its first reading."""
    start = np.zeros((r.cycle.max() + 1 if len(r.peak) == 0 else len(r.peak), arm.dof))
    if len(r.peak) and np.any(r.peak):
        # The load a cycle started from, in the wrench of its first reading's direction.
        _, first = np.unique(r.cycle, return_index=True)
        ratio = np.linalg.norm(r.peak, axis=1) / np.maximum(np.linalg.norm(r.force[first], axis=1), 1e-9)
        start = tau[first] * ratio[:, None]
    return start
