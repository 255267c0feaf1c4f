"""From what a user types to a plan's protocol: loads, directions, what is read."""

from __future__ import annotations

import itertools
import re

import numpy as np

from doe import Measurements
from doe.planning import protocol
from robots import InputError, ModelDescription, Robot
from robots.arrays import Array
from robots.constants import STANDARD_GRAVITY
from stiffarm.session.parsing import parse_numbers

# Loads of a first campaign, as shares of the payload's weight: lever enough, and a line to see through them.
PAYLOAD_SHARES = (0.25, 0.5, 1.0)

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_AXIS = re.compile(r"([+-]?)([xyz])")
_READ = {"x": (0,), "y": (1,), "z": (2,), "r": (3, 4, 5)}


def parse_directions(text: str) -> Array:
    """Unit vectors (d, 3) from ``-z``, ``+x,-x,+y`` or ``0,0,-1;1,0,-1``.

    Raises
    ------
    InputError
        Not a direction, a length of zero, or the same direction twice.
    """
    found: list[Array] = []
    for part in text.split(";"):
        axes = [_AXIS.fullmatch(word.strip()) for word in part.split(",")]
        if all(axes):
            found += [(-1.0 if match[1] == "-" else 1.0) * np.array(_AXES[match[2]]) + 0.0 for match in axes if match]
        else:
            found.append(_vector(part, text))
    for (i, a), (j, b) in itertools.combinations(enumerate(found), 2):
        if np.allclose(a, b, atol=1e-6):
            raise InputError(
                f"--directions: the {_ordinal(i)} and the {_ordinal(j)} are the same direction",
                code="A004",
                value=text,
                allowed="each direction once",
                remedy="remove one of the two; more readings in one direction come from --repeats and --poses",
            )
    return np.array(found)


def _vector(part: str, text: str) -> Array:
    values = np.array(parse_numbers(part) or ())
    if len(values) != 3:
        raise InputError(
            "--directions",
            code="A004",
            value=text,
            allowed="axes of the base with a sign, as in +x,-x,-z, or vectors, as in 0,0,-1;1,0,-1",
            remedy="separate axes by commas and vectors by semicolons",
        )
    if not values.any():
        raise InputError(
            "--directions: a direction of length zero",
            code="A004",
            value=text,
            allowed="vectors that are not all zero",
            remedy="say where the load pulls, as in 0,0,-1",
        )
    unit = values / np.abs(values).max()
    return np.asarray(unit / np.linalg.norm(unit))


def _ordinal(k: int) -> str:
    names = ("first", "second", "third", "fourth", "fifth", "sixth")
    return names[k] if k < len(names) else f"{k + 1}th"


def parse_read(text: str) -> tuple[int, ...]:
    """Components 0 to 5 from letters: ``z``, ``xyz``, ``xyzr`` (r: the three rotations)."""
    letters = text.strip().lower()
    if not letters or not set(letters) <= set(_READ) or len(set(letters)) < len(letters):
        raise InputError(
            "--read",
            code="A004",
            value=text,
            allowed="letters x, y, z and r (the three rotations), each once",
            remedy="write them together, as in z, xyz or xyzr",
        )
    return tuple(sorted(k for letter in letters for k in _READ[letter]))


def usual_loads(description: ModelDescription, data: Measurements | None) -> Array:
    """Force magnitudes (l,) N: those of the data, else shares of the payload's weight.

    Raises
    ------
    InputError
        Neither is known.
    """
    if data is not None:
        loads = protocol.usual_loads(data.wrench[:, :3])
        if len(loads):
            return loads
    if description.payload is None:
        raise InputError(
            f"{description.name}: no payload is known, so no load either",
            code="A006",
            allowed="--loads, or a payload in the model file",
            remedy="as in --loads 150,375,650",
        )
    rated = description.payload.si * STANDARD_GRAVITY
    return np.array([float(f"{share * rated:.2g}") for share in PAYLOAD_SHARES])


def usual_components(data: Measurements | None) -> tuple[int, ...]:
    """Components read in the data, else dz."""
    if data is None:
        return (2,)
    return tuple(int(k) for k in np.flatnonzero(data.used.any(axis=0)))


def resting_pose(robot: Robot, held_deg: dict[str, float]) -> Array:
    """Where coordinates stand that do not vary (dof,) rad: as given, else 0, else mid-range.

    Raises
    ------
    InputError
        A value out of its limits.
    """
    low, high = robot.limits.T
    q = np.where((low <= 0.0) & (high >= 0.0), 0.0, 0.5 * (low + high))
    for name, value in held_deg.items():
        k = robot.coordinate_index(name)
        if not np.degrees(low[k]) - 1e-9 <= value <= np.degrees(high[k]) + 1e-9:
            raise InputError(
                f"--hold: {name}",
                code="A005",
                value=f"{value:g}",
                allowed=f"{np.degrees(low[k]):g} to {np.degrees(high[k]):g} deg",
                remedy="keep the joint's limits",
            )
        q[k] = np.radians(value)
    return np.asarray(q)
