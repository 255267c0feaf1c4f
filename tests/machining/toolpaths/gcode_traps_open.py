"""Traps that this state of the readers falls into; empty where all are mended."""

from __future__ import annotations

OPEN: frozenset[str] = frozenset(
    {
        "h: RND F",
        "h: block FUNCTION TCPM F TCP ZZ",
        "h: two presets",
        "h: word PR+5",
        "h: word R5",
    }
)
