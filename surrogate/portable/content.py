"""What is written into a portable surrogate, and what each of them must answer."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Literal, get_args

import numpy as np

from robots.arrays import Array, Integers
from robots.errors import InputError, require_one_of
from robots.robot import LIMIT_TOLERANCE_RAD
from surrogate.expansion import Expansion
from surrogate.model import Factor
from surrogate.scope import Scope

Link = Literal["identity", "exp", "squares", "factor"]

LINKS: tuple[Link, ...] = get_args(Link)
# Links that sum up rows.
ROWS = ("squares", "factor")
SCHEMA = "stiffarm-portable/1"


class Status(IntEnum):
    """How a query ended, in every language. Of several faults the angles.s own come first: 3, 1, 2."""

    OK = 0
    OUTSIDE_DOMAIN = 1
    COUPLINGS_BROKEN = 2
    NOT_FINITE = 3


@dataclass(frozen=True, eq=False, kw_only=True)
class Portable(Scope):
    """A surrogate with all that a stranger needs to know of it.

    With ``s = expansion(q)``, (s,) at each pose, the quantity is

    - link 'identity': s;
    - link 'exp': ``exp(s)``, so it is positive;
    - link 'squares': ``sum_r w_r s_r^2``, so it is not negative;
    - link 'factor': ``sum_r w_r l_r^T l_r`` with rows l (r, 6), the numbers of s row by row: a symmetric, positive
      semidefinite 6 x 6.

    Angles outside of the domain or the couplings, or not finite, get no value. They are given in radians, even where
    the name of an input says deg.

    Parameters
    ----------
    expansion, link : the function
    factor : weights w_r of the rows, for the links 'squares' and 'factor' and only these
    name : what functions and files are called after; made a valid identifier where one is needed
    quantity, unit : as in 'compliance' and 'm/N'
    notes : further lines for the reader, the meaning of error bars among them
    errors : name -> held-out error, as in 'rms_relative' -> 0.001

    Raises
    ------
    InputError
        As for `Scope`; also parts that do not fit together, an unknown link, errors that are not finite.
    """

    expansion: Expansion
    link: Link
    factor: Factor | None = None
    name: str
    quantity: str
    unit: str
    notes: tuple[str, ...] = ()
    errors: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        k = len(self.inputs)
        require_one_of("portable surrogate: link", self.link, LINKS, code="F007")
        if any(part.n_inputs != k for part in self.sums):
            raise InputError("portable surrogate: expansions", code="F007", allowed=f"functions of the {k} inputs")
        if (self.link in ROWS) != (self.factor is not None):
            raise InputError(
                "portable surrogate: factor", code="F007", allowed=f"for the links {', '.join(ROWS)}, and only there"
            )
        numbers = self.expansion.n_outputs
        if self.factor is not None and numbers != len(self.factor.group) * (6 if self.link == "factor" else 1):
            raise InputError(
                "portable surrogate: numbers of a factor",
                code="F007",
                value=numbers,
                allowed="one for each row, or six",
            )
        if not np.isfinite(list(self.errors.values())).all():
            raise InputError(
                "portable surrogate: errors", code="F007", value=dict(self.errors), allowed="finite numbers"
            )

    @property
    def row_weights(self) -> Integers:
        """Of each row (r,): 0 for a weight of 1, otherwise 1 + the number of its weight."""
        return np.zeros(self.expansion.n_outputs, dtype=np.int64) if self.factor is None else self.factor.group + 1

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the quantity at one pose: (6, 6) for the link 'factor', (1,) for 'squares', otherwise (m,)."""
        if self.link in ROWS:
            return (6, 6) if self.link == "factor" else (1,)
        return (self.expansion.n_outputs,)

    @property
    def sums(self) -> tuple[Expansion, ...]:
        """All expansions: the surrogate's, then those of the weights."""
        return (self.expansion, *(() if self.factor is None else self.factor.weights))

    @property
    def n_values(self) -> int:
        """Numbers at each pose."""
        return int(np.prod(self.shape))

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper limits of the inputs (k,), widened by a rounding error."""
        return self.lower - LIMIT_TOLERANCE_RAD, self.upper + LIMIT_TOLERANCE_RAD

    @property
    def coupled_bounds(self) -> tuple[Array, Array]:
        """Lower and upper limits of the couplings (c,), widened by a rounding error."""
        c = self.couplings
        return c.lower - LIMIT_TOLERANCE_RAD, c.upper + LIMIT_TOLERANCE_RAD


def content_hash(portable: Portable) -> str:
    """SHA-256 (hex) of all that decides the values: functions, terms, coefficients, link, domain and couplings."""
    p, c = portable, portable.couplings
    digest = hashlib.sha256()
    shapes = [[e.terms.shape, e.coefficients.shape, [f.matrix.shape for f in e.families]] for e in p.sums]
    families = [[(f.periodic, f.harmonics, *f.degrees) for f in e.families] for e in p.sums]
    digest.update(repr((SCHEMA, p.link, *p.inputs, families, shapes, c.matrix.shape, p.row_weights.tolist())).encode())
    for e in p.sums:
        digest.update(np.ascontiguousarray(e.terms, dtype="<i8").tobytes())
        figures = [v for f in e.families for v in (np.array([f.centre, f.half_range]), f.matrix)]
        for values in (*figures, e.coefficients):
            digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    for values in (p.lower, p.upper, c.matrix, c.lower, c.upper):
        digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    return digest.hexdigest()
