"""What is written into a portable surrogate, and what each of them must answer."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Literal, get_args

import numpy as np

from robots.arrays import Array, Integers
from robots.errors import InputError
from robots.robot import LIMIT_TOLERANCE_RAD
from surrogate.expansion import Expansion
from surrogate.scope import Couplings

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
class Portable:
    """A surrogate with all that a stranger needs to know of it.

    With ``s = expansion(q)``, (s,) at each pose, the quantity is

    - link 'identity': s;
    - link 'exp': ``exp(s)``, so it is positive;
    - link 'squares': ``sum_r w_r s_r^2``, so it is not negative;
    - link 'factor': ``sum_r w_r l_r^T l_r`` with rows l (r, 6), the numbers of s row by row: a symmetric, positive
      semidefinite 6 x 6.

    Weights w_r are 1, or ``exp(weights[group[r]](q))``.

    Angles outside of the domain or the couplings, or not finite, get no value.

    Parameters
    ----------
    expansion, link : the function
    name : what functions and files are called after; made a valid identifier where one is needed
    quantity, unit : as in 'compliance' and 'm/N'
    inputs : (k,) names of the joint angles, as in 'q2_deg'; angles are given in radians all the same
    lower, upper : (k,) rad, the domain; may be infinite
    couplings : limits on sums of inputs
    robot, model_hash : name of the robot, and content hash of the model that the surrogate was fitted to
    fixed_deg : the other coordinates of the robot, name -> degrees
    notes : further lines for the reader, the meaning of error bars among them
    errors : name -> held-out error, as in 'rms_relative' -> 0.001
    weights : (g,) expansions, one number each, of the logarithms of the rows' weights
    group : (r,) which weight belongs to each row, -1 for a weight of 1; empty: 1 for all

    Raises
    ------
    InputError
        Parts that do not fit together, an unknown link, a domain that is empty, numbers that are not finite.
    """

    expansion: Expansion
    link: Link
    name: str
    quantity: str
    unit: str
    inputs: tuple[str, ...]
    lower: Array
    upper: Array
    couplings: Couplings
    robot: str
    model_hash: str
    fixed_deg: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    errors: Mapping[str, float] = field(default_factory=dict)
    weights: tuple[Expansion, ...] = ()
    group: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        for name in ("lower", "upper"):
            object.__setattr__(self, name, _frozen(getattr(self, name)))
        k = self.expansion.n_inputs
        if self.link not in LINKS:
            raise InputError("portable surrogate: link", value=self.link, allowed=", ".join(LINKS))
        self._check_weights()
        if self.link == "factor" and self.expansion.n_outputs % 6:
            raise InputError(
                "portable surrogate: numbers of a factor", value=self.expansion.n_outputs, allowed="a multiple of 6"
            )
        if len(self.inputs) != k or len(set(self.inputs)) < k:
            raise InputError("portable surrogate: inputs", value=list(self.inputs), allowed=f"{k} different names")
        if self.lower.shape != (k,) or self.upper.shape != (k,) or not np.all(self.lower <= self.upper):
            raise InputError("portable surrogate: domain", allowed=f"lower <= upper for each of {k} inputs")
        if self.couplings.matrix.shape[1] != k:
            raise InputError("portable surrogate: couplings", allowed=f"one factor for each of {k} inputs")
        for what, values in (("fixed_deg", self.fixed_deg), ("errors", self.errors)):
            if not np.isfinite(list(values.values())).all():
                raise InputError(f"portable surrogate: {what}", value=dict(values), allowed="finite numbers")

    def _check_weights(self) -> None:
        object.__setattr__(self, "group", tuple(int(g) for g in self.group))
        g = len(self.weights)
        if any(w.n_inputs != self.expansion.n_inputs or w.n_outputs != 1 for w in self.weights):
            raise InputError("portable surrogate: weights", allowed="expansions of the same inputs, one number each")
        if (self.weights or self.group) and self.link not in ROWS:
            raise InputError("portable surrogate: weights", allowed=f"for the links {', '.join(ROWS)} only")
        rows = self.expansion.n_outputs // (6 if self.link == "factor" else 1)
        if len(self.group) not in (0, rows) or not all(-1 <= i < g for i in self.group) or (g and not self.group):
            raise InputError(
                "portable surrogate: group", value=list(self.group), allowed=f"-1 to {g - 1}, {rows} times"
            )

    @property
    def row_weights(self) -> Integers:
        """Of each row (r,): 0 for a weight of 1, otherwise 1 + the number of its weight."""
        rows = self.expansion.n_outputs // (6 if self.link == "factor" else 1)
        return np.array(self.group or (-1,) * rows, dtype=np.int64) + 1

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the quantity at one pose: (6, 6) for the link 'factor', (1,) for 'squares', otherwise (m,)."""
        if self.link in ROWS:
            return (6, 6) if self.link == "factor" else (1,)
        return (self.expansion.n_outputs,)

    @property
    def sums(self) -> tuple[Expansion, ...]:
        """All expansions: the surrogate's, then those of the weights."""
        return (self.expansion, *self.weights)

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


def reference(portable: Portable, Q: Array) -> tuple[Array, Integers]:
    """What every portable form must answer: Q (n, k) rad -> values (n, *shape), NaN without one, and status (n,)."""
    poses = np.asarray(Q, dtype=np.float64)
    lower, upper = portable.bounds
    coupled_lower, coupled_upper = portable.coupled_bounds
    status = np.full(len(poses), int(Status.OK))
    with np.errstate(invalid="ignore", over="ignore"):
        sums = poses @ portable.couplings.matrix.T
        status[~((sums >= coupled_lower) & (sums <= coupled_upper)).all(axis=1)] = Status.COUPLINGS_BROKEN
        status[~((poses >= lower) & (poses <= upper)).all(axis=1)] = Status.OUTSIDE_DOMAIN
        status[~np.isfinite(poses).all(axis=1)] = Status.NOT_FINITE
        good = status == Status.OK
        s = portable.expansion(poses[good])
        if portable.link == "exp":
            s = np.exp(s)
        elif portable.link in ROWS:
            weights = [np.exp(w(poses[good])) for w in portable.weights]
            w = np.hstack([np.ones((len(s), 1)), *weights])[:, portable.row_weights, None]
            L = s.reshape(len(s), len(portable.row_weights), -1)
            C = np.swapaxes(L, 1, 2) @ (w * L)
            s = 0.5 * (C + np.swapaxes(C, 1, 2))
    values = np.full((len(poses), *portable.shape), np.nan)
    values[good] = s.reshape(-1, *portable.shape)
    broken = good & ~np.isfinite(values).reshape(len(values), -1).all(axis=1)
    status[broken], values[broken] = Status.NOT_FINITE, np.nan
    return values, status


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


def _frozen(values: Array) -> Array:
    out = np.array(values, dtype=np.float64)
    out.flags.writeable = False
    return out
