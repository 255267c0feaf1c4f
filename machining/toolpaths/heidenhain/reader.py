"""Programs in Heidenhain's conversational language: TNC 310 to TNC 640, by their users' manuals."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from machining.toolpaths.gcode.state import ENDS
from machining.toolpaths.gcode.words import Block
from machining.toolpaths.heidenhain.contour import Contour
from machining.toolpaths.heidenhain.words import assign, number, statements, words
from machining.toolpaths.motions import Motions
from machining.toolpaths.options import UNITS, ReadOptions
from machining.toolpaths.recorder import StatementError
from machining.toolpaths.source import content, lines_of, readable
from robots.files.reading import recording

_BEGIN = re.compile(r"BEGIN PGM\b.*?(?:\b(MM|INCH))?\s*$")
_TOOL = re.compile(r"TOOL CALL\s*(?:\"([^\"]*)\"|(\d+)(?:\.\d+)?)?\s*([XYZUVW])?\b\s*(.*)$", re.I)
_SPEED = re.compile(r"\b(S|F)\s*([-+]?(?:Q\d+|[\d.,]+))", re.I)
_LABEL = re.compile(r"LBL\s*(\"[^\"]+\"|\d+)\s*$")
_CALL = re.compile(r"CALL LBL\s*(\"[^\"]+\"|\d+)\s*(?:REP\s*(\d*)(?:/\d+)?)?\s*$")
_LOST_TEXT = re.compile(r"\([^()]*\)|\(.*$")
_MOVES = ("L", "LP", "LN", "C", "CP", "CR", "CT", "CC")
# Words that change nothing of the moves.
QUIET = re.compile(r"^(?:BLK FORM|TOOL DEF|\*|CYCL END|FN\s*1[46]\b|FN\s*3[78]\b|TOUCH PROBE OFF|FUNCTION MODE MILL)")
CALLS_MOST, DEEPEST = 65534, 20
REMEDY = "post the program without it, or as G-code or APT"


@recording()
def read_heidenhain(path: Path, options: ReadOptions | None = None) -> Motions:
    """Read a program in conversational language.

    Read are L, LP, LN, CC, C, CP, CR, CT, RND, CHF; the cycles 1, 7, 10, 200 to 209, 240; PLANE SPATIAL and RESET; M128
    and TCPM; labels, Q parameters and formulas. Coordinates are those of the datum in force. Moves and faults as in
    :func:`machining.toolpaths.read_gcode`.

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
    source = statements(lines_of(path.name, data))
    if re.search(rb"CALL\s+LBL", data):
        reader.stored = list(source)
        reader.run_stored()
    else:
        reader.run(source)
    reader.finish()
    return reader.recorder.motions()


Statements = Iterable[tuple[int, str, str]]


class _Reader(Contour):
    over = False
    depth = calls = 0

    def __init__(self, path: Path, options: ReadOptions) -> None:
        super().__init__(path, options)
        self.stored: list[tuple[int, str, str]] = []

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
            raise StatementError(f"CALL LBL {call[1]}: no such label in the file", "labels of this file", REMEDY)
        self.calls += 1
        if self.depth >= DEEPEST or self.calls > CALLS_MOST:
            raise StatementError("calls of labels", f"{DEEPEST} within one another, {CALLS_MOST} in all", REMEDY)
        self.depth += 1
        repeats = int(call[2]) if call[2] else 1
        if call[0].find("REP") < 0:
            good = self.run_stored(found[0] + 1)
        elif found[0] > at or repeats > CALLS_MOST:
            raise StatementError("CALL LBL REP of a label that comes later", "a label above", REMEDY)
        else:
            good = all(self.run_stored(found[0] + 1, at) for _ in range(repeats))
        self.depth -= 1
        return good

    def _statement(self, line: int, text: str, comment: str) -> bool:
        self.line = line
        if comment:
            self.recorder.event(line, "comment", readable(comment))
        if "(" in text and "=" not in text:
            text = _LOST_TEXT.sub(" ", text).strip()
        if not text or self.over:
            return True
        if text.startswith("/"):
            if self.skips_deleted(text):
                return True
            text = text[1:].strip()
        self.text = readable(text)[:120]
        try:
            self._read(text)
        except StatementError as fault:
            self.refuse(fault, self.text)
            return False
        return True

    def _read(self, text: str) -> None:
        word = text.split()[0]
        if word in ("RND", "CHF"):
            self.corner(word, text[3:])
            return
        if word in _MOVES:
            self.motion_statement(word, words(text[len(word) :], self.values))
            return
        self.settle()
        if text.startswith("TOOL CALL"):
            self._tool(text)
        elif text.startswith(("CYCL DEF", "CYCLE DEF")):
            self.define(re.sub(r"^CYCLE? DEF\s*", "", text))
        elif text.startswith("CYCL CALL"):
            self.call_cycle(text.removeprefix("CYCL CALL").strip())
        elif re.match(r"Q[LR]?\d+\s*=\s*(?:MAX|AUTO|FMAX|PREDEF)\b", text) or assign(text, self.values):
            return
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
        elif text.startswith(("FUNCTION TCPM", "FUNCTION RESET TCPM")):
            self.tcp = "RESET" not in text or self.options.tcp
            self.recorder.event(self.line, "TCPM", readable(text))
        elif QUIET.match(text) or _LABEL.match(text):
            self.recorder.event(self.line, text.split()[0], readable(text))
        else:
            return False
        return True

    def _other(self, text: str) -> None:
        what = " ".join(text.split()[:2])
        if re.match(r"FN\s*\d+\s*:", text):
            raise StatementError(f"{what} jumps, or asks the control", "FN 0 to FN 8, formulas", REMEDY)
        if self.options.unknown_motion == "error":
            raise StatementError(f"{readable(what)[:40]} is not read", "L, C, CC, CR, CT, CP, LP, LN, RND, CHF", REMEDY)
        self.recorder.event(self.line, what, readable(text), note=f"{readable(what)} left out, as asked")
        self.leave((0, 1, 2), readable(what))

    def _tool(self, text: str) -> None:
        match = _TOOL.match(text)
        if match is None or (match[3] or "Z").upper() != "Z":
            raise StatementError("a tool along another axis than Z", "TOOL CALL 5 Z S3000", REMEDY)
        block = Block()
        for letter, value in _SPEED.findall(match[4]):
            block.words[letter.upper()] = number(value, self.values) * (
                self.feed_scale if letter.upper() == "F" else 1.0
            )
        given = match[1] or match[2]
        if match[2]:
            block.words["T"] = float(match[2])
        block.tool = match[1] or ""
        self.take(block)
        if "F" in block.words:
            self.feed_of_tool = block.words["F"]
        if given:
            self._change_tool()

    def finish(self) -> None:
        """What the end of the file leaves open."""
        try:
            self.settle()
        except StatementError as fault:
            self.refuse(fault, self.text)
        if not self.over:
            self.recorder.note(self.line, "the program ends without END PGM: it may be cut short")

    def ended(self, misc: list[int]) -> None:
        """M2 and M30 end the program."""
        self.over = any(code in ENDS and code != 99 for code in misc)
