"""Figures that pages state, and the results files that they come from.

A comment above a paragraph, a list or a table names files of this tree: ``<!-- figures from: PATH [PATH ...] -->``.
Every figure of that block then occurs in one of them, rounded as the page has it; a per cent may be a fraction there.
Above a heading the comment holds for the whole section. The page itself as a file means its other tables, and what its
commands print (``<!-- shown -->``). ``<!-- figures asserted by: tests/... -->`` names a test that holds the figures
instead; ``<!-- figures printed -->`` says that the page's commands print them, which `test_page_commands.py` sees when
it runs them.

A figure is a number with a unit, a per cent, a number with decimals, and each number in a table's cell that begins with
one. Signs are not compared. Numbers in code, in headings and in names (``CalculiX 2.20``, ``section 3``) are none, nor
is the level of an interval.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from test_house import ROOT

FENCE = re.compile(r"^( *)(`{3,}|~{3,}).*?^ *\2", re.MULTILINE | re.DOTALL)
SHOWN = re.compile(r"^<!-- shown -->\n+```text\n(.*?)^```", re.MULTILINE | re.DOTALL)
COMMENT = re.compile(r"^ *<!-- .*? -->$")
MARK = re.compile(r"^ *<!-- figures (?:(from|asserted by): (.+?)|(printed)) -->$", re.MULTILINE)
LIST = re.compile(r" *(?:[-*]|\d+\.) ")
CODE = re.compile(r"`[^`]*`|\]\([^)]*\)|https?:\S+|doi:\S+")

SIGN = r"((?:\+-|[-+\u2212])?)"
GROUPED = r"\d{1,3}(?:[ ,]\d{3})+(?!\d)"
PLAIN = r"\d+(?:\.\d+)?(?:e[-+]?\d+)?"
NUMBER = re.compile(rf"(?<![\w.,/^+-]){SIGN}({GROUPED}|{PLAIN})(?![\w^]|[.,]\d)")
SIMPLE = r"(?:[munk]?m|[mu]?s|h|min|[kMG]B|kg|[mu]?rad|deg|k?N)"
UNIT = rf"(?:%|per cent\b|times\b|x\b(?! ?\d)|{SIMPLE}(?:[ /](?:k?N|mm?|rad))*(?![\w/]))"
# Numbers of one unit: "16 to 40 %", "5, 8 and 11 mm", "96.2 +- 0.4 %".
JOINED = r"(?:,| to| and| or| in place of| against| instead of| \+-|/) ?"
OTHERS = rf"(?={JOINED}(?:[-+\u2212]?\d[\d .,]*{JOINED})*[-+\u2212]?\d[\d.]* ?{UNIT})"
WITH_UNIT = re.compile(rf"{NUMBER.pattern}(?: ?{UNIT}|{OTHERS})")
DECIMAL = re.compile(rf"(?<![\w.,/^+-]){SIGN}(\d+\.\d+(?:e[-+]?\d+)?|\d+e-\d+)(?![\w^]|\.\d)")
NAMED = re.compile(rf"(?:\b[A-Z]\w+|\bsection|\beq\.) \d+(?:\.\d+)*(?![\d.]*\d| ?{UNIT})")
# The level of an interval is chosen, not measured.
LEVEL = re.compile(r"\b95 %(?= (?:exact |error )?(?:intervals?|bars?|set)\b)|(?<=interval, )95 %|(?<=exact, )95 %")
# A file that holds nearly every number proves nothing.
MOST_NUMBERS = 2500


@dataclass(frozen=True)
class Block:
    """A paragraph, list or table, and the mark that holds for it: its kind and what it names."""

    text: str
    line: int
    kind: str = ""
    named: tuple[str, ...] = ()

    @property
    def is_table(self) -> bool:
        return self.text.startswith("|")


def blanked(found: re.Match[str]) -> str:
    return "\n" * found[0].count("\n")


def blocks(text: str) -> list[Block]:
    """Blocks of a page, each with the mark above it or above the heading of its section."""
    out: list[Block] = []
    sections: list[tuple[int, tuple[str, tuple[str, ...]]]] = []
    waiting: tuple[str, tuple[str, ...]] | None = None
    lines, begin = [*FENCE.sub(blanked, text).splitlines(), ""], None
    for k, line in enumerate(lines):
        stops = not line.strip() or COMMENT.match(line) or line.startswith("#")
        if begin is None and not stops:
            begin = k
        if begin is not None and stops:
            body = "\n".join(lines[begin:k])
            mark = waiting or (sections[-1][1] if sections else ("", ()))
            last = out[-1] if out else None
            goes_on = last and waiting is None and LIST.match(body) and LIST.match(last.text)
            if goes_on and last:
                out[-1] = Block(f"{last.text}\n{body}", last.line, last.kind, last.named)
            else:
                out.append(Block(body, begin + 1, *mark))
            begin, waiting = None, None
        if found := MARK.match(line):
            waiting = (found[1] or found[3], tuple((found[2] or "").split()))
        elif line.startswith("#"):
            depth = len(line) - len(line.lstrip("#"))
            sections = [s for s in sections if s[0] < depth]
            if waiting is not None:
                sections.append((depth, waiting))
            waiting = None
    return out


@dataclass(frozen=True)
class Figure:
    """A number as a page has it, without its sign."""

    said: str
    is_percent: bool = False

    @property
    def value(self) -> float:
        return float(re.sub("[ ,]", "", self.said))

    @property
    def half(self) -> float:
        """Half of its last digit; zeros at the end of a number in thousands are no digits beyond the second."""
        mantissa, _, power = re.sub("[ ,]", "", self.said).partition("e")
        whole, _, decimals = mantissa.partition(".")
        zeros = 0 if decimals or len(whole) < 4 else min(len(whole) - len(whole.rstrip("0")), len(whole) - 2)
        return float(0.5 * 10.0 ** (zeros - len(decimals) + int(power or 0)))


def figures(block: Block) -> list[Figure]:
    """What of a block counts as a figure."""
    return [figure for _, some in rows(block) for figure in some]


def rows(block: Block) -> list[tuple[frozenset[str], list[Figure]]]:
    """Rows of a table, each with the cells that name it and its figures; of other blocks all in one."""
    if not block.is_table:
        return [(frozenset(), _of_words(re.sub(r"^ *\d+\. ", "", CODE.sub("", block.text), flags=re.MULTILINE)))]
    heads, _, *lines = [
        [plain(c).strip() for c in line.strip().strip("|").split("|")] for line in block.text.splitlines()
    ]
    out = []
    for cells in lines:
        names = frozenset(c for c in cells if c.strip("-") and not NUMBER.match(c))
        found = [
            f for k, (head, cell) in enumerate(zip(heads, cells, strict=False)) for f in _of_cell(head, cell, k == 0)
        ]
        out.append((names, found))
    return out


def plain(text: str) -> str:
    """Without the signs that make words bold or code."""
    return re.sub(r"[*`]", "", text)


def _of_words(text: str) -> list[Figure]:
    text = NAMED.sub("", LEVEL.sub("", " ".join(text.split())))
    out = {}
    for found in WITH_UNIT.finditer(text):
        unit = re.search(UNIT, text[found.end(2) :])
        out[found.start()] = Figure(found[2], bool(unit and unit[0] in ("%", "per cent")))
    for found in DECIMAL.finditer(text):
        out.setdefault(found.start(), Figure(found[2]))
    return [out[k] for k in sorted(out)]


def _of_cell(head: str, cell: str, is_first: bool) -> list[Figure]:
    """Of a cell that begins with a number all, unless it is a row's name; of other cells as in words."""
    if is_first and not re.fullmatch(rf"{NUMBER.pattern}(?: ?{UNIT})?", cell):
        return []
    if NUMBER.match(cell):
        return [Figure(n[2], "%" in head + cell) for n in NUMBER.finditer(cell)]
    return _of_words(cell)


