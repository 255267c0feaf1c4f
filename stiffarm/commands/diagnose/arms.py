"""Where the arm was when the model was wrong: of each measured pose its error, and the reading that is worst."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from doe.diagnosis.diagnose import Diagnosis
from doe.diagnosis.space import Gaps
from doe.diagnosis.where import SAME_LOAD, load_labels
from doe.tables.loaded import rms_mm
from robots import Robot, forward_kinematics, tool_position
from robots.arrays import Array, Indices


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


def skeleton(robot: Robot, q: Array, point: Array) -> list[Array]:
    """Lines (k, 3) m through the joints of an arm in poses q (dof,) to the point that was read.

    First the chain itself, from the base; then the crank and bar of a parallelogram.
    """
    frames = forward_kinematics(robot, q[None])
    chain = np.vstack([np.zeros(3), frames.p[0], frames.p_flange, point[None]])
    lines = [chain]
    if (pg := robot.parallelogram) is not None:
        lever = frames.R[0, pg.driven + 1] @ pg.pin
        crank, driven = frames.p[0, pg.crank_about + 1], frames.p[0, pg.driven + 1]
        lines.append(np.stack([crank, crank + lever, driven + lever, driven]))
    return lines


def tool_points(robot: Robot, q: Array) -> Array:
    """Tool points (n, 3) m of poses q (n, dof)."""
    return np.asarray(tool_position(robot, forward_kinematics(robot, q)))
