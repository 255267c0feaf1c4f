"""How a stiffness is stated, wherever it is shown: at which load it holds, and its 95 % interval."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import numpy as np
import typer

from fem import ArmModel
from fem.arm import Arm
from fem.effects.base import PlacedEffect
from fem.effects.secant import StatedLoad, worth
from fem.statics.stated import StatedAt, at_load_entry, stiffness_ends
from robots import InputError, ModelDescription, require_positive
from robots.arm_class import stated_load
from robots.arrays import Array
from robots.constants import DOWN, NORMAL_95
from robots.robot import trial_poses

if TYPE_CHECKING:
    from doe.certainty.propagation import Propagated

Given = TypeVar("Given", bound=Arm)
# Poses by which the worth of what is left out is judged.
JUDGED = 64

AtLoad = Annotated[
    float | None,
    typer.Option(
        "--at-load",
        metavar="N",
        help="Load in N at which stiffness is stated, for a model with effects that are not linear in the load, such "
        "as backlash. Default: of the loads it was calibrated with, the one nearest to the rated load.",
    ),
]


def at_load(
    given: Given, size_N: float | None = None, direction: Sequence[float] | Array = DOWN, point: Array | None = None
) -> Given:
    """The arm with all its effects in its compliance, at a load: what is asked wherever an answer is in N/mm or mm.

    Parameters
    ----------
    size_N : force; None: :func:`robots.arm_class.stated_load`
    direction : of the force, base axes
    point : (3,) m, flange frame, at which it acts; None: the model's tool point

    Raises
    ------
    InputError
        A load that is not above 0, or a law that fails.
    """
    require_positive("--at-load", size_N, code="A006", remedy="give the load in N at which stiffness is asked")
    size = stated_load(given.robot, given.description) if size_N is None else size_N
    along = np.asarray(direction, dtype=np.float64)
    return given.at_load(StatedLoad(size * along / np.linalg.norm(along), point))


def stated_words(model: ArmModel) -> str:
    """At which load a stiffness of this arm holds, and what is left out of it with its worth; empty where neither is.

    ``model``: of :func:`at_load`.
    """
    s = model.secants
    if s is None:
        return ""
    out = []
    if s.bent:
        out.append(
            f"Stiffness at a load of {_load_words(s.load)} (secant): {_codes(s.bent)} "
            f"{'is' if len(s.bent) == 1 else 'are'} not linear in the load."
        )
    if s.left_out:
        out.append(
            f"Left out of every stiffness: {_codes(s.left_out)}, worth {_worth(model):+.3g} N/mm (median of "
            "poses), which depends on more than pose and load."
        )
    return " ".join(out)


def stated_at(model: ArmModel) -> StatedAt | None:
    """The same for files; None where there is nothing to say."""
    s = model.secants
    if s is None:
        return None
    carried, bent, left = (tuple(e.effect.code for e in some) for some in (s.carried, s.bent, s.left_out))
    return StatedAt(s.load.size, carried, bent, left, _worth(model) if left else None)


def stated_table(model: ArmModel) -> dict[str, Any]:
    """The same for JSON: an entry ``at_load``, or none."""
    return at_load_entry(stated_at(model))


def _worth(model: ArmModel) -> float:
    return float(np.median(worth(model, trial_poses(model.robot, 16 * JUDGED, JUDGED)))) * 1e-3


def _codes(effects: Sequence[PlacedEffect]) -> str:
    return ", ".join(e.effect.code for e in effects)


def _load_words(load: StatedLoad) -> str:
    along = load.force / load.size
    way = "downward" if np.allclose(along, DOWN) else "along " + ", ".join(f"{v + 0.0:.3g}" for v in along)
    return f"{load.size:.4g} N {way}"


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


def stiffness_interval(value: float, half: float) -> tuple[float, float]:
    """The same of one stiffness."""
    low, high = stiffness_ends(np.array(value), np.array(half))
    return float(low), float(high)


def intervals_at(
    description: ModelDescription, model: ArmModel, q: Array, direction: Array, value: Array, point: Array | None = None
) -> tuple[Array, Array]:
    """Ends (n,) of the 95 % intervals of stiffnesses (n,) at poses (n, dof); NaN where nothing is known of one."""
    half, rows = np.full(len(q), np.nan), np.flatnonzero(np.isfinite(value))
    # Links or a load path other than those it was calibrated with are refused.
    with suppress(InputError):
        found = propagated(description, model, q[rows], direction, point) if len(rows) else None
        if found is not None:
            half[rows] = half_widths(found)
    return stiffness_ends(value, half)
