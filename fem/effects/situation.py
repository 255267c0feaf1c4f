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

    @cached_property
    def places(self) -> dict[str, Port]:
        """Base, joints, tool (and links) with what they carry."""
        if self.few is not self:
            return {name: port.take(self.at.distinct[1]) for name, port in self.few.places.items()}
        robot = self.model.robot
        return ports(self.model, self.at.q, self.at.wrench, self.at.point, {"base", "tool", *robot.joint_names})

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

    @cached_property
    def preload(self) -> Array:
        """Torque (n, dof) N m of the links' own weight at the springs; zero where no masses are declared."""
        if self.few is not self:
            return self.few.preload[self.at.distinct[1]]
        return gravity_torque(self.model, self.at.q)

    def of(self, model: ArmModel, at: LoadedPoses) -> Situation:
        """The same history with another arm or loads; statics already known are kept where they still hold.

        An arm is statically determinate: as long as its geometry, load path and loads are the same, what its springs
        are does not matter to what they carry.
        """
        other = replace(self, model=model, at=at)
        # Where a cached property keeps what it found.
        if at is self.at and self.few is not self:
            other.__dict__["few"] = self.few.of(model, self.few.at)
        same_path = (model.bar is None) == (self.model.bar is None)
        if at is self.at and model.robot is self.model.robot and same_path and model.masses is self.model.masses:
            for name in ("places", "preload"):
                if name in self.__dict__:
                    other.__dict__[name] = self.__dict__[name]
        return other

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
