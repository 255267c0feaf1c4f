"""The width of the openings that wrapping closes, found by trial: the smallest that gives one casing near the original.

Too narrow, and the wrap enters the casing: its own walls are then all there is, thinner than the wall of the shell,
and get lost. Too wide, and it spans hollows that stiffen nothing. Both show as departures from the original.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from meshes.surfaces.checks import SurfaceFault
from meshes.surfaces.wrap import Departure, Method
from robots import InputError

T = TypeVar("T")

# Widths tried where none is given, in element sizes.
WIDTHS = (2.0, 6.0, 12.0, 40.0)
# Departure of 95 % of the surfaces that is taken, in element sizes: what an element cannot follow, on both sides.
MOST_DEPARTURE = 2.0


@dataclass(frozen=True)
class Trial:
    """A width (m) and method, what came of them in words, and the departure (m) at 95 %, NaN without a casing."""

    width: float
    method: Method
    words: str
    departure: float = float("nan")

    def __str__(self) -> str:
        return f"{1e3 * self.width:.4g} mm ({self.method}): {self.words}"


class TooFar(SurfaceFault):
    """A wrapped surface that departs too far from the original."""

    def __init__(self, name: str, off: Departure, most: float) -> None:
        self.departure = off
        super().__init__(
            f"surface {name}: {off}",
            code="L005",
            allowed=f"95 % within {1e3 * most:.3g} mm",
            remedy="close openings of another width",
        )


def methods(asked: Method) -> tuple[Method, ...]:
    """Ways to wrap, one after the other: "auto" is the grid, then alpha where pymeshlab is installed.

    The grid first: its skin is as fine at every width, the facets of an alpha wrap are as large as what it closes.
    """
    if asked != "auto":
        return (asked,)
    return ("grid", "alpha") if importlib.util.find_spec("pymeshlab") is not None else ("grid",)


def by_trial(
    name: str, size: float, asked: Method, attempt: Callable[[float, Method, float], T]
) -> tuple[T, tuple[Trial, ...]]:
    """First success of ``attempt(width, method, most)`` over the widths, and the failed trials before it.

    ``size`` m: of the elements. ``attempt`` raises SurfaceFault, :class:`TooFar` where it departs by over ``most`` m.

    Raises
    ------
    InputError
        No trial succeeds: all their figures, and the width to ask for; or a trial of the first width meets what no
        width mends (a grid too large, a missing package).
    """
    most = MOST_DEPARTURE * size
    failed: list[Trial] = []
    for width in (share * size for share in WIDTHS):
        for method in methods(asked):
            try:
                return attempt(width, method, most), tuple(failed)
            except TooFar as fault:
                failed.append(Trial(width, method, str(fault.departure), fault.departure.middling))
            except InputError as fault:
                if not failed and not isinstance(fault, SurfaceFault):
                    raise
                words = fault.what.removeprefix(f"surface {name}").lstrip(": ")
                words += f", {fault.value}" if fault.value else ""
                failed.append(Trial(width, method, words))
    raise InputError(
        f"surface {name}: no closing width by trial gives one casing within two elements ({1e3 * most:.3g} mm) of the "
        f"original",
        code="L005",
        value="; ".join(map(str, failed)),
        allowed=f"off by up to {1e3 * most:.3g} mm for 95 % of what is seen",
        remedy=_remedy(name, failed),
    )


def _remedy(name: str, failed: list[Trial]) -> str:
    bodies = [trial for trial in failed if np.isfinite(trial.departure)]
    other = f"repair the file, or leave the link rigid with --rigid {name}"
    if not bodies:
        return (
            f"--close-mm does not help up to {1e3 * failed[-1].width:.4g}: export the outer skin alone as one body "
            f"and give the wall's true thickness; else {other}"
        )
    best = min(bodies, key=lambda trial: trial.departure)
    alpha = " --wrap alpha" if best.method == "alpha" else ""
    return (
        f"--close-mm {1e3 * best.width:.0f}{alpha} takes the nearest of them, off by {1e3 * best.departure:.3g} mm, "
        f"with a warning; else {other}"
    )


def warning(off: Departure, size: float) -> tuple[str, ...]:
    """A line that begins with WARNING where a casing departs too far from the original; else none."""
    if not off.middling > MOST_DEPARTURE * size:
        return ()
    return (
        f"WARNING: {off}, more than two elements ({2e3 * size:.3g} mm): walls are lost or hollows spanned, and the "
        f"link's stiffness is not to be trusted",
    )
