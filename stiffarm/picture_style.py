"""How every picture looks: fonts, sizes, colours that colour-blind readers can tell apart; PNG output."""

from __future__ import annotations

import base64
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Colormap, LinearSegmentedColormap
from matplotlib.figure import Figure

from robots import InputError

# Okabe and Ito, "Color Universal Design" (2008): eight colours that the common kinds of colour
# blindness keep apart.
OKABE_ITO: Final = MappingProxyType(
    {
        "blue": "#0072B2",
        "vermillion": "#D55E00",
        "green": "#009E73",
        "orange": "#E69F00",
        "sky": "#56B4E9",
        "purple": "#CC79A7",
        "yellow": "#F0E442",
        "black": "#000000",
    }
)
INK: Final = "#222222"
FAINT: Final = "#B8BCC2"

DPI: Final = 150
SIZES_IN: Final = MappingProxyType(
    {"single": (6.4, 4.4), "wide": (10.0, 4.4), "tall": (6.4, 8.0), "picture": (1600 / DPI, 1200 / DPI)}
)
"""Figure sizes in inches by use; at ``DPI`` the last one is 1600 x 1200 pixels."""

_STYLE: Final[dict[str, Any]] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 10.0,
    "axes.titlesize": 11.0,
    "axes.labelsize": 10.0,
    "axes.edgecolor": "#666666",
    "axes.labelcolor": INK,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.prop_cycle": mpl.cycler(color=[c for name, c in OKABE_ITO.items() if name != "yellow"]),
    "grid.color": "#E3E5E8",
    "grid.linewidth": 0.7,
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "xtick.labelsize": 9.0,
    "ytick.labelsize": 9.0,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "lines.linewidth": 1.8,
    "text.color": INK,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}


def _stiffness_colours() -> Colormap:
    # Plasma rises in lightness all the way, from a cold dark blue (soft) to a warm bright yellow
    # (stiff), so the order survives deuteranopia, protanopia and a grey print. Its last yellows are
    # left out: they vanish on white paper.
    colours = mpl.colormaps["plasma"](np.linspace(0.0, 0.93, 256))
    return LinearSegmentedColormap.from_list("stiffness", [tuple(c) for c in colours], N=256)


STIFFNESS_COLOURS: Final = _stiffness_colours()
"""Colour map of stiffness: warm and bright is stiff, cold and dark is soft."""


@contextmanager
def house_style() -> Iterator[None]:
    """Within it, matplotlib draws in this project's style (needed around late legends and texts)."""
    with mpl.rc_context(_STYLE):
        yield


def new_figure(
    size: str | tuple[float, float] = "single", rows: int = 1, cols: int = 1, **subplots: Any
) -> tuple[Figure, list[Axes]]:
    """A figure with its axes in this project's style, without any pyplot state.

    Parameters
    ----------
    size : a name of ``SIZES_IN`` or (width, height) in inches
    rows, cols : grid of axes; with ``rows = 0`` the figure is empty and has no layout engine
    subplots : further arguments of ``Figure.subplots`` (``sharex`` ...)

    Returns
    -------
    figure, and its axes row by row
    """
    if isinstance(size, str):
        if size not in SIZES_IN:
            raise InputError("figure size", value=size, allowed=", ".join(SIZES_IN))
        size = SIZES_IN[size]
    with house_style():
        figure = Figure(figsize=size, dpi=DPI, layout="constrained" if rows > 0 else None)
        FigureCanvasAgg(figure)
        if rows == 0:
            return figure, []
        axes = figure.subplots(rows, cols, squeeze=False, **subplots)
    return figure, list(axes.ravel())


def save_png(figure: Figure, path: Path) -> None:
    """Write a figure as PNG at ``DPI`` under a temporary name, then rename.

    Raises
    ------
    InputError
        The folder does not exist.
    """
    if not path.parent.is_dir():
        raise InputError("picture folder", value=str(path.parent), allowed="an existing folder")
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with house_style():
            figure.savefig(temporary, format="png", dpi=DPI)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def png_base64(path: Path) -> str:
    """A picture's bytes as base64 text, for ``src="data:image/png;base64,..."`` in a report."""
    return base64.b64encode(path.read_bytes()).decode("ascii")
