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
from collections.abc import Iterable, Iterator
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
    text = CODE.sub("", block.text)
    if block.is_table:
        return list(_of_cells(text))
    return _of_words(re.sub(r"^ *\d+\. ", "", text, flags=re.MULTILINE))


def _of_words(text: str) -> list[Figure]:
    text = NAMED.sub("", LEVEL.sub("", " ".join(text.split())))
    out = {}
    for found in WITH_UNIT.finditer(text):
        unit = re.search(UNIT, text[found.end(2) :])
        out[found.start()] = Figure(found[2], bool(unit and unit[0] in ("%", "per cent")))
    for found in DECIMAL.finditer(text):
        out.setdefault(found.start(), Figure(found[2]))
    return [out[k] for k in sorted(out)]


def _of_cells(table: str) -> Iterator[Figure]:
    """Of a cell that begins with a number all, unless it is a row's name; of other cells as in words."""
    heads, _, *rows = [[cell.strip(" *") for cell in line.strip().strip("|").split("|")] for line in table.splitlines()]
    for row in rows:
        for head, cell in zip(heads, row, strict=False):
            if cell is row[0] and not re.fullmatch(rf"{NUMBER.pattern}(?: ?{UNIT})?", cell):
                continue
            if NUMBER.match(cell):
                yield from (Figure(n[2], "%" in head + cell) for n in NUMBER.finditer(cell))
            else:
                yield from _of_words(cell)


def numbers(text: str) -> list[float]:
    """All numbers of a text, sorted by size; lines that begin with # are remarks."""
    kept = "\n".join(line for line in text.splitlines() if not re.match(r"# ", line))
    found = {
        abs(float(re.sub(r"[ ,_]", "", m)))
        for m in re.findall(rf"(?<![\w.])(?:{GROUPED}|\d[\d_]*(?:\.\d+)?(?:e[-+]?\d+)?)", kept)
    }
    return sorted(found)


@cache
def numbers_of(path: Path) -> tuple[float, ...]:
    return tuple(numbers(path.read_text(encoding="utf-8")))


def own(page: str, block: Block) -> list[float]:
    """Numbers of the other tables of a page, and of what it shows as printed."""
    tables = [b.text for b in blocks(page) if b.is_table and b.line != block.line]
    return numbers("\n".join([*tables, *SHOWN.findall(page)]))


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
        pools: list[Iterable[float]] = []
        for name in block.named:
            path = ROOT / name
            pools.append(own(text, block) if path == page else numbers_of(path))
        if lost := [f.said for f in figures(block) if not any(occurs(f, pool) for pool in pools)]:
            out[block.line] = lost
    return out
