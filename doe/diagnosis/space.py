"""Where in space a diagnosis shows: the gap at each tool point, and what leaving the effects out would cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from doe.diagnosis.diagnose import Diagnosis, State
from doe.diagnosis.where import SAME_LOAD, load_labels
from doe.tables.loaded import rms_mm
from fem.effects.base import PlacedEffect
from fem.effects.observed import observed
from fem.statics.loads import LoadedPoses
from robots import forward_kinematics, tool_position
from robots.arrays import Array, Bools, Indices


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


@dataclass(frozen=True, eq=False)
class Stand:
    """The arm in a measured pose under the load where the model without effects was most wrong.

    ``q`` (dof,) rad; ``point`` (3,) m: the point that was read; ``force`` (3,) N. ``read``, ``before`` (3,) m: the
    displacement that was read, and what the model without effects leaves of it, means of all readings there; NaN where
    a component was not read.
    """

    pose: str
    q: Array
    point: Array
    force: Array
    read: Array
    before: Array

    @property
    def load_N(self) -> float:  # noqa: N802 - the unit's letter
        """Size of the load."""
        return float(np.linalg.norm(self.force))

    @property
    def left_over_m(self) -> float:
        """Size of what the model without effects leaves."""
        return float(np.linalg.norm(np.nan_to_num(self.before)))


def stands(found: Gaps) -> list[Stand]:
    """A stand for each pose of which a displacement was read, the most wrong first."""
    loads = np.array(load_labels(np.hstack([found.force, np.zeros_like(found.force)])))
    # The same size may be put on along several directions.
    way = np.round(found.force / np.maximum(np.linalg.norm(found.force, axis=1, keepdims=True), 1e-12) / SAME_LOAD / 20)
    keys = [(load, *direction) for load, direction in zip(loads.tolist(), way.tolist(), strict=True)]
    out = []
    for pose in dict.fromkeys(found.pose):
        rows = np.flatnonzero([p == pose for p in found.pose])
        groups: dict[tuple[object, ...], list[int]] = {}
        for row in rows.tolist():
            groups.setdefault(keys[row], []).append(row)
        means = [_mean(found.before, np.array(g)) for g in groups.values()]
        worst = np.array(list(groups.values())[int(np.argmax([np.linalg.norm(np.nan_to_num(m)) for m in means]))])
        first = worst[0]
        out.append(
            Stand(
                pose,
                found.q[first],
                found.point[first],
                found.force[first],
                _mean(found.measured, worst),
                _mean(found.before, worst),
            )
        )
    return sorted(out, key=lambda s: -s.left_over_m)


def _mean(values: Array, rows: Indices) -> Array:
    """Mean (3,) of rows, NaN where nothing was read."""
    some, count = np.nan_to_num(values[rows]), np.isfinite(values[rows]).sum(axis=0)
    return np.where(count > 0, some.sum(axis=0) / np.maximum(count, 1), np.nan)


def pose_errors_mm(d: Diagnosis) -> dict[str, tuple[float, float]]:
    """RMS of what the models without and with the effects leave of each pose's displacements, the largest first.

    Readings that hardly count are left out, as of every RMS of a diagnosis.
    """
    p = d.before.setting.data
    out = {}
    for k, pose in enumerate(p.poses):
        mine = np.flatnonzero((p.pose == k) & (p.component < 3) & d.counts)
        if len(mine):
            c = p.component[mine]
            out[pose] = rms_mm(d.before.residual[mine], c), rms_mm(d.after.residual[mine], c)
    return dict(sorted(out.items(), key=lambda item: -item[1][0]))
