"""The figure of what bends: each part's share of the deflection. Data in, Figure out."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from robots import InputError
from robots.arrays import Array
from stiffarm.pages.figure_parts import above, joint_colour, note, paler, title
from stiffarm.pages.style import INK, house_style, new_figure

_GREYS: Final = ("#6B7178", "#9AA0A7", "#C4C8CD")
_JOINT: Final = re.compile(r"(?:j|a|joint)[ _-]?\d+", re.IGNORECASE)


def budget_figure(
    parts: Mapping[str, Array],
    poses: Sequence[str],
    measured_mm: Array | None = None,
    least_share: float = 0.02,
) -> Figure:
    """Draw what bends: each part's share of the vertical deflection (mm) by pose, in stacked bars.

    Parts that work against the sum (possible under a load that is not vertical) stand left of zero.

    Parameters
    ----------
    parts : name -> (n,) mm, from :func:`fem.deflection_by_part`
    poses : (n,) labels
    measured_mm : (n,) readings, drawn as a black line across each bar
    least_share : parts below this share at every pose are drawn together

    Raises
    ------
    InputError
        No parts, arrays not as long as ``poses``, values not finite, or a pose that does not deflect.
    """
    table = np.array([np.asarray(v, dtype=np.float64) for v in parts.values()])
    if table.shape != (len(parts), len(poses)) or not table.size or not np.isfinite(table).all():
        allowed = f"finite, ({len(poses)},) each"
        raise InputError("budget figure: parts", value=f"shape {table.shape}", allowed=allowed)
    total = table.sum(axis=0)
    if not total.all():
        raise InputError(f"budget figure: pose {poses[int(np.argmin(np.abs(total)))]} does not deflect")
    stack = _stacked(list(parts), table * np.sign(total), np.abs(total), least_share)
    with house_style():
        figure, (ax,) = new_figure((10.0, 1.8 + 0.4 * len(poses)))
        keys: list[Any] = []
        for name, values, left in stack:
            _segment(ax, values, left, _part_colour(name, [n for n, _, _ in stack]), np.abs(total))
            # A key of its own: matplotlib leaves bars out of legends if their name begins with "_".
            keys.append(Patch(facecolor=ax.patches[-1].get_facecolor(), label=name))
        end = sum(np.maximum(values, 0.0) for _, values, _ in stack)
        for row, value in enumerate(np.abs(total)):
            behind = (float(np.asarray(end)[row]), row)
            note(ax, f"{value:.2f} mm", behind, (7, 0), ha="left", weight="bold")
        y = np.arange(len(poses))
        if measured_mm is not None:
            ax.vlines(np.abs(measured_mm), y - 0.46, y + 0.46, color="black", linewidth=2.2)
            look: dict[str, Any] = {"color": "black", "markersize": 11, "markeredgewidth": 2.2}
            keys += ax.plot([], [], linestyle="none", marker="|", label="measured", **look)
        ax.axvline(0.0, color=INK, linewidth=0.8)
        ax.set_yticks(y, [f"pose {p}" for p in poses])
        ax.set_ylim(len(poses) - 0.4, -0.6)
        ax.set_xlim(min(0.0, 1.05 * ax.dataLim.x0), 1.12 * ax.dataLim.x1)
        ax.tick_params(axis="y", length=0)
        ax.grid(visible=False, axis="y")
        ax.set_xlabel("vertical deflection |dz| (mm); bold: simulated sum, in the bars: share of it (%)")
        above(ax, keys, 7)
        title(figure, "Where the deflection comes from")
    return figure


def _stacked(names: list[str], size: Array, total: Array, least_share: float) -> list[tuple[str, Array, Array]]:
    """Name, length and left end (n,) of each segment: largest part first, the small ones together last."""
    share = np.abs(size) / total
    kept = sorted(np.flatnonzero(share.max(axis=1) >= least_share), key=lambda i: -float(share[i].mean()))
    segments = [(names[i], size[i]) for i in kept]
    small = [i for i in range(len(names)) if i not in kept and share[i].max() > 0.0]
    if small:
        count = "other part," if len(small) == 1 else f"{len(small)} other parts, each"
        segments.append((f"{count} below {100 * least_share:g} %", size[small].sum(axis=0)))
    out: list[tuple[str, Array, Array]] = []
    for name, values in segments:
        same = [np.where(values * v > 0.0, v, 0.0) for _, v, _ in out]
        out.append((name, values, np.sum([np.zeros(len(values)), *same], axis=0)))
    return out


def _segment(ax: Axes, values: Array, left: Array, colour: str, total: Array) -> None:
    y = np.arange(len(values))
    ax.barh(y, values, 0.74, left=left, color=colour, edgecolor="white", linewidth=0.8)
    dark = np.dot(to_rgb(colour), (0.3, 0.59, 0.11)) < 0.5
    for row in np.flatnonzero(np.abs(values) > 0.045 * total.max()):
        middle = (float(left[row] + values[row] / 2), float(row))
        text = f"{100 * values[row] / total[row]:.0f} %".replace("-", "−")
        note(ax, text, middle, color="white" if dark else INK)


def _part_colour(name: str, names: Sequence[str]) -> str:
    """Joints in their colours of the other figures, structure in greys, so that the two are told apart."""
    found = _JOINT.match(name)
    if found:
        colour = joint_colour(found.group())
        return colour if found.group() == name else paler(colour)
    return _GREYS[[n for n in names if not _JOINT.match(n)].index(name) % 3]
