"""A set-up for machining: the cell, the arm's bodies in it, and what that means for how the arm is driven."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

import machining.cell as cells
from machining.posture.drive import Drive
from machining.task import Task, ToolPath
from machining.tooling import given_frames, require_tools, the_one_tool, tools_of
from robots.arrays import Array, Integers

if TYPE_CHECKING:
    from machining.cell import ArmBodies, Cell, Scene
    from machining.toolpaths.conversion import GivenPath
    from machining.toolpaths.motions import Motions

# Clearance is weighed from this many times the safety distance on, and from this far at least, m.
ZONE = 3.0
LEAST_ZONE = 0.02


def weighed_zone(safety: float) -> float:
    """Distance (m) from which on clearance is weighed where ``safety`` m is to be kept."""
    return max(ZONE * safety, LEAST_ZONE)


@dataclass(frozen=True, eq=False)
class Tools:
    """What is on the flange along a path of n points.

    ``T_flange_tool`` (n, 4, 4) m; ``scenes``: arm and cell with each tool, none where collisions are not looked at;
    ``place`` (n,) of each point's in them.
    """

    T_flange_tool: Array
    scenes: tuple[Scene, ...]
    place: Integers

    def at(self, rows: Integers) -> Tools:
        """The same for some of the points."""
        return Tools(self.T_flange_tool[rows], self.scenes, self.place[rows])


@dataclass(frozen=True, eq=False)
class Setup:
    """A cell, and the arm's bodies in it; ``arm`` is None where no surfaces are known, so nothing can collide."""

    cell: Cell
    arm: ArmBodies | None = None

    def drive(self, drive: Drive, *, given: GivenPath | None = None, clear: bool = True) -> Drive:
        """The drive with the cell's joint speeds and, if ``clear``, the arm's clearance with all axes at 0.

        ``given``: the path, where the cell changes tools along it.
        """
        if drive.speed is None and self.cell.joint_speed is not None:
            drive = replace(drive, speed=self.cell.joint_speed)
        if self.arm is None or not self.arm.bodies:
            return drive
        zone = weighed_zone(self.cell.safety)
        drive = replace(drive, clearance_zone=zone, clearance_least=self.cell.safety, nearest_of=self._in_the_way)
        if not clear:
            return drive
        if given is not None and given.motions is not None and self.cell.tools:
            clearance, tool = self.clearance(given.motions), given.motions.tool[given.moves]
            assert clearance is not None  # noqa: S101 - surfaces are known
            still = np.zeros((1, len(self.cell.linear_axes)))

            def clear_at(q: Array, point: Integers) -> Array:
                return clearance(q, np.repeat(still, len(q), axis=0), tool[point])

            return replace(drive, clearance_at=clear_at)
        return replace(drive, clearance_of=cells.clearance_of(self.cell, self.arm, within=zone))

    def _in_the_way(self, q: Array) -> str:
        """Which pairs of bodies are nearest in poses q (k, dof) rad, the most frequent first."""
        assert self.arm is not None  # noqa: S101 - surfaces are known
        found = cells.clearance(cells.scene_of(self.cell, self.arm), q)
        counted = Counter(" and ".join(found.names[k]) for k in found.pair.tolist() if k >= 0)
        return "; ".join(name for name, _ in counted.most_common(2))

    def tools(self, given: GivenPath) -> Tools | None:
        """What is on the flange along a path; None where that is the cell's one tool. Errors as :meth:`clearance`."""
        require_tools(self.cell, given.motions)
        if given.motions is None or not self.cell.tools:
            return None
        used, place = np.unique(given.motions.tool[given.moves], return_inverse=True)
        tools = tools_of(self.cell, given.motions)
        scenes: tuple[Scene, ...] = ()
        if self.arm is not None:
            scenes = tuple(cells.scene_of(self.cell.with_tool(tools[i]), self.arm) for i in used.tolist())
        frames = np.broadcast_to(given_frames(self.cell, given), (given.path.n, 4, 4))
        return Tools(frames, scenes, place.astype(np.int64))

    @property
    def notes(self) -> tuple[str, ...]:
        """What is not looked at for collisions."""
        return () if self.arm is None else cells.scene_of(self.cell, self.arm).notes

    def clearance(self, motions: Motions, table: float = 0.0) -> Callable[[Array, Array, Integers], Array] | None:
        """Clearance (k,) m of poses (k, dof) rad, linear axes at (k, axes) m, with tools (k,) of the motions' table.

        None without surfaces. Errors as :func:`machining.tooling.tools_of`.
        """
        if self.arm is None or not self.arm.bodies:
            return None
        tools, zone = tools_of(self.cell, motions), weighed_zone(self.cell.safety)
        made: dict[int, Scene] = {}

        def scene_with(i: int) -> Scene:
            if id(tools[i]) not in made:
                assert self.arm is not None  # noqa: S101 - asked above
                made[id(tools[i])] = cells.scene_of(self.cell.with_tool(tools[i]), self.arm)
            return made[id(tools[i])]

        def clear(q: Array, e: Array, tool: Integers) -> Array:
            out = np.empty(len(q))
            for i in np.unique(tool).tolist():
                at = tool == i
                out[at] = cells.clearance(scene_with(i), q[at], e[at], np.array([table]), within=zone).distance
            return out

        return clear

    def task(self, given: ToolPath | GivenPath, reference: Array | None = None) -> Task:
        """The path on the part where the cell has it, all axes at 0; gamma counts from ``reference`` (3,).

        A path alone has the cell's one tool.
        """
        T_base_part = self.cell.T_base_part()[0]
        if isinstance(given, ToolPath):
            return Task(given, the_one_tool(self.cell, "the path").T_flange_tool, T_base_part, reference)
        return Task(given.path, given_frames(self.cell, given), T_base_part, reference)
