"""Pictures of `robots check`: the arm with both sets of points."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from robots import Robot, forward_kinematics
from robots.controller import shown_tool
from robots.pendant.check import PendantCheck
from stiffarm.pages.figure_parts import above, drawing
from stiffarm.pages.style import FAINT, INK, OKABE_ITO


def skeleton_figure(robot: Robot, found: PendantCheck) -> Figure:
    """Draw joints and links of the pose that is farthest off, and the tool of all poses: read, and as modelled."""
    worst = int(found.distance.argmax())
    frames = forward_kinematics(robot, found.readings.q)
    tool = frames.T_flange @ shown_tool(robot)
    chain = 1e3 * np.vstack([np.zeros(3), frames.p[worst], frames.p_flange[worst], tool[worst, :3, 3]])
    there = 1e3 * tool[:, :3, 3]
    read = there + 1e3 * found.left
    heading = f"Pose {found.readings.labels[worst]}, and where the tool is in all poses"
    with drawing(heading, (11.0, 5.2), 1, 2) as (figure, axes):
        for ax, (a, b) in zip(axes, ((0, 2), (0, 1)), strict=True):
            ax.plot(chain[:, a], chain[:, b], color=FAINT, linewidth=6.0, solid_capstyle="round", zorder=1)
            ax.plot(chain[:-1, a], chain[:-1, b], "o", color=INK, markersize=5, zorder=2)
            for one, other in zip(there, read, strict=True):
                ax.plot([one[a], other[a]], [one[b], other[b]], color=OKABE_ITO["vermillion"], linewidth=1.2, zorder=3)
            ax.plot(
                there[:, a],
                there[:, b],
                "o",
                color=OKABE_ITO["blue"],
                markerfacecolor="white",
                markersize=7,
                label="model",
                zorder=4,
            )
            ax.plot(
                read[:, a], read[:, b], "o", color=OKABE_ITO["vermillion"], markersize=4, label="controller", zorder=5
            )
            ax.set_xlabel(f"{'xyz'[a]} (mm), seen {'from the side' if b == 2 else 'from above'}")
            ax.set_ylabel(f"{'xyz'[b]} (mm)")
            ax.set_aspect("equal", adjustable="datalim")
        above(axes[0], axes[0].get_legend_handles_labels()[0], 2)
    return figure
