"""The figure of the sensitivity study. Pure: data in, Figure out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from doe import PoseEffects
from robots import InputError
from stiffarm.pages.figure_parts import drawing, joint_colour, named_rows, note
from stiffarm.pages.style import INK


def sensitivity_figure(
    effects: Mapping[str, Sequence[PoseEffects]],
    levels_Nm_per_rad: tuple[float, float] | None = None,
) -> Figure:
    """Draw the signed main effects of the joint springs (mm): a column a load path, a row a pose.

    ``levels_Nm_per_rad``: the low and high stiffness of the study, for the axis label.

    Raises
    ------
    InputError
        No effects.
    """
    poses = list(dict.fromkeys(e.pose for column in effects.values() for e in column))
    if not poses:
        raise InputError("sensitivity figure: no effects to draw")
    every = np.concatenate([e.effect_mm for column in effects.values() for e in column])
    low, high = levels_Nm_per_rad or (0.0, 0.0)
    step = f" from {low:,.0f} to {high:,.0f} N m/rad".replace(",", " ") if levels_Nm_per_rad else ""
    heading, size = "Which joint's stiffness moves the tool", (10.0, 1.6 + 1.25 * len(poses))
    with drawing(heading, size, len(poses), len(effects), sharex=True) as (figure, axes):
        for c, (path, column) in enumerate(effects.items()):
            axes[c].set_title(f"Load path: {path}", loc="left")
            for r, pose in enumerate(poses):
                ax = axes[r * len(effects) + c]
                found = [e for e in column if e.pose == pose]
                if found:
                    _effect_bars(ax, found[0], float(np.abs(every).max()))
                else:
                    ax.text(0.5, 0.5, "not studied", transform=ax.transAxes, ha="center")
                if c == 0:
                    ax.set_ylabel(f"pose {pose}", weight="bold")
        low, high = min(0.0, every.min()), max(0.0, every.max(), 1e-9)
        room = 0.2 * (high - low)
        axes[0].set_xlim(low - room if low < 0.0 else 0.0, high + room)
        figure.supxlabel(f"effect on dz of stiffening one joint{step} (mm); positive: sags less", size=10)
    return figure


def _effect_bars(ax: Axes, effects: PoseEffects, largest: float) -> None:
    colours = [joint_colour(joint, i + 2) for i, joint in enumerate(effects.joints)]
    ax.barh(range(len(colours)), effects.effect_mm, 0.72, color=colours)
    ax.axvline(0.0, color=INK, linewidth=0.8)
    for row, value in enumerate(effects.effect_mm):
        text = "0" if abs(value) <= 1e-7 * largest else f"{value:+.3g}".replace("-", "−")
        side = 1 if value >= 0.0 else -1
        note(ax, text, (value, float(row)), (4 * side, 0), ha="left" if side > 0 else "right")
    named_rows(ax, effects.joints)
