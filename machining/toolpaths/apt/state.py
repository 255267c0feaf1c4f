"""Words of APT files that set the state of the machine: feed, spindle, tool, frame, unit, operation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from machining.toolpaths.apt import words
from machining.toolpaths.apt.frames import Frames
from machining.toolpaths.apt.units import length_unit
from machining.toolpaths.cycles import Cycle
from machining.toolpaths.motions import Tool
from machining.toolpaths.options import ReadOptions
from machining.toolpaths.recorder import Recorder, Vector
from machining.toolpaths.source import readable

Handler = Callable[[str], None]


class AptState:
    """State of an APT file while it is read, and its words; each handler takes the text behind the word."""

    def __init__(self, path: Path, options: ReadOptions) -> None:
        self.options = options
        self.recorder = Recorder(path.name, options.max_moves)
        self.scale = length_unit(path, options, self.recorder)
        self.frames = Frames(options.frames)
        self.line = 0
        self.axis: Vector = (0.0, 0.0, 1.0)
        self.rapid = False
        self.feed, self.spindle = words.Feed(), words.Spindle()
        # Data of the tool given since the last motion: they belong to the next one.
        self.tool, self.loaded = Tool(), False
        self.operation = ""
        self.cycle: Cycle | None = None
        # State that the recorder has not got yet; words that end the file behind the last motion.
        self.dirty = self.ended = True

    def state_words(self) -> dict[str, Handler]:
        """Handlers by word."""
        return {
            "FEDRAT": self._fedrat,
            "SPINDL": self._spindl,
            "DELAY": self._delay,
            "DWELL": self._delay,
            "UNITS": self._units,
            "UNIT": self._units,
            "TLAXIS": self._tlaxis,
            **{word: self._frame(word) for word in ("MSYS", "MCSYS", "CSYS", "TRANS", "ORIGIN")},
            "TOOL PATH": self._tool_path,
            "TLDATA": self._cutter("TLDATA"),
            "CUTTER": self._cutter("CUTTER"),
            "LOADTL": self._load,
            "LOAD": self._load,
            "TOOLNO": self._load,
            "CUTCOM": self._cutcom,
            "OPNAME": self._opname,
        }

    def _commit(self) -> None:
        fault = self.frames.use()
        if fault:
            self._fault("motion in a second frame", fault, "one frame", "pass frames='written' or frames='absolute'")
        sign = self.spindle.signed
        self.recorder.state(self.feed.speed(sign), sign, self.tool, self.operation)
        self.dirty = self.ended = self.loaded = False

    def _fault(self, what: str, value: str, allowed: str, remedy: str | None = None) -> None:
        self.recorder.error(self.line, what, value=value.strip() or None, allowed=allowed, remedy=remedy)

    def _fedrat(self, rest: str) -> None:
        parts = words.items(rest)
        if "RAPID" in parts:
            self.rapid = True
        elif "INVERS" in parts or "FPT" in parts:
            self.feed = words.Feed()
            self.recorder.note(self.line, f"FEDRAT/{rest.strip()}: the feed is not known")
        else:
            self.feed = words.feed(parts, self.scale, self.feed)
        self.dirty = True

    def _spindl(self, rest: str) -> None:
        self.spindle, remark = words.spindle(words.items(rest), self.spindle)
        self.dirty = True
        if remark:
            self.recorder.note(self.line, remark)

    def _delay(self, rest: str) -> None:
        parts = words.items(rest)
        turns = "REV" in parts
        seconds = words.numbers([part for part in parts if part not in ("REV", "SEC", "ON")], (1,))[0]
        if turns:
            if not self.spindle.signed > 0.0 and not self.spindle.signed < 0.0:
                raise words.WordError("a dwell in turns without a spindle speed", "SPINDL before it")
            seconds *= 2.0 * math.pi / abs(self.spindle.signed)
        self.recorder.dwell(self.line, seconds)

    def _units(self, rest: str) -> None:
        parts = words.items(rest)
        if len(parts) != 1 or parts[0] not in words.LENGTHS:
            raise words.WordError(f"unit of length {rest.strip()!r}", ", ".join(words.LENGTHS))
        if words.LENGTHS[parts[0]] != self.scale:
            raise words.WordError("the unit of length changes behind motion", "one unit, before the first motion")

    def _tlaxis(self, rest: str) -> None:
        x, y, z = words.numbers(words.items(rest), (3,))
        self.axis = self.frames.direction((x, y, z))

    def _frame(self, word: str) -> Handler:
        def frame(rest: str) -> None:
            self.recorder.event(self.line, word, rest)
            self.frames.set(word, words.items(rest), self.scale)
            self.dirty = True

        return frame

    def _tool_path(self, rest: str) -> None:
        parts = rest.split(",")
        self.operation = words.name(parts[0])
        self.tool = Tool(name=words.name(parts[2]) if len(parts) > 2 else "")
        self.loaded = self.dirty = True
        self.rapid, self.cycle = False, None
        self.recorder.event(self.line, "TOOL PATH", readable(rest))

    def _cutter(self, word: str) -> Handler:
        def cutter(rest: str) -> None:
            self._fresh()
            self.tool = words.tool_data(self.tool, words.items(rest), self.scale, word)

        return cutter

    def _load(self, rest: str) -> None:
        parts = words.items(rest)
        number = words.tool_number(parts)
        self.recorder.event(self.line, "LOADTL", readable(rest))
        if number is not None and number != self.tool.number:
            self._fresh()
            self.tool = replace(self.tool, number=number)

    def _fresh(self) -> None:
        if self.cycle is not None:
            self.cycle = None
            self._fault("a tool is changed while a cycle is on", "", "CYCLE/OFF before it", "find where the cycle ends")
        # Data of the tool before must not stay on the next one; data given since the last motion belong to it.
        if not self.loaded:
            self.tool, self.loaded = Tool(), True
        self.dirty = True

    def _opname(self, rest: str) -> None:
        self.operation, self.dirty = words.name(rest), True

    def _cutcom(self, rest: str) -> None:
        self.recorder.event(self.line, "CUTCOM", rest)
        if not {"OFF", "LENGTH"} & set(words.items(rest)):
            self.recorder.note(
                self.line, "CUTCOM: points are taken as the tool's centre, the control's offset is not read"
            )
