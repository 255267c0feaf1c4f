"""Readings held against all passive arms of the model's geometry: those that tell nothing, columns that stand still.

A calibration answers whatever it is given: of readings with every second sign flipped it makes springs at their rigid
end and a large noise. So readings are first held against all passive arms of the model's geometry
(:class:`PassiveArm`). Where what the nearest one leaves is below half of the readings, they are deflections of such an
arm with some noise. Where it is more, they must follow the arm better than chance would: better than the same readings
with the signs of whole rows drawn at random (a passive arm gives along its loads), and better than with rows exchanged
at random (it gives by pose and load). Both are tests by randomisation (Fisher 1935; Edgington and Onghena,
Randomization Tests, 4th ed.), exact whatever the noise is distributed like.

Readings stand still while the arm gives way where a gauge does not touch, sticks, or was never connected. A column that
shows one value in all set-ups is right where the arm does nothing else there (across the plane of its links, about an
axis without a lever, at angles that only turn the whole arm). Where no arm that comes near the other columns keeps this
one still, it is the gauge that stands.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from doe.estimation.problem import Problem, problem
from doe.tables.columns import DISPLACEMENTS
from doe.tables.joined import files_of
from doe.tables.measurements import Measurements
from fem import ArmModel, spring_influence
from robots import InputError
from robots.arrays import Array, Indices, Integers
from robots.errors import raise_any

# Scatter of less than this share of the readings leaves no doubt that they follow the arm: random readings get there
# by chance once in some thousand tables of nine. Gauges at robots scatter by 1 to 30 % of what they read.
NOISY = 0.5
# Readings that scatter by more must follow the arm better than all but this share of their random variants.
LEVEL = 0.01
DRAWS = 499
# Sums of squares that differ by less (relative) are the same.
ROUNDING = 1e-9
# Ways of giving that move readings by less than this share of what the strongest one does are rounding.
BLIND = 1e-12
# A column stands still against the arm where the nearest arm departs from it by more than a digit of the readings and
# by more than this share of what was read, of few set-ups more, for two or three may read the same by chance: two loads
# of which one is twice the other are enough.
STILL, FEW = 0.1, 0.6
# Digits of a millimetre (or mrad) beyond which none was read.
MOST_DIGITS = 6
# By which a rotation is compared with translations, m: about the reach at which they were read.
LEVER_M = 1.0


@dataclass(frozen=True)
class PassiveArm:
    """m read components beside what a passive arm can do, whatever its springs: the yardstick for readings.

    A passive arm gives way by ``d = sum_j c_j a_j`` with compliances c_j >= 0: ``a_j`` what a spring about joint j's
    axis gives (:func:`fem.statics.flexibility.spring_influence`), what the links give, free to be more or less than
    the model has it, and something in series with the arm that gives along the force (tool, fixture, foundation).
    Readings that no such arm comes near are no deflections of this arm, whatever numbers a calibration makes of them.

    ``ways`` (m, k): what each way of giving adds to the readings, per unit of it (m or rad); ``value`` (m,) as read;
    ``row`` (m,): reading it belongs to, ``component`` (m,): 0..5; ``setup`` (n, d): joints, load and point of each
    reading.
    """

    ways: Array
    value: Array
    row: Integers
    component: Integers
    setup: Array

    @staticmethod
    def of(p: Problem) -> PassiveArm:
        """The arm with a problem's geometry, links and load path, and the problem's readings."""
        at = p.free.at
        influence, rest = spring_influence(p.free.model, at.q, at.wrench, at.point)
        series = np.where(p.component < 3, at.wrench[p.row, p.component], 0.0)
        ways = np.column_stack([influence[p.row, :, p.component], rest[p.row, p.component], series])
        return PassiveArm(ways, p.value, p.row, p.component, np.column_stack([at.q, at.wrench, at.point]))

    def over(self, size: Array) -> PassiveArm:
        """The same with readings over ``size`` (m,), and each way of giving of length one; blind ones are left out."""
        ways = self.ways / size[:, None]
        norm = np.linalg.norm(ways, axis=0)
        seen = norm > BLIND * max(float(norm.max(initial=0.0)), 1e-300)
        return PassiveArm(ways[:, seen] / norm[seen], self.value / size, self.row, self.component, self.setup)

    def fit(self) -> tuple[Array, int]:
        """Readings (m,) of the passive arm nearest to what was read, and in how many ways it gives."""
        if not self.ways.shape[1]:
            return np.zeros(len(self.value)), 0
        amount, _ = nnls(self.ways, self.value)
        return np.asarray(self.ways @ amount), int(np.count_nonzero(amount))


@dataclass(frozen=True)
class Told:
    """What readings tell.

    ``scatter``: what the nearest passive arm leaves of them, over their RMS, at most 1 (NaN: none spare). ``by_sign``,
    ``by_order``: share of the draws with random signs, and with rows exchanged, that follow the arm better than the
    readings as they stand; NaN where it was not asked.
    """

    anything: bool
    readings: int
    scatter: float = math.nan
    by_sign: float = math.nan
    by_order: float = math.nan

    @property
    def words(self) -> str:
        """Why the readings tell nothing, in a phrase."""
        share, drawn = max(
            (self.by_sign, "with signs drawn at random"), (self.by_order, "in another order of the rows")
        )
        return (
            f"the springs that fit them best leave {100.0 * self.scatter:.0f} % of their size (RMS) unexplained, and "
            f"in {100.0 * share:.0f} of 100 trials the same readings {drawn} fit better"
        )


def told_by(p: Problem) -> Told:
    """Hold the readings of a problem against all passive arms of its geometry.

    The same readings in another order of rows give the same answer.
    """
    arm = PassiveArm.of(p)
    scaled = arm.over(_sizes(arm))
    f, ways = scaled.fit()
    spare = len(f) - ways
    if spare <= 0:
        return Told(True, len(f))
    energy = float(scaled.value @ scaled.value)
    left = float(np.sum((scaled.value - f) ** 2))
    # With many numbers for few readings the estimate can exceed all that was read, which is not possible.
    scatter = min(math.sqrt(left / spare * len(f) / energy), 1.0) if energy > 0.0 else 1.0
    if scatter <= NOISY:
        return Told(True, len(f), scatter)
    by_sign, by_order = _by_chance(scaled, energy - left)
    return Told(max(by_sign, by_order) <= LEVEL, len(f), scatter, by_sign, by_order)


def refuse_telling_nothing(p: Problem, source: str) -> None:
    """Refuse readings that tell nothing about the arm.

    Raises
    ------
    InputError
        Their scatter is of the size of the readings themselves, and chance would do as well.
    """
    told = told_by(p)
    if told.anything:
        return
    raise InputError(
        f"{source}: these {told.readings} readings tell nothing about the arm: {told.words}",
        code="T013",
        allowed=f"at most {100.0 * NOISY:g} % unexplained, or {100.0 * LEVEL:g} of 100 such trials that fit better",
        remedy="check signs, the order of the rows, which column is which, loads and joint angles; "
        "else measure again with larger loads",
    )


def _sizes(arm: PassiveArm) -> Array:
    """RMS (m,) of what was read of each one's kind, translations and rotations; 1 where all of them are 0."""
    size = np.ones(len(arm.value))
    for kind in (arm.component < 3, arm.component >= 3):
        if arm.value[kind].any():
            size[kind] = np.sqrt(np.mean(arm.value[kind] ** 2))
    return size


