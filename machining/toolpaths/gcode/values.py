"""Numbers that a G-code program works out: variables (``#1``, ``#<depth>``, ``R1``), brackets and functions.

Blocks come out with plain numbers, and assignments are kept for the blocks behind them. What decides which blocks run
(IF, WHILE, GOTO) is a macro program and not worked out. By RS-274/NGC (NISTIR 6556, sections 2.1.2.2 and 3.3.2.3) and,
for ``R1=`` and ``X=``, Siemens' programming manual; assignments of a block hold from the next one on.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Mapping

from machining.magnitudes import LARGEST
from machining.toolpaths.recorder import StatementError

# Words of Siemens of several letters that take a number.
NAMED = "CR|TURN|AR|AP|RP|ANG|RND|RNDM|CHF|CHR|FRC|FRCM|RPL|I1|J1|ADIS|ADISPOS|CTOL|OTOL|ATOL|[ABC]3|[SM][1-9]"
_FUNCTION = r"(?:ASIN|ACOS|ATAN2|ATAN|SIN|COS|TAN|SQRT|ABS|EXP|LN|ROUND|FIX|FUP|TRUNC|POT|EXISTS|AC|IC)(?=\s*[\[(])"
# Letters may stand close: X, then SIN[30]. Words of three letters and more are Siemens'.
_TOKEN = re.compile(
    r"\s*(?:(?P<number>\d+\.?\d*|\.\d+)|(?P<named>#\s*<[^<>]*>)"
    rf"|(?P<name>{_FUNCTION}|(?:MOD|AND|XOR|OR|EQ|NE|GT|GE|LT|LE)(?![A-Z])|(?:{NAMED})(?=\s*=)"
    rf"|(?![A-Z]{_FUNCTION})[A-Z_]{{3,}}[A-Z0-9_]*|[A-Z])|(?P<sign>\*\*|[-+*/=#,\[\]()]))"
)
# Whether a block has anything to work out, and the end of a text behind which a bracket holds no comment.
COMPUTES = re.compile(r"[#=\[]")
BRACKET = re.compile(r"(?:[-=+*/,(]|\b(?:AC|IC|SIN|COS|TAN|ASIN|ACOS|ATAN2?|SQRT|ABS|ROUND|TRUNC|POT))\s*\($")
# Variables that a program declares.
DECLARES = re.compile(r"^(?:N\d+\s*)?DEF\s+(?:REAL|INT)\s+(.+)$")
_OWN_NAME = re.compile(r"[A-Z_]{3,}[A-Z0-9_]*")
# Behind these "=" gives the word's value.
_WORD = re.compile(rf"(?:[A-Z]|{NAMED})$")
# Values of one word that are absolute or incremental by themselves.
OWN_WAY = ("AC", "IC")
# Variables from here on set the control itself on some controls.
SYSTEM = 1000
DEEPEST = 50

_OPERATORS: tuple[Mapping[str, Callable[[float, float], float]], ...] = (
    {
        "AND": lambda a, b: float(bool(a) and bool(b)),
        "OR": lambda a, b: float(bool(a) or bool(b)),
        "XOR": lambda a, b: float(bool(a) != bool(b)),
    },
    {
        name: (lambda compare: lambda a, b: float(compare(a, b)))(getattr(operator, name.lower()))
        for name in ("EQ", "NE", "GT", "GE", "LT", "LE")
    },
    {"+": operator.add, "-": operator.sub},
    {"*": operator.mul, "/": operator.truediv, "MOD": math.fmod},
    {"**": math.pow},
)


def _whole(rounded: Callable[[float], int]) -> Callable[[float], float]:
    def of(x: float) -> float:
        if x < 0.0 and x != int(x):
            raise StatementError("FIX or FUP of a number below 0: controls differ", "0 and more", code="P018")
        return float(rounded(x))

    return of


_FUNCTIONS: Mapping[str, Callable[[float], float]] = {
    "SIN": lambda x: math.sin(math.radians(x)),
    "COS": lambda x: math.cos(math.radians(x)),
    "TAN": lambda x: math.tan(math.radians(x)),
    "ASIN": lambda x: math.degrees(math.asin(x)),
    "ACOS": lambda x: math.degrees(math.acos(x)),
    "SQRT": math.sqrt,
    "ABS": abs,
    "EXP": math.exp,
    "LN": math.log,
    "ROUND": lambda x: math.copysign(math.floor(abs(x) + 0.5), x),
    "FIX": _whole(math.floor),
    "FUP": _whole(math.ceil),
    "TRUNC": lambda x: float(math.trunc(x)),
    "POT": lambda x: x * x,
}


class Values:
    """The variables of one program."""

    def __init__(self) -> None:
        self.known: dict[str, float] = {}

    def worked_out(self, text: str) -> str:
        """A block in capitals, without comments, as words with plain numbers; its assignments are taken.

        Raises
        ------
        StatementError
            A variable without a value, an expression that is none, a number that is not finite.
        """
        if declared := DECLARES.match(text):
            self._declare(declared[1])
            return ""
        parser = _Parser(text, self.known)
        words = parser.block()
        self.known |= parser.given
        return words

    def value(self, text: str) -> float:
        """What an expression comes to; errors as :meth:`worked_out`."""
        return _Parser(text, self.known).whole()

    def _declare(self, text: str) -> None:
        """``DEF REAL DEPTH = 5, WIDTH``: variables by name; 0 without a value (Siemens)."""
        for part in text.split(","):
            name, _, value = (one.strip() for one in part.partition("="))
            if not _OWN_NAME.fullmatch(name) or name in _FUNCTIONS:
                raise StatementError(f"variable {name[:30]}", "a name of three letters or more", code="P018")
            self.known[name] = self.value(value) if value else 0.0


class _Parser:
    """One block; ``given`` are its assignments."""

    def __init__(self, text: str, known: Mapping[str, float]) -> None:
        self.known, self.given = known, dict[str, float]()
        self.tokens: list[tuple[str, str]] = []
        end = 0
        for match in _TOKEN.finditer(text):
            if match.start() != end:
                break
            end = match.end()
            kind = str(match.lastgroup)
            self.tokens.append((kind, match[kind].replace(" ", "")))
        if text[end:].strip():
            raise StatementError(
                f"{text[end:].strip()[:20]!r} is no part of an expression", "numbers, #1, [1 + 2], SIN[30]", code="P018"
            )
        self.at, self.depth = 0, 0

    def whole(self) -> float:
        """The value of all that stands there."""
        value = self._expression()
        if self.at < len(self.tokens):
            raise StatementError(f"{self.tokens[self.at][1]!r} behind an expression", "one expression", code="P018")
        return value

    def block(self) -> str:
        """Words of the block with numbers; assignments are left out."""
        out: list[str] = []
        while self.at < len(self.tokens):
            kind, text = self.tokens[self.at]
            if kind == "named" or text == "#":
                key = self._variable()
                self._expect("=")
                self._assign(key, self._expression())
            elif kind == "name":
                self.at += 1
                out.append(self._named(text))
            else:
                raise StatementError(
                    f"{text!r} where a word or a variable is expected", "as in X[#1 + 2], #1 = 5", code="P018"
                )
        return " ".join(filter(None, out))

    def _named(self, text: str) -> str:
        """What begins with letters: a variable of Siemens that is set, a word with its value, or a word alone."""
        if text == "R" and (key := self._parameter()) and self._next("="):
            self._assign(key, self._expression())
            return ""
        if self._next("="):
            if text in self.known:
                self._assign(text, self._expression())
                return ""
            if not _WORD.match(text):
                raise StatementError(
                    f"{text} = ...: a name that is not known", "#1 to #999, #<name>, R1, axes", code="P018"
                )
            if self.at < len(self.tokens) and self.tokens[self.at][1] in OWN_WAY:
                self.at += 1
                return f"{text}={self.tokens[self.at - 1][1]}({_plain(self._bracket())})"
            return text + ("=" if len(text) > 1 else "") + _plain(self._expression())
        if len(text) > 1:
            return text
        return text + (_plain(self._value()) if self._has_value() else "")

    def _has_value(self) -> bool:
        """Whether a number follows, and not the next word."""
        if self.at >= len(self.tokens):
            return False
        kind, text = self.tokens[self.at]
        return kind in ("number", "named") or text in "+-#[(" or text in _FUNCTIONS or text in ("ATAN", "EXISTS")

    def _parameter(self) -> str:
        """Siemens' ``R5`` where the number behind R is whole and ``=`` follows; empty where it is a word."""
        after = self.tokens[self.at : self.at + 2]
        if len(after) == 2 and after[0][0] == "number" and after[0][1].isdigit() and after[1][1] == "=":
            self.at += 1
            return "R" + after[0][1]
        return ""

    def _assign(self, key: str, value: float) -> None:
        number = key.lstrip("#")
        if key.startswith("#") and number.isdigit() and int(number) >= SYSTEM:
            raise StatementError(f"{key} may be a variable of the control itself", f"#1 to #{SYSTEM - 1}", code="P018")
        self.given[key] = value

    def _variable(self) -> str:
        """Key of the variable that stands here: ``#5``, ``#<depth>``."""
        kind, text = self.tokens[self.at]
        self.at += 1
        if kind == "named":
            return "#" + text[1:].replace("\t", "").lower()
        number = self._value()
        if number != int(number) or number < 0:
            raise StatementError(f"variable #{number:g}", "a whole number", code="P018")
        return f"#{int(number)}"

    def _expression(self, level: int = 0) -> float:
        """An expression of operators that bind as ``level`` and tighter."""
        if level == len(_OPERATORS):
            return self._value()
        left = self._expression(level + 1)
        while self.at < len(self.tokens) and self.tokens[self.at][1] in _OPERATORS[level]:
            sign = self.tokens[self.at][1]
            self.at += 1
            left = _finite(_OPERATORS[level][sign], left, self._expression(level + 1))
        return left

    def _value(self) -> float:
        """A number, a variable, a bracket, a function, each with a sign or none."""
        self.depth += 1
        if self.depth > DEEPEST:
            raise StatementError("brackets in brackets", f"at most {DEEPEST} deep", code="P018")
        value = self._unsigned()
        self.depth -= 1
        return value

    def _unsigned(self) -> float:
        if self.at >= len(self.tokens):
            raise StatementError(
                "the block ends where a number is expected", "numbers, #1, [1 + 2], SIN[30]", code="P018"
            )
        kind, text = self.tokens[self.at]
        if text in ("-", "+"):
            self.at += 1
            return -self._value() if text == "-" else self._value()
        if kind == "number":
            self.at += 1
            return _finite(float, text)
        if kind == "named" or text == "#":
            return self._get(self._variable())
        if text in ("[", "("):
            return self._bracket()
        if kind == "name":
            self.at += 1
            return self._function(text)
        raise StatementError(f"{text!r} where a number is expected", "numbers, #1, [1 + 2], SIN[30]", code="P018")

    def _bracket(self) -> float:
        ends = {"[": "]", "(": ")"}[self.tokens[self.at][1]]
        self.at += 1
        value = self._expression()
        self._expect(ends)
        return value

    def _function(self, name: str) -> float:
        if name == "R" and self.at < len(self.tokens) and self.tokens[self.at][1].isdigit():
            self.at += 1
            return self._get("R" + self.tokens[self.at - 1][1])
        if name in self.known:
            return self._get(name)
        here = self.at < len(self.tokens) and self.tokens[self.at][1] in ("[", "(")
        if name == "EXISTS" and here:
            self.at += 1
            key = self._variable()
            self._expect("]")
            if key[1:].isdigit():
                raise StatementError(
                    f"EXISTS of {key}: controls differ", "EXISTS of a name, as in EXISTS[#<depth>]", code="P018"
                )
            return float(key in self.known)
        if name == "ATAN" and here:
            y = self._bracket()
            self._expect("/")
            return math.degrees(math.atan2(y, self._bracket()))
        if name == "ATAN2" and here:
            self.at += 1
            y = self._expression()
            self._expect(",")
            x = self._expression()
            self._expect(")")
            return math.degrees(math.atan2(y, x))
        if name not in _FUNCTIONS or not here:
            raise StatementError(
                f"{name} is no function that is worked out", ", ".join((*_FUNCTIONS, "ATAN")), code="P018"
            )
        return _finite(_FUNCTIONS[name], self._bracket())

    def _get(self, key: str) -> float:
        if key not in self.known:
            raise StatementError(
                f"variable {key} has no value here", "variables that a block before has set", code="P018"
            )
        return self.known[key]

    def _next(self, text: str) -> bool:
        if self.at < len(self.tokens) and self.tokens[self.at][1] == text:
            self.at += 1
            return True
        return False

    def _expect(self, text: str) -> None:
        if not self._next(text):
            raise StatementError(f"{text!r} is missing", "closed brackets, #1 = 5", code="P018")


def _finite(function: Callable[..., float], *of: float | str) -> float:
    try:
        value = float(function(*of))
    except StatementError:
        raise
    except (ValueError, ZeroDivisionError, OverflowError):
        value = math.nan
    if not abs(value) <= LARGEST:
        raise StatementError("an expression without a finite value", f"up to {LARGEST:g}", code="P018")
    return value


def _plain(value: float) -> str:
    """The number without an exponent, and without a point where it is whole."""
    return f"{value:.9f}".rstrip("0").rstrip(".")
