"""Cycles of conversational programs: what CYCL DEF defines, and the calls of drill cycles."""

from __future__ import annotations

import math
import re
from functools import partial
from pathlib import Path

from machining.toolpaths.gcode.words import Block
from machining.toolpaths.heidenhain.cycles import DRILLS, FMAX, hole, known, parameters, pecked
from machining.toolpaths.heidenhain.frames import Frames
from machining.toolpaths.heidenhain.harmless import ALL, CHANGES, CYCLE_QUIET, CYCLE_ZERO, USED_MISC
from machining.toolpaths.heidenhain.words import REMEDY, VALUE, number
from machining.toolpaths.options import ReadOptions
from machining.toolpaths.recorder import StatementError
from machining.toolpaths.source import readable

REMEDY_POST = "post the program without it, with feeds in each minute"
REMEDY_LEFT_OUT = (
    "post the program without it; where it leaves path and feed alone, leave it out: --read unknown_motion=report "
    "(unknown_motion= in Python)"
)


class Definitions(Frames):
    """Cycles, and M functions that are none of a motion."""

    harmless = ALL

    def __init__(self, path: Path, options: ReadOptions) -> None:
        super().__init__(path, options)
        self.feed_scale, self.feed_of_tool = 1.0, math.nan
        self.cycle_number = 0
        self.old_cycle: dict[int, float] = {}
        self.modal_call = False
        # The cycle whose parameters may come in lines of their own.
        self.defining = 0

    def define(self, text: str) -> None:
        """CYCL DEF: a cycle and its parameters."""
        match = re.match(r"(\d+)(?:\.(\d+))?\s*(.*)$", text)
        if match is None:
            raise StatementError("CYCL DEF without its number", "CYCL DEF 200", code="P012")
        cycle, part, rest = int(match[1]), int(match[2] or 0), match[3]
        self.recorder.event(self.line, "CYCL DEF", readable(text)[:200])
        self.defining = cycle
        old = {7: self._datum_shift, 10: self._rotate, 19: self._working_plane, 1: self._pecking, 9: self._dwell}
        if cycle in (*old, 8, 11, 26):
            if not part and re.search(r"[\d#]", rest):
                raise StatementError(
                    f"CYCL DEF {cycle} with numbers behind its name", f"CYCL DEF {cycle}.1 for them", code="P012"
                )
            if part:
                old.get(cycle, partial(self._scaled, cycle))(part, rest)
        elif cycle in DRILLS:
            # A new cycle ends M89.
            self.cycle_number, self.modal_call = cycle, False
            for name in (*DRILLS[cycle], *CYCLE_ZERO, *CYCLE_QUIET):
                # What this definition does not give is not that of a cycle before.
                self.values.known.pop(f"#{name}", None)
            self.more_of_cycle(rest)
        elif cycle == 247:
            self.more_of_cycle(rest)
        elif f"cycle {cycle}" not in self.harmless:
            read = "cycles 1, 7, 9, 10, 200 to 203, 205 to 207, 209, 240, 247"
            self.left_out(f"cycle {cycle}", StatementError(f"cycle {cycle} is not read", read, REMEDY, code="P012"))
            self.cycle_number = 0

    def more_of_cycle(self, text: str) -> None:
        """Parameters of the cycle that is being defined."""
        given = parameters(text, self.values, self.feed_of_tool / self.feed_scale)
        if self.defining in DRILLS:
            known(self.defining, given)
        elif self.defining == 247:
            if given.keys() - {339}:
                raise StatementError("cycle 247 with other parameters than Q339", "Q339=+1", code="P012")
            if 339 in given:
                self._work_offset(f"preset {given[339]:g}")
        for name, value in given.items():
            self.values.known[f"#{name}"] = value

    def _use_offset(self) -> None:
        if self.used_offset is not None and self.options.frames == "one":
            before, now = self.used_offset or "the preset of before", self.offset
            self.used_offset = now
            raise StatementError(
                f"motion at {now} behind motion at {before}",
                "one preset",
                "post a program for each preset; where all are at one place, or coordinates are wanted as written: "
                "--read frames=written",
                code="P013",
            )
        self.used_offset = self.offset

    def _pecking(self, part: int, rest: str) -> None:
        self.cycle_number, self.modal_call = 1, False
        value = re.fullmatch(rf"[A-Z][A-Z .-]*?\s*({VALUE})", rest)
        if value is None or not 1 <= part <= 5:
            raise StatementError(
                f"part {part} of cycle 1", "1.1 SET UP, 1.2 DEPTH, 1.3 PECKG, 1.4 DWELL, 1.5 F", code="P012"
            )
        self.old_cycle[part] = number(value[1], self.values) * (self.feed_scale if part == 5 else 1.0)

    def _dwell(self, part: int, rest: str) -> None:
        value = re.fullmatch(rf"(?:[A-Z][A-Z .-]*?)?\s*({VALUE})", rest)
        if value is None:
            raise StatementError("cycle 9 without its time", "CYCL DEF 9.1 DWELL 0.5", code="P012")
        self.recorder.dwell(self.line, number(value[1], self.values))

    def _scaled(self, cycle: int, part: int, rest: str) -> None:
        """Cycles 8, 11 and 26: no mirroring and factors of 1 are read."""
        factors = re.findall(rf"(?:SCL|(?<!C)[XYZ])\s*({VALUE})", rest)
        left = re.sub(rf"(?:SCL|CC[XYZ]|[XYZ])\s*{VALUE}", "", rest).strip()
        if left or any(number(factor, self.values) != 1.0 for factor in factors):
            what = {8: "mirroring", 11: "scaling", 26: "scaling"}[cycle]
            raise StatementError(f"cycle {cycle}: {what}", "coordinates as they are", REMEDY, code="P013")

    def _drill_cycle(self) -> None:
        if self.cycle_number == 0:
            raise StatementError("a cycle is called and none is defined", "CYCL DEF before it", code="P012")
        self.require_placed()
        if self.cycle_number == 1:
            height = self.here[2]
            if height is None:
                raise StatementError("cycle 1 while Z is not known", "Z given before", code="P012")
            one = pecked(self.old_cycle, height, self.scale)
        else:
            q = {int(k[1:]): v for k, v in self.values.known.items() if k[1:].isdigit() and int(k[1:]) < 2000}
            for feed in (206, 208):
                if q.get(feed, FMAX) < FMAX:
                    q[feed] *= self.feed_scale
            one = hole(self.cycle_number, q, self.scale)
        plane, self.plane = self.plane, 170
        self.drill_here(one)
        self.plane = plane

    def _misc(self, number: int, b: Block) -> None:
        if number in USED_MISC:
            super()._misc(number, b)
        elif number in CHANGES:
            raise StatementError(
                f"M{number}: {CHANGES[number]}", "M functions that move nothing", REMEDY_POST, code="P019"
            )
        elif not self.changes_nothing(f"M{number}"):
            alone = "M functions that leave path and feed alone"
            self.left_out(f"M{number}", StatementError(f"M{number} is not read", alone, REMEDY_LEFT_OUT, code="P019"))
