"""What a placement is chosen for: the criterion K_sf, the mean or the worst stiffness, or the surface error."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from machining.cutting import ConstantForce
from machining.cutting.force import CuttingForce
from machining.cutting.process_axes import weights
from machining.stiffness.criterion import N_PER_MM, Criterion
from machining.task import ToolPath
from robots import InputError
from robots.arrays import Array

Aim = Literal["ksf", "mean", "worst", "error"]
AIMS: tuple[Aim, ...] = ("ksf", "mean", "worst", "error")


@dataclass(frozen=True, eq=False)
class Goal:
    """What is made large, or small.

    Attributes
    ----------
    aim : "ksf", the criterion of :mod:`machining.stiffness.criterion`; "mean" or "worst" directional stiffness along
    the
        cutting force; "error": least RMS of the surface error along the path
    force : the cutting force; its direction at each point is what stiffness is looked at along
    criterion : weights of K_sf; None: comparable ones for the largest mean stiffness found on the coarse grid
    by_length : sums and means of stiffness by length of path, not by points. Off: eq. 4 counts points, and one path at
        several positions has the same points. Turn it on where a path's points are much denser here than there. The
        surface error is always by length, as in :mod:`machining.cutting.surface_error`

    Raises
    ------
    InputError
        No such aim.
    """

    aim: Aim = "ksf"
    force: CuttingForce = field(default_factory=lambda: ConstantForce(np.array([0.0, 0.0, -100.0])))
    criterion: Criterion | None = None
    by_length: bool = False

    def __post_init__(self) -> None:
        if self.aim not in AIMS:
            raise InputError("aim of the placement", value=self.aim, allowed=", ".join(AIMS))

    @property
    def minimised(self) -> bool:
        """Whether small is good."""
        return self.aim == "error"

    def share(self, path: ToolPath) -> Array:
        """Part (n,) of sums and means that each point stands for."""
        if self.by_length or self.minimised:
            return weights(path)
        return np.full(path.n, 1.0 / path.n)

    def with_criterion(self, criterion: Criterion) -> Goal:
        """The same with weights of K_sf."""
        return replace(self, criterion=criterion)

    def merit(self, value: Array, share: Array, n: int) -> Array:
        """Large is good (...): of stiffness (N/m) or surface error (m) ``value`` (..., m) at points with ``share``.

        ``n``: points of the whole path.
        """
        if self.aim == "worst":
            return np.asarray(value.min(axis=-1))
        if self.aim == "mean":
            return np.asarray(value @ share)
        if self.aim == "error":
            return np.asarray(-np.sqrt(value**2 @ share))
        return self.weights_of_ksf.value(value, share, n)

    @property
    def weights_of_ksf(self) -> Criterion:
        """The criterion; there must be one."""
        if self.criterion is None:
            raise InputError("weights of K_sf", value="none", remedy="give them, or use machining.placement.place")
        return self.criterion

    def gains(self, value: Array, n: int, slope: float) -> Array:
        """What each point adds per share, large is good (...): sums of it rank placements by pieces.

        K_sf is no sum; ``slope`` (mm/N) stands for its second term, see :func:`slopes`. For "worst" it is the value.
        """
        if self.aim == "error":
            return np.asarray(-(value**2))
        if self.aim != "ksf":
            return value
        k = value / N_PER_MM
        return np.asarray(self.weights_of_ksf.alpha * n * k**2 + slope * k)
