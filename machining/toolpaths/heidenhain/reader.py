"""Programs in Heidenhain's conversational language: TNC 310 to TNC 640, by their users' manuals."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from pathlib import Path

from machining.toolpaths.gcode.words import Block
from machining.toolpaths.heidenhain.contour import Contour
from machining.toolpaths.heidenhain.cycles import PARAMETER
from machining.toolpaths.heidenhain.harmless import STATEMENTS, WORDS
from machining.toolpaths.heidenhain.words import assign, number, statements, words
from machining.toolpaths.motions import Motions
from machining.toolpaths.options import UNITS, ReadOptions
from machining.toolpaths.recorder import StatementError
from machining.toolpaths.source import content, lines_of, readable
from robots.files.reading import recording

_BEGIN = re.compile(r"BEGIN PGM\b.*?(?:\b(MM|INCH))?\s*$")
_TOOL = re.compile(r"TOOL CALL\s*(?:\"([^\"]*)\"|(\d+)(\.\d+)?)?\s*(?:([XYZUVW])(?![A-Z0-9.]))?\s*(.*)$", re.I)
_OF_TOOL = re.compile(r"\s*(S|F|DL|DR2|DR)\s*:?\s*([-+]?\s*(?:Q[LR]?\d+|[\d.,]+))(?=\s|$)", re.I)
_LABEL = re.compile(r"LBL\s*(\"[^\"]+\"|\d+)\s*$")
_CALL = re.compile(r"CALL LBL\s*(\"[^\"]+\"|\d+)\s*(?:REP\s*(\d*)(?:\s*/\s*\d+)?)?\s*$")
# A remark of a simulator or a person at the end of a statement, unless it could be words of it.
_LOST_TEXT = re.compile(r"\((?!(?:\s*[A-Z]{1,2}[-+]?[\d.,]+)+\s*\))[^()]*\)?\s*$|^\(.*$")
_TCPM = re.compile(
    r"FUNCTION TCPM(?:\s+F TCP)?(?:\s+AXIS (POS|SPAT))?(?:\s+PATHCTRL (?:AXIS|VECTOR))?(?:\s+REFPNT TIP-TIP)?"
)
CALLS_MOST, DEEPEST = 65534, 20
# Cycles from this number on have Q parameters, which begin with the same one.
FIRST_BY_Q = 200
REMEDY = "post the program without it, or as G-code or APT"


@recording()
def read_heidenhain(path: Path, options: ReadOptions | None = None) -> Motions:
    """Read a program in conversational language.

    Read are L, LP, LN, CC, C, CP, CR, CT, CTP, RND, CHF; the cycles 1, 7, 9, 10, 200 to 209, 240, 247; PLANE SPATIAL
    and RESET; M128 and TCPM; labels, Q parameters and formulas. What changes nothing about the path is in
    :mod:`machining.toolpaths.heidenhain.harmless`, with the reason; all else is refused. Coordinates are those of the
    datum in force. Moves and faults as in :func:`machining.toolpaths.read_gcode`.

    Raises
    ------
    InputError
        The file is too large, too many moves.
    InputErrors
        Faults of lines, all of them: jumps, other cycles and contours, cutter compensation.
    """
    options = options or ReadOptions()
    reader = _Reader(path, options)
    data = content(path, options.max_bytes)
    source = reader.one_program(statements(lines_of(path.name, data)))
    if re.search(rb"CALL\s+LBL", data):
        reader.stored = list(source)
        reader.run_stored()
    else:
        reader.run(source)
    reader.finish()
    return reader.recorder.motions()


Statements = Iterable[tuple[int, str, str]]


class _Reader(Contour):
    calls = 0

    def __init__(self, path: Path, options: ReadOptions) -> None:
        super().__init__(path, options)
        self.stored: list[tuple[int, str, str]] = []

    def one_program(self, source: Statements) -> Statements:
        """All statements; behind END PGM only those of labels may stand."""
        ended = inside = False
        for line, text, comment in source:
            inside = text != "LBL 0" if _LABEL.match(text) else inside
            if ended and text and text != "LBL 0" and not inside:
                self.line = line
                fault = StatementError(
                    "a statement behind END PGM", "one program", "give each program in a file", code="P019"
                )
                self.refuse(fault, readable(text)[:120])
                return
            ended |= text.startswith("END PGM")
            yield line, text, comment

    def run(self, source: Statements) -> None:
        """All statements of a program without calls of labels."""
        for line, text, comment in source:
            self._statement(line, text, comment)

    def run_stored(self, first: int = 0, last: int | None = None) -> bool:
        """Statements from ``first`` to ``last``, or to LBL 0 inside a call; whether that was without a fault."""
        at, good = first, True
        while at < (len(self.stored) if last is None else last) and not self.over:
            line, text, comment = self.stored[at]
            if self.depth and last is None and re.fullmatch(r"LBL\s*0", text):
                break
            if call := _CALL.match(text):
                self.line = line
                try:
                    good &= self._call(call, at)
                except StatementError as fault:
                    self.refuse(fault, readable(text)[:120])
                    good = False
            else:
                good &= self._statement(line, text, comment)
            at += 1
        return good

    def _call(self, call: re.Match[str], at: int) -> bool:
        found = [
            i for i, (_, text, _) in enumerate(self.stored) if (label := _LABEL.match(text)) and label[1] == call[1]
        ]
        if not found:
            raise StatementError(
                f"CALL LBL {call[1]}: no such label in the file", "labels of this file", REMEDY, code="P017"
            )
        self.calls += 1
        if self.depth >= DEEPEST or self.calls > CALLS_MOST:
            raise StatementError(
                "calls of labels", f"{DEEPEST} within one another, {CALLS_MOST} in all", REMEDY, code="P017"
            )
        self.depth += 1
        repeats = int(call[2]) if call[2] else 1
        if call[0].find("REP") < 0:
            good = self.run_stored(found[0] + 1)
        elif found[0] > at or repeats > CALLS_MOST:
            raise StatementError("CALL LBL REP of a label that comes later", "a label above", REMEDY, code="P017")
        else:
            good = all(self.run_stored(found[0] + 1, at) for _ in range(repeats))
        self.depth -= 1
        return good

    def _statement(self, line: int, text: str, comment: str) -> bool:
        self.line = line
        if comment:
            self.recorder.event(line, "comment", readable(comment))
        if "(" in text and "=" not in text:
            text = _LOST_TEXT.sub("", text).strip()
        if not text or self.over:
            return True
        if text.startswith("/"):
            if self.skips_deleted(text):
                return True
            text = text[1:].strip()
        if not text:
            return True
        try:
            self._read(text)
            if text.split()[0] != "CC":
                self.corner_behind()
        except StatementError as fault:
            self.refuse(fault, readable(text)[:120])
            return False
        return True

    def _read(self, text: str) -> None:
        word = text.split()[0]
        if not PARAMETER.fullmatch(text):
            self.defining = 0
        if word in ("RND", "CHF"):
            self.corner(word, text[3:])
            return
        if word in WORDS:
            self.motion_statement(word, words(text[len(word) :], self.values))
            return
        if text.startswith("TOOL CALL"):
            self._tool(text)
        elif text.startswith(("CYCL DEF", "CYCLE DEF")):
            self.define(re.sub(r"^CYCLE? DEF\s*", "", text))
        elif text.startswith("CYCL CALL"):
            self.call_cycle(text.removeprefix("CYCL CALL").strip())
        elif self.defining >= FIRST_BY_Q and PARAMETER.fullmatch(text) and int(text[1:4]) >= FIRST_BY_Q:
            self.more_of_cycle(text)
        elif assign(text, self.values):
            return
        elif text.startswith("TRANS DATUM"):
            self.defining = 7
            self.datum_statement(text.removeprefix("TRANS DATUM").strip())
        elif text.startswith("PLANE"):
            self.plane_statement(text.removeprefix("PLANE").strip())
        elif re.match(r"M\s*\d", text):
            self.motion_statement("L", words(text, self.values))
        elif text.startswith("STOP"):
            self.recorder.command(self.line, "stop", text="STOP", word="STOP")
            if rest := text.removeprefix("STOP").strip():
                self.motion_statement("L", words(rest, self.values))
        elif not self._frame(text):
            self._other(text)

    def _frame(self, text: str) -> bool:
        """Statements about the program as a whole, and modes."""
        if begin := _BEGIN.match(text):
            if begin[1]:
                self.unit = UNITS["mm" if begin[1] == "MM" else "inch"]
                # Feeds of a program in inches are in tenths of an inch (TNC 640, user's manual).
                self.feed_scale = 1.0 if begin[1] == "MM" else 0.1
        elif text.startswith("END PGM"):
            self.over = True
            self.recorder.event(self.line, "END", readable(text))
            self.recorder.finish(self.line, "END PGM")
        elif text == "FUNCTION RESET TCPM" or _TCPM.fullmatch(text):
            self.tcp = text != "FUNCTION RESET TCPM" or self.options.tcp
            self.spatial = {} if "AXIS SPAT" in text else None
            self.recorder.event(self.line, "TCPM", readable(text))
        elif text == "CYCL END":
            self.modal_call = False
        elif why := next((why for pattern, why in STATEMENTS.items() if re.fullmatch(pattern, text)), ""):
            self.recorder.event(self.line, text.split()[0], readable(text) + f" ({why})")
        else:
            return False
        return True

    def _other(self, text: str) -> None:
        what = " ".join(text.split()[:2])
        if re.match(r"FN\s*\d+\s*:", text):
            raise StatementError(f"{what} jumps, or asks the control", "FN 0 to FN 8, formulas", REMEDY, code="P017")
        read = "L, C, CC, CR, CT, CP, LP, LN, RND, CHF"
        fault = StatementError(f"{readable(what)[:40]} is not read", read, REMEDY, code="P019")
        self.left_out(readable(what), fault, readable(text))
        self.leave((0, 1, 2), readable(what))

    def _tool(self, text: str) -> None:
        match = _TOOL.match(text)
        if match is None or (match[4] or "Z").upper() != "Z":
            raise StatementError("a tool along another axis than Z", "TOOL CALL 5 Z S3000", REMEDY, code="P014")
        block, at = Block(), 0
        oversize = self.oversize if not (match[1] or match[2]) else 0.0
        while (found := _OF_TOOL.match(match[5], at)) is not None:
            letter, value, at = found[1].upper(), number(found[2], self.values), found.end()
            if letter == "DL" and value:
                raise StatementError(
                    f"a tool longer by {value:g} (DL): the path is that much higher",
                    "DL 0",
                    "post it with the allowance in the points",
                    code="P014",
                )
            if letter in ("DR", "DR2"):
                oversize = oversize or value
            else:
                block.words[letter] = value * (self.feed_scale if letter == "F" else 1.0)
        if rest := match[5][at:].strip():
            raise StatementError(
                f"{rest[:30]!r} of a tool call is not read", "S, F, DL, DR, DR2 with numbers", code="P014"
            )
        self.oversize = oversize
        given = match[1] or match[2]
        if match[2] and not match[3]:
            block.words["T"] = float(match[2])
        block.tool = match[1] or (match[2] + match[3] if match[3] else "")
        self.take(block)
        if given:
            # A feed of another tool's call is not this one's.
            self.feed_of_tool = math.nan
        if "F" in block.words:
            self.feed_of_tool = block.words["F"]
        if given:
            self._change_tool()

    def finish(self) -> None:
        """What the end of the file leaves open."""
        if not self.over:
            self.recorder.note(self.line, "the program ends without END PGM: it may be cut short", code="W037")
