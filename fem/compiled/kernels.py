"""Compiled loops behind :mod:`fem.compiled.compliance`: the compliance of a flat arm, from the tool to the base.

The compliance at the tool point is carried along in axes that turn with the joint being passed: 21 numbers, and the
lever p from the joint to the tool. A body adds its constant K seen from the tool, ``X^T K X``; a joint adds one
rank-one term; a frame is left by two rotations in a plane. A quarter turn about x, as between most axes of most arms,
only changes places. Of the parallelogram only wrenches are carried along until it is closed:
``(column row^T)`` of all its parts adds up to ``half row^T + row half^T``. Loops have no branches and run over rows of
a block of poses, so that they become vector instructions.

All functions in one file: numba recompiles what it has stored when the file of a function changes, not when another
one does.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from fem.compiled.flat_arm import (
    BLOCK,
    COLUMN,
    HALF,
    QUARTER,
    ROW,
    ROWS,
    SHIFT,
    STRAIGHT,
    TURN,
    A,
    B,
    D,
    Figures,
    K,
    Loop,
    P,
    Work,
)
from robots.arrays import Array

# Tuples, because numba counts references of arrays.
Vector = tuple[float, float, float]
Symmetric = tuple[float, float, float, float, float, float]  # xx, xy, xz, yy, yz, zz
Full = tuple[float, float, float, float, float, float, float, float, float]  # by rows
Wrench = Symmetric  # six rows as well

# Products may be fused with sums (faster, and no less exact); nothing else is relaxed.
compiled = njit(cache=True, nogil=True, error_model="numpy", forceinline=True, fastmath={"contract"})
# Called several times; compiled once instead of at each call.
separate = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})

Z, NOWHERE, NOTHING = np.array([0.0, 0.0, 1.0]), np.zeros(3), (0.0,) * 6
# Row of the state of each entry of a symmetric matrix (36,), by rows.
_HALF = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
_BLOCK = B + np.arange(9).reshape(3, 3)
ENTRY = np.block([[A + _HALF, _BLOCK], [_BLOCK.T, D + _HALF]]).ravel()


@compiled
def _three(v: Array) -> Vector:
    return v[0], v[1], v[2]


@compiled
def _vector(W: Array, row: int, i: int) -> Vector:
    return W[row * BLOCK + i], W[(row + 1) * BLOCK + i], W[(row + 2) * BLOCK + i]


@compiled
def _put_vector(W: Array, row: int, i: int, v: Vector) -> None:
    W[row * BLOCK + i], W[(row + 1) * BLOCK + i], W[(row + 2) * BLOCK + i] = v


@compiled
def _symmetric(W: Array, row: int, i: int) -> Symmetric:
    return (
        W[row * BLOCK + i],
        W[(row + 1) * BLOCK + i],
        W[(row + 2) * BLOCK + i],
        W[(row + 3) * BLOCK + i],
        W[(row + 4) * BLOCK + i],
        W[(row + 5) * BLOCK + i],
    )


@compiled
def _put_symmetric(W: Array, row: int, i: int, m: Symmetric) -> None:
    for k in range(6):
        W[(row + k) * BLOCK + i] = m[k]


@compiled
def _full(W: Array, row: int, i: int) -> Full:
    return (
        W[row * BLOCK + i],
        W[(row + 1) * BLOCK + i],
        W[(row + 2) * BLOCK + i],
        W[(row + 3) * BLOCK + i],
        W[(row + 4) * BLOCK + i],
        W[(row + 5) * BLOCK + i],
        W[(row + 6) * BLOCK + i],
        W[(row + 7) * BLOCK + i],
        W[(row + 8) * BLOCK + i],
    )


@compiled
def _put_full(W: Array, row: int, i: int, m: Full) -> None:
    for k in range(9):
        W[(row + k) * BLOCK + i] = m[k]


@compiled
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def _vector_z(v: Vector, c: float, s: float) -> Vector:
    return c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]


@compiled
def _vector_x(v: Vector, c: float, s: float) -> Vector:
    return v[0], c * v[1] - s * v[2], s * v[1] + c * v[2]


@compiled
def _symmetric_z(m: Symmetric, c: float, s: float) -> Symmetric:
    xx, xy, xz, yy, yz, zz = m
    a, b = c * xx - s * xy, c * xy - s * yy
    d, e = s * xx + c * xy, s * xy + c * yy
    return c * a - s * b, s * a + c * b, c * xz - s * yz, s * d + c * e, s * xz + c * yz, zz


@compiled
def _symmetric_x(m: Symmetric, c: float, s: float) -> Symmetric:
    xx, xy, xz, yy, yz, zz = m
    a, b = c * yy - s * yz, c * yz - s * zz
    d, e = s * yy + c * yz, s * yz + c * zz
    return xx, c * xy - s * xz, s * xy + c * xz, c * a - s * b, s * a + c * b, s * d + c * e


@compiled
def _full_z(m: Full, c: float, s: float) -> Full:
    xx, xy, xz, yx, yy, yz, zx, zy, zz = m
    a, b, d, e = c * xx - s * yx, c * xy - s * yy, s * xx + c * yx, s * xy + c * yy
    return (
        c * a - s * b,
        s * a + c * b,
        c * xz - s * yz,
        c * d - s * e,
        s * d + c * e,
        s * xz + c * yz,
        c * zx - s * zy,
        s * zx + c * zy,
        zz,
    )


@compiled
def _full_x(m: Full, c: float, s: float) -> Full:
    xx, xy, xz, yx, yy, yz, zx, zy, zz = m
    a, b, d, e = c * yy - s * zy, c * yz - s * zz, s * yy + c * zy, s * yz + c * zz
    return (
        xx,
        c * xy - s * xz,
        s * xy + c * xz,
        c * yx - s * zx,
        c * a - s * b,
        s * a + c * b,
        s * yx + c * zx,
        c * d - s * e,
        s * d + c * e,
    )


@compiled
def _quarter_symmetric(m: Symmetric, s: float) -> Symmetric:
    """A quarter turn about x: y becomes s z, z becomes -s y."""
    return m[0], -s * m[2], s * m[1], m[5], -m[4], m[3]


@compiled
def _quarter_full(m: Full, s: float) -> Full:
    return m[0], -s * m[2], s * m[1], -s * m[6], m[8], -m[7], s * m[3], -m[5], m[4]


@compiled
def _seen(
    p: Vector, a: Symmetric, b: Full, d: Symmetric, k: Symmetric, kb: Full, kd: Symmetric
) -> tuple[Symmetric, Full, Symmetric]:
    """a, b, d with K added, its point p away from the tool: with S v = v x p, b + K_b + S K_d, and so on."""
    x, y, z = p
    # S K_d, then K_b with it.
    n0 = kb[0] + z * kd[1] - y * kd[2]
    n1 = kb[1] + z * kd[3] - y * kd[4]
    n2 = kb[2] + z * kd[4] - y * kd[5]
    n3 = kb[3] + x * kd[2] - z * kd[0]
    n4 = kb[4] + x * kd[4] - z * kd[1]
    n5 = kb[5] + x * kd[5] - z * kd[2]
    n6 = kb[6] + y * kd[0] - x * kd[1]
    n7 = kb[7] + y * kd[1] - x * kd[3]
    n8 = kb[8] + y * kd[2] - x * kd[4]
    sums = (
        a[0] + k[0] + (z * kb[1] - y * kb[2]) + (z * n1 - y * n2),
        a[1] + k[1] + (z * kb[4] - y * kb[5]) + (x * n2 - z * n0),
        a[2] + k[2] + (z * kb[7] - y * kb[8]) + (y * n0 - x * n1),
        a[3] + k[3] + (x * kb[5] - z * kb[3]) + (x * n5 - z * n3),
        a[4] + k[4] + (x * kb[8] - z * kb[6]) + (y * n3 - x * n4),
        a[5] + k[5] + (y * kb[6] - x * kb[7]) + (y * n6 - x * n7),
    )
    full = (b[0] + n0, b[1] + n1, b[2] + n2, b[3] + n3, b[4] + n4, b[5] + n5, b[6] + n6, b[7] + n7, b[8] + n8)
    return sums, full, (d[0] + kd[0], d[1] + kd[1], d[2] + kd[2], d[3] + kd[3], d[4] + kd[4], d[5] + kd[5])


@compiled
def _sprung(p: Vector, flexible: float, a: Symmetric, b: Full, d: Symmetric) -> tuple[Symmetric, Full, Symmetric]:
    """a, b, d with a spring about z."""
    x, y = flexible * p[0], flexible * p[1]
    return (
        (a[0] + y * p[1], a[1] - x * p[1], a[2], a[3] + x * p[0], a[4], a[5]),
        (b[0], b[1], b[2] - y, b[3], b[4], b[5] + x, b[6], b[7], b[8]),
        (d[0], d[1], d[2], d[3], d[4], d[5] + flexible),
    )


@compiled
def _constant(f: Array) -> tuple[Symmetric, Full, Symmetric]:
    """K of a row of constants."""
    return (
        (f[K], f[K + 1], f[K + 2], f[K + 3], f[K + 4], f[K + 5]),
        (f[K + 6], f[K + 7], f[K + 8], f[K + 9], f[K + 10], f[K + 11], f[K + 12], f[K + 13], f[K + 14]),
        (f[K + 15], f[K + 16], f[K + 17], f[K + 18], f[K + 19], f[K + 20]),
    )


@compiled
def _get(W: Array, i: int) -> tuple[Vector, Symmetric, Full, Symmetric]:
    return _vector(W, P, i), _symmetric(W, A, i), _full(W, B, i), _symmetric(W, D, i)


@compiled
def _put(W: Array, i: int, a: Symmetric, b: Full, d: Symmetric) -> None:
    _put_symmetric(W, A, i, a)
    _put_full(W, B, i, b)
    _put_symmetric(W, D, i, d)


@separate
def _add(f: Array, W: Array) -> None:
    """A body's constant compliance."""
    k, kb, kd = _constant(f)
    for i in range(BLOCK):
        p, a, b, d = _get(W, i)
        a, b, d = _seen(p, a, b, d, k, kb, kd)
        _put(W, i, a, b, d)


