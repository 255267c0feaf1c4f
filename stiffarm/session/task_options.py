"""What users type for machining tasks: frames, directions, ranges of gamma, forces; and the options that take them."""

from __future__ import annotations

import math
import warnings
from typing import Annotated

import numpy as np
import typer
from scipy.spatial.transform import Rotation

from machining import GammaRange
from robots import InputError, Robot
from robots.arrays import Array

# Angles gamma of a range at most.
MOST_ANGLES = 1440
FRAME_FORM = "x,y,z in mm, or x,y,z,a,b,c with a, b, c in deg about the fixed axes x, then y, then z"

ToolOpt = Annotated[
    str | None,
    typer.Option(
        "--tool",
        metavar="X,Y,Z[,A,B,C]",
        help="Tool frame on the flange, in mm and deg (a, b, c about the fixed axes x, y, z in this "
        "order); its z axis points out of the holder through the tip. Default: the model's tool.",
    ),
]
PartOpt = Annotated[
    str | None,
    typer.Option(
        "--part", metavar="X,Y,Z[,A,B,C]", help="Part frame in the base frame, in mm and deg. Default: the base frame."
    ),
]
NormalOpt = Annotated[str, typer.Option("--normal", metavar="X,Y,Z", help="Surface normal in base axes.")]
GammaOpt = Annotated[
    str,
    typer.Option(
        "--gamma",
        metavar="FROM:TO:STEP",
        help="Angles gamma about the tool axis, in deg; the two ends of a full turn count once.",
    ),
]

ReferenceOpt = Annotated[
    str | None,
    typer.Option(
        "--reference",
        metavar="X,Y,Z",
        help="Direction in the part frame from which gamma is measured. Default: x, or y if the tool axis "
        "comes close to x.",
    ),
]


def parse_frame(text: str, option: str) -> Array:
    """A frame (4, 4), m, from :data:`FRAME_FORM`.

    Raises
    ------
    InputError
        Neither three nor six finite numbers.
    """
    values = parse_numbers(text)
    if values is None or len(values) not in (3, 6):
        raise InputError(option, value=text, allowed=FRAME_FORM, remedy=f"write it as in {option} 0,0,250,0,0,0")
    T = np.eye(4)
    T[:3, 3] = np.array(values[:3]) * 1e-3
    if len(values) == 6:
        T[:3, :3] = Rotation.from_euler("xyz", values[3:], degrees=True).as_matrix()
    return T


def tool_of(robot: Robot, text: str | None) -> Array:
    """Tool frame on the flange (4, 4): that of ``--tool``, or the robot's own."""
    return robot.T_flange_tool if text is None else parse_frame(text, "--tool")


def frame_words(T: Array) -> str:
    """A frame as a user would type it."""
    xyz = T[:3, 3] * 1e3
    with warnings.catch_warnings():
        # At b = 90 deg a and c turn about one axis; then c is 0, which is as good as any.
        warnings.filterwarnings("ignore", message="Gimbal lock")
        turn = Rotation.from_matrix(T[:3, :3]).as_euler("xyz", degrees=True)
    return ", ".join(f"{v:.6g}" for v in xyz) + " mm; " + ", ".join(f"{v + 0.0:.6g}" for v in turn.round(9)) + " deg"


def parse_vector(text: str, option: str, unit: str, *, zero: bool = False) -> Array:
    """Three finite numbers, not all zero unless ``zero``.

    Raises
    ------
    InputError
        Anything else.
    """
    values = parse_numbers(text)
    if values is None or len(values) != 3 or not (zero or any(values)):
        allowed = f"three finite numbers x,y,z{'' if zero else ', not all zero'}: {unit}"
        raise InputError(option, value=text, allowed=allowed, remedy=f"write it as in {option} 0,0,1")
    return np.array(values)


def parse_gammas(text: str) -> GammaRange | float:
    """A range of gamma from ``-180:180:5``, or one angle (rad) from ``30``; deg.

    Raises
    ------
    InputError
        Not numbers, an empty range, a step that is not positive or leaves fewer than two angles.
    """
    values = parse_numbers(text, ":")
    if values is None or len(values) not in (1, 3):
        raise InputError(
            "--gamma", value=text, allowed="one angle, or FROM:TO:STEP in deg", remedy="as in --gamma -180:180:5"
        )
    if len(values) == 1:
        return math.radians(values[0])
    low, high, step = values
    if not (high > low and high - low <= 360.0 + 1e-9):
        raise InputError(
            "--gamma", value=text, allowed="FROM below TO, at most 360 deg apart", remedy="as in --gamma -180:180:5"
        )
    if not 0.0 < step <= high - low:
        raise InputError(
            "--gamma: step", value=step, allowed=f"more than 0, at most {high - low:g} deg", remedy="as in 0:90:5"
        )
    if (high - low) / step > MOST_ANGLES:
        raise InputError(
            "--gamma: step", value=step, allowed=f"{(high - low) / MOST_ANGLES:.3g} deg or more: {MOST_ANGLES} angles",
            remedy="finer angles are found about the best ones by themselves",
        )  # fmt: skip
    cells = max(1, round((high - low) / step))
    closed = high - low > 360.0 - 1e-9
    return GammaRange(math.radians(low), math.radians(high), max(2, cells if closed else cells + 1))


def parse_numbers(text: str, between: str = ",") -> tuple[float, ...] | None:
    """Finite numbers between commas, None if any is not."""
    try:
        values = tuple(float(part) for part in text.split(between))
    except ValueError:
        return None
    return values if all(map(math.isfinite, values)) else None


def parse_joint_figures(robot: Robot, text: str, option: str) -> Array:
    """Positive numbers (dof,), one for all joints or one each.

    Raises
    ------
    InputError
        Another count, or a number that is not positive.
    """
    values = parse_numbers(text)
    if values is None or len(values) not in (1, robot.dof) or not all(v > 0.0 for v in values):
        raise InputError(
            option, value=text, allowed=f"one number above 0, or {robot.dof} separated by commas", remedy="correct it"
        )
    return np.broadcast_to(np.array(values), (robot.dof,)).copy()
