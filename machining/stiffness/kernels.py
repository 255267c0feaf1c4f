"""Compiled loops behind :mod:`machining.stiffness.compiled`: inverse kinematics and ``C_tt u``, all branches.

The equations are those of :mod:`robots.inverse.closed_form` and :mod:`fem.statics.flexibility`. Three things make them
cheap:

- Sines and cosines come from the half-angle's square roots, so no angle is turned back into them. Angles are left as
  pairs (sine, cosine) for numpy's vectorised arctangent.
- The wrist's axes meet in one point W, so their share is ``(sum c_j z_j (z_j . m)) x L`` with ``L = P - W``,
  ``m = L x u``; axis 6 and m are the target's own, the same in all branches.
- Loops have no branches and work on rows of a thousand bytes and more, so that they become vector instructions.

Two branches of one target differ in the sign of an angle: they share its pair.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from robots.arrays import Array, Integers
from robots.inverse.branches import Reason
from robots.inverse.turns import TURN

Codes = NDArray[np.int8]
# Tuples, because numba counts references of arrays, and threads would wait for one another there.
Pair = tuple[float, float]
Vector = tuple[float, float, float]
Rotation = tuple[Vector, Vector, Vector]
Six = tuple[float, float, float, float, float, float]

# Products may be fused with sums (faster, and no less exact); nothing else is relaxed.
compiled = njit(cache=True, nogil=True, error_model="numpy", forceinline=True, fastmath={"contract"})
# Called several times; compiled once instead of at each call.
separate = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})

LIMITS, TOO_FAR, TOO_NEAR = int(Reason.LIMITS), int(Reason.TOO_FAR), int(Reason.TOO_NEAR)
SHOULDER, ORIENTATION = int(Reason.SHOULDER), int(Reason.ORIENTATION)

# Targets a pass. Each figure of theirs has a row of the work array, which stays in the processor's cache. Loops always
# run over whole rows: no target's digits depend on where it stands. Not a power of two: see fem.statics.flexibility.
BLOCK = 520
# Rows. Three banks of 32: sines and cosines (times any positive number) of the angles sought, and displacements.
SINE, COSINE, MOVED = 0, 32, 64
# In each bank, of the target, of each of two shoulders (by 3 rows), of each of four elbows (by 6); two branches each.
SWING, STRAIGHT = 0, 1
BEND, TOWARDS, INNER = 2, 3, 4
BEND_5, ASKED, GIVEN, LAST, BETWEEN = 8, 9, 10, 11, 13
# The target's point as given, cos and sin of gamma, the hand's vectors in axes of joint 1, cos and sin of joint 1 for
# each shoulder, why the target or a shoulder has no posture; what joints 4 to 6 need of a shoulder, and of each elbow.
POINT, GAMMA, HAND, JOINT_1, WHY, ARM, ELBOW, ROWS = 96, 114, 116, 125, 129, 132, 148, 158
TIP, AXIS, X0, Y0, LOAD, NORMAL = (POINT + 3 * k for k in range(6))


# Not to be renamed: what numba has stored of an earlier version asks for it by name.
class Figures(NamedTuple):
    """An arm and a tool: the figures of :class:`robots.inverse.spherical_wrist.SphericalWristArm`, and what follows.

    ``cos_zero``, ``sin_zero`` of ``elbow_zero``; ``ca``, ``sa``, ``cb``, ``sb`` of the wrist's alpha and beta;
    ``nearest``, ``farthest`` angle (rad) that axes 4 and 6 can take, ``sin2_least`` and ``cos2_most`` the squares of
    sine and cosine of half of them. Nearer to an axis than ``free_m``, ``free_rad`` a joint is free: it takes the
    angle ``near`` (6,), with ``cos_near`` and ``sin_near``. ``lever`` m: the way from wrist centre to tip, ``z6`` axis
    6, ``x6`` the x beside it, in tool axes. ``lower``, ``upper_limit`` (6,) rad; ``compliance`` (6,) rad/(N m).
    """

    R_21: Rotation
    t_21: Vector
    R_42: Rotation
    sin12: float
    cos12: float
    along_2: float
    upper: float
    fore: float
    elbow_zero: float
    elbow_zero_cs: Pair
    sign3: float
    front: float
    elbow_up: float
    margin_m: float
    free_m: float
    free_rad: float
    margin_rad: float
    nearest: float
    farthest: float
    ca: float
    sa: float
    cb: float
    sb: float
    sin2_least: float
    cos2_most: float
    wrist_zero: float
    outward: float
    lever: Vector
    z6: Vector
    x6: Vector
    cos_near: Six
    sin_near: Six
    near: Array
    lower: Array
    upper_limit: Array
    compliance: Six


@compiled
def _get(W: Array, row: int, i: int) -> Vector:
    return W[row * BLOCK + i], W[(row + 1) * BLOCK + i], W[(row + 2) * BLOCK + i]


@compiled
def _put(W: Array, row: int, i: int, v: Vector) -> None:
    W[row * BLOCK + i], W[(row + 1) * BLOCK + i], W[(row + 2) * BLOCK + i] = v


@compiled
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def _sum(v: Vector, x: Vector, y: Vector, z: Vector) -> Vector:
    """``v`` in the axes x, y, z."""
    return (
        v[0] * x[0] + v[1] * y[0] + v[2] * z[0],
        v[0] * x[1] + v[1] * y[1] + v[2] * z[1],
        v[0] * x[2] + v[1] * y[2] + v[2] * z[2],
    )


@compiled
def _into(R: Rotation, c: float, s: float, v: Vector) -> Vector:
    """``R`` times v turned back about z."""
    turned = (c * v[0] + s * v[1], c * v[1] - s * v[0], v[2])
    return _dot(R[0], turned), _dot(R[1], turned), _dot(R[2], turned)


@compiled
def _out_of(R: Rotation, c: float, s: float, v: Vector) -> Vector:
    """Undo :func:`_into`."""
    x, y, z = _sum(v, R[0], R[1], R[2])
    return c * x - s * y, s * x + c * y, z


@compiled
def _difference(a: Pair, b: Pair, sign: float) -> Pair:
    """Cosine and sine of the angle of a minus ``sign`` times that of b."""
    return a[0] * b[0] + sign * a[1] * b[1], a[1] * b[0] - sign * a[0] * b[1]


@compiled
def _twice(sin2: float, cos2: float, W: Array, row: int, i: int) -> Pair:
    """Cosine and sine of twice the angle that has these squares, in any one unit; its own pair goes to ``row``."""
    sin2, cos2 = max(sin2, 0.0), max(cos2, 0.0)
    y, x = math.sqrt(sin2), math.sqrt(cos2)
    W[(SINE + row) * BLOCK + i], W[(COSINE + row) * BLOCK + i] = y, x
    size = sin2 + cos2
    scale = 1.0 / size if size > 0.0 else 0.0
    return (cos2 - sin2) * scale, 2.0 * y * x * scale


@compiled
def _unit(x: float, y: float, size: float, W: Array, row: int, i: int) -> Pair:
    """Cosine and sine of the direction (x, y) of this size; the pair goes to ``row`` as it is."""
    W[(SINE + row) * BLOCK + i], W[(COSINE + row) * BLOCK + i] = y, x
    scale = 1.0 / size if size > 0.0 else 0.0
    return x * scale, y * scale


@compiled
def solve(f: Figures, points: Array, point: Integers, along: bool, W: Array) -> None:
    """Fill the rows of W (ROWS * BLOCK,) for targets at these points (BLOCK,); limits are not looked at.

    ``points`` (n, 18): tip m, tool axis, x and y across it at gamma = 0, load, surface normal, in axes of joint 1 about
    a point on it. Rows ``GAMMA`` hold cos and sin of gamma. Displacement: its size, or with ``along`` that along the
    normal.
    """
    for i in range(BLOCK):
        for k in range(18):
            W[(POINT + k) * BLOCK + i] = points[point[i], k]
    _shoulders(f, W)
    arm = W[ARM * BLOCK : ELBOW * BLOCK]
    for back in range(2):
        # Each number stands by itself, so that the compiler knows every row.
        if back == 0:
            _elbows(f, W, 0)
        else:
            _elbows(f, W, 1)
        for down in range(2):
            _wrists(f, along, arm, W[(ELBOW + 5 * down) * BLOCK :], W[6 * (2 * back + down) * BLOCK : POINT * BLOCK])


@compiled
def _shoulders(f: Figures, W: Array) -> None:
    """Joint 1, both ways."""
    for i in range(BLOCK):
        c, s = W[GAMMA * BLOCK + i], W[(GAMMA + 1) * BLOCK + i]
        x0, y0, z, tip = _get(W, X0, i), _get(W, Y0, i), _get(W, AXIS, i), _get(W, TIP, i)
        x = (c * x0[0] + s * y0[0], c * x0[1] + s * y0[1], c * x0[2] + s * y0[2])
        y = (s * x0[0] - c * y0[0], s * x0[1] - c * y0[1], s * x0[2] - c * y0[2])
        z = (-z[0], -z[1], -z[2])
        lever = _sum(f.lever, x, y, z)
        _put(W, HAND, i, lever)
        _put(W, HAND + 3, i, _sum(f.z6, x, y, z))
        _put(W, HAND + 6, i, _sum(f.x6, x, y, z))
        x1, y1, z1 = tip[0] - lever[0], tip[1] - lever[1], tip[2] - lever[2]
        radius = math.sqrt(x1 * x1 + y1 * y1)
        across = (f.along_2 - f.cos12 * z1) / f.sin12
        W[WHY * BLOCK + i] = SHOULDER if abs(across) - radius > f.margin_m else 0.0
        # Where joint 1 is free, it stands as it is preferred or half a turn from there: straight is a quarter turn on.
        free = radius < f.free_m and abs(across) < f.margin_m
        x1, y1 = -f.front * f.sin_near[0] if free else x1, f.front * f.cos_near[0] if free else y1
        radius, across = 1.0 if free else radius, 0.0 if free else across
        swing = _twice(radius - across, radius + across, W, SWING, i)
        straight = _unit(x1, y1, radius, W, STRAIGHT, i)
        W[JOINT_1 * BLOCK + i], W[(JOINT_1 + 1) * BLOCK + i] = _difference(straight, swing, f.front)
        W[(JOINT_1 + 2) * BLOCK + i], W[(JOINT_1 + 3) * BLOCK + i] = _difference(straight, swing, -f.front)


@compiled
def _elbows(f: Figures, W: Array, back: int) -> None:
    """Joints 2 and 3, both ways, and the share of joints 1 to 3 in the displacement; in axes of joint 2."""
    for i in range(BLOCK):
        c, s = W[(JOINT_1 + 2 * back) * BLOCK + i], W[(JOINT_1 + 2 * back + 1) * BLOCK + i]
        tip, lever = _into(f.R_21, c, s, _get(W, TIP, i)), _into(f.R_21, c, s, _get(W, HAND, i))
        z6, load = _into(f.R_21, c, s, _get(W, HAND + 3, i)), _into(f.R_21, c, s, _get(W, LOAD, i))
        m = _cross(lever, load)
        _put(W, ARM, i, lever)
        _put(W, ARM + 3, i, z6)
        _put(W, ARM + 6, i, _into(f.R_21, c, s, _get(W, HAND + 6, i)))
        _put(W, ARM + 9, i, m)
        _put(W, ARM + 12, i, _into(f.R_21, c, s, _get(W, NORMAL, i)))
        W[(ARM + 15) * BLOCK + i] = f.compliance[5] * _dot(z6, m)
        wx, wy = tip[0] - lever[0] - f.t_21[0], tip[1] - lever[1] - f.t_21[1]
        distance = math.sqrt(wx * wx + wy * wy)
        full, nearest = f.upper + f.fore, abs(f.upper - f.fore)
        why = TOO_FAR if distance - full > f.margin_m else (TOO_NEAR if nearest - distance > f.margin_m else 0.0)
        why_1 = W[WHY * BLOCK + i]
        W[(WHY + 1 + back) * BLOCK + i] = why_1 if why_1 == SHOULDER else why
        stretch, fold = (full - distance) * (full + distance), (distance - nearest) * (distance + nearest)
        bend = _twice(stretch, fold, W, BEND + 3 * back, i)
        ix, iy = f.upper + f.fore * bend[0], f.fore * bend[1]
        inside = math.sqrt(ix * ix + iy * iy)
        free = distance < f.free_m
        wx, wy = f.cos_near[1] if free else wx, f.sin_near[1] if free else wy
        distance, inside = 1.0 if free else distance, 1.0 if free else inside
        ix, iy = 1.0 if free else ix, 0.0 if free else iy
        towards = _unit(wx, wy, distance, W, TOWARDS + 3 * back, i)
        inner = _unit(ix, iy, inside, W, INNER + 3 * back, i)
        J1 = _cross((f.R_21[0][2], f.R_21[1][2], f.R_21[2][2]), tip)
        t1 = f.compliance[0] * _dot(J1, load)
        rx, ry = tip[0] - f.t_21[0], tip[1] - f.t_21[1]
        t2 = f.compliance[1] * (rx * load[1] - ry * load[0])
        by_2 = (t1 * J1[0] - t2 * ry, t1 * J1[1] + t2 * rx, t1 * J1[2])
        up = f.elbow_up * (1.0 - 2.0 * back)
        _one_elbow(f, W, ELBOW, i, up, towards, inner, bend, (rx, ry), load, by_2)
        _one_elbow(f, W, ELBOW + 5, i, -up, towards, inner, bend, (rx, ry), load, by_2)


@compiled
def _one_elbow(
    f: Figures,
    W: Array,
    row: int,
    i: int,
    bent: float,
    towards: Pair,
    inner: Pair,
    bend: Pair,
    r: Pair,
    load: Vector,
    by_2: Vector,
) -> None:
    c2, s2 = _difference(towards, inner, bent)
    ex, ey = r[0] - f.upper * c2, r[1] - f.upper * s2
    t3 = f.compliance[2] * (ex * load[1] - ey * load[0])
    W[row * BLOCK + i], W[(row + 1) * BLOCK + i] = _difference(_difference((c2, s2), bend, -bent), f.elbow_zero_cs, 1.0)
    _put(W, row + 2, i, (by_2[0] - t3 * ey, by_2[1] + t3 * ex, by_2[2]))


@separate
def _wrists(f: Figures, along: bool, arm: Array, elbow: Array, W: Array) -> None:
    """Joints 4 to 6, both ways, and the displacement; rows ``ARM``, those of this elbow, and those of its results.

    Apart from one another, so that the loop need not fear to overwrite what it reads.
    """
    R, ca, sa, cb, sb = f.R_42, f.ca, f.sa, f.cb, f.sb
    for i in range(BLOCK):
        c, s = elbow[i], elbow[BLOCK + i]
        lever, z6, m, normal = _get(arm, 0, i), _get(arm, 3, i), _get(arm, 9, i), _get(arm, 12, i)
        z, x = _into(R, c, s, z6), _into(R, c, s, _get(arm, 6, i))
        off2 = z[0] * z[0] + z[1] * z[1]
        off, size2 = math.sqrt(off2), off2 + z[2] * z[2]
        W[(SINE + BETWEEN) * BLOCK + i], W[(COSINE + BETWEEN) * BLOCK + i] = off, z[2]
        # Squares of sine and cosine of half the angle between axes 4 and 6, the small one without cancellation.
        large = 0.5 * (1.0 + abs(z[2]) / math.sqrt(size2))
        small = off2 / (size2 * 4.0 * large)
        sin2, cos2 = small if z[2] >= 0.0 else large, large if z[2] >= 0.0 else small
        cos5, sin5 = _twice(sin2 - f.sin2_least, cos2 - f.cos2_most, W, BEND_5, i)
        gx, gy = ca * sb * cos5 - sa * cb, sb * sin5
        size = math.sqrt(gx * gx + gy * gy)
        free = off < f.free_rad
        ax, ay = f.cos_near[3] if free else z[0], f.sin_near[3] if free else z[1]
        gx, gy = 1.0 if free else gx, 0.0 if free else gy
        asked = _unit(ax, ay, 1.0 if free else off, W, ASKED, i)
        given = _unit(gx, gy, 1.0 if free else size, W, GIVEN, i)
        z4 = (c * R[2][0] - s * R[2][1], s * R[2][0] + c * R[2][1], R[2][2])
        t4, t6 = f.compliance[3] * _dot(z4, m), arm[15 * BLOCK + i]
        turn = (t4 * z4[0] + t6 * z6[0], t4 * z4[1] + t6 * z6[1], t4 * z4[2] + t6 * z6[2])
        by_arm = _cross(turn, lever)
        moved = (
            elbow[2 * BLOCK + i] + by_arm[0],
            elbow[3 * BLOCK + i] + by_arm[1],
            elbow[4 * BLOCK + i] + by_arm[2],
        )
        for flip in range(2):
            sign = f.outward * (1.0 - 2.0 * flip)
            c4, s4 = _difference(asked, given, sign)
            x4, y4 = c4 * x[0] + s4 * x[1], c4 * x[1] - s4 * x[0]
            x5, last = ca * x4 + sa * x[2], ca * x[2] - sa * x4
            W[(SINE + LAST + flip) * BLOCK + i] = cos5 * y4 - sign * sin5 * x5
            W[(COSINE + LAST + flip) * BLOCK + i] = cb * (cos5 * x5 + sign * sin5 * y4) - sb * last
            # Axis 5 stands in the xz plane of B4, on the side of -x, turned by joint 4.
            z5 = _out_of(R, c, s, (-sa * c4, -sa * s4, ca))
            t5 = f.compliance[4] * _dot(z5, m)
            by_5 = _cross(z5, lever)
            d = (moved[0] + t5 * by_5[0], moved[1] + t5 * by_5[1], moved[2] + t5 * by_5[2])
            W[(MOVED + LAST + flip) * BLOCK + i] = abs(_dot(d, normal)) if along else math.sqrt(_dot(d, d))


@compiled
def finish(f: Figures, A: Array, W: Array, q: Array, reason: Codes, value: Array) -> None:
    """Angles A (32, BLOCK) put together to q (k, 8, 6) and turned into limits; reason (k, 8), value (k, 8) where valid.

    The turn is that of :func:`robots.inverse.turns.nearest_turn` for an arm without couplings.
    """
    near, lower, upper = f.near, f.lower, f.upper_limit
    skew = f.nearest > f.margin_rad or f.farthest < 0.5 * TURN - f.margin_rad
    for k in range(len(q)):
        for branch in range(8):
            back, down, flip = branch >> 2, (branch >> 1) & 1, branch & 1
            shoulder, elbow = 3 * back, 6 * (branch >> 1)
            why = int(W[(WHY + 1 + back) * BLOCK + k])
            if why == 0 and skew:
                between = A[BETWEEN + elbow, k]
                if f.nearest - between > f.margin_rad or between - f.farthest > f.margin_rad:
                    why = ORIENTATION
            value[k, branch] = np.nan
            reason[k, branch] = why
            if why != 0:
                for j in range(6):
                    q[k, branch, j] = np.nan
                continue
            side = f.front * (1.0 - 2.0 * back)
            bent = f.elbow_up * (1.0 - 2.0 * back) * (1.0 - 2.0 * down)
            sign = f.outward * (1.0 - 2.0 * flip)
            angles = (
                A[STRAIGHT, k] - side * 2.0 * A[SWING, k],
                A[TOWARDS + shoulder, k] - bent * A[INNER + shoulder, k],
                f.sign3 * (bent * 2.0 * A[BEND + shoulder, k] - f.elbow_zero),
                A[ASKED + elbow, k] - sign * A[GIVEN + elbow, k],
                sign * 2.0 * A[BEND_5 + elbow, k] - f.wrist_zero,
                A[LAST + elbow + flip, k],
            )
            inside = True
            for j in range(6):
                turned = _turned(angles[j], near[j], lower[j], upper[j])
                q[k, branch, j] = turned
                inside = inside and lower[j] <= turned <= upper[j]
            if inside:
                value[k, branch] = W[(MOVED + LAST + elbow + flip) * BLOCK + k]
            else:
                reason[k, branch] = LIMITS


@compiled
def _turned(angle: float, near: float, lower: float, upper: float) -> float:
    away, turned = angle - near, angle
    if abs(away) > 0.5 * TURN:
        turned -= TURN * float(np.rint(away / TURN))
    if turned < lower:
        back = turned + TURN * float(np.ceil((lower - turned) / TURN))
        return back if back <= upper else turned
    if turned > upper:
        back = turned - TURN * float(np.ceil((turned - upper) / TURN))
        return back if back >= lower else turned
    return turned
