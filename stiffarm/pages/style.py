"""How every picture looks: fonts, sizes, colours that colour-blind readers can tell apart; PNG output."""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, Literal

import matplotlib as mpl
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Colormap, LinearSegmentedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from robots import InputError, require_one_of
from robots.arrays import Array
from robots.files.written import written_whole
from stiffarm.pages.band import banded, in_the_file
from stiffarm.pages.numbers import typeset, typeset_cell
from stiffarm.pages.report import SCENE

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

_STYLE: Final[dict[Any, Any]] = {
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
    "axes.prop_cycle": cycler(color=[c for name, c in OKABE_ITO.items() if name != "yellow"]),
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
    # Titles, names and labels come from files: a "$" in them is a dollar. Every text of a figure is made
    # within this style, so this is the one place where mathtext is kept out.
    "text.parse_math": False,
}


def stretch_of(known: str, low: float, high: float) -> Colormap:
    """A colour map that is this stretch, 0 to 1, of one that matplotlib knows."""
    return LinearSegmentedColormap.from_list(known, mpl.colormaps[known](np.linspace(low, high, 256)), N=256)


# Plasma rises in lightness all the way, from a cold dark blue (soft) to a warm bright yellow (stiff), so the order
# survives deuteranopia, protanopia and a grey print. Its last yellows are left out: they vanish on white paper.
STIFFNESS_COLOURS: Final = stretch_of("plasma", 0.0, 0.93)
"""Colour map of stiffness: warm and bright is stiff, cold and dark is soft."""


@contextmanager
def house_style() -> Iterator[None]:
    """Within it, matplotlib draws in this project's style (needed around late legends and texts)."""
    with mpl.rc_context(_STYLE):
        yield


