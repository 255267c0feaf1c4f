"""Words of APT files that set the state of the machine: feed, spindle, tool, frame, unit, operation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from machining.toolpaths.apt import words
from machining.toolpaths.apt.arcs import ArcWord
from machining.toolpaths.apt.words import Statement, numbers
from machining.toolpaths.cycles import Cycle
from machining.toolpaths.motions import Feed, Tool
from machining.toolpaths.options import ReadOptions
from machining.toolpaths.program import Program
from machining.toolpaths.recorder import StatementError, Vector
from machining.toolpaths.source import readable
from robots.arrays import Array

# What to do about motion in more than one frame.
FRAMES = "say which coordinates are wanted: --read frames=written or frames=absolute (frames= in Python)"
Handler = Callable[[Statement], None]

# Numbers of each word; MCSYS has words between them.
COUNTS = {"MSYS": 9, "MCSYS": 9, "CSYS": 12, "TRANS": 3, "ORIGIN": 3}
NONE = {
    "MSYS": (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0),
    "CSYS": (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0),
    "TRANS": (0.0, 0.0, 0.0),
    "ORIGIN": (0.0, 0.0, 0.0),
}


class Frames:
    """Frame words in force, and those that motion happened in.

    ``MSYS/x,y,z,xx,xy,xz,yx,yy,yz``: origin, x and y axis of the machine coordinate system in absolute coordinates;
    points of the file are in it. ``CSYS/`` (SolidWorks CAM, Creo): a 3 x 4 matrix. ``TRANS/`` is added by
    postprocessors, ``ORIGIN/`` taken away. ``upright``: z axis of the last CSYS of coordinates in the part.
    """

    def __init__(self, mode: str) -> None:
        self.mode = mode
        self.words: dict[str, tuple[float, ...]] = {}
        self.used: dict[str, tuple[float, ...]] | None = None
        self.told = False
        # TRNTYP/WORLD of SolidWorks CAM: coordinates stay those of the part, CSYS only tells the set-up's axes.
        self.world = False
        self.upright: Vector | None = None
        self.R, self.t = np.eye(3), np.zeros(3)

    @property
    def moves(self) -> bool:
        """Whether coordinates differ from those written."""
        return self.mode == "absolute"

    def set(self, word: str, parts: list[str], scale: float) -> None:
        """Take a frame word.

        Raises
        ------
        StatementError
            Numbers missing, axes that are not at right angles, a word whose sense is not known with "absolute".
        """
        if word == "MCSYS":
            parts, word = _mcsys(parts), "MSYS"
        values = numbers(parts, (COUNTS[word],))
        if word == "CSYS" and self.world:
            self.upright = values[2], values[6], values[10]
            return
        if self.mode == "absolute" and word == "CSYS":
            raise StatementError(
                "CSYS cannot be applied: vendors differ in its direction", "--read frames=written", code="P013"
            )
        self.words = {key: v for key, v in self.words.items() if key != word}
        if word == "MSYS":
            x, y = np.array(values[3:6]), np.array(values[6:9])
            if abs(np.linalg.norm(x) - 1.0) > 1e-3 or abs(np.linalg.norm(y) - 1.0) > 1e-3 or abs(x @ y) > 1e-3:
                raise StatementError(
                    "axes of MSYS that are not at right angles and of length 1", "two unit vectors", code="P013"
                )
        if any(abs(v - w) > 1e-9 for v, w in zip(values, NONE[word], strict=True)):
            self.words[word] = tuple(values)
        if self.mode == "absolute":
            self._absolute(scale)

    def _absolute(self, scale: float) -> None:
        system = np.array(self.words.get("MSYS", NONE["MSYS"]))
        x, y = system[3:6], system[6:9]
        x = x / np.linalg.norm(x)
        y = y - (y @ x) * x
        y /= np.linalg.norm(y)
        self.R = np.column_stack([x, y, np.cross(x, y)])
        shift = np.array(self.words.get("TRANS", NONE["TRANS"])) - np.array(self.words.get("ORIGIN", NONE["ORIGIN"]))
        self.t = (system[:3] + self.R @ shift) * scale

    def use(self) -> str | None:
        """Motion happens now: None, or the frame that is not the first one, once."""
        if self.used is None:
            self.used = self.words
        elif self.mode == "one" and self.words != self.used and not self.told:
            self.told = True
            return "; ".join(f"{word}/{','.join(map(str, v))}" for word, v in self.words.items()) or "none"
        return None

    def point(self, point: Vector) -> Vector:
        """Point m as asked for."""
        return self._moved(point, self.t) if self.moves else point

    def direction(self, direction: Vector) -> Vector:
        """Direction as asked for."""
        return self._moved(direction, 0.0) if self.moves else direction

    def _moved(self, vector: Vector, shift: Array | float) -> Vector:
        x, y, z = (self.R @ np.array(vector) + shift).tolist()
        return x, y, z


def _mcsys(parts: list[str]) -> list[str]:
    """Numbers of ``MCSYS/NUM,n,POINT,x,y,z,VECTOR,x,y,z,VECTOR,x,y,z`` without the number of the system."""
    if parts[:1] == ["NUM"]:
        parts = parts[2:]
    return [part for part in parts if part not in ("POINT", "VECTOR")]


class AptState(Program):
    """State of an APT file while it is read, and its words; each handler takes the text behind the word."""

    def __init__(self, path: Path, options: ReadOptions) -> None:
        super().__init__(path, options)
        self.scale = words.length_unit(path, options, self.recorder)
        self.frames = Frames(options.frames)
        self.rapid = False
        self.feed, self.spindle = Feed(), words.Spindle()
        # Data of the tool given since the last motion: they belong to the next one.
        self.tool, self.loaded = Tool(), False
        self.operation = ""
        self.here: Vector | None = None
        self.arc: ArcWord | None = None
        self.tangent: Array | None = None
        self.cycle: Cycle | None = None
        self.last_cycle: Cycle | None = None
        # Words that end the file behind the last motion.
        self.ended = True

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
            **dict.fromkeys(COUNTS, self._frame),
            "TRNTYP": self._transformed,
            "TOOL PATH": self._tool_path,
            "TLDATA": self._cutter,
            "CUTTER": self._cutter,
            "LOADTL": self._load,
            "LOAD": self._load,
            "TOOLNO": self._load,
            "CUTCOM": self._cutcom,
            "OPNAME": self._opname,
            "COOLNT": self._coolnt,
            "STOP": self._stop,
            "OPSTOP": self._stop,
        }

    def _commit(self) -> None:
        fault = self.frames.use()
        if fault:
            self.refuse(StatementError("motion in a second frame", "one frame", FRAMES, code="P013"), fault)
        sign = self.spindle.signed
        self.recorder.state(self.feed.speed(sign), sign, self.tool, self.operation)
        self.dirty = self.ended = self.loaded = False

    def _fedrat(self, s: Statement) -> None:
        self.feed = words.feed(s.parts, self.scale, self.feed)
        self.dirty = True

    def _spindl(self, s: Statement) -> None:
        self.spindle, remark = words.spindle(s.parts, self.spindle)
        self.dirty = True
        sense = "CLW" if self.spindle.sense > 0 else "CCLW"
        self.recorder.command(self.line, "spindle", self.spindle.signed, sense if self.spindle.on else "OFF", "SPINDL")
        if remark:
            self.recorder.note(self.line, remark)

    def _coolnt(self, s: Statement) -> None:
        kind = words.coolant(s.parts)
        if kind is None:
            text = f"COOLNT/{readable(s.rest).strip()} is no command here: ON, FLOOD, MIST, THRU or OFF are"
            self.recorder.event(self.line, "COOLNT", readable(s.rest), note=text)
            return
        self.recorder.command(self.line, "coolant", text=kind, word="COOLNT")

    def _stop(self, s: Statement) -> None:
        kind = "stop" if s.word == "STOP" else "optional stop"
        self.recorder.command(self.line, kind, text=readable(s.rest), word=s.word)

    def _delay(self, s: Statement) -> None:
        seconds = words.numbers([part for part in s.parts if part not in ("REV", "SEC")], (1,))[0]
        if "REV" in s.parts:
            if not self.spindle.signed > 0.0 and not self.spindle.signed < 0.0:
                raise StatementError("a dwell in turns without a spindle speed", "SPINDL before it", code="P022")
            seconds *= 2.0 * math.pi / abs(self.spindle.signed)
        self.recorder.dwell(self.line, seconds)

    def _units(self, s: Statement) -> None:
        if len(s.parts) != 1 or s.parts[0] not in words.LENGTHS:
            raise StatementError(f"unit of length {s.rest.strip()!r}", ", ".join(words.LENGTHS), code="P003")
        if words.LENGTHS[s.parts[0]] != self.scale:
            raise StatementError(
                "the unit of length changes behind motion", "one unit, before the first motion", code="P003"
            )

    def _tlaxis(self, s: Statement) -> None:
        x, y, z = s.numbers(3)
        self.axis = self.frames.direction((x, y, z))

    def _frame(self, s: Statement) -> None:
        self.recorder.event(self.line, s.word, s.rest)
        self.frames.set(s.word, s.parts, self.scale)
        if s.word == "CSYS" and self.frames.upright is not None:
            self.axis = self.frames.upright
        self.dirty = True

    def _transformed(self, s: Statement) -> None:
        self.recorder.event(self.line, s.word, readable(s.rest))
        if any(words.as_number(part) for part in s.parts):
            raise StatementError("a system other than the first one", "TRNTYP/WORLD,0,0,0", code="P013")
        self.frames.world = True

    def _tool_path(self, s: Statement) -> None:
        parts = s.rest.split(",")
        self.operation = words.name(parts[0])
        self.recorder.operation(self.line, self.operation, s.word)
        self.tool = Tool(name=words.name(parts[2]) if len(parts) > 2 else "")
        self.loaded = self.dirty = True
        self.rapid, self.cycle = False, None
        self.recorder.tool_change(self.line, "TOOL PATH", readable(s.rest), stated=False)

    def _cutter(self, s: Statement) -> None:
        if not self.loaded:
            self.recorder.tool_change(self.line, s.word, stated=False)
        self._fresh()
        self.tool = words.tool_data(self.tool, s.parts, self.scale, s.word)

    def _load(self, s: Statement) -> None:
        number = words.tool_number(s.parts)
        if number is not None and number == self.tool.number and not self.loaded:
            # The tool that is there: its number is given once more, nothing is changed.
            self.recorder.event(self.line, "LOADTL", readable(s.rest))
            return
        self.recorder.tool_change(self.line, "LOADTL", readable(s.rest), number=number, stated=True)
        if number is not None and number != self.tool.number:
            self._fresh()
            self.tool = replace(self.tool, number=number)

    def _fresh(self) -> None:
        if self.cycle is not None:
            self.cycle = None
            self.refuse(StatementError("a tool is changed while a cycle is on", "CYCLE/OFF before it", code="P012"))
        # Data of the tool before must not stay on the next one; data given since the last motion belong to it.
        if not self.loaded:
            self.tool, self.loaded = Tool(), True
        self.dirty = True

    def _opname(self, s: Statement) -> None:
        self.operation, self.dirty = words.name(s.rest), True
        self.recorder.operation(self.line, self.operation, s.word)

    def _cutcom(self, s: Statement) -> None:
        """Points of such files are places of the tool (cutter location data, ISO 3592): an offset adds its wear.

        A cutter without width has them on the part's edge.
        """
        if not {"OFF", "LENGTH"} & set(s.parts):
            if self.tool.diameter == 0.0 and self.options.compensation == "error":
                raise StatementError(
                    "CUTCOM with a cutter of diameter 0, whose points lie on the part's edge",
                    "the tool's diameter",
                    "post the tool's places; where the points are those: --read compensation=centre",
                    code="P015",
                )
            self.recorder.note(
                self.line, "CUTCOM: points are the tool's places; the control's offset, for wear, is not read"
            )
        self.recorder.event(self.line, "CUTCOM", s.rest)
