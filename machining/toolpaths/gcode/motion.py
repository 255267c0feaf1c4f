"""Motion of G-code blocks: G0 to G3, drill cycles, rotary axes."""

from __future__ import annotations

import math

import numpy as np

from machining.toolpaths.arcs import ArcError, arc_points, between
from machining.toolpaths.cycles import Cycle, drill
from machining.toolpaths.gcode.arcs import CYCLES, PLANES, center, drill_cycle
from machining.toolpaths.gcode.siemens_cycles import Hole
from machining.toolpaths.gcode.state import REMEDY_START, Modes
from machining.toolpaths.gcode.words import Block
from machining.toolpaths.motions import Feed
from machining.toolpaths.recorder import StatementError, Vector
from robots.arrays import Array

# Components of a tool axis as Siemens writes them.
POINTING = ("A3", "B3", "C3")
POINTING_SET = frozenset(POINTING)
# Words that move the tool.
MOVING = frozenset((*"XYZABC", *POINTING))


class GcodeMotion(Modes):
    """The blocks that move the tool, on top of the modes; ``pointing``: A3, B3, C3 have told its axis."""

    pointing = False

    def _motion(self, b: Block) -> None:
        if self.motion is None:
            raise StatementError("coordinates without a motion code before them", "G0, G1, G2, G3 or a cycle")
        if self.motion in CYCLES:
            self._cycle(b)
            return
        target = self.target(b)
        before, self.axis = self.axis, self._tool_axis(b)
        if self.motion == 0:
            if not self._rapid_known(target):
                self.recorder.event(
                    self.line,
                    "G0",
                    str(b),
                    note="a rapid move with a coordinate not known yet is kept as an event only",
                )
            return
        point = self._known(target)
        if self.motion == 10:
            start = self.here
            self.commit(math.nan if None in start else math.dist([v or 0.0 for v in start], point))
            if self.turns_part:
                self._with_table(np.array(start, dtype=np.float64), np.array(point))
            else:
                self.recorder.move(self.line, self.shifted(point), self.axis, False)
        else:
            self._arc(b, point, before)
        self.here = list(point)

    def _rapid_known(self, target: list[float | None]) -> bool:
        self.here = target
        x, y, z = target
        if x is None or y is None or z is None:
            return False
        self.commit(math.nan)
        self.recorder.move(self.line, self.shifted((x, y, z)), self.axis, True)
        return True

    def _known(self, target: list[float | None]) -> Vector:
        x, y, z = target
        if x is None or y is None or z is None:
            self.here = target
            missing = ", ".join(letter for letter, v in zip("XYZ", target, strict=True) if v is None)
            raise StatementError(
                f"a move at feed while {missing} is not known",
                "X, Y, Z given before",
                REMEDY_START,
            )
        return x, y, z

    def _arc(self, b: Block, end: Vector, before: Vector) -> None:
        start = np.array(self._known(self.here))
        self.here = list(end)
        clockwise = self.motion == 20
        middle = center(
            b,
            start,
            np.array(end),
            self.plane,
            clockwise,
            scale=self.scale,
            absolute=self.arc_absolute,
            slack=self.options.arc_tolerance,
        )
        normal = np.zeros(3)
        normal[PLANES[self.plane][2]] = -1.0 if clockwise else 1.0
        # Fanuc and LinuxCNC count all turns begun, Siemens those added.
        turns = b.words["TURN"] + 1.0 if "TURN" in b.words else b.words.get("P", 1.0)
        if not 1.0 <= turns <= 10_000.0 or turns != int(turns):
            raise StatementError(f"an arc of {turns:g} turns", "P of a whole number from 1 to 10000")
        try:
            fraction, points = arc_points(
                start,
                end,
                middle,
                normal,
                chord_tolerance=self.options.chord_tolerance,
                arc_tolerance=self.options.arc_tolerance,
                turns=int(turns),
                limit=self.options.max_moves,
            )
        except ArcError as fault:
            remedy = (
                "check G90.1 and G91.1; say that centres are coordinates: --read arc_absolute=yes; allow more: "
                "--read arc_tolerance_um=50; or post with more decimals"
            )
            raise StatementError(f"{fault.what} ({fault.value})", fault.allowed, remedy) from None
        chain = np.vstack([start, points])
        self.commit(float(np.linalg.norm(np.diff(chain, axis=0), axis=1).sum()))
        if self.turns_part and self.angles != self.angles_before:
            raise StatementError("an arc while the table turns", "arcs at fixed angles", "post it as short lines")
        points = self.in_part(self.frame.out(points) + self.shift)
        self.recorder.moves(self.line, points, between(before, self.axis, fraction), False)

    def _with_table(self, start: Array, end: Array) -> None:
        """A move at feed while the table turns: as chords of what the tip does in the part."""
        old, new = self.angles_before, dict(self.angles)
        turn = max(abs(new[k] - old[k]) for k in new)
        lever = max(float(np.linalg.norm(end - np.array(self.options.pivot))), 1e-3)
        step = min(math.radians(5.0), 2.0 * math.sqrt(2.0 * self.options.chord_tolerance / lever))
        count = 1 if np.isnan(start).any() else max(1, math.ceil(turn / step))
        self.recorder.room(count)
        for f in np.arange(1, count + 1) / count:
            self.angles = {k: old[k] + f * (new[k] - old[k]) for k in new}
            x, y, z = (end if f == 1.0 else start + f * (end - start)).tolist()
            self.recorder.move(self.line, self.shifted((x, y, z)), self._of_angles(), False)
        self.angles = new

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
                f"rotary axis {', '.join(wrong)} with --rotary {rotary}", "axes of the machine", remedy
            )
        if any(angles.values()) and not self.tcp and not self.turns_part:
            raise StatementError(
                "turned rotary axes without tool centre point control: X, Y, Z are no points of the part",
                "G43.4, G234 or TRAORI before it",
                "post with tool centre point control; where X, Y, Z are the tip in the part: --tcp (tcp= in Python); "
                "where a table turns: --read pivot=X,Y,Z, the place where its axes meet, in mm",
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
                "A3, B3, C3 without TRAORI", "TRAORI before them", "say that it is on: --tcp (tcp= in Python)"
            )
        axis = self.frame.turn @ np.array([b.words.get(letter, 0.0) for letter in POINTING])
        size = float(np.linalg.norm(axis))
        if not size > 0.0:
            raise StatementError("a tool axis of length 0", "A3, B3 or C3 other than 0")
        self.pointing = True
        x, y, z = (axis / size).tolist()
        return x, y, z

    def _cycle(self, b: Block) -> None:
        along = PLANES[self.plane][2]
        letter = "XYZ"[along]
        for key in (letter, "R", "Q"):
            if key in b.words:
                self.sticky[key] = b.words[key] * self.scale
        if "P" in b.words:
            whole = "P" not in b.points and self.options.dwell_unit == "ms"
            if "P" not in b.points and not whole and b.words["P"] >= 100.0:
                self.recorder.note(
                    self.line, "a cycle with a whole P of 100 or more: taken as s; --read dwell_unit=ms?"
                )
            self.sticky["P"] = b.words["P"] * (1e-3 if whole else 1.0)
        if letter not in self.sticky or "R" not in self.sticky:
            raise StatementError(f"a cycle without {letter} or R", f"{letter} and R")
        if (
            "K" in b.words
            or b.words.get("L", 1.0) != int(b.words.get("L", 1.0))
            or not 1 <= b.words.get("L", 1) <= 9999
        ):
            raise StatementError(
                "repeats of a cycle", "L of a whole number from 1 to 9999, or none", "post hole by hole"
            )
        self.axis = self._tool_axis(b)
        self._require_along_normal()
        before, times = len(self.recorder), int(b.words.get("L", 1.0))
        for i in range(times):
            self._hole(b, along, letter)
            if i == 0:
                # All holes have as many moves: too many are refused before they are made.
                self.recorder.room((len(self.recorder) - before) * (times - 1))

    def _hole(self, b: Block, along: int, letter: str) -> None:
        target = self.target(b)
        target[along] = self.here[along] if self.initial is None else self.initial
        initial = self._known(target)[along]
        retract = self.sticky["R"] + (0.0 if self.absolute else initial)
        bottom = self.sticky[letter] + (0.0 if self.absolute else retract)
        back = initial if self.back_to_initial else retract
        work = drill_cycle(
            self.motion or 0, retract, bottom, max(back, retract), self.sticky.get("Q", 0.0), self.sticky.get("P", 0.0)
        )
        target[along] = retract
        self._drill(target, work)

    def _drill(self, target: list[float | None], work: Cycle) -> None:
        """A cycle that begins to feed at ``target``, m in the frame in force; the tool ends where it leads back to."""
        point = self._known(target)
        here: Array | None = None
        if None not in self.here:
            here = self.frame.out(np.array([v or 0.0 for v in self.here])) + self.shift

        def state(own: Feed | None, reverse: bool) -> None:
            feed, mode = self.feed, self.feed_mode
            if own is not None:
                self.feed, self.feed_mode, self.dirty = own.value / self.scale, own.per, True
            self.commit(math.nan, reverse=reverse)
            self.feed, self.feed_mode = feed, mode

        end = drill(self.recorder, self.line, here, self.shifted(point), self.axis, work, state)
        self.dirty = True
        self.here = self.frame.into(np.array(end) - self.shift).tolist()

    def drill_here(self, one: Hole) -> None:
        """A Siemens cycle at the place where the tool stands."""
        self._require_along_normal()
        target = list(self.here)
        target[PLANES[self.plane][2]] = one.start
        self._drill(target, one.cycle)

    def _require_along_normal(self) -> None:
        """Cycles drill along the plane's normal alone."""
        if (np.array(self.axis) @ self.frame.turn)[PLANES[self.plane][2]] < 1.0 - 1e-9:
            raise StatementError("a cycle with the tool not along the normal of the plane", "post it as single moves")


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
