"""Statements of conversational programs: lines joined, Q parameters put in, words told apart."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from machining.magnitudes import LARGEST
from machining.toolpaths.gcode.values import Values
from machining.toolpaths.heidenhain.harmless import OF_MISC
from machining.toolpaths.recorder import StatementError

# A block number, and the slash that lets a block be left out before or behind it.
_NUMBER = re.compile(r"^(/?)\s*\d+(?:\s+|$)")
_VALUE = r"[-+]?\s*(?:Q[LR]?\d+|\d+[.,]?\d*|[.,]\d+)"
# A number as anything that looks like one, for statements with words of their own; what is none is refused then.
VALUE = r"[-+]?\s*(?:Q[LR]?\d+|[\d.,]+)"
REMEDY = "post it as single moves"
_WORD = re.compile(
    rf"\s*(?:(?P<flag>R0|RL|RR|FMAX|F\s+MAX|F\s*AUTO|MB\s*MAX|DR\s*[-+])(?![A-Z0-9.,])"
    rf"|(?P<key>IPR|IPA|PR|PA|LA|[NT][XYZ]|I?[XYZABC]|R|MB|M|F|T)\s*(?P<value>{_VALUE}))",
    re.I,
)
_Q = re.compile(r"\bQ([LR]?)(\d+)")
_ASSIGNED = re.compile(r"^(Q[LR]?\d+)\s*=\s*(.+)$")
_FN = re.compile(r"^FN\s*([0-8])\s*:\s*(Q[LR]?\d+)\s*=\s*(.+)$")
_FUNCTION = re.compile(r"\b(SIN|COS|TAN|ASIN|ACOS|ATAN|SQRT|ABS|LN|EXP)\s*([-+]?(?:#\d+|\d+\.?\d*))")
# FN 0 to FN 8: what stands between their two values, as an expression.
_FN_FORMS = {
    "1": ("+", "{0} + {1}"),
    "2": ("-", "{0} - {1}"),
    "3": ("*", "{0} * {1}"),
    "4": ("DIV", "{0} / {1}"),
    "5": ("SQRT", "SQRT[{1}]"),
    "6": ("SIN", "SIN[{1}]"),
    "7": ("COS", "COS[{1}]"),
    "8": ("LEN", "SQRT[{0} * {0} + {1} * {1}]"),
}
# Numbers of local and permanent Q parameters, apart from those of plain ones.
_KINDS = {"": 0, "L": 300_000, "R": 600_000}
# Rotary axes where PLANE has worked them out: the parameters that hold them (Q120 to Q122), by axis.
WORKED_OUT = {"A": "Q120", "B": "Q121", "C": "Q122"}
# Sign before a power, which controls and calculators take in two ways.
_SIGNED_POWER = re.compile(r"(?:^|[-+*/^(])\s*-\s*[^-+*/()]*\^")


@dataclass(frozen=True)
class Words:
    """Words of a motion: ``values`` by name, ``misc`` M codes, ``flags`` such as R0, FMAX, DR+."""

    values: dict[str, float] = field(default_factory=dict)
    misc: list[int] = field(default_factory=list)
    flags: set[str] = field(default_factory=set)


def statements(source: Iterable[str]) -> Iterator[tuple[int, str, str]]:
    """Line number, text in capitals without its block number, and comment; lines that ``~`` joins are one."""
    first, held, said = 0, "", ""
    for number, raw in enumerate(source, start=1):
        text, _, comment = raw.partition(";")
        text = text.strip()
        if not held:
            first, text = number, _NUMBER.sub(r"\1", text).strip()
        joined = text.endswith("~") or bool(text and comment.rstrip().endswith("~"))
        held, said = f"{held} {text.rstrip('~')}".strip(), said or comment
        if joined:
            continue
        yield first, held if '"' in held else held.upper(), said.strip(" ~")
        held, said = "", ""
    if held:
        yield first, held.upper(), said


def key(name: str) -> str:
    """Name of a Q parameter as a variable of :class:`Values`."""
    match = _Q.fullmatch(name.upper())
    if match is None:
        raise StatementError(f"Q parameter {name}", "Q0 to Q1999", code="P018")
    return f"#{_KINDS[match[1]] + int(match[2])}"


def assign(text: str, values: Values) -> bool:
    """Take ``Q1 = ...`` or ``FN 0: Q1 = ...``; whether the text is one of these.

    Raises
    ------
    StatementError
        An expression that is none, or of parameters without a value.
    """
    if function := _FN.match(text):
        number, name, rest = function.groups()
        if number != "0":
            sign, form = _FN_FORMS[number]
            left, found, right = rest.partition(sign) if number not in "12" else _split(rest, sign)
            if not found:
                raise StatementError(f"FN {number} without {sign}", f"FN {number}: Q1 = Q2 {sign} Q3", code="P018")
            rest = form.format(left.strip(), right.strip())
    elif plain := _ASSIGNED.match(text):
        name, rest = plain.groups()
    else:
        return False
    rest = _Q.sub(lambda match: key(match[0]), rest.replace(",", "."))
    if _SIGNED_POWER.search(rest):
        raise StatementError("a power of a number with a sign", "brackets, as in (-Q1) ^ 2", code="P018")
    rest = (
        _FUNCTION.sub(lambda m: f"{m[1]}[{m[2]}]" + ("/[1]" if m[1] == "ATAN" else ""), rest)
        .replace("^", "**")
        .replace("(", "[")
        .replace(")", "]")
    )
    values.known[key(name)] = values.value(rest)
    return True


def _split(rest: str, sign: str) -> tuple[str, str, str]:
    """The two sides of a sum or a difference; a sign at the front is that of the first number."""
    at = rest.find(sign, 1 + len(rest) - len(rest.lstrip()))
    return (rest[:at], sign, rest[at + 1 :]) if at > 0 else (rest, "", "")


def number(text: str, values: Values) -> float:
    """A number, or a Q parameter with a sign or none.

    Raises
    ------
    StatementError
        A parameter without a value, no number, or one too large.
    """
    text = text.replace(" ", "").replace(",", ".").upper()
    sign = -1.0 if text.startswith("-") else 1.0
    text = text.lstrip("+-")
    if text.startswith("Q"):
        name = key(text)
        if name not in values.known:
            raise StatementError(
                f"{text} has no value here", "Q parameters that a statement before has set", code="P018"
            )
        return sign * values.known[name]
    try:
        value = float(text)
    except ValueError:
        raise StatementError(f"{text[:12]} is no number", "numbers such as 1500 or 12.5", code="P018") from None
    if value > LARGEST:
        raise StatementError(f"{text[:12]}...", f"up to {LARGEST:g}", code="P018")
    return sign * value


def words(text: str, values: Values) -> Words:
    """Words of a motion behind its keyword; those behind an M function that are its own are left out with it.

    Raises
    ------
    StatementError
        Text that is no word, or a word given twice.
    """
    out, end, of_misc = Words(), 0, set[str]()
    for match in _WORD.finditer(text):
        if text[end : match.start()].strip(" ,"):
            break
        end = match.end()
        flag, name = (match["flag"] or "").upper().replace(" ", ""), (match["key"] or "").upper()
        if flag in out.flags or (name in out.values and name not in of_misc):
            raise StatementError(f"{flag or name} twice", "each word once", code="P020")
        if flag:
            out.flags.add(flag)
        elif name == "M":
            out.misc.append(int(number(match["value"], values)))
            of_misc = set(OF_MISC.get(out.misc[-1], ()))
        elif name in of_misc:
            number(match["value"], values)
            of_misc.remove(name)
        elif match["value"].lstrip("+ ").upper() == WORKED_OUT.get(name) and key(WORKED_OUT[name]) not in values.known:
            out.flags.add("SWIVEL")
        else:
            out.values[name] = number(match["value"], values)
    if rest := text[end:].strip(" ,"):
        raise StatementError(f"{rest[:30]!r} is no word of a motion", "X+10, IZ-5, R0, F500, FMAX, M3", code="P020")
    return out
