"""From what a user types to numbers and arrays: lists, pairs, poses, loads, directions, frames."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Final, TypeVar

import numpy as np

from robots import InputError, Robot
from robots.arrays import Array
from robots.frames import rpy_of

if TYPE_CHECKING:
    from doe.absolute.readings import Payload

WRENCH_NAMES = ("fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm")
# Far above any load; beyond about 1e150 squares overflow.
LARGEST_LOAD = 1e9
FRAME_FORM = "x,y,z in mm, or x,y,z,a,b,c with a, b, c in deg about the fixed axes x, then y, then z"

Word = TypeVar("Word", bound=str)


def parse_word(text: str, allowed: tuple[Word, ...], option: str) -> Word:
    """One of some words."""
    for word in allowed:
        if word == text:
            return word
    raise InputError(option, code="A001", value=text, allowed=", ".join(allowed), remedy="choose one of them")


def refuse_given(options: Mapping[str, object], why_not: str, remedy: str) -> None:
    """Refuse options that were given (not None) where nothing would heed them."""
    given = [name for name, value in options.items() if value is not None]
    if given:
        raise InputError(f"{', '.join(given)}: {why_not}", code="A002", remedy=remedy)


def refuse_together(options: Mapping[str, object]) -> None:
    """Refuse more than one of some options that exclude one another."""
    given = [name for name, value in options.items() if value is not None]
    if len(given) > 1:
        raise InputError(
            f"{' and '.join(given)}: one of them at a time", code="A002", remedy=f"leave out {given[0]} or {given[-1]}"
        )


def typed_again(command: str, arguments: Iterable[object], options: Mapping[str, object]) -> str:
    """A command line to copy: what was typed of ``arguments`` and ``options``, quoted where a shell needs it."""
    words = [*command.split(), *map(str, arguments)]
    for name, value in options.items():
        if isinstance(value, bool):
            words += [name] * value
        else:
            words += [w for one in (value if isinstance(value, list) else [value]) if one for w in (name, str(one))]
    return shlex.join(words)


def parse_numbers(text: str, between: str = ",") -> tuple[float, ...] | None:
    """Finite numbers between commas, None if any is not."""
    try:
        values = tuple(float(part) for part in text.split(between))
    except ValueError:
        return None
    return values if all(map(math.isfinite, values)) else None


def parse_settings(texts: Sequence[str], option: str) -> dict[str, str]:
    """Read ``name=value`` texts, each name once; what names and values may be, the model says."""
    out: dict[str, str] = {}
    for text in texts:
        name, sign, value = (part.strip() for part in text.partition("="))
        if not (name and sign and value):
            remedy = "write a parameter, =, and its value"
            raise InputError(
                option, code="A004", value=text, allowed="NAME=VALUE, as in j2.stiffness=1.4e6", remedy=remedy
            )
        if name in out:
            raise InputError(
                f"{option}: {name} is given twice", code="A004", allowed="each name once", remedy="remove one"
            )
        out[name] = value
    return out


def angles_of(robot: Robot, values: Mapping[str, float], option: str) -> Array:
    """Coordinates (dof,) rad from angles in deg by name, all the model's or all the controller's; the rest is 0."""
    shown = () if robot.controller is None else robot.controller.names
    other = [name for name in values if name not in robot.coordinates]
    if robot.controller is None or not other:
        return np.radians([values.get(name, 0.0) for name in robot.coordinates])
    mixed = [name for name in values if name not in shown]
    if mixed:
        raise InputError(
            f"{option}: {', '.join(mixed)} beside {', '.join(other)}",
            code="A004",
            allowed=f"either the model's coordinates or the controller's angles: {', '.join(shown)}",
            remedy="give all angles in one of the two",
        )
    return np.asarray(robot.controller.model(np.radians([[values.get(name, 0.0) for name in shown]]))[0])


def tool_words(T: Array) -> str:
    """Tool frames on the flange in words: (4, 4) m, or (n, 4, 4) where tools are changed, each in its order."""
    if T.ndim == 2:
        return frame_words(T)
    return ", then ".join(dict.fromkeys(map(frame_words, T)))


def frame_words(T: Array) -> str:
    """A frame as a user would type it."""
    xyz, turn = T[:3, 3] * 1e3, np.degrees(rpy_of(T[:3, :3]))
    return ", ".join(f"{v:.6g}" for v in xyz) + " mm; " + ", ".join(f"{v + 0.0:.6g}" for v in turn.round(9)) + " deg"


# What a flange carries at most.
HEAVIEST_kg: Final = 5000.0
WIDEST_mm: Final = 5000.0


def payload_of(values: Sequence[float]) -> Payload:
    """Mass (kg), or mass and centre in the flange frame (mm).

    Raises
    ------
    InputError
        No mass, or a place that no tool has.
    """
    from doe.absolute.readings import Payload

    kg, *centre = (*values, 0.0, 0.0, 0.0) if len(values) == 1 else values
    if len(centre) != 3 or not 0.0 <= kg <= HEAVIEST_kg or max(map(abs, centre)) > WIDEST_mm:
        raise InputError(
            "--payload",
            code="A004",
            value=", ".join(f"{v:g}" for v in values),
            allowed=f"KG or KG,X,Y,Z: 0 to {HEAVIEST_kg:g} kg, its centre within {WIDEST_mm:g} mm of the flange",
            remedy="give the mass of spindle and tool, as in 25,0,0,120",
        )
    return Payload(float(kg), np.array(centre) * 1e-3)
