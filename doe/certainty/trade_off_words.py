"""Trade-offs in words: what is determined, what is not, and what it takes to settle the rest."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from doe.certainty.combinations import Combination
from fem.free.parameters import Parameter
from robots.arrays import Array

# Weights of a combination within this of one another are called a sum or a difference.
EQUAL = 1.25
# A combination whose value is known this well (standard deviation over its terms' sizes) is called determined.
KNOWN = 0.5
# Groups of more parameters than this are named by joint and row; of so many combinations the best are listed.
FEW, LISTED = 6, 3
UNITS = {"N m/rad": "rad/(N m)", "N/m": "m/N", "Pa": "1/Pa"}


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
    out.append(f"with {some} given (a prior, or held) the others follow" if len(given) <= FEW else
               f"{len(given)} of them must be given (a prior, or held) before the others follow")  # fmt: skip
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
