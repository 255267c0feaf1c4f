"""Rotary axes of G-code: where the tool points to, and moves that a table turns in."""

from __future__ import annotations

import math

import numpy as np

from machining.toolpaths.gcode.state import Modes
from machining.toolpaths.gcode.words import Block
from machining.toolpaths.recorder import StatementError, Vector
from robots.arrays import Array

# Components of a tool axis as Siemens writes them.
POINTING = ("A3", "B3", "C3")
POINTING_SET = frozenset(POINTING)


class Rotary(Modes):
    """Rotary axes on top of the modes; ``pointing``: A3, B3, C3 have told the tool's axis."""

    pointing = False

    def _with_table(self, start: Array, end: Array) -> None:
        """A move at feed while the table turns: as chords of what the tip does in the part."""
        old, new = self.angles_before, dict(self.angles)
        turn = max(abs(new[k] - old[k]) for k in new)
        lever = max(float(np.linalg.norm(end - np.array(self.options.pivot))), 1e-3)
        step = min(math.radians(5.0), 2.0 * math.sqrt(2.0 * self.options.chord_tolerance / lever))
        count = 1 if np.isnan(start).any() else max(1, math.ceil(turn / step))
        self.recorder.room(count)
        points, axes = [], []
        for f in np.arange(0 if count > 1 else 1, count + 1) / count:
            self.angles = {k: old[k] + f * (new[k] - old[k]) for k in new}
            x, y, z = (end if f == 1.0 else start + f * (end - start)).tolist()
            points.append(self.shifted((x, y, z)))
            axes.append(self._of_angles())
        self.angles = new
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()) if count > 1 else math.nan
        straight = float(np.linalg.norm(end - start))
        self._commit_turning(length, straight, math.hypot(straight / self.scale, math.degrees(turn)) * self.scale)
        self.recorder.moves(self.line, np.array(points[-count:]), np.array(axes[-count:]), False)
        self.dirty = True

    def _commit_turning(self, length: float, straight: float, vector: float) -> None:
        """State of a move that a table turns in: the tip's speed in the part, by the time that the move takes.

        ``length`` m in the part, ``straight`` m of X Y Z, ``vector`` of X Y Z and the angles, a degree as a unit of
        length.
        """
        if self.feed_mode == "inverse":
            self.commit(length)
            return
        if not self.options.rotary_feed:
            raise StatementError(
                "a feed per minute while the table turns: of X Y Z, or of these with the angles",
                "G93, or TCP",
                "say which: --read rotary_feed=linear (RS-274) or rotary_feed=vector (Fanuc)",
                code="P022",
            )
        way = vector if self.options.rotary_feed == "vector" or straight == 0.0 else straight
        feed = self.feed
        self.feed, self.dirty = feed * length / way if way > 0.0 else feed, True
        self.commit(length)
        self.feed = feed

    def _of_angles(self) -> Vector:
        return tool_axis(self.options.rotary, self.iso_angles)

    def _tool_axis(self, b: Block) -> Vector:
        turned = False
        self.angles_before = self.angles
        for letter in "ABC":
            if letter in b.words:
                if not turned:
                    self.angles = dict(self.angles)
                old = self.angles[letter]
                self.angles[letter] = math.radians(b.words[letter]) + (0.0 if b.own.get(letter, self.absolute) else old)
                turned = True
        angles = self.angles
        if not POINTING_SET.isdisjoint(b.words):
            return self._direction(b)
        if turned:
            self.pointing = False
        elif self.pointing:
            return self.axis
        if not turned and not any(angles.values()):
            return self.frame_axis
        rotary = self.options.rotary
        wrong = [k for k, v in angles.items() if v and k not in rotary.rpartition("-")[2]]
        if wrong and any(angles.values()):
            remedy = "say how the axes turn: --rotary table-AC or head-BC (rotary= in Python)"
            raise StatementError(
                f"rotary axis {', '.join(wrong)} with --rotary {rotary}", "axes of the machine", remedy, code="P014"
            )
        if any(angles.values()) and not self.tcp and not self.turns_part:
            raise StatementError(
                "turned rotary axes without tool centre point control: X, Y, Z are no points of the part",
                "G43.4, G234 or TRAORI before it",
                "post with tool centre point control; where X, Y, Z are the tip in the part: --tcp (tcp= in Python); "
                "where a table turns: --read pivot=X,Y,Z, the place where its axes meet, in mm",
                code="P014",
            )
        return (0.0, 0.0, 1.0) if rotary == "none" else self._of_angles()

    @property
    def frame_axis(self) -> Vector:
        """Tool axis in the part without any rotary axis: upright, or the z axis of a plane that the tool follows."""
        if not self.frame.follows:
            return 0.0, 0.0, 1.0
        x, y, z = self.frame.turn[:, 2].tolist()
        return x, y, z

    def _direction(self, b: Block) -> Vector:
        """Siemens' A3 B3 C3: the tool axis as a vector of the frame in force, from the tip into the holder."""
        if not self.tcp:
            raise StatementError(
                "A3, B3, C3 without TRAORI",
                "TRAORI before them",
                "say that it is on: --tcp (tcp= in Python)",
                code="P014",
            )
        axis = self.frame.turn @ np.array([b.words.get(letter, 0.0) for letter in POINTING])
        size = float(np.linalg.norm(axis))
        if not size > 0.0:
            raise StatementError("a tool axis of length 0", "A3, B3 or C3 other than 0", code="P014")
        self.pointing = True
        x, y, z = (axis / size).tolist()
        return x, y, z


def tool_axis(rotary: str, angles: dict[str, float]) -> Vector:
    """Unit tool axis in the part frame, from the tip into the holder, for ``angles`` by letter in rad.

    With signs by ISO 841 (a positive angle turns the tool against the part in the positive sense, whichever of them
    turns) table, head and mixed machines have one formula: axis = Rz(C) Rx(A) z or Rz(C) Ry(B) z. The C axis is the one
    next to the part on a table, the one away from the tool on a head. Inclined (nutating) axes are not covered.

    ``rotary``: the machine, such as "table-AC".
    """
    tilt = rotary.rpartition("-")[2][0]
    c, s = math.cos(angles[tilt]), math.sin(angles[tilt])
    # Rx(A) z = (0, -sin A, cos A); Ry(B) z = (sin B, 0, cos B).
    x, y = (0.0, -s) if tilt == "A" else (s, 0.0)
    cc, sc = math.cos(angles["C"]), math.sin(angles["C"])
    return cc * x - sc * y, sc * x + cc * y, c
