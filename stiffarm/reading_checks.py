"""Tables that no calibration should be made from: readings against the load, units out by a thousand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from doe import Measurements
from robots import InputError
from stiffarm.console import say

Array = NDArray[np.float64]

# Stiffness at an arm's tool, N/mm: small cobots some ten, the largest arms some thousand. A thousand times off lies
# outside, a good robot in a stiff pose does not.
PLAUSIBLE_N_PER_MM = (1.0, 5e4)
FEWEST, LISTED = 3, 10


def refuse_implausible(data: Measurements) -> None:
    """Raise InputError if most readings move against their load, or give a stiffness that no arm has.

    Only readings in every direction that is loaded tell: the work of the load is known there. A passive arm never
    moves against a load as a whole, so a calibration would drive every spring to its rigid end and look calm.
    """
    work, force, _ = _work(data)
    if len(work) < FEWEST:
        return
    against = int((work < 0.0).sum())
    if 2 * against > len(work):
        raise InputError(
            f"{data.source}: {against} of {len(work)} readings move against the load",
            allowed="deflections along the load, as those of every passive arm",
            remedy="check the sign of the load and reading columns (a downward load has fz_N < 0 and gives dz_mm < 0)",
        )
    stiffness = 1e-3 * force**2 / np.maximum(np.abs(work), 1e-300)
    typical, (low, high) = float(np.median(stiffness)), PLAUSIBLE_N_PER_MM
    if not low <= typical <= high:
        raise InputError(
            f"{data.source}: stiffness at the tool, median of the readings (N/mm)",
            value=f"{typical:.3g}",
            allowed=f"{low:g} to {high:g}, as arms have",
            remedy="check the units: loads in N, deflections in mm",
        )


def against_load(data: Measurements) -> str | None:
    """A remark on readings that move against their load by more than a gauge's noise would; None if none do.

    Few of them may be slips of the pen; a calibration gives them little weight if it can.
    """
    work, force, told = _work(data)
    odd = np.flatnonzero(told)[(work < 0.0) & (1e-3 * force**2 <= PLAUSIBLE_N_PER_MM[1] * np.abs(work))]
    if not odd.size:
        return None
    rows = ", ".join(str(data.row_numbers[i]) for i in odd[:LISTED]) + (" ..." if odd.size > LISTED else "")
    return f"{data.source}: {odd.size} of {len(work)} readings move against their load: the sign? Rows {rows}"


def _work(data: Measurements) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Force times displacement (k,), force (k,) and which (n,) of the readings had their loaded directions all read."""
    force = data.wrench[:, :3]
    work = np.where(force != 0.0, force * data.displacement[:, :3], 0.0).sum(axis=1)
    told = (force != 0.0).any(axis=1) & np.isfinite(work) & (work != 0.0)
    return work[told], data.loads_N[told], told


def check_readings(data: Measurements) -> None:
    """Refuse what :func:`refuse_implausible` does, and remark on readings against their load."""
    refuse_implausible(data)
    remark = against_load(data)
    if remark is not None:
        say(f"note: {remark}")