@separate
def _quarter(f: Array, cos: Array, sin: Array, axial: Array, W: Array) -> None:
    """The joint's spring, its angle, a quarter turn about x, the shift."""
    sx, tx, ty, tz = f[TURN + 1], f[SHIFT], f[SHIFT + 1], f[SHIFT + 2]
    for i in range(BLOCK):
        c, s = cos[i], sin[i]
        p, a, b, d = _get(W, i)
        a, b, d = _sprung(p, axial[i], a, b, d)
        x, y, z = _vector_z(p, c, s)
        _put_vector(W, P, i, (x + tx, ty - sx * z, tz + sx * y))
        a, b, d = _symmetric_z(a, c, s), _full_z(b, c, s), _symmetric_z(d, c, s)
        _put(W, i, _quarter_symmetric(a, sx), _quarter_full(b, sx), _quarter_symmetric(d, sx))


@separate
def _straight(f: Array, cos: Array, sin: Array, axial: Array, W: Array) -> None:
    """The same where the next axis is parallel."""
    tx, ty, tz = f[SHIFT], f[SHIFT + 1], f[SHIFT + 2]
    for i in range(BLOCK):
        c, s = cos[i], sin[i]
        p, a, b, d = _get(W, i)
        a, b, d = _sprung(p, axial[i], a, b, d)
        x, y, z = _vector_z(p, c, s)
        _put_vector(W, P, i, (x + tx, y + ty, z + tz))
        _put(W, i, _symmetric_z(a, c, s), _full_z(b, c, s), _symmetric_z(d, c, s))


