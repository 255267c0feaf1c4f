"""Which combinations of variables are determined when not all of them are; in words, what it takes to settle the rest.

It is linear algebra of a null space. The readings determine w^T x exactly if w is orthogonal to every direction z that
moves no reading. Rows of a reduced echelon form are such w with as few variables as can be (no row has another one's
variables among its own), and the form splits the variables into groups that have nothing to do with one another (the
components of a matroid: Oxley, Matroid Theory, 2nd ed., section 4.1).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components

from fem.free.parameters import Parameter
from robots.arrays import Array, Bools, Indices

# Entries of an echelon form below this are rounding; variables have columns of norm one, null vectors length one.
ROUNDING = 1e-6
# Echelon forms that are compared for the one with the fewest entries.
TRIES = 60
# Weights of a combination within this of one another are called a sum or a difference.
EQUAL = 1.25
# A combination whose value is known this well (standard deviation over its terms' sizes) is called determined.
KNOWN = 0.5
# Groups of more parameters than this are named by joint and row; of so many combinations the best are listed.
FEW, LISTED = 6, 3
UNITS = {"N m/rad": "rad/(N m)", "N/m": "m/N", "Pa": "1/Pa"}


@dataclass(frozen=True)
class Combination:
    """A weighted sum of the estimator's variables: ``names`` and ``weights`` (k,), the largest 1 where units agree.

    ``value`` and ``sd`` in ``unit``; ``relative``: sd over the sum of its terms' sizes.
    """

    names: tuple[str, ...]
    weights: Array
    value: float
    sd: float
    unit: str
    relative: float
    words: str


def echelon(rows: Array, order: Indices) -> tuple[Array, Indices]:
    """Reduced echelon form (r, p) of rows (k, p) and its r pivots, pivots sought in a given order of the columns."""
    M, pivots, r = rows.copy(), [], 0
    for c in order:
        if r == len(M):
            break
        k = r + int(np.argmax(np.abs(M[r:, c])))
        if abs(M[k, c]) < ROUNDING:
            continue
        M[[r, k]] = M[[k, r]]
        M[r] /= M[r, c]
        others = np.arange(len(M)) != r
        M[others] -= np.outer(M[others, c], M[r])
        pivots.append(c)
        r += 1
    M = M[:r]
    M[np.abs(M) < ROUNDING * np.abs(M).max(initial=1.0)] = 0.0
    return M, np.array(pivots, dtype=np.intp)


def sparsest(rows: Array) -> tuple[Array, Indices]:
    """The echelon form with the fewest entries among some; the same for the same rows."""
    p = rows.shape[1]
    rng = np.random.default_rng(0)
    forms = [echelon(rows, np.arange(p) if k == 0 else rng.permutation(p)) for k in range(TRIES if p > 2 else 1)]
    return min(forms, key=lambda form: np.count_nonzero(form[0]))


def groups(joined: Bools) -> list[Indices]:
    """Sets of two or more things that ``joined`` (n, n) connects, pair by pair."""
    count, label = connected_components(joined, directed=False)
    sets = (np.flatnonzero(label == k) for k in range(count))
    return [members for members in sets if members.size > 1]


def components(null: Array) -> list[Indices]:
    """Groups of two or more variables that null vectors (d, p) join."""
    there = echelon(null, np.arange(null.shape[1]))[0] != 0.0
    return groups(there.T @ there)


def complement(null: Array) -> Array:
    """Rows (p - d, p), orthonormal, orthogonal to the null vectors (d, p)."""
    _, s, V = np.linalg.svd(null, full_matrices=True)
    return np.asarray(V[int((s > ROUNDING).sum()) :])


def alike(null: Array) -> list[Indices]:
    """Sets of two or more variables of which only one and the same combination is ever seen."""
    W = complement(null)
    P = W.T @ W
    size = np.sqrt(np.maximum(np.diag(P), 0.0))
    same = np.abs(P) > (1.0 - ROUNDING) * np.outer(size, size)
    same &= (size[:, None] > ROUNDING) & (size[None, :] > ROUNDING)
    return groups(same)


def unit_of(q: Parameter) -> str:
    """Unit of the estimator's variable."""
    if q.scale == "compliance":
        return UNITS.get(q.unit, f"1/({q.unit})")
    return f"ln({q.unit})" if q.scale == "log" else q.unit


def combination_words(q: Sequence[Parameter], weights: Array, value: float, sd: float, unit: str, known: bool) -> str:
    """One sentence about the only combination of some parameters that is determined."""
    compliances = all(p.scale == "compliance" for p in q)
    what = "compliances" if compliances else "values"
    names = listed([p.name for p in q])
    size = f"{value:.2g} +- {sd:.1g} {unit}"
    verb = "is determined" if known else "would be determined, and that poorly"
    if len(q) == 1:
        return f"only the {'compliance' if compliances else 'value'} of {names}, {size}, {verb} by these poses"
    if unit == "mixed units":
        return f"{names} trade off: these readings see them only together, in a mix of different units"
    ratio = np.abs(weights).max() / np.abs(weights).min()
    if ratio < EQUAL and (weights > 0).all():
        return f"{names} trade off: only the sum of their {what}, {size}, {verb} by these poses{_floor(q, value, sd)}"
    if ratio < EQUAL and len(q) == 2:
        return f"{names} trade off: only the difference of their {what}, {size}, {verb} by these poses"
    return f"{names} trade off: only {formula(q, weights)} = {size} {verb} by these poses"


