"""The stiffness indices as rows of a map's table of quantities (:mod:`surrogate.maps.quantities`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from machining.inputs import as_units
from machining.stiffness.indices import INDICES, evaluate
from machining.stiffness.objective import shown
from robots.arrays import Array
from surrogate.maps.quantities import Poses, Quantity, one_field

# Of the indices those that a map has no other name for: 'weakest' is its 'worst', 'strongest' its 'best'.
ON_MAPS: tuple[str, ...] = tuple(name for name in INDICES if name not in ("weakest", "strongest", "isotropy"))
_LABELS = {"k_fs": "k_fs along the normal"}


def index_rows(normal: ArrayLike) -> tuple[Quantity, ...]:
    """Rows of the indices, for a surface ``normal`` (3,) in base axes; the force is along the map's load.

    No index depends on the size of the force. Only k_fs is part of a map unasked.

    Raises
    ------
    InputError
        A normal of length zero.
    """
    unit = as_units("surface normal", normal, 1)[0]
    return tuple(_row(name, unit) for name in ON_MAPS)


def _row(name: str, normal: Array) -> Quantity:
    what = shown(name)

    def of(p: Poses) -> Array:
        value = what.factor * evaluate(name, p.translational, normal, p.direction)
        return np.where(np.isfinite(value), value, np.nan)

    return one_field(name, what.column, what.unit, _LABELS.get(name, name), of, common=name == "k_fs")
