"""How sure a stiffness is by the model's calibration: the same 95 % interval wherever it is shown."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fem import ArmModel
from robots import InputError, ModelDescription
from robots.arrays import Array
from robots.constants import NORMAL_95
from stiffarm.session.json_text import number

if TYPE_CHECKING:
    from doe.certainty.propagation import Propagated


def propagated(
    description: ModelDescription, model: ArmModel, q: Array, direction: Array | None = None, point: Array | None = None
) -> Propagated | None:
    """The compliance along a force at poses q (n, dof) rad and its uncertainty; None where the file says nothing of it.

    ``model``: built from the description; the other arguments and the errors as of
    :func:`doe.certainty.propagation.propagate`.
    """
    if description.calibration is None:
        return None
    # Only calibrated models need them, and they take their time to load.
    from doe.certainty.propagation import parameter_uncertainty, propagate

    known = parameter_uncertainty(description)
    return None if known is None else propagate(model, known, q, direction, point)


def half_widths(found: Propagated) -> Array:
    """Half of the 95 % interval of the compliance, as a share of it (n,)."""
    return np.asarray(NORMAL_95 * found.relative_sd)


def stiffness_ends(value: Array, half: Array) -> tuple[Array, Array]:
    """Ends (n,) of the 95 % intervals of stiffnesses from half their widths as a share.

    It is the compliance that is off by the share; an upper end of infinity means that there is none, NaN that nothing
    is known.
    """
    high = np.where(
        half < 1.0, value / np.where(half < 1.0, 1.0 - half, 1.0), np.where(np.isfinite(half), np.inf, np.nan)
    )
    return np.asarray(value / (1.0 + half)), np.asarray(high)


def stiffness_interval(value: float, half: float) -> tuple[float, float]:
    """The same of one stiffness."""
    low, high = stiffness_ends(np.array(value), np.array(half))
    return float(low), float(high)


def interval_at(
    description: ModelDescription, model: ArmModel, q: Array, direction: Array, value: float, point: Array | None = None
) -> tuple[float, float]:
    """Ends of the 95 % interval of a stiffness at one pose (dof,); NaN where nothing is known of it."""
    try:
        found = propagated(description, model, q[None], direction, point)
    except InputError:
        # Links or a load path other than those it was calibrated with.
        found = None
    return (np.nan, np.nan) if found is None else stiffness_interval(value, float(half_widths(found)[0]))


def interval_json(ends: tuple[float, float]) -> list[float | None] | None:
    """Ends for JSON: null where there is no upper one, and for an interval of which nothing is known."""
    low, high = ends
    return [number(low), number(high) if np.isfinite(high) else None] if np.isfinite(low) else None
