"""Compiled loops behind :mod:`surrogate.maps.self_motion`: one pose at a time, without any array between the steps.

All functions in one file: numba recompiles what it has stored when the file of a function changes, not when another
one does.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from robots.arrays import Array

# Products may be fused with sums (faster, and no less exact); nothing else is relaxed.
compiled = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
inlined = njit(cache=True, nogil=True, error_model="numpy", forceinline=True, fastmath={"contract"})
# Row of the chain: a constant rotation by rows, then a shift (m), both before the joint; the last leads to the tool.
SHIFT, COLUMNS = 9, 12
# Shorter than this share of its first length, what is left of a vector is rounding.
NOTHING = 1e-12


# Not to be renamed: what numba has stored of an earlier version asks for it by name.
class Limbs(NamedTuple):
    """An arm for these loops.

    ``chain`` (dof + 1, COLUMNS); ``sign``, ``offset``, ``low``, ``high`` (dof,); of the couplings ``factors`` (c, dof)
    and ``ends`` (c, 3): offset, lower, upper. ``free``: the joints up to here move, those behind it are held.
    ``length`` m, by which lengths are divided.
    """

    chain: Array
    sign: Array
    offset: Array
    low: Array
    high: Array
    factors: Array
    ends: Array
    free: int
    length: float


@inlined
def _tip(arm: Limbs, q: Array, tip: Array, J: Array) -> None:
    """Tool point (3,) m and, in the first rows of J (6, dof), how it moves with the joints; the rest is scratch."""
    dof = len(q)
    xx, xy, xz, yx, yy, yz, zx, zy, zz = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
    x, y, z = 0.0, 0.0, 0.0
    for i in range(dof + 1):
        c = arm.chain[i]
        x += xx * c[9] + xy * c[10] + xz * c[11]
        y += yx * c[9] + yy * c[10] + yz * c[11]
        z += zx * c[9] + zy * c[10] + zz * c[11]
        if i == dof:
            break
        ax, ay, az = (
            xx * c[0] + xy * c[3] + xz * c[6],
            xx * c[1] + xy * c[4] + xz * c[7],
            (xx * c[2] + xy * c[5] + xz * c[8]),
        )
        bx, by, bz = (
            yx * c[0] + yy * c[3] + yz * c[6],
            yx * c[1] + yy * c[4] + yz * c[7],
            (yx * c[2] + yy * c[5] + yz * c[8]),
        )
        dx, dy, dz = (
            zx * c[0] + zy * c[3] + zz * c[6],
            zx * c[1] + zy * c[4] + zz * c[7],
            (zx * c[2] + zy * c[5] + zz * c[8]),
        )
        angle = arm.sign[i] * q[i] + arm.offset[i]
        cos, sin = math.cos(angle), math.sin(angle)
        xx, xy, xz = cos * ax + sin * ay, cos * ay - sin * ax, az
        yx, yy, yz = cos * bx + sin * by, cos * by - sin * bx, bz
        zx, zy, zz = cos * dx + sin * dy, cos * dy - sin * dx, dz
        J[0, i], J[1, i], J[2, i], J[3, i], J[4, i], J[5, i] = az, bz, dz, x, y, z
    tip[0], tip[1], tip[2] = x, y, z
    for i in range(dof):
        ax, ay, az = arm.sign[i] * J[0, i], arm.sign[i] * J[1, i], arm.sign[i] * J[2, i]
        dx, dy, dz = x - J[3, i], y - J[4, i], z - J[5, i]
        J[0, i], J[1, i], J[2, i] = ay * dz - az * dy, az * dx - ax * dz, ax * dy - ay * dx


@inlined
def _coupling(arm: Limbs, k: int, q: Array, held: Array) -> tuple[float, float, bool]:
    """How far a coupling is broken (rad), the square of its normal among the joints that move, whether it is active."""
    value, size = arm.ends[k, 0], 0.0
    for j in range(len(q)):
        value += arm.factors[k, j] * q[j]
        size += arm.factors[k, j] ** 2 * (1.0 - held[j])
    lower, upper = arm.ends[k, 1], arm.ends[k, 2]
    over = max(value - upper, 0.0) - max(lower - value, 0.0)
    return over, size, value >= upper - 1e-12 or value <= lower + 1e-12


@inlined
def _onto_limits(arm: Limbs, q: Array, held: Array) -> None:
    """Move q (dof,) onto limits and couplings that it breaks; ``held`` (dof,) becomes 1 for joints on an end."""
    for j in range(len(q)):
        held[j] = 1.0 if j >= arm.free or q[j] <= arm.low[j] or q[j] >= arm.high[j] else 0.0
        q[j] = min(max(q[j], arm.low[j]), arm.high[j])
    for k in range(len(arm.factors)):
        over, size, _ = _coupling(arm, k, q, held)
        if over != 0.0 and size > 0.0:
            for j in range(len(q)):
                q[j] -= over / size * arm.factors[k, j] * (1.0 - held[j])


@inlined
def _allowed(arm: Limbs, q: Array, held: Array, J: Array) -> None:
    """Take out of J, lengths over the arm's, what joints on ends and active couplings do not let the joints do."""
    dof = len(q)
    for i in range(3):
        for j in range(dof):
            J[i, j] *= (1.0 - held[j]) / arm.length
    for k in range(len(arm.factors)):
        _, size, active = _coupling(arm, k, q, held)
        if active and size > 0.0:
            for i in range(3):
                along = 0.0
                for j in range(dof):
                    along += J[i, j] * arm.factors[k, j]
                for j in range(dof):
                    J[i, j] -= along / size * arm.factors[k, j] * (1.0 - held[j])