def numbers(text: str) -> list[float]:
    """All numbers of a text, sorted by size."""
    found = {
        abs(float(re.sub(r"[ ,_]", "", m)))
        for m in re.findall(rf"(?<![\w.])(?:{GROUPED}|\d[\d_]*(?:\.\d+)?(?:e[-+]?\d+)?)", text)
    }
    return sorted(found)


@cache
def lines_of(path: Path) -> tuple[str, ...]:
    """Lines of a results file without remarks; of CSV the commas stand apart, so that none joins thousands.

    JSON is one line: its rows are not lines.
    """
    lines = path.read_text(encoding="utf-8").splitlines()
    kept = [plain(line) for line in lines if not line.startswith("# ")]
    if path.suffix == ".json":
        return (" ".join(kept),)
    return tuple(line.replace(",", ", ") if path.suffix == ".csv" else line for line in kept)


@cache
def numbers_of(lines: tuple[str, ...], names: frozenset[str] = frozenset()) -> tuple[float, ...]:
    """Numbers of the lines that have all the names of a table's row; of all, where no line has them."""
    named = [line for line in lines if all(name in line for name in names)] if names else []
    return tuple(numbers("\n".join(named or lines)))


def own(page: str, block: Block) -> tuple[str, ...]:
    """Lines of the other tables of a page, and of what it shows as printed."""
    tables = [b.text for b in blocks(page) if b.is_table and b.line != block.line]
    return tuple("\n".join([*tables, *SHOWN.findall(page)]).splitlines())


def occurs(figure: Figure, among: Iterable[float]) -> bool:
    """Whether one of the numbers, in order of size, is the figure when rounded."""
    known = list(among)
    for scale in (1.0, 100.0) if figure.is_percent else (1.0,):
        size, half = figure.value / scale, figure.half * (1 + 1e-9) / scale
        k = bisect_left(known, size - half)
        if k < len(known) and known[k] <= size + half:
            return True
    return False


def not_printed(page: str, said: str) -> list[str]:
    """Figures of blocks marked as printed that are not among what the commands print."""
    among = numbers(said)
    return [f.said for block in blocks(page) if block.kind == "printed" for f in figures(block) if not occurs(f, among)]


def missing(page: Path) -> dict[int, list[str]]:
    """Line of each marked block -> its figures that none of the named files has."""
    text, out = page.read_text(encoding="utf-8"), {}
    for block in blocks(text):
        if block.kind != "from":
            continue
        files = [own(text, block) if ROOT / name == page else lines_of(ROOT / name) for name in block.named]
        lost = [
            f.said
            for names, some in rows(block)
            for f in some
            if not any(occurs(f, numbers_of(lines, names)) for lines in files)
        ]
        if lost:
            out[block.line] = lost
    return out
