"""Surrogates at many poses by compiled loops; needs numba. Without it everything goes by numpy, with the same results.

A pose's value is that of :class:`surrogate.expansion.Expansion` to rounding: 1e-13 of the sum of its terms' sizes.
"""

from __future__ import annotations

from functools import partial
from types import ModuleType
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from robots.arrays import Array, Integers, in_blocks
from robots.errors import InputError, require_at_least
from robots.threads import compiled_loops, in_shares
from surrogate.expansion import Expansion

if TYPE_CHECKING:
    from surrogate.kernels import Plan

# Fewer products than this numpy has done in some 10 ms; loading numba takes 0.3 s, once.
FEWEST = 1_000_000
# Poses that a thread takes at once.
SHARE = 4_096
# From so many outputs on, forming each product costs less than going through the tree again.
MANY = 3

# None where numba is not there.
kernels = partial(compiled_loops, "surrogate.kernels")
_plans: WeakKeyDictionary[Expansion, Plan] = WeakKeyDictionary()
_square_plans: WeakKeyDictionary[Expansion, Plan] = WeakKeyDictionary()
# Of squares, terms with all coefficients below this share of the largest are rounding of a fit.
NOTHING = 1e-13
# Rows of outputs that numpy squares at once.
_BLOCK = 8_192


def evaluate(expansion: Expansion, Q: ArrayLike, threads: int | None = None) -> Array:
    """Q (n, k) rad -> y (n, m), as ``expansion(Q)`` gives it to rounding, faster. NaN where an angle is not finite.

    Parameters
    ----------
    threads : at most so many; None: those that numba is set to use. Their number changes no digit

    Raises
    ------
    InputError
        Q of another shape, or fewer than one thread.
    """
    poses, compiled = _checked(expansion, Q, threads)
    if compiled is None:
        with np.errstate(invalid="ignore", over="ignore"):
            return expansion(poses)
    plan = _plans.get(expansion)
    if plan is None:
        plan = _plans.setdefault(expansion, _plan(compiled, expansion))
    return _run(compiled, expansion, plan, poses, threads)


def sum_of_squares(expansion: Expansion, Q: ArrayLike, threads: int | None = None) -> Array:
    """Sum of the outputs' squares (n,) at Q (n, k) rad, as of :func:`evaluate`, without holding the outputs.

    Orthogonal mixtures of the outputs have the same one; of all mixtures the triangular one takes half the work.
    """
    poses, compiled = _checked(expansion, Q, threads)
    if compiled is None:
        blocks = (evaluate(expansion, poses[rows], threads) for rows in in_blocks(len(poses), _BLOCK))
        return np.concatenate([np.zeros(0), *(np.sum(y**2, axis=1) for y in blocks)])
    plan = _square_plans.get(expansion)
    if plan is None:
        plan = _square_plans.setdefault(expansion, _plan(compiled, expansion, squares=True))
    return _run(compiled, expansion, plan, poses, threads, squares=True)[:, 0]


def backend() -> str:
    """What large batches are evaluated by: 'numba' or 'numpy'."""
    return "numpy" if kernels() is None else "numba"


def _checked(expansion: Expansion, Q: ArrayLike, threads: int | None) -> tuple[Array, ModuleType | None]:
    """The poses, and the compiled loops where they are worth it."""
    poses, k = np.asarray(Q, dtype=np.float64), expansion.n_inputs
    if poses.ndim != 2 or poses.shape[1] != k:
        raise InputError("surrogate: angles", code="B003", value=f"shape {poses.shape}", allowed=f"(n, {k}), rad")
    require_at_least("surrogate: threads", threads, 1, code="B003")
    return poses, kernels() if len(poses) * expansion.n_terms >= FEWEST else None


