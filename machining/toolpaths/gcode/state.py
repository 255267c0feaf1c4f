"""Modes of a G-code program: what stays in force from block to block."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from machining.toolpaths.gcode import modes
from machining.toolpaths.gcode.words import Block
from machining.toolpaths.motions import Feed, Tool
from machining.toolpaths.options import UNITS, ReadOptions
from machining.toolpaths.recorder import Recorder, StatementError, Vector


class Modes:
    """Modes, position and feed; codes and words of a block are taken by :meth:`take` before its motion."""

    def __init__(self, path: Path, options: ReadOptions) -> None:
        self.options, self.recorder = options, Recorder(path.name, options.max_moves)
        self.line = 0
        self.motion: int | None = None
        self.plane = 170
        self.absolute, self.arc_absolute = True, options.arc_absolute
        self.feed_mode: modes.FeedMode = "minute"
        self.back_to_initial = True
        self.tcp = options.tcp
        self.unit = None if options.units is None else UNITS[options.units]
        self.here: list[float | None] = [None, None, None] if options.start is None else list(options.start)
        self.angles = {"A": 0.0, "B": 0.0, "C": 0.0}
        self.axis: Vector = (0.0, 0.0, 1.0)
        # Words of a cycle stay in force while it is on; the height before it is where G98 returns to.
        self.sticky: dict[str, float] = {}
        self.initial: float | None = None
        self.offset = ""
        self.used_offset: str | None = None
        self.shift = np.zeros(3)
        self.feed = math.nan
        self.speed, self.sense = math.nan, 0
        self.surface_speed = False
        self.tool, self.selected = Tool(), -1
        self.inverse_given = False
        self.dirty = True

    @property
    def scale(self) -> float:
        """Metres in the unit of length; a fault of the file once if none is stated."""
        if self.unit is None:
            self.recorder.error(
                self.line,
                "coordinates before a unit of length",
                allowed="G20 or G21",
                remedy="pass units='mm' or 'inch'",
            )
            self.unit = UNITS["mm"]
        return self.unit

    @property
    def spindle(self) -> float:
        """Spindle rad/s, signed; NaN by cutting speed."""
        if self.sense == 0:
            return 0.0
        return math.nan if self.surface_speed else self.sense * self.speed

    def take(self, b: Block) -> None:
        """Take modes, feed, speed, tool and switches of a block."""
        for code in b.codes:
            self._code(code, b)
        if "F" in b.words and 40 not in b.codes:
            if not b.words["F"] > 0.0:
                raise StatementError(f"feed {b.words['F']:g}", "more than 0")
            self.feed, self.inverse_given, self.dirty = b.words["F"], True, True
        else:
            self.inverse_given = False
        if "S" in b.words and 920 not in b.codes:
            if b.words["S"] < 0.0:
                raise StatementError(f"spindle speed {b.words['S']:g}", "0 or more")
            self.speed, self.dirty = b.words["S"] * 2.0 * math.pi / 60.0, True
        if "T" in b.words:
            self.selected = int(b.words["T"])
        for number in b.misc:
            self._misc(number)

    def _code(self, code: int, b: Block) -> None:
        if code in modes.SETS:
            setattr(self, *modes.SETS[code])
        elif code in modes.LENGTHS or (code in (700, 710) and not b.words):
            new = modes.LENGTHS.get(code, UNITS["inch"] if code == 700 else UNITS["mm"])
            self.feed = self.feed * (self.unit / new) if self.unit is not None else self.feed
            self.unit = new
        elif code in modes.FEED_MODES:
            if modes.FEED_MODES[code] != self.feed_mode:
                # A feed of one kind means nothing in another.
                self.feed = math.nan
            self.feed_mode, self.dirty = modes.FEED_MODES[code], True
        elif code in modes.OFFSETS:
            self._work_offset(modes.OFFSETS[code])
        elif code in modes.TCP_ON:
            self.tcp = True
            self.recorder.event(self.line, modes.shown(code))
        elif code in modes.COMPENSATED:
            text = "points are taken as the tool's centre, the control's offset is not read"
            self.recorder.event(self.line, modes.shown(code), note=f"{modes.shown(code)}: {text}")
        elif code in (960, 970):
            self.surface_speed, self.dirty = code == 960, True
        elif code in (50, 51, *modes.QUIET):
            if code == 490:
                self.tcp = self.options.tcp
            self.recorder.event(self.line, modes.shown(code), "".join(f"{k}{v:g}" for k, v in b.words.items()))
        elif code not in modes.KNOWN:
            self.recorder.event(self.line, modes.shown(code), note=f"{modes.shown(code)} is not read")

    def _misc(self, number: int) -> None:
        if number in (3, 4, 5, 13, 14, 19):
            self.sense, self.dirty = {3: 1, 13: 1, 4: -1, 14: -1}.get(number, 0), True
        elif number == 6:
            if self.selected < 0:
                self.recorder.note(self.line, "M6 without a tool number before it")
            else:
                self.tool, self.dirty = Tool(number=self.selected), True
            self.recorder.event(self.line, "LOADTL", f"T{self.selected}" if self.selected >= 0 else "")
        elif number in modes.COOLANT:
            self.recorder.event(self.line, "COOLNT", modes.COOLANT[number])
        elif number in modes.STOPS:
            self.recorder.event(self.line, modes.STOPS[number], f"M{number}")
        else:
            self.recorder.event(self.line, f"M{number}", note=f"M{number} is not read")

    def _work_offset(self, name: str) -> None:
        if name == self.offset:
            return
        self.recorder.event(self.line, name)
        new = self.options.offsets.get(name)
        old_known = self.offset in self.options.offsets or not self.offset
        target = np.zeros(3) if new is None else np.array(new)
        if new is not None and old_known:
            moved = self.shift - target
            self.here = [None if v is None else v + float(d) for v, d in zip(self.here, moved, strict=True)]
        elif self.offset and self.options.frames != "written":
            # Where the tool stands in the new frame is not known.
            self.here = [None, None, None]
        self.offset, self.shift = name, target
        if new is None:
            self.recorder.note(self.line, f"{name}: coordinates are in its frame; its origin is the caller's")

    def target(self, b: Block) -> list[float | None]:
        """Coordinates m behind the block; None where they are not known."""
        out = list(self.here)
        for i, letter in enumerate("XYZ"):
            if letter in b.words:
                value, old = b.words[letter] * self.scale, out[i]
                if self.absolute:
                    out[i] = value
                else:
                    out[i] = None if old is None else old + value
        return out

    def lose(self, b: Block) -> None:
        """Forget where the tool stands along the axes that a block left out has."""
        for i, letter in enumerate("XYZ"):
            if letter in b.words:
                self.here[i] = None

    def shifted(self, point: Vector) -> Vector:
        """Point with the work offset added."""
        return (point[0] + float(self.shift[0]), point[1] + float(self.shift[1]), point[2] + float(self.shift[2]))

    def commit(self, length: float, reverse: bool = False) -> None:
        """Put feed, spindle and tool of the moves to come into the recorder; ``length`` m of the move at feed."""
        if self.used_offset != self.offset:
            self._use_offset()
        if self.feed_mode == "inverse" and not math.isnan(length) and not self.inverse_given:
            raise StatementError("a move at inverse time without F", "F in each block under G93")
        if not self.dirty and self.feed_mode != "inverse" and not reverse:
            return
        if self.tool.number is None and self.selected >= 0:
            self.tool = Tool(number=self.selected)
            self.recorder.note(self.line, "a tool is taken from T without M6")
        spindle = self.spindle
        self.recorder.state(self._feed_speed(length), -spindle if reverse else spindle, self.tool, "")
        self.dirty = reverse

    def _feed_speed(self, length: float) -> float:
        if math.isnan(self.feed):
            return math.nan
        if self.feed_mode == "inverse":
            return length * self.feed / 60.0 or math.nan
        return Feed(self.feed * self.scale, self.feed_mode).speed(self.spindle)

    def _use_offset(self) -> None:
        if self.used_offset and self.options.frames == "one":
            missing = [n for n in (self.used_offset, self.offset) if n not in self.options.offsets]
            if missing:
                self.used_offset = self.offset
                what = f"motion in {self.offset or 'no offset'} behind motion in another work offset"
                remedy = f"pass offsets for {', '.join(missing)}, or frames='written'"
                raise StatementError(what, "one work offset", remedy)
        self.used_offset = self.offset
