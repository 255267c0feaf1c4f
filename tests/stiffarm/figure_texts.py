"""What is written on a figure once it is drawn."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox


@dataclass(frozen=True)
class Seen:
    """A text as it was drawn."""

    text: str
    box: Bbox
    size: float
    rotation: float


def texts(figure: Figure, *, may_be_none: bool = False) -> list[Seen]:
    """Draw a figure and return what is written on it (its artists also know texts that are never drawn)."""
    seen = []
    original = Text.draw

    def draw(self: Text, renderer: object, *args: object, **kwargs: object) -> None:
        if self.get_visible() and self.get_text().strip():
            seen.append(Seen(self.get_text(), self.get_window_extent(), self.get_fontsize(), self.get_rotation()))
        original(self, renderer, *args, **kwargs)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Text, "draw", draw)
        figure.canvas.draw()
    assert seen or may_be_none
    return seen


@contextmanager
def drawn_meanwhile() -> Iterator[list[str]]:
    """All texts that are drawn, on whatever figure, until the context ends."""
    seen: list[str] = []
    original = Text.draw

    def draw(self: Text, renderer: object, *args: object, **kwargs: object) -> None:
        if self.get_visible() and self.get_text().strip():
            seen.append(self.get_text())
        original(self, renderer, *args, **kwargs)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Text, "draw", draw)
        yield seen
