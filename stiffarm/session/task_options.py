"""What users type for machining tasks: frames, directions, ranges of gamma, forces; and the options that take them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from robots import InputError
from robots.arrays import Array, finite
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
CellOpt = Annotated[
    Path | None,
    typer.Option(
        "--cell",
        metavar="CELL.toml",
        help="Cell file (TOML): tool, part, fixtures, floor, linear axes and joint speeds.",
    ),
]

# First value, last value and step, or one value.
Range = float | tuple[float, float, float]


def parse_range(text: str, option: str, unit: str = "mm", example: str = "-600:600:25") -> Range:
    """A range from ``-600:600:25``, or one number.

    Raises
    ------
    InputError
        Anything else.
    """
    values = parse_numbers(text, ":")
    if values is None or len(values) not in (1, 3):
        raise InputError(
            option,
            code="A004",
            value=text,
            allowed=f"FROM:TO:STEP or one number, {unit}",
            remedy=f"write it as in {option} {example}",
        )
    return values[0] if len(values) == 1 else (values[0], values[1], values[2])


def values_of(given: Range, option: str, unit: str = "mm", example: str = "-600:600:25") -> Array:
    """Values (n,) of a range.

    Raises
    ------
    InputError
        A range that does not ascend or is no whole number of steps, too many values.
    """
    numbers = finite(option.lstrip("-"), np.atleast_1d(given), ("n",), unit)
    if len(numbers) == 1:
        return numbers
    low, high, step = numbers.tolist() if len(numbers) == 3 else (0.0, 0.0, 0.0)
    count = (high - low) / step if step > 0.0 else 0.0
    if not 1.0 - UNEVEN <= count <= MOST_VALUES or abs(count - round(count)) > UNEVEN * max(count, 1.0):
        raise InputError(
            option,
            code="A004",
            value=":".join(f"{v:g}" for v in numbers),
            allowed=f"FROM:TO:STEP or one number, {unit}, FROM below TO, a whole number of steps between them",
            remedy=f"write it as in {option} {example}",
        )
    return np.linspace(low, high, round(count) + 1)


def gammas_of(given: Range | Sequence[float]) -> GammaRange | float:
    """A range of gamma, or one angle (rad), from deg.

    Raises
    ------
    InputError
        An empty range, a step that is not positive or leaves fewer than two angles.
    """
    from machining import GammaRange

    numbers = finite("gamma", np.atleast_1d(given), ("n",), "deg").tolist()
    if len(numbers) == 1:
        return math.radians(numbers[0])
    low, high, step = numbers if len(numbers) == 3 else (0.0, 0.0, 0.0)
    if not (high > low and high - low <= 360.0 + 1e-9):
        raise InputError(
            "--gamma",
            code="A004",
            value=":".join(f"{v:g}" for v in numbers),
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
