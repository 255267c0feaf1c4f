"""The figure of the measured deflections. Pure: data in, Figure out."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from doe import Measurements
from robots import InputError, Robot
from robots.arrays import Array
from stiffarm.pages.figure_parts import SERIES, above, drawing, note, paler
from stiffarm.pages.style import INK

_HATCHES: Final = ("////", "xxxx", "....")
# From this many bars on, their numbers stand upright; from the second on they are left out.
_BARS_UPRIGHT, _BARS_BARE = 36, 90
# From this many characters on, the labels of the poses stand upright.
_LABELS_UPRIGHT = 100


@dataclass(frozen=True)
class Doubt:
    """Readings that may be wrong: at these poses and loads (N), for the reason in ``note``."""

    poses: tuple[str, ...]
    loads_N: tuple[float, ...]  # noqa: N815 - the unit's letter
    note: str


def wrist_families(data: Measurements, robot: Robot) -> dict[str, str]:
    """Name each pose by the coordinates from the fourth on that vary in the data: ``q4 = 0°, q5 = −100°``."""
    columns = [i for i in range(3, robot.dof) if np.ptp(data.q[:, i]) > 0.0]
    out = {}
    for pose, rows in data.pose_groups().items():
        angles = zip(columns, np.degrees(data.q[rows[0], columns]), strict=True)
        parts = [f"{robot.coordinates[i].removesuffix('_deg')} = {angle:.4g}°" for i, angle in angles]
        out[pose] = ", ".join(parts).replace("-", "−") or "all poses"
    return out


def data_figure(
    data: Measurements,
    *,
    excluded_loads_N: Sequence[float] = (),
    doubts: Sequence[Doubt] = (),
    families: Mapping[str, str] | None = None,
) -> Figure:
    """Draw the measured |dz| (mm) of each pose, grouped by load; repeats as their mean with the range.

    Parameters
    ----------
    excluded_loads_N : loads shown pale, as not used to calibrate
    doubts : hatched bars with a note; where several apply to a bar, the first
    families : pose -> family, drawn in one colour each (see :func:`wrist_families`); ignored if there are
        more families than colours

    Raises
    ------
    InputError
        No reading of dz.
    """
    dz = np.abs(data.displacement[:, 2]) * 1e3
    if np.isnan(dz).all():
        raise InputError(f"{data.source}: no dz_mm reading to draw", remedy="give dz_mm for at least one row")
    loads, poses = _load_groups(data.loads_N), list(data.pose_groups())
    names = list(dict.fromkeys(families.values())) if families else []
    names = names if len(names) <= len(SERIES) else []
    bars = len(loads) * len(poses)
    places = np.add.outer((len(poses) + 1.4) * np.arange(len(loads)), np.arange(len(poses)))
    used: set[int] = set()
    longest = max(map(len, poses))
    upright = bars * longest > _LABELS_UPRIGHT
    # What stands below the pose labels, in points: upright ones are as high as they are long.
    below_pt = 10.0 + 6.0 * max(longest, 2)
    heading = "Measured vertical deflection of every pose and load"
    with drawing(heading, (10.0, 5.0 + 0.25 * len(doubts))) as (figure, (ax,)):
        for (load, rows), at in zip(loads, places, strict=True):
            pale = any(_same_load(load, other) for other in excluded_loads_N)
            for x, pose in zip(at, poses, strict=True):
                mine = dz[[i for i in rows if data.pose[i] == pose]]
                colour = SERIES[names.index(families[pose])] if families and names else SERIES[0]
                hatches = [i for i, d in enumerate(doubts) if _applies(d, pose, load)][:1]
                used.update(hatches)
                look: dict[str, Any] = {"facecolor": paler(colour) if pale else colour}
                look |= {"hatch": _HATCHES[hatches[0] % 3]} if hatches else {}
                _data_bar(ax, float(x), mine[~np.isnan(mine)], look, bars)
            text = f"{load:.4g} N" + (" (not used to calibrate)" if pale else "")
            below = {"xycoords": ("data", "axes fraction"), "weight": "bold", "size": 10}
            note(ax, text, (float(at.mean()), 0.0), (0, -(below_pt if upright else 22.0)), va="top", **below)
        ax.set_xticks(places.ravel(), poses * len(loads), size=8.5, rotation=90 if upright else 0)
        ax.tick_params(axis="x", length=0, pad=2)
        ax.grid(visible=False, axis="x")
        ax.set(
            xlim=(-1.2, places[-1, -1] + 1.2),
            ylim=(0.0, (1.08 if bars <= _BARS_UPRIGHT else 1.14) * float(np.nanmax(dz))),
            ylabel="measured deflection |dz| (mm)",
        )
        ax.set_xlabel("pose number, grouped by load (N)", labelpad=28.0 + (2.0 * longest if upright else 0.0))
        if len(names) > 1:
            above(ax, [Patch(facecolor=c, label=name) for c, name in zip(SERIES, names, strict=False)], 4)
        hatched = [(_HATCHES[i % 3], textwrap.fill(doubts[i].note, 130)) for i in sorted(used)]
        if hatched:
            keys = [Patch(facecolor="#777777", edgecolor="white", hatch=h, label=text) for h, text in hatched]
            figure.legend(handles=keys, loc="outside lower left", handlelength=2.6, handleheight=1.4)
    return figure


def _data_bar(ax: Axes, x: float, values: Array, look: Mapping[str, Any], bars: int) -> None:
    if not values.size:
        note(ax, "–", (x, 0.0), va="bottom")
        return
    ax.bar(x, values.mean(), 0.86, edgecolor="white", linewidth=0.0, **look)
    if np.ptp(values) > 0.0:
        ax.vlines(x, values.min(), values.max(), color=INK, linewidth=1.2)
    if bars <= _BARS_BARE:
        upright = bars > _BARS_UPRIGHT
        text = f"{values.mean():.2f}"
        note(ax, text, (x, values.max()), (0, 2), va="bottom", size=8.5, rotation=90 if upright else 0)


def _same_load(a: float, b: float) -> bool:
    # A real weight is never its nominal one.
    return abs(a - b) <= 0.01 * abs(b)


def _applies(doubt: Doubt, pose: str, load: float) -> bool:
    return pose in doubt.poses and any(_same_load(load, other) for other in doubt.loads_N)


def _load_groups(loads: Array) -> list[tuple[float, list[int]]]:
    """Rows of each load, smallest load first; loads that follow one another within 1 % are one."""
    order = np.argsort(loads, kind="stable")
    ascending = loads[order]
    jumps = np.flatnonzero(ascending[1:] > 1.01 * ascending[:-1]) + 1
    return [(float(loads[rows[0]]), rows.tolist()) for rows in np.split(order, jumps)]
