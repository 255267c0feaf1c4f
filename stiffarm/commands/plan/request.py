"""What is asked of a plan, and what stands for what is not said."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from doe import Measurements
from doe.absolute.campaign import Target, Wanted
from doe.absolute.readings import Payload
from doe.planning import protocol
from doe.planning.optimal_choice import Criterion
from doe.planning.pose_designs import METHODS, Method
from doe.planning.zones import Zone
from fem.arm import Arm
from robots import InputError, ModelDescription, Robot, require_one_of
from robots.arrays import Array
from robots.constants import STANDARD_GRAVITY
from robots.quantities import rounded_all
from stiffarm.request import (
    BOX,
    HEIGHT,
    LOADS,
    NAMES,
    POSE,
    READINGS,
    ByName,
    Kind,
    Readings,
    Request,
    argument,
    numbers_of,
    option,
    seed,
    word,
)
from stiffarm.session.parsing import HEAVIEST_kg, WIDEST_mm, parse_numbers
from stiffarm.session.zones import zone_of

# Loads of a first campaign, as shares of the payload's weight: lever enough, and a line to see through them.
PAYLOAD_SHARES = (0.25, 0.5, 1.0)
FARTHEST_mm: Final = 100_000.0
_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_AXIS = re.compile(r"([+-]?)([xyz])")
_READ = {"x": (0,), "y": (1,), "z": (2,), "r": (3, 4, 5)}


def directions_of(given: Any, name: str = "--directions") -> Array:
    """Unit vectors (d, 3) from ``-z``, ``+x,-x,+y`` or ``0,0,-1;1,0,-1``, from such words or from vectors.

    Raises
    ------
    InputError
        Not a direction, a length of zero, or the same direction twice.
    """
    if isinstance(given, str):
        given = given.split(";")
    elif np.ndim(given) == 1 and not any(isinstance(one, str) for one in given):
        given = [given]
    found: list[Array] = []
    for part in given:
        axes = [_AXIS.fullmatch(one.strip()) for one in part.split(",")] if isinstance(part, str) else [None]
        if all(axes):
            found += [(-1.0 if match[1] == "-" else 1.0) * np.array(_AXES[match[2]]) + 0.0 for match in axes if match]
        else:
            found.append(_vector(part, given, name))
    for (i, a), (j, b) in itertools.combinations(enumerate(found, start=1), 2):
        if np.allclose(a, b, atol=1e-6):
            raise InputError(
                f"{name}: number {i} and number {j} are the same direction",
                code="A004",
                value=given,
                allowed="each direction once",
                remedy="remove one of the two; more readings in one direction come from --repeats and --poses",
            )
    return np.array(found)


def _vector(part: Any, given: Any, name: str) -> Array:
    values = np.array((parse_numbers(part) if isinstance(part, str) else numbers_of(part, name, "directions")) or ())
    if len(values) != 3 or not values.any():
        raise InputError(
            name,
            code="A004",
            value=given,
            allowed="axes of the base with a sign, as in +x,-x,-z, or vectors that are not zero, as in 0,0,-1;1,0,-1",
            remedy="say where the load pulls; separate axes by commas and vectors by semicolons",
        )
    unit = values / np.abs(values).max()
    return np.asarray(unit / np.linalg.norm(unit))


def _letters(value: Any, name: str) -> str:
    letters = str(value).strip().lower()
    if not letters or not set(letters) <= set(_READ) or len(set(letters)) < len(letters):
        raise InputError(
            name,
            code="A004",
            value=value,
            allowed="letters x, y, z and r (the three rotations), each once",
            remedy="write them together, as in z, xyz or xyzr",
        )
    return letters


def components_of(letters: str) -> tuple[int, ...]:
    """Components 0 to 5 of letters: ``z``, ``xyz``, ``xyzr`` (r: the three rotations)."""
    return tuple(sorted(k for letter in letters for k in _READ[letter]))


def _positive(value: Any, name: str) -> float:
    (number, *more) = numbers_of(value, name, "a number")
    if more or not 0.0 < number <= 1e3:
        allowed = "more than 0, at most 1000"
        raise InputError(name, code="C006", value=number, allowed=allowed, remedy="give the gauge's resolution")
    return number


def _point(value: Any, name: str) -> tuple[float, ...]:
    allowed = "X,Y,Z in mm, the arm's base frame"
    row = numbers_of(value, name, allowed)
    if len(row) != 3 or max(map(abs, row)) > FARTHEST_mm:
        raise InputError(name, code="A004", value=value, allowed=allowed, remedy=f"as in {name} 3000,500,1200")
    return row


def _payload(value: Any, name: str) -> tuple[float, ...]:
    allowed = f"KG or KG,X,Y,Z: 0 to {HEAVIEST_kg:g} kg, its centre within {WIDEST_mm:g} mm of the flange"
    row = numbers_of(value, name, allowed)
    if len(row) not in (1, 4) or not 0.0 <= row[0] <= HEAVIEST_kg or max(map(abs, row[1:]), default=0.0) > WIDEST_mm:
        remedy = "give the mass of spindle and tool, as in 25,0,0,120"
        raise InputError(name, code="A004", value=value, allowed=allowed, remedy=remedy)
    return row


def _read_target(text: str, _: str) -> Any:
    label, _, rest = text.partition(":")
    return {label: parse_numbers(rest) or ()}


def _targets(value: Any, name: str) -> Mapping[str, tuple[float, ...]]:
    if not isinstance(value, Mapping):
        raise InputError(name, code="A004", value=value, allowed="positions in mm by name", remedy="name each target")
    out = {}
    for label, at in value.items():
        row = numbers_of(at, name, "positions in mm") if np.size(at) else ()
        good = re.fullmatch(r"[\w-]{1,40}", str(label)) and len(row) in (3, 6) and max(map(abs, row[:3])) <= FARTHEST_mm
        if not good or (len(row) == 6 and not any(row[3:])):
            raise InputError(
                name,
                code="A004",
                value=f"{label}:{','.join(f'{v:g}' for v in row)}",
                allowed="NAME:X,Y,Z or NAME:X,Y,Z,DX,DY,DZ: mm in the flange frame, and a direction that is not 0,0,0",
                remedy=f"write it as in {name} ball:0,80,50 or {name} srm1:0,80,50,0,0,1",
            )
        out[label] = row
    return out


def _numbers(text: str, _: str) -> Any:
    """Numbers between commas; other text is refused by what checks them."""
    return parse_numbers(text) or text


def _row(values: Sequence[float]) -> str:
    return ",".join(f"{v:g}" for v in values)


DIRECTIONS: Final = Kind("DIRECTION,...", lambda text, _: text, directions_of)
READ: Final = Kind("xyzr", lambda text, _: text, _letters)
GAUGE: Final = Kind("NUMBER", _numbers, _positive, lambda value: f"{value:g}")
TRACKER: Final = Kind("X,Y,Z", _numbers, _point, _row)
TARGET: Final = Kind("NAME:X,Y,Z[,DX,DY,DZ]", _read_target, _targets)
PAYLOAD: Final = Kind("KG[,X,Y,Z]", _numbers, _payload, _row)
# What each of the other tasks has no use for.
OF_POSITIONS: Final = ("tracker", "target", "payload")
NOT_OF_POSITIONS: Final = ("data", "directions", "loads", "read", "vary", "hold", "unloading")


@dataclass(frozen=True, kw_only=True)
class PlanRequest(Request):
    """Choose what to measure next and write a sheet to fill in.

    Chooses poses, loads and load directions; the filled-in sheet is read back by calibrate and diagnose.

    Examples
    --------
    >>> import stiffarm as sa
    >>> found = sa.plan("xr701", poses=2, free=["j2.stiffness", "j3.stiffness"], candidates=50)
    >>> len(found.to_frame())
    2
    """

    data: Readings | None = argument(
        "Measurement table (CSV/XLSX). Default: the robot's bundled table, if there is one.", READINGS, metavar="[DATA]"
    )
    poses: int | None = option("Number of set-ups to choose; a set-up is a pose with a load direction.", least=1)
    design_only: int | None = option(
        "Instead of --poses: plan this many poses straight from --design, without choosing.", least=1
    )
    positions: int | None = option(
        "Instead of --poses: choose this many poses to read targets at with a tracker, for a calibration from "
        "positions.",
        least=4,
        most=1000,
    )
    tracker: Sequence[float] | None = option(
        "With --positions: position of the tracker in the arm's base frame, in mm.", TRACKER
    )
    target: Mapping[str, Sequence[float]] | Sequence[Mapping[str, Sequence[float]]] = option(
        "With --positions: a target in the flange frame, in mm, and the direction in which it faces. May be repeated.",
        TARGET,
        several=True,
    )
    payload: Sequence[float] | float | None = option(
        "With --positions: what the flange carries: mass in kg and its centre in the flange frame, in mm.", PAYLOAD
    )
    without_data: bool = option(
        "Plan from scratch; ignore all existing readings, including bundled ones.", default=False
    )
    free: Sequence[str] | None = option(
        "Parameters to identify, separated by commas, as in j2.stiffness,base.rx. Default: the joint stiffnesses that "
        "the readings can show.",
        NAMES,
    )
    criterion: Criterion = option(
        "Design criterion: D (all parameters jointly), A (their mean variance) or I (prediction variance).",
        word(Criterion),
        default="D",
    )
    loads: Sequence[float] | None = option(
        "Loads, in N, separated by commas, as in 150,650. Default: those of the readings, otherwise 1/4, 1/2 and all "
        "of the payload.",
        LOADS,
    )
    directions: str | Sequence[str] | Sequence[Sequence[float]] | Array | None = option(
        "Load directions in base axes, as in +x,-x,-z or 0,0,-1;1,0,-1. Default: those of the readings (if there are "
        "many, the axes nearest to them), otherwise -z.",
        DIRECTIONS,
    )
    read: str | None = option(
        "Components to read: z, xyz or xyzr (r: the three rotations). Default: those of the readings, otherwise z.",
        READ,
    )
    repeats: int = option("Number of readings at each load.", default=3, least=1, most=100)
    unloading: bool = option("Read during unloading too.", default=False)
    candidates: int = option("Number of candidate poses to choose from.", default=1500, least=1, most=20_000)
    design: Method = option(f"Design of the candidate poses: {', '.join(METHODS)}.", word(Method), default="sobol")
    levels: int = option("Number of levels of a full factorial design.", default=3, least=2, most=50)
    vary: Sequence[str] | None = option(
        "Joint coordinates to vary, separated by commas, as in q2_deg,q4_deg. Default: all that matter.", NAMES
    )
    hold: ByName | None = option(
        "Values of the other joint coordinates in deg, as in q1_deg=30. Default: 0, or mid-range if 0 is out of range.",
        POSE,
    )
    floor_mm: float | None = option(
        "Height of the floor in mm: no part of the arm may be below it; or none.", HEIGHT, default=0.0
    )
    keep_out: Sequence[float] | Sequence[Sequence[float]] = option(
        "Box that the arm must keep out of, x0,y0,z0:x1,y1,z1, in mm. May be repeated.", BOX, several=True
    )
    clearance_mm: float | None = option(
        "Distance of wrist and tool from base and upper arm, in mm; 0 for no limit. Default: what the casings need.",
        least=0.0,
        most=1e4,
    )
    random_order: bool = option(
        "Randomise the order of the set-ups, against drift. Default: ordered for a short path.", default=False
    )
    gauge_mm: float = option("Smallest standard deviation of a displacement reading, in mm.", GAUGE, default=0.01)
    gauge_mrad: float = option("Smallest standard deviation of a rotation reading, in mrad.", GAUGE, default=0.01)
    confirm_units: bool = option(
        "Accept the table although its values look like other units; use it after checking them.", default=False
    )
    seed: int = seed()

    @property
    def count(self) -> int:
        """Set-ups to choose, or poses of a plain design."""
        return self.design_only or self.poses or 0

    @property
    def is_plain(self) -> bool:
        """Whether the poses of a design are taken as they are."""
        return self.design_only is not None

    @property
    def gauge(self) -> tuple[float, float]:
        """Smallest standard deviations, m and rad."""
        return 1e-3 * self.gauge_mm, 1e-3 * self.gauge_mrad

    def zone(self, given: Arm) -> Zone:
        """Where the arm must not be."""
        return zone_of(given.description, self.floor_mm, self.keep_out, self.clearance_mm)  # type: ignore[arg-type]

    def check_task(self) -> None:
        """Raise InputError unless it is one of the three tasks, with the options that go with it."""
        tasks = self.given("poses", "design_only", "positions")
        if len(tasks) != 1:
            raise InputError(
                "plan",
                code="A003",
                value=" with ".join(tasks) or "no task",
                allowed="one of --poses N, --design-only N, --positions N",
                remedy="say how many set-ups to choose, as in --poses 6",
            )
        is_other = self.positions is None
        if wrong := self.given(*(OF_POSITIONS if is_other else NOT_OF_POSITIONS)):
            why = "only with --positions" if is_other else "no option of --positions"
            raise InputError(f"{', '.join(wrong)}: {why}", code="A002", remedy="leave it out")

    def campaign(self, given: Arm) -> Wanted:
        """What is asked of a campaign of positions.

        Raises
        ------
        InputError
            No tracker, no target, or two of the same name.
        """
        targets = [(label, np.array(row)) for one in self.target for label, row in one.items()]  # type: ignore[union-attr]
        names = [label for label, _ in targets]
        if not names or len(set(names)) != len(names):
            raise InputError(
                "--target",
                code="A004",
                value=", ".join(names) or "none",
                allowed="one or more, each name once",
                remedy="write it as in --target ball:0,80,50",
            )
        if self.tracker is None:
            allowed = "X,Y,Z in mm, the arm's base frame"
            remedy = "say about where it stands, as in --tracker 3000,500,1200"
            raise InputError("--tracker", code="A004", value="none", allowed=allowed, remedy=remedy)
        carried: Any = self.payload
        return Wanted(
            self.positions or 0,
            tuple(Target(label, 1e-3 * at[:3], at[3:] if len(at) == 6 else None) for label, at in targets),
            1e-3 * np.array(self.tracker),
            free=None if self.free is None else tuple(self.free),
            sigma=self.gauge[0],
            candidates=self.candidates,
            payload=None if carried is None else Payload(carried[0], 1e-3 * np.array(carried[1:] or (0.0, 0.0, 0.0))),
            zone=self.zone(given),
            seed=self.seed,
        )


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
    return np.array(rounded_all((share * rated for share in PAYLOAD_SHARES), 2), dtype=np.float64)


def usual_components(data: Measurements | None) -> tuple[int, ...]:
    """Components read in the data, else dz."""
    if data is None:
        return (2,)
    return tuple(int(k) for k in np.flatnonzero(data.used.any(axis=0)))


def resting_pose(robot: Robot, held_deg: Mapping[str, float]) -> Array:
    """Where coordinates stand that do not vary (dof,) rad: as given, else 0, else mid-range.

    Raises
    ------
    InputError
        A value out of its limits.
    """
    low, high = robot.limits.T
    q = np.where((low <= 0.0) & (high >= 0.0), 0.0, 0.5 * (low + high))
    for name, value in held_deg.items():
        require_one_of("--hold: name", name, robot.coordinates, code="A004", remedy="use these names")
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
