"""Motion of G-code blocks: G0 to G3, splines, corners, polar coordinates and drill cycles."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from machining.toolpaths.arcs import between, chord_count, sweep_about
from machining.toolpaths.corners import Piece, chamfered, rounded, tangent_arc, through_point
from machining.toolpaths.cycles import Cycle, drill
from machining.toolpaths.gcode.arcs import CYCLES, PLANES, RESTS, center, drill_cycle
from machining.toolpaths.gcode.frames import CoordinateFrame
from machining.toolpaths.gcode.rotary import POINTING, Rotary
from machining.toolpaths.gcode.siemens_cycles import Hole
from machining.toolpaths.gcode.splines import CUBIC, NURBS, NURBS_END, QUADRATIC, Nurbs
from machining.toolpaths.gcode.state import REMEDY_START
from machining.toolpaths.gcode.words import Block
from machining.toolpaths.motions import Feed
from machining.toolpaths.recorder import StatementError, Vector
from robots.arrays import Array

# Words that move the tool.
MOVING = frozenset((*"XYZABC", *POINTING, "AP", "RP"))


# Arcs that turn by less, rad, are full turns.
FULL_TURN = 1e-6
# Arcs of Siemens by a point on the way, and along the direction of the move before.
VIA = {"CIP": -1, "CT": -2}
# Words that round or chamfer the corner at the end of a line or an arc: of Fanuc, and of Siemens.
CORNERS = (",R", ",C", "RND", "CHF", "CHR")
ROUNDS = (",R", "RND", "RNDM")


@dataclass(frozen=True, eq=False)
class Element:
    """A line at feed, or an arc about ``center``, from ``start`` to ``end`` (3,) m of the frame in force.

    ``modes``: plane, frame and work offset. ``count`` of its moves, up to the number ``moves``.
    """

    start: Array
    end: Array
    modes: tuple[int, CoordinateFrame, str]
    axis: Vector
    moves: int
    count: int = 1
    center: Array | None = None
    clockwise: bool = False
    turns: int = 1

    @property
    def piece(self) -> Piece:
        """The element by the axes of its plane."""
        p, sign = list(PLANES[self.modes[0]]), -1.0 if self.clockwise else 1.0
        start, end = self.start[p], self.end[p]
        if self.center is None:
            return Piece(start, end)
        sweep = sweep_about(start, end, self.center[p], (0.0, 0.0, sign)) + 2.0 * math.pi * (self.turns - 1)
        return Piece(start, end, self.center[p], sign * sweep)


class Corner(NamedTuple):
    """A corner to be cut at the end of an element: the word, its size m, line of the file, feed (NaN: its own)."""

    word: str
    size: float
    line: int
    feed: float
    element: Element


class GcodeMotion(Rotary):
    """The blocks that move the tool."""

    # The last line or arc at feed, and the corner at its end that what follows cuts off; radius of RNDM, m.
    element: Element | None = None
    open_corner: Corner | None = None
    every_corner = 0.0
    # Feed of corners (FRCM); the last polar place: radius m, angle deg.
    feed_of_corners = math.nan
    polar = math.nan, math.nan
    # The moves made and the direction (3,) m in which the last cubic spline ends; what G5.2 has given.
    spline: tuple[int, Array] | None = None
    open_nurbs: Nurbs | None = None

    def _motion(self, b: Block) -> None:
        if self.motion is None:
            raise StatementError(
                "coordinates without a motion code before them", "G0, G1, G2, G3 or a cycle", code="P016"
            )
        if self.motion in CYCLES:
            self._cycle(b)
            return
        target = self._target(b)
        before, self.axis = self.axis, self._tool_axis(b)
        along = PLANES[self.plane][2]
        if self.length is False and "XYZ"[along] in b.words:
            if self.motion != 0:
                raise StatementError(
                    f"a move of {'XYZ'[along]} behind G49, of the spindle and not of the tip", "G43", code="P016"
                )
            # How far the tip goes is not known: a retract.
            target[along] = None
            self.leave((along,), "G49")
            if not b.words.keys() & (MOVING - {"XYZ"[along]}):
                return
        if self.motion == 0:
            if not self.rapid_to(target):
                self.recorder.event(
                    self.line,
                    "G0",
                    str(b),
                    note="a rapid move with a coordinate not known yet is kept as an event only",
                )
            return
        point = self._known(target)
        if self.open_nurbs is not None:
            raise StatementError("a move between G5.2 and G5.3", "control points, then G5.3", code="P011")
        if self.motion == 10:
            self._feed_to(b, point)
        elif self.motion in (CUBIC, QUADRATIC):
            self._bezier(b, np.array(point))
        else:
            point = self._arc(b, point, before)
        self.here = list(point)

    def _feed_to(self, b: Block, point: Vector) -> None:
        end = np.array(point)
        element = self._joined(b, np.array(self.here, dtype=np.float64), end)
        if self.turns_part and self.angles != self.angles_before:
            self._with_table(element.start, end)
        else:
            self.commit(float(np.linalg.norm(element.start - end)))
            self.recorder.move(self.line, self.shifted(point), self.axis, False)
        self._ended(b, element, 1)

    def _joined(self, b: Block, start: Array, end: Array, **arc: Any) -> Element:
        """The element of a block, behind the corner that it begins at if that is to be cut; ``arc``: its fields."""
        modes = self.plane, self.frame, self.offset
        element = Element(start, end, modes, self.axis, 0, **arc)
        if self.open_corner is None:
            return element
        corner, self.open_corner = self.open_corner, None
        return replace(element, start=self._cut_off(corner, element))

    def _ended(self, b: Block, element: Element, count: int) -> None:
        """Keep an element of ``count`` moves, and the corner that its block asks for at its end."""
        self.element = replace(element, count=count, moves=len(self.recorder))
        asked = {word: b.words[word] * self.scale for word in CORNERS if word in b.words}
        if self.every_corner and not asked:
            asked = {"RNDM": self.every_corner}
        if len(asked) > 1:
            raise StatementError("two ways to cut one corner", f"one of {', '.join(CORNERS)}", code="P021")
        for word, size in asked.items():
            self.cut_next(word, size, b.words.get("FRC", self.feed_of_corners))

    def cut_next(self, word: str, size: float, feed: float = math.nan) -> None:
        """Cut the corner at the end of the last element, ``size`` m, once the one behind it is known."""
        if self.element is None or self.element.moves != len(self.recorder) or not self.element.count:
            raise StatementError(f"{word} behind no line or arc at feed", "between lines and arcs at feed", code="P021")
        if self.feed_mode == "inverse" or self.turns_part or not size > 0.0:
            raise StatementError(
                f"{word} of {size / self.scale:g}", "more than 0, with feed per minute or turn", code="P021"
            )
        if feed <= 0.0:
            raise StatementError(f"feed {feed:g} of a corner", "more than 0", code="P021")
        self.open_corner = Corner(word, size, self.line, feed, self.element)

    def _cut_off(self, corner: Corner, after: Element) -> Array:
        """Round or chamfer the corner between two elements; returns where (3,) m the second one begins then."""
        word, size, line, own, before = corner
        same = before.modes[1] is after.modes[1] and before.modes[::2] == after.modes[::2]
        axis = self._axis_of_plane()
        if not same or before.moves != len(self.recorder) or not before.axis == after.axis == axis:
            raise StatementError(
                f"{word} between elements that do not follow each other in one plane", "one plane", code="P021"
            )
        into, out = before.piece, after.piece
        if word in ROUNDS:
            first, cut = rounded(into, out, size)
        else:
            first, cut = chamfered(into, out, size, across=word == "CHF")
        count = int(chord_count(abs(cut.sweep), size, self.options.chord_tolerance))
        back, kept = np.argsort(PLANES[self.plane]), np.arange(1, before.count + 1) / before.count
        self.recorder.shorten(self.placed(into.along(first * kept)[:, back]))
        if not math.isnan(own):
            feed, self.feed, self.dirty = self.feed, own, True
            self.commit(math.nan)
            self.feed, self.dirty = feed, True
        points = self.placed(cut.along(np.arange(1, count + 1) / count)[:, back])
        self.recorder.moves(line, points, np.tile(axis, (count, 1)), False)
        self.recorder.behind(self.line, before.moves)
        return np.asarray(cut.end[back])

    def corner_behind(self) -> None:
        """Refuse a corner to be cut where no line or arc follows."""
        c = self.open_corner
        if c is not None and c.line != self.line:
            # A block without a move between two of them: controls may round the corner, or may not.
            between = c.element.moves == len(self.recorder)
            unread = replace(c.element, modes=(0, c.element.modes[1], ""))
            self.open_corner = c._replace(element=unread) if between else None
            if c.word != "RNDM":
                self.open_corner = None
                raise StatementError(
                    f"{c.word} in line {c.line} without an element behind it", "two at feed", code="P021"
                )

    def _bezier(self, b: Block, end: Array) -> None:
        """G5 and G5.1 of LinuxCNC in G17; without I and J a curve goes on in the direction of the one before."""
        start, cubic = np.array(self.here, dtype=np.float64), self.motion == CUBIC
        i, j, p, q = (self.scale * b.words.get(letter, math.nan) for letter in "IJPQ")
        first, last = np.array([i, j, 0.0]), np.array([p, q, 0.0])
        if not cubic:
            first, last = np.nan_to_num(first), np.zeros(3)
        elif math.isnan(i) and math.isnan(j) and self.spline is not None and self.spline[0] == len(self.recorder):
            first = self.spline[1]
        if self.plane != 170 or start[2] != end[2] or not first.any() or np.isnan([first, last]).any():
            raise StatementError(
                "a spline out of X Y, or without its points", "G17, X, Y, I, J, and P, Q of G5", code="P011"
            )
        self._spline(Nurbs([start, start + first, *([end + last] if cubic else []), end], order=3 + cubic))
        self.spline = len(self.recorder), -last

    def nurbs(self, b: Block) -> None:
        """G5.2 of LinuxCNC: control points from here on, with weights P; G5.3: the curve of order L that they make."""
        first, second, normal = PLANES[self.plane]
        named, target = b.words.keys() & {"XYZ"[first], "XYZ"[second]}, self.target(b)
        if NURBS in b.codes:
            weight = 1.0 if named else b.words.get("P", 1.0)
            self.open_nurbs = Nurbs([np.array(self._known(self.here))], [weight], int(b.words.get("L", 3.0)))
        if self.open_nurbs is None or len(named) == 1 or target[normal] != self.here[normal]:
            raise StatementError(
                "a control point without both coordinates, or out of its plane", "G5.2, X, Y, P, G5.3", code="P011"
            )
        if named:
            self.open_nurbs.control.append(np.array(self._known(target)))
            self.open_nurbs.weights.append(b.words.get("P", 1.0))
            self.here = target
        if NURBS_END in b.codes:
            made, self.open_nurbs, self.motion = self.open_nurbs, None, None
            self._spline(made)

    def _spline(self, made: Nurbs) -> None:
        points = made.points(self.options.chord_tolerance)
        self.commit(float(np.linalg.norm(np.diff([made.control[0], *points], axis=0), axis=1).sum()))
        self.recorder.moves(self.line, self.placed(points), np.tile(self.axis, (len(points), 1)), False)

    def _axis_of_plane(self) -> Vector:
        x, y, z = self.frame.turn[:, PLANES[self.plane][2]].tolist() if self.frame.follows else self.axis
        return x, y, z

    def _target(self, b: Block) -> list[float | None]:
        """Coordinates m behind the block, polar ones and those along an angle too."""
        first, second, _ = PLANES[self.plane]
        if b.words.keys() & {"AP", "RP"}:
            return self._polar(b)
        out = self.target(b)
        if "ANG" not in b.words or self.motion != 10:
            return out
        angle, here = math.radians(b.words["ANG"]), self.here
        given = [i for i in (first, second) if "XYZ"[i] in b.words]
        u, v = here[first], here[second]
        if len(given) != 1 or u is None or v is None:
            raise StatementError(
                "ANG with both coordinates of the plane, or with none", "ANG and one coordinate", code="P020"
            )
        along = (math.cos(angle), math.sin(angle))[given[0] == second]
        if abs(along) < 1e-9:
            raise StatementError("ANG across the coordinate that is given", "an angle towards it", code="P020")
        way = ((out[given[0]] or 0.0) - (u, v)[given[0] == second]) / along
        if way < 0.0:
            raise StatementError("ANG away from the coordinate that is given", "an angle towards it", code="P020")
        out[first], out[second] = u + way * math.cos(angle), v + way * math.sin(angle)
        return out

    def _polar(self, b: Block) -> list[float | None]:
        """AP, RP about the pole: angle and radius; the radius is absolute but for IC, the angle adds under G91, too.

        What is left out, or added to, is that of the polar place at which the tool stands; of any place where an arc
        begins.
        """
        first, second, normal = PLANES[self.plane]
        letters, out = ("XYZ"[first], "XYZ"[second]), list(self.here)
        a, c = self.pole[first], self.pole[second]
        if b.words.keys() & {*letters, *"IJKR", "AR"} or a is None or c is None:
            raise StatementError(
                "polar coordinates with others, or while the pole is not known", "AP and RP alone", code="P020"
            )
        u, v = np.array(out, dtype=np.float64)[[first, second]] - (a, c)
        lever = complex(u, v)
        if self.motion in (20, 30):
            self.polar = abs(lever), math.degrees(cmath.phase(lever))
        elif not abs(lever - cmath.rect(self.polar[0], math.radians(self.polar[1]))) < 1e-9:
            self.polar = math.nan, math.nan
        radius, angle = self.polar
        if "RP" in b.words:
            radius = b.words["RP"] * self.scale + (0.0 if b.own.get("RP", True) else radius)
        if "AP" in b.words:
            angle = b.words["AP"] + (0.0 if b.own.get("AP", self.absolute) else angle)
        if not math.isfinite(radius + angle):
            raise StatementError("polar coordinates away from a polar place", "radius and angle, absolute", code="P020")
        self.polar = radius, angle
        out[first] = a + radius * math.cos(math.radians(angle))
        out[second] = c + radius * math.sin(math.radians(angle))
        out[normal] = self.target(b)[normal]
        return out

    def set_pole(self, code: int, b: Block) -> None:
        """G110, G111, G112: pole by its coordinates from the last place, the origin or the last pole (Siemens)."""
        if self.diameter:
            raise StatementError(f"a pole under {self.diameter}", "DIAMOF before it", code="P020")
        origins: dict[int, list[float | None]] = {1100: self.here, 1110: [0.0, 0.0, 0.0], 1120: self.pole}
        if b.words.keys() & {"AP", "RP"} or not b.words.keys() & set("XYZ"):
            raise StatementError(
                "a pole by polar coordinates, or polar interpolation", "G110 to G112 with X, Y, Z", code="P020"
            )
        self.pole = [
            None if old is None else old + b.words.get(letter, 0.0) * self.scale
            for old, letter in zip(origins[code], "XYZ", strict=True)
        ]

    def rapid_to(self, target: list[float | None]) -> bool:
        """A rapid move, at the height of a retract while that of the target is not known; whether there was one."""
        self.here = target
        unknown = [k for k, v in enumerate(target) if v is None]
        x, y, z = (0.0 if v is None else v for v in target)
        if not unknown:
            self.commit(math.nan)
            self.recorder.move(self.line, self.shifted((x, y, z)), self.axis, True)
        elif len(unknown) == 1 and self.recorder.retracts.away and self._along_tool(unknown[0]):
            self.commit(math.nan)
            self.recorder.across(self.line, self.shifted((x, y, z)), self.axis)
        else:
            return False
        return True

    def _along_tool(self, k: int) -> bool:
        """Whether the tool axis is along coordinate k of the frame in force."""
        way = np.array(self.shifted((float(k == 0), float(k == 1), float(k == 2)))) - self.shifted((0.0, 0.0, 0.0))
        return abs(float(way @ np.array(self.axis))) > 1.0 - 1e-9

    def _known(self, target: list[float | None]) -> Vector:
        x, y, z = target
        if x is None or y is None or z is None:
            self.here = target
            missing = ", ".join(letter for letter, v in zip("XYZ", target, strict=True) if v is None)
            raise StatementError(
                f"a move at feed while {missing} is not known",
                "X, Y, Z given before",
                REMEDY_START,
                code="P016",
            )
        return x, y, z

    def _arc(self, b: Block, end: Vector, before: Vector) -> Vector:
        """An arc; returns where it ends."""
        start = np.array(self._known(self.here))
        self.here = list(end)
        clockwise = self.motion == 20
        if self.diameter:
            raise StatementError(f"an arc under {self.diameter}", "DIAMOF before it", code="P011")
        first, second, along = PLANES[self.plane]
        centred = bool(b.words.keys() & set("IJK"))
        if "AR" in b.words and not centred:
            self._opening(b, start, np.array(end))
        if b.words.keys() & {"AP", "RP"}:
            middle = start.copy()
            middle[[first, second]] = self.pole[first], self.pole[second]
        elif self.motion in VIA.values():
            middle, clockwise = self._via(b, start, np.array(end))
        else:
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
        if "AR" in b.words and centred:
            end = self._turned_end(b, start, middle, clockwise)
            self.here = list(end)
        normal = np.zeros(3)
        normal[along] = -1.0 if clockwise else 1.0
        apart = math.hypot(end[first] - start[first], end[second] - start[second])
        if 0.0 < apart < FULL_TURN * float(np.linalg.norm((middle - start)[[first, second]])):
            # Below what a control tells apart: a full turn, as in LinuxCNC.
            whole = list(end)
            whole[first], whole[second] = float(start[first]), float(start[second])
            end = whole[0], whole[1], whole[2]
        # Fanuc and LinuxCNC count all turns begun, Siemens those added.
        turns = b.words["TURN"] + 1.0 if "TURN" in b.words else 1.0 if self.siemens else b.words.get("P", 1.0)
        if not 1.0 <= turns <= 10_000.0 or turns != int(turns):
            raise StatementError(f"an arc of {turns:g} turns", "P of a whole number from 1 to 10000", code="P011")
        if self.turns_part and self.angles != self.angles_before:
            raise StatementError(
                "an arc while the table turns", "arcs at fixed angles", "post it as short lines", code="P011"
            )
        element = self._joined(b, start, np.array(end), center=middle, clockwise=clockwise, turns=int(turns))
        fraction, points = self.chords(element.start, end, middle, normal, turns=int(turns))
        chain = np.vstack([element.start, points])
        self.commit(float(np.linalg.norm(np.diff(chain, axis=0), axis=1).sum()))
        self.recorder.moves(self.line, self.placed(points), between(before, self.axis, fraction), False)
        self._ended(b, element, len(points))
        return end

    def leaving(self) -> Array:
        """Direction (3,) in which the last line or arc at feed leads at its end."""
        last = self.element
        if last is None or last.moves != len(self.recorder) or last.modes[1] is not self.frame:
            raise StatementError("CT without a contour before it", "a line or an arc at feed before it", code="P011")
        return np.asarray(last.piece.heading(1.0)[np.argsort(PLANES[last.modes[0]])])

    def _via(self, b: Block, start: Array, end: Array) -> tuple[Array, bool]:
        """Centre (3,) m of CIP or CT in the plane, and whether the arc is clockwise."""
        u, v, w = PLANES[self.plane]
        if start[w] != end[w] or (self.motion == VIA["CIP"] and (not self.absolute or self.plane != 170)):
            raise StatementError(
                "CIP or CT out of the plane, or CIP under G91", "arcs in the plane, CIP in G17, G90", code="P016"
            )
        p, out = [u, v, w], start.copy()
        if self.motion == VIA["CIP"]:
            if not b.words.keys() >= {"I1", "J1"}:
                raise StatementError("CIP without the point on its way", "I1 and J1", code="P016")
            on_way = np.array([b.words["I1"] * self.scale, b.words["J1"] * self.scale, start[w]])
            middle, clockwise = through_point(start, on_way, end)
        else:
            middle, clockwise = tangent_arc(start[p], end[p], self.leaving()[p])
        out[p] = middle
        return out, clockwise

    def _turned_end(self, b: Block, start: Array, middle: Array, clockwise: bool) -> Vector:
        """Where an arc about ``middle`` (3,) m ends that opens by AR."""
        angle = b.words["AR"]
        if not 0.0 < angle < 360.0 or b.words.keys() & {*"XYZR"}:
            raise StatementError(
                "AR with a centre and an end, or out of range", "above 0, below 360, one of both", code="P016"
            )
        p, turn = list(PLANES[self.plane][:2]), math.radians(-angle if clockwise else angle)
        lever = complex(*(start - middle)[p]) * cmath.rect(1.0, turn)
        out = start.copy()
        out[p] = middle[p] + (lever.real, lever.imag)
        return out[0], out[1], out[2]

    def _opening(self, b: Block, start: Array, end: Array) -> None:
        """AR, the angle that an arc opens by, with its end: as the radius that it gives."""
        angle = b.words["AR"]
        if not 0.0 < angle < 360.0 or b.words.keys() & set("IJKR"):
            raise StatementError("AR out of range, or with R", "AR above 0 and below 360", code="P020")
        half = math.radians(angle) / 2.0
        radius = float(np.linalg.norm((end - start)[list(PLANES[self.plane][:2])])) / 2.0 / math.sin(half) / self.scale
        dict.__setitem__(b.words, "R", radius if angle <= 180.0 else -radius)

    def _cycle(self, b: Block) -> None:
        along = PLANES[self.plane][2]
        letter = "XYZ"[along]
        for key in (letter, "R", *("Q" * (CYCLES[self.motion or 0] in ("chip", "peck")))):
            if key in b.words:
                self.sticky[key] = b.words[key] * self.scale
        if "P" in b.words and self.motion in RESTS:
            whole = "P" not in b.points and self.options.dwell_unit == "ms"
            if "P" not in b.points and not whole and b.words["P"] >= 100.0:
                self.recorder.note(
                    self.line, "a cycle with a whole P of 100 or more: taken as s; --read dwell_unit=ms?", code="W039"
                )
            self.sticky["P"] = b.words["P"] * (1e-3 if whole else 1.0)
        if letter not in self.sticky or "R" not in self.sticky:
            raise StatementError(f"a cycle without {letter} or R", f"{letter} and R", code="P012")
        if (
            "K" in b.words
            or b.words.get("L", 1.0) != int(b.words.get("L", 1.0))
            or not 1 <= b.words.get("L", 1) <= 9999
        ):
            raise StatementError(
                "repeats of a cycle", "L of a whole number from 1 to 9999, or none", "post hole by hole", code="P012"
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
            raise StatementError(
                "a cycle with the tool not along the normal of the plane", "post it as single moves", code="P012"
            )