def _by_chance(arm: PassiveArm, explained: float) -> tuple[float, float]:
    """Shares of the draws that explain more than ``explained``: with signs of rows, and with rows exchanged."""
    if explained <= ROUNDING * float(arm.value @ arm.value):
        return 1.0, 1.0
    row = np.unique(arm.row, return_inverse=True)[1]
    table = np.full((int(row.max()) + 1, 6), np.nan)
    table[row, arm.component] = arm.value
    # Rows in an order of their own, so that it does not matter how they stand in the file.
    order = np.lexsort(np.column_stack([arm.setup[np.unique(arm.row)], table]).T)
    table, row = table[order], np.argsort(order)[row]
    rng = np.random.default_rng(0)
    sign, moved = rng.choice([-1.0, 1.0], size=(DRAWS, len(table))), np.tile(np.arange(len(table)), (DRAWS, 1))
    for alike in _alike(table):
        moved[:, alike] = rng.permuted(moved[:, alike], axis=1)
    # In as many numbers as there are ways of giving: a draw then costs next to nothing.
    Q, R = np.linalg.qr(arm.ways)
    drawn = sign[:, row] * table[row, arm.component], table[moved[:, row], arm.component]
    more = [sum(_explained(R, b) > explained * (1.0 + ROUNDING) for b in values @ Q) for values in drawn]
    return more[0] / DRAWS, more[1] / DRAWS


