"""What the figures have in common: paper, colours and markers of series, notes, legends, titles, axes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from robots.arrays import Array
from stiffarm.pages.style import OKABE_ITO, house_style, new_figure

SERIES: Final = tuple(OKABE_ITO[c] for c in ("blue", "vermillion", "green", "purple", "orange", "sky"))
MARKERS: Final = "osD^vP"
# As many kinds of lines as colours: no two series differ by hue alone.
LINES: Final[tuple[Any, ...]] = (
    "-",
    (0, (5, 1.5)),
    (0, (1, 1)),
    (0, (6, 1.5, 1, 1.5)),
    (0, (2.5, 1)),
    (0, (6, 1, 1, 1, 1, 1)),
)
# Values after a jump by more than this factor leave a linear axis; their number is written instead.
_JUMP = 3.0
_RAISED: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# More names than this do not fit below an axis; from this many characters on they stand upright.
_MOST_NAMES, _NAMES_UPRIGHT = 28, 100


@contextmanager
def drawing(
    heading: str, size: str | tuple[float, float], rows: int = 1, cols: int = 1, **subplots: Any
) -> Iterator[tuple[Figure, list[Axes]]]:
    """A figure of ``size`` (a name, or inches) with its title and its axes, row by row; within, the house style holds.

    ``subplots``: further arguments of ``Figure.subplots``.
    """
    with house_style():
        figure, axes = new_figure(size, rows, cols, **subplots)
        if heading:
            title(figure, heading)
        yield figure, axes


@contextmanager
def panels(
    heading: str, count: int, columns: int, width: float, height: float, room: float, **subplots: Any
) -> Iterator[tuple[Figure, list[Axes]]]:
    """A figure of ``count`` like panels in so many columns at most; each is ``height`` inches high.

    ``room``: height in inches of what stands around them.
    """
    columns = min(count, columns)
    rows = -(-count // columns)
    with drawing(heading, (width, room + height * rows), rows, columns, **subplots) as (figure, axes):
        for empty in axes[count:]:
            empty.set_axis_off()
        yield figure, axes[:count]


def named_rows(ax: Axes, names: Sequence[str], **look: Any) -> None:
    """Name the rows 0, 1, ... of a chart of lying bars or intervals, the first at the top."""
    ax.set_yticks(range(len(names)), names, **look)
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.tick_params(axis="y", length=0)
    ax.grid(visible=False, axis="y")


def named_columns(ax: Axes, names: Sequence[str], part: int = 1) -> None:
    """Name the columns 0, 1, ... of a chart; of many names only some are written, of long ones upright.

    ``part``: how many charts share the page's width.
    """
    shown = range(0, len(names), -(-len(names) // _MOST_NAMES))
    upright = sum(len(names[k]) + 1 for k in shown) > _NAMES_UPRIGHT // part
    ax.set_xticks(list(shown), [names[k] for k in shown], rotation=90 if upright else 0)
    ax.set_xlim(-0.6, len(names) - 0.4)
    ax.grid(visible=False, axis="x")


def joint_colour(name: str, position: int = 0) -> str:
    """Return one colour for a joint in every figure, by the number in its name, else by ``position``."""
    digits = re.findall(r"\d+", name)
    # Joint 2 gets the first colour: on most arms it is the one that matters.
    return SERIES[((int(digits[-1]) if digits else position) - 2) % len(SERIES)]


def joint_line(name: str, position: int = 0) -> dict[str, Any]:
    """Colour and kind of line for a joint in every figure: :func:`joint_colour`, and a dash that goes with it."""
    colour = joint_colour(name, position)
    return {"color": colour, "linestyle": LINES[SERIES.index(colour)]}


def note(ax: Axes, text: str, xy: tuple[float, float], offset: tuple[float, float] = (0, 0), **look: Any) -> None:
    """Write beside a point, ``offset`` in points of type, centred unless ``look`` says otherwise."""
    ax.annotate(text, xy, offset, textcoords="offset points", **{"ha": "center", "va": "center", "size": 9.0, **look})


def above(ax: Axes, handles: Sequence[Any], columns: int) -> None:
    """Put the legend above the axes, where it hides no data."""
    look: dict[str, Any] = {"columnspacing": 1.4, "handlelength": 1.6, "borderaxespad": 0.3}
    ax.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, **look)


def title(figure: Figure, text: str) -> None:
    """Write the title of a figure at its top left."""
    figure.suptitle(text, x=0.01, ha="left", size=11.5, weight="bold")


def paler(colour: str) -> str:
    """Return a colour mixed with white; unlike a transparent one it hides the grid behind it."""
    red, green, blue = (0.42 * part + 0.58 for part in to_rgb(colour))
    return to_hex((red, green, blue))


def axis_limit(values: Array) -> float:
    """End of a linear axis of magnitudes: the largest, or the last one before a jump to a few far larger."""
    ordered = np.sort(values)
    for i in range(int(0.6 * len(ordered)), len(ordered) - 1):
        if ordered[i] > 0.0 and ordered[i + 1] > _JUMP * ordered[i]:
            return float(ordered[i])
    return float(ordered[-1]) if ordered.size and ordered[-1] > 0.0 else 1.0


def angle_label(name: str) -> str:
    """Return the axis label of a joint coordinate: ``q2 (deg)`` for ``q2_deg``."""
    return f"{name.removesuffix('_deg')} (deg)"


def power_of_ten(value: float) -> str:
    """Write a positive number as ``10⁵`` or ``2·10⁵``: without mathtext, which no figure of ours uses."""
    exponent = int(np.floor(np.log10(value) + 1e-9))
    lead, power = f"{value / 10.0**exponent:.3g}", "10" + str(exponent).translate(_RAISED)
    return power if lead == "1" else f"{lead}·{power}"


def log_ticks(axis: Axis, write: Callable[[float], str] = power_of_ten) -> None:
    """Label a logarithmic axis whose limits are set: powers of ten, with more between them the fewer these are.

    Matplotlib's own labels are mathtext.
    """
    low, high = axis.get_view_interval()
    few = (1.0, 2.0, 5.0) if high > 6.0 * low else (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)
    axis.set_major_locator(LogLocator(subs=(1.0,) if high > 300.0 * low else few))
    axis.set_major_formatter(FuncFormatter(lambda v, _: write(float(v))))
    axis.set_minor_locator(NullLocator())
