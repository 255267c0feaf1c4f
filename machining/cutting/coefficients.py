"""Cutting coefficients of the linear edge force model, and published sets with where they were found.

``dF = (K_c h + K_e) dz`` along the tangent, the radius and the axis (Altintas, Manufacturing Automation, 2nd ed. 2012,
chapter 2), h the chip thickness, dz the depth along the tool axis. A set holds for its alloy, tool material, rake and
helix, wear, and range of speed and feed: figures for the same alloy differ by a factor of two between sources.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import numpy as np

from robots import InputError, require_at_least, require_one_of, require_positive
from robots.arrays import Array

NAMES: Final = ("K_tc", "K_te", "K_rc", "K_re", "K_ac", "K_ae")
UNITS: Final = ("Pa", "N/m") * 3
# Chip coefficients come in N/mm^2, edge coefficients in N/mm.
FROM_SHOP: Final = np.array([1e6, 1e3] * 3)


@dataclass(frozen=True, eq=False)
class CuttingCoefficients:
    """``values`` (6,): K_tc, K_te, K_rc, K_re, K_ac, K_ae; chip coefficients Pa, edge coefficients N/m.

    ``source``: where they come from. ``others`` (k, 6): what other sources give for the same alloy, None where these
    are not from a publication but one's own.

    Raises
    ------
    InputError
        Not six finite numbers, or a tangential chip coefficient that is not positive. Others may be negative: fits
        to measured forces give that.
    """

    values: Array
    source: str
    others: Array | None = None

    def __post_init__(self) -> None:
        values = np.asarray(self.values, dtype=np.float64)
        if values.shape != (6,) or not np.isfinite(values).all():
            raise InputError(
                "cutting coefficients",
                code="K005",
                value=values.tolist(),
                allowed=f"6 finite numbers: {', '.join(NAMES)}",
            )
        require_positive("cutting coefficient K_tc", float(values[0]), "Pa", code="K005")
        object.__setattr__(self, "values", values)


@dataclass(frozen=True)
class PlungeCoefficients:
    """Of the end teeth (:mod:`machining.cutting.plunging`): ``chip`` Pa, ``edge`` N/m, ``source``; ``relative_sd``.

    Raises
    ------
    InputError
        A chip coefficient that is not positive, an edge coefficient or an uncertainty below 0.
    """

    chip: float
    edge: float
    source: str
    relative_sd: float = 0.1

    def __post_init__(self) -> None:
        require_positive("plunging coefficient K_pc", self.chip, "Pa", code="K005")
        require_at_least("plunging coefficient K_pe", self.edge, 0.0, "N/m", code="K005")
        require_at_least("relative standard deviation of plunging coefficients", self.relative_sd, 0.0, code="K005")


def shop_coefficients(
    tc_N_per_mm2: float,
    te_N_per_mm: float,
    rc_N_per_mm2: float,
    re_N_per_mm: float,
    ac_N_per_mm2: float = 0.0,
    ae_N_per_mm: float = 0.0,
    *,
    source: str,
) -> CuttingCoefficients:
    """Coefficients from the shop's units. Errors as :class:`CuttingCoefficients`."""
    shop = np.array([tc_N_per_mm2, te_N_per_mm, rc_N_per_mm2, re_N_per_mm, ac_N_per_mm2, ae_N_per_mm])
    return CuttingCoefficients(shop * FROM_SHOP, source)


_REVIEW: Final = (
    "review table, doi:10.1186/s10033-021-00536-9, Table 5 (read; it heads edge coefficients N.mm, taken as N/mm); "
    "carbide, dry; its ref. "
)

PUBLISHED: Final = MappingProxyType(
    {
        "al6082-t6": shop_coefficients(631.0, 13.0, 99.0, 10.0, 273.0, 2.8, source=_REVIEW + "189"),
        "al7075-t6": shop_coefficients(767.01, 27.7, 168.8, 26.6, 222.0, 0.7, source=_REVIEW + "190"),
        "al7075": shop_coefficients(1319.41, 19.65, 788.83, 26.77, 48.75, 2.05, source=_REVIEW + "47"),
        "ti6al4v": shop_coefficients(
            1825.0, 29.7, 770.0, 55.7, 735.0, 1.8, source="recalled (work of Altintas and others), not verified"
        ),
    }
)
"""Published sets by name. The two of Al 7075 differ by a factor of 1.7 in K_tc: that is how far such figures carry."""


def published(name: str) -> CuttingCoefficients:
    """A set of :data:`PUBLISHED`, with the other sets of its alloy, whatever their temper.

    Raises
    ------
    InputError
        No such set.
    """
    require_one_of("cutting coefficients", name, PUBLISHED, code="K005")
    alloy = name.partition("-")[0]
    others = [one.values for key, one in PUBLISHED.items() if key != name and key.partition("-")[0] == alloy]
    return replace(PUBLISHED[name], others=np.array(others).reshape(-1, 6))
