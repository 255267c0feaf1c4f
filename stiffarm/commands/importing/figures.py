"""Contact sheet of imported links from two sides each, with their interface rings."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from stiffarm.commands.importing.solids import Piece
from stiffarm.pages import style
from stiffarm.pages.figure_parts import panels

SHELL: Final = "#C9CDD2"
RING_COLOURS: Final = (style.OKABE_ITO["blue"], style.OKABE_ITO["vermillion"], style.OKABE_ITO["green"])
_LIGHT: Final = np.array([-0.35, 0.55, 0.76])
_COLUMNS: Final = 3
_CELL_IN: Final = (3.6, 3.3)
# Width of a letter of the title.
_LETTER_IN: Final = 0.125


def contact_sheet(pieces: Sequence[Piece], facts: Sequence[Sequence[str]], title: str) -> Figure:
    """Draw each link twice, from above and from opposite below, so that all rings show; dots are interface points.

    ``facts``: lines of text under each link.
    """
    views = [(piece, lines, side) for piece, lines in zip(pieces, facts, strict=True) for side in (1.0, -1.0)]
    columns = 2 if len(pieces) == 1 else 2 * min(_COLUMNS, -(-len(pieces) // 2))
    width = columns * _CELL_IN[0] * 0.75
    heading = textwrap.fill(title, max(int(width / _LETTER_IN), 20))
    with panels(heading, len(views), columns, width, _CELL_IN[1], 1.0) as (figure, axes):
        for place, view in zip(axes, views, strict=True):
            _draw(place, *view)
        names = list(dict.fromkeys(name for piece in pieces for name in piece.interfaces))
        marks = [
            Line2D([], [], color=_ring_colour(i), marker="s", linestyle="none", label=f"ring: {name}")
            for i, name in enumerate(names)
        ]
        marks.append(
            Line2D([], [], color=style.INK, marker="o", markerfacecolor="white", linestyle="none", label="joint")
        )
        figure.legend(handles=marks, loc="outside lower center", ncols=len(marks))
    return figure


def _ring_colour(i: int) -> str:
    return RING_COLOURS[i % len(RING_COLOURS)]


def _draw(axes: Axes, mesh: Piece, lines: Sequence[str], side: float) -> None:
    """One link from above (side 1) or from opposite below (-1): faces turned to the eye, the farthest first."""
    camera = style.Camera(side * np.array([0.62, -1.0, 0.45]))
    flat = 1e3 * camera(mesh.nodes)
    corners = flat[mesh.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    seen = np.flatnonzero(normal[:, 2] > 0.0)
    seen = seen[np.argsort(corners[seen, :, 2].mean(axis=1), kind="stable")]
    base = np.tile(to_rgb(SHELL), (len(mesh.triangles), 1))
    for i, ring in enumerate(mesh.interfaces.values()):
        held = np.zeros(len(mesh.nodes), dtype=bool)
        held[ring] = True
        base[held[mesh.triangles].all(axis=1)] = to_rgb(_ring_colour(i))
    light = 0.45 + 0.6 * np.clip(normal @ (_LIGHT / np.linalg.norm(_LIGHT)), 0.0, 1.0)
    colours = np.clip(base * light[:, None], 0.0, 1.0)[seen]
    faces = PolyCollection(
        list(corners[seen][:, :, :2]), facecolors=colours, edgecolors=0.86 * colours, linewidths=0.15
    )
    axes.add_collection(faces)
    points = 1e3 * camera(mesh.points)[:, :2]
    axes.plot(*points.T, linestyle=":", color=style.INK, linewidth=0.9, zorder=3)
    for i, point in enumerate(points):
        axes.plot(*point, marker="o", markersize=6, color=_ring_colour(i), markerfacecolor="white", zorder=4)
    everything = np.vstack([flat[:, :2], points])
    low, high = everything.min(axis=0), everything.max(axis=0)
    half = 0.54 * float((high - low).max())
    middle = 0.5 * (low + high)
    axes.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half), aspect="equal")
    axes.set_axis_off()
    if side > 0.0:
        axes.set_title(mesh.name, loc="left", fontsize=10.5, fontweight="bold")
        axes.text(0.0, -0.01, "\n".join(lines), transform=axes.transAxes, va="top", size=8.0, color="#555555")
    else:
        axes.set_title("from opposite, below", loc="left", fontsize=9, color="#777777")