def new_figure(
    size: str | tuple[float, float] = "single", rows: int = 1, cols: int = 1, **subplots: Any
) -> tuple[Figure, list[Axes]]:
    """Make a figure with its axes in this project's style, without any pyplot state.

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
        require_one_of("figure size", size, SIZES_IN, code="B002")
        size = SIZES_IN[size]
    with house_style():
        figure = Figure(figsize=size, dpi=DPI, layout="constrained" if rows > 0 else None)
        FigureCanvasAgg(figure)
        if rows == 0:
            return figure, []
        axes = figure.subplots(rows, cols, squeeze=False, **subplots)
        for ax in axes.ravel():
            for axis in (ax.xaxis, ax.yaxis):
                if axis.get_scale() == "linear":
                    axis.set_major_formatter(HouseTicks())
    return figure, list(axes.ravel())


class HouseTicks(ScalarFormatter):
    """Numbers along a linear axis, written as everywhere: in groups of three, and a common power as one."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        """The label of a tick."""
        return typeset_cell(super().__call__(x, pos))

    def get_offset(self) -> str:
        """The power that all labels have in common."""
        return typeset(super().get_offset())


def save_png(figure: Figure, path: Path) -> None:
    """Write a figure as PNG at ``DPI``, whole or not at all; its numbers are written as those of the pages.

    Where there is something to warn of, a band above it does.

    Raises
    ------
    InputError
        The folder does not exist.
    """
    require_folder(path)
    for text in figure.findobj(Text):
        assert isinstance(text, Text)  # noqa: S101 - found by its type
        text.set_text(typeset(text.get_text()))
    with written_whole(path) as draft, house_style(), banded(figure) as shape:
        shown = {"Holds": SCENE} if any(figure.findobj(AxesImage)) else {}
        figure.savefig(draft, format="png", dpi=DPI, metadata={**in_the_file(), **shown}, **shape)


def require_folder(path: Path) -> None:
    """Raise InputError unless the folder that a picture shall go to exists."""
    if not path.parent.is_dir():
        raise InputError("picture folder", code="F008", value=str(path.parent), allowed="an existing folder")


@dataclass(frozen=True)
class Camera:
    """Parallel projection; ``towards`` points from the scene to the eye, z stays upright."""

    towards: Array

    @property
    def axes(self) -> Array:
        """Rows: right, up, towards the eye."""
        towards = self.towards / np.linalg.norm(self.towards)
        right = np.cross([0.0, 0.0, 1.0], towards)
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(towards, right), towards])

    def __call__(self, points: Array) -> Array:
        """Project (..., 3) to right, up and nearness."""
        return np.asarray(points @ self.axes.T)


def headings(figure: Figure, title: str, subtitle: str) -> None:
    """Write a title and a line of facts at the top left, broken where they are too long."""
    heading, lines = textwrap.fill(title, 85), textwrap.fill(subtitle, 125)
    figure.text(0.03, 0.975, heading, size=15, weight="bold", va="top")
    figure.text(0.03, 0.975 - 0.032 * (1 + heading.count("\n")), lines, size=10, color="#555555", va="top")


# Stiffness over a workspace is skewed: on a linear scale most of a map would be dark.
_LOG_FROM_RATIO = 4.0


def colour_scale(values: Array, colour_range: tuple[float, float] | None) -> tuple[Normalize, Array]:
    """Scale and ticks of a colour bar; its ends are the given range or the 2nd and 98th percentile.

    The scale is logarithmic where the ends differ by more than a factor of four.

    Raises
    ------
    InputError
        The range is not two ascending finite numbers.
    """
    low, high = np.percentile(values, [2.0, 98.0]) if colour_range is None else colour_range
    if not (np.isfinite([low, high]).all() and low < high) and colour_range is not None:
        raise InputError("colour range (N/mm)", code="B002", value=str(colour_range), allowed="two ascending numbers")
    if high - low < 1e-6 * high:
        low, high = 0.95 * low, 1.05 * high
    if low > 0.0 and high / low > _LOG_FROM_RATIO:
        ticks = _log_ticks(low, high, exact=colour_range is not None)
        return LogNorm(ticks[0], ticks[-1]), ticks
    ticks = _linear_ticks(low, high, exact=colour_range is not None)
    return Normalize(ticks[0], ticks[-1]), ticks


def _linear_ticks(low: float, high: float, *, exact: bool) -> Array:
    inner = np.asarray(MaxNLocator(nbins=7, steps=[1, 2, 5, 10]).tick_values(low, high), dtype=np.float64)
    step = float(inner[1] - inner[0])
    if not exact:
        low, high = np.floor(5.0 * low / step) * step / 5.0, np.ceil(5.0 * high / step) * step / 5.0
    # Ends keep their labels; a tick too near to one would run into it.
    inner = inner[(inner > low + 0.35 * step) & (inner < high - 0.35 * step)]
    return np.array([low, *inner, high])


def _log_ticks(low: float, high: float, *, exact: bool) -> Array:
    if not exact:
        digits = 10.0 ** np.floor(np.log10([low, high]))
        low, high = np.floor(low / digits[0]) * digits[0], np.ceil(high / digits[1]) * digits[1]
    decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1.0)
    steps = (1.0, 2.0, 3.0, 5.0, 7.0) if high / low < 100.0 else (1.0, 2.0, 5.0)
    inner = np.sort(np.outer(decades, steps).ravel())
    # 1.15: closer than that, two labels would touch.
    inner = inner[(inner > 1.15 * low) & (inner < high / 1.15)]
    return np.array([low, *inner, high])


Extend = Literal["neither", "min", "max", "both"]


def ends_cut(values: Array, ticks: Array) -> Extend:
    """Which ends of a scale, from the first tick to the last, cut values (n,) off."""
    below, above = bool((values < ticks[0]).any()), bool((values > ticks[-1]).any())
    if below:
        return "both" if above else "min"
    return "max" if above else "neither"


def colour_bar(
    figure: Figure, colours: Colormap, norm: Normalize, ticks: Array, extend: Extend, place: Mapping[str, Any]
) -> Colorbar:
    """A colour bar without a label; ends that cut values off say so ("≥ 700"). ``place``: ``cax``, or ``ax`` and more.

    Beside a picture in the picture plane it stands at :func:`beside_picture`.
    """
    bar = figure.colorbar(ScalarMappable(norm, colours), extend=extend, ticks=ticks, **place)
    labels = [f"{t:.6g}".replace("-", "−") for t in ticks]
    labels[0] = "≤ " * (extend in ("min", "both")) + labels[0]
    labels[-1] = "≥ " * (extend in ("max", "both")) + labels[-1]
    bar.ax.minorticks_off()
    bar.ax.set_yticklabels(labels)
    bar.outline.set_linewidth(0.6)
    return bar


def beside_picture(figure: Figure) -> Axes:
    """Axes at the right of a picture, for a colour bar."""
    return figure.add_axes((0.872, 0.20, 0.022, 0.56))


def box_ticks(points: Array) -> list[Array]:
    """Ticks along x, y, z with one round step for all; the outer ones bound the points (n, 3)."""
    low, high = points.min(axis=0), points.max(axis=0)
    nice = MaxNLocator(nbins=7, steps=[1, 2, 5, 10]).tick_values(0.0, float((high - low).max()))
    step = float(nice[1] - nice[0])
    first = np.floor(low / step)
    last = np.maximum(np.ceil(high / step), first + 1.0)
    return [np.arange(a, b + 0.5) * step for a, b in zip(first, last, strict=True)]


def window(middle: Array, half: Array, size: Array) -> tuple[float, float, float, float]:
    """The piece (u0, u1, v0, v1) of a plane about ``middle`` that holds ``half`` to each side.

    All (2,), across and up; ``size`` says what shape the piece has.
    """
    half = np.maximum(half, half[::-1] * size / size[::-1])
    (u0, v0), (u1, v1) = middle - half, middle + half
    return float(u0), float(u1), float(v0), float(v1)


def frame_axes(figure: Figure, camera: Camera, ticks: Sequence[Array], *, flat: bool) -> Axes:
    """Add axes of the picture plane in mm that hold the box spanned by ``ticks`` (along x, y, z).

    ``flat`` is for a view along Y: ordinary ticks along X and Z; otherwise the box is drawn in space.
    """
    axes = figure.add_axes((0.075, 0.075, 0.755, 0.80) if flat else (0.01, 0.015, 0.83, 0.87))
    corners = np.array(list(itertools.product(*[t[[0, -1]] for t in ticks])))
    outer = camera(corners)[:, :2]
    low, high = outer.min(axis=0), outer.max(axis=0)
    pad = (high - low) * (np.array([0.02, 0.02]) if flat else np.array([0.055, 0.05]))
    size = figure.get_size_inches() * [axes.get_position().width, axes.get_position().height]
    u0, u1, v0, v1 = window(0.5 * (low + high), 0.5 * (high - low) + pad, size)
    axes.set(xlim=(u0, u1), ylim=(v0, v1), autoscale_on=False)
    if flat:
        axes.set(xlabel="X (mm)", ylabel="Z (mm)")
        axes.locator_params(nbins=9, steps=[1, 2, 5, 10])
        axes.axhline(0.0, color=FAINT, linewidth=1.2, zorder=0.9)
    else:
        axes.set_axis_off()
        _draw_box(axes, camera, ticks)
    return axes


def _draw_box(axes: Axes, camera: Camera, ticks: Sequence[Array]) -> None:
    """Floor and the two far walls as grids, ticks at the near edges, for an eye at +x, -y, +z."""
    (x0, x1), (y0, y1), (z0, z1) = (t[[0, -1]] for t in ticks)
    lines = [[(x, y0, z0), (x, y1, z0), (x, y1, z1)] for x in ticks[0]]
    lines += [[(x1, y, z0), (x0, y, z0), (x0, y, z1)] for y in ticks[1]]
    lines += [[(x0, y0, z), (x0, y1, z), (x1, y1, z)] for z in ticks[2]]
    flat = [camera(np.array(line))[:, :2] for line in lines]
    axes.add_collection(LineCollection(flat, colors="#DDE0E4", linewidths=0.7, zorder=0.5), autolim=False)
    edges = [[(x0, y0, z1), (x0, y0, z0), (x1, y0, z0), (x1, y1, z0)]]
    flat = [camera(np.array(edge))[:, :2] for edge in edges]
    axes.add_collection(LineCollection(flat, colors="#8A9097", linewidths=0.9, zorder=0.6), autolim=False)
    size = max(x1 - x0, z1 - z0)
    edges_of = (
        ("X (mm)", ticks[0], [(x, y0, z0) for x in ticks[0]], (-0.25, -1.0), "center"),
        ("Y (mm)", ticks[1], [(x1, y, z0) for y in ticks[1]], (0.7, -0.2), "left"),
        ("Z (mm)", ticks[2], [(x0, y0, z) for z in ticks[2]], (-0.5, 0.0), "right"),
    )
    for name, numbers, places, outward, side in edges_of:
        out = 0.022 * size * np.array(outward)
        spots = camera(np.array(places))[:, :2]
        for number, spot in zip(numbers, spots + 1.5 * out, strict=True):
            label = f"{number:g}".replace("-", "−")
            axes.text(spot[0], spot[1], label, ha=side, va="center", size=9, color="#444444")
        along = spots[-1] - spots[0]
        turn = float(np.degrees(np.arctan2(along[1], along[0])))
        spot = spots[[0, -1]].mean(axis=0) + {"center": 4.4, "left": 7.5, "right": 11.0}[side] * out
        axes.text(spot[0], spot[1], name, ha="center", va="center", size=10, rotation=turn)