@separate
def _turned(f: Array, cos: Array, sin: Array, axial: Array, W: Array) -> None:
    """The same by any angle about x."""
    cx, sx, tx, ty, tz = f[TURN], f[TURN + 1], f[SHIFT], f[SHIFT + 1], f[SHIFT + 2]
    for i in range(BLOCK):
        c, s = cos[i], sin[i]
        p, a, b, d = _get(W, i)
        a, b, d = _sprung(p, axial[i], a, b, d)
        x, y, z = _vector_x(_vector_z(p, c, s), cx, sx)
        _put_vector(W, P, i, (x + tx, y + ty, z + tz))
        a, b, d = _symmetric_z(a, c, s), _full_z(b, c, s), _symmetric_z(d, c, s)
        _put(W, i, _symmetric_x(a, cx, sx), _full_x(b, cx, sx), _symmetric_x(d, cx, sx))


@separate
def _turn_base(turn: Array, W: Array) -> None:
    c, s = turn[0], turn[1]
    for i in range(BLOCK):
        p, a, b, d = _get(W, i)
        _put_vector(W, P, i, _vector_z(p, c, s))
        _put(W, i, _symmetric_z(a, c, s), _full_z(b, c, s), _symmetric_z(d, c, s))


@compiled
def _plus_both_ways(W: Array, i: int, h: Wrench, r: Wrench) -> None:
    """C + h r^T + r h^T."""
    for k in range(3):
        for m in range(3):
            W[(B + 3 * k + m) * BLOCK + i] += h[k] * r[3 + m] + r[k] * h[3 + m]
    at = 0
    for k in range(3):
        for m in range(k, 3):
            W[(A + at) * BLOCK + i] += h[k] * r[m] + r[k] * h[m]
            W[(D + at) * BLOCK + i] += h[3 + k] * r[3 + m] + r[3 + k] * h[3 + m]
            at += 1


