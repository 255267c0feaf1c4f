"""Readings that stand still while the arm gives way: a gauge that does not touch, sticks, or was never connected.

A column that shows one value in all set-ups is right where the arm does nothing else there (across the plane of its
links, about an axis without a lever, at angles that only turn the whole arm). So it is held against what a passive arm
of this geometry can do (:mod:`doe.tables.passive_arm`): where no arm that comes near the other columns keeps this one
still, it is the gauge that stands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from doe.estimation.problem import problem
from doe.tables.columns import DISPLACEMENTS
from doe.tables.joined import files_of
from doe.tables.measurements import Measurements
from doe.tables.passive_arm import PassiveArm
from fem import ArmModel
from robots import InputError
from robots.arrays import Array
from robots.errors import raise_any

# A column stands still against the arm where the nearest arm departs from it by more than a digit of the readings and
# by more than this share of what was read, of few set-ups more, for two or three may read the same by chance: two loads
# of which one is twice the other are enough.
STILL, FEW = 0.1, 0.6
# Digits of a millimetre (or mrad) beyond which none was read.
MOST_DIGITS = 6
# By which a rotation is compared with translations, m: about the reach at which they were read.
LEVER_M = 1.0


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
            value=f"{value:g} {unit}",
            allowed=f"readings that follow load and pose: an arm of this geometry would leave it by {moves:.2g} {unit}",
            remedy="check that the gauge touches and moves freely; leave cells empty where nothing was read",
        )


def refuse_frozen(model: ArmModel, data: Measurements) -> None:
    """Refuse tables in which nothing moved, or a column that stands still where the arm cannot; each file by itself.

    Raises
    ------
    InputError
        Naming file, column and value.
    InputErrors
        Several of them.
    """
    files = files_of(data) or (data.source,) * data.n
    faults = []
    for file in dict.fromkeys(files):
        mine = data.select(np.array([name == file for name in files]))
        if not np.nan_to_num(mine.displacement).any():
            faults.append(
                InputError(
                    f"{file}: every reading is 0",
                    allowed="readings that differ from 0: every arm gives way under a load",
                    remedy="check that the gauge touches, and that the columns hold what it read",
                )
            )
        else:
            faults += [one.fault(file) for one in frozen_columns(PassiveArm.of(problem(model, mine, ())))]
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
