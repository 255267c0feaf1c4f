"""Numbers as people and instruments write them: which mark is the decimal one, and what a cell is worth."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Final, Literal

from doe.instruments.units import unit_of
from doe.tables.columns import LARGEST_NUMBER
from doe.tables.workbook import Figure
from robots import InputError

Mark = Literal["point", "comma"]
MARKS: Final[tuple[Mark, ...]] = ("point", "comma")
_WITH_UNIT: Final = re.compile(r"([^A-Za-z]*?\d[.,]?(?:[eE][+-]?\d+)?)(\s*)([^\W\d_]+[^\d]*|[\u00b0\"][^\d]*)")
# What stands in cells that were not read.
NOT_READ: Final = frozenset(("", "-", "--", "---", "\u2013", "\u2014", "n/a", "#n/a", "na", "nan", "none", "null"))
_MINUS: Final = re.compile(r"^[\u2212\u2013](?=[\d.,])")
# Digits with one mark or none; or in groups of three by one mark, then the other one. 12.05.2026 is neither.
_LOOSE: Final = re.compile(
    r"[+-]?(?:\d+[.,]?\d*|[.,]\d+|\d{1,3}([.,])\d{3}(?:\1\d{3})*(?:(?!\1)[.,]\d*)?)(?:[eE][+-]?\d{1,3})?", re.ASCII
)
_SPACES: Final = re.compile(r"[ '\u2019\u00a0\u202f](?=\d{3}(?:\D|$))")
_PLAIN: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?", re.ASCII)
# Digits in groups of three between commas or points, as in 1,234 and 12.345.678: thousands, or decimals.
_GROUPED: Final = {mark: re.compile(rf"[+-]?[1-9]\d{{0,2}}(?:{re.escape(mark)}\d{{3}})+", re.ASCII) for mark in ",."}


def cleaned(cell: str) -> str:
    """A cell's text with a plain minus and without blanks between thousands."""
    text = cell.strip()
    if text.isascii() and " " not in text and "'" not in text:
        return text
    text = _MINUS.sub("-", text)
    return _SPACES.sub("", text) if text[:1] in "+-0123456789" else text


def is_number(cell: str) -> bool:
    """Whether a cell holds a number, whichever its decimal mark is, with or without a unit behind it."""
    # No instrument writes longer ones.
    if isinstance(cell, Figure):
        return True
    return len(cell) < 60 and (_LOOSE.fullmatch(cleaned(cell)) is not None or bare_and_unit(cell) is not None)


def bare_and_unit(cell: str) -> tuple[str, str] | None:
    """The number and the unit of a cell that has both, as 52.4\u00b0 or 173.9 mm; None of any other."""
    found = None if isinstance(cell, Figure) or cell[-1:].isdigit() else _WITH_UNIT.fullmatch(cell.strip())
    if found is None or not _LOOSE.fullmatch(cleaned(found[1])):
        return None
    unit = unit_of(found[3])
    # 3g and 12h are labels as a rule; N, the degree and inches stand close to their number.
    return (found[1], unit) if unit and (found[2] or len(found[3]) > 1 or found[3] in 'N\u00b0\u00ba"') else None


def evidence(cells: Iterable[tuple[int, str]]) -> dict[str, tuple[int, str]]:
    """What the number cells of a table (line, text) say of its decimal mark: the first of each kind.

    Kinds: "point" and "comma", the decimal mark beyond doubt; "1,234" and "1.234", which may be thousands or decimals;
    "point, thousands" and "comma, thousands", where the other mark is seen to stand between thousands.
    """
    found: dict[str, tuple[int, str]] = {}
    for line, cell in cells:
        if isinstance(cell, Figure) or not ("," in cell or "." in cell) or not is_number(cell):
            continue
        text = cleaned(cell)
        for kind in _kinds(text):
            found.setdefault(kind, (line, text))
    return found


def _kinds(text: str) -> tuple[str, ...]:
    if "," in text and "." in text:
        mark = "comma" if text.rindex(",") > text.rindex(".") else "point"
        return mark, f"{mark}, thousands"
    for other, mine, theirs in ((",", "comma", "point"), (".", "point", "comma")):
        if other in text:
            if text.count(other) > 1:
                return theirs, f"{theirs}, thousands"
            return (f"1{other}234",) if _GROUPED[other].fullmatch(text) else (mine,)
    return ()


def decimal_mark(cells: Sequence[tuple[int, str]], where: str, asked: str | None) -> tuple[Mark, str]:
    """The decimal mark of a table's cells (line, text), and how that is known.

    Raises
    ------
    InputError
        They contradict one another, or 1,234 may be a thousand or a little more than one: ``--decimal`` says which.
    """
    if asked is not None:
        for known in MARKS:
            if asked == known:
                return known, "as asked"
        raise InputError("--decimal", code="I003", value=asked, allowed=", ".join(MARKS), remedy="choose one of them")
    found = evidence(cells)
    if "point" in found and "comma" in found:
        (a, point), (b, comma) = found["point"], found["comma"]
        raise InputError(
            f"{where}: {point} in line {a} has a decimal point, {comma} in line {b} a decimal comma",
            code="I003",
            allowed="one decimal mark in a file",
            remedy="correct one of them, or leave its lines out with --rows",
        )
    mark: Mark = "comma" if "comma" in found else "point"
    other = "1.234" if mark == "comma" else "1,234"
    # One point alone is a decimal point, as everywhere in this program: 1.234 is in doubt only beside decimal commas.
    if other in found and f"{mark}, thousands" not in found:
        line, text = found[other]
        raise InputError(
            f"{where}: {text} in line {line} may be {text.replace(',', '.')} or "
            f"{text.replace(',', '').replace('.', '')} (thousands), and no other number settles it",
            code="I003",
            allowed="--decimal comma or --decimal point",
            remedy="say which with --decimal, or correct the cell",
        )
    if mark in found:
        line, text = found[mark]
        return mark, f"{text} in line {line}"
    return mark, "no decimal comma anywhere"


def figure(cell: str, mark: Mark) -> float:
    """The number in a cell.

    Raises
    ------
    ValueError
        It is none in this decimal mark; the message is the remedy.
    """
    if isinstance(cell, Figure):
        return _bounded(str(cell))
    text = cleaned(cell)
    thousands, decimal = (",", ".") if mark == "point" else (".", ",")
    whole, dot, rest = text.partition(decimal)
    if thousands in whole:
        if not _GROUPED[thousands].fullmatch(whole):
            raise ValueError(f"its decimal mark is not the {mark} of the other cells: correct it, or give --decimal")
        whole = whole.replace(thousands, "")
    text = whole + ("." if dot else "") + rest
    if not _PLAIN.fullmatch(text):
        raise ValueError(f"write digits with a decimal {mark}, without unit or text")
    return _bounded(text)


def _bounded(text: str) -> float:
    value = float(text)
    if not abs(value) < LARGEST_NUMBER:
        raise ValueError(f"the number is too large (below {LARGEST_NUMBER:.0e}): check its exponent")
    return value
