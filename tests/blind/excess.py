"""How much of an effect the model's free springs cannot absorb, in units of the noise."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from .arm import Arm, Array
from .kinematics import frames
from .links import link_compliances
from .noise import Noise
from .spec import Readings
from .statics import joint_rows


def linear_model(arm: Arm, links: str, r: Readings) -> tuple[Array, Array]:
    """Displacements (n, 3, 6) per unit compliance of each joint, and (n, 3) of the links, of the nominal arm."""
    unique, index = np.unique(r.q, axis=0, return_inverse=True)
    index = index.ravel()
    at = frames(arm, unique)
    rows = joint_rows(arm, at)[index]
    w = np.concatenate([r.force, np.zeros_like(r.force)], 1)
    J = np.einsum("nji,nj->nij", rows[:, :, :3], np.einsum("nji,ni->nj", rows, w))
    if links == "rigid":
        return J, np.zeros((len(r), 3))
    C = np.asarray(sum(c.sum(0) for c in link_compliances(arm, at).values()))
    return J, np.einsum("nij,nj->ni", C[index][:, :3], w)


def excess_chi2(
    arm: Arm, free: list[int], links: str, r: Readings, d: Array, noise: Noise, axes: list[int]
) -> tuple[float, Array]:
    """Smallest |V^-1/2 (d - links - J c)|^2 over c >= 0 of the free joints, and that c; V as the truth has it."""
    J, fixed = linear_model(arm, links, r)
    exact = d[:, axes]
    both = np.concatenate([J[:, axes][:, :, free], (d - fixed)[:, axes][:, :, None]], axis=2)
    white = noise.whiten(r, exact, both)
    A, b = white[:, :-1], white[:, -1]
    scale = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    usable = np.linalg.norm(A, axis=0) > 1e-9 * max(1e-300, float(np.linalg.norm(A, axis=0).max()))
    c = np.zeros(len(free))
    if not usable.any():
        return float(b @ b), c
    found, distance = nnls(A[:, usable] / scale[usable], b)
    c[usable] = found / scale[usable]
    return float(distance**2), c
