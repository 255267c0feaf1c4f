"""Datum shifts, rotations, tilted planes and rotary axes of conversational programs."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from machining.toolpaths.gcode.frames import CoordinateFrame, turned
from machining.toolpaths.gcode.motion import GcodeMotion
from machining.toolpaths.gcode.rotary import POINTING_SET
from machining.toolpaths.gcode.words import Block
from machining.toolpaths.heidenhain.words import REMEDY, VALUE, Words, number
from machining.toolpaths.options import ReadOptions
from machining.toolpaths.recorder import StatementError, Vector
from machining.toolpaths.source import readable
from robots.arrays import Array

_AXES = re.compile(rf"\s*(I?[XYZABC])\s*({VALUE})(?=[\s,A-Z]|$)")
_PLANE = re.compile(rf"SPATIAL((?:\s*SP[ABC]\s*{VALUE})*)\s*(.*)")
# How PLANE brings the tool upright to it, with a retract, a distance and a feed of its own; which of two solutions, and
# whether a table or the coordinates turn, leave the tool's place in the part as it is.
_BROUGHT = re.compile(
    rf"(STAY|TURN|MOVE)((?:\s*(?:MB\s*(?:MAX|{VALUE})|(?:DIST|ABST)\s*{VALUE}|F\s*(?:MAX|AUTO|{VALUE})|SEQ[-+]|SYM[-+]|"
    r"TABLE ROT|COORD ROT))*)"
)
_REMEDY_UPRIGHT = "PLANE ... TURN, or L A+Q120 B+Q121 C+Q122 with the axes of the machine behind it"


class Frames(GcodeMotion):
    """Where coordinates of a conversational program are, and where the tool points to."""

    def __init__(self, path: Path, options: ReadOptions) -> None:
        super().__init__(path, options)
        # In m of the frame in force.
        self.pole: list[float | None] = [None, None, None]
        self.polar = math.nan, math.nan
        self.datum, self.rotation = np.zeros(3), 0.0
        self.tilt: CoordinateFrame | None = None
        # The direction of the tool where PLANE has not brought it upright (None: it is), spatial angles of TCPM, and
        # whether a shift inside a tilted plane has moved coordinates until the plane is left.
        self.leans: Vector | None = None
        self.spatial: dict[str, float] | None = None
        self.shifted_inside = False

    def _rotary(self, w: Words, out: Block) -> None:
        """Rotary words of a statement, where they do not move the tip about the part (tool centre point control)."""
        given = {letter for letter in "ABC" if letter in out.words}
        if "SWIVEL" in w.flags:
            if self.tilt is None or given:
                raise StatementError(
                    "rotary axes as PLANE has worked them out", "behind PLANE SPATIAL, all of them", code="P013"
                )
            self.leave((0, 1, 2), "PLANE")
            self._upright(np.array(self.frame_axis))
        elif given and self.spatial is not None:
            if given & out.own.keys() or len(self.spatial | dict.fromkeys(given)) < len("ABC"):
                raise StatementError(
                    "spatial angles of TCPM (AXIS SPAT) that are not all known", "A, B and C", code="P013"
                )
            self.spatial |= {letter: out.words.pop(letter) for letter in given}
            x, y, z = (self.frame.turn @ turned("zyx", [self.spatial[k] for k in "CBA"])[:, 2]).tolist()
            self.leans = x, y, z
            if not {"X", "Y", "Z"} & out.words.keys():
                # The tool turns about its tip.
                out.words |= {k: v / self.scale for k, v in zip("XYZ", self.here, strict=True) if v is not None}
        elif given and not self.tcp and not self.turns_part:
            self._swivelled(w, out, given)

    def _swivelled(self, w: Words, out: Block, given: set[str]) -> None:
        """Rotary axes turn without tool centre point control, at a rapid: where the tip comes to is not known."""
        at_machine = bool({91, 92} & set(w.misc))
        if self.tilt is None and not at_machine and (out.codes != [0] or {"X", "Y", "Z"} & w.values.keys()):
            # Said as of every move that turns axes without tool centre point control.
            return
        old = self.angles
        self.angles = old | {
            k: math.radians(out.words.pop(k)) + (0.0 if out.own.pop(k, True) else old[k]) for k in given
        }
        if self.angles != old or self.leans is not None:
            self.leave((0, 1, 2), "rotary axes")
        if self.tilt is None:
            self.leans = None
            return
        wrong = [k for k, v in self.angles.items() if v and k not in self.options.rotary.rpartition("-")[2]]
        if wrong:
            raise StatementError(
                f"rotary axis {', '.join(wrong)} in a tilted plane with --rotary {self.options.rotary}",
                "L A+Q120 B+Q121 C+Q122 with the axes of the machine",
                "say how the axes turn: --rotary table-AC or head-BC (rotary= in Python)",
                code="P014",
            )
        self._upright(np.array(self._of_angles() if any(self.angles.values()) else (0.0, 0.0, 1.0)))

    def _upright(self, axis: Array) -> None:
        """The tool points along ``axis`` in the part: the normal of the plane, or it is a fault."""
        if float(np.linalg.norm(axis - np.array(self.frame_axis))) > 1e-4:
            raise StatementError(
                "rotary axes that do not bring the tool upright to the plane", "those of the plane", code="P013"
            )
        self.leans, self.angles = None, dict.fromkeys("ABC", 0.0)

    def require_placed(self) -> None:
        """Refuse motion whose coordinates or direction are the control's."""
        if self.shifted_inside:
            raise StatementError(
                "a move behind a datum that was moved inside a tilted plane", "PLANE RESET before", code="P013"
            )
        if self.leans is not None and not self.tcp:
            raise StatementError(
                "a move while the tool is not upright to the plane", None, _REMEDY_UPRIGHT, code="P013"
            )

    def _tool_axis(self, b: Block) -> Vector:
        if self.leans is None or not POINTING_SET.isdisjoint(b.words) or {"A", "B", "C"} & b.words.keys():
            self.leans = None
            return super()._tool_axis(b)
        return self.leans

    def _datum_shift(self, part: int, rest: str) -> None:
        """A part of cycle 7; inside a tilted plane only back to 0, before the plane is left."""
        at = 0
        while (found := _AXES.match(rest, at)) is not None:
            name, value, at = found[1], number(found[2], self.values) * self.scale, found.end()
            if name[-1] in "ABC" and value == 0.0:
                continue
            if name[-1] in "ABC" or (self.tilt is not None and (value or name.startswith("I"))):
                what = "a datum shift inside a tilted plane" if self.tilt is not None else f"a shift of axis {name}"
                raise StatementError(what, "X, Y and Z before PLANE", "PLANE RESET before it", code="P013")
            k = "XYZ".index(name[-1])
            if self.rotation and value and (name.startswith("I") or value != self.datum[k]):
                raise StatementError(
                    "a datum shift in turned coordinates", "cycle 7 before cycle 10", REMEDY, code="P013"
                )
            self.datum[k] = value + (self.datum[k] if name.startswith("I") else 0.0)
        if rest[at:].strip(" ,"):
            raise StatementError(
                f"{rest[at:].strip()[:30]!r}: a datum of the control's table", "X, Y, Z with numbers", code="P013"
            )
        # What coordinates inside the plane would count from then is the control's.
        self.shifted_inside = self.tilt is not None
        self._framed()

    def _rotate(self, part: int, rest: str) -> None:
        match = re.fullmatch(rf"(I?)ROT\s*({VALUE})", rest)
        if match is None:
            raise StatementError("cycle 10 without its angle", "CYCL DEF 10.1 ROT+30", code="P013")
        angle = number(match[2], self.values)
        if self.tilt is not None and (angle or match[1]):
            raise StatementError("a rotation inside a tilted plane", "PLANE RESET before it", REMEDY, code="P013")
        self.rotation = angle + (self.rotation if match[1] else 0.0)
        self.shifted_inside = self.tilt is not None
        self._framed()

    def _working_plane(self, part: int, rest: str) -> None:
        """Cycle 19: its angles are those of axes or of space, as the machine has it; 0 leaves a tilted plane."""
        found = re.fullmatch(rf"(?:[ABC]\s*({VALUE})\s*)?(?:[ABC]\s*({VALUE})\s*)?(?:[ABC]\s*({VALUE}))?", rest)
        if found is None or any(number(value, self.values) for value in found.groups() if value):
            raise StatementError(
                "cycle 19 with angles", "PLANE SPATIAL, or cycle 19 with angles of 0", REMEDY, code="P013"
            )
        self.plane_statement("RESET STAY")

    def datum_statement(self, text: str) -> None:
        """TRANS DATUM, as cycle 7 in one statement."""
        if text != "RESET" and not text.startswith("AXIS"):
            raise StatementError(
                f"TRANS DATUM {text[:20]}", "TRANS DATUM AXIS X Y Z, TRANS DATUM RESET", REMEDY, code="P013"
            )
        self._datum_shift(1, "X0 Y0 Z0" if text == "RESET" else text.removeprefix("AXIS"))

    def plane_statement(self, text: str) -> None:
        """PLANE SPATIAL: angles about the fixed axes X, Y, Z, in this order; PLANE RESET."""
        self.recorder.event(self.line, "PLANE", readable(text))
        before = self.leans or self.frame_axis
        if text.startswith("RESET"):
            brought, self.tilt = text.removeprefix("RESET").strip() or "TURN", None
        elif match := _PLANE.fullmatch(text):
            given = re.findall(rf"SP([ABC])\s*({VALUE})", match[1])
            if len({letter for letter, _ in given}) < len(given):
                raise StatementError("PLANE SPATIAL with an angle twice", "SPA, SPB, SPC", code="P013")
            angles = [number(dict(given).get(letter, "0"), self.values) for letter in "CBA"]
            brought, self.tilt = match[2], CoordinateFrame(turned("zyx", angles), follows=True)
            if any(angles) and self.rotation:
                raise StatementError("PLANE in turned coordinates", "PLANE before CYCL DEF 10", REMEDY, code="P013")
        else:
            raise StatementError(
                f"PLANE {text.split()[0] if text else ''}", "PLANE SPATIAL, PLANE RESET", REMEDY, code="P013"
            )
        how = _BROUGHT.fullmatch(brought)
        if how is None:
            raise StatementError(
                f"PLANE ... {brought[:40]}", "STAY, TURN or MOVE, with MB, DIST, F, SEQ, TABLE ROT", code="P013"
            )
        self.shifted_inside = False
        self._framed()
        if how[1] != "STAY":
            # The control swivels, and may move the axes for it.
            self.here, self.leans, self.angles = [None, None, None], None, dict.fromkeys("ABC", 0.0)
        elif any(self.angles.values()) and self.tilt is not None and self.options.rotary != "none":
            self._upright(np.array(self._of_angles()))
        else:
            far = float(np.linalg.norm(np.array(before) - np.array(self.frame_axis))) > 1e-9
            self.leans = before if far else None

    def _framed(self) -> None:
        frame = CoordinateFrame(shift=self.datum.copy())
        if self.rotation:
            frame = frame.then(CoordinateFrame(turned("Z", [self.rotation])))
        if self.tilt is not None:
            frame = frame.then(self.tilt)
        if (frame.turn != self.frame.turn).any() or (frame.shift != self.frame.shift).any():
            # Those of coordinates that are no more.
            self.pole, self.polar = [None, None, None], (math.nan, math.nan)
        self.put_into(frame)
        self.axis = self.frame_axis