def _floor(q: Sequence[Parameter], value: float, sd: float) -> str:
    """What a sum of compliances says about each of them: none can be larger than the sum."""
    if not all(p.scale == "compliance" for p in q) or value + 2.0 * sd <= 0.0:
        return ""
    each = "neither" if len(q) == 2 else "none of them"
    return f", so {each} is softer than {1.0 / (value + 2.0 * sd):.2g} {q[0].unit}"


def group_words(
    q: Sequence[Parameter], found: Sequence[Combination], twins: Sequence[tuple[str, ...]], given: Sequence[str]
) -> str:
    """About parameters that no reading separates, of which some combinations are determined."""
    compliances = all(p.scale == "compliance" for p in q)
    known = [c for c in found if c.relative < KNOWN]
    by_name = {p.name: p for p in q}
    what = "compliances" if compliances else "numbers"
    out = [f"{_group(q)} are seen only together: none of them is determined by these poses"]
    if not known:
        out[0] += f", and neither is any of the {len(found)} combinations of their {what} that readings depend on"
    elif len(known) == len(found):
        out[0] += f", but {len(found)} combination{'s' * (len(found) > 1)} of their {what}"
    else:
        out[0] += f", but {len(known)} combination{'s' * (len(known) > 1)} of their {what} (of {len(found)} readable)"
    if found:
        shown = (known or found)[:LISTED]
        label = "best known" if len(found) > len(shown) else "known"
        out.append(f"{label if known else 'best of them'}: {'; '.join(_value(c, by_name) for c in shown)}")
    if len(found) > LISTED:
        out.append(f"least known: {_value(found[-1], by_name)}")
    if twins and len(q) > 2:
        out.append(f"the same effect in every reading: {'; '.join(listed(list(t)) for t in twins)}")
    some = (
        f"{len(given)} of them, for instance {listed(list(given))}," if len(given) > 1 else f"one of them, {given[0]},"
    )
    out.append(
        f"with {some} given (a prior, or held) the others follow"
        if len(given) <= FEW
        else f"{len(given)} of them must be given (a prior, or held) before the others follow"
    )
    return "; ".join(out)


def near_words(q: Sequence[Parameter], best: Combination, worst: Combination) -> str:
    """About parameters that correlate, though readings could tell them apart if there were more."""
    by_name = {p.name: p for p in q}
    return (
        f"{_group(q)} trade off: best known is {_value(best, by_name)}; least known {_value(worst, by_name)}; "
        "more poses can tell them apart"
    )


def _value(c: Combination, by_name: dict[str, Parameter]) -> str:
    chosen = [by_name[n] for n in c.names]
    if c.unit == "mixed units":
        return f"{formula(chosen, c.weights)} within {100.0 * c.relative:.2g} % (SI units)"
    return f"{formula(chosen, c.weights)} = {c.value:.2g} +- {c.sd:.1g} {c.unit}"


def formula(q: Sequence[Parameter], weights: Array) -> str:
    """A weighted sum: c(NAME) is a compliance, x(NAME) another variable."""
    out = ""
    for p, w in zip(q, weights, strict=True):
        sign = "-" if w < 0.0 else "+"
        size = "" if abs(abs(w) - 1.0) < 5e-3 else f"{abs(w):.2g} "
        term = f"{size}{'c' if p.scale == 'compliance' else 'x'}({p.name})"
        out += term if not out and sign == "+" else (f"-{term}" if not out else f" {sign} {term}")
    return out


def _group(q: Sequence[Parameter]) -> str:
    """Names of a group; of a large one as rows of places."""
    names = [p.name for p in q]
    if len(names) <= FEW:
        return listed(names)
    rows: dict[str, list[str]] = {}
    for name in names:
        place, _, row = name.partition(".")
        rows.setdefault(place, []).append(row)
    places: dict[tuple[str, ...], list[str]] = {}
    for place, mine in rows.items():
        places.setdefault(tuple(mine), []).append(place)
    parts = [f"{listed(list(mine))} of {_places(where)}" for mine, where in places.items()]
    return f"{'; '.join(parts)} ({len(names)} numbers)"


def _places(names: Sequence[str]) -> str:
    """Places as in a sentence; three or more that are numbered in a row as the first and the last."""
    numbers = [re.fullmatch(r"(\D*)(\d+)", name) for name in names]
    if len(names) > 2 and all(numbers):
        found = [(n[1], int(n[2])) for n in numbers if n]
        if found == [(found[0][0], found[0][1] + k) for k in range(len(found))]:
            return f"{names[0]} to {names[-1]}"
    return listed(names)


def listed(names: Sequence[str]) -> str:
    """Names as in a sentence."""
    return ", ".join(names[:-1]) + " and " + names[-1] if len(names) > 1 else names[0]
