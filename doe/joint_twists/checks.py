"""Checks of an identification: hysteresis, the way up alone, and whether a diagonal matrix a joint is enough."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.linalg import block_diag
from scipy.stats import norm

from doe.joint_twists.identify import Identified
from doe.joint_twists.laws import Direction, Law
from fem.statics.ports import ROWS
from robots.arrays import Array, Bools
from robots.constants import NORMAL_95

# Cycles that load a row by less than this share of the most say little about its loop.
LOADED = 0.3
SIGNIFICANT = 0.05
# Coupling below this share of the two diagonal entries' geometric mean is small, even where it is proven.
SMALL = 0.1


@dataclass(frozen=True)
class Loop:
    """Hysteresis of one row of one joint.

    ``width`` (m or rad): up against down at the same load, positive where the way down reads more, mean over the
    ``cycles`` that load the row; ``spread``: its standard deviation, NaN where nothing tells the noise;
    ``share`` of the range (0 to the top load).
    ``loading_only``: stiffness from the way up alone over that from both, minus one.
    """

    joint: str
    row: str
    width: float
    spread: float
    share: float
    cycles: int
    loading_only: float

    @property
    def proven(self) -> bool:
        """Whether the width is beyond chance at 95 %."""
        return bool(abs(self.width) > NORMAL_95 * self.spread)


def loops(found: Identified) -> tuple[Loop, ...]:
    """Loops of every joint and row that was loaded and read both ways."""
    c, out = found.cycles, []
    for j, name in enumerate(found.names):
        for r, row in enumerate(ROWS):
            t = c.carried[:, r]
            mine = (c.joint == j) & np.isfinite(c.half_width[:, r]) & np.isfinite(c.slope[:, r])
            if not mine.any() or not np.abs(t[mine]).max() > 1e-6:
                continue
            mine &= np.abs(t) > LOADED * np.abs(t[mine]).max()
            sign = np.sign(t[mine])
            w = 1.0 / c.half_width_variance[mine, r]
            width = 2.0 * float(np.sum(w * sign * c.half_width[mine, r]) / np.sum(w))
            spread = 2.0 / float(np.sqrt(np.sum(w))) if c.noise_known[j, r // 3] else np.nan
            reach = float(np.sum(w * sign * c.slope[mine, r] * c.top[mine]) / np.sum(w))
            share = width / reach if reach != 0.0 else np.nan
            out.append(Loop(name, row, width, spread, share, int(mine.sum()), _loading(found, mine, r)))
    return tuple(out)


def _loading(found: Identified, mine: Bools, r: int) -> float:
    """Stiffness from the way up alone over that from both ways, minus one."""
    c = found.cycles
    w = c.carried[mine, r] / c.variance[mine, r]
    both, up = float(np.sum(w * c.slope[mine, r])), float(np.sum(w * c.loading[mine, r]))
    return both / up - 1.0 if up != 0.0 else np.nan


@dataclass(frozen=True)
class Coupling:
    """An entry off the diagonal of a joint's compliance: displacement of one row by the load of another.

    ``entry`` SI with ``spread``; ``share``: over the geometric mean of the two diagonal entries; ``p_value`` for zero.
    ``proven``: beyond chance with all entries of the campaign looked at (Holm 1979).
    """

    joint: str
    rows: tuple[str, str]
    entry: float
    spread: float
    share: float
    p_value: float
    proven: bool = False


@dataclass(frozen=True)
class DiagonalTest:
    """Whether a diagonal compliance is enough at a joint: its largest coupling, and which are proven."""

    joint: str
    couplings: tuple[Coupling, ...]

    @property
    def suffices(self) -> bool:
        """No coupling is both proven and larger than :data:`SMALL`."""
        return not any(c.proven and abs(c.share) > SMALL for c in self.couplings)


def diagonal_tests(found: Identified) -> tuple[DiagonalTest, ...]:
    """Added-variable test of every pair of rows at every joint: entry (a, b) = (b, a), constant over the angle.

    Weighted least squares with the laws of both rows free to follow, set-ups scattering together; entries are tested
    one at a time.
    """
    pairs = [(j, name, a, b) for j, name in enumerate(found.names) for a, b in combinations(range(6), 2)]
    tested = [one for one in (_coupling(found, *pair) for pair in pairs) if one is not None]
    proven = _holm(tested)
    marked = [replace(c, proven=(c.joint, *c.rows) in proven) for c in tested]
    watched = dict.fromkeys(c.joint for c in tested)
    return tuple(DiagonalTest(name, tuple(c for c in marked if c.joint == name)) for name in watched)


def _coupling(found: Identified, j: int, name: str, a: int, b: int) -> Coupling | None:
    laws = [found.directions[name, ROWS[r]] for r in (a, b)]
    if not all(found.cycles.noise_known[j, r // 3] for r in (a, b)):
        return None  # nothing tells what chance does
    one, other = _equations(found, j, a, b, laws[0].law), _equations(found, j, b, a, laws[1].law)
    if one is None or other is None:
        return None
    (Ja, xa, ya), (Jb, xb, yb) = one, other
    A = np.column_stack([block_diag(Ja, Jb), np.concatenate([xa, xb])])
    size = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    U, s, Vt = np.linalg.svd(A / size, full_matrices=False)
    # An added column that the laws can follow themselves cannot be tested.
    if s[-1] < 1e-6 * s[0]:
        return None
    x = Vt.T @ ((U.T @ np.concatenate([ya, yb])) / s)
    spread = float(np.linalg.norm(Vt[:, -1] / s) / size[-1])
    entry = float(x[-1] / size[-1])
    diagonal = float(np.sqrt(laws[0].mean * laws[1].mean))
    return Coupling(
        name, (ROWS[a], ROWS[b]), entry, spread, entry / diagonal, float(2.0 * norm.sf(abs(entry) / spread))
    )


def _equations(found: Identified, j: int, r: int, other: int, law: Law | None) -> tuple[Array, Array, Array] | None:
    """Whitened equations of row r: derivatives by its law's coefficients, the other row's load, and residuals."""
    c = found.cycles
    if law is None:
        return None
    mine = np.flatnonzero((c.joint == j) & np.isfinite(c.slope[:, r]))
    angle, t, v = c.angle[mine], c.carried[mine, r], c.variance[mine, r]
    f = law.value(angle)
    rows = np.column_stack([law.slopes(angle) * t[:, None], c.carried[mine, other], c.slope[mine, r] - f * t])
    for s in np.unique(c.setup[mine]):
        k = c.setup[mine] == s
        common = found.scatter[r // 3] * f[k] * t[k]
        L = np.linalg.cholesky(np.diag(v[k]) + np.outer(common, common))
        rows[k] = np.linalg.solve(L, rows[k])
    return rows[:, :-2], rows[:, -2], rows[:, -1]


def _holm(tests: list[Coupling]) -> set[tuple[str, str, str]]:
    out: set[tuple[str, str, str]] = set()
    for k, c in enumerate(sorted(tests, key=lambda one: one.p_value)):
        if c.p_value > SIGNIFICANT / (len(tests) - k):
            break
        out.add((c.joint, *c.rows))
    return out


@dataclass(frozen=True)
class BendingRatio:
    """Twist about X over twist about the gear axis of one joint under the same moment, with its 95 % interval."""

    joint: str
    ratio: float
    low: float
    high: float


def bending_ratio(directions: Mapping[tuple[str, str], Direction], joint: str, row: str = "rx") -> BendingRatio | None:
    """The paper's finding at joint 2 (0.010 over 0.017 deg): compliance about X over that about the gear axis.

    From the means over all set-ups; None where one of the two is not determined.
    """
    across, axial = directions[joint, row], directions[joint, "rz"]
    if across.status != "determined" or axial.status != "determined":
        return None
    ratio = across.mean / axial.mean
    relative = across.quantile * float(np.hypot(across.spread / across.mean, axial.spread / axial.mean))
    return BendingRatio(joint, ratio, ratio * (1.0 - relative), ratio * (1.0 + relative))