def _explained(R: Array, b: Array) -> float:
    """What the nearest passive arm explains of readings with the coefficients b (k,), as a sum of squares."""
    f = R @ nnls(R, b)[0]
    return float(2.0 * f @ b - f @ f)


def _alike(table: Array) -> list[Indices]:
    """Rows (k,) of a table with the same components read, which may be exchanged for one another."""
    kind = np.unique(np.isnan(table), axis=0, return_inverse=True)[1].reshape(-1)
    return [np.flatnonzero(kind == k) for k in range(int(kind.max()) + 1)]


@dataclass(frozen=True)
class Frozen:
    """A column that shows one ``value`` (m or rad) in ``setups`` set-ups, where an arm would leave it by ``moves``."""

    component: int
    value: float
    setups: int
    moves: float

    def fault(self, source: str) -> InputError:
        """The fault in words."""
        unit = "mm" if self.component < 3 else "mrad"
        name, value, moves = DISPLACEMENTS[self.component], 1e3 * self.value, 1e3 * self.moves
        return InputError(
            f"{source}: column {name} reads the same in all {self.setups} set-ups",
            code="T013",
            value=f"{value:g} {unit}",
            allowed=f"readings that follow load and pose: an arm of this geometry would leave it by {moves:.2g} {unit}",
            remedy="check that the gauge touches and moves freely; leave cells empty where nothing was read",
        )


def refuse_frozen(model: ArmModel, data: Measurements, whole: Problem | None = None) -> None:
    """Refuse tables in which nothing moved, or a column that stands still where the arm cannot; each file by itself.

    ``whole``: all readings, with nothing set free, where that has been set up already.

    Raises
    ------
    InputError
        Naming file, column and value.
    InputErrors
        Several of them.
    """
    files = files_of(data) or (data.source,) * data.n
    faults = []
    several = set(files)
    for file in dict.fromkeys(files):
        mine = data if len(several) == 1 else data.select(np.array([name == file for name in files]))
        if not np.nan_to_num(mine.displacement).any():
            faults.append(
                InputError(
                    f"{file}: every reading is 0",
                    code="T013",
                    allowed="readings that differ from 0: every arm deflects under a load",
                    remedy="check that the gauge touches, and that the columns hold what it read",
                )
            )
        else:
            p = problem(model, mine, ()) if whole is None or mine is not data else whole
            faults += [one.fault(file) for one in frozen_columns(PassiveArm.of(p))]
    raise_any(data.source, faults)


def frozen_columns(arm: PassiveArm) -> list[Frozen]:
    """Columns that show one value in several set-ups where no passive arm near the readings does."""
    # Something in series gives the same under the same load in any pose; springs and links must explain that.
    lever = np.where(arm.component < 3, 1.0, 1.0 / LEVER_M)
    near = PassiveArm(arm.ways[:, :-1], arm.value, arm.row, arm.component, arm.setup).over(lever)
    away = (near.fit()[0] - near.value) * lever
    size, digit = float(np.sqrt(np.mean(near.value**2))), _digit(arm.value)
    out = []
    for k in np.unique(arm.component):
        mine = arm.component == k
        setups = len(np.unique(np.round(arm.setup[arm.row[mine]], 9), axis=0))
        moves = float(np.sqrt(np.mean(away[mine] ** 2)))
        still = setups > 1 and np.ptp(arm.value[mine]) == 0.0
        if still and moves > digit and moves / lever[mine][0] > max(STILL, FEW / setups) * size:
            out.append(Frozen(int(k), float(arm.value[mine][0]), setups, moves))
    return out


def _digit(value: Array) -> float:
    """The last digit (m or rad) that any of the readings (m,) shows in mm or mrad."""
    for k in range(MOST_DIGITS):
        shown = 1e3 * value * 10.0**k
        if np.all(np.abs(shown - np.round(shown)) < 1e-6 * np.maximum(1.0, np.abs(shown))):
            return float(10.0 ** -(k + 3))
    return float(10.0 ** -(MOST_DIGITS + 3))
