"""Modes of a G-code program: what G and M codes mean here, and what stays in force from block to block."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from machining.toolpaths.gcode import harmless
from machining.toolpaths.gcode.arcs import CYCLES, PLANES
from machining.toolpaths.gcode.frames import CoordinateFrame, turned
from machining.toolpaths.gcode.harmless import shown
from machining.toolpaths.gcode.splines import CUBIC, NURBS, NURBS_END, QUADRATIC
from machining.toolpaths.gcode.values import Values
from machining.toolpaths.gcode.words import Block
from machining.toolpaths.motions import Feed, Tool
from machining.toolpaths.options import UNITS, ReadOptions
from machining.toolpaths.program import Program
from machining.toolpaths.recorder import StatementError, Vector
from machining.toolpaths.source import readable
from robots.arrays import Array

# Codes in tenths: G43.4 is 434. Those that set one mode, and to what.
SETS: dict[int, tuple[str, int | bool | None]] = {
    **{code: ("motion", code) for code in (0, 10, 20, 30, *CYCLES)},
    800: ("motion", None),
    **{code: ("plane", code) for code in PLANES},
    **{code: ("absolute", code == 900) for code in (900, 910)},
    **{code: ("arc_absolute", code == 901) for code in (901, 911)},
    **{code: ("back_to_initial", code == 980) for code in (980, 990)},
}
FeedMode = Literal["inverse", "minute", "turn"]
FEED_MODES: dict[int, FeedMode] = {930: "inverse", 940: "minute", 950: "turn"}
LENGTHS = {200: 25.4e-3, 210: 1e-3, 7000: 25.4e-3, 7100: 1e-3}
OFFSETS = {
    **{10 * n: f"G{n}" for n in range(54, 60)},
    **{590 + n: f"G59.{n}" for n in (1, 2, 3)},
    **{10 * n: f"G{n}" for n in (500, *range(505, 600))},
}
# Modes of which one block sets one.
GROUPS = (
    (0, 10, 20, 30, 50, 51, 52, 53, *CYCLES),
    tuple(PLANES),
    (900, 910),
    (901, 911),
    (980, 990),
    tuple(FEED_MODES),
    tuple(LENGTHS),
    tuple(OFFSETS),
    (400, 410, 411, 420, 421),
    (430, 434, 440, 490),
    (680, 682, 690),
    (700, 710),
)
TCP_ON = (434, 2340)
# Codes of cutter compensation, and those that have a meaning of their own.
COMPENSATED = (410, 411, 420, 421)
OWN = (
    40,
    52,
    53,
    100,
    921,
    922,
    923,
    280,
    300,
    520,
    530,
    531,
    1530,
    680,
    682,
    690,
    700,
    710,
    920,
    1100,
    1110,
    1120,
    *COMPENSATED,
)
# Codes that move the tool, or move or turn its coordinates, in a way that is not read here.
REFUSED = {
    CUBIC: "a spline of LinuxCNC in files named .ngc, or another move",
    QUADRATIC: "a spline of LinuxCNC in files named .ngc, or another move",
    NURBS: "a NURBS of LinuxCNC in files named .ngc",
    NURBS_END: "a NURBS of LinuxCNC in files named .ngc",
    60: "a NURBS",
    62: "a NURBS",
    70: "diameters for X",
    120: "a circular pocket",
    130: "a circular pocket",
    121: "polar interpolation",
    160: "polar coordinates",
    171: "a plane of U V W",
    181: "a plane of U V W",
    191: "a plane of U V W",
    290: "a return from home",
    310: "probing",
    320: "threading",
    330: "threading",
    331: "rigid tapping",
    382: "probing",
    383: "probing",
    384: "probing",
    385: "probing",
    435: "tool axes as vectors",
    510: "scaling",
    511: "mirroring",
    650: "a macro call",
    660: "a macro call",
    600: "an approach from one side",
    281: "a place of the machine",
    301: "a place of the machine",
    720: "a cycle of lathes",
    740: "left-hand tapping",
    750: "a cycle of lathes",
    760: "threading or fine boring",
    870: "back boring",
    880: "boring with a stop by hand",
    2540: "a tilted plane",
    1070: "cylindrical interpolation",
    71: "cylindrical interpolation",
    161: "polar coordinates",
    270: "a move to a place of the machine",
    431: "offsets of the tool",
    432: "offsets of the tool",
}
# Words of Siemens that move the tool or its coordinates, or change its feed, and are not read here.
REFUSED_WORDS = frozenset(
    (
        "BSPLINE",
        "ASPLINE",
        "CSPLINE",
        "POLY",
        "INVCW",
        "INVCCW",
        "PTP",
        "PTPG0",
        "ROTS",
        "AROTS",
        "CROTS",
        "SCALE",
        "ASCALE",
        "MIRROR",
        "AMIRROR",
        "TOROT",
        "TOFRAME",
        "PAROT",
        "TRAANG",
        "TRANSMIT",
        "TRACYL",
        "TRACON",
        "TOFFON",
        "CUTMOD",
        "FLIN",
        "FCUB",
        "FGROUP",
        "EXTCALL",
        "CALL",
    )
)
# M codes: calls move the tool as another program says.
CALLS = (97, 98, 198)
ENDS = (2, 17, 30, 99)
STOPS = {0: "stop", 1: "optional stop", 60: "stop"}
COOLANT = {7: "mist", 8: "flood", 9: "off", 88: "through", 89: "off"}
TURNING = (3, 4, 5, 13, 14, 19)
COMPENSATION = "points of the part's edge, or of the tool's centre where only wear is compensated: it is not said which"
REMEDY_COMPENSATION = (
    "post with compensation by the computer; where the points are the tool's centre: --read compensation=centre"
)
REMEDY_START = "say where the tool stands first, in mm: --read start=X,Y,Z (start= in Python)"
REMEDY_MACRO = "post the program without loops and calls, or let the control's simulator write it out"


# Modes that M70 keeps for M72.
KEPT = (
    "unit",
    "plane",
    "absolute",
    "arc_absolute",
    "feed_mode",
    "back_to_initial",
    "feed",
    "speed",
    "sense",
    "offset",
)
KNOWN_CODES = "codes that are read, or are certain to change nothing about the path"
KNOWN_FUNCTIONS = "M functions of spindle, coolant, tools and stops"


def remedy_ignore(word: str) -> str:
    """What to do about a word that may be harmless on the machine at hand."""
    return f"post the program without it, or, where it changes nothing about the path: --read ignore={word}"


KNOWN = frozenset((*SETS, *OWN, *harmless.CODES, *TCP_ON, *FEED_MODES, *LENGTHS, *OFFSETS))
# Codes and M functions that are never harmless, whatever the caller says.
NEEDED = {
    "G": (KNOWN | REFUSED.keys()) - harmless.CODES.keys() | {CUBIC, QUADRATIC},
    "M": frozenset(10 * number for number in (*CALLS, *ENDS, *TURNING, 6, 61, 70, 71, 72)),
}


class Modes(Program):
    """Modes, position and feed; codes and words of a block are taken by :meth:`take` before its motion."""

    harmless = harmless.ALL
    # Whether the file is one of Siemens' controls or of LinuxCNC: some codes and words mean something else there.
    siemens = linuxcnc = False
    # Whether the program has ended, and calls within calls.
    over, depth = False, 0

    def __init__(self, path: Path, options: ReadOptions) -> None:
        super().__init__(path, options)
        self.values = Values()
        self.motion: int | None = None
        self.plane = 170
        self.absolute, self.arc_absolute = True, options.arc_absolute
        self.feed_mode: FeedMode = "minute"
        self.back_to_initial = True
        self.tcp = options.tcp
        self.unit = None if options.units is None else UNITS[options.units]
        self.here: list[float | None] = [None, None, None] if options.start is None else list(options.start)
        self.angles = {"A": 0.0, "B": 0.0, "C": 0.0}
        # Before the block that is read.
        self.angles_before = dict(self.angles)
        # Words of a cycle stay in force while it is on; the height before it is where G98 returns to.
        self.sticky: dict[str, float] = {}
        self.initial: float | None = None
        self.offset = ""
        self.used_offset: str | None = None
        self.shift, self.frame = np.zeros(3), CoordinateFrame()
        # Origin of coordinates that G68 has turned, m; None: they are not turned. Pole of polar coordinates, m.
        self.unturned: Array | None = None
        self.pole: list[float | None] = [0.0, 0.0, 0.0]
        self.feed = math.nan
        self.speed, self.sense = math.nan, 0
        self.surface_speed = False
        self.tool, self.selected, self.named = Tool(), -1, ""
        self.inverse_given = False
        # Whether the tool's length counts; None: no code has said.
        self.length: bool | None = None
        self.kept: dict[str, Any] | None = None
        # What has moved the origin of coordinates.
        self.origin_by = ""
        # DIAMON, DIAM90 or none: X is a diameter, or where it is absolute.
        self.diameter = ""

    @property
    def scale(self) -> float:
        """Metres in the unit of length; a fault of the file once if none is stated."""
        if self.unit is None:
            self.recorder.error(
                self.line,
                "coordinates before a unit of length",
                code="P003",
                allowed="G20 or G21",
                remedy="say it: --units mm or inch (units= in Python)",
            )
            self.unit = UNITS["mm"]
        return self.unit

    @property
    def spindle(self) -> float:
        """Spindle rad/s, signed; NaN by cutting speed."""
        if self.sense == 0:
            return 0.0
        return math.nan if self.surface_speed else self.sense * self.speed

    def skips_deleted(self, raw: str) -> bool:
        """Whether a block that starts with a slash is left out, as an event; else a note says that it is read."""
        if self.options.skip_deleted:
            self.recorder.event(self.line, "/", readable(raw))
        else:
            self.recorder.note(self.line, "a block that '/' may delete is read; --read skip_deleted=yes leaves it out")
        return self.options.skip_deleted

    def take(self, b: Block) -> None:
        """Take modes, feed, speed, tool and switches of a block."""
        # G80 ends a cycle, and a motion code of its block holds, wherever it stands.
        codes = sorted(b.codes, key=lambda code: code != 800) if len(b.codes) > 1 else b.codes
        for code in codes:
            self._code(code, b)
        if "F" in b.words and 40 not in b.codes:
            if not b.words["F"] > 0.0:
                raise StatementError(f"feed {b.words['F']:g}", "more than 0", code="P004")
            self.feed, self.inverse_given, self.dirty = b.words["F"], True, True
        else:
            self.inverse_given = False
        if "S" in b.words and 920 not in b.codes:
            if b.words["S"] < 0.0:
                raise StatementError(f"spindle speed {b.words['S']:g}", "0 or more", code="P004")
            self.speed, self.dirty = b.words["S"] * 2.0 * math.pi / 60.0, True
            if self.sense and not set(TURNING) & set(b.misc):
                self._turn()
        if "T" in b.words:
            self.selected, self.named = int(b.words["T"]), ""
        elif b.tool:
            self.selected, self.named = -1, b.tool
        for number in b.misc:
            self._misc(number, b)

    def _code(self, code: int, b: Block) -> None:
        if code in SETS:
            setattr(self, *SETS[code])
        elif code in LENGTHS or code in (700, 710):
            if code in (700, 710) and b.words.keys() & set("PQUW"):
                raise StatementError(f"{shown(code)}: a cycle of lathes", "G70, G71 for inches and mm", code="P019")
            new = LENGTHS.get(code, UNITS["inch"] if code == 700 else UNITS["mm"])
            self.feed = self.feed * (self.unit / new) if self.unit is not None else self.feed
            self.unit = new
        elif code in FEED_MODES:
            if FEED_MODES[code] != self.feed_mode:
                # A feed of one kind means nothing in another.
                self.feed = math.nan
            self.feed_mode, self.dirty = FEED_MODES[code], True
        elif code in OFFSETS:
            self._work_offset(OFFSETS[code])
        elif code in TCP_ON:
            self.tcp, self.length = True, True
            self.recorder.event(self.line, shown(code))
        elif code in COMPENSATED:
            self.compensated(shown(code))
        elif code in (NURBS, NURBS_END) or (code in (CUBIC, QUADRATIC) and b.words.keys() & set("XYIJ")):
            self.motion = code
        elif code in (430, 440, 490):
            # Behind G49 coordinates are those of the spindle, where a length was on before.
            self.length = False if code == 490 and self.length is not None else True if code != 490 else None
            self.tcp = self.tcp if code != 490 else self.options.tcp
            self.changes_nothing(shown(code))
        elif code in (960, 970):
            self.surface_speed, self.dirty = code == 960, True
        elif (
            not self.changes_nothing(shown(code), "".join(f"{k}{v:g}" for k, v in b.words.items()))
            and code not in KNOWN
        ):
            raise StatementError(f"{shown(code)} is not known", KNOWN_CODES, remedy_ignore(shown(code)), code="P019")

    def compensated(self, word: str) -> None:
        """Cutter compensation begins: points may lie on the part's edge."""
        if self.options.compensation == "error":
            raise StatementError(
                f"{word}: {COMPENSATION}", "G40: points of the tool's centre", REMEDY_COMPENSATION, code="P015"
            )
        self.recorder.event(self.line, word, note=f"{word}: points are taken as the tool's centre, as asked")

    def _misc(self, number: int, b: Block) -> None:
        if number in TURNING:
            self.sense, self.dirty = {3: 1, 13: 1, 4: -1, 14: -1}.get(number, 0), True
            self._turn()
            if number in (13, 14):
                self.recorder.command(self.line, "coolant", text="flood", word="COOLNT")
        elif number == 6:
            self._change_tool()
        elif number == 61:
            # The number of the tool that is in the spindle already.
            self.selected, self.named = int(b.words.get("Q", -1.0)), ""
            self._change_tool()
        elif number in (70, 71, 72):
            self._modes_kept(number)
        elif number in COOLANT:
            self.recorder.command(self.line, "coolant", text=COOLANT[number], word="COOLNT")
        elif number not in STOPS and number not in ENDS and not self.changes_nothing(f"M{number}"):
            raise StatementError(f"M{number} is not known", KNOWN_FUNCTIONS, remedy_ignore(f"M{number}"), code="P019")

    def _modes_kept(self, number: int) -> None:
        """M70 keeps modes, M72 takes them back, M71 forgets them (LinuxCNC)."""
        if number == 72:
            if self.kept is None or any(self.kept[name] != getattr(self, name) for name in ("sense", "offset")):
                raise StatementError(
                    "M72 without M70, or with another work offset or spindle", "M70 before it", code="P019"
                )
            vars(self).update(self.kept, dirty=True)
        else:
            self.kept = {name: getattr(self, name) for name in KEPT} if number == 70 else None

    def _change_tool(self) -> None:
        """M6: the tool that T has named goes into the spindle."""
        if self.selected < 0 and not self.named:
            self.recorder.note(self.line, "M6 without a tool number before it")
            return
        number = None if self.selected < 0 else self.selected
        new = Tool(number=number, name=self.named)
        if new != self.tool and len(self.recorder) and not self.recorder.rapids[-1]:
            # It is in the cut, and does not leave that by a word of its own.
            self._put_state(math.nan)
            self.recorder.away(self.line, "M6")
        self.tool, self.dirty = new, True
        # A change of tool leaves the spindle stopped (RS-274/NGC, M6).
        self.sense = 0
        text = self.named or f"T{self.selected}"
        self.recorder.tool_change(self.line, "LOADTL", text, number=number, stated=True)

    def _turn(self) -> None:
        """A command to the spindle, by the state that it is in now."""
        text = {1: "CLW", -1: "CCLW", 0: "OFF"}[self.sense]
        self.recorder.command(self.line, "spindle", self.spindle, text, "SPINDL")

    def stop(self, b: Block) -> None:
        """Stops and the end of the program, which come after the motion of their block."""
        for number in b.misc:
            if number in STOPS:
                self.recorder.command(
                    self.line, STOPS[number], text=f"M{number}", word="STOP" if number != 1 else "OPSTOP"
                )
            elif number in ENDS:
                self.recorder.event(self.line, "END", f"M{number}")
                if number not in (17, 99):
                    # M2 and M30 stop spindle and coolant (RS-274/NGC, NISTIR 6556, program stopping).
                    self.recorder.finish(self.line, f"M{number}")

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
            self.recorder.note(
                self.line, f"{name}: coordinates are in its frame; its origin is the caller's", code="W040"
            )

    def target(self, b: Block) -> list[float | None]:
        """Coordinates m behind the block; None where they are not known."""
        out = list(self.here)
        for i, letter in enumerate("XYZ"):
            if letter in b.words:
                value, old = b.words[letter] * self.scale, out[i]
                absolute = b.own.get(letter, self.absolute)
                if i == 0 and (self.diameter == "DIAMON" or (self.diameter == "DIAM90" and absolute)):
                    value /= 2.0
                if absolute:
                    out[i] = value
                else:
                    out[i] = None if old is None else old + value
        return out

    def lose(self, b: Block, word: str) -> None:
        """Forget where the tool stands along the axes that a block left out has."""
        self.leave([i for i, letter in enumerate("XYZ") if letter in b.words], word)

    def leave(self, axes: Sequence[int], word: str) -> None:
        """Along some axes the tool goes where the file does not say, as ``word`` tells it: the robot retracts."""
        for i in axes:
            self.here[i] = None
        if axes and len(self.recorder):
            self._put_state(math.nan)
            self.recorder.away(self.line, word)

    def leave_by(self, machine: Sequence[int], word: str) -> None:
        """As :meth:`leave`, by axes of the machine: in a turned frame they change others, with a head or a table."""
        turned = np.abs(self.frame.turn[list(machine)]).max(axis=0, initial=0.0) > 1e-9
        self.leave(sorted({*machine, *np.flatnonzero(turned).tolist()}), word)

    def shifted(self, point: Vector) -> Vector:
        """Point of the frame in force, with the work offset added."""
        if not self.frame.plain:
            x, y, z = self.frame.out(np.array(point)).tolist()
            point = x, y, z
        x, y, z = point[0] + float(self.shift[0]), point[1] + float(self.shift[1]), point[2] + float(self.shift[2])
        if self.turns_part:
            x, y, z = self.in_part(np.array([x, y, z])).tolist()
        return x, y, z

    def placed(self, points: Array) -> Array:
        """Points (n, 3) m of the frame in force, with the work offset added."""
        return self.in_part(self.frame.out(points) + self.shift)

    @property
    def turns_part(self) -> bool:
        """Whether X Y Z are the machine's and a table turns the part under the tool."""
        return self.options.pivot is not None and not self.tcp and self.options.rotary.startswith("table")

    @property
    def iso_angles(self) -> dict[str, float]:
        """Angles rad of the rotary axes in the sense of ISO 841."""
        return {k: -v if k in self.options.rotary_reversed else v for k, v in self.angles.items()}

    def in_part(self, points: Array) -> Array:
        """Points (..., 3) m of the machine's axes in the part that a table has turned; or as they are (TCP).

        As in :func:`machining.toolpaths.tool_axis` the part is turned back by Rz(C) Rx(A) or Rz(C) Ry(B), about the
        pivot.
        """
        if not self.turns_part or not any(self.angles.values()):
            return points
        tilt, angles, pivot = self.options.rotary.rpartition("-")[2][0], self.iso_angles, np.array(self.options.pivot)
        R = turned("zx" if tilt == "A" else "zy", [math.degrees(angles[k]) for k in ("C", tilt)])
        return np.asarray((points - pivot) @ R.T + pivot)

    def put_into(self, frame: CoordinateFrame) -> None:
        """Take another frame for the coordinates to come; the tool stays where it is."""
        here, old = self.here, self.frame
        self.frame = frame
        if any(self.pole):
            # Controls differ in whether a pole that was set moves on with the frame.
            self.pole = [None, None, None]
        if None not in here:
            self.here = frame.into(old.out(np.array(here, dtype=np.float64))).tolist()
        elif (frame.turn == old.turn).all():
            moved = (old.shift - frame.shift) @ frame.turn
            self.here = [None if v is None else v + float(d) for v, d in zip(here, moved, strict=True)]
        else:
            self.here = [None, None, None]

    def commit(self, length: float, reverse: bool = False) -> None:
        """Put feed, spindle and tool of the moves to come into the recorder; ``length`` m of the move at feed."""
        if self.used_offset != self.offset:
            self._use_offset()
        if self.feed_mode == "inverse" and not math.isnan(length) and not self.inverse_given:
            raise StatementError("a move at inverse time without F", "F in each block under G93", code="P022")
        self._put_state(length, reverse)

    def _put_state(self, length: float, reverse: bool = False) -> None:
        if not self.dirty and self.feed_mode != "inverse" and not reverse:
            return
        if self.tool == Tool() and (self.selected >= 0 or self.named):
            self.tool = Tool(number=None if self.named else self.selected, name=self.named)
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
        # A control begins with G54, whose word may come late.
        other = self.used_offset is not None and (self.used_offset or "G54") != (self.offset or "G54")
        if other and self.options.frames == "one":
            missing = [n for n in (self.used_offset, self.offset) if n not in self.options.offsets]
            if missing:
                self.used_offset = self.offset
                what = f"motion in {self.offset or 'no offset'} behind motion in another work offset"
                named = " ".join(f"--read {name}=X,Y,Z" for name in missing if name)
                remedy = (
                    f"say where each has its origin, in mm: {named or '--read G54=X,Y,Z'} (offsets= in Python), "
                    "or take coordinates as written: --read frames=written"
                )
                raise StatementError(what, "one work offset", remedy, code="P013")
        self.used_offset = self.offset
