"""APT and CLSF files: Siemens NX, CATIA, Creo, SolidWorks CAM, Autodesk and relatives.

Words by ISO 4343 and the vendors' manuals; where dialects differ, the module of the word says so. Files are read line
by line; the numbers of ``GOTO/`` go straight into flat arrays.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from machining.magnitudes import LARGEST
from machining.toolpaths.apt import harmless, words
from machining.toolpaths.apt.motion import AptMotion
from machining.toolpaths.apt.state import Handler
from machining.toolpaths.apt.words import Statement, statement
from machining.toolpaths.motions import Motions
from machining.toolpaths.options import ReadOptions
from machining.toolpaths.recorder import StatementError
from machining.toolpaths.source import lines, readable
from robots.files.reading import recording

# Words that an open arc has to be ended before.
CLOSED_ARC = ("FROM", "GOHOME", "GODLTA", "CIRCLE", "MOVARC", "TLON,GOFWD", "CYCLE")
STATEMENT_LIMIT = 65536
_WORD = re.compile(r"[A-Z]+\s*=?\s*[-+]?[\d.]+")
# A block of words alone, and what is a command even among other text ("Stock Size X40. Y267." is a text).
_BLOCK = re.compile(rf"(?:{_WORD.pattern}\s*)*")
_COMMAND = re.compile(
    r"(?<![\w=-])(?:[GM]\d+(?:\.\d+)?(?!\w)|CALL\s+(?:LBL|PGM)|CYCLE\d+|"
    r"(?:CALL|CYCL|PLANE|A?TRANS|A?ROT|SUPA|MCALL|EXTCALL|TRAORI|L|LP|CC|CP|CR|CT)(?=\s+\S*[-+\d\"]))"
)
REMEDY = "post the program without it, or go on without it: --read unknown_motion=report (unknown_motion= in Python)"


@recording()
def read_apt(path: Path, options: ReadOptions | None = None) -> Motions:
    """Read an APT or CLSF file.

    ``RAPID`` holds for the next motion. ``GOTO`` without a tool axis keeps the last one (z before the first).
    ``FROM`` is the first point, and rapid. ``GOHOME``, ``GOHOME/x,y,z`` (to above its point), ``RETRCT`` are retracts
    (:mod:`machining.toolpaths.retracts`). ``DELAY`` counts for the move before it.
    Words that change nothing about the path are in :mod:`machining.toolpaths.apt.harmless`, with the reason; all others
    are refused.

    Raises
    ------
    InputError
        The file is too large, too many moves, no unit of length.
    InputErrors
        Faults of lines, all of them.
    """
    options = options or ReadOptions()
    reader = _Reader(path, options)
    reader.read(lines(path, options.max_bytes))
    return reader.recorder.motions()


class _Reader(AptMotion):
    harmless = harmless.WORDS

    def __init__(self, path: Path, options: ReadOptions) -> None:
        super().__init__(path, options)
        self.head, self.head_line, self.comment_goes_on = "", 0, False
        # Nothing open that the short way for GOTO would miss.
        self.plain, self.finished = True, False
        self.table: dict[str, Handler] = {
            **self.state_words(),
            **self.motion_words(),
            **dict.fromkeys(harmless.WORDS, self._keep),
            **dict.fromkeys(harmless.DROPPED, lambda _: None),
            "PREFUN": self._codes,
            "AUXFUN": self._codes,
            "INSERT": self._insert,
        }

    def read(self, source: Iterable[str]) -> None:
        number = 0
        for number, raw in enumerate(source, start=1):
            if self.plain and raw.startswith("GOTO"):
                head, _, rest = raw.partition("/")
                if len(head.rstrip()) == 4 and "$" not in rest and "_" not in rest:
                    try:
                        values = list(map(float, rest.split(",")))
                    except ValueError:
                        values = []
                    # What no machine goes to is told by the long way; NaN is not less than anything.
                    if len(values) in (3, 6) and sum(map(abs, values)) < LARGEST:
                        self.line = number
                        if len(values) == 6:
                            self.axis = (values[3], values[4], values[5])
                        s = self.scale
                        self._to((values[0] * s, values[1] * s, values[2] * s))
                        continue
            self._physical(number, raw)
        self.line = number
        self._finish()

    # Lines and statements

    def _physical(self, number: int, raw: str) -> None:
        text, comment_mark, comment = raw.strip().partition("$$")
        if self.comment_goes_on:
            # Creo's $$-> words run over lines too.
            self.comment_goes_on = text.endswith("$")
            return
        if comment_mark:
            self.comment_goes_on = not text and comment.startswith("->") and comment.rstrip().endswith("$")
            self._comment(number, comment)
        if not text.strip():
            return
        if not self.head:
            self.head_line = number
        body, dollar, behind = text.partition("$")
        if dollar and behind.strip() and statement(self.head + text).word in words.TEXT_WORDS:
            body, dollar = text, ""
        whole = self.head + body
        if dollar:
            self.head, self.plain = whole, False
            if len(whole) > STATEMENT_LIMIT:
                self.line, self.head = self.head_line, ""
                self.refuse(StatementError("statement", f"up to {STATEMENT_LIMIT} characters", code="P020"))
            return
        self.head, self.line = "", self.head_line
        self._settle()
        if whole.strip():
            self._statement(whole)

    def _statement(self, text: str) -> None:
        s = statement(text)
        word, handler = s.word, self.table.get(s.word)
        if word in CLOSED_ARC:
            self._no_open_arc()
        try:
            if handler is not None:
                self._minor(s)
                handler(s)
            elif word == "PROBE" and s.parts in (["ON"], ["OFF"]):
                self.recorder.command(self.line, "probe", float(s.parts == ["ON"]), s.rest, word)
            elif not words.sounds_like_motion(word) and word in self.options.ignore:
                self.changes_nothing(word, readable(s.rest))
            elif word[:1] in "+-.,0123456789(" and not words.sounds_like_motion(word):
                fault = StatementError(
                    "numbers without a word before them", "GOTO/ and the like, or $ above", code="P020"
                )
                self.refuse(fault, readable(text))
            else:
                self._lost(s)
        except StatementError as fault:
            self.arc = None
            fault.what = f"{word}: {fault.what}"
            self.refuse(fault, readable(text))
        self._settle()

    def _comment(self, number: int, text: str) -> None:
        text = readable(text).strip()
        if not text:
            return
        self.recorder.event(number, "$$", text)
        head, _, name = text.partition(":")
        if head.strip().upper() == "OPERATION NAME" and name.strip():
            self.operation, self.dirty = words.name(name), True
            self.recorder.operation(number, self.operation, "OPERATION NAME")

    def _lost(self, s: Statement) -> None:
        sounds = "sounds like a motion and" if words.sounds_like_motion(s.word) else "may change the path: it"
        fault = StatementError(f"{sounds} is not read", "GOTO, CIRCLE, MOVARC, ...", REMEDY, code="P019")
        self.left_out(readable(s.word), fault, readable(s.rest))

    def _minor(self, s: Statement) -> None:
        """Refuse a minor word with which a major one may change the path."""
        if self.finished and s.word not in harmless.DROPPED:
            raise StatementError(
                "a statement behind FINI", "FINI as the last one", "post a file for each program", code="P020"
            )
        known = harmless.MINOR.get(s.word)
        stray = [part for part in s.parts if part and words.as_number(part) is None and part not in (known or ())]
        if known is not None and stray:
            allowed = ", ".join(sorted(known)) or f"{s.word} alone"
            raise StatementError(f"{stray[0]} is not read", allowed, REMEDY, code="P019")

    def _codes(self, s: Statement) -> None:
        """PREFUN and AUXFUN: codes as they come into the program."""
        letter = "G" if s.word == "PREFUN" else "M"
        for number in s.numbers(*range(1, 9)):
            if f"{letter}{number:g}" not in harmless.CODES:
                allowed = ", ".join(code for code in harmless.CODES if code[0] == letter)
                raise StatementError(f"{letter}{number:g} may change the path", allowed, REMEDY, code="P019")
        self.recorder.event(self.line, s.word, s.rest)

    def _insert(self, s: Statement) -> None:
        """INSERT: a block as it comes into the program; a text, or codes that change nothing of the path."""
        text = re.sub(r"\([^()]*\)?|;.*|^N\d+", " ", s.rest.upper().strip("/ ")).strip()
        whole = _BLOCK.fullmatch(text) is not None
        for code in (_WORD if whole else _COMMAND).findall(text):
            number = words.as_number(code[1:])
            if number is None or f"{code[0]}{number:g}" not in harmless.CODES:
                raise StatementError(f"{code} may change the path", "texts, and codes such as M8", REMEDY, code="P019")
        self.recorder.event(self.line, s.word, readable(s.rest))

    def _settle(self) -> None:
        self.plain = (
            not self.head and not self.finished and self.arc is None and self.cycle is None and not self.frames.moves
        )

    def _finish(self) -> None:
        if self.head:
            self.line = self.head_line
            self.refuse(
                StatementError("the file ends within a statement", "the rest behind the last $", code="P020"), self.head
            )
        if self.arc is not None:
            self.refuse(
                StatementError("the file ends behind an arc without its GOTO", "the end of the arc", code="P011")
            )
        if self.ended:
            self.recorder.finish(self.line, "END-OF-PATH")
        else:
            self.recorder.note(self.line, "the file ends without FINI or END-OF-PATH: it may be cut short", code="W037")

    def _keep(self, s: Statement) -> None:
        self.changes_nothing(s.word, readable(s.rest))
        if s.word in ("FINI", "GOUGCK", "END-OF-PATH"):
            self.ended = True
            self._no_open_arc()
        if s.word in ("FINI", "END"):
            self.recorder.finish(self.line, s.word)
        self.finished |= s.word == "FINI"