@compiled
def _displaced(p: Vector, h: Wrench) -> Wrench:
    """The tool's displacement by a deformation h at the frame's origin, p away from the tool."""
    x, y, z = _cross((h[3], h[4], h[5]), p)
    return h[0] + x, h[1] + y, h[2] + z, h[3], h[4], h[5]


@compiled
def _times(M: Array, v: Wrench) -> Wrench:
    """M (36,) times v."""
    return (
        M[0] * v[0] + M[1] * v[1] + M[2] * v[2] + M[3] * v[3] + M[4] * v[4] + M[5] * v[5],
        M[6] * v[0] + M[7] * v[1] + M[8] * v[2] + M[9] * v[3] + M[10] * v[4] + M[11] * v[5],
        M[12] * v[0] + M[13] * v[1] + M[14] * v[2] + M[15] * v[3] + M[16] * v[4] + M[17] * v[5],
        M[18] * v[0] + M[19] * v[1] + M[20] * v[2] + M[21] * v[3] + M[22] * v[4] + M[23] * v[5],
        M[24] * v[0] + M[25] * v[1] + M[26] * v[2] + M[27] * v[3] + M[28] * v[4] + M[29] * v[5],
        M[30] * v[0] + M[31] * v[1] + M[32] * v[2] + M[33] * v[3] + M[34] * v[4] + M[35] * v[5],
    )


@compiled
def _dot(v: Wrench, w: Wrench) -> float:
    return v[0] * w[0] + v[1] * w[1] + v[2] * w[2] + v[3] * w[3] + v[4] * w[4] + v[5] * w[5]


@compiled
def _plus(h: Wrench, factor: float, v: Wrench) -> Wrench:
    return (
        h[0] + factor * v[0],
        h[1] + factor * v[1],
        h[2] + factor * v[2],
        h[3] + factor * v[3],
        h[4] + factor * v[4],
        h[5] + factor * v[5],
    )


@compiled
def _direction(axis: Array, turns: bool, p: Vector) -> tuple[Wrench, Wrench]:
    """Of a law: what it feels of the wrench at the frame's origin, and of the one at the tool."""
    e = _three(axis)
    if turns:
        x, y, z = _cross(e, p)
        return (0.0, 0.0, 0.0, e[0], e[1], e[2]), (x, y, z, e[0], e[1], e[2])
    own = (e[0], e[1], e[2], 0.0, 0.0, 0.0)
    return own, own


@separate
def _law(axis: Array, turns: bool, flexible: Array, W: Array) -> None:
    for i in range(BLOCK):
        _, felt = _direction(axis, turns, _vector(W, P, i))
        _plus_both_ways(W, i, _plus(NOTHING, 0.5 * flexible[i], felt), felt)


@separate
def _driven(loop: Loop, cos: Array, sin: Array, W: Array, flat: Array) -> None:
    """At the driven joint: row, half and column; ``flat``: how far the lever is above the least, m."""
    (ux, uy, uz), (rx, ry, rz) = _three(loop.u), _three(loop.pin)
    for i in range(BLOCK):
        c, s = cos[i], sin[i]
        p = _vector(W, P, i)
        u = (c * ux + s * uy, c * uy - s * ux, uz, 0.0, 0.0, 0.0)
        lever = rx * u[1] - ry * u[0]
        flat[i] = abs(lever) - loop.least
        row = (p[1] / lever, -p[0] / lever, 0.0, 0.0, 0.0, -1.0 / lever)
        both = loop.bar + _dot(u, _times(loop.own, u))
        _put_symmetric(W, ROW, i, row)
        _put_symmetric(W, HALF, i, _plus(_displaced(p, _times(loop.at_pin, u)), 0.5 * both, row))
        x, y, z = _cross((rx, ry, rz), (u[0], u[1], u[2]))
        _put_symmetric(W, COLUMN, i, (u[0], u[1], u[2], x, y, z))


