"""Motion of conversational programs: lines, arcs, polar coordinates, corners, cycles, planes."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from machining.toolpaths.corners import chamfered, rounded, tangent_arc
from machining.toolpaths.gcode.arcs import PLANES, center
from machining.toolpaths.gcode.frames import CoordinateFrame, turned
from machining.toolpaths.gcode.motion import MOVING, GcodeMotion
from machining.toolpaths.gcode.state import REMEDY_START
from machining.toolpaths.gcode.words import Block
from machining.toolpaths.heidenhain.cycles import DRILLS, hole, pecked
from machining.toolpaths.heidenhain.words import Words, assign, number
from machining.toolpaths.options import ReadOptions
from machining.toolpaths.recorder import StatementError
from machining.toolpaths.source import readable
from robots.arrays import Array

REMEDY = "post it as single moves"
# Cycles that set what moves do not depend on: rest, orientation, tolerance, preset.
_QUIET_CYCLES = (9, 13, 32, 247)
# M codes of places of the machine.
MACHINE = (91, 92, 140)
# A full turn has no words but its centre's.
_WITH_CENTRES = MOVING | {*"IJK"}
_PLANE_OF = {"XY": 170, "XZ": 180, "YZ": 190}
_Q_PART = re.compile(r"(Q\d+)\s*=\s*([-+]?\s*(?:Q\d+|[\d.,]+)|MAX|AUTO|FMAX|FAUTO|FU|PREDEF)")


class Contour(GcodeMotion):
    """Statements that move the tool, made into blocks of :class:`GcodeMotion`."""

    def __init__(self, path: Path, options: ReadOptions) -> None:
        super().__init__(path, options)
        self.feed_scale, self.feed_of_tool = 1.0, math.nan
        # In m of the frame in force: pole, direction of the last contour element.
        self.pole: list[float | None] = [None, None, None]
        self.along: Array | None = None
        self.right_hand: bool | None = None
        self.polar = [math.nan, math.nan]
        self.cycle_number = 0
        self.old_cycle: dict[int, float] = {}
        self.modal_call = False
        # A line that waits for RND or CHF: its start and what is said of the corner at its end.
        self.waiting: tuple[Words, Array, Array] | None = None
        self.held, self.held_line, self.held_text = Block(), 0, ""
        # The statement that is read, as faults show it.
        self.text = ""
        self.corner_is: tuple[str, float] | None = None
        self.datum = np.zeros(3)
        self.rotation = 0.0
        self.tilt: CoordinateFrame | None = None

    # Contour

    def motion_statement(self, word: str, w: Words) -> None:
        """One statement of motion."""
        if word == "CC":
            self.settle()
            self._centre(w)
            return
        if word not in ("L", "LP"):
            if self.corner_is is not None:
                self.waiting = self.corner_is = None
                raise StatementError("RND or CHF between a line and an arc", "between two lines", REMEDY)
            self.settle()
        if {"RL", "RR"} & w.flags:
            self.compensated("RL or RR")
        if word in ("LP", "CP"):
            w = self._from_polar(word, w)
        if word in ("L", "LP", "LN"):
            self._line_to(word, w)
        else:
            self._arc_to(word, w)

    def _line_to(self, word: str, w: Words) -> None:
        block = self._block(w, 0 if "FMAX" in w.flags else 10)
        if word == "LN":
            for letter in "XYZ":
                if f"T{letter}" in w.values:
                    block.words[f"{'ABC'['XYZ'.index(letter)]}3"] = w.values[f"T{letter}"]
        start, target = self._here(), self.target(block)
        plain = block.codes == [10] and start is not None and None not in target and not w.misc
        if self.corner_is is not None:
            self._round(np.array(target, dtype=np.float64) if plain else None)
            start = self._here()
        else:
            self.settle()
        if plain and start is not None and {"X", "Y"} & block.words.keys():
            # It may be cut short by RND or CHF.
            self.waiting = (w, start, np.array(target, dtype=np.float64))
            self.held, self.held_line, self.held_text = block, self.line, self.text
            return
        self._run(block, w)

    def settle(self) -> None:
        """Make the line that waited for a corner."""
        if self.corner_is is not None:
            self.corner_is = None
            raise StatementError("RND or CHF without the line behind it", "L before and behind it", REMEDY)
        if self.waiting is not None:
            w, _, _ = self.waiting
            self.waiting = None
            self._run_held(self.held, w)

    def _run_held(self, block: Block, w: Words) -> None:
        """Run the line that waited, as of its own place in the file."""
        line, self.line = self.line, self.held_line
        try:
            self._run(block, w)
        except StatementError as fault:
            # It is this line's fault, not that of the statement which brought it to be run.
            self.refuse(fault, self.held_text)
        finally:
            self.line = line

    def corner(self, word: str, text: str) -> None:
        """RND or CHF, with its radius or length."""
        match = re.match(r"\s*R?\s*([-+]?(?:Q\d+|[\d.,]+))\s*(?:F\s*[\d.,]+)?\s*$", text)
        if match is None:
            raise StatementError(f"{word} without its size", f"{word} R5")
        if self.waiting is None or self.corner_is is not None:
            raise StatementError(f"{word} behind no line at feed", "between two lines L", REMEDY)
        self.corner_is = word, number(match[1], self.values) * self.scale

    def _round(self, end: Array | None) -> None:
        if self.waiting is None or self.corner_is is None:
            return
        (w, start, corner), (word, size) = self.waiting, self.corner_is
        held, self.waiting, self.corner_is = self.held, None, None
        if end is None:
            raise StatementError("RND or CHF before a rapid move or a place not known", "two lines at feed", REMEDY)
        if word == "CHF":
            first, last = chamfered(start, corner, end, size)
            self._run_held(self._to(first, held), w)
            self._run(self._to(last, Block(codes=[10])), Words())
            return
        first, last, centre, clockwise = rounded(start, corner, end, size)
        self._run_held(self._to(first, held), w)
        self.plane = 170
        arc = self._to(last, Block(codes=[20 if clockwise else 30]))
        arc.words |= {"I": (centre - first)[0] / self.scale, "J": (centre - first)[1] / self.scale}
        self._run(arc, Words())

    def _to(self, point: Array, like: Block) -> Block:
        """A block like another one to a point (3,) m."""
        kept = {k: v for k, v in like.words.items() if k not in "XYZ"}
        return replace(
            like, words=type(like.words)(kept | dict(zip("XYZ", (point / self.scale).tolist(), strict=True))), own={},
            codes=list(like.codes), misc=list(like.misc),
        )  # fmt: skip

    def _here(self) -> Array | None:
        at = self.here if self.waiting is None else self.waiting[2].tolist()
        return None if None in at else np.array(at, dtype=np.float64)

    def _block(self, w: Words, code: int) -> Block:
        """A block with the coordinates, feed and M codes of a statement."""
        if self.waiting is not None:
            # Incremental coordinates count from the corner, whatever is cut off it.
            last = dict(zip("XYZ", self.waiting[2], strict=True))
        else:
            last = dict(zip("XYZ", self.here, strict=True))
        out = Block(codes=[code], misc=list(w.misc))
        for name, value in w.values.items():
            letter = name[-1]
            if name in (*"XYZABC",):
                out.words[letter] = value
            elif name in ("IX", "IY", "IZ"):
                old = last[letter]
                if old is None:
                    raise StatementError(f"{name} while {letter} is not known", "X, Y, Z given before", REMEDY_START)
                out.words[letter] = value + old / self.scale
            elif name in ("IA", "IB", "IC"):
                out.words[letter], out.own[letter] = value, False
        if self.waiting is not None:
            for letter in "XYZ":
                out.words.setdefault(letter, last[letter] / self.scale)
        if self.frame.follows and self.tilt is not None and {"A", "B", "C"} & out.words.keys():
            self.recorder.note(self.line, "rotary axes inside a tilted plane only bring the tool upright to it")
            for letter in "ABC":
                out.words.pop(letter, None)
        if "F" in w.values:
            out.words["F"] = w.values["F"] * self.feed_scale
        elif "FAUTO" in w.flags:
            out.words["F"] = self.feed_of_tool
        return out

    def _run(self, block: Block, w: Words) -> None:
        """Modes, motion, cycles and stops of a block."""
        misc = block.misc
        call = 99 in misc
        self.modal_call |= 89 in misc
        if 128 in misc or 129 in misc:
            self.tcp = 128 in misc or self.options.tcp
        machine = not set(MACHINE).isdisjoint(misc)
        if 140 not in misc and ("MB" in w.values or "MBMAX" in w.flags):
            raise StatementError("MB without M140", "M140 MB MAX, M140 MB 50", REMEDY)
        block.misc = [m for m in misc if m not in (89, 99, 128, 129, *MACHINE)]
        before = self._here()
        self.take(block)
        if machine:
            self._machine_place(block, w)
        elif not _WITH_CENTRES.isdisjoint(block.words):
            self._motion(block)
            after = self._here()
            if before is not None and after is not None and np.linalg.norm(after - before) > 1e-9:
                self.along = after - before if block.codes[0] in (0, 10) else self._leaving(before, after, block)
            call |= self.modal_call
        if call:
            self._drill_cycle()
        if 99 in misc:
            self.modal_call = False
        self.stop(block)
        self.ended(block.misc)

    def ended(self, misc: list[int]) -> None:
        """Whether M codes end the program; for the reader."""

    def _machine_place(self, block: Block, w: Words) -> None:
        """M91, M92: coordinates of the machine; M140: back along the tool axis, by MB or as far as the machine goes."""
        word = f"M{next(m for m in w.misc if m in MACHINE)}"
        self.recorder.event(self.line, word, str(block))
        # The block may have coordinates of the line before, too.
        named = [k for k, letter in enumerate("XYZ") if letter in w.values or f"I{letter}" in w.values]
        if word != "M140":
            self.leave_by(named, word)
            return
        way = np.array(self.axis) @ self.frame.turn
        if named or ("MB" in w.values) == ("MBMAX" in w.flags):
            raise StatementError("M140 with coordinates, or without its way", "M140 MB MAX, M140 MB 50", REMEDY)
        if "MBMAX" in w.flags:
            self.leave(np.flatnonzero(np.abs(way) > 1e-9).tolist(), word)
            return
        if not w.values["MB"] > 0.0:
            raise StatementError(f"M140 MB {w.values['MB']:g}", "MB of more than 0")
        x, y, z = self._known(self.here)
        self.here = [v + w.values["MB"] * self.scale * float(d) for v, d in zip((x, y, z), way, strict=True)]
        self.commit(w.values["MB"] * self.scale)
        self.recorder.move(self.line, self.shifted(self._known(self.here)), self.axis, "F" not in block.words)

    # Arcs

    def _centre(self, w: Words) -> None:
        """CC: the pole and centre of the arcs to come; the plane is that of its two axes."""
        if not w.values:
            self.pole = list(self.here)
            return
        if not {name.lstrip("I") for name in w.values} <= {*"XYZ"}:
            raise StatementError("CC with other words than X, Y, Z", "two coordinates")
        axes = "".join(sorted(name[-1] for name in w.values))
        for name, value in w.values.items():
            k = "XYZ".index(name[-1])
            if name.startswith("I"):
                old = self.here[k]
                if old is None:
                    raise StatementError(f"{name} while its axis is not known", "absolute coordinates")
                self.pole[k] = old + value * self.scale
            else:
                self.pole[k] = value * self.scale
        if axes in _PLANE_OF:
            self.plane = _PLANE_OF[axes]

    def _from_polar(self, word: str, w: Words) -> Words:
        """LP and CP: coordinates in the plane about the pole."""
        first, second, _ = PLANES[self.plane]
        a, b = self.pole[first], self.pole[second]
        here = self._here()
        if a is None or b is None:
            raise StatementError(f"{word} without its pole", "CC before it")
        if here is not None:
            du, dv = here[first] - a, here[second] - b
            now = [math.hypot(du, dv) / self.scale, math.degrees(math.atan2(dv, du))]
            # What the statement leaves out is that of the last one, or of the place where the tool stands.
            if math.isnan(self.polar[0]) or word == "CP" or {"IPR", "IPA"} & w.values.keys():
                self.polar = [now[0], self.polar[1] if math.isfinite(self.polar[1]) and word == "LP"
                              and "IPA" not in w.values and "PA" not in w.values else now[1]]  # fmt: skip
        values = {k: v for k, v in w.values.items() if k not in ("PR", "PA", "IPR", "IPA")}
        radius = w.values.get("PR", self.polar[0] + w.values.get("IPR", 0.0))
        angle = w.values.get("PA", self.polar[1] + w.values.get("IPA", 0.0))
        if not math.isfinite(radius + angle):
            raise StatementError(f"{word} without PR or PA", "PR and PA, or a place that is known")
        self.polar = [radius, angle]
        values["XYZ"[first]] = a / self.scale + radius * math.cos(math.radians(angle))
        values["XYZ"[second]] = b / self.scale + radius * math.sin(math.radians(angle))
        self.turns = max(1, math.ceil(abs(w.values.get("IPA", 0.0)) / 360.0 - 1e-9))
        if word == "CP" and "IPA" in w.values:
            turning = w.values["IPA"] > 0.0
            if {"DR+", "DR-"} & w.flags and ("DR+" in w.flags) != turning:
                raise StatementError("CP whose DR and IPA have different signs", "one direction")
            return replace(w, values=values, flags=w.flags | {"DR+" if turning else "DR-"})
        return replace(w, values=values)

    def _arc_to(self, word: str, w: Words) -> None:
        if {"DR+", "DR-"} & w.flags:
            self.right_hand = "DR+" in w.flags
        start = self._here()
        if start is None:
            raise StatementError("an arc from a place that is not known", "X, Y, Z given before", REMEDY_START)
        if word in ("CR", "CT"):
            self.plane = 170
        block = self._block(w, 30)
        first, second, _ = PLANES[self.plane]
        if word == "CT":
            end = np.array(self.target(block), dtype=np.float64)
            if self.along is None:
                raise StatementError("CT without a contour before it", "L, C or CR before it")
            centre, clockwise = tangent_arc(start, end, self.along)
        else:
            if self.right_hand is None:
                raise StatementError("an arc without its direction", "DR+ or DR-")
            clockwise, centre = not self.right_hand, start
        block.codes = [20 if clockwise else 30]
        if word == "CR":
            if "R" not in w.values:
                raise StatementError("CR without its radius", "R+10 or R-10")
            block.words["R"] = w.values["R"]
        else:
            for k in (first, second):
                pole = float(centre[k]) if word == "CT" else self.pole[k]
                if pole is None:
                    raise StatementError(f"{word} without its centre", "CC before it")
                block.words["IJK"[k]] = (pole - start[k]) / self.scale
        if word == "CP" and self.turns > 1:
            block.words["P"] = float(self.turns)
        self.arc_absolute = False
        self._run(block, w)

    def _leaving(self, start: Array, end: Array, block: Block) -> Array:
        """Direction in which an arc ends."""
        normal = PLANES[self.plane][2]
        out = np.zeros(3)
        if "R" in block.words:
            middle = center(block, start, end, self.plane, block.codes[0] == 20, scale=self.scale, absolute=False,
                            slack=self.options.arc_tolerance)  # fmt: skip
        else:
            middle = start + self.scale * np.array([block.words.get(letter, 0.0) for letter in "IJK"])
        lever, out[normal] = end - middle, -1.0 if block.codes[0] == 20 else 1.0
        return np.asarray(np.cross(out, lever))

    # Cycles

    def define(self, text: str) -> None:
        """CYCL DEF: a cycle and its parameters."""
        match = re.match(r"(\d+)(?:\.(\d+))?\s*(.*)$", text)
        if match is None:
            raise StatementError("CYCL DEF without its number", "CYCL DEF 200")
        cycle, part, rest = int(match[1]), int(match[2] or 0), match[3]
        self.recorder.event(self.line, "CYCL DEF", readable(text)[:200])
        if cycle == 7:
            self._datum_shift(part, rest)
        elif cycle == 10:
            self._rotate(rest)
        elif cycle == 1:
            self.cycle_number = 1
            value = re.search(r"[-+]?[\d.,]+\s*$", rest)
            if part and value:
                self.old_cycle[part] = number(value[0], self.values) * (self.feed_scale if part == 5 else 1.0)
        elif cycle in DRILLS:
            self.cycle_number = cycle
            for name, value in _Q_PART.findall(rest):
                if value[-1].isdigit() or value[-1] == ".":
                    assign(f"{name}={value}", self.values)
                else:
                    self.values.known.pop(f"#{name[1:]}", None)
        elif cycle not in _QUIET_CYCLES and self.options.unknown_motion == "error":
            raise StatementError(
                f"cycle {cycle} is not read", "cycles 1, 7, 10, 200 to 203, 205 to 207, 209, 240", REMEDY
            )
        elif cycle not in _QUIET_CYCLES:
            self.cycle_number = 0
            self.recorder.note(self.line, f"cycle {cycle} left out, as asked")

    def call_cycle(self, text: str) -> None:
        """CYCL CALL with M codes, or none."""
        if text.startswith(("PAT", "POS")):
            raise StatementError(f"CYCL CALL {text[:3]}", "CYCL CALL, M99, M89", REMEDY)
        misc = [int(m) for m in re.findall(r"M\s*(\d+)", text)]
        self._run(Block(codes=[], misc=misc), Words())
        self._drill_cycle()

    def _drill_cycle(self) -> None:
        if self.cycle_number == 0:
            raise StatementError("a cycle is called and none is defined", "CYCL DEF before it")
        if self.cycle_number == 1:
            height = self.here[2]
            if height is None:
                raise StatementError("cycle 1 while Z is not known", "Z given before")
            one = pecked(self.old_cycle, height, self.scale)
        else:
            q = {int(k[1:]): v for k, v in self.values.known.items() if k[1:].isdigit() and int(k[1:]) < 2000}
            for feed in (206, 208):
                if feed in q:
                    q[feed] *= self.feed_scale
            one = hole(self.cycle_number, q, self.scale)
        plane, self.plane = self.plane, 170
        self.drill_here(one)
        self.plane = plane

    # Frames

    def _datum_shift(self, part: int, rest: str) -> None:
        if part == 0:
            return
        for name, value in re.findall(r"(I?[XYZ])\s*([-+]?(?:Q\d+|[\d.,]+))", rest):
            k, v = "XYZ".index(name[-1]), number(value, self.values) * self.scale
            self.datum[k] = v + (self.datum[k] if name.startswith("I") else 0.0)
        if "#" in rest or (re.search(r"\bQ\d+\b", rest) and not re.search(r"[XYZ]", rest)):
            raise StatementError("a datum of the control's table", "CYCL DEF 7 with X, Y, Z")
        if self.tilt is not None:
            raise StatementError("a datum shift inside a tilted plane", "PLANE RESET before it", REMEDY)
        self._framed()

    def _rotate(self, rest: str) -> None:
        if match := re.search(r"(I?)ROT\s*([-+]?(?:Q\d+|[\d.,]+))", rest):
            if self.tilt is not None:
                raise StatementError("a rotation inside a tilted plane", "PLANE RESET before it", REMEDY)
            self.rotation = number(match[2], self.values) + (self.rotation if match[1] else 0.0)
            self._framed()

    def plane_statement(self, text: str) -> None:
        """PLANE SPATIAL: angles about the fixed axes X, Y, Z, in this order; PLANE RESET."""
        self.recorder.event(self.line, "PLANE", readable(text))
        if text.startswith("RESET"):
            self.tilt = None
        elif text.startswith("SPATIAL"):
            given = dict(re.findall(r"SP([ABC])\s*([-+]?(?:Q\d+|[\d.,]+))", text))
            angles = [number(given.get(letter, "0"), self.values) for letter in "CBA"]
            self.tilt = CoordinateFrame(turned("zyx", angles), follows=True)
            if any(angles) and self.rotation:
                raise StatementError("PLANE in turned coordinates", "PLANE before CYCL DEF 10", REMEDY)
        else:
            raise StatementError(f"PLANE {text.split()[0] if text else ''}", "PLANE SPATIAL, PLANE RESET", REMEDY)
        self._framed()
        if self.tilt is not None and "STAY" not in text:
            # The control swivels, and may move the axes for it.
            self.leave((0, 1, 2), "PLANE")

    def _framed(self) -> None:
        frame = CoordinateFrame(shift=self.datum.copy())
        if self.rotation:
            frame = frame.then(CoordinateFrame(turned("Z", [self.rotation])))
        if self.tilt is not None:
            frame = frame.then(self.tilt)
        self.put_into(frame)
        self.axis = self.frame_axis
