"""What users type for machining tasks: frames, directions, ranges of gamma, forces; and the options that take them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from robots import InputError
from robots.arrays import Array
from stiffarm.session.parsing import parse_numbers

if TYPE_CHECKING:
    from machining import GammaRange

# Angles gamma of a range at most.
MOST_ANGLES = 1440
# Share of a step by which a range may miss a whole number of steps: rounding of decimals.
UNEVEN = 1e-6
# Largest number of values along one axis: far beyond what a map can hold.
MOST_VALUES = 100_000

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


def parse_values(text: str, option: str, unit: str = "mm", example: str = "-600:600:25") -> Array:
    """Values (n,) from ``-600:600:25`` or ``486``.

    Raises
    ------
    InputError
        Not numbers, a range that does not ascend or is no whole number of steps, too many values.
    """
    values = parse_numbers(text, ":")
    if values is not None and len(values) == 1:
        return np.array(values)
    low, high, step = values if values is not None and len(values) == 3 else (0.0, 0.0, 0.0)
    count = (high - low) / step if step > 0.0 else 0.0
    if not 1.0 - UNEVEN <= count <= MOST_VALUES or abs(count - round(count)) > UNEVEN * max(count, 1.0):
        raise InputError(
            option,
            code="A004",
            value=text,
            allowed=f"FROM:TO:STEP or one number, {unit}, FROM below TO, a whole number of steps between them",
            remedy=f"write it as in {option} {example}",
        )
    return np.linspace(low, high, round(count) + 1)


def parse_gammas(text: str) -> GammaRange | float:
    """A range of gamma from ``-180:180:5``, or one angle (rad) from ``30``; deg.

    Raises
    ------
    InputError
        Not numbers, an empty range, a step that is not positive or leaves fewer than two angles.
    """
    from machining import GammaRange

    values = parse_numbers(text, ":")
    if values is None or len(values) not in (1, 3):
        raise InputError(
            "--gamma",
            code="A004",
            value=text,
            allowed="one angle, or FROM:TO:STEP in deg",
            remedy="as in --gamma -180:180:5",
        )
    if len(values) == 1:
        return math.radians(values[0])
    low, high, step = values
    if not (high > low and high - low <= 360.0 + 1e-9):
        raise InputError(
            "--gamma",
            code="A004",
            value=text,
            allowed="FROM below TO, at most 360 deg apart",
            remedy="as in --gamma -180:180:5",
        )
    if not 0.0 < step <= high - low:
        raise InputError(
            "--gamma: step",
            code="A004",
            value=step,
            allowed=f"more than 0, at most {high - low:g} deg",
            remedy="as in 0:90:5",
        )
    if (high - low) / step > MOST_ANGLES:
        raise InputError(
            "--gamma: step",
            code="A004",
            value=step,
            allowed=f"{(high - low) / MOST_ANGLES:.3g} deg or more: {MOST_ANGLES} angles",
            remedy="finer angles are found about the best ones by themselves",
        )
    return GammaRange.of_degrees(low, high, step)
