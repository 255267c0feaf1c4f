"""What an exact gauge would read: the truth, from the loads of the sheet to the displacement."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import laws, nuisance, outside
from .arm import Arm, Array
from .effects import FACTOR_LAWS, TORQUE_LAWS
from .kinematics import Frames, frames
from .links import MODES, link_compliances
from .spec import Readings, path_index
from .statics import bar_row, base_rows, joint_rows, tilt_rows, tool_rows

DOWN = np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True)
class Truth:
    """Everything hidden: the arm by name, its springs, nuisance and effects as plain values."""

    arm: Arm
    compliance: Array  # (6,) rad/(N m), 0 where rigid
    links: str
    nuisance: dict[str, Any]
    effects: tuple[dict[str, Any], ...]  # each with code, kind, where and its parameters
    seed: int  # for scatter that belongs to a set-up

    def of(self, kind: str) -> list[dict[str, Any]]:
        return [e for e in self.effects if e["kind"] == kind]


def built(truth: Truth) -> Arm:
    """The arm as it stands there: nuisance and load path."""
    arm = nuisance.bent(truth.arm, truth.nuisance)
    for e in truth.of("load-path"):
        arm = dataclasses.replace(arm, parallelogram=e["law"] == "parallelogram")
    return arm


def angles(truth: Truth, q: Array) -> Array:
    q = q + np.array(truth.nuisance["zeros_rad"])
    for e in truth.of("joint-zero-offset"):
        q[:, int(e["where"][1:]) - 1] += e["zero_rad"]
    return q


def wrenches(truth: Truth, r: Readings, at: Frames) -> Array:
    """True wrench (n, 6) at the tool point."""
    sizes = np.linalg.norm(r.force, axis=1)
    scale = {size: nuisance.weight_scale(truth.nuisance, size) for size in np.unique(sizes)}
    force = r.force * np.array([scale[size] for size in sizes])[:, None]
    moment = np.zeros_like(force)
    for e in truth.of("load-misalignment"):
        azimuth = e["azimuth_rad"] + e["per_q1"] * r.q[:, 0]
        # Turned about a horizontal axis across the azimuth (Rodrigues).
        k = np.stack([-np.sin(azimuth), np.cos(azimuth), np.zeros_like(azimuth)], 1)
        c, s = np.cos(e["tilt_rad"]), np.sin(e["tilt_rad"])
        along = np.einsum("ni,ni->n", k, force)[:, None]
        force = force * c + np.cross(k, force) * s + k * along * (1 - c)
    R = at.rotations[:, 6]
    for e in truth.of("load-point-offset"):
        moment = moment + np.cross(R @ np.array(e["at_flange_m"]), force)
    for e in truth.of("payload"):
        weight = np.tile(e["weight_N"] * DOWN, (len(force), 1))
        force = force + weight
        moment = moment + np.cross(R @ np.array(e["at_flange_m"]), weight)
    return np.concatenate([force, moment], 1)


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
    """Factors (n, 6) on the joints' compliances at the stated angles."""
    f = np.ones_like(q)
    for e in truth.effects:
        if e["kind"] in FACTOR_LAWS:
            j = int(e["where"][1:]) - 1
            f[:, j] *= laws.FACTORS[e["law"]](q[:, j], e)
    return f


def twists(truth: Truth, r: Readings, tau: Array, c: Array, start: Array) -> Array:
    """Angles (n, 6) of the joints, rad."""
    theta = c * tau
    for e in truth.effects:
        if e["kind"] not in TORQUE_LAWS:
            continue
        j = int(e["where"][1:]) - 1
        name = {"kink": "gap", "preloaded": "gap", "jenkins": "play"}.get(e["law"], e["law"])

        def law(path: Array, own: Array, name: str = name, e: dict[str, Any] = e) -> Array:
            return laws.LAWS[name](path, own, e)

        theta[:, j] = on_paths(law, tau[:, j], c[:, j], start[:, j], r)
    for e in truth.of("wrist-coupling"):
        a, b = e["per_Nm"]
        theta[:, 4] += a * tau[:, 3]
        theta[:, 3] += b * tau[:, 4]
    return theta


def extra_parts(truth: Truth, arm: Arm, at: Frames, w: Array) -> Array:
    """Displacement (n, 3) of compliant parts beside joints and links."""
    d = np.zeros((len(w), 6))

    def give(rows: Array, c: Array) -> None:
        d[:] += np.einsum("npi,p,npj,nj->ni", rows, c, rows, w)

    for e in truth.of("joint-tilt"):
        give(tilt_rows(at, int(e["where"][1:]) - 1), 1 / np.array(e["k_Nm_per_rad"]))
    for e in truth.of("base-tilt"):
        give(base_rows(at)[:, :2], 1 / np.array(e["k_Nm_per_rad"]))
    for e in truth.of("base-vertical"):
        stiffening = 1 - e["loss_at_1kN"] * np.abs(w[:, 2]) / 1000
        d[:, 2] += w[:, 2] / e["k_N_per_m"] * stiffening
    for e in truth.of("parallelogram-bar"):
        row = bar_row(arm, at)
        N = np.einsum("ni,ni->n", row, w)
        d += row * (N / e["k_N_per_m"] * (1 - e["loss_at_3kN"] * np.minimum(np.abs(N) / 3000, 2)))[:, None]
    for e in truth.of("tool-compliance"):
        give(tool_rows(at), np.array(e["c_m_per_N"]))
    return d[:, :3]


def link_part(truth: Truth, arm: Arm, poses: Frames, pose: Array, w: Array) -> Array:
    """Displacement (n, 3) of the links; compliances once a pose."""
    if truth.links == "rigid":
        return np.zeros((len(w), 3))
    total = np.zeros((len(poses.tool), 6, 6))
    more = {e["where"]: e["modes"] for e in truth.of("link-flexibility")}
    for name, C in link_compliances(arm, poses).items():
        gain = np.array([1 + more.get(name, {}).get(mode, 0.0) for mode in MODES])
        total += np.einsum("m,mnij->nij", gain, C)
    return np.einsum("nij,nj->ni", total[pose.astype(int)][:, :3], w)


def gauge(truth: Truth, r: Readings, d: Array) -> Array:
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
    unique, index = np.unique(r.q, axis=0, return_inverse=True)
    index = index.ravel()
    poses = frames(arm, angles(truth, unique))
    at = Frames(**{f.name: getattr(poses, f.name)[index] for f in dataclasses.fields(poses)})
    w = wrenches(truth, r, at)
    rows = joint_rows(arm, poses)[index]
    w = outside.wrench(truth, r, at, w)
    tau = np.einsum("nji,ni->nj", rows, w)
    start = np.zeros((r.cycle.max() + 1 if len(r.peak) == 0 else len(r.peak), 6))
    if len(r.peak) and np.any(r.peak):
        # The load a cycle started from, in the wrench of its first reading's direction.
        _, first = np.unique(r.cycle, return_index=True)
        ratio = np.linalg.norm(r.peak, axis=1) / np.maximum(np.linalg.norm(r.force[first], axis=1), 1e-9)
        start = tau[first] * ratio[:, None]
    c = truth.compliance * factors(truth, r.q) * outside.factors(truth, r, tau)
    theta = outside.twists(truth, r, at, w, tau, twists(truth, r, tau, c, start))
    d = np.einsum("nji,nj->ni", rows[:, :, :3], theta)
    d = d + extra_parts(truth, arm, at, w) + link_part(truth, arm, poses, index, w)
    return gauge(truth, r, outside.shift(truth, r, at, w, d))
