"""Figures of a calibration from positions: how accurate before and after, and the joints' error curves."""

from __future__ import annotations

from typing import Final

import numpy as np
from matplotlib.figure import Figure

from doe.absolute.calibrate import Positions
from doe.absolute.identified import Curve
from stiffarm.pages.figure_parts import drawing
from stiffarm.pages.style import OKABE_ITO

_COLOURS: Final = ("vermillion", "blue", "green", "purple")
# Room beyond the largest of most readings; those beyond stand in the table.
_SHARE, _ROOM = 0.995, 1.3


def accuracy_figure(c: Positions) -> Figure:
    """Share of readings that are nearer than a distance."""
    names = ("as described", "calibrated", "calibrated, left out")
    curves = dict(zip(names, c.distances().values(), strict=True))
    if c.holdout is not None:
        curves["held out"] = c.holdout[1].distance
    with drawing("How many readings are nearer than a distance", (10.0, 4.2), 1, 1) as (figure, axes):
        ax = axes[0]
        for (name, d), colour in zip(curves.items(), _COLOURS, strict=False):
            style = "--" if name != "as described" and "left out" in name else "-"
            ax.plot(
                1e3 * np.sort(d), 100.0 * np.arange(1, len(d) + 1) / len(d), style, color=OKABE_ITO[colour], label=name
            )
        ax.set_xlim(0.0, _ROOM * 1e3 * max(float(np.quantile(d, _SHARE)) for d in curves.values()))
        ax.set_ylim(0.0, 101.0)
        ax.set_xlabel("distance between read and predicted position (mm)")
        ax.set_ylabel("readings (%)")
        ax.legend(loc="lower right")
    return figure


def curves_figure(curves: tuple[Curve, ...]) -> Figure:
    """Each joint's error over its angle with its 95 % band, where it is identified."""
    size = (10.0, 0.8 + 1.9 * len(curves))
    with drawing("Error of each joint over its angle", size, len(curves), 1) as (figure, axes):
        for ax, one in zip(axes, curves, strict=True):
            angle = np.degrees(one.angle)
            error, half = (np.where(one.known, 1e3 * x, np.nan) for x in (one.error, one.half95))
            ax.fill_between(angle, error - half, error + half, color=OKABE_ITO["blue"], alpha=0.25, linewidth=0)
            ax.plot(angle, error, color=OKABE_ITO["blue"], linewidth=1.4)
            ax.axhline(0.0, color="0.5", linewidth=0.8)
            ax.set_ylabel(f"{one.joint} (mrad)")
            if one.is_known:
                ax.set_xlim(angle[one.known][0] - 2.0, angle[one.known][-1] + 2.0)
        axes[-1].set_xlabel("joint angle (deg)")
    return figure
