"""Evaluation of a map block by block: each block by itself, so that it may be made anywhere and in any order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robots import forward_kinematics, tool_position
from robots.progress import Progress, report_progress
from surrogate.maps.candidates import Arm
from surrogate.maps.data import Layout
from surrogate.maps.layouts import points_of, poses_of
from surrogate.maps.poses import Extreme, PoseRule
from surrogate.maps.quantities import Quantities
from surrogate.maps.store import Column, MapStore

Block = Mapping[str, NDArray[np.generic]]

# Points a block: some tenths of a second where poses are given, some seconds where they are searched for.
POINTS_GIVEN, POINTS_SEARCHED = 16_384, 4_096


@dataclass(frozen=True, eq=False)
class Engine:
    """What evaluates the blocks of a map.

    ``rule`` and ``arm``: how the pose at a point is chosen; None for a joint layout. ``seed``: of arms whose inverse
    kinematics is a search; each block draws its own numbers, so that blocks do not depend on each other. ``told``: what
    the rule tells besides (:class:`surrogate.maps.candidates.Chosen`).
    """

    grid: Layout
    quantities: Quantities
    rule: PoseRule | None = None
    arm: Arm | None = None
    seed: int = 0
    told: Mapping[str, Column] = field(default_factory=dict)

    @property
    def points_a_block(self) -> int:
        """Points a block by default."""
        return POINTS_SEARCHED if isinstance(self.rule, Extreme) else POINTS_GIVEN

    @property
    def columns(self) -> dict[str, Column]:
        """Arrays of a map: names with type and what follows the number of points in their shape."""
        number, truth = "<f8", "|b1"
        out = {
            "points": Column(number, (3,)),
            "q": Column(number, (self.quantities.model.robot.dof,)),
            "reached": Column(truth),
            "sure": Column(truth),
        }
        out |= {**self.told, **{kind.name: Column(number) for kind in self.quantities.kinds}}
        if self.quantities.shares:
            out["shares"] = Column("<f4", (len(self.quantities.parts),))
        return out

    def block(self, rows: slice) -> dict[str, NDArray[np.generic]]:
        """All arrays of some rows; NaN (-1 for categories) where there is no pose.

        Raises
        ------
        InputError
            As :meth:`surrogate.maps.quantities.Quantities.values`.
        """
        robot, out = self.quantities.model.robot, dict[str, NDArray[np.generic]]()
        if self.rule is None or self.arm is None:
            q = poses_of(self.grid, robot, rows)
            points = tool_position(robot, forward_kinematics(robot, q), self.quantities.point)
            reached, sure = robot.reachable(q), np.ones(len(q), dtype=np.bool_)
        else:
            points = points_of(self.grid, rows)
            chosen = self.rule.choose(
                self.arm, points, np.random.default_rng([self.seed, rows.indices(self.grid.n)[0]])
            )
            q, reached, sure = chosen.q, chosen.reached, chosen.sure
            out |= chosen.told
        values = self.quantities.values(q[reached]) if reached.any() else {}
        out |= {"points": points, "reached": reached, "sure": sure, "q": np.where(reached[:, None], q, np.nan)}
        for name, column in self.columns.items():
            if name in out:
                continue
            empty = -1.0 if self.quantities.categories(name) else np.nan
            array = np.full((len(q), *column.shape), empty, dtype=column.dtype)
            if name in values:
                array[reached] = values[name]
            out[name] = array
        return out


def run_blocks(engine: Engine, store: MapStore, progress: Progress | None = None) -> None:
    """Evaluate the blocks that a store lacks, one after the other. Errors as :meth:`Engine.block`."""
    for number in store.missing():
        store.write(number, engine.block(store.rows(number)))
        report_progress(progress, store.points_done, store.n)
