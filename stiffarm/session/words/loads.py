"""Loads of readings in words."""

from __future__ import annotations

from collections.abc import Sequence

# More are said by the least and the largest.
SHOWN = 8


def loads_words(levels_N: Sequence[float]) -> str:
    """``150, 375, 650 N``, or ``115 to 1170 N`` of many; loads each once, rising."""
    if len(levels_N) > SHOWN:
        return f"{levels_N[0]:g} to {levels_N[-1]:g} N"
    return f"{', '.join(f'{v:g}' for v in levels_N)} N"
