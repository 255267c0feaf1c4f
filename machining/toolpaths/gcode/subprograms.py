"""Subprograms that stand in the file of their call: ``O100`` ... ``M99``, called by ``M98 P100 L3``."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

_HEAD = re.compile(r"^\s*(?:O|:)\s*(\d+)\s*(?:\([^)]*\)\s*)?$", re.I)
_END = re.compile(r"\bM0*(99|30|2)\b(?!\.)", re.I)
_COMMENT = re.compile(r"\([^()]*\)|;.*")
CALL = re.compile(rb"M0*98\b", re.I)
# Calls within calls; Fanuc's controls have four to ten.
DEEPEST = 10


@dataclass(frozen=True)
class Subprogram:
    """Blocks behind ``O`` up to that with ``M99``, with their line numbers; ``lines``: from ``O`` to ``M99``."""

    blocks: tuple[tuple[int, str], ...]
    lines: range


def subprograms(source: Iterable[str]) -> dict[int, Subprogram]:
    """Subprograms of a file, by number: what begins with ``O`` and ends with ``M99``."""
    out: dict[int, Subprogram] = {}
    name, first, blocks = -1, 0, list[tuple[int, str]]()
    for number, raw in enumerate(source, start=1):
        if head := _HEAD.match(raw.rstrip()):
            name, first, blocks = int(head[1]), number, []
            continue
        blocks.append((number, raw))
        if end := _END.search(_COMMENT.sub(" ", raw)):
            if end[1] == "99" and name >= 0:
                out.setdefault(name, Subprogram(tuple(blocks), range(first, number + 1)))
            name, blocks = -1, []
    return out


def called(words: dict[str, float]) -> tuple[int, int]:
    """Number and repeats of a call by its words P and L; Fanuc also writes P0030100 for three times 100."""
    number = int(words.get("P", -1.0))
    if number > 9999 and "L" not in words:
        return number % 10_000, number // 10_000
    return number, int(words.get("L", 1.0))
