"""Figures as pictures that a notebook shows and a script saves."""

from __future__ import annotations

import io

from matplotlib.figure import Figure

from stiffarm.face.arms import Picture
from stiffarm.pages import style


def picture_of(figure: Figure) -> Picture:
    """The figure as PNG, as the reports have it."""
    buffer = io.BytesIO()
    with style.house_style():
        figure.savefig(buffer, format="png", dpi=style.DPI)
    return Picture(buffer.getvalue())
