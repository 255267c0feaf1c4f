"""What an effect's law can ask for: loads and their order, torques, springs, how a joint's turn moves the tool."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fem.model import ArmModel
from fem.statics.loads import LoadedPoses, gravity_torque
from fem.statics.ports import Port, ports
from robots.arrays import Array, Bools, Indices


@dataclass(frozen=True)
class History:
    """When n readings were taken.

    ``cycle`` (n,): number of the load cycle a reading belongs to, each of which starts unloaded; ``order`` (n,): its
    place in the cycle, from 0, equal for readings taken at one time; ``clock`` (n,): time in the whole campaign, 0 at
    the first reading, 1 at the last; NaN where it is not known. ``is_known``: whether loading and unloading are told
    apart; else each reading is taken as a loading from zero. ``session`` (n,): number of the day or visit, all 0 where
    that is not known.
    """

    cycle: Indices
    order: Indices
    clock: Array
    is_known: bool
    session: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.intp))

    def __post_init__(self) -> None:
        if not len(self.session):
            object.__setattr__(self, "session", np.zeros(len(self.cycle), dtype=np.intp))

    def unloading(self, size: Array) -> Bools:
        """Whether readings (n,) were taken on the way down; ``size`` (n,): of their loads.

        That is, a larger load came before in the cycle.
        """
        most = np.zeros(int(self.cycle.max(initial=-1)) + 1)
        out = np.zeros(len(size), dtype=bool)
        for step in range(int(self.order.max(initial=-1)) + 1):
            now = np.flatnonzero(self.order == step)
            mine = self.cycle[now]
            out[now] = size[now] < most[mine] - 1e-9
            np.maximum.at(most, mine, size[now])
        return out

    def play(self, x: Array, width: Array | float) -> Array:
        """The play operator over every cycle: y (n,) follows x (n,) at a distance of at most ``width``.

        ``y_i = max(x_i - r, min(x_i + r, y_(i-1)))`` with y = 0 before the first (Visintin 1994,
        doi:10.1007/978-3-662-11557-2, ch. III).
        """
        r = np.broadcast_to(np.asarray(width, dtype=np.float64), x.shape)
        y, last = np.zeros(len(x)), np.zeros(int(self.cycle.max(initial=-1)) + 1)
        for step in range(int(self.order.max(initial=-1)) + 1):
            now = np.flatnonzero(self.order == step)
            mine = self.cycle[now]
            y[now] = np.maximum(x[now] - r[now], np.minimum(x[now] + r[now], last[mine]))
            last[mine] = y[now]
        return y

    def take(self, rows: Indices) -> History:
        """The history of some readings; a memory only knows what is still there, so keep whole cycles."""
        cycle = np.unique(self.cycle[rows], return_inverse=True)[1].astype(np.intp)
        return History(cycle, self.order[rows], self.clock[rows], self.is_known, self.session[rows])


def plain_history(n: int) -> History:
    """Each of n readings a loading of its own, from zero; no clock."""
    return History(np.arange(n), np.zeros(n, dtype=np.intp), np.full(n, np.nan), is_known=False)


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
