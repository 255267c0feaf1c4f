"""Figure of stiffness at poses: cuts through the force-stiffness ellipsoid. Data in, Figure out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from machining import directional_stiffness, ellipsoid_radius, stiffness_ellipsoid
from robots import InputError
from robots.arrays import Array
from stiffarm.pages.figure_parts import drawing
from stiffarm.pages.style import INK, OKABE_ITO

MOST_POSES: Final = 4
_PLANES: Final = (("x", "y"), ("x", "z"), ("y", "z"))
_TURN: Final = np.linspace(0.0, 2.0 * np.pi, 361)
# Directions in which nothing deflects would swamp the others.
_MOST: Final = 6.0


def ellipsoid_figure(C_tt: Array, labels: Sequence[str], normal: Array) -> Figure:
    """Draw cuts of each pose's ellipsoid and directional stiffness (N/mm) in the planes XY, XZ, YZ of the base.

    ``C_tt`` (n, 3, 3) m/N, at most :data:`MOST_POSES`; ``normal`` (3,) is marked where it lies in the plane's sight.

    Raises
    ------
    InputError
        No poses, or more than fit.
    """
    n = len(C_tt)
    if not 0 < n <= MOST_POSES or len(labels) != n:
        raise InputError(
            "poses of the ellipsoid figure", code="B002", value=n, allowed=f"1 to {MOST_POSES}, with a label each"
        )
    heading = "Stiffness at the tool by direction of the force, N/mm"
    with drawing(heading, (10.0, 0.9 + 3.5 * n), n, 3) as (figure, axes):
        for i in range(n):
            top = _top(C_tt[i])
            for p, plane in enumerate(_PLANES):
                _cut(axes[3 * i + p], C_tt[i], plane, normal, top)
            axes[3 * i].set_title(f"pose {labels[i]}", loc="left", weight="bold", pad=6)
        handles = [
            Line2D([], [], color=OKABE_ITO["blue"], label="force for 1 mm in any direction (ellipsoid, k_fs)"),
            Line2D([], [], color=OKABE_ITO["orange"], linestyle="--", label="force for 1 mm along itself"),
            Line2D([], [], color=INK, marker=">", linestyle="-", linewidth=1.0, label="surface normal"),
        ]
        figure.legend(handles=handles, loc="outside lower left", ncols=3)
    return figure


def _top(C: Array) -> float:
    """End of the axes of one pose, N/mm: the strongest direction, unless that is next to rigid."""
    axes = stiffness_ellipsoid(C[None]).semi_axes[0] * 1e-3
    return float(min(axes[2], _MOST * axes[1], _MOST**2 * axes[0]))


def _cut(ax: Axes, C: Array, plane: tuple[str, str], normal: Array, top: float) -> None:
    a, b = ("xyz".index(name) for name in plane)
    direction = np.zeros((len(_TURN), 3))
    direction[:, a], direction[:, b] = np.cos(_TURN), np.sin(_TURN)
    many = np.broadcast_to(C, (len(_TURN), 3, 3))
    radius = ellipsoid_radius(many, direction) * 1e-3
    along = directional_stiffness(many, direction) * 1e-3
    for values, colour, style in ((along, "orange", "--"), (radius, "blue", "-")):
        shown = np.where(values <= 1.02 * top, values, np.nan)
        ax.plot(shown * direction[:, a], shown * direction[:, b], color=OKABE_ITO[colour], linestyle=style)
    seen = normal[[a, b]] / np.linalg.norm(normal)
    if np.linalg.norm(seen) > 0.3:
        tip = (float(0.45 * top * seen[0]), float(0.45 * top * seen[1]))
        ax.annotate("", tip, (0.0, 0.0), arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.0})
    ax.plot(0.0, 0.0, "+", color=INK, markersize=7)
    ax.set_aspect("equal", adjustable="box")
    ax.set(
        xlim=(-1.08 * top, 1.08 * top),
        ylim=(-1.08 * top, 1.08 * top),
        xlabel=f"{plane[0].upper()}, N/mm",
        ylabel=f"{plane[1].upper()}, N/mm",
    )
