"""What an effect's law can ask for: loads and their order, torques, springs, how a joint's turn moves the tool."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fem.compiled.compliance import deflection
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

    def deflection(self, model: ArmModel) -> Array:
        """Displacement (n, 6) of the tool of an arm whose parts carry the same (:meth:`is_of`).

        What other springs, another base and another tool add is linear: the rest is not worked out again.
        """
        at = self.at
        for own, d in self._deflections:
            if _alike_but_for_springs(own, model):
                return np.asarray(d + self._further(own, model))
        d = deflection(model, at.q, at.wrench, at.point)
        self._deflections[:] = [(model, d), *self._deflections[: GEOMETRIES - 1]]
        return d.copy()

    @cached_property
    def _deflections(self) -> list[tuple[ArmModel, Array]]:
        """The newest arms whose springs, base or tool alone were not those of another one, with their deflections."""
        return []

    def _further(self, own: ArmModel, model: ArmModel) -> Array:
        """What springs about joints' axes, base and tool of an arm add (n, 6) to those of its ``own``."""
        d = np.zeros((len(self.at), 6))
        for place, C in (("base", model.base - own.base), ("tool", model.tool - own.tool)):
            if C.any():
                d += self.places[place].share(C)
        for joint, was in zip(model.joints, own.joints, strict=True):
            if joint.axial is not was.axial:
                port = self.places[joint.name]
                turn = (joint.axial.compliance(self.at.q) - was.axial.compliance(self.at.q)) * port.carried[5]
                d += (port.T[5] * turn).T
        return d

    @cached_property
    def preload(self) -> Array:
        """Torque (n, dof) N m of the links' own weight."""
        few, where = self.at.distinct
        return gravity_torque(self.model, few.q)[where]


def _alike_but_for_springs(a: ArmModel, b: ArmModel) -> bool:
    """Whether two arms of one geometry have the same parts, but for springs about joints' axes, base and tool."""
    joints = zip(a.joints, b.joints, strict=True)
    return (
        all(x is y for x, y in zip(a.links, b.links, strict=False))
        and len(a.links) == len(b.links)
        and a.bar is b.bar
        and all(x.bearing is y.bearing and x.housing is y.housing and x.laws is y.laws for x, y in joints)
    )


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
    def deflection(self) -> Array:
        """Displacement (n, 6) of the tool by the model's own parts, m and rad: the caller's to change."""
        return self._statics.deflection(self.model)

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
