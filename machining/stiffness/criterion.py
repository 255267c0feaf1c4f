"""The stiffness criterion K_sf of a toolpath, by which positions of a robot's base are compared.

``K_sf = alpha sum k_i^2 + beta (mean k_i)^4``, eq. 4 of "Postprocessor for Verification of Robot Movements with
Additional Axis after Toolpath Optimization" (Staubli TX200 on linear axes). ``k_i`` is the directional stiffness in
the direction of the cutting force at point i, in N/mm; alpha is in mm^2/N^2 and beta in mm^4/N^4, so K_sf is a pure
number.

The paper gives no weights. With alpha = beta the second term is k^2 / n times the first: some 1e4 for 1000 N/mm and 100
points, and the first has no say. :meth:`Criterion.comparable` makes both terms 1 at a stiffness of reference.

The sum runs over points, so a path that is sampled more densely scores higher, and densely sampled stretches count
more. For one path at several base positions the first does no harm; against the second give ``share``: the part of
the path's length that each point stands for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from robots import InputError, require_at_least, require_positive
from robots.arrays import Array

# N/m for one N/mm, the paper's unit of stiffness.
N_PER_MM = 1e3
# Shares must add up to 1 this well.
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Terms:
    """The two terms of K_sf, pure numbers: ``squares`` = alpha sum k^2, ``mean`` = beta (mean k)^4; arrays (...)."""

    squares: Array
    mean: Array

    @property
    def value(self) -> Array:
        """K_sf (...)."""
        return np.asarray(self.squares + self.mean)


@dataclass(frozen=True)
class Criterion:
    """Weights of K_sf: ``alpha`` mm^2/N^2 and ``beta`` mm^4/N^4.

    Raises
    ------
    InputError
        Weights that are negative or not finite, or both zero.
    """

    alpha: float
    beta: float

    def __post_init__(self) -> None:
        for name, unit, value in (("alpha", "mm^2/N^2", self.alpha), ("beta", "mm^4/N^4", self.beta)):
            require_at_least(f"weight {name} of K_sf", value, 0.0, unit, "leave it out", code="G004")
        if self.alpha == 0.0 and self.beta == 0.0:
            raise InputError(
                "weights of K_sf", code="G004", value="both 0", allowed="one of them above 0", remedy="leave them out"
            )

    @classmethod
    def comparable(cls, stiffness: float, n: int) -> Criterion:
        """Weights that make both terms 1 for n points of one ``stiffness`` (N/m): 1 / (n k^2) and 1 / k^4.

        Raises
        ------
        InputError
            A stiffness that is not positive and finite, or no point.
        """
        require_positive("stiffness of reference for K_sf", stiffness, "N/m", code="G004")
        require_at_least("points of the path", n, 1, code="G004")
        k = stiffness / N_PER_MM
        return cls(1.0 / (n * k**2), 1.0 / k**4)

    def terms(self, stiffness: ArrayLike, share: Array | None = None, n: int | None = None) -> Terms:
        """Both terms for stiffnesses (..., m) N/m at the points of a path.

        Parameters
        ----------
        share : (m,) part of the mean that each point stands for, adding up to 1; None: all the same, as in the paper
        n : points that the sum counts; None: m. Knots that stand for more points than they are give these

        Raises
        ------
        InputError
            No points, a stiffness that is not positive, or shares that do not fit.
        """
        k = np.asarray(stiffness, dtype=np.float64) / N_PER_MM
        if k.ndim < 1 or k.shape[-1] == 0 or not (k > 0.0).all():
            raise InputError(
                "stiffness along the path", code="G004", value=f"shape {k.shape}", allowed="more than 0 N/m, a point"
            )
        m = k.shape[-1]
        w = np.full(m, 1.0 / m) if share is None else np.asarray(share, dtype=np.float64)
        if w.shape != (m,) or not (w >= 0.0).all() or abs(w.sum() - 1.0) > ROUNDING:
            raise InputError(
                "shares of the points", code="G004", value=f"shape {w.shape}", allowed=f"({m},), adding up to 1"
            )
        count = m if n is None else n
        return Terms(np.asarray(self.alpha * count * (k**2 @ w)), np.asarray(self.beta * (k @ w) ** 4))

    def value(self, stiffness: ArrayLike, share: Array | None = None, n: int | None = None) -> Array:
        """K_sf (...); arguments and errors as :meth:`terms`."""
        return self.terms(stiffness, share, n).value

    def slope(self, mean: float) -> float:
        """Slope of the second term over the mean stiffness (mm/N), at a mean stiffness (N/m)."""
        return float(4.0 * self.beta * (mean / N_PER_MM) ** 3)
