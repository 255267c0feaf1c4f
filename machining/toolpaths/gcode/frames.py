"""Frames that a G-code program puts its coordinates into: G52, G68, G68.2, CYCLE800, TRANS, ROT."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from machining.toolpaths.recorder import StatementError
from robots.arrays import Array

# Programmable frames of Siemens, and those that add to the one in force.
PROGRAMMABLE = ("TRANS", "ATRANS", "ROT", "AROT")
# CYCLE800: swivel axis by axis; its other modes name the plane in other ways.
AXIS_BY_AXIS = 0
# Last digit of its third argument: the plane is a new one, or adds to the one in force.
NEW, ADDED = 0, 1
_ARGUMENTS = 14


@dataclass(frozen=True)
class CoordinateFrame:
    """Where coordinates of a block are: ``turn`` (3, 3) and ``shift`` (3,) m in the work offset's frame.

    ``follows``: the tool axis is the frame's z axis (G53.1, a swivelled table or head); else the frame turns
    coordinates alone.
    """

    turn: Array = field(default_factory=lambda: np.eye(3))
    shift: Array = field(default_factory=lambda: np.zeros(3))
    follows: bool = False

    @cached_property
    def plain(self) -> bool:
        """Whether coordinates are those of the work offset itself."""
        return not self.shift.any() and not self.follows and bool((self.turn == np.eye(3)).all())

    def out(self, points: Array) -> Array:
        """Points (..., 3) m of the frame in the work offset's."""
        return np.asarray(points @ self.turn.T + self.shift)

    def into(self, points: Array) -> Array:
        """Points (..., 3) m of the work offset in the frame."""
        return np.asarray((points - self.shift) @ self.turn)

    def then(self, inner: CoordinateFrame) -> CoordinateFrame:
        """The frame that ``inner`` is in this one."""
        return CoordinateFrame(self.turn @ inner.turn, self.out(inner.shift), self.follows or inner.follows)


def turned(axes: str, angles_deg: Sequence[float]) -> Array:
    """Rotation (3, 3) about axes one after the other, each as the ones before have turned it."""
    # Most files turn nothing, and reading them must not wait for scipy.
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_euler(axes.upper(), angles_deg, degrees=True).as_matrix())


def in_plane(
    words: Mapping[str, float], plane: tuple[int, int, int], scale: float, here: Sequence[float | None]
) -> CoordinateFrame:
    """G68 with a centre and R: coordinates turned about it in the plane; no centre: about where the tool stands.

    Raises
    ------
    StatementError
        No angle, or a centre that is not known.
    """
    if "R" not in words:
        raise StatementError("G68 without its angle", "R in degrees", code="P013")
    centre = np.zeros(3)
    for axis in plane[:2]:
        value = words["XYZ"[axis]] * scale if "XYZ"[axis] in words else here[axis]
        if value is None:
            raise StatementError("G68 about a point that is not known", "G68 with X, Y and R", code="P013")
        centre[axis] = value
    R = turned("XYZ"[plane[2]], [words["R"]])
    return CoordinateFrame(R, centre - R @ centre)


def tilted(words: Mapping[str, float], scale: float) -> CoordinateFrame:
    """G68.2: a plane by its origin X Y Z and the Euler angles I J K about z, x, z (Fanuc; P0 or none).

    Raises
    ------
    StatementError
        A plane that is told in another way (P1 to P4).
    """
    if words.get("P", 0.0) != 0.0:
        raise StatementError(
            f"G68.2 P{words['P']:g}: a plane told by other angles or points", "Euler angles (no P, or P0)", code="P013"
        )
    origin = scale * np.array([words.get(letter, 0.0) for letter in "XYZ"])
    return CoordinateFrame(turned("zxz", [words.get(letter, 0.0) for letter in "IJK"]), origin)


def swivelled(given: Sequence[float], scale: float, before: CoordinateFrame) -> CoordinateFrame:
    """CYCLE800 of Siemens, axis by axis; without arguments it swivels back, by its kind it adds to the one before.

    ``given``: its arguments, NaN where there is none.

    Raises
    ------
    StatementError
        A plane by solid angle or projection, or another kind.
    """
    if all(map(math.isnan, given)):
        return CoordinateFrame()
    number = [0.0 if math.isnan(value) else value for value in given] + [0.0] * (_ARGUMENTS - len(given))
    mode, kind = int(number[3]), int(number[2]) % 10
    if mode >> 6 != AXIS_BY_AXIS or kind not in (NEW, ADDED):
        raise StatementError(
            f"CYCLE800 of mode {mode}, kind {kind}",
            "swivel axis by axis (mode below 64), new or added (kind 0 or 1)",
            "post the swivel axis by axis",
            code="P013",
        )
    order = [mode >> 2 * k & 3 for k in range(3)]
    if 0 in order[: np.count_nonzero(number[7:10])] or any(order[k] == 0 and number[7 + k] for k in range(3)):
        raise StatementError(f"CYCLE800 of mode {mode}", "a mode that names an axis for each angle", code="P013")
    R = np.eye(3)
    for axis, angle in zip(order, number[7:10], strict=True):
        R = R @ (turned("XYZ"[axis - 1], [angle]) if axis else np.eye(3))
    origin, behind = scale * np.array(number[4:7]), scale * np.array(number[10:13])
    new = CoordinateFrame(R, origin + R @ behind, follows=number[13] != 0.0)
    return before.then(new) if kind == ADDED else new


def programmable(
    word: str, words: Mapping[str, float], scale: float, before: CoordinateFrame, normal: int
) -> CoordinateFrame:
    """TRANS, ROT of Siemens, and ATRANS, AROT that add to the frame in force; without axes none is left.

    Several angles of one ROT turn about z, then the new y, then the new x; RPL turns in the plane with this ``normal``.
    """
    axes = [words.get(letter, 0.0) for letter in "XYZ"]
    if word.endswith("TRANS"):
        new = CoordinateFrame(shift=scale * np.array(axes))
    else:
        axes[normal] += words.get("RPL", 0.0)
        new = CoordinateFrame(turned("zyx", axes[::-1]))
    return before.then(new) if word.startswith("A") else new
