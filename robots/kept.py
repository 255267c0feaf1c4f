"""Figures that depend on one immutable object alone, a robot or a model, worked out once for each."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from functools import wraps
from typing import TypeVar

Owner = TypeVar("Owner")
Figure = TypeVar("Figure")


def once_for_each(figure: Callable[[Owner], Figure]) -> Callable[[Owner], Figure]:
    """Keep what ``figure`` gives for as long as its owner lives, which must be immutable; errors are not kept.

    A single target of the inverse kinematics takes a fifth of the time that its robot's figures take to work out.
    """
    kept: dict[int, tuple[weakref.ref[Owner], Figure]] = {}

    @wraps(figure)
    def looked_up(owner: Owner) -> Figure:
        key = id(owner)
        found = kept.get(key)
        if found is not None and found[0]() is owner:
            return found[1]
        value = figure(owner)

        def forget(gone: weakref.ref[Owner]) -> None:
            # Another owner may have taken the place in memory.
            if key in kept and kept[key][0] is gone:
                del kept[key]

        kept[key] = (weakref.ref(owner, forget), value)
        return value

    return looked_up
