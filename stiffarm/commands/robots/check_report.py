"""report.html of `robots check`: what is wrong, differences pose by pose, and the arm with both sets of points."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from robots import ModelDescription, Robot, forward_kinematics
from robots.controller import shown_tool
from robots.pendant.check import PendantCheck
from stiffarm.commands.robots import check_words as words
from stiffarm.pages.bars import bars_figure
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.figure_parts import above, drawing
from stiffarm.pages.report import Answer, Block, Bullets, KeyFigure, Section, Table, Text, write_page
from stiffarm.pages.style import FAINT, INK, OKABE_ITO
from stiffarm.session.outputs import OutputFolder

QUESTION = "do the kinematics agree with the controller?"


def write_report(
    description: ModelDescription, robot: Robot, found: PendantCheck, content: dict[str, Any], folder: OutputFolder
) -> None:
    """Draw the pictures and write report.html."""
    pictures = Pictures(folder)
    first = (content["explanations"] or [content["closest"]])[0]
    changes = [] if first is None else first["changes"]
    picture = pictures.add(
        skeleton_figure(robot, found),
        "skeleton",
        "The arm in the pose that is farthest off, and the tool of all poses, from the side and from above.",
    )
    key = [
        KeyFigure(f"{content['largest_mm']:.3g} mm", "largest difference as the model stands"),
        KeyFigure(f"{max(one['then_mm'] for one in content['by_pose']):.3g} mm", "with what is named put right")
        if changes
        else KeyFigure(str(content["poses"]), "poses"),
    ]
    sure = {
        "agrees": "Nothing needs to be changed.",
        "orientation": "Positions agree; orientations do not.",
        "explained": f"{len(changes)} change{'s' * (len(changes) != 1)} of the model explain"
        f"{'s' * (len(changes) == 1)} all poses: the fewest of signs, zeros, couplings, lengths and frames that do.",
        "misread": "All other poses agree, and no usual slip of the model explains these.",
        "unexplained": "No usual slip, up to three at once, explains this.",
    }[content["verdict"]]
    told = words.told_in_paragraphs(content)
    todo = words.todo(content)
    distances = {
        "as it stands": {one["pose"]: one["distance_mm"] for one in content["by_pose"]},
        **({"with that put right": {one["pose"]: one["then_mm"] for one in content["by_pose"]}} if changes else {}),
    }
    by_pose: list[Block] = [
        pictures.add(
            bars_figure(
                "Distance between controller and model",
                distances,
                "distance (mm)",
                "pose",
                {"allowed": content["tolerance_mm"]},
            ),
            "distances",
            "How far the tool is from where the controller shows it, pose by pose.",
        ),
        Table("Pose by pose", words.HEADS, tuple(words.rows(content)), (0,)),
        Text(
            "Read: as the controller shows it. Read less model: along the axes of the model's base. Put right: what "
            "is left when all that is named first is changed in the model."
        ),
    ]
    sections = [Section("What was found", (Bullets(tuple(told)),))] if told else []
    made = f"{len(found.readings.q)} poses read at the controller"
    write_page(
        folder,
        description.title.split(" (")[0],
        f"{words.headline(description.title, content)}.",
        key,
        [*sections, Section("Pose by pose", tuple(by_pose))],
        QUESTION,
        made,
        Answer(sure, todo, picture),
    )


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
