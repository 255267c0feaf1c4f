"""What somebody with deuteranopia sees of a figure's series: whether more than a hue tells them apart."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import to_rgba
from matplotlib.container import Container
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

# Machado, Oliveira and Fernandes (2009), severity 1, on linear RGB.
DEUTERANOPIA = np.array(
    [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]]
)
# Lightness (0 to 100) that tells two areas or strokes apart, and how many times wider a stroke must be.
LIGHTER, WIDER = 12.0, 1.6


def lightness(colour: Any) -> float:
    """CIE lightness, 0 to 100, of a colour on white as seen with deuteranopia."""
    r, g, b, a = to_rgba(colour)
    rgb = a * np.array([r, g, b]) + 1.0 - a
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    seen = np.clip(DEUTERANOPIA @ linear, 0.0, 1.0)
    y = float(seen @ [0.2126, 0.7152, 0.0722])
    return 116.0 * y ** (1.0 / 3.0) - 16.0 if y > 0.008856 else 903.3 * y


def _look(handle: Artist) -> tuple[tuple[object, ...], float, float]:
    """What of an entry of a legend is no colour: kind and shape; its lightness; its width."""
    if isinstance(handle, Line2D):
        dash = str(handle._unscaled_dash_pattern) if handle.get_linestyle() != "None" else "no line"  # type: ignore[attr-defined]
        marker = str(handle.get_marker())
        filled = marker not in ("None", "", "none") and lightness(handle.get_markerfacecolor()) < 97.0
        face = handle.get_markeredgecolor() if dash == "no line" else handle.get_color()
        return ("line", dash, marker, filled), lightness(face), handle.get_linewidth()
    if isinstance(handle, PathCollection):
        face = handle.get_facecolor()
        edge = handle.get_edgecolor()
        colour = face[0] if len(face) else edge[0]
        return (
            ("points", str(handle.get_paths()[0].vertices.round(3).tolist()), bool(len(face))),
            lightness(colour),
            0.0,
        )
    if isinstance(handle, LineCollection):
        return ("line", str(handle.get_linestyle()), "None", False), lightness(handle.get_color()[0]), 0.0
    if isinstance(handle, Patch):
        return ("area", handle.get_hatch()), lightness(handle.get_facecolor()), 0.0
    return (id(handle),), 0.0, 0.0


def alike(figure: Figure) -> list[str]:
    """Pairs of entries of one legend that differ by hue alone, or not at all."""
    legends: list[Legend] = [*figure.legends, *(one for ax in figure.axes if (one := ax.get_legend()) is not None)]
    out = []
    for legend in legends:
        names = [text.get_text() for text in legend.get_texts()]
        entries = list(zip(names, map(_look, _single(legend)), strict=True))
        for (one, (shape, light, wide)), (other, (shape2, light2, wide2)) in combinations(entries, 2):
            apart = max(wide, wide2) > WIDER * min(wide, wide2) if min(wide, wide2) > 0.0 else False
            if shape == shape2 and abs(light - light2) < LIGHTER and not apart:
                out.append(f"{one} | {other}")
    return out


def _single(legend: Legend) -> list[Artist]:
    return [h[0] if isinstance(h, Container | tuple) else h for h in legend.legend_handles if h is not None]
