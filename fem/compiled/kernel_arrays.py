"""The arrays that :mod:`fem.compiled.kernels` works on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robots.arrays import Array, Integers

# Poses a pass. Each figure of theirs has a row of the work array; that stays in the cache.
BLOCK = 200
# Rows of the work array: translations by forces, by moments (row by row), rotations by moments; the lever; row and half
# of the column of the parallelogram's share; the bar's column in the upper arm.
A, B, D, P, ROW, HALF, COLUMN, ROWS = 0, 6, 15, 21, 24, 30, 36, 42
# Columns of a joint's constants: cos and sin of alpha, shift, and K in the order of the rows.
TURN, SHIFT, K, CONSTANTS = 0, 2, 5, 26


# Not to be renamed: what numba has stored of an earlier version asks for it by name.
class Figures(NamedTuple):
    """A :class:`fem.compiled.flat_arm.FlatArm` in contiguous arrays.

    ``joint`` (dof, CONSTANTS), ``kind`` (dof,) of turn, ``soft`` (dof,) if K is not zero; ``base`` (CONSTANTS,), shift
    and turn unused, ``base_soft``; ``turn_base`` to ``t_tool`` as there; ``law_frame``, ``law_axis`` (laws, 3),
    ``law_turns``. ``driven``: joint, -1 without a parallelogram; ``loop`` (8,): the bar's direction in the axes of the
    driven joint at angle 0, pin, least lever, bar's compliance. Matrices (36,): ``at_pin``, what the bar's force at the
    pin does in the forearm's frame, ``pin``, what it does to itself (columns 3 to 5 are zero), K of the ``upper``
    arm's frame, the crank's ``housing``; ``shift_crank`` (3,): the crank's joint in the frame before it.
    """

    joint: Array
    kind: Integers
    soft: Integers
    base: Array
    base_soft: bool
    turn_base: Array
    sign: Array
    offset: Array
    R_tool: Array
    t_tool: Array
    law_frame: Integers
    law_axis: Array
    law_turns: Integers
    driven: int
    loop: Array
    at_pin: Array
    pin: Array
    upper: Array
    housing: Array
    housed: bool
    shift_crank: Array


class Work(NamedTuple):
    """What a thread works on; rows of BLOCK poses, and the state with its rows one after the other."""

    state: Array
    angle: Array
    flat: Array
    tool: Array
    cos: Array
    sin: Array
    springs: Array
    laws: Array


def work_of(dof: int, laws: int) -> Work:
    """Arrays for arms of so many joints, and laws across their axes."""
    rows = [np.zeros((n, BLOCK)) for n in (3, dof, dof, dof, laws)]
    return Work(np.zeros(ROWS * BLOCK), np.zeros(BLOCK), np.zeros(BLOCK), *rows)
