"""How a quantity of a map is coloured: colour map by what it means, scale, ticks, names of categories."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import (
    BoundaryNorm,
    Colormap,
    ListedColormap,
    LogNorm,
    Normalize,
    to_rgb,
)
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from robots import InputError
from robots.arrays import Array
from stiffarm.pages.style import OKABE_ITO, STIFFNESS_COLOURS, Extend, colour_bar, colour_scale, ends_cut, stretch_of
from surrogate.maps.data import Field

Kind = Literal["stiff", "soft", "error", "other", "angle", "category"]

# Values that the ends of a scale are found from; more of them would not move its percentiles.
_MOST_VALUES: Final = 500_000
# Sequential maps end before white and black: a first colour is seen on paper, lines on a last one.
_BLUES: Final = stretch_of("Blues", 0.2, 1.0)
_GREENS: Final = stretch_of("viridis", 0.12, 1.0)
COLOURS: Final = MappingProxyType(
    {
        "stiff": STIFFNESS_COLOURS,
        # A compliance or a deflection: warm and bright stays stiff.
        "soft": STIFFNESS_COLOURS.reversed(),
        "error": _BLUES,
        "other": _GREENS,
        # Angles close on themselves: -180 and 180 deg have one colour.
        "angle": mpl.colormaps["twilight"],
    }
)
"""Colour map by kind; lightness rises or falls all the way in each but that of angles, also for colour-blind eyes."""

_ERROR_WORDS: Final = ("error", "uncertain", "interval", "half_width", "deviation", "sigma", "std")
_SOFT_UNITS: Final = ("um", "um/N", "mm", "mm/N", "m/N", "rad/N")
_STIFF_UNITS: Final = ("N/mm", "N/m", "N/um", "Nm/rad")
_PLAIN_UNITS: Final = {"percent": "%"}
# Categories beyond these share one grey: more hues are not told apart.
_HUES: Final = tuple(OKABE_ITO[c] for c in ("blue", "orange", "green", "purple", "sky", "vermillion", "yellow"))
_REST: Final = "#8A8F96"
_NAMED: Final = len(_HUES)


@dataclass(frozen=True, eq=False)
class Look:
    """Colours and scale of one quantity.

    ``names``: for categories, (number, name, colour) of those that occur, the most frequent first; the numbers of the
    rare ones are in ``rest``. ``extend``: which ends of the scale cut values off.
    """

    name: str
    label: str
    unit: str
    kind: Kind
    colours: Colormap
    norm: Normalize
    ticks: Array
    extend: Extend = "neither"
    names: tuple[tuple[int, str, str], ...] = ()
    rest: tuple[int, ...] = ()

    @property
    def axis_label(self) -> str:
        """For bars and axes: the words with the unit, and whether the scale is logarithmic."""
        text = f"{self.label} ({self.unit})" if self.unit else self.label
        return text + (", log scale" if isinstance(self.norm, LogNorm) else "")

    @property
    def ends(self) -> tuple[str, str]:
        """What the largest and the smallest value are called."""
        words = {"stiff": ("stiffest", "softest"), "soft": ("softest", "stiffest")}
        return words.get(self.kind, ("largest", "smallest"))

    def rgb(self, values: Array) -> Array:
        """Colours (n, 3) of values (n,)."""
        return np.asarray(self.colours(self.norm(values)))[:, :3]

    def level_ink(self, level: float) -> str:
        """Colour of a line on the colour of its own value: white on dark, ink on light."""
        red, green, blue = to_rgb(self.colours(self.norm(level)))
        return "#FFFFFF" if 0.299 * red + 0.587 * green + 0.114 * blue < 0.55 else "#222222"

    def text(self, value: float) -> str:
        """A value with its unit."""
        # Four digits, without the exponent that %.4g gives 12340.
        return f"{float(f'{value:.4g}'):.12g} {self.unit}".replace("-", "−").rstrip()


def kind_of(name: str, field: Field) -> Kind:
    """What a field means: by its categories, its name (errors) and its unit."""
    if field.categories:
        return "category"
    if any(word in name.lower() for word in _ERROR_WORDS):
        return "error"
    if field.unit in _SOFT_UNITS:
        return "soft"
    if field.unit == "deg":
        return "angle"
    return "stiff" if field.unit in _STIFF_UNITS else "other"


def look_of(name: str, field: Field) -> Look:
    """Colours and scale for all values of a field.

    Raises
    ------
    InputError
        The field has no value at all.
    """
    step = max(1, len(field.values) // _MOST_VALUES)
    values = np.asarray(field.values[::step], dtype=np.float64)
    values = values[np.isfinite(values)]
    kind = kind_of(name, field)
    if kind == "category":
        return _categories(name, field, values[values >= 0.0])
    if not values.size:
        raise InputError(
            f"map: {name}",
            code="B002",
            value="no value at any point",
            remedy="move the grid to where the robot reaches",
        )
    if kind == "angle":
        low = 0.0 if values.min() >= 0.0 and values.max() > 180.0 else -180.0
        norm, ticks = Normalize(low, low + 360.0), low + np.arange(0.0, 361.0, 45.0)
    elif np.ptp(values) <= 1e-9 * np.abs(values).max():
        # One value everywhere: a scale about it.
        size = 0.05 * max(float(np.abs(values).max()), 1e-12)
        low, high = float(values.min()) - size, float(values.max()) + size
        norm, ticks = Normalize(low, high), np.array([low, float(values.mean()), high])
    else:
        norm, ticks = colour_scale(values, None)
    unit = _PLAIN_UNITS.get(field.unit, field.unit)
    return Look(name, field.label, unit, kind, COLOURS[kind], norm, ticks, ends_cut(values, ticks))


def _categories(name: str, field: Field, values: Array) -> Look:
    if not values.size:
        raise InputError(
            f"map: {name}",
            code="B002",
            value="no value at any point",
            remedy="move the grid to where the robot reaches",
        )
    count = np.bincount(values.astype(np.int64), minlength=len(field.categories))
    order = [int(i) for i in np.argsort(-count, kind="stable") if count[i]]
    # One more than there are hues may have the grey for itself.
    named = order if len(order) <= _NAMED + 1 else order[:_NAMED]
    colours = [*_HUES, _REST]
    names = tuple((i, field.categories[i], colours[k]) for k, i in enumerate(named))
    of_number = {i: colour for i, _, colour in names}
    palette = ListedColormap([of_number.get(i, _REST) for i in range(len(field.categories))])
    norm = BoundaryNorm(np.arange(len(field.categories) + 1) - 0.5, max(len(field.categories), 1))
    return Look(
        name, field.label, "", "category", palette, norm, np.zeros(0), names=names, rest=tuple(order[len(named) :])
    )


def category_patches(look: Look) -> list[Patch]:
    """Legend entries of categories: the most frequent first."""
    out = [Patch(facecolor=colour, label=name) for _, name, colour in look.names]
    return out + ([Patch(facecolor=_REST, label=f"{len(look.rest)} others")] if look.rest else [])


def look_bar(figure: Figure, look: Look, *, axes: Any = None, cax: Axes | None = None, levels: Any = ()) -> None:
    """Colour bar of a quantity with its unit; ends that cut values off say so; ``levels`` are marked on it."""
    place: dict[str, Any] = {"cax": cax} if cax is not None else {"ax": axes, "pad": 0.02, "aspect": 30}
    bar = colour_bar(figure, look.colours, look.norm, look.ticks, look.extend, place)
    bar.set_label(look.axis_label)
    for level in levels:
        bar.ax.axhline(level, color=look.level_ink(level), linewidth=2.0)
    if look.kind in ("stiff", "soft"):
        for y, text, side in ((1.075, look.ends[0], "bottom"), (-0.075, look.ends[1], "top")):
            words = text.removesuffix("est")
            bar.ax.text(0.5, y, words, transform=bar.ax.transAxes, ha="center", va=side, size=9, color="#555555")
