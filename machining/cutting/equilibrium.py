"""Depth of cut and deflection in balance: a mill that is pushed off its wall cuts less deep, which pushes less."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from machining.cutting.force import ForceAlong, MillingForce, check_wall
from machining.cutting.process_axes import process_axes
from machining.task import Task
from robots import InputError, require_at_least, require_positive
from robots.arrays import Array

# Step of the depth for the slope, share of it: central differences leave some 1e-8 of the slope.
STEP = 1e-4


@dataclass(frozen=True)
class Balance:
    """Settings of the fixed-point iteration: ``tolerance`` m between two rounds, at most ``rounds``.

    Raises
    ------
    InputError
        A tolerance that is not positive, or less than one round.
    """

    tolerance: float = 1e-9
    rounds: int = 50

    def __post_init__(self) -> None:
        require_positive("tolerance of the balance", self.tolerance, "m", code="K006")
        require_at_least("rounds of the balance", self.rounds, 1, code="K006")


@dataclass(frozen=True, eq=False)
class Balanced:
    """The balance found.

    ``force``: at it; ``depth`` (n,) m: radial depth left; ``gain`` (n,): what the balance leaves of a small change of
    the error, ``1 / (1 + slope)`` with the slope of the error by the depth; ``rounds`` needed, ``change`` m in the
    last.
    """

    force: ForceAlong
    depth: Array
    gain: Array
    rounds: int
    change: float


def balanced(task: Task, force: MillingForce, error: Callable[[ForceAlong], Array], settings: Balance) -> Balanced:
    """Iterate ``e <- error(force at depth - e)`` at all points.

    ``error``: the error (n,) m along the wall's normal under a force. It converges where a change of depth moves the
    tool by less than that change.

    Raises
    ------
    InputError
        No wall, a full slot (its immersion does not change), normals that are not the wall's, a mill that leaves the
        cut, or no convergence.
    """
    engaged, mill = force.engagement, force.mill
    width = engaged.exit - engaged.entry
    if engaged.wall is None or width >= np.pi:
        allowed = "peripheral milling: a wall, and a radial depth below the diameter"
        raise InputError(
            "balance of depth and deflection", code="K006", value=f"{np.degrees(width):.4g} deg", allowed=allowed
        )
    check_wall(task, engaged, process_axes(task))
    nominal = 0.5 * mill.diameter * (1.0 - np.cos(width))
    e, change, rounds = np.zeros(task.path.n), np.inf, 0
    while change > settings.tolerance:
        if rounds == settings.rounds:
            raise _restless(settings, change)
        at = force.at_depth(task, _in_cut(nominal - e, mill.diameter))
        new = error(at)
        e, change, rounds = new, float(np.abs(new - e).max()), rounds + 1
    depth = _in_cut(nominal - e, mill.diameter)
    h = STEP * np.minimum(depth, mill.diameter - depth)
    slope = (error(force.at_depth(task, depth + h)) - error(force.at_depth(task, depth - h))) / (2.0 * h)
    return Balanced(force.at_depth(task, depth), depth, 1.0 / (1.0 + slope), rounds, change)


def _restless(settings: Balance, change: float) -> InputError:
    return InputError(
        "balance of depth and deflection",
        code="K006",
        value=f"still moving by {change:.3g} m after {settings.rounds} rounds",
        allowed=f"{settings.tolerance:g} m",
        remedy="the cut is too heavy for this arm: less axial depth or feed; or give more rounds",
    )


def _in_cut(depth: Array, diameter: float) -> Array:
    out = ~((depth > 0.0) & (depth < diameter))
    if out.any():
        row = int(np.argmax(out))
        raise InputError(
            f"balance of depth and deflection at path point {row}: radial depth with the deflection",
            code="K006",
            value=f"{depth[row] * 1e3:.4g} mm",
            allowed=f"more than 0, below the diameter {diameter * 1e3:g} mm",
            remedy="the cut is too heavy for this arm: less axial depth or feed",
        )
    return depth
