"""A comparison as JSON: keys with units, null where there is no number."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from robots.quantities import rounded, rounded_all
from stiffarm.commands.compare import words
from stiffarm.commands.compare.maps import MapPair, Quantity
from stiffarm.commands.compare.numbers import Figure, Pair
from stiffarm.commands.compare.sources import Source
from stiffarm.commands.compare.step import Compared

SCHEMA = "stiffarm-comparison/1"


def comparison(some: Sequence[Compared]) -> dict[str, Any]:
    """Each of several results against the first one."""
    first = some[0].a
    return {
        "schema": SCHEMA,
        "kind": first.kind,
        "robot": first.robot or None,
        "first": source(first),
        "others": [compared(c) for c in some],
    }


def source(s: Source) -> dict[str, Any]:
    """What was compared."""
    return {"name": s.name, "file": s.file.name}


def compared(c: Compared) -> dict[str, Any]:
    """One of the others against the first."""
    out: dict[str, Any] = {"second": source(c.b), "in_words": words.headline(c), "remarks": words.remarks(c)}
    if c.maps is not None:
        return out | of_maps(c.maps)
    return out | {
        "numbers": {p.name: pair(p) for p in c.pairs},
        "settings": {s.name: {"first": s.a, "second": s.b, "same": s.same} for s in c.settings},
        "all_at_once": None
        if c.joint is None
        else {
            "chi_square": rounded(c.joint.chi2),
            "degrees_of_freedom": c.joint.freedom,
            "p_value": rounded(c.joint.p, 3),
        },
    }


def pair(p: Pair) -> dict[str, Any]:
    """A number of both; ``change`` as a share of the first, or in its unit."""
    return {
        "unit": p.unit,
        "first": figure(p.a),
        "second": figure(p.b),
        "change": rounded(p.change, 4),
        "change_is_share": p.is_share,
        "p_value": rounded(p.p, 3),
        "verdict": None if p.verdict == "other" else p.verdict,
    }


def figure(f: Figure | None) -> dict[str, Any] | None:
    """A number with its interval; null where a side is open."""
    if f is None:
        return None
    ends = [None if v is None or not math.isfinite(v) else rounded(v) for v in (f.low, f.high)]
    return {"value": None if f.value is None else rounded(f.value), "interval95": ends}


def of_maps(m: MapPair) -> dict[str, Any]:
    """Two maps, quantity by quantity."""
    return {
        "points": len(m.points),
        "only_first_reaches": m.only_a,
        "only_second_reaches": m.only_b,
        "quantities": {q.name: quantity(q) for q in m.quantities},
    }


def quantity(q: Quantity) -> dict[str, Any]:
    """One quantity over the points that both reach; changes as a share of the first, or in its unit."""
    good = np.isfinite(q.change)
    low, middle, high = np.quantile(q.change[good], [0.05, 0.5, 0.95]) if good.any() else (math.nan,) * 3
    return {
        "label": q.label,
        "unit": q.unit,
        "points": int(good.sum()),
        "first_median": rounded(float(np.median(q.a[good]))) if good.any() else None,
        "second_median": rounded(float(np.median(q.b[good]))) if good.any() else None,
        "change_is_share": q.is_share,
        "change_median": rounded(float(middle), 4),
        "change_5_to_95": rounded_all((float(low), float(high)), 4),
        "share_beyond_noise": None if q.beyond is None else rounded(float(np.mean(q.beyond[good])), 4),
    }
