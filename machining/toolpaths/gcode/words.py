"""Blocks of G-code as words: letters with numbers; comments, macros and words of more letters are told apart."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from machining.magnitudes import LARGEST

_COMMENT = re.compile(r"\(([^()]*)\)")
_WORD = re.compile(r"([A-Z])\s*([+-]?(?:\d+\.?\d*|\.\d+))")
_LONG = re.compile(r"[A-Z_]{2,}[A-Z0-9_]*(?:\s*\([^()]*\))?")
_MACRO = re.compile(
    r"#|=|\[|\b(?:WHILE|IF|GOTO[BFC]?|DO\d*|END\d+|ENDIF|ENDWHILE|FOR|ENDFOR|LOOP|ENDLOOP|REPEAT|CALL|PROC|DEF|EXTERN)\b|"
    r"^\s*(?:N\d+\s*)?O\s*<|^\s*O\d+\s+(?:SUB|ENDSUB|IF|WHILE|DO|CALL|RETURN|REPEAT)"
)
# Words that count something, by the parts of one that they may have: G codes have tenths.
WHOLE = {"G": 10, "M": 1, "T": 1}
# Long words that change nothing here.
QUIET = (
    "SUPA",
    "DIAMOF",
    "DIAMON",
    "CFIN",
    "CFTCP",
    "CFC",
    "SOFT",
    "BRISK",
    "DRIVE",
    "FFWON",
    "FFWOF",
    "ORIWKS",
    "ORIMKS",
)
# Words whose brackets are no comment.
CALLS = ("CYCLE", "MCALL", "MSG", "HOLES", "POCKET", "SLOT")
MOTION_WORDS = re.compile(
    r"^(?:CYCLE(?!832)\d+|HOLES\d|POCKET\d|SLOT\d|LONGHOLE|MCALL|CIP|CT|BSPLINE|ASPLINE|CSPLINE|POLY|PLANE|ROT|AROT|TRANS|"
    r"ATRANS|SCALE|ASCALE|MIRROR|AMIRROR|TRACYL|TRANSMIT|COLLECT|CC|CR|LN|CYCL|TOOL|BEGIN|L)$"
)


@dataclass(slots=True)
class Block:
    """One block: ``words`` by letter (G and M apart), ``codes`` of G in tenths, ``misc`` of M, ``long`` words.

    ``deleted``: starts with a slash. ``macro``: text of what needs a macro interpreter. ``bad``: text that is none of
    these. ``points``: letters written with a decimal point.
    """

    words: dict[str, float] = field(default_factory=dict)
    codes: list[int] = field(default_factory=list)
    misc: list[int] = field(default_factory=list)
    long: list[str] = field(default_factory=list)
    comments: list[str] = field(default_factory=list)
    points: set[str] = field(default_factory=set)
    deleted: bool = False
    macro: str = ""
    bad: str = ""

    def __str__(self) -> str:
        return " ".join(f"{letter}{value:g}" for letter, value in self.words.items())


def block(line: str) -> Block:
    """Words of one line."""
    out = Block()
    text = line.strip()
    # Siemens messages hold comment signs inside quotes.
    if '"' in text:
        text = re.sub(r'"[^"]*"', "", text)
    if ";" in text:
        text, _, comment = text.partition(";")
        out.comments.append(comment)
    if "(" in text and not text.upper().lstrip("/ 0123456789N").startswith(CALLS):
        out.comments += _COMMENT.findall(text)
        text = _COMMENT.sub(" ", text)
        text, mark, comment = text.partition("(")
        if mark:
            out.comments.append(comment)
    text = text.upper()
    text = text.strip()
    if text.startswith("/"):
        out.deleted, text = True, re.sub(r"^/\d?", "", text).strip()
    if not text or text.startswith("%"):
        return out
    if _MACRO.search(text):
        out.macro = text
        return out
    last = 0
    for match in _LONG.finditer(text):
        _words(out, text[last : match.start()])
        out.long.append(match[0])
        last = match.end()
    _words(out, text[last:])
    return out


def _words(out: Block, text: str) -> None:
    """Enter the words of a text without long words; what stands between them must be no more than commas."""
    end = 0
    for match in _WORD.finditer(text):
        out.bad = out.bad or text[end : match.start()].strip(" ,")
        end = match.end()
        _put(out, match[1], match[2])
    out.bad = out.bad or text[end:].strip(" ,")


def _put(out: Block, letter: str, number: str) -> None:
    value = float(number)
    if abs(value) > LARGEST:
        out.bad = out.bad or f"{letter}{number[:12]}..."
    elif letter in WHOLE and abs(value * WHOLE[letter] - round(value * WHOLE[letter])) > 1e-6:
        # G43.45 and M3.5 are no codes; cut to G43.4 and M3 they would be others.
        out.bad = out.bad or f"{letter}{number[:12]}"
    elif letter == "G":
        out.codes.append(round(value * 10))
    elif letter == "M":
        out.misc.append(round(value))
    elif letter in out.words:
        out.bad = out.bad or f"{letter} twice"
    elif letter != "N":
        out.words[letter] = value
        if "." in number:
            out.points.add(letter)
