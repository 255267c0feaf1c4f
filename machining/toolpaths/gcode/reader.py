"""G-code programs (ISO 6983, RS-274) of three- and five-axis milling machines; Fanuc, LinuxCNC, Haas, Sinumerik ISO."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType

from machining.toolpaths.gcode import harmless
from machining.toolpaths.gcode.arcs import CYCLES, PLANES
from machining.toolpaths.gcode.frames import PROGRAMMABLE, programmable, swivelled
from machining.toolpaths.gcode.harmless import shown
from machining.toolpaths.gcode.motion import MOVING, VIA
from machining.toolpaths.gcode.origins import MACHINE, ORIGINS, POLES, Origins
from machining.toolpaths.gcode.siemens_cycles import DRILLS, Hole, hole
from machining.toolpaths.gcode.splines import CUBIC, NURBS, NURBS_END, QUADRATIC, SPLINES
from machining.toolpaths.gcode.state import (
    CALLS,
    ENDS,
    GROUPS,
    KNOWN,
    NEEDED,
    REFUSED,
    REFUSED_WORDS,
    REMEDY_MACRO,
    remedy_ignore,
)
from machining.toolpaths.gcode.subprograms import CALL, DEEPEST, Subprogram, called, subprograms
from machining.toolpaths.gcode.words import Block, block, cycle_arguments
from machining.toolpaths.motions import Motions
from machining.toolpaths.options import ReadOptions
from machining.toolpaths.recorder import StatementError
from machining.toolpaths.source import content, lines_of, readable
from robots import InputError
from robots.files.reading import recording


@recording()
def read_gcode(path: Path, options: ReadOptions | None = None) -> Motions:
    """Read a G-code program.

    Coordinates are those of the work offset that is in force. A rapid move made while a coordinate is not known yet
    (after G28, G53, or at the start of the program) is an event with a note; a move at feed is a fault. Rotary axes
    need ``options.rotary``, and the tool tip as programmed point: G43.4, G234, TRAORI, or ``options.tcp``.

    Raises
    ------
    InputError
        The file is too large, too many moves.
    InputErrors
        Faults of lines, all of them: variables, macros, subprograms, codes that move the tool and are not read.
    """
    options = options or ReadOptions()
    reader = _Reader(path, options)
    for word in options.ignore:
        if word in NEVER or _code_of(word) in NEEDED.get(word[:1], ()):
            raise InputError(
                "option ignore",
                code="P020",
                value=word,
                allowed="words that change nothing about path and feed",
                remedy="leave it out: this word is read, or is known to change the path",
            )
    reader.siemens, reader.linuxcnc = path.suffix.lower() in (".mpf", ".spf"), path.suffix.lower() == ".ngc"
    data = content(path, options.max_bytes)
    if CALL.search(data):
        reader.subprograms = subprograms(lines_of(path.name, data))
    reader.read(lines_of(path.name, data))
    return reader.recorder.motions()


REMEDY_END = "give each program in a file of its own, and end the file with it"
# Words that are never harmless, whatever the caller says.
NEVER = REFUSED_WORDS | {
    *VIA,
    "DIAMON",
    "DIAM90",
    "DIAMOF",
    *PROGRAMMABLE,
    *DRILLS,
    "TRAORI",
    "TRAFOOF",
    "MCALL",
    "CYCLE800",
    "RET",
    "SUPA",
}
# What to do about motion that is not read.
WITHOUT = (
    "post the program without it, or go on without this motion: --read unknown_motion=report "
    "(unknown_motion= in Python)"
)


class _Reader(Origins):
    tape = ""
    # A cycle that every place to come is drilled with.
    modal_cycle: Hole | None = None
    subprograms: Mapping[str, Subprogram] = MappingProxyType({})

    def read(self, source: Iterable[str]) -> None:
        aside = {number for one in self.subprograms.values() for number in one.lines}
        for number, raw in enumerate(source, start=1):
            if number not in aside:
                self._line(number, raw)
        if self.open_nurbs is not None:
            self.refuse(StatementError("the file ends behind G5.2 without G5.3", "G5.3", code="P011"))
        if not self.over:
            self.recorder.note(self.line, "the program ends without M2, M30 or M99: it may be cut short", code="W037")

    def _line(self, number: int, raw: str) -> bool:
        """Read one line; whether that was without a fault."""
        self.line = number
        words = block(raw)
        for comment in words.comments:
            if comment.strip():
                self.recorder.event(number, "comment", readable(comment))
        if words.title and self.tape == "read":
            words.bad = f"%{words.title}"
        if words.tape_mark:
            # The first % is where a tape begins, the next one where it ends.
            self.tape, self.over = self.tape or "begun", self.over or self.tape != ""
        elif not words.empty:
            self.tape = "read"
        if self.over:
            if not words.empty and not words.ends:
                fault = StatementError(
                    "a block behind the end of the program", "one program in a file", REMEDY_END, code="P020"
                )
                self.refuse(fault, readable(raw).strip())
                return False
            return True
        if words.deleted and self.skips_deleted(raw):
            return True
        try:
            self._block(words)
        except StatementError as fault:
            self.refuse(fault, readable(raw).strip())
            if self.unit is not None:
                # The file is refused; the lines behind this one are judged as if the tool had come there.
                self.here = self.target(words)
            return False
        return True

    def _block(self, b: Block) -> None:
        if b.macro:
            raise StatementError(
                "a macro program: loops and branches", "variables and expressions", REMEDY_MACRO, code="P017"
            )
        if b.computes:
            b.take(self.values.worked_out(b.computes))
        if b.bad:
            raise StatementError(f"{readable(b.bad)!r} is no word of G-code", "letters with numbers", code="P020")
        self._ignore(b)
        for group in GROUPS:
            if len(found := sorted(set(group) & set(b.codes))) > 1:
                both = " and ".join(map(shown, found[:2]))
                raise StatementError(f"{both} in one block", "one code of a kind in a block", code="P020")
        call = self._called(b)
        for word in b.long:
            self._long(word, b)
        self._refuse(b)
        cycle_before = self.motion
        self.take(b)
        if self.motion in CYCLES and cycle_before not in CYCLES:
            self.initial, self.sticky = self.here[PLANES[self.plane][2]], {}
        # M99 and M17 end a subprogram, not the program.
        self.every_corner = b.words["RNDM"] * self.scale if "RNDM" in b.words else self.every_corner
        self.feed_of_corners = b.words["FRCM"] or math.nan if "FRCM" in b.words else self.feed_of_corners
        self.over = self.over or any(number in ENDS and not (number != 30 and self.depth) for number in b.misc)
        self._moved(b)
        self._all_used(b)
        if not b.empty:
            self.corner_behind()
        if not self.depth or not {2, 17, 99} & set(b.misc):
            self.stop(b)
        if call is not None:
            self._call(*call)

    def _ignore(self, b: Block) -> None:
        """Leave out the words that the caller knows to be harmless; letters only where they have no meaning."""
        for word in self.options.ignore:
            code, found = _code_of(word), False
            if code in b.codes and word[0] == "G":
                b.codes, found = [one for one in b.codes if one != code], True
            elif code // 10 in b.misc and word[0] == "M":
                b.misc, found = [one for one in b.misc if one != code // 10], True
            elif word in ("U", "V", "W") and 40 not in b.codes:
                found = b.words.pop(word, None) is not None
            b.long = [long for long in b.long if long.partition("(")[0].strip() != word or not (found := True)]
            if found:
                self.recorder.event(self.line, word, note=f"{word} is left out, as asked", code="W041")

    def _all_used(self, b: Block) -> None:
        """Every word of a block is used, or is certain to change nothing about the path."""
        known = {"H", "D"} | set(harmless.VALUES)
        if b.words.keys() == {"O"} and not b.codes and not b.misc and not b.long:
            known.add("O")
        if self.siemens and dict.get(b.words, "D") == 0.0 and not (set(MACHINE) & set(b.codes) or "SUPA" in b.long):
            raise StatementError(
                "D0: coordinates of the spindle, not of the tool's tip", "D0 with SUPA, G53 or G153", code="P013"
            )
        for code in b.codes:
            known |= set(harmless.WITH_CODE.get(code, "") if code != self.motion else "")
        for number in b.misc:
            known |= set(harmless.WITH_FUNCTION.get(number, ""))
        # I, J or K of 0 on an arc, along the normal of its plane; a rest or peck of 0 in a cycle without.
        none = "IJK" if self.motion in (20, 30) else "PQ" if self.motion in CYCLES else ""
        known |= {word for word in none if dict.get(b.words, word) == 0.0}
        left = [word for word in b.words.left if word not in known]
        for word in set(left) & set(self.options.ignore):
            left.remove(word)
            self.recorder.event(self.line, word, note=f"{word} is left out, as asked", code="W041")
        if left:
            raise StatementError(
                f"{', '.join(left)} {'has' if len(left) == 1 else 'have'} no meaning in this block that is read",
                "words that belong to its codes",
                remedy_ignore(left[0]),
                code="P020",
            )

    def _called(self, b: Block) -> tuple[str, int] | None:
        """Name and repeats of a subprogram of this file that the block calls; None where it calls none."""
        own = [word for word in b.long if word in self.subprograms]
        if (98 in b.misc or own) and any(b.words.get(letter, 0.0) % 1.0 for letter in "PL"):
            raise StatementError("a call with a number that is not whole", "whole numbers", code="P017")
        if 98 in b.misc:
            number, times = called(b.words)
            name = f"O{number}"
            b.misc.remove(98)
        elif not b.codes and not b.misc and "L" in b.words and b.words.keys() <= {"L", "P"}:
            name, times = f"L{b.words['L']:g}", int(b.words.get("P", 1.0))
            if any(other.startswith("L0") for other in self.subprograms):
                raise StatementError(
                    "subprograms whose names begin with L0", "names that differ in more than zeros", code="P017"
                )
        elif own:
            if b.words.keys() - {"P"} or b.codes or b.misc or len(b.long) > 1:
                raise StatementError(
                    f"a call of {own[0]} among other words", "the call in a block of its own", code="P017"
                )
            name, times = own[0], int(b.words.get("P", 1.0))
            b.long.remove(name)
        else:
            return None
        if name not in self.subprograms:
            raise StatementError(
                "M98 without P" if name == "O-1" else f"a call of a subprogram that is not in the file: {name}",
                "subprograms in the same file: O100 to M99, %_N_L100_SPF to M17",
                REMEDY_MACRO,
                code="P017",
            )
        if not 1 <= times <= 9999 or self.depth >= DEEPEST:
            raise StatementError(
                "a call of a subprogram",
                f"1 to 9999 times, at most {DEEPEST} calls within one another",
                REMEDY_MACRO,
                code="P017",
            )
        self.recorder.event(self.line, name if name[0] != "O" else "M98", str(b))
        for letter in "PL":
            b.words.pop(letter, None)
        return name, times

    def _call(self, name: str, times: int) -> None:
        self.depth += 1
        here = self.line
        for _ in range(times):
            good = [self._line(*one) for one in self.subprograms[name].blocks if not self.over]
            # Faults are told once.
            if not all(good):
                break
        self.depth, self.line = self.depth - 1, here

    def _moved(self, b: Block) -> None:
        """What a block does beside its modes: rest, motion, other origins."""
        if 40 in b.codes:
            self._dwell(b)
            if "P" not in b.words or not b.words.keys() & set("XYZABC"):
                return
            # Beside its rest a block may move, after it (RS-274/NGC, table 8).
            if not {0, 10, 20, 30} & set(b.codes):
                raise StatementError(
                    "G4 P with coordinates", "a rest alone, or with G0 to G3 in its block", code="P022"
                )
            del b.words["P"]
        if harmless.LIMITS & set(b.codes):
            # Their coordinates are no motion.
            b.words.used |= set("XYZIJK")
            return
        for code in b.codes:
            if code in POLES:
                if not self.siemens:
                    raise StatementError(
                        f"{shown(code)}: a pole (Siemens), a work offset (Haas) or polar interpolation",
                        "poles in files named .mpf or .spf",
                        code="P022",
                    )
                self.set_pole(code, b)
                return
            if code in MACHINE:
                self._machine(code, b)
                return
            if code in ORIGINS:
                self._origin(code, b)
                return
        if "SUPA" in b.long:
            self._machine(530, b)
            return
        if (
            {580, 590} & set(b.codes)
            and b.words.keys() & set("XYZ")
            and (self.siemens or not {0, 10, 20, 30} & set(b.codes))
        ):
            # Siemens' G58 and G59 move the origin by these words; Fanuc's select a work offset and move the tool.
            raise StatementError(
                "G58 or G59 with coordinates", "G0 or G1 in the block, or G54 to G57, TRANS", code="P013"
            )
        if b.words.keys() & set("UVW"):
            raise StatementError("axes U, V, W", "X, Y, Z, A, B, C", "post for axes X, Y, Z", code="P014")
        if self.motion in (NURBS, NURBS_END) and (b.words or NURBS_END in b.codes):
            self.nurbs(b)
        elif not MOVING.isdisjoint(b.words) or (self.motion in (20, 30) and b.words.keys() & set("IJK")):
            self._motion(b)
            if self.modal_cycle is not None:
                self.drill_here(self.modal_cycle)

    # Words that are not read

    def _refuse(self, b: Block) -> None:
        if any(number in CALLS for number in b.misc):
            raise StatementError("a call of a subprogram", code="P017", remedy=REMEDY_MACRO)
        for code in tuple(b.codes):
            # G60 of Siemens is an exact stop; Fanuc's comes from one side.
            free = code in (CUBIC, QUADRATIC, 281, 301, 600) and not b.words.keys() & set("XYZIJ")
            quiet = free or (code == 600 and self.siemens) or (code in SPLINES and self.linuxcnc)
            known = code in REFUSED and not quiet
            unknown = not known and code not in KNOWN and bool(b.words.keys() & set("XYZABCIJKR"))
            if not known and not unknown:
                continue
            what = REFUSED.get(code, "not known, with coordinates")
            fault = StatementError(f"{shown(code)}: {what}", "G0 to G3, G73, G81 to G86, G89", WITHOUT, code="P019")
            self.left_out(shown(code), fault)
            self.lose(b, shown(code))
            b.words.clear()
            b.codes.remove(code)

    def _long(self, word: str, b: Block) -> None:
        head, _, rest = word.partition("(")
        head = " ".join(head.split())
        # A modal cycle goes by the cycle's own name.
        name = head.removeprefix("MCALL ")
        if head in ("TRAORI", "TRAFOOF"):
            self.tcp = head == "TRAORI"
        elif head in PROGRAMMABLE:
            plane_alone = b.words.keys() == {"RPL"} and head.endswith("ROT")
            if (stray := sorted(b.words.keys() - set("XYZ"))) and not plane_alone:
                raise StatementError(f"{', '.join(stray)} with {head}", f"{head} with X, Y, Z", code="P019")
            self._moves_origin("TRANS, ROT or CYCLE800")
            self.put_into(programmable(head, b.words, self.scale, self.frame, PLANES[self.plane][2]))
            b.words.clear()
        elif head == "MCALL":
            self.modal_cycle = None
        elif name in DRILLS:
            one = hole(name, self._arguments(name, rest), self.scale)
            if name != head:
                self.modal_cycle = one
            else:
                self.drill_here(one)
        elif head == "CYCLE800":
            self._moves_origin("TRANS, ROT or CYCLE800")
            self.put_into(swivelled(self._arguments(head, rest), self.scale, self.frame))
            self._swivelled(head)
        elif head in ("DIAMON", "DIAM90", "DIAMOF"):
            self.diameter = head.replace("DIAMOF", "")
        elif head in VIA:
            if set(GROUPS[0]) & set(b.codes):
                raise StatementError(f"{head} beside another kind of motion", "one of them", code="P019")
            self.motion = VIA[head]
        elif head in ("RET", "M17"):
            if not self.depth:
                self.over = True
        elif self.changes_nothing(head, readable(word)):
            return
        else:
            remedy = WITHOUT if name in REFUSED_WORDS else remedy_ignore(head)
            what = f"{readable(head)} is not read, nor a subprogram in this file"
            self.left_out(readable(head), StatementError(what, "G0 to G3", remedy, code="P019"))
            self.lose(b, readable(head))
            b.words.clear()
        self.recorder.event(self.line, readable(head), readable(word))

    # Codes without motion in the part

    def _dwell(self, b: Block) -> None:
        for letter in "PXUF":
            if letter in b.words:
                value = b.words[letter]
                whole = letter == "P" and "P" not in b.points
                if whole and self.options.dwell_unit == "ms":
                    value *= 1e-3
                elif whole and value >= 100.0:
                    self.recorder.note(
                        self.line, "G4 with a whole P of 100 or more: taken as s; --read dwell_unit=ms?", code="W039"
                    )
                self.recorder.dwell(self.line, value)
                return
        raise StatementError("a dwell without its time", "P, X, U or F with a number", code="P022")

    def _arguments(self, name: str, rest: str) -> list[float]:
        """Numbers of a cycle; ``rest``: what stands behind its opening bracket. Names of data records are none."""
        texts = (1,) if name == "CYCLE800" else ()
        return cycle_arguments(name, rest.rpartition(")")[0], self.values.value, texts)


def _code_of(word: str) -> int:
    """Ten times the number of a G code or M function; -1 for another word."""
    return round(float(word[1:]) * 10) if re.fullmatch(r"[GM]\d+(\.\d)?", word) else -1