@separate
def _carried(axis: Array, turns: bool, flexible: Array, W: Array) -> None:
    """The bar's share in a law, or in the spring about the axis of the crank."""
    for i in range(BLOCK):
        own, felt = _direction(axis, turns, _vector(W, P, i))
        share = _dot(own, _symmetric(W, COLUMN, i))
        both = _plus(felt, 0.5 * share, _symmetric(W, ROW, i))
        _put_symmetric(W, HALF, i, _plus(_symmetric(W, HALF, i), flexible[i] * share, both))


@separate
def _carried_constant(M: Array, t: Array, W: Array) -> None:
    """The bar's share in a constant compliance M (36,) about t from the frame's origin."""
    tx, ty, tz = _three(t)
    for i in range(BLOCK):
        x, y, z = _vector(W, P, i)
        column = _symmetric(W, COLUMN, i)
        s = _times(M, column)
        h = _plus(_symmetric(W, HALF, i), 0.5 * _dot(column, s), _symmetric(W, ROW, i))
        _put_symmetric(W, HALF, i, _plus(h, 1.0, _displaced((x - tx, y - ty, z - tz), s)))


@separate
def _leave(f: Array, cos: Array, sin: Array, W: Array) -> None:
    """Row, half and column in the axes of the frame before."""
    cx, sx = f[TURN], f[TURN + 1]
    for row in range(ROW, ROWS, 3):
        for i in range(BLOCK):
            _put_vector(W, row, i, _vector_x(_vector_z(_vector(W, row, i), cos[i], sin[i]), cx, sx))


@separate
def _close(W: Array) -> None:
    """The bar's share in the compliance."""
    for i in range(BLOCK):
        _plus_both_ways(W, i, _symmetric(W, HALF, i), _symmetric(W, ROW, i))


@separate
def _loop_part(f: Figures, j: int, cos: Array, sin: Array, work: Work) -> None:
    """What the bar's force adds in the frame of a driven joint or of a crank's, before it is left."""
    if j == f.loop.driven:
        _driven(f.loop, cos, sin, work.state, work.flat)
    else:
        _carried_constant(f.loop.upper, NOWHERE, work.state)
        _carried(Z, True, work.springs[j], work.state)
    for k in range(len(f.law_frame)):
        if f.law_frame[k] == j:
            _carried(f.law_axis[k], f.law_turns[k] == 1, work.laws[k], work.state)


@separate
def _solve(f: Figures, work: Work) -> None:
    """Fill the rows A, B, D of the state for BLOCK poses whose directions, springs and tool points are there.

    ``flat`` is negative then where the parallelogram is flat.
    """
    W = work.state
    for i in range(P * BLOCK):
        W[i] = 0.0
    for k in range(3):
        for i in range(BLOCK):
            W[(P + k) * BLOCK + i] = work.tool[k, i]
    for j in range(len(f.joint) - 1, -1, -1):
        constants, c, s = f.joint[j], work.cos[j], work.sin[j]
        if f.soft[j] == 1:
            _add(constants, W)
        for k in range(len(f.law_frame)):
            if f.law_frame[k] == j:
                _law(f.law_axis[k], f.law_turns[k] == 1, work.laws[k], W)
        in_loop = f.loop.driven >= 0 and (j == f.loop.driven or j == f.loop.driven - 1)
        if in_loop:
            _loop_part(f, j, c, s, work)
            if j == f.loop.driven or f.loop.housed:
                _leave(constants, c, s, W)
            else:
                _close(W)
        if f.kind[j] == QUARTER:
            _quarter(constants, c, s, work.springs[j], W)
        elif f.kind[j] == STRAIGHT:
            _straight(constants, c, s, work.springs[j], W)
        else:
            _turned(constants, c, s, work.springs[j], W)
        if in_loop and j != f.loop.driven and f.loop.housed:
            _carried_constant(f.loop.housing, f.loop.shift, W)
            _close(W)
    if f.turn_base[1] != 0.0:
        _turn_base(f.turn_base, W)
    if f.base_soft:
        _add(f.base, W)


