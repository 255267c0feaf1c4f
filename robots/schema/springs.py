"""Springs in a model file: laws over joint angles, and places that give way in six directions."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, Literal, Self, get_args

import numpy as np
from pydantic import Discriminator, Tag, model_validator

from robots.arrays import Array
from robots.schema.quantities import Compliance, RotationalStiffness, Strict, TranslationalStiffness
from robots.schema.units import check_magnitude

# A power of a scaled angle beyond these says nothing of a spring, and overflows.
HIGHEST_EXPONENT, NARROWEST_deg = 20, 1e-3


class LogPolynomialLaw(Strict):
    """Angle-dependent spring: ln(k / (N m/rad)) is a polynomial in scaled joint coordinates.

    ``k = exp(sum_t c_t prod_i u_i^e_ti)``, ``u_i = (q_i - centre_i) / half_range_i``; k stays positive.
    """

    kind: Literal["log-polynomial"] = "log-polynomial"
    inputs: tuple[str, ...]
    centre_deg: tuple[float, ...]
    half_range_deg: tuple[float, ...]
    exponents: tuple[tuple[int, ...], ...]
    coefficients: tuple[float, ...]
    source: str

    @model_validator(mode="after")
    def _shapes_agree(self) -> Self:
        n = len(self.inputs)
        if len(self.centre_deg) != n or len(self.half_range_deg) != n:
            raise ValueError("centre_deg and half_range_deg need one number for each input")
        if any(len(row) != n for row in self.exponents) or len(self.exponents) != len(self.coefficients):
            raise ValueError("exponents need one row for each coefficient and one column for each input")
        if any(not 0 <= e <= HIGHEST_EXPONENT for row in self.exponents for e in row):
            raise ValueError(f"exponents must be 0 to {HIGHEST_EXPONENT}")
        if any(not h >= NARROWEST_deg for h in self.half_range_deg):
            raise ValueError(f"half_range_deg must be {NARROWEST_deg:g} or more")
        return self


class LogFourierLaw(Strict):
    """Angle-dependent spring: ln(k / (N m/rad)) = c0 + sum_m (c_{2m-1} cos m q + c_2m sin m q) of one coordinate."""

    kind: Literal["log-fourier"]
    input: str
    coefficients: tuple[float, ...]
    source: str

    @model_validator(mode="after")
    def _odd(self) -> Self:
        if len(self.coefficients) % 2 == 0:
            raise ValueError("coefficients need an odd number: the mean, then a cosine and a sine for each order")
        return self

    @property
    def inputs(self) -> tuple[str, ...]:
        """The joint coordinates it depends on."""
        return (self.input,)


class TableLaw(Strict):
    """Angle-dependent spring: ln k is linear between nodes of one coordinate, constant beyond the ends."""

    kind: Literal["table"]
    input: str
    nodes_deg: tuple[float, ...]
    stiffness_Nm_per_rad: tuple[float, ...]  # noqa: N815
    source: str

    @model_validator(mode="after")
    def _a_table(self) -> Self:
        if len(self.nodes_deg) != len(self.stiffness_Nm_per_rad) or len(self.nodes_deg) < 2:
            raise ValueError("nodes_deg and stiffness_Nm_per_rad need as many numbers, two or more")
        if any(b <= a for a, b in pairwise(self.nodes_deg)):
            raise ValueError("nodes_deg must rise")
        for k in self.stiffness_Nm_per_rad:
            check_magnitude("rotational stiffness", "N m/rad", k, positive=True)
        return self

    @property
    def inputs(self) -> tuple[str, ...]:
        """The joint coordinates it depends on."""
        return (self.input,)


SpringLawTable = LogPolynomialLaw | LogFourierLaw | TableLaw


def _spring_kind(value: Any) -> str:
    keys = value if isinstance(value, dict) else {}
    kind = keys.get("kind", getattr(value, "kind", None))
    if kind in ("log-fourier", "table"):
        return str(kind)
    law = isinstance(value, LogPolynomialLaw) or "kind" in keys or "coefficients" in keys
    return "law" if law else "constant"


# Told apart before validation: otherwise one slip in a constant is reported as eight faults of a law.
Spring = Annotated[
    Annotated[RotationalStiffness, Tag("constant")]
    | Annotated[LogPolynomialLaw, Tag("law")]
    | Annotated[LogFourierLaw, Tag("log-fourier")]
    | Annotated[TableLaw, Tag("table")],
    Discriminator(_spring_kind),
]


Row = Literal["tx", "ty", "tz", "rx", "ry", "rz"]


class ComplianceEntry(Strict):
    """An entry of a place's compliance matrix off the diagonal (and its mirror image)."""

    rows: tuple[Row, Row]
    compliance: Compliance

    @model_validator(mode="after")
    def _off_the_diagonal(self) -> Self:
        if self.rows[0] == self.rows[1]:
            raise ValueError("rows must differ: on the diagonal stands one over the stiffness")
        turns = sum(row.startswith("r") for row in self.rows)
        allowed = (("m/N", "mm/N"), ("rad/N",), ("rad/(N m)",))[turns]
        if self.compliance.unit not in allowed:
            raise ValueError(f"rows {self.rows[0]}, {self.rows[1]} need a compliance in {' or '.join(allowed)}")
        return self


class BearingLaws(Strict):
    """Stiffness across a joint's axis that varies with a joint's angle, direction by direction.

    ln k as :class:`LogFourierLaw` has it, of N/m for tx, ty, tz and of N m/rad for rx, ry. It gives way on top of what
    ``bearing`` holds.
    """

    tx: LogFourierLaw | None = None
    ty: LogFourierLaw | None = None
    tz: LogFourierLaw | None = None
    rx: LogFourierLaw | None = None
    ry: LogFourierLaw | None = None

    @property
    def given(self) -> tuple[tuple[int, LogFourierLaw], ...]:
        """Row (0 to 4) and law of those that are given."""
        laws = (self.tx, self.ty, self.tz, self.rx, self.ry)
        return tuple((row, law) for row, law in enumerate(laws) if law is not None)


class PlaceStiffness(Strict):
    """Stiffness of a place in six directions of its own axes; what is not given is rigid.

    The diagonal entry of the compliance is one over the stiffness; ``entry`` adds those off the diagonal.
    """

    tx: TranslationalStiffness | None = None
    ty: TranslationalStiffness | None = None
    tz: TranslationalStiffness | None = None
    rx: RotationalStiffness | None = None
    ry: RotationalStiffness | None = None
    rz: RotationalStiffness | None = None
    entry: tuple[ComplianceEntry, ...] = ()

    @property
    def compliance(self) -> Array:
        """The compliance matrix (6, 6), SI, forces before moments."""
        given = (self.tx, self.ty, self.tz, self.rx, self.ry, self.rz)
        C = np.diag([0.0 if k is None else 1.0 / k.si for k in given])
        names = get_args(Row)
        for entry in self.entry:
            a, b = (names.index(row) for row in entry.rows)
            C[a, b] = C[b, a] = entry.compliance.si
        return C
