"""Where in space a diagnosis shows: the gap at each tool point, and what leaving the effects out would cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from doe.diagnosis.diagnose import Diagnosis, State
from fem.effects.base import PlacedEffect
from fem.effects.observed import observed
from fem.statics.loads import LoadedPoses
from robots import forward_kinematics, tool_position
from robots.arrays import Array, Bools


@dataclass(frozen=True, eq=False)
class Gaps:
    """Measured minus simulated displacement at the tool points of n loaded poses, base axes.

    ``pose``: labels (n,); ``q`` (n, dof) rad; ``point`` (n, 3) m; ``force`` (n, 3) N; ``measured``, ``before``,
    ``after`` (n, 3) m: the displacement that was read, and what the model without and with the effects leaves of it;
    NaN where a component was not read. ``after`` is ``before`` where nothing was found. ``outlier`` (n,): where a
    component that was read is an outlier.
    """

    pose: tuple[str, ...]
    q: Array
    point: Array
    force: Array
    measured: Array
    before: Array
    after: Array
    outlier: Bools


def gaps(d: Diagnosis) -> Gaps:
    """The gap of every loaded pose of which a displacement was read."""
    p = d.before.setting.data
    at, linear = p.free.at, p.component < 3
    rows = np.unique(p.row[linear])
    labels = dict(zip(p.row.tolist(), p.pose.tolist(), strict=True))

    def placed(values: Array) -> Array:
        out = np.full((len(at), 3), np.nan)
        out[p.row[linear], p.component[linear]] = values[linear]
        return out[rows]

    robot, q = d.before.setting.model.robot, at.q[rows]
    return Gaps(
        tuple(p.poses[labels[row]] for row in rows.tolist()),
        q,
        tool_position(robot, forward_kinematics(robot, q), at.point[rows]),
        at.wrench[rows, :3],
        placed(p.value),
        placed(d.before.residual),
        placed(d.after.residual),
        np.isin(rows, p.row[~np.asarray(d.counts, dtype=bool)]),
    )


def cost_of_leaving_out(d: Diagnosis, at: LoadedPoses) -> Array:
    """Displacements (n, 3) m that a model without the effects would miss at loaded poses.

    The difference of the two fitted models, each with its own springs. Effects of the measurement (a gauge's zero, a
    load that was not what the sheet says) bend the springs of the model without them, and count by that alone: they
    do not act when the arm works. Loads are taken as put on once, from zero.
    """
    return _moved(d.after, at) - _moved(d.before, at)


def _moved(state: State, at: LoadedPoses) -> Array:
    s = state.setting
    return observed(s.arm, at, of_the_arm(s.accepted))[:, :3]


def of_the_arm(effects: Sequence[PlacedEffect]) -> list[PlacedEffect]:
    """The effects that act whenever the arm works, and not only while it was measured."""
    return [e for e in effects if e.effect.of_the_arm]
