"""How much of an effect the model's free springs cannot absorb, in units of the noise."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from rehearsal.arm import Arm
from rehearsal.evaluate import as_modelled, described_part, link_compliance
from rehearsal.kinematics import frames
from rehearsal.noise import Noise
from rehearsal.readings import Readings
from rehearsal.springs import shapes
from rehearsal.statics import joint_rows
from robots.arrays import Array, Bools


def linear_model(arm: Arm, links: str, r: Readings) -> tuple[Array, Array]:
    """Displacements (n, 3, dof) per unit compliance of each joint, and (n, 3) of the rest, of the nominal arm."""
    unique, index, points = r.kinds
    at = frames(arm, unique, points)
    rows = joint_rows(arm, at)[index]
    here = at.at(index)
    w = np.concatenate(as_modelled(arm, here, r.wrench[:, :3], r.wrench[:, 3:]), 1)
    J = np.einsum("nji,nj->nij", rows[:, :, :3], np.einsum("nji,ni->nj", rows, w))
    if any(arm.laws):
        J = J * shapes(arm, r.q)[:, None]
    C = link_compliance(arm, at, links)
    fixed = np.einsum("nij,nj->ni", C[index][:, :3], w)
    return J, fixed + described_part(arm, here, r.q, w)


def excess_chi2(
    arm: Arm,
    free: list[int],
    links: str,
    r: Readings,
    d: Array,
    noise: Noise,
    axes: list[int],
    read: Bools | None = None,
) -> tuple[float, Array]:
    """Smallest |V^-1/2 (d - links - J c)|^2 over c >= 0 of the free joints, and that c; V as the truth has it.

    ``read`` (n, 3): which axes each reading has, if not all of ``axes``.
    """
    J, fixed = linear_model(arm, links, r)
    exact = d[:, axes]
    both = np.concatenate([J[:, axes][:, :, free], (d - fixed)[:, axes][:, :, None]], axis=2)
    white = noise.whiten(r, exact, both, None if read is None else read[:, axes])
    A, b = white[:, :-1], white[:, -1]
    scale = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    usable = np.linalg.norm(A, axis=0) > 1e-9 * max(1e-300, float(np.linalg.norm(A, axis=0).max()))
    c = np.zeros(len(free))
    if not usable.any():
        return float(b @ b), c
    found, distance = nnls(A[:, usable] / scale[usable], b)
    c[usable] = found / scale[usable]
    return float(distance**2), c
