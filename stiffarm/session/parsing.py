"""From what a user types to numbers and arrays: lists, pairs, poses, loads, directions, frames."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Final, TypeVar

import numpy as np

from robots import InputError, Robot
from robots.arrays import Array
from robots.errors import raise_any, twice
from robots.frames import frame_mm_deg, rpy_of

if TYPE_CHECKING:
    from doe.absolute.readings import Payload

WRENCH_NAMES = ("fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm")
DISPLACEMENT_NAMES = ("dx_mm", "dy_mm", "dz_mm", "rx_mrad", "ry_mrad", "rz_mrad")
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


def parse_names(text: str | None, allowed: tuple[str, ...] | None, option: str) -> tuple[str, ...] | None:
    """Names between commas, each once, or None; ``allowed``: those that are known, None where others check that."""
    if text is None:
        return None
    names = tuple(part.strip() for part in text.split(",") if part.strip())
    known = None if allowed is None else ", ".join(allowed)
    for name in names:
        if allowed is not None and name not in allowed:
            raise InputError(
                option, code="A001", value=name, allowed=known, remedy="choose from these, separated by commas"
            )
    if not names or twice(names):
        raise InputError(
            option, code="A001", value=text, allowed=known, remedy="name at least one, each once, separated by commas"
        )
    return names


def parse_pairs(text: str, option: str, allowed: tuple[str, ...]) -> dict[str, float]:
    """Read ``name=value,name=value`` with known names and finite numbers; all faults at once."""
    out: dict[str, float] = {}
    faults = []
    if "=" not in text:
        some = ",".join(f"{name}={value.strip() or 0}" for name, value in zip(allowed, text.split(","), strict=False))
        raise InputError(
            option, code="A004", value=text, allowed="name=value pairs separated by commas", remedy=f"write {some}"
        )
    for item in text.split(","):
        name, _, number = (part.strip() for part in item.partition("="))
        if name not in allowed:
            faults.append(
                InputError(
                    f"{option}: name",
                    code="A004",
                    value=name,
                    allowed=", ".join(allowed),
                    remedy=f"write name=value pairs separated by commas, as in {allowed[0]}=5",
                )
            )
            continue
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            faults.append(
                InputError(
                    f"{option}: {name}",
                    code="A004",
                    value=number,
                    allowed="a finite number",
                    remedy=f"write it with a decimal point and without a unit, as in {name}=5",
                )
            )
        elif name in out:
            faults.append(
                InputError(
                    f"{option}: {name} is given twice", code="A004", allowed="each name once", remedy="remove one"
                )
            )
        else:
            out[name] = value
    raise_any(option, faults)
    return out


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


def parse_pose(robot: Robot, text: str) -> Array:
    """One pose (dof,) rad from ``q2_deg=5,q3real_deg=77.5``; the rest is 0. Limits are checked.

    The controller's angles may be given instead, all that are not 0 of them.
    """
    values = parse_pairs(text, "--pose", robot.angle_names)
    q = angles_of(robot, values, "--pose")
    wrong = robot.violations(q)
    if wrong:
        raise InputError(
            f"--pose {text}: {robot.name} cannot take it: {'; '.join(wrong)}",
            code="A005",
            remedy="keep the ranges named (a coordinate that is not given stands at 0)",
        )
    return np.asarray(q)


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


def parse_loads(text: str | None) -> tuple[float, ...] | None:
    """``--loads 150,650`` or ``--loads all`` (an empty tuple), or None if not given."""
    if text is None:
        return None
    if text.strip() == "all":
        return ()
    loads = parse_numbers(text)
    if loads is None or not all(0.0 < v <= LARGEST_LOAD for v in loads):
        raise InputError(
            "--loads",
            code="A006",
            value=text,
            allowed="'all', or force magnitudes greater than 0 N",
            remedy="separate them by commas, as in 150,650",
        )
    return loads


def parse_vector(text: str, option: str, unit: str) -> Array:
    """Three finite numbers (3,), not all zero.

    Raises
    ------
    InputError
        Anything else.
    """
    values = parse_numbers(text)
    if values is None or len(values) != 3 or not any(values):
        allowed = f"three finite numbers x,y,z, not all zero: {unit}"
        raise InputError(option, code="A004", value=text, allowed=allowed, remedy=f"write it as in {option} 0,0,1")
    return np.array(values)


def parse_direction(text: str, option: str = "--direction") -> tuple[float, float, float]:
    """A direction in base axes from ``0,0,-1``; its length does not matter."""
    vector = parse_vector(text, option, "a direction in base axes")
    x, y, z = (vector / np.abs(vector).max()).tolist()  # so that no square overflows later
    return x, y, z


def parse_frame(text: str, option: str) -> Array:
    """A frame (4, 4), m, from :data:`FRAME_FORM`.

    Raises
    ------
    InputError
        Neither three nor six finite numbers.
    """
    values = parse_numbers(text)
    if values is None or len(values) not in (3, 6):
        raise InputError(
            option, code="A004", value=text, allowed=FRAME_FORM, remedy=f"write it as in {option} 0,0,250,0,0,0"
        )
    return frame_mm_deg(values)


def tool_words(T: Array) -> str:
    """Tool frames on the flange in words: (4, 4) m, or (n, 4, 4) where tools are changed, each in its order."""
    if T.ndim == 2:
        return frame_words(T)
    return ", then ".join(dict.fromkeys(map(frame_words, T)))


def frame_words(T: Array) -> str:
    """A frame as a user would type it."""
    xyz, turn = T[:3, 3] * 1e3, np.degrees(rpy_of(T[:3, :3]))
    return ", ".join(f"{v:.6g}" for v in xyz) + " mm; " + ", ".join(f"{v + 0.0:.6g}" for v in turn.round(9)) + " deg"


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
            option,
            code="A004",
            value=text,
            allowed=f"one number above 0, or {robot.dof} separated by commas",
            remedy="correct it",
        )
    return np.broadcast_to(np.array(values), (robot.dof,)).copy()


# What a flange carries at most.
HEAVIEST_kg: Final = 5000.0
WIDEST_mm: Final = 5000.0


def parse_payload(text: str) -> Payload:
    """Mass and centre in the flange frame, mm.

    Raises
    ------
    InputError
        No mass, or a place that no tool has.
    """
    from doe.absolute.readings import Payload

    values = parse_numbers(text) or ()
    kg, *centre = (*values, 0.0, 0.0, 0.0) if len(values) == 1 else values or (-1.0,)
    if len(centre) != 3 or not 0.0 <= kg <= HEAVIEST_kg or max(map(abs, centre)) > WIDEST_mm:
        raise InputError(
            "--payload",
            code="A004",
            value=text,
            allowed=f"KG or KG,X,Y,Z: 0 to {HEAVIEST_kg:g} kg, its centre within {WIDEST_mm:g} mm of the flange",
            remedy="give the mass of spindle and tool, as in 25,0,0,120",
        )
    return Payload(float(kg), np.array(centre) * 1e-3)
