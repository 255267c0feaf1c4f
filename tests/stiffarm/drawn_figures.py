"""Every figure that is saved within a context: how small its letters are, and which labels of ticks lie on others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from colour_blind import alike
from figure_texts import texts
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

# Width of a page's content, and pixels of the page for an inch of a figure that fits into it.
PAGE_PX, PX_PER_INCH = 1080.0, 108.0
# Labels may touch by so many dots.
TOUCH = 1.0


@dataclass
class Drawn:
    """A saved figure: its title, size of its smallest letters as a page shows them (px), labels that overlap.

    ``alike``: series that only a hue tells apart.
    """

    title: str
    smallest_px: float
    overlaps: list[str] = field(default_factory=list)
    alike: list[str] = field(default_factory=list)


@contextmanager
def recorded() -> Iterator[list[Drawn]]:
    """Look at each figure before it is saved."""
    found: list[Drawn] = []
    original = Figure.savefig

    def savefig(self: Figure, *args: Any, **kwargs: Any) -> None:
        found.append(looked_at(self))
        original(self, *args, **kwargs)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", savefig)
        yield found


def looked_at(figure: Figure) -> Drawn:
    """What a reader would see of it."""
    seen = texts(figure, may_be_none=True)
    inches = float(figure.get_size_inches()[0])
    scale = min(PX_PER_INCH, PAGE_PX / inches) / 72.0
    title = figure.get_suptitle() or next((ax.get_title(loc="left") for ax in figure.axes), "")
    return Drawn(title, min((one.size for one in seen), default=np.inf) * scale, overlaps(figure), alike(figure))


def overlaps(figure: Figure) -> list[str]:
    """Pairs of labels along one axis that lie on one another."""
    out = []
    for ax in figure.axes:
        if ax.name == "3d" or not ax.get_visible():
            continue
        for axis in (ax.xaxis, ax.yaxis):
            out += _along(axis)
    return out


def _along(axis: Axis) -> list[str]:
    low, high = sorted(axis.get_view_interval())
    room = 1e-9 * (high - low)
    labels = [
        tick.label1
        for tick in axis.get_major_ticks()
        if tick.label1.get_visible() and tick.label1.get_text() and low - room <= tick.get_loc() <= high + room
    ]
    # Slanted labels have boxes that lie on one another though they do not.
    boxes = [(one.get_text(), one.get_window_extent()) for one in labels if one.get_rotation() % 90 == 0]
    place = 0 if axis.axis_name == "x" else 1
    boxes.sort(key=lambda one: one[1].p0[place])
    return [f"{a} | {b}" for (a, one), (b, other) in pairwise(boxes) if _shared(one, other)]


def _shared(one: Bbox, other: Bbox) -> bool:
    both = Bbox.intersection(one, other)
    return both is not None and bool(both.width > TOUCH and both.height > TOUCH)


def faults(figures: Sequence[Drawn], least_px: float = 11.0) -> list[str]:
    """What is wrong with them, in words."""
    small = [f"{f.title}: letters of {f.smallest_px:.1f} px" for f in figures if f.smallest_px < least_px]
    pairs = [f"{f.title}: {pair}" for f in figures for pair in f.overlaps]
    return small + pairs + [f"{f.title}: told apart by hue alone: {pair}" for f in figures for pair in f.alike]