def _run(
    compiled: ModuleType, expansion: Expansion, plan: Plan, poses: Array, threads: int | None, squares: bool = False
) -> Array:
    out = np.empty((len(poses), 1 if squares else expansion.n_outputs))
    many = squares or expansion.n_outputs >= MANY
    raw = 1 + (plan.figures[:, 1:3] * [2, 1]).sum(axis=1).max()
    # One row more: the angle itself has a place even where there are no polynomials.
    room = len(plan.first_entry) - 1 + raw + 1

    def share(part: slice) -> None:
        angles, found = np.array(poses[part], order="C"), out[part]
        work = np.empty((room, compiled.BLOCK))
        if many:
            compiled.products(angles, plan, work, found, squares)
        else:
            compiled.sums(angles, plan, work, found)
        # Not finite, or more turns than the compiled code takes off: as slow and as exact as numpy is.
        odd = np.isnan(found[:, 0])
        if odd.any():
            with np.errstate(invalid="ignore", over="ignore"):
                y = expansion(angles[odd])
                found[odd] = np.sum(y**2, axis=1, keepdims=True) if squares else y

    in_shares(len(poses), SHARE, threads, share)
    return out


def _plan(compiled: ModuleType, expansion: Expansion, squares: bool = False) -> Plan:
    size = np.abs(expansion.coefficients).max(axis=1)
    kept = size > (NOTHING * size.max() if squares else 0.0)
    kept[0] |= not kept.any()  # a sum of nothing still needs one term
    terms, coefficients = expansion.terms[kept], expansion.coefficients[kept]
    inputs = _input_order(terms)
    terms = terms[:, inputs]
    order = np.lexsort(terms.T[::-1])
    terms, coefficients = terms[order], coefficients[order]
    if squares:
        coefficients = np.asarray(np.linalg.qr(coefficients.T, mode="r"), dtype=np.float64).T
    rows = np.empty_like(terms)
    figures, entries, first_row = [], [], 0
    for place, i in enumerate(inputs):
        family = expansion.families[i]
        used, where = np.unique(terms[:, place], return_inverse=True)
        rows[:, place] = first_row + where
        # All degrees up to the highest are computed.
        raw = np.array([*range(1 + 2 * family.harmonics), *(2 * family.harmonics + d for d in family.degrees)])
        entries += [(raw[row != 0.0], row[row != 0.0]) for row in family.matrix[used]]
        highest = family.degrees[-1] if family.degrees else 0
        figures.append((family.periodic, family.harmonics, highest, first_row, first_row + len(used)))
        first_row += len(used)
    change = np.any(terms[1:, :-1] != terms[:-1, :-1], axis=1)
    first_leaf = np.concatenate([[0], np.flatnonzero(change) + 1, [len(terms)]])
    branches = rows[first_leaf[:-1], :-1]
    differ = branches[1:] != branches[:-1]
    common = [*np.argmax(differ, axis=1), 0] if differ.size else [0]
    t, m = coefficients.shape
    weights = coefficients.T
    if squares or m >= MANY:
        leaves, outputs = compiled.LEAVES, compiled.OUTPUTS
        weights = np.zeros((-(-t // leaves) * leaves, -(-m // outputs) * outputs))
        weights[:t, :m] = coefficients
    plan: Plan = compiled.Plan(
        inputs=np.array(inputs),
        figures=np.array(figures),
        centre=np.array([expansion.families[i].centre for i in inputs]),
        half_range=np.array([expansion.families[i].half_range for i in inputs]),
        first_entry=np.cumsum([0, *(len(raw) for raw, _ in entries)]),
        column=np.concatenate([raw for raw, _ in entries]),
        entry=np.concatenate([factor for _, factor in entries]),
        first_leaf=first_leaf,
        leaf_row=np.ascontiguousarray(rows[:, -1]),
        branch_row=np.ascontiguousarray(branches),
        common=np.array(common, dtype=np.int64),
        weights=np.ascontiguousarray(weights),
    )
    return plan


def _input_order(terms: Integers) -> list[int]:
    """Order of inputs with few branches: from the last on, the one without which the fewest products are left."""
    left, order = list(range(terms.shape[1])), []
    while len(left) > 1:
        fewer = {i: np.unique(terms[:, [j for j in left if j != i]], axis=0) for i in left}
        least = min(left, key=lambda i: (len(fewer[i]), -i))
        order.append(least)
        left.remove(least)
    return [*left, *order[::-1]]
