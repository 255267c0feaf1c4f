"""A course of postures along a path in files, and its picture: what `posture`, `place` and `post` have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Final

from machining import Course
from machining.posture.posing import CHOSEN
from machining.task import ToolPath
from robots import Robot
from robots.arrays import Array
from robots.inverse.elbow_angle import elbow_angle
from robots.quantities import Quantity, angle, length
from stiffarm.result import Drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GAMMA: Final = angle("gamma")
ELBOW: Final = angle("elbow")
PATH_LENGTH: Final = length("path_length")
ERROR_SD: Final = length("error_sd", unit="um")


def prefixed(name: str, quantity: Quantity) -> Quantity:
    """A quantity of one of several courses or placements; that of the recommended one has its own name."""
    return (
        quantity
        if name == CHOSEN
        else replace(quantity, key=f"{name.replace(' ', '_').replace(',', '')}_{quantity.key}")
    )


def precise(quantity: Quantity) -> Quantity:
    """A place or an angle with the digits that lead the tool back to where it was."""
    return replace(quantity, stored=10)


def course_values(robot: Robot, path: ToolPath, course: Course) -> dict[Quantity, Array]:
    """Where the path's points are, gamma, the elbow's angle of a seven-axis arm, and the joints (n,)."""
    elbow = elbow_angle(robot, course.q)
    places = zip(("path", "x", "y", "z"), (path.arc_length, *path.points.T), strict=True)
    values = {length(name): column for name, column in places} | {GAMMA: course.gamma}
    values |= {} if elbow is None else {ELBOW: elbow}
    values |= {angle(name): column for name, column in zip(robot.coordinates, course.q.T, strict=True)}
    return {precise(quantity): column for quantity, column in values.items()}


def elbow_range(robot: Robot, q: Array) -> dict[str, list[float | None]]:
    """Least and largest angle of the elbow of a seven-axis arm at poses q (n, dof) rad; nothing of other arms."""
    elbow = elbow_angle(robot, q)
    return {} if elbow is None else {ELBOW.column: ELBOW.stored_values((elbow.min(), elbow.max()))}


def angles_text(gamma: Array) -> str:
    """An angle that stays the same, or its range, in deg: ``35 deg``, ``35 to 40 deg``."""
    low, high = GAMMA.text(gamma.min()), GAMMA.text(gamma.max())
    return f"{low} deg" if low == high else f"{low} to {high} deg"


def joints_drawing(arc: Array, courses: Mapping[str, Array], robot: Robot, *, narrow: bool = False) -> Drawing:
    """The picture of joint angles q (n, dof) of courses, the first boldly, over the path's length (n,) m."""
    caption = "Joint angles along the path. Shaded, where it is in the picture: beyond a joint limit."
    return Drawing("joints", caption, "joint angles along the path", partial(_joints, arc, courses, robot, narrow))


def _joints(arc: Array, courses: Mapping[str, Array], robot: Robot, narrow: bool) -> Figure:
    from stiffarm.commands.posture.figures.along_path import joints_figure

    return joints_figure(arc, courses, robot, narrow=narrow)