@inlined
def _gain(J: Array, damping: float, miss: Array) -> None:
    """``miss`` (3,) becomes (J J^T + damping)^-1 miss."""
    a, b, c, d, e, f = damping, 0.0, 0.0, damping, 0.0, damping
    for j in range(J.shape[1]):
        a += J[0, j] * J[0, j]
        b += J[0, j] * J[1, j]
        c += J[0, j] * J[2, j]
        d += J[1, j] * J[1, j]
        e += J[1, j] * J[2, j]
        f += J[2, j] * J[2, j]
    aa, bb, cc = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * aa + b * bb + c * cc
    dd, ee, ff = a * f - c * c, b * c - a * e, a * d - b * b
    x, y, z = miss[0], miss[1], miss[2]
    miss[0] = (aa * x + bb * y + cc * z) / determinant
    miss[1] = (bb * x + dd * y + ee * z) / determinant
    miss[2] = (cc * x + ee * y + ff * z) / determinant


@compiled
def brought_back(
    arm: Limbs, q: Array, target: Array, corrections: int, near: float, damping: float, longest: float, there: Array
) -> None:
    """:func:`surrogate.maps.self_motion.brought_back` in place, without the last look at the limits.

    q (t k, dof) rad, target (k, 3) m; ``near``: share of the arm's length that counts as there; ``there`` (t k,) 0, 1.
    """
    n, dof = q.shape
    J, tip, miss, held = np.zeros((6, dof)), np.zeros(3), np.zeros(3), np.zeros(dof)
    for row in range(n):
        pose, goal = q[row], target[row % len(target)]
        there[row] = 0.0
        for turn in range(corrections + 1):
            _onto_limits(arm, pose, held)
            _tip(arm, pose, tip, J)
            square = 0.0
            for i in range(3):
                miss[i] = (goal[i] - tip[i]) / arm.length
                square += miss[i] * miss[i]
            if square < near * near:
                there[row] = 1.0
                break
            if turn == corrections:
                break
            _allowed(arm, pose, held, J)
            _gain(J, damping, miss)
            largest = longest
            for j in range(dof):
                J[3, j] = J[0, j] * miss[0] + J[1, j] * miss[1] + J[2, j] * miss[2]
                largest = max(largest, abs(J[3, j]))
            for j in range(dof):
                pose[j] += longest / largest * J[3, j]


@inlined
def _made_normal(B: Array, k: int) -> bool:
    """Row k of B across the k rows before it, and of unit length; False where nothing is left of it."""
    first, size = 0.0, 0.0
    for j in range(B.shape[1]):
        first += B[k, j] ** 2
    for _ in range(2):  # once more: rounding of the first time
        for h in range(k):
            along = 0.0
            for j in range(B.shape[1]):
                along += B[h, j] * B[k, j]
            for j in range(B.shape[1]):
                B[k, j] -= along * B[h, j]
    for j in range(B.shape[1]):
        size += B[k, j] ** 2
    some = size > NOTHING**2 * first
    for j in range(B.shape[1]):
        B[k, j] = B[k, j] / math.sqrt(size) if some else 0.0
    return some


@compiled
def self_motions(arm: Limbs, q: Array, out: Array) -> None:
    """Orthonormal joint motions ``out`` (n, free - 3, dof) that leave the tool point at rest, at poses q (n, dof).

    The three rows of the Jacobian are made orthonormal, then unit vectors of those joints that are least in what is
    there already: of all joints one has a share of 1 - k / free or more left.
    """
    n, dof = q.shape
    J, tip, B = np.zeros((6, dof)), np.zeros(3), np.zeros((arm.free, dof))
    for row in range(n):
        _tip(arm, q[row], tip, J)
        for i in range(3):
            for j in range(dof):
                B[i, j] = J[i, j] if j < arm.free else 0.0
            _made_normal(B, i)
        for k in range(3, arm.free):
            most, joint = -1.0, 0
            for j in range(arm.free):
                left = 1.0
                for h in range(k):
                    left -= B[h, j] ** 2
                if left > most:
                    most, joint = left, j
            for j in range(dof):
                B[k, j] = 1.0 if j == joint else 0.0
            _made_normal(B, k)
            for j in range(dof):
                out[row, k - 3, j] = B[k, j]
