"""What an effect's law can ask for: loads and their order, torques, springs, how a joint's turn moves the tool."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fem.effects.history import History, plain_history
from fem.model import ArmModel
from fem.statics.loads import LoadedPoses, gravity_torque
from fem.statics.ports import Port, ports
from robots.arrays import Array

__all__ = ["History", "Situation", "plain_history"]


# Geometries of one arm whose statics are kept at once.
GEOMETRIES = 3


@dataclass(frozen=True)
class _Statics:
    """What parts of an arm carry at loaded poses, whatever its springs; worked out when it is asked for."""

    model: ArmModel
    at: LoadedPoses

    def is_of(self, model: ArmModel) -> bool:
        """Whether another arm's parts carry the same."""
        own = self.model
        same_path = (model.bar is None) == (own.bar is None)
        return model.robot is own.robot and same_path and model.masses is own.masses

    @cached_property
    def places(self) -> dict[str, Port]:
        """Base, joints and tool."""
        few, where = self.at.distinct
        if few is not self.at:
            mine = Situation(self.model, few, plain_history(len(few))).places
            return {name: port.take(where) for name, port in mine.items()}
        robot = self.model.robot
        return ports(self.model, self.at.q, self.at.wrench, self.at.point, {"base", "tool", *robot.joint_names})

    @cached_property
    def preload(self) -> Array:
        """Torque (n, dof) N m of the links' own weight."""
        few, where = self.at.distinct
        return gravity_torque(self.model, few.q)[where]


@dataclass(frozen=True)
class Situation:
    """An arm at n loaded poses with their history; ``model`` has the springs as they are."""

    model: ArmModel
    at: LoadedPoses
    history: History

    @cached_property
    def few(self) -> Situation:
        """The same at its distinct loaded poses, for laws without a memory; itself where none comes twice."""
        at, _ = self.at.distinct
        return self if at is self.at else Situation(self.model, at, plain_history(len(at)))

    @property
    def places(self) -> dict[str, Port]:
        """Base, joints, tool (and links) with what they carry."""
        return self._statics.places

    @property
    def preload(self) -> Array:
        """Torque (n, dof) N m of the links' own weight at the springs; zero where no masses are declared."""
        return self._statics.preload

    @cached_property
    def _statics(self) -> _Statics:
        """What the loaded poses keep of an arm's statics, for all situations that ask for it again.

        An arm is statically determinate: as long as its geometry and its load path are the same, what its springs are
        does not matter to what they carry.
        """
        kept: list[_Statics] = self.at.__dict__.setdefault("_statics", [])
        for one in kept:
            if one.is_of(self.model):
                return one
        # The newest few: numbers that move a joint's zero make a geometry of every step.
        kept[:] = [_Statics(self.model, self.at), *kept[: GEOMETRIES - 1]]
        return kept[0]

    def carried(self, place: str, rows: slice) -> Array:
        """Forces N and moments N m (n, k) at a place under the load, rows of its own axes (:class:`Port`)."""
        return np.asarray(self.places[place].carried[rows].T)

    def moved(self, place: str, rows: slice, by: Array) -> Array:
        """Displacement (n, 6) of the tool where a place gives way by (n, k) m or rad in rows of its own axes."""
        port = self.places[place]
        return np.asarray(np.einsum("kcn,nk->nc", port.distinct[rows][:, :, port.where], by))

    def torque(self, joint: str) -> Array:
        """Torque (n,) N m that the spring about a joint's axis feels under the load."""
        return np.asarray(self.places[joint].carried[5])

    def of(self, model: ArmModel, at: LoadedPoses) -> Situation:
        """The same history with another arm or loads."""
        return replace(self, model=model, at=at)

    def compliance(self, joint: str) -> Array:
        """Compliance (n,) rad/(N m) of the spring about a joint's axis."""
        return np.asarray(self._compliances[self.model.robot.joint_names.index(joint)])

    @cached_property
    def _compliances(self) -> Array:
        """Of all joints (dof, n)."""
        if self.few is not self:
            return self.few._compliances[:, self.at.distinct[1]]
        return np.stack([joint.axial.compliance(self.at.q) for joint in self.model.joints])

    def turned(self, joint: str, angle: Array) -> Array:
        """Displacement (n, 6) of the tool where a joint's spring turns by ``angle`` (n,) rad."""
        return np.asarray(self.row(joint).T * angle[:, None])

    def row(self, joint: str) -> Array:
        """Torque of a joint's spring per wrench at the tool (6, n); how a turn there moves the tool."""
        port = self.places[joint]
        return np.asarray(port.distinct[5][:, port.where])
