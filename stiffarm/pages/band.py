"""The band across a picture of a model that is not calibrated: drawn above the figure, which stays as it is."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.transforms import Bbox

from stiffarm.session.caution import caution

GROUND: Final = "#FFE9C2"
EDGE: Final = "#B8400A"
_TEXT: Final = "#3D2500"
# Size of type, and the height of a line and the width of a letter in it, inches.
_SIZE: Final = 9.5
_LINE: Final = 1.35 * _SIZE / 72.0
_LETTER: Final = 0.56 * _SIZE / 72.0
_PAD: Final = 0.07
_BAR: Final = 0.09


@contextmanager
def banded(figure: Figure) -> Iterator[dict[str, Any]]:
    """Draw the band for as long as the context lasts; gives what ``savefig`` needs to show it, nothing without one.

    The band lies above the figure's own area, so that no layout has to make room for it, and a figure that is saved
    twice has it once each time.
    """
    text = caution()
    if not text:
        yield {}
        return
    width, height = figure.get_size_inches()
    lines = textwrap.wrap(text, max(20, int((width - _BAR - 3.0 * _PAD) / _LETTER)))
    room = len(lines) * _LINE + 2.0 * _PAD
    whole: dict[str, Any] = {"transform": figure.transFigure, "linewidth": 0.0, "clip_on": False, "in_layout": False}
    top = (height + room) / height
    drawn: list[Any] = [
        Rectangle((0.0, 1.0), 1.0, top - 1.0, facecolor=GROUND, **whole),
        Rectangle((0.0, 1.0), _BAR / width, top - 1.0, facecolor=EDGE, **whole),
    ]
    for patch in drawn:
        figure.add_artist(patch)
    left, middle = (_BAR + 1.5 * _PAD) / width, 0.5 * (1.0 + top)
    look: dict[str, Any] = {"size": _SIZE, "weight": "bold", "color": _TEXT, "va": "center", "parse_math": False}
    words = figure.text(left, middle, "\n".join(lines), linespacing=1.2, **look)
    words.set_in_layout(False)
    try:
        yield {"bbox_inches": Bbox([[0.0, 0.0], [width, height + room]])}
    finally:
        for artist in (*drawn, words):
            artist.remove()


def in_the_file() -> dict[str, str]:
    """The same as text in a PNG's own table, for programs."""
    return {"Warning": caution()} if caution() else {}
