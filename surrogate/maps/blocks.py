"""Evaluation of a map block by block: each block by itself, so that it may be made anywhere and in any order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robots import forward_kinematics, tool_position
from robots.arrays import Array
from robots.progress import Progress, report_progress
from surrogate.maps.candidates import Arm
from surrogate.maps.data import Field, Layout, MapData
from surrogate.maps.layouts import points_of, poses_of, sweep_layout
from surrogate.maps.poses import PoseRule
from surrogate.maps.quantities import Quantities
from surrogate.maps.store import MapStore

Arrays = Mapping[str, NDArray[np.generic]]

# Points a block where poses are given: some tenths of a second.
POINTS_GIVEN = 16_384


@dataclass(frozen=True, eq=False)
class Engine:
    """What evaluates the blocks of a map.

    ``rule`` and ``arm``: how the pose at a point is chosen; None for a joint layout. ``seed``: of arms whose inverse
    kinematics is a search; each block draws its own numbers, so that blocks do not depend on each other.
    """

    grid: Layout
    quantities: Quantities
    rule: PoseRule | None = None
    arm: Arm | None = None
    seed: int = 0

    @property
    def size(self) -> int:
        """Points a block."""
        return POINTS_GIVEN if self.rule is None else self.rule.points_a_block

    def rows(self, number: int) -> slice:
        """Points of a block."""
        return slice(number * self.size, min((number + 1) * self.size, self.grid.n))

    @property
    def columns(self) -> dict[str, np.dtype[np.generic]]:
        """Arrays of a map: names with what they hold of each point, as in ``np.empty(n, dtype)``."""
        number, truth = np.dtype("<f8"), np.dtype("?")
        out: dict[str, np.dtype[np.generic]] = {
            "points": np.dtype(("<f8", (3,))),
            "q": np.dtype(("<f8", (self.quantities.model.robot.dof,))),
        }
        out |= {"reached": truth, "sure": truth}
        out |= {} if self.rule is None else self.rule.besides
        out |= {kind.name: number for kind in self.quantities.kinds}
        if self.quantities.shares:
            out["shares"] = np.dtype(("<f4", (len(self.quantities.parts),)))
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
            out |= chosen.besides
        values = self.quantities.values(q[reached]) if reached.any() else {}
        out |= {"points": points, "reached": reached, "sure": sure, "q": np.where(reached[:, None], q, np.nan)}
        for name, kind in self.columns.items():
            if name in out:
                continue
            empty = -1.0 if self.quantities.categories(name) else np.nan
            array = np.full((len(q), *kind.shape), empty, dtype=kind.base)
            if name in values:
                array[reached] = values[name]
            out[name] = array
        return out

    def computed(
        self,
        metadata: Mapping[str, str] | None = None,
        progress: Progress | None = None,
        store: MapStore | None = None,
        make: Callable[[MapStore, Progress | None], None] | None = None,
    ) -> MapData:
        """The map: all its blocks, made here or by ``make``, which writes those that a store lacks.

        Raises
        ------
        InputError
            As :meth:`block`, and as ``make``.
        """
        store = self.store() if store is None else store
        if make is None:
            for number in store.missing():
                store.write(number, self.block(store.rows(number)))
                report_progress(progress, store.points_done, store.n)
        else:
            make(store, progress)
        return self.map_of(store.finished(), metadata)

    def store(self, key: str = "", folder: Path | None = None) -> MapStore:
        """What holds the arrays while they are made, and keeps them in a folder; see :class:`MapStore`."""
        return MapStore(self.grid.n, self.size, self.columns, key, folder)

    def map_of(self, arrays: Arrays, metadata: Mapping[str, str] | None = None) -> MapData:
        """The map of all rows of the engine's arrays."""
        numbers: Mapping[str, Array] = arrays  # type: ignore[assignment]
        with_shares, besides = "shares" in arrays, {} if self.rule is None else self.rule.besides
        return MapData(
            layout=self.grid,
            points=numbers["points"],
            q=numbers["q"],
            reached=arrays["reached"].view(np.bool_),
            coordinates=self.quantities.model.robot.coordinates,
            fields={
                kind.name: Field(numbers[kind.name], kind.unit, kind.label, self.quantities.categories(kind.name))
                for kind in self.quantities.kinds
            },
            parts=self.quantities.parts if with_shares else (),
            shares=numbers["shares"] if with_shares else None,
            metadata=dict(metadata or {}),
            sure=arrays["sure"].view(np.bool_),
            by_rule={name: numbers[name] for name in besides},
        )


def sweep_engine(quantities: Quantities, points: int, layers_deg: Sequence[float] | None = None) -> Engine:
    """The engine of the usual sweep of the workspace, ``points`` values of each joint coordinate.

    Raises
    ------
    InputError
        As :func:`surrogate.maps.layouts.sweep_layout`.
    """
    return Engine(sweep_layout(quantities.model.robot, points, layers_deg), quantities)
