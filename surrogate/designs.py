"""Where to run the model: poses that fill the reachable part of a box, and poses where a fit is worst."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal, get_args

import numpy as np
from scipy.stats import qmc

from robots.arrays import Array, Bools, Integers
from robots.errors import InputError, require_at_least, require_one_of
from surrogate.scope import Couplings, as_box

Density = Literal["arcsine", "uniform", "random", "boundary"]

# Tries before a box without one accepted pose is called empty (missing 1e-4 of it by chance: 2e-6).
_EMPTY_AFTER = 2**17
_GIVE_UP_AFTER = 2**22


def space_filling_design(
    lower: Array,
    upper: Array,
    n: int,
    rng: np.random.Generator,
    accept: Callable[[Array], Bools] | None = None,
    *,
    density: Density = "arcsine",
    couplings: Couplings | None = None,
    names: Sequence[str] | None = None,
) -> Array:
    """Exactly n poses that fill a box, as far as it can be reached: scrambled Sobol points -> (n, k) rad.

    A polynomial has its worst error at the boundary of the box. Measured on the rigid-link model of a 6R arm
    with a parallelogram (k = 4, log-compliance, degree 6, coupling kept, mean of three seeds), errors on
    36 000 uniform and on 10 000 boundary poses:

    ====  =======  ===========  ===========  ============  ============
    runs  density  uniform RMS  uniform max  boundary RMS  boundary max
    ====  =======  ===========  ===========  ============  ============
    400   uniform        3.2 %         75 %          24 %         156 %
    400   arcsine        3.0 %         40 %          18 %          86 %
    4096  uniform        1.8 %         40 %          14 %          69 %
    4096  arcsine        2.5 %         25 %         7.7 %          35 %
    ====  =======  ===========  ===========  ============  ============

    Uniform with 10 % boundary poses: worst 83 and 167 % (400 runs), 29 and 37 % (4096). So runs to fit are
    drawn with the arcsine density (that of Chebyshev points) by default. Runs to judge a fit should be
    uniform, with boundary ones added for the worst case.

    Parameters
    ----------
    lower, upper : (k,) rad
    n : number of poses, 1 or more
    rng : random generator; the same state gives the same poses
    accept : (m, k) -> (m,), which poses may be used
    density : 'arcsine' and 'uniform' over the box, 'random': uniform and independent, as statistics need them, or
        'boundary': 1 to k inputs at one of their limits
    couplings : limits on sums of inputs, kept too, and named if they leave nothing
    names : (k,) of the inputs, for messages

    Raises
    ------
    InputError
        A bad box or number, or (almost) no pose is accepted; says which limits leave none.
    """
    lo, hi = as_box(lower, upper)
    require_at_least("design: number of poses", n, 1, code="C005")
    require_one_of("design: density", density, get_args(Density), code="C005")
    sobol = qmc.Sobol(len(lo), scramble=True, rng=rng)
    found: list[Array] = []
    limits = Couplings.none(len(lo)) if couplings is None else couplings
    count, tried, refused = 0, 0, np.zeros(1 + len(limits.names), dtype=np.int64)
    # Blocks double, so that all points so far are a power of two: only then is a Sobol set balanced.
    block = 1 << max(8, int(n - 1).bit_length())
    while count < n:
        if tried >= (_EMPTY_AFTER if count == 0 else _GIVE_UP_AFTER):
            raise _nothing_left(f"{count} of {n} poses after {tried} tries", lo, hi, names, limits, refused)
        Q = np.minimum(lo + (hi - lo) * _shape(sobol.random(block), density, rng), hi)
        ok = np.ones(block, dtype=np.bool_) if accept is None else np.asarray(accept(Q), dtype=np.bool_)
        kept = limits.kept(Q)
        refused += [np.count_nonzero(~ok), *np.count_nonzero(~kept, axis=0)]
        ok = ok & kept.all(axis=1)
        found.append(Q[ok])
        count, tried = count + int(np.count_nonzero(ok)), tried + block
        block = tried
    return np.concatenate(found)[:n]


def _shape(u: Array, density: Density, rng: np.random.Generator) -> Array:
    """Turn uniform points of the unit box into another density; the box's own limits may be hit."""
    if density == "arcsine":
        return np.asarray(0.5 - 0.5 * np.cos(np.pi * u))
    if density == "random":
        return rng.random(u.shape)
    if density == "boundary":
        at_limit = np.argsort(rng.random(u.shape)) < rng.integers(1, u.shape[1] + 1, (len(u), 1))
        return np.asarray(np.where(at_limit, np.round(u), u))
    return u


def _nothing_left(
    found: str, lo: Array, hi: Array, names: Sequence[str] | None, limits: Couplings, refused: Integers
) -> InputError:
    labels = names or [f"input {i + 1}" for i in range(len(lo))]
    box = ", ".join(f"{name} {_span(a, b)}" for name, a, b in zip(labels, lo, hi, strict=True))
    why = [f"accept() refuses {refused[0]}"] if refused[0] else []
    for j in np.flatnonzero(refused[1:]):
        ends = np.sort(np.stack([limits.matrix[j] * lo, limits.matrix[j] * hi]), axis=0).sum(axis=1)
        why.append(
            f"{limits.names[j]} refuses {refused[1 + j]} (over the box it spans {_span(*ends)}, "
            f"allowed {_span(limits.lower[j], limits.upper[j])})"
        )
    return InputError(
        f"design: found only {found} in the box {box}: {'; '.join(why)}",
        code="C005",
        remedy="widen or shift the ranges so that they overlap with these limits",
    )


def _span(lower: float, upper: float) -> str:
    return f"{np.degrees(lower):.6g} to {np.degrees(upper):.6g} deg"
