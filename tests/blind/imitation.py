"""How well any one catalogue effect could imitate what is hidden: linearised parts, fitted generously.

Parameters have no sign and no range here, and non-linear laws get several shapes at once, so the excess that
remains is a lower bound: where it is far above zero, no single name of the catalogue is an honest answer.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from rehearsal import laws
from rehearsal.arm import Arm
from rehearsal.evaluate import on_paths
from rehearsal.excess import excess_chi2, linear_model
from rehearsal.kinematics import Frames, frames
from rehearsal.links import link_compliances
from rehearsal.noise import Noise
from rehearsal.readings import Readings
from rehearsal.statics import bar_row, base_rows, joint_rows, tilt_rows, tool_rows
from robots.arrays import Array

Columns = Iterator[tuple[str, Array]]  # code and displacements (n, 3, m)


def torque_shapes(rows: Array, w: Array, r: Readings) -> Columns:
    """Joint laws: powers, gaps and sliders of each joint's own torque."""
    tau = np.einsum("nji,ni->nj", rows, w)
    peak = np.zeros(len(r.peak))
    for j in range(6):
        t = tau[:, j]
        top = float(np.quantile(np.abs(t), 0.8))
        if top < 1e-6:
            continue
        move = rows[:, j, :3]
        powers = [np.sign(t) * np.abs(t / top) ** p for p in (0.5, 1.5, 2.0, 3.0)]
        gaps = [np.clip(t / (x * top), -1, 1) for x in (0.05, 0.3, 0.6)]
        yield f"torque-law:j{j + 1}", move[:, :, None] * np.stack(powers + gaps, 1)[:, None]

        def sliders(path: Array, c: Array, top: float = top) -> Array:
            slip = {"stuck_share": 0.0, "weights": [1.0]}
            return np.stack([laws.play(path, c, slip | {"slip_Nm": [x * top]}) for x in (0.1, 0.3, 0.6)], -1)

        one = np.ones(len(t))
        yield f"friction:j{j + 1}", move[:, :, None] * on_paths(sliders, t, one, peak, r)[:, None]


def angle_shapes(arm: Arm, J: Array, r: Readings) -> Columns:
    """Compliance that varies with a joint's own angle: three harmonics, or one ripple of any tooth number."""
    for j in range(6):
        q = r.q[:, j]
        waves = [f(k * q) for k in (1, 2, 3) for f in (np.cos, np.sin)]
        yield f"angle-dependent-stiffness:j{j + 1}", J[:, :, j, None] * np.stack(waves, 1)[:, None]


def parts(arm: Arm, links: str, at: Frames, poses: Frames, index: Array, w: Array) -> Columns:
    """Compliant parts beside the joints' own axes."""

    def give(rows: Array) -> Array:
        return np.einsum("npi,npj,nj->nip", rows[:, :, :3], rows, w)

    for j in range(6):
        yield f"joint-tilt:j{j + 1}", give(tilt_rows(at, j))
    yield "base-tilt", give(base_rows(at)[:, :2])
    yield "base-vertical", give(base_rows(at)[:, 2:])
    yield "tool-compliance", give(tool_rows(at))
    if arm.bar is not None and arm.parallelogram:
        yield "parallelogram-bar", give(bar_row(arm, at)[:, None])
    if links == "beam":
        for name, C in link_compliances(arm, poses).items():
            yield f"link-flexibility:{name}", np.einsum("mnij,nj->nim", C[:, index, :3], w)


def loads(arm: Arm, c: Array, r: Readings, at: Frames, rows: Array) -> Columns:
    """Loads and angles that are not what the sheet says, about the springs that fit best."""
    n = len(r)

    def moved(w: Array) -> Array:
        return np.einsum("nji,j,njk,nkm->nim", rows[:, :, :3], c, rows, w)

    down = np.zeros((n, 6, 1))
    down[:, 2] = -1
    yield "payload", moved(down)
    R = at.hand
    arms = np.stack([np.cross(R[:, :, k], r.force) for k in range(3)], 2)
    yield "load-point-offset", moved(np.concatenate([np.zeros((n, 3, 3)), arms], 1))
    sides = np.stack([np.cross(e, r.force) for e in np.eye(3)], 2)
    yield "load-misalignment", moved(np.concatenate([sides, np.zeros((n, 3, 3))], 1))
    for j in range(6):
        step = np.zeros(6)
        step[j] = 1e-4
        d = [linear_model(arm, "rigid", dataclasses.replace(r, q=r.q + s * step))[0] @ c for s in (-1, 1)]
        yield f"joint-zero-offset:j{j + 1}", ((d[1] - d[0]) / 2e-4)[:, :, None]


def catalogue(arm: Arm, links: str, c: Array, r: Readings) -> Columns:
    """All single effects, as columns to add to the springs'."""
    unique, index = np.unique(r.q, axis=0, return_inverse=True)
    index = index.ravel()
    poses = frames(arm, unique)
    at = poses.at(index)
    w = np.concatenate([r.force, np.zeros_like(r.force)], 1)
    rows = joint_rows(arm, poses)[index]
    J, _ = linear_model(arm, "rigid", r)
    yield "joint-compliance", J
    yield from torque_shapes(rows, w, r)
    yield from angle_shapes(arm, J, r)
    yield from parts(arm, links, at, poses, index, w)
    yield from loads(arm, c, r, at, rows)
    yield "gauge-zero", np.tile(np.eye(3), (len(r), 1, 1))
    t = r.clock[:, None, None]
    yield "drift", np.ones((1, 3, 1)) * np.concatenate([t, t**2, np.exp(-t / 0.2)], 2)
    tau = np.einsum("nji,ni->nj", rows, w)
    pair = np.stack([rows[:, 4, :3] * tau[:, 3:4], rows[:, 3, :3] * tau[:, 4:5]], 2)
    yield "wrist-coupling", pair
    if arm.bar is not None:
        other = dataclasses.replace(arm, parallelogram=not arm.parallelogram)
        yield "load-path", linear_model(other, "rigid", r)[0]


def best_imitation(
    arm: Arm, free: list[int], links: str, r: Readings, d: Array, noise: Noise, axes: list[int]
) -> tuple[str, float]:
    """The catalogue effect that leaves least of the noise-free readings ``d``, and the excess it leaves."""
    _, found = excess_chi2(arm, free, links, r, d, noise, axes)
    c = np.zeros(6)
    c[free] = found
    J, fixed = linear_model(arm, links, r)
    base = np.concatenate([J[:, axes][:, :, free], (d - fixed)[:, axes][:, :, None]], 2)
    white = noise.whiten(r, d[:, axes], base)
    best = ("nothing", float("inf"))
    for code, columns in catalogue(arm, links, c, r):
        A = np.concatenate([white[:, :-1], noise.whiten(r, d[:, axes], columns[:, axes])], 1)
        A = A / np.maximum(np.linalg.norm(A, axis=0), 1e-300)
        x, *_ = np.linalg.lstsq(A, white[:, -1], rcond=1e-9)
        left = float(np.sum((white[:, -1] - A @ x) ** 2))
        if left < best[1]:
            best = (code, left)
    return best