@separate
def _write(W: Array, wrench: Array, out: Array, start: int, end: int) -> None:
    """Rows ``start`` to ``end`` of the deflections (k, 6) under wrenches (1 or k, 6), or of the compliances (k, 36)."""
    for i in range(end - start):
        o = out[start + i]
        if len(wrench) == 0:
            for k in range(36):
                o[k] = W[ENTRY[k] * BLOCK + i]
        else:
            w = wrench[min(start + i, len(wrench) - 1)]
            for k in range(6):
                moved = 0.0
                for m in range(6):
                    moved += W[ENTRY[6 * k + m] * BLOCK + i] * w[m]
                o[k] = moved


@separate
def _sines(angle: Array, cos: Array, sin: Array) -> None:
    """Sine and cosine together, to a unit or so in the last digit, for angles up to 1e6 rad.

    Reduced by quarter turns in three steps (Cody and Waite), then the polynomials of fdlibm (k_sin.c, k_cos.c).
    """
    for i in range(BLOCK):
        x = angle[i]
        n = np.rint(x * 0.6366197723675814)
        r = ((x - n * 1.57079632673412561417) - n * 6.07710050630396597660e-11) - n * 2.02226624879595063154e-21
        z = r * r
        s = 2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
        s = r + r * z * (
            -1.66666666666666324348e-01 + z * (8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * s))
        )
        c = -2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 - z * 1.13596475577881948265e-11)
        c = z * (
            4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 + z * c))
        )
        c = (1.0 - 0.5 * z) + z * c
        quarter = n - 4.0 * np.floor(0.25 * n)
        odd = quarter == 1.0 or quarter == 3.0
        a, b = c if odd else s, s if odd else c
        sin[i] = -a if quarter >= 2.0 else a
        cos[i] = -b if quarter == 1.0 or quarter == 2.0 else b


@separate
def _tools(f: Figures, points: Array, start: int, tool: Array) -> None:
    R, t = f.R_tool, f.t_tool
    for i in range(BLOCK):
        k = min(start + i, len(points) - 1)
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        for m in range(3):
            tool[m, i] = t[m] + (R[m, 0] * x + R[m, 1] * y + R[m, 2] * z)


@separate
def _load(f: Figures, q: Array, axial: Array, laws: Array, points: Array, start: int, work: Work) -> None:
    """Put the poses from ``start`` on into the work arrays; behind the last one stands the last one again."""
    last = len(q) - 1
    for j in range(len(f.joint)):
        for i in range(BLOCK):
            work.angle[i] = f.sign[j] * q[min(start + i, last), j] + f.offset[j]
        _sines(work.angle, work.cos[j], work.sin[j])
        if start == 0 or len(axial) > 1:
            for i in range(BLOCK):
                work.springs[j, i] = axial[min(start + i, len(axial) - 1), j]
    if start == 0 or len(points) > 1:
        _tools(f, points, start, work.tool)
    for m in range(len(laws)):
        for i in range(BLOCK):
            work.laws[m, i] = laws[m, min(start + i, last)]


@separate
def deflections(
    f: Figures, q: Array, axial: Array, laws: Array, points: Array, wrench: Array, work: Work, out: Array
) -> int:
    """Deflections (k, 6) under wrenches (1 or k, 6), or compliances (k, 36) without any (0, 6).

    Poses q (k, dof); ``axial`` (1 or k, dof), ``laws`` (laws, k), ``points`` (1 or k, 3) in the flange frame. A block
    that is not full is filled up with the last pose: no pose's digits depend on where it stands. Returns the first pose
    whose parallelogram is flat, or -1.
    """
    for start in range(0, len(q), BLOCK):
        _load(f, q, axial, laws, points, start, work)
        _solve(f, work)
        end = min(start + BLOCK, len(q))
        if f.loop.driven >= 0:
            for i in range(end - start):
                if work.flat[i] < 0.0:
                    return start + i
        _write(work.state, wrench, out, start, end)
    return -1
