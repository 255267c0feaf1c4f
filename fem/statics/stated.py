"""What stands beside a stiffness: its load and the ends of its interval. Apart from models: surrogates need none."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from robots.arrays import Array


@dataclass(frozen=True)
class StatedAt:
    """What files say of an arm with secants: the load in N.

    ``effects``: codes of those that are in the compliance; ``not_linear``: of these those by which another load has
    another stiffness; ``left_out``: of those that are not in it, which are worth ``left_out_worth_N_per_mm`` in the
    median pose.
    """

    load_N: float  # noqa: N815 - units are in the names of the file's keys
    effects: tuple[str, ...]
    not_linear: tuple[str, ...]
    left_out: tuple[str, ...]
    left_out_worth_N_per_mm: float | None  # noqa: N815 - as above


def at_load_entry(at: StatedAt | None) -> dict[str, Any]:
    """For JSON: an entry ``at_load``, or none."""
    return {} if at is None else {"at_load": asdict(at)}


def stiffness_ends(value: Array, half: Array) -> tuple[Array, Array]:
    """Ends (n,) of the 95 % intervals of stiffnesses from half their widths as a share.

    It is the compliance that is off by the share; an upper end of infinity means that there is none, NaN that nothing
    is known.
    """
    high = np.where(
        half < 1.0, value / np.where(half < 1.0, 1.0 - half, 1.0), np.where(np.isfinite(half), np.inf, np.nan)
    )
    return np.asarray(value / (1.0 + half)), np.asarray(high)
