"""Motion of conversational programs: lines, arcs, polar coordinates, corners."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from machining.toolpaths.corners import tangent_arc
from machining.toolpaths.gcode.arcs import PLANES
from machining.toolpaths.gcode.motion import MOVING, Element
from machining.toolpaths.gcode.state import ENDS, REMEDY_START
from machining.toolpaths.gcode.words import Block
from machining.toolpaths.heidenhain.definitions import Definitions
from machining.toolpaths.heidenhain.harmless import EITHER, WORDS
from machining.toolpaths.heidenhain.words import REMEDY, VALUE, Words, number
from machining.toolpaths.options import ReadOptions
from machining.toolpaths.recorder import StatementError
from robots.arrays import Array

# M codes of places of the machine.
MACHINE = (91, 92, 140)
# A full turn has no words but its centre's.
_WITH_CENTRES = MOVING | {*"IJK"}
POLAR = {"PR": "RP", "IPR": "RP", "PA": "AP", "IPA": "AP"}
_PLANE_OF = {"XY": 170, "XZ": 180, "YZ": 190}


class Contour(Definitions):
    """Statements that move the tool, made into blocks of :class:`GcodeMotion`."""

    def __init__(self, path: Path, options: ReadOptions) -> None:
        super().__init__(path, options)
        self.right_hand: bool | None = None
        # What the tool's call adds to its radius.
        self.oversize = 0.0

    # Contour

    def motion_statement(self, word: str, w: Words) -> None:
        """One statement of motion."""
        given = {*w.values, *w.flags} - {"SWIVEL"} - ({"MB", "MBMAX"} if word == "L" and 140 in w.misc else set())
        if stray := sorted(given - WORDS[word]) or ["M"] * (word == "CC" and bool(w.misc)):
            raise StatementError(f"{stray[0]} means nothing with {word}", ", ".join(sorted(WORDS[word])), code="P021")
        for one, other in EITHER:
            if one in given and other in given:
                raise StatementError(f"{one} and {other} in one statement", "one of them", code="P021")
        if word == "CC":
            self._centre(w)
            return
        by_radius = bool({"RL", "RR"} & w.flags)
        if by_radius:
            self.compensated("RL or RR")
        if self.oversize and (by_radius or "NX" in w.values):
            raise StatementError(
                f"a tool larger by {self.oversize:g} (DR) under compensation", "DR 0", REMEDY, code="P021"
            )
        plane = self.plane
        try:
            self._line_to(word, w) if word in ("L", "LP", "LN") else self._arc_to(word, w)
        finally:
            # The plane of the pole stays, whatever corners and arcs by their radius lie in.
            self.plane = plane

    def _line_to(self, word: str, w: Words) -> None:
        block = self._block(word, w, 0 if "FMAX" in w.flags else 10)
        if word == "LN":
            for first in "NT":
                if 0 < sum(f"{first}{letter}" in w.values for letter in "XYZ") < 3:
                    raise StatementError(
                        f"LN without all of {first}X, {first}Y, {first}Z", "all three components", code="P016"
                    )
            for letter in "XYZ":
                if f"T{letter}" in w.values:
                    block.words[f"{'ABC'['XYZ'.index(letter)]}3"] = w.values[f"T{letter}"]
        if word != "LP":
            # Corners of lines lie in the plane of the tool.
            self.plane = 170
        self._run(block, w)

    def corner(self, word: str, text: str) -> None:
        """RND or CHF, with its radius or length."""
        match = re.match(rf"\s*{'R?' if word == 'RND' else ''}\s*({VALUE})\s*(?:F\s*({VALUE}))?\s*$", text)
        if match is None:
            raise StatementError(f"{word} without its size", f"{word} R5", code="P021")
        feed = number(match[2], self.values) * self.feed_scale if match[2] else math.nan
        # A chamfer takes its length off both lines, as Siemens' CHR does.
        self.cut_next("CHR" if word == "CHF" else word, number(match[1], self.values) * self.scale, feed)

    def _here(self) -> Array | None:
        return None if None in self.here else np.array(self.here, dtype=np.float64)

    def _block(self, word: str, w: Words, code: int) -> Block:
        """A block with the coordinates, feed and M codes of a statement."""
        plane = PLANES[self.plane][:2]
        own = {f"{sign}{'XYZ'[k]}" for k in plane for sign in ("", "I")} & w.values.keys()
        if word in ("LP", "CP", "CTP") and (own or not POLAR.keys() & w.values.keys()):
            raise StatementError(
                f"{word} without PR and PA, or with coordinates of its own plane", "PR, PA, an axis", code="P016"
            )
        if word in ("LP", "CP", "CTP") and None in (self.pole[k] for k in plane):
            raise StatementError(f"{word} without its pole", "CC before it", code="P016")
        out = Block(codes=[code], misc=list(w.misc))
        for name, value in w.values.items():
            letter = POLAR.get(name, name[-1])
            if name in POLAR or name.removeprefix("I") in (*"XYZABC",):
                out.words[letter] = value
                if name[0] == "I":
                    out.own[letter] = False
        self._rotary(w, out)
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
            self.tcp, self.spatial = 128 in misc or self.options.tcp, None
        machine = not set(MACHINE).isdisjoint(misc)
        if 140 not in misc and ("MB" in w.values or "MBMAX" in w.flags):
            raise StatementError("MB without M140", "M140 MB MAX, M140 MB 50", REMEDY, code="P016")
        block.misc = [m for m in misc if m not in (89, 99, 128, 129, *MACHINE)]
        self.take(block)
        if machine:
            self._machine_place(block, w)
        elif not _WITH_CENTRES.isdisjoint(block.words):
            self.require_placed()
            before, last = self._here(), self.element
            self._motion(block)
            self._keep_direction(before, last, block)
            call |= self.modal_call
        if call:
            self._drill_cycle()
        if 99 in misc:
            self.modal_call = False
        self.stop(block)
        self.over = any(code in ENDS and code != 99 for code in block.misc)

    def _keep_direction(self, before: Array | None, last: Element | None, block: Block) -> None:
        """Rapid lines are elements that CT goes on from, too; a line of no length keeps the direction before it."""
        after, moves = self._here(), len(self.recorder)
        if before is None or after is None or block.codes[0] not in (0, 10):
            return
        if not np.linalg.norm(after - before) > 1e-9:
            self.element = None if last is None else replace(last, moves=moves, count=0)
        elif block.codes == [0]:
            self.element = Element(before, after, (170, self.frame, self.offset), self.axis, moves, count=0)

    def call_cycle(self, text: str) -> None:
        """CYCL CALL with M codes, or none."""
        if not re.fullmatch(r"(?:M\s*\d+\s*)*", text):
            raise StatementError(f"CYCL CALL {text[:3]}", "CYCL CALL, M99, M89", REMEDY, code="P012")
        misc = [int(m) for m in re.findall(r"M\s*(\d+)", text)]
        self._run(Block(codes=[], misc=misc), Words())
        self._drill_cycle()

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
            raise StatementError(
                "M140 with coordinates, or without its way", "M140 MB MAX, M140 MB 50", REMEDY, code="P016"
            )
        if "MBMAX" in w.flags:
            self.leave(np.flatnonzero(np.abs(way) > 1e-9).tolist(), word)
            return
        if not w.values["MB"] > 0.0:
            raise StatementError(f"M140 MB {w.values['MB']:g}", "MB of more than 0", code="P016")
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
        axes = "".join(sorted(name[-1] for name in w.values))
        for name, value in w.values.items():
            k = "XYZ".index(name[-1])
            if name.startswith("I"):
                old = self.here[k]
                if old is None:
                    raise StatementError(f"{name} while its axis is not known", "absolute coordinates", code="P016")
                self.pole[k] = old + value * self.scale
            else:
                self.pole[k] = value * self.scale
        if len(axes) > 2:
            raise StatementError("CC with three coordinates", "two", code="P016")
        if axes in _PLANE_OF:
            self.plane = _PLANE_OF[axes]

    def _arc_to(self, word: str, w: Words) -> None:
        if {"DR+", "DR-"} & w.flags:
            self.right_hand = "DR+" in w.flags
        start = self._here()
        if start is None:
            raise StatementError(
                "an arc from a place that is not known", "X, Y, Z given before", REMEDY_START, code="P011"
            )
        if word in ("CR", "CT", "CTP"):
            if "XYZ"[PLANES[self.plane][2]] != "Z" and word == "CTP":
                raise StatementError("CTP in another plane than X Y", "CC X Y before it", REMEDY, code="P011")
            if {"Z", "IZ"} & w.values.keys() and len({"X", "Y", "IX", "IY"} & w.values.keys()) < 2:
                raise StatementError(f"{word} with Z and not both X and Y", "X and Y", REMEDY, code="P011")
            self.plane = 170
        block, turn = self._block(word, w, 30), w.values.get("IPA", 0.0)
        first, second, _ = PLANES[self.plane]
        if word in ("CT", "CTP"):
            self.motion = 10
            end = np.array(self._target(block), dtype=np.float64)
            centre, clockwise = tangent_arc(start, end, self.leaving())
            block.words = type(block.words)(
                {k: v for k, v in block.words.items() if k not in ("AP", "RP")}
                | dict(zip("XYZ", (end / self.scale).tolist(), strict=True))
            )
        else:
            if word == "CP" and turn:
                if {"DR+", "DR-"} & w.flags and self.right_hand != (turn > 0.0):
                    raise StatementError("CP whose DR and IPA have different signs", "one direction", code="P011")
                self.right_hand = turn > 0.0
            if self.right_hand is None:
                raise StatementError("an arc without its direction", "DR+ or DR-", code="P011")
            clockwise, centre = not self.right_hand, np.array(self.pole, dtype=np.float64)
        block.codes = [20 if clockwise else 30]
        if word == "CR":
            if "R" not in w.values:
                raise StatementError("CR without its radius", "R+10 or R-10", code="P011")
            block.words["R"] = w.values["R"]
        elif word == "CP":
            block.words["P"] = max(1.0, math.ceil(abs(turn) / 360.0 - 1e-9))
        elif np.isnan(centre[[first, second]]).any():
            raise StatementError(f"{word} without its centre", "CC before it", code="P011")
        else:
            block.words |= {"IJK"[k]: (centre[k] - start[k]) / self.scale for k in (first, second)}
        self.arc_absolute = False
        self._run(block, w)
