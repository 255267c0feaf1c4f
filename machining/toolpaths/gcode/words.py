"""Blocks of G-code as words: letters with numbers; comments, macros and words of more letters are told apart."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from machining.magnitudes import LARGEST
from machining.toolpaths.gcode.values import BRACKET, COMPUTES, DECLARES, NAMED
from machining.toolpaths.recorder import StatementError

_COMMENT = re.compile(r"\(([^()]*)\)")
# Fanuc rounds and chamfers corners by words behind a comma.
_WORD = re.compile(r"(,\s*[A-Z]|[A-Z])\s*([+-]?(?:\d+\.?\d*|\.\d+))")
_LONG = re.compile(r"(?:MCALL\s+(?=[A-Z]))?[A-Z_]{2,}[A-Z0-9_]*(?:\s*\([^()]*\))?")
# What decides which blocks run: a true macro program.
_MACRO = re.compile(
    r"\b(?:WHILE|IF|GOTO[BFC]?|DO\d*|END\d+|ENDIF|ENDWHILE|FOR|ENDFOR|LOOP|ENDLOOP|REPEAT|CALL|PROC|DEF|EXTERN)\b|"
    r"^\s*(?:N\d+\s*)?O\s*<|^\s*O\d+\s+(?:SUB|ENDSUB|IF|WHILE|DO|CALL|RETURN|REPEAT)"
)
_TOOL = re.compile(r"\bT\s*=?\s*\"([^\"]{1,80})\"", re.I)
# Words of several letters with a number, and words that say themselves whether they are absolute.
_NAMED = re.compile(rf"\b({NAMED})=([-+]?[\d.]+)")
_OWN = re.compile(r"\b([XYZABCIJK]|AP|RP)=(AC|IC)\(([-+]?[\d.]+)\)")
# The number of a block stands before all else.
_LATE_NUMBER = re.compile(r"(?<=.)(?<![A-Z_])N\s*\d")
# Words that count something, by the parts of one that they may have: G codes have tenths.
WHOLE = {"G": 10, "M": 1, "T": 1}
# Words whose brackets are no comment.
CALLS = ("CYCLE", "MCALL", "MSG", "HOLES", "POCKET", "SLOT")


class Words(dict[str, float]):
    """Words of a block by letter; ``used`` are those whose number somebody has asked for."""

    def __init__(self, words: Mapping[str, float] = MappingProxyType({})) -> None:
        super().__init__(words)
        self.used: set[str] = set()

    def __getitem__(self, key: str) -> float:
        self.used.add(key)
        return super().__getitem__(key)

    def get(self, key: str, default: Any = None) -> Any:
        """The number of a word, which counts as used."""
        return self[key] if key in self else default  # noqa: SIM401 - this is what get does

    @property
    def left(self) -> list[str]:
        """Words that nobody has asked for."""
        return [key for key in self if key not in self.used]


@dataclass(slots=True)
class Block:
    """One block: ``words`` by letter (G and M apart), ``codes`` of G in tenths, ``misc`` of M, ``long`` words.

    ``deleted``: starts with a slash. ``computes``: text whose numbers are to be worked out first, then :meth:`take`.
    ``macro``: text of what needs a macro interpreter. ``bad``: text that is none of these. ``points``: letters written
    with a decimal point. ``own``: of words that are so by themselves (``X=IC(5)``) whether they are absolute.
    ``tool``: a tool's name in quotes. ``tape_mark``: % alone, at the beginning and the end. ``title``: text behind a %.
    """

    words: Words = field(default_factory=Words)
    codes: list[int] = field(default_factory=list)
    misc: list[int] = field(default_factory=list)
    long: list[str] = field(default_factory=list)
    comments: list[str] = field(default_factory=list)
    points: set[str] = field(default_factory=set)
    own: dict[str, bool] = field(default_factory=dict)
    tool: str = ""
    deleted: bool = False
    computes: str = ""
    macro: str = ""
    bad: str = ""
    tape_mark: bool = False
    title: str = ""

    def __str__(self) -> str:
        return " ".join(f"{letter}{value:g}" for letter, value in self.words.items())

    @property
    def empty(self) -> bool:
        """Whether there is nothing to do."""
        return not (self.words or self.codes or self.misc or self.long or self.macro or self.computes or self.bad)

    @property
    def ends(self) -> bool:
        """Whether it says once more that the program is over, or names the next one."""
        return self.words.keys() <= {"O"} and not (
            self.codes or self.long or self.macro or self.computes or self.bad or set(self.misc) - {2, 17, 30, 99}
        )

    def take(self, text: str) -> None:
        """Enter words with plain numbers, in capitals."""
        if late := _LATE_NUMBER.search(text.lstrip()):
            self.bad = self.bad or late[0] + " within a block"
        if "=" in text:
            for letter, way, number in _OWN.findall(text):
                _put(self, letter, number)
                self.own[letter] = way == "AC"
            for name, number in _NAMED.findall(text):
                # S1= and M1= are of the first spindle, which mills.
                _put(self, {"CR": "R", "S1": "S", "M1": "M"}.get(name, name), number)
            text = _NAMED.sub(" ", _OWN.sub(" ", text))
        last = 0
        for match in _LONG.finditer(text):
            _words(self, text[last : match.start()])
            self.long.append(match[0])
            last = match.end()
        _words(self, text[last:])


def block(line: str) -> Block:
    """Words of one line."""
    out = Block()
    # Tabulators between words are blanks; those in comments are no matter.
    text = line.replace("\t", " ").strip()
    # Siemens messages hold comment signs inside quotes.
    if '"' in text:
        if tool := _TOOL.search(text):
            out.tool, text = tool[1], _TOOL.sub(" ", text)
        text = re.sub(r'"[^"]*"', "", text)
    if ";" in text:
        text, _, comment = text.partition(";")
        out.comments.append(comment)
    if "(" in text and not text.upper().lstrip("/ 0123456789N").startswith(CALLS):
        text = _without_comments(out, text)
    text = text.upper().strip()
    if text.startswith("/"):
        out.deleted, text = True, re.sub(r"^/\d?", "", text).strip()
    if not text or text.startswith("%"):
        out.tape_mark, out.title = text == "%", text[1:].strip()
        return out
    if "DEF" in text and DECLARES.match(text):
        out.computes = text
    elif _MACRO.search(text):
        out.macro = text
    elif COMPUTES.search(text):
        out.computes = text
    else:
        out.take(text)
    return out


def _without_comments(out: Block, text: str) -> str:
    """The text without its comments in brackets; brackets of expressions stay where something is worked out."""
    kept = ""
    if "=" in text:
        while "(" in text:
            head, _, rest = text.partition("(")
            kept += head
            if not BRACKET.search(f"{kept}(".upper()):
                comment, _, text = rest.partition(")")
                out.comments.append(comment)
                kept += " "
                continue
            size = _closed(rest)
            kept, text = f"{kept}({rest[:size]}", rest[size:]
        return kept + text
    out.comments += _COMMENT.findall(text)
    text = _COMMENT.sub(" ", text)
    text, mark, comment = text.partition("(")
    if mark:
        out.comments.append(comment)
    return text


def _closed(text: str) -> int:
    """Characters up to the bracket that closes one which was opened before; all where none does."""
    depth = 1
    for i, character in enumerate(text):
        depth += (character == "(") - (character == ")")
        if not depth:
            return i + 1
    return len(text)


def _words(out: Block, text: str) -> None:
    """Enter the words of a text without long words; nothing may stand between them."""
    end = 0
    for match in _WORD.finditer(text):
        out.bad = out.bad or text[end : match.start()].strip()
        end = match.end()
        _put(out, match[1].replace(" ", ""), match[2])
    out.bad = out.bad or text[end:].strip()


def cycle_arguments(name: str, text: str, value: Callable[[str], float], texts: Sequence[int] = ()) -> list[float]:
    """Arguments between the brackets of a Siemens cycle; NaN for empty ones and for those at the places ``texts``.

    ``value``: what an expression with variables comes to.

    Raises
    ------
    StatementError
        Arguments that are no finite numbers, or too large.
    """
    out = []
    for place, part in enumerate(text.split(",")):
        try:
            number = value(part.strip()) if part.strip() and place not in texts else math.nan
        except StatementError:
            number = math.inf
        if abs(number) > LARGEST or (math.isnan(number) and part.strip() and place not in texts):
            raise StatementError(
                f"{name} with {part.strip()[:20]!r}", f"finite numbers of at most {LARGEST:g} in size", code="P012"
            )
        out.append(number)
    return out


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
