"""Cutting forces and bending of several tools along one path: each point has those of the tool that is there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from machining.cutting.end_mill import ToolBending
from machining.cutting.force import ByRuns, CuttingForce, ForceAlong
from machining.task import Task
from robots import InputError
from robots.arrays import Array, Bools, Integers

# What a force is, of the task at some points of a path and their places in it.
Of = Callable[[CuttingForce, Task, Integers], ForceAlong]


@dataclass(frozen=True, eq=False)
class ForceOfEach:
    """The cutting force of each tool of a path.

    ``forces``: by place in the path's table of tools, None where nothing is known: such a tool has no force; ``names``
    of these tools. ``tool`` (n,): places of the points of the tasks that are asked for. ``free`` (n - 1,): segments
    that do not mill, None where there are none.
    """

    forces: tuple[CuttingForce | None, ...]
    names: tuple[str, ...]
    tool: Integers
    free: Bools | None = None

    def at(self, tool: Integers, free: Bools | None = None) -> ForceOfEach:
        """The same for other points."""
        return ForceOfEach(self.forces, self.names, tool, free)

    def along(self, task: Task) -> ForceAlong:
        """See :class:`machining.cutting.force.CuttingForce`."""

        def by_runs(force: CuttingForce, part: Task, rows: Integers) -> ForceAlong:
            # Between two runs of one tool lie those of others: no segment that mills.
            gap = np.diff(rows) > 1
            free = gap if self.free is None else gap | self.free[rows[1:] - 1]
            return ByRuns(force, free).along(part) if free.any() else force.along(part)

        return self.joined(task, by_runs)

    def joined(self, task: Task, of: Of) -> ForceAlong:
        """What ``of`` gives for each tool by itself, as one force along the path.

        Raises
        ------
        InputError
            Points of another number than the tools, no tool with a force; else as ``of``.
        """
        n = task.path.n
        if len(self.tool) != n:
            raise InputError("tools along a path", code="K004", value=f"{len(self.tool)} points", allowed=f"{n}")
        parts = []
        for i in np.unique(self.tool).tolist():
            force, rows = self.forces[i], np.flatnonzero(self.tool == i)
            if force is not None:
                parts.append((rows, of(force, task.at(rows), rows), self.names[i]))
        if not parts:
            raise InputError(
                "cutting force",
                code="K004",
                value="none for any tool of the path",
                allowed="one or more",
                remedy="give a tool of the cell file its milling file, or --milling or --force",
            )
        return _one(n, parts)


@dataclass(frozen=True, eq=False)
class BendingOfEach:
    """The bending of each tool of a path, as :class:`machining.cutting.ToolBending` of one.

    ``bendings``: by place in the path's table of tools, None: taken as rigid; ``tool`` (n,) as in :class:`ForceOfEach`.
    """

    bendings: tuple[ToolBending | None, ...]
    tool: Integers

    def at(self, tool: Integers) -> BendingOfEach:
        """The same for other points."""
        return BendingOfEach(self.bendings, tool)

    @property
    def _known(self) -> list[ToolBending]:
        return [one for one in self.bendings if one is not None]

    @property
    def compliance(self) -> float:
        """Compliance across the axis of the softest tool, m/N."""
        return max(one.compliance for one in self._known)

    @property
    def relative_sd(self) -> float:
        """Standard deviation of the compliances as a share of them: that of the least known."""
        return max(one.relative_sd for one in self._known)

    def matrices(self, axes: Array) -> Array:
        """Compliance (n, 3, 3) m/N for tool axes (n, 3), unit vectors."""
        out = np.zeros((len(axes), 3, 3))
        for i in np.unique(self.tool).tolist():
            bending, rows = self.bendings[i], np.flatnonzero(self.tool == i)
            if bending is not None:
                out[rows] = bending.matrices(axes[rows])
        return out


def _one(n: int, parts: Sequence[tuple[Integers, ForceAlong, str]]) -> ForceAlong:
    """Forces at different rows as one, the parameters of each by themselves."""
    sizes = [len(found.value) for _, found, _ in parts]
    basis = np.zeros((n, sum(sizes), 3))
    for (rows, found, _), end, size in zip(parts, np.cumsum(sizes), sizes, strict=True):
        basis[rows, end - size : end] = found.basis
    return ForceAlong(
        basis,
        np.concatenate([found.value for _, found, _ in parts]),
        np.asarray(block_diag(*(found.covariance for _, found, _ in parts))),
        tuple(f"{tool}: {name}" for _, found, tool in parts for name in found.names),
        "; ".join(dict.fromkeys(f"{tool}: {found.note}" for _, found, tool in parts)),
    )
