"""A surrogate as JavaScript: its numbers as JSON, and the few lines that evaluate them, for pages and for Node."""

from __future__ import annotations

import json
from collections.abc import Iterable
from importlib import resources
from typing import Any

import numpy as np

from surrogate.expansion import Expansion
from surrogate.portable.content import Portable, content_hash
from surrogate.portable.words import identifier, provenance


def evaluator_script() -> str:
    """The function ``stiffarmSurrogate(data)``: its ``evaluate(q_rad)`` answers ``{status, values}``."""
    return (resources.files("surrogate.portable") / "templates" / "portable.js").read_text(encoding="utf-8")


def surrogate_data(portable: Portable) -> dict[str, Any]:
    """What ``stiffarmSurrogate`` takes, as JSON has it: numbers read back as the same bits, null is without an end."""
    p = portable
    lower, upper = p.bounds
    coupled_lower, coupled_upper = p.coupled_bounds
    return {
        "inputs": list(p.inputs),
        "link": p.link,
        "n_values": p.n_values,
        "lower": lower.tolist(),
        "upper": upper.tolist(),
        "coupled": p.couplings.matrix.tolist(),
        "coupled_lower": _ends(coupled_lower),
        "coupled_upper": _ends(coupled_upper),
        "row_weights": p.row_weights.tolist() if p.factor is not None else [],
        "sums": [_sum(e) for e in p.sums],
    }


def javascript(portable: Portable) -> str:
    """Text of a script that runs in a page and in Node, and needs nothing else.

    With NAME the surrogate's name as an identifier it has ``NAME.evaluate(q_rad)``, which answers ``{status, values}``
    with a :class:`~surrogate.portable.content.Status`, values NaN unless it is 0; a matrix 6 x 6 stands row by row.
    """
    name = identifier(portable.name)
    lines = [*provenance(portable), f"SHA-256 of the numbers: {content_hash(portable)}"]
    comment = "\n".join(f"// {line}".rstrip() for line in lines)
    data = json.dumps(surrogate_data(portable), allow_nan=False).replace("<", "\\u003c")
    export = f'if (typeof module !== "undefined") module.exports = {name};'
    return f"{comment}\n{evaluator_script()}const {name} = stiffarmSurrogate({data});\n{export}\n"


def _ends(values: Iterable[float]) -> list[float | None]:
    return [float(v) if np.isfinite(v) else None for v in values]


def _sum(e: Expansion) -> dict[str, Any]:
    return {
        "terms": e.terms.tolist(),
        "coefficients": e.coefficients.tolist(),
        "families": [
            {
                "centre": float(f.centre),
                "half_range": float(f.half_range),
                "periodic": bool(f.periodic),
                "harmonics": int(f.harmonics),
                "degrees": [int(d) for d in f.degrees],
                "matrix": f.matrix.tolist(),
            }
            for f in e.families
        ],
    }
