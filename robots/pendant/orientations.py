"""Orientations read at the controller against the model's: another convention, a turned tool, or a slip of the wrist.

Positions do not show everything. Where the tool point lies on the last axis, neither that axis' sign nor what it is
coupled to moves it; and numbers named after one maker's convention may be another's.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from robots.arrays import Array
from robots.controller import shown_tool
from robots.kinematics import forward_kinematics
from robots.pendant.explanations import Explanation, PendantReadings
from robots.pendant.slips import fitted, slips
from robots.robot import Robot

# Orientations agree up to this, rad; controllers show hundredths of a degree.
SAME_TURN_rad = float(np.radians(0.1))


@dataclass(frozen=True, eq=False)
class Turned:
    """How orientations compare with the model's.

    ``angle`` (n,) rad between them; ``tool_turn`` (3, 3): a constant turn of the tool that makes them agree;
    ``convention``: the one that they are read in, where that is not the one that the columns are named after.
    """

    angle: Array
    tool_turn: Array | None
    convention: str | None = None

    @property
    def disagreement(self) -> int:
        """0: orientations agree, 1: but for a constant turn of the tool, 2: they do not."""
        return 0 if self.angle.max() <= SAME_TURN_rad else 1 if self.tool_turn is not None else 2


def orientations_explained(
    robot: Robot,
    readings: PendantReadings,
    rotation: Array,
    explained: list[Explanation],
    bases: dict[bool, Array],
    tolerance: float,
) -> list[tuple[Explanation, Turned]]:
    """Those explanations of the positions that explain the orientations best, each with how these compare.

    In the convention that the columns are named after; where that explains nothing, in another, or with one more slip
    that the positions do not show. ``rotation`` (n, 3, 3): of the readings; ``bases``: the controller's robot frame in
    the base frame, (4, 4), by whether the model file has it; ``tolerance``: of positions, m.
    """
    as_named = _compared(robot, rotation, explained, bases)
    if not as_named or as_named[0][1].disagreement < 2:
        return as_named
    readable: list[tuple[str | None, Array]] = [(None, rotation), *readings.other_rotations.items()]
    for candidates in (explained, list(_with_one_more(robot, readings, explained, bases, tolerance))):
        tried = [(name, _compared(robot, one, candidates, bases)) for name, one in readable]
        for wanted in (0, 1):
            for name, found in tried:
                if found and found[0][1].disagreement == wanted:
                    return [(e, replace(turned, convention=name)) for e, turned in found]
    return as_named


def _compared(
    robot: Robot, rotation: Array, explained: list[Explanation], bases: dict[bool, Array]
) -> list[tuple[Explanation, Turned]]:
    """Those explanations under which orientations agree best."""
    # Flipping the wrist and turning it half way round lead to the same place, not to the same orientation.
    found = [(e, orientations(robot, rotation, e, bases)) for e in explained]
    least = min((turned.disagreement for _, turned in found), default=0)
    return [(e, turned) for e, turned in found if turned.disagreement == least]


def _with_one_more(
    robot: Robot, readings: PendantReadings, explained: list[Explanation], bases: dict[bool, Array], tolerance: float
) -> Iterator[Explanation]:
    """The first explanation with one more sign or coupling, where positions still agree."""
    first = explained[0]
    T = bases[first.base_known]
    position = readings.position @ T[:3, :3].T + T[:3, 3]
    for slip in slips(robot):
        if slip.kind == "angles" and slip.joint >= 0 and slip not in first.chosen:
            chosen = (*first.chosen, slip)
            fit = fitted(robot, readings.q, position, chosen, first.frames)
            if fit.worst <= tolerance:
                yield Explanation(chosen, first.frames, fit, first.base_known)


def orientations(robot: Robot, rotation: Array, best: Explanation, bases: dict[bool, Array]) -> Turned:
    """How orientations read, (n, 3, 3) in the controller's robot frame, compare with the model's and an explanation."""
    turn = best.fit.shift.get("turned-base")
    R_turn = np.eye(3) if turn is None else _rotation(turn[:3])
    flange = R_turn @ forward_kinematics(robot, best.fit.q).R_flange
    tool = np.swapaxes(flange, 1, 2) @ (bases[best.base_known][:3, :3] @ rotation)
    turned = _angle(shown_tool(robot)[:3, :3].T @ tool)
    if turned.max() <= SAME_TURN_rad:
        return Turned(turned, None)
    U, _, Vt = np.linalg.svd(tool.sum(axis=0))
    mean = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    return Turned(turned, mean if _angle(mean.T @ tool).max() <= SAME_TURN_rad else None)


def _angle(R: Array) -> Array:
    """Angles (n,) rad of rotations (n, 3, 3), exact near 0 too."""
    w = np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1)
    return np.asarray(np.arctan2(np.linalg.norm(w, axis=1), np.trace(R, axis1=1, axis2=2) - 1.0))


def _rotation(vector: Array) -> Array:
    return np.asarray(Rotation.from_rotvec(vector).as_matrix())
