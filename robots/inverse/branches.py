"""Answers of the inverse kinematics: branches with names, why one is missing, and the solutions themselves."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from robots.arrays import Array, Bools, Integers
from robots.errors import InputError
from robots.inverse.turns import EquivalentPoses, every_turn
from robots.robot import Robot

Method = Literal["closed form", "closed form, refined", "numerical search"]


class Reason(IntEnum):
    """Why a branch has no valid solution; FOUND if it has."""

    FOUND = 0
    LIMITS = 1
    TOO_FAR = 2
    TOO_NEAR = 3
    SHOULDER = 4
    ORIENTATION = 5
    NOT_FOUND = 6
    OUT_OF_REACH = 7
    NO_SUCH = 8

    @property
    def words(self) -> str:
        """The reason as a user reads it."""
        return _WORDS[self]


_WORDS = {
    Reason.FOUND: "can be taken",
    Reason.LIMITS: "beyond joint limits",
    Reason.TOO_FAR: "out of reach: the wrist centre is farther from axis 2 than the stretched arm",
    Reason.TOO_NEAR: "out of reach: the wrist centre is nearer to axis 2 than the folded arm",
    Reason.SHOULDER: "out of reach: the wrist centre is nearer to axis 1 than the arm's lateral offset",
    Reason.ORIENTATION: "the skew wrist cannot take this orientation",
    Reason.NOT_FOUND: "the numerical search found no solution here",
    Reason.OUT_OF_REACH: "out of reach: joints 1 to 3 cannot bring the wrist centre there",
    Reason.NO_SUCH: "does not exist here",
}


@dataclass(frozen=True)
class Branch:
    """One of the configurations that reach the same target.

    front / back: the wrist centre lies before or behind axis 1, the front being the side that joint 2 sits on
    (where it sits on axis 1: the base's X). elbow up / down: the elbow's side where the arm reaches outwards
    level. no flip / flip: joint 5 above or below the angle at which the hand points straight on from the forearm
    (0 for most robots). The names change exactly at the shoulder, elbow and wrist singularity.
    """

    shoulder: Literal["front", "back"]
    elbow: Literal["up", "down"]
    wrist: Literal["no flip", "flip"]

    @property
    def name(self) -> str:
        """For screens and files, as "front, elbow up, no flip"."""
        return f"{self.shoulder}, elbow {self.elbow}, {self.wrist}"


# Index 4 (back) + 2 (elbow down) + 1 (flip).
BRANCHES: tuple[Branch, ...] = tuple(
    Branch(*names)  # type: ignore[arg-type]
    for names in product(("front", "back"), ("up", "down"), ("no flip", "flip"))
)
BRANCH_NAMES: tuple[str, ...] = tuple(branch.name for branch in BRANCHES)
SINGULARITIES = ("shoulder", "elbow", "wrist")


@dataclass(frozen=True)
class InverseSolutions:
    """All joint angles found for n targets, m columns each: eight branches, or what a search found.

    Attributes
    ----------
    robot : the robot
    method : how they were found
    names : (m,) names of the columns; for a search "solution 1" ...
    q : (n, m, dof) rad, in the turn nearest to ``near`` within limits. NaN where the target has no solution.
        Beyond limits the angles are there, ``valid`` is False.
    valid : (n, m) the angles reach the target and keep all limits and couplings
    reason : (n, m) :class:`Reason` as integer
    singular : (n, m, 3) shoulder, elbow, wrist: the arm stands in that singularity to 1e-7 (rad, or share of
        the arm's length). There the branches of either side meet; at a wrist singularity (and, without a
        lateral offset, at a shoulder one) joints 4 and 6 (joint 1) can take any value, of which the one given in
        ``near`` is returned. A search sees singularities only in the Jacobian and marks all three.
    twin : (n, m) equal to an earlier column of this target, to 1e-6 rad (two branches met)
    sure : (n,) whether all solutions were found for certain (closed form), or by good statistics (search)
    unseen : (n,) estimated probability that one more random start would find something new; 0 in closed form
    """

    robot: Robot
    method: Method
    names: tuple[str, ...]
    q: Array
    valid: Bools
    reason: NDArray[np.int8]
    singular: Bools
    twin: Bools
    sure: Bools
    unseen: Array

    @property
    def reached(self) -> Bools:
        """(n, m) branches that reach the target, limits or not."""
        return np.asarray(np.isfinite(self.q).all(axis=2))

    @property
    def count(self) -> Integers:
        """(n,) number of different solutions within limits."""
        return np.asarray((self.valid & ~self.twin).sum(axis=1), dtype=np.int64)

    def nearest(self, q: Array, weight: Array | None = None) -> tuple[Array, Integers]:
        """The valid solution nearest to given angles, any turn of each: angles (n, dof) rad, and column (n,).

        ``q`` (dof,) or (n, dof) rad; ``weight`` (dof,) for the sum of weighted squared differences, default 1.
        Where nothing is valid the angles are NaN and the column is -1.

        Raises
        ------
        InputError
            Shapes that do not fit, or weights that are negative or not finite.
        """
        n, dof = len(self.q), self.robot.dof
        w = np.ones(dof) if weight is None else np.asarray(weight, dtype=np.float64)
        if w.shape != (dof,) or not np.isfinite(w).all() or (w < 0.0).any():
            raise InputError(
                "weights of joints",
                code="B003",
                value=w.tolist(),
                allowed=f"{dof} numbers, 0 or more",
                remedy="one for each joint",
            )
        wanted = as_near(self.robot, q, n)
        turned = self.turns()
        best, column = np.full((n, dof), np.nan), np.full(n, -1)
        each = ((turned.q - wanted[turned.target]) ** 2 * w).sum(axis=1)
        # Sorted from far to near, the nearest of each target is written last.
        order = np.argsort(-each, kind="stable")
        target = turned.target[order]
        best[target], column[target] = turned.q[order], turned.column[order]
        return best, column

    def turns(self) -> EquivalentPoses:
        """Every valid solution with every equivalent angle (360 deg apart) within limits; twins are left out."""
        target, column = np.nonzero(self.reached & ~self.twin)
        found = every_turn(self.robot, self.q[target, column])
        return EquivalentPoses(target[found.target], column[found.target], found.q)

    def explain(self, target: int) -> list[str]:
        """One line a column of one target: its name, and what it is or why it is not."""
        lines = []
        for column, name in enumerate(self.names):
            reason = Reason(int(self.reason[target, column]))
            if reason in (Reason.NOT_FOUND, Reason.NO_SUCH):
                continue
            words = reason.words
            if reason is Reason.LIMITS:
                words += ": " + "; ".join(self.robot.violations(self.q[target, column]))
            marks = [s for s, on in zip(SINGULARITIES, self.singular[target, column], strict=True) if on]
            if marks:
                words += f" (singular: {', '.join(marks)})"
            if self.twin[target, column]:
                words += " (the same as another branch)"
            lines.append(f"{name}: {words}")
        if not self.sure[target]:
            found = int((self.reached & ~self.twin)[target].sum())
            lines.append(f"{found} found; not sure that these are all")
        return lines


def as_near(robot: Robot, near: Array | None, n: int) -> Array:
    """Preferred angles (n, dof) rad; None: the middle of each joint's range.

    Raises
    ------
    InputError
        Wrong shape, or not finite.
    """
    given = robot.limits.mean(axis=1) if near is None else np.asarray(near, dtype=np.float64)
    if given.shape not in ((robot.dof,), (n, robot.dof)) or not np.isfinite(given).all():
        raise InputError(
            f"preferred joint angles for {robot.name}",
            code="B001",
            value=f"shape {given.shape}" if np.isfinite(given).all() else "a value that is not finite",
            allowed=f"({robot.dof},) or ({n}, {robot.dof}) finite angles in rad",
            remedy="give one pose, or one for each target",
        )
    return np.broadcast_to(given, (n, robot.dof))


def twins_of(q: Array, reached: Bools) -> Bools:
    """(n, m) which solutions equal an earlier one of the same target, whole turns aside; q (n, m, dof) rad."""
    twin = np.zeros(reached.shape, dtype=np.bool_)
    for later in range(1, q.shape[1]):
        for earlier in range(later):
            apart = q[:, later] - q[:, earlier]
            with np.errstate(invalid="ignore"):  # NaN where there is no solution
                same = np.abs(apart - 2.0 * np.pi * np.round(apart / (2.0 * np.pi))).max(axis=1) < TWIN_RAD
            twin[:, later] |= same & reached[:, later] & reached[:, earlier]
    return twin


# Where two branches meet their angles part by the square root of rounding: 1e-8.
TWIN_RAD = 1e-6
