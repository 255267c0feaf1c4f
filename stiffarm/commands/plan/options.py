"""From what a user types to a plan's protocol: loads, directions, what is read, where the arm must not be."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence

import numpy as np

from doe import Measurements
from doe.planning.pose_designs import Zone
from meshes.sections import section_dimensions
from robots import InputError, ModelDescription, Robot
from robots.arrays import Array
from robots.constants import STANDARD_GRAVITY
from stiffarm.session.parsing import LARGEST_LOAD, parse_numbers

# Loads of a first campaign, as shares of the payload's weight: lever enough, and a line to see through them.
PAYLOAD_SHARES = (0.25, 0.5, 1.0)
# What wrist and base keep from each other beyond their casings, m.
MARGIN = 0.05
# A table may hold a measured force for each reading; a plan is made for a few nominal ones.
MOST_LOADS, MOST_DIRECTIONS = 5, 6
DOWN = (0.0, 0.0, -1.0)

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
            value=text,
            allowed="axes of the base with a sign, as in +x,-x,-z, or vectors, as in 0,0,-1;1,0,-1",
            remedy="separate axes by commas and vectors by semicolons",
        )
    if not values.any():
        raise InputError(
            "--directions: a direction of length zero",
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
            value=text,
            allowed="letters x, y, z and r (the three rotations), each once",
            remedy="write them together, as in z, xyz or xyzr",
        )
    return tuple(sorted(k for letter in letters for k in _READ[letter]))


def parse_zone(description: ModelDescription, floor: str, boxes: Sequence[str], clearance: float | None) -> Zone:
    """Where the arm must not be: below ``floor`` (mm or ``none``), inside boxes ``x0,y0,z0:x1,y1,z1`` (mm).

    ``clearance`` (mm) of wrist and tool from base and upper arm; None: what the casings and a margin need.
    """
    if clearance is not None and not 0.0 <= clearance < 1e4:
        raise InputError("--clearance-mm", value=clearance, allowed="0 (no test) to 10000", remedy="give mm")
    own = usual_clearance(description) if clearance is None else 1e-3 * clearance
    height = () if floor.strip().lower() == "none" else parse_numbers(floor)
    if height is None or len(height) > 1:
        raise InputError(
            "--floor-mm", value=floor, allowed="a height in mm, or none", remedy="as in --floor-mm 0"
        )  # fmt: skip
    return Zone(height[0] * 1e-3 if height else None, tuple(_box(text) for text in boxes), own)


def usual_clearance(description: ModelDescription) -> float:
    """Distance (m) of the wrist's line from that of base and upper arm: half of both casings and a margin."""
    bodies = ["base", *[joint.name for joint in description.joint]]

    def half(wanted: set[str]) -> float:
        links = [link for link in description.link if link.body in wanted]
        return max((0.5 * float(section_dimensions(link.section)[:-1].max()) for link in links), default=0.05)

    return half(set(bodies[:3])) + half({bodies[-1]}) + MARGIN


def _box(text: str) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    corners = [parse_numbers(corner) or () for corner in text.split(":")]
    if [len(corner) for corner in corners] != [3, 3]:
        raise InputError("--keep-out", value=text, allowed="two corners x0,y0,z0:x1,y1,z1 in mm",
                         remedy="as in --keep-out 500,-800,0:1500,800,900")  # fmt: skip
    low, high = np.sort(1e-3 * np.array(corners), axis=0)
    if not (low < high).all():
        raise InputError("--keep-out", value=text, allowed="a box with a volume", remedy="give opposite corners")
    (x0, y0, z0), (x1, y1, z1) = low.tolist(), high.tolist()
    return (x0, y0, z0), (x1, y1, z1)


def usual_loads(description: ModelDescription, data: Measurements | None) -> Array:
    """Force magnitudes (l,) N: those of the data, else shares of the payload's weight.

    Raises
    ------
    InputError
        Neither is known.
    """
    if data is not None:
        loads = np.unique([float(f"{v:.3g}") for v in data.loads_N if v > 0.0])
        if len(loads) > MOST_LOADS:
            loads = loads[np.unique([0, len(loads) // 2, len(loads) - 1])]
        if len(loads):
            return loads
    rated = rated_load(description, None, "--loads", "as in --loads 150,375,650")
    return np.array([float(f"{share * rated:.2g}") for share in PAYLOAD_SHARES])


def rated_load(description: ModelDescription, given: float | None, option: str, remedy: str) -> float:
    """Rated load in N: as given, else the payload's weight; without either an InputError names ``option``."""
    if given is not None:
        if not 0.0 < given <= LARGEST_LOAD:
            raise InputError(option, value=given, allowed=f"more than 0, at most {LARGEST_LOAD:g} N", remedy=remedy)
        return given
    if description.payload is None:
        raise InputError(
            f"{description.name}: no payload is known, so no load either",
            allowed=f"{option}, or a payload in the model file",
            remedy=remedy,
        )
    return description.payload.si * STANDARD_GRAVITY


def usual_directions(data: Measurements | None) -> Array:
    """Directions (d, 3): those of the data, of many the axes that they are nearest to; without data down."""
    if data is not None and (data.loads_N > 0.0).any():
        force = data.wrench[data.loads_N > 0.0, :3]
        unit = np.unique(np.round(force / np.linalg.norm(force, axis=1, keepdims=True), 3), axis=0) + 0.0
        if len(unit) <= MOST_DIRECTIONS:
            return np.asarray(unit / np.linalg.norm(unit, axis=1, keepdims=True))
        main = np.abs(unit).argmax(axis=1)
        nearest = np.zeros_like(unit)
        nearest[np.arange(len(unit)), main] = np.sign(unit[np.arange(len(unit)), main])
        return np.unique(nearest, axis=0)
    return np.array([DOWN])


def usual_components(data: Measurements | None) -> tuple[int, ...]:
    """Components read in the data, else dz."""
    if data is None:
        return (2,)
    return tuple(int(k) for k in np.flatnonzero(data.used.any(axis=0)))


def usual_point(data: Measurements | None) -> tuple[float, float, float] | None:
    """The point of its own, m in the flange frame, that most readings of the data have; None for the tool point."""
    if data is None:
        return None
    points, count = np.unique(data.point, axis=0, return_counts=True, equal_nan=True)
    most = points[int(np.argmax(count))]
    x, y, z = most.tolist()
    return None if np.isnan(most).any() else (x, y, z)


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
                value=f"{value:g}",
                allowed=f"{np.degrees(low[k]):g} to {np.degrees(high[k]):g} deg",
                remedy="keep the joint's limits",
            )
        q[k] = np.radians(value)
    return np.asarray(q)
