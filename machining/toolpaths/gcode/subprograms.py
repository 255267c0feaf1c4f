"""Subprograms that stand in the file of their call: ``O100`` ... ``M99`` by ``M98 P100 L3``, ``L100 P3`` of Siemens."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

_HEAD = re.compile(r"^\s*(?:O|:)\s*(\d+)\s*(?:\([^)]*\)\s*)?$", re.I)
# Siemens keeps several programs in one file behind such lines, or begins one with PROC.
_NAME = re.compile(r"^\s*(?:%_N_([A-Z_][A-Z0-9_]*)_(SPF|MPF)|(?:N\d+\s*)?PROC\s+([A-Z_][A-Z0-9_]*))\s*(?:;.*)?$", re.I)
_END = re.compile(r"\b(?:M0*(99|30|17|2)\b(?!\.)|(RET)\b)", re.I)
_COMMENT = re.compile(r"\([^()]*\)|;.*")
CALL = re.compile(rb"M0*98\b|M0*99\b|M0*17\b|\bRET\b|_SPF\b", re.I)
# Calls within calls; Fanuc's controls have four to ten.
DEEPEST = 10


@dataclass(frozen=True)
class Subprogram:
    """Blocks behind ``O`` up to that with ``M99``, with their line numbers; ``lines``: from ``O`` to ``M99``."""

    blocks: tuple[tuple[int, str], ...]
    lines: range


def subprograms(source: Iterable[str]) -> dict[str, Subprogram]:
    """Subprograms of a file by name: ``O100`` up to M99; ``%_N_NAME_SPF`` or ``PROC NAME`` up to M17, M2 or RET.

    What a file begins with is its main program where it has no ``%_N_NAME_MPF``, and where it is not ``O100`` to M99.
    """
    out: dict[str, Subprogram] = {}
    name, first, blocks = "", 0, list[tuple[int, str]]()
    main = ""
    for number, raw in enumerate(source, start=1):
        text = raw.rstrip()
        if head := _HEAD.match(text):
            name, first, blocks = f"O{int(head[1])}", number, []
        elif named := _NAME.match(text):
            own = (named[1] or named[3]).upper()
            begins = not main and not out and not any(block.strip() for _, block in blocks)
            if begins or (named[2] or "").upper() == "MPF":
                main, own = own, ""
            if own != name or not own:
                name, first, blocks = own, number, []
        else:
            blocks.append((number, raw))
            if end := _END.search(_COMMENT.sub(" ", raw)):
                counted = name[:1] == "O" and name[1:].isdigit()
                if name and ((end[1] == "99") if counted else (end[1] not in ("99", "30"))):
                    out.setdefault(name, Subprogram(tuple(blocks), range(first, number + 1)))
                name, blocks = "", []
    return out


def called(words: dict[str, float]) -> tuple[int, int]:
    """Number and repeats of a call by its words P and L; Fanuc also writes P0030100 for three times 100."""
    number = int(words.get("P", -1.0))
    if number > 9999 and "L" not in words:
        return number % 10_000, number // 10_000
    return number, int(words.get("L", 1.0))
