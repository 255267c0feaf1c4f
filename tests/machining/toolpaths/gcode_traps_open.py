"""Traps that this state of the readers falls into; empty where all are mended."""

from __future__ import annotations

OPEN: frozenset[str] = frozenset()
# Dialects of random programs that are read wrong.
RANDOM: frozenset[str] = frozenset()
