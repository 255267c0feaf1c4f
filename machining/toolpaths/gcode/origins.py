"""Codes of G-code that move or turn the frame of coordinates, and those of places of the machine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from machining.toolpaths.gcode.arcs import PLANES
from machining.toolpaths.gcode.frames import CoordinateFrame, in_plane, tilted
from machining.toolpaths.gcode.harmless import shown
from machining.toolpaths.gcode.motion import GcodeMotion
from machining.toolpaths.gcode.words import Block
from machining.toolpaths.recorder import StatementError

# Codes that move or turn the frame of coordinates: G10, G52, G53.1, G68, G68.2, G69, G92 to G92.3.
ORIGINS = (100, 520, 531, 680, 682, 690, 920, 921, 922, 923)
# Poles of polar coordinates (Siemens): from the last place, the origin, the last pole.
POLES = (1100, 1110, 1120)
# Codes of places of the machine, beside SUPA: G28, G30, G53, G153 of Siemens.
MACHINE = (280, 300, 530, 1530)


class Origins(GcodeMotion):
    """Origins of coordinates on top of the motion."""

    # Frame that G92.2 has set aside, and whether G92 has said what coordinates mean before any was known.
    aside: CoordinateFrame | None = None
    presumed = False
    # What had moved the origin before G68.
    origin_before = ""

    def _machine(self, code: int, b: Block) -> None:
        """G28, G30: by way of a point to the machine's own; G53, G153, SUPA: coordinates of the machine."""
        named = [i for i, letter in enumerate("XYZ") if letter in b.words]
        home = code in (280, 300)
        if home and named and self.target(b) != self.here:
            # The point on the way is in the part.
            self.rapid_to(self.target(b))
        for letter in "ABC":
            if letter in b.words:
                self.angles[letter] = 0.0
        b.words.used |= set("XYZABC") | ({"P"} if code == 300 else set())
        word = "SUPA" if "SUPA" in b.long else shown(code)
        self.recorder.event(self.line, word, str(b))
        # G28 alone is for all axes; G53 alone moves nothing.
        self.leave_by(named if named or not home or b.words.keys() & set("ABC") else (0, 1, 2), word)

    def _origin(self, code: int, b: Block) -> None:
        """Codes that move or turn the frame of the coordinates to come."""
        self.recorder.event(self.line, shown(code), str(b))
        old = self.frame
        if code == 100:
            # Work offsets and lengths of tools: with nothing before them they only say what the caller knows.
            if b.words.get("L") not in (12.0, 13.0) and len(self.recorder):
                raise StatementError("G10 moves offsets between moves", "G10 before the first move", code="P013")
            self.recorder.note(self.line, "G10 sets data of the control; offsets are the caller's")
        elif code == 520:
            self._moves_origin("G52")
            here = [b.words.get(letter, old.shift[k] / self.scale) for k, letter in enumerate("XYZ")]
            self.put_into(CoordinateFrame(shift=self.scale * np.array(here)))
        elif code == 920:
            self._here_is(b)
        elif code in (921, 922, 923):
            self._preset(code)
        elif code == 680:
            self.put_into(self._turned(b))
        elif code == 682:
            self._moves_origin("G68.2")
            self.put_into(tilted(b.words, self.scale))
        elif code == 531:
            self.frame = replace(old, follows=True)
            self._swivelled(shown(code))
        elif self.unturned is not None:
            self.put_into(CoordinateFrame(shift=self.unturned))
            self.unturned, self.origin_by = None, self.origin_before
        elif self.origin_by == "G68.2":
            self.put_into(CoordinateFrame())

    def _moves_origin(self, by: str) -> None:
        """What moves the origin; controls differ in how two of such words go together."""
        if self.diameter:
            raise StatementError(f"{by} under {self.diameter}", "DIAMOF before it", code="P020")
        if not self.frame.plain and self.origin_by != by:
            raise StatementError(
                f"{by} while {self.origin_by} moves or turns coordinates",
                "one of them at a time",
                "end the other one before, or post with work offsets",
                code="P020",
            )
        self.origin_by = by

    def _turned(self, b: Block) -> CoordinateFrame:
        """G68: coordinates turned in the plane. Controls differ in what a second one does."""
        if not self.absolute:
            raise StatementError("G68 under G91: its centre and angle may add", "G90 before it", code="P013")
        if self.unturned is None:
            if not (self.frame.turn == np.eye(3)).all():
                raise StatementError(f"G68 while {self.origin_by} turns coordinates", "G69 before it", code="P013")
            self.unturned, self.origin_before, self.origin_by = self.frame.shift, self.origin_by, "G68"
            before = self.frame
        elif not self.options.rotation:
            raise StatementError(
                "G68 while coordinates are turned: controls turn anew, or on",
                "G69 before it",
                "say which: --read rotation=absolute or rotation=added (rotation= in Python)",
                code="P013",
            )
        else:
            before = self.frame if self.options.rotation == "added" else CoordinateFrame(shift=self.unturned)
        return before.then(in_plane(b.words, PLANES[self.plane], self.scale, self.here))

    def _preset(self, code: int) -> None:
        """G92.1 and G92.2 take the offset of G92 off, the second for G92.3 to put it on again."""
        if self.presumed and len(self.recorder):
            raise StatementError(
                f"{shown(code)}: where G92 has moved the origin is not known",
                "G92 behind a move of its axes",
                "post with work offsets",
                code="P013",
            )
        if not (self.frame.turn == np.eye(3)).all():
            raise StatementError(f"{shown(code)} in turned coordinates", "G69 before it", code="P013")
        if self.origin_by != "G52":
            self._moves_origin("G92")
        if code != 923:
            self.aside = self.frame if code == 922 and not self.frame.plain else self.aside if code == 922 else None
            self.put_into(CoordinateFrame())
        elif self.aside is not None:
            self.put_into(self.aside)

    def _swivelled(self, word: str) -> None:
        """Table or head turn: what coordinates the tool then has is the machine's, unless nothing turns."""
        if self.axis != self.frame_axis:
            self.leave((0, 1, 2), word)
        self.axis = self.frame_axis

    def _here_is(self, b: Block) -> None:
        """G92: what the coordinates of the tool's place are from now on."""
        given = {k: b.words[letter] * self.scale for k, letter in enumerate("XYZ") if letter in b.words}
        if any(self.here[k] is None for k in given) and len(self.recorder):
            raise StatementError(
                "G92 where the tool's place is not known",
                "G92 behind a move of its axes",
                "post with work offsets",
                code="P013",
            )
        if given:
            self._moves_origin("G92")
        moved = self.frame.shift.copy()
        for k, value in given.items():
            old = self.here[k]
            self.presumed = self.presumed or old is None
            # Before any move it says what the coordinates mean, and moves nothing.
            moved[k] += 0.0 if old is None else old - value
            self.here[k] = value
        self.frame = CoordinateFrame(shift=moved)
        if given:
            # G92.3 puts on again what was stated last, not what stood before G92.2.
            self.aside = self.frame
