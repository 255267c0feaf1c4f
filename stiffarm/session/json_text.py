"""Results as JSON text: every figure in it is a finite number, or nothing is written."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from robots import InputError
from robots.errors import listed

if TYPE_CHECKING:
    from rehearsal.scoring import Share


def json_text(content: Mapping[str, Any]) -> str:
    """The text of one JSON object.

    Raises
    ------
    InputError
        Figures that are not finite, by their place: what went in is beyond what can be computed.
    """
    try:
        return json.dumps(content, indent=2, allow_nan=False) + "\n"
    except ValueError as error:
        places = list(_not_finite(content, ""))
        if not places:
            raise
        raise InputError(
            f"results that are no finite numbers: {listed(places)}",
            code="X004",
            remedy="look for extreme figures in the model, the tables and the options; with --debug see where",
        ) from error


def _not_finite(node: Any, place: str) -> Iterator[str]:
    if isinstance(node, float) and not math.isfinite(node):
        yield place.removeprefix(".")
    elif isinstance(node, Mapping):
        for key, inner in node.items():
            yield from _not_finite(inner, f"{place}.{key}")
    elif isinstance(node, list | tuple):
        for i, inner in enumerate(node):
            yield from _not_finite(inner, f"{place}[{i}]")


def number(value: float, digits: int = 6) -> float | None:
    """A JSON number with that many significant digits; None for NaN and infinity."""
    return float(f"{value:.{digits}g}") if math.isfinite(value) else None


def numbers(values: Iterable[float], digits: int = 6) -> list[float | None]:
    """The same for each of some values."""
    return [number(float(value), digits) for value in values]


def share(s: Share) -> dict[str, Any]:
    """A count with its exact interval."""
    return {"count": s.count, "of": s.of, "interval95": [number(v) for v in s.interval95]}
