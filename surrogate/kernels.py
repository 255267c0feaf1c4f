"""Compiled loops behind :mod:`surrogate.fast`: a sum of products of one-dimensional functions, many poses at a time.

The terms are the leaves of a tree: terms that share their first factors share a branch, so each of these factors is
multiplied in once, as in Horner's rule. A block of poses goes through the tree at once. All functions of a block stay
near the processor's first cache, and the inner loops over its poses become vector instructions.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from robots.arrays import Array, Integers

# Poses a pass. Loops run over whole blocks, so no pose's digits depend on where it stands. 28 functions take 57 kB.
BLOCK = 256
# Terms that `products` adds at once, and outputs that it adds them to: fastest of those tried.
LEAVES, OUTPUTS = 8, 2
# Larger angles (rad) give NaN: whole turns are taken off exactly up to here.
LARGEST = 1e5

# Sums may be taken in another order and fused with products; NaN and infinity keep their meaning.
compiled = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc"})
inlined = njit(cache=True, nogil=True, error_model="numpy", forceinline=True, fastmath={"contract", "reassoc"})
# Here the order of sums is what makes them right.
ordered = njit(cache=True, nogil=True, error_model="numpy", forceinline=True, fastmath={"contract"})

TURN = 2.0 * math.pi
# The leading 33 bits of a turn, whose multiples are exact, and the rest: 2 pi - TURN_HIGH to 50 digits, rounded.
TURN_HIGH = float.fromhex("0x1.921fb5440p+2")
TURN_LOW = float.fromhex("0x1.0b4611a626331p-32")
# Adding and taking off 1.5 x 2^52 rounds to the nearest whole number, ties to even, in vector instructions.
ROUNDING = 1.5 * 2.0**52
# Taylor series of sin(h) / h and cos(h) in h^2, highest power first; at |h| = pi/2 the first term left out is 1e-18.
SINE = tuple((-1.0) ** j / math.factorial(2 * j + 1) for j in range(10, -1, -1))
COSINE = tuple((-1.0) ** j / math.factorial(2 * j) for j in range(11, -1, -1))


# Not to be renamed: what numba has stored of an earlier version asks for it by name.
class Plan(NamedTuple):
    """An expansion for these loops: inputs reordered, and only functions and terms that count.

    Attributes
    ----------
    inputs : (k,) which column of angles stands where; the last has the most functions a product of the others
    figures : (k, 5) periodic, harmonics, highest degree, first row of its functions and the row after its last
    centre, half_range : (k,) rad
    first_entry, column, entry : function r is the sum over e in first_entry[r] to first_entry[r + 1] of entry[e]
        times raw function column[e]
    first_leaf, leaf_row : (r + 1,), (t,) terms that differ in their last factor only are a run; the row of that factor
    branch_row : (r, k - 1) rows of a run's other factors
    common : (r,) how many of these the next run shares, from the first on
    weights : (m, t) for `sums`; for `products` (t, m), filled up with zeros to multiples of LEAVES and OUTPUTS
    """

    inputs: Integers
    figures: Integers
    centre: Array
    half_range: Array
    first_entry: Integers
    column: Integers
    entry: Array
    first_leaf: Integers
    leaf_row: Integers
    branch_row: Integers
    common: Integers
    weights: Array


@ordered
def _nearest(x: float) -> float:
    return (x + ROUNDING) - ROUNDING


@ordered
def _cosine_and_sine(x: float) -> tuple[float, float]:
    """By series for half the angle, to 4e-16."""
    turns = _nearest(x * (1.0 / TURN))
    h = 0.5 * ((x - turns * TURN_HIGH) - turns * TURN_LOW)
    hh = h * h
    s, c = SINE[0], COSINE[0]
    for a in SINE[1:]:
        s = s * hh + a
    for a in COSINE[1:]:
        c = c * hh + a
    s *= h
    return 1.0 - 2.0 * s * s, 2.0 * s * c


@inlined
def _sum(first: int, last: int, row: Integers, weight: Array, F: Array, out: Array) -> None:
    """``out = sum weight[e] F[row[e]]`` over e from first to last; four at a time spare loads and stores of the sum."""
    e = first + (last - first) % 4
    if e == first:
        for b in range(BLOCK):
            out[b] = 0.0
    else:
        w, r = weight[first], row[first]
        for b in range(BLOCK):
            out[b] = w * F[r, b]
        for e1 in range(first + 1, e):
            w, r = weight[e1], row[e1]
            for b in range(BLOCK):
                out[b] += w * F[r, b]
    for e4 in range(e, last, 4):
        w0, w1, w2, w3 = weight[e4], weight[e4 + 1], weight[e4 + 2], weight[e4 + 3]
        r0, r1, r2, r3 = row[e4], row[e4 + 1], row[e4 + 2], row[e4 + 3]
        for b in range(BLOCK):
            out[b] += (w0 * F[r0, b] + w1 * F[r1, b]) + (w2 * F[r2, b] + w3 * F[r3, b])


@inlined
def _functions(Q: Array, start: int, p: Plan, G: Array, F: Array, bad: Array) -> None:
    """Fill F with all functions of the poses from ``start``, ``bad`` with 0 or NaN; G is room for the raw ones."""
    last_pose = len(Q) - 1
    full = start + BLOCK <= len(Q)
    for b in range(BLOCK):
        bad[b] = 0.0
        G[0, b] = 1.0
    for i in range(len(p.inputs)):
        periodic, harmonics, highest, first_row, end_row = p.figures[i]
        column, centre, legendre = p.inputs[i], p.centre[i], 1 + 2 * harmonics
        x = G[legendre]
        if full:
            for b in range(BLOCK):
                x[b] = Q[start + b, column] - centre
        else:  # a block that is not full is filled up with the last pose
            for b in range(BLOCK):
                x[b] = Q[min(start + b, last_pose), column] - centre
        for b in range(BLOCK):
            bad[b] += 0.0 if abs(x[b]) <= LARGEST else np.nan
        if periodic:
            for b in range(BLOCK):
                x[b] -= TURN * _nearest(x[b] / TURN)
        if harmonics:
            for b in range(BLOCK):
                G[1, b], G[2, b] = _cosine_and_sine(x[b])
        for j in range(2, harmonics + 1):
            c, s = 2 * j - 1, 2 * j
            for b in range(BLOCK):
                c1, s1, cj, sj = G[1, b], G[2, b], G[c - 2, b], G[s - 2, b]
                G[c, b] = cj * c1 - sj * s1
                G[s, b] = sj * c1 + cj * s1
        scale = 1.0 / p.half_range[i]
        for b in range(BLOCK):
            x[b] *= scale
        for d in range(2, highest + 1):
            up, down = (2.0 * d - 1.0) / d, (d - 1.0) / d
            now = legendre + d - 1
            older = now - 2 if d > 2 else 0
            for b in range(BLOCK):
                G[now, b] = up * x[b] * G[now - 1, b] - down * G[older, b]
        for r in range(first_row, end_row):
            _sum(p.first_entry[r], p.first_entry[r + 1], p.column, p.entry, G, F[r])


@compiled
def sums(Q: Array, p: Plan, work: Array, out: Array) -> None:
    """Q (n, k) rad -> out (n, m) for few outputs: through the tree once for each, branches summed up as they end.

    NaN where an angle is not finite or beyond LARGEST. ``work`` is room for rows of BLOCK numbers: all functions, and
    the raw ones of one input.
    """
    k = len(p.inputs)
    rows = len(p.first_entry) - 1
    F, G = work[:rows], work[rows:]
    # Sums over the branches below a branching point, by its depth; below the last stand the leaves.
    A = np.zeros((k, BLOCK))
    bad = np.zeros(BLOCK)
    for start in range(0, len(Q), BLOCK):
        _functions(Q, start, p, G, F, bad)
        for o in range(out.shape[1]):
            A[: k - 1] = 0.0
            for run in range(len(p.common)):
                _sum(p.first_leaf[run], p.first_leaf[run + 1], p.leaf_row, p.weights[o], F, A[k - 1])
                for d in range(k - 2, p.common[run] - 1, -1):
                    row = p.branch_row[run, d]
                    for b in range(BLOCK):
                        A[d, b] += F[row, b] * A[d + 1, b]
                    if d < k - 2:
                        for b in range(BLOCK):
                            A[d + 1, b] = 0.0
            for b in range(min(BLOCK, len(Q) - start)):
                out[start + b, o] = A[0, b] + bad[b]


@compiled
def products(Q: Array, p: Plan, work: Array, out: Array, squares: bool) -> None:
    """As :func:`sums`, for many outputs: each product is formed once; eight at a time go to two outputs at a time.

    ``squares``: out (n, 1) is the sum of the outputs' squares; the weights are lower triangular then.
    """
    k, padded = len(p.inputs), p.weights.shape[1]
    rows, last_leaf = len(p.first_entry) - 1, len(p.leaf_row) - 1
    F, G = work[:rows], work[rows:]
    # Products of a run's factors, by their number; a few leaves; sums.
    P, L, Y = np.ones((k, BLOCK)), np.zeros((LEAVES, BLOCK)), np.zeros((padded, BLOCK))
    bad = np.zeros(BLOCK)
    for start in range(0, len(Q), BLOCK):
        _functions(Q, start, p, G, F, bad)
        Y[:] = 0.0
        depth = 0
        for run in range(len(p.common)):
            for d in range(depth, k - 1):
                row = p.branch_row[run, d]
                for b in range(BLOCK):
                    P[d + 1, b] = P[d, b] * F[row, b]
            depth = p.common[run]
            for leaf in range(p.first_leaf[run], p.first_leaf[run + 1]):
                row, room = p.leaf_row[leaf], leaf % LEAVES
                for b in range(BLOCK):
                    L[room, b] = P[k - 1, b] * F[row, b]
                if room == LEAVES - 1 or leaf == last_leaf:
                    # Row t of a triangle has nothing beyond output t.
                    _add_eight(p.weights, leaf - room, L, Y[: leaf - room + LEAVES] if squares else Y)
        if squares:
            _add_squares(Y, bad, out[start : start + BLOCK, 0])
        else:
            for b in range(min(BLOCK, len(Q) - start)):
                for o in range(out.shape[1]):
                    out[start + b, o] = Y[o, b] + bad[b]


@inlined
def _add_squares(Y: Array, bad: Array, out: Array) -> None:
    for o in range(len(Y)):
        for b in range(BLOCK):
            bad[b] += Y[o, b] * Y[o, b]
    for b in range(len(out)):
        out[b] = bad[b]


@inlined
def _add_eight(w: Array, t: int, L: Array, Y: Array) -> None:
    """``Y[o] += sum w[t + j, o] L[j]`` over j up to LEAVES, for all o; written out, so that sums stay in registers."""
    for o in range(0, len(Y), OUTPUTS):
        a0, a1, a2, a3 = w[t, o], w[t + 1, o], w[t + 2, o], w[t + 3, o]
        a4, a5, a6, a7 = w[t + 4, o], w[t + 5, o], w[t + 6, o], w[t + 7, o]
        b0, b1, b2, b3 = w[t, o + 1], w[t + 1, o + 1], w[t + 2, o + 1], w[t + 3, o + 1]
        b4, b5, b6, b7 = w[t + 4, o + 1], w[t + 5, o + 1], w[t + 6, o + 1], w[t + 7, o + 1]
        for b in range(BLOCK):
            l0, l1, l2, l3, l4, l5, l6, l7 = L[0, b], L[1, b], L[2, b], L[3, b], L[4, b], L[5, b], L[6, b], L[7, b]
            Y[o, b] += ((a0 * l0 + a1 * l1) + (a2 * l2 + a3 * l3)) + ((a4 * l4 + a5 * l5) + (a6 * l6 + a7 * l7))
            Y[o + 1, b] += ((b0 * l0 + b1 * l1) + (b2 * l2 + b3 * l3)) + ((b4 * l4 + b5 * l5) + (b6 * l6 + b7 * l7))
