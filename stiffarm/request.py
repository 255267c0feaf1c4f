"""Requests: what a capability is asked, as a dataclass, of which its command line and Python function are made.

A field is declared once, by :func:`option` or :func:`argument`, with its help. A field whose value is more than a
number, a word or a file has a :class:`Kind`, which turns the command line's text into the same value that Python
passes, and checks it. Nothing behind the command line is text that would be parsed again.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final, Protocol, cast, get_args

import numpy as np

from robots import InputError, Robot, require_one_of
from robots.arrays import Array
from robots.errors import raise_any, twice
from robots.frames import frame_mm_deg
from stiffarm.session.parsing import FRAME_FORM, LARGEST_LOAD, WRENCH_NAMES, angles_of

if TYPE_CHECKING:
    import pandas as pd

    from doe import Measurements
    from doe.absolute.readings import AbsoluteReadings
    from fem.arm import Arm

    Poses = Path | pd.DataFrame

    class Read(Protocol):
        """Readings that were read and checked before (:func:`stiffarm.read_readings`)."""

        @property
        def table(self) -> Measurements:
            """The readings."""

    Readings = Path | str | pd.DataFrame | Read
else:
    # What the command line takes of these; pandas is loaded when it is needed.
    Poses = Readings = Path

# Numbers by name, or all of them in the order of the names.
ByName = Mapping[str, float] | Sequence[float]
# One of them or several; a request holds a tuple of them.
Given = ByName | Sequence[ByName]
_OPTION: Final = "option"


@dataclass(frozen=True)
class Kind:
    """A kind of value: ``read`` makes it of the command line's text, ``checked`` tests it, ``text`` writes it.

    Both get the name of the option, for their InputError.
    """

    metavar: str | None
    read: Callable[[str, str], Any]
    checked: Callable[[Any, str], Any] = lambda value, name: value
    text: Callable[[Any], str] = str

    def of(self, text: str, name: str) -> Any:
        """The value of a text, checked."""
        return self.checked(self.read(text, name), name)


@dataclass(frozen=True)
class Option:
    """How a field of a request stands on the command line.

    ``several``: it may be given more than once, and its value is a tuple; ``spelled``: other spellings than ``--`` and
    the field's name; ``least``, ``most``: its range; ``is_common``: it is listed with what all commands have;
    ``group``: the heading of the help that it stands under.
    """

    help: str
    kind: Kind | None = None
    metavar: str | None = None
    several: bool = False
    is_argument: bool = False
    spelled: tuple[str, ...] = ()
    least: float | None = None
    most: float | None = None
    is_common: bool = False
    group: str | None = None


def option(
    help: str,
    kind: Kind | None = None,
    *,
    default: Any = None,
    several: bool = False,
    required: bool = False,
    **more: Any,
) -> Any:
    """A field that is an option, which may be left out unless ``required``; further keywords as :class:`Option`."""
    return dataclasses.field(
        default=dataclasses.MISSING if required else () if several and default is None else default,
        metadata={_OPTION: Option(help, kind, several=several, **more)},
    )


def seed() -> Any:
    """The field of the seed of random numbers, an option of the common group."""
    return option("Seed of the random numbers.", default=0, least=0, is_common=True)


def argument(help: str, kind: Kind | None = None, *, metavar: str, required: bool = False, **more: Any) -> Any:
    """A field that stands without a name, on the command line and in Python; it may be left out unless ``required``."""
    how = Option(help, kind, metavar=metavar, is_argument=True, **more)
    default: Any = dataclasses.MISSING if required else () if how.several else None
    return dataclasses.field(default=default, kw_only=False, metadata={_OPTION: how})


@dataclass(frozen=True, kw_only=True)
class Request:
    """What a capability is asked. Values are checked as they come in, whoever made them.

    One with a field ``out`` of its own is answered by what writes there itself; others get a folder of ``--out``.
    """

    def __post_init__(self) -> None:
        for name, how in options_of(type(self)).items():
            value = getattr(self, name)
            if how.several:
                value = _several(value, how)
            if how.kind is not None and value is not None:
                checked = how.kind.checked
                typed = spelled(name, how)
                value = tuple(checked(one, typed) for one in value) if how.several else checked(value, typed)
            elif value is not None:
                _check_range(value, how, spelled(name, how))
            object.__setattr__(self, name, value)

    def links(self, model: str, given: str | None) -> str | None:
        """The kind of links that the command builds the model with, where ``--links`` is ``given``."""
        return given

    def given(self, *names: str) -> list[str]:
        """Those of these fields that do not have their default, as the command line spells them."""
        defaults = {f.name: f.default for f in dataclasses.fields(self)}
        options, out = options_of(type(self)), []
        for name in names:
            value, usual = getattr(self, name), defaults[name]
            if value is not usual and (usual is None or value != usual):
                out.append(spelled(name, options[name]))
        return out

    writes_itself: ClassVar[bool] = False
    """Whether its answer writes into :attr:`folder` as it goes; else the result is written when it is there."""

    @property
    def writes_by(self) -> str | None:
        """The option that was given and writes files, so that the command needs a folder."""
        return None

    @property
    def folder(self) -> Path | None:
        """The folder of the results where ``--out`` names none."""
        return None

    def as_json(self) -> dict[str, Any]:
        """The request for run.json: numbers, texts and lists."""
        return {name: _plain(getattr(self, name)) for name in options_of(type(self))}


def options_of(request: type[Request]) -> dict[str, Option]:
    """Fields of a request by name."""
    return {f.name: f.metadata[_OPTION] for f in dataclasses.fields(request) if _OPTION in f.metadata}


def spelled(name: str, how: Option) -> str:
    """A field as the command line spells it; at the Python function it is the name of the argument again."""
    if how.is_argument:
        return how.metavar.strip("[]") if how.metavar else name
    return how.spelled[0].partition("/")[0] if how.spelled else f"--{name.replace('_', '-')}"


def _several(value: Any, how: Option) -> tuple[Any, ...]:
    """One value, or some of them, as a tuple."""
    if value is None:
        return ()
    if not isinstance(value, list | tuple | np.ndarray):
        return (value,)
    is_row = how.kind is not None and len(value) > 0 and all(isinstance(v, int | float | np.number) for v in value)
    return (value,) if is_row else tuple(value)


def _check_range(value: Any, how: Option, name: str) -> None:
    low, high = how.least, how.most
    if low is None and high is None:
        return
    good = isinstance(value, int | float) and math.isfinite(value)
    if not good or (low is not None and value < low) or (high is not None and value > high):
        ends = [f"{low:g} or more" if low is not None else "", f"up to {high:g}" if high is not None else ""]
        raise InputError(name, code="A004", value=value, allowed=", ".join(filter(None, ends)))


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


# Reading and checking of values.


def numbers_of(value: Any, name: str, allowed: str) -> tuple[float, ...]:
    """Finite numbers in a row, from a sequence, an array or one number.

    Raises
    ------
    InputError
        Anything else.
    """
    try:
        row = np.atleast_1d(np.asarray(value, dtype=np.float64))
    except (TypeError, ValueError):
        row = np.full((1, 1), np.nan)
    if row.ndim != 1 or not np.isfinite(row).all():
        raise InputError(name, code="A004", value=_typed(value), allowed=allowed)
    return tuple(row.tolist())


def _typed(value: Any) -> Any:
    """Numbers in a row as they are typed; else the value itself."""
    is_row = isinstance(value, tuple) and all(isinstance(one, float) for one in value)
    return _joined(value) if is_row else value


def _split(text: str, name: str, allowed: str, example: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise InputError(
            name, code="A004", value=text, allowed=allowed, remedy=f"write it as in {name} {example}"
        ) from None


def row(*counts: int, allowed: str, example: str, zero: bool = True) -> Kind:
    """Numbers between commas, so many of them (any where that is not said); ``zero``: all of them may be 0."""

    def checked(value: Any, name: str) -> tuple[float, ...]:
        row = numbers_of(value, name, allowed)
        if (counts and len(row) not in counts) or not (zero or any(row)):
            raise InputError(
                name, code="A004", value=_typed(value), allowed=allowed, remedy=f"write it as in {name} {example}"
            )
        return row

    metavar = "X,Y,Z" if counts == (3,) else "X,Y,Z[,A,B,C]"
    return Kind(metavar, lambda text, name: _split(text, name, allowed, example), checked, _joined)


def _joined(values: Sequence[float]) -> str:
    return ",".join(f"{v:g}" for v in values)


def _named(text: str, name: str) -> dict[str, float] | tuple[float, ...]:
    """``a=1,b=2`` by name, ``1,2`` in order; what the names may be, the arm says."""
    if "=" not in text:
        return _split(text, name, "name=value pairs separated by commas", "q2_deg=5,q3_deg=77")
    found: dict[str, float] = {}
    faults = []
    for item in text.split(","):
        key, _, number = (part.strip() for part in item.partition("="))
        if key in found:
            faults.append(
                InputError(f"{name}: {key} is given twice", code="A004", allowed="each name once", remedy="remove one")
            )
        try:
            found[key] = float(number)
        except ValueError:
            found[key] = math.nan
        if not math.isfinite(found[key]):
            faults.append(
                InputError(
                    f"{name}: {key}",
                    code="A004",
                    value=number,
                    allowed="a finite number",
                    remedy=f"write it with a decimal point and without a unit, as in {key}=5",
                )
            )
    raise_any(name, faults)
    return found


def _paired(value: ByName) -> str:
    if isinstance(value, Mapping):
        return ",".join(f"{key}={number:g}" for key, number in value.items())
    return _joined(value)


def in_order(values: Any, names: Sequence[str], name: str, unit: str = "number") -> Array:
    """The values of ``names`` (k,), 0 where one is not given; a row of numbers has them all.

    Raises
    ------
    InputError
        A name that is not one of them, a row of another length, or a value that is not finite.
    """
    if not isinstance(values, Mapping):
        row = numbers_of(values, name, f"finite numbers by name, as in {names[0]}=5")
        if len(row) != len(names):
            raise InputError(
                name,
                code="A004",
                value=f"{len(row)} numbers",
                allowed=f"{len(names)}, those of {', '.join(names)}, or by name, as in {names[0]}=5",
            )
        return np.array(row)
    for key, value in values.items():
        require_one_of(f"{name}: name", key, names, code="A004", remedy="use these names")
        numbers_of(value, f"{name}: {key}", f"a finite {unit}")
    return np.array([float(values.get(key, 0.0)) for key in names])


def pose_of(robot: Robot, value: ByName, name: str) -> Array:
    """Joint coordinates (dof,) in rad of a pose in degrees: by the model's or the controller's names, or in order.

    Raises
    ------
    InputError
        A name that the robot does not have, an angle that is no finite number, or a pose that it cannot take.
    """
    names = robot.angle_names if isinstance(value, Mapping) else robot.coordinates
    degrees = dict(zip(names, in_order(value, names, name, "number of degrees"), strict=True))
    given = {key: degrees[key] for key in (value if isinstance(value, Mapping) else names)}
    q = angles_of(robot, given, name)
    if wrong := robot.violations(q):
        raise InputError(
            f"{name}: {robot.name} cannot take this pose: {'; '.join(wrong)}",
            code="A005",
            remedy="keep the ranges named (a coordinate that is not given stands at 0)",
        )
    return np.asarray(q)


def poses_asked(robot: Robot, given: Given, table: Poses | None, what: str) -> tuple[Array, tuple[str, ...], list[str]]:
    """Poses (n, dof) rad that are given one by one or in a table, their labels, and remarks.

    Raises
    ------
    InputError
        Neither of the two or both, or a pose that the robot cannot take.
    """
    if (table is None) == (not given):
        raise InputError(
            f"{what} needs poses",
            code="A003",
            allowed="either --pose (one or more) or a table of poses",
            remedy=f"give one of the two, as in --pose {robot.coordinates[0]}=5",
        )
    if table is None:
        labels = tuple(str(i + 1) for i in range(len(given)))
        return np.stack([pose_of(robot, one, "--pose") for one in cast("Sequence[ByName]", given)]), labels, []
    from stiffarm.session.pose_tables import read_pose_table

    degrees, texts, remarks = read_pose_table(robot.coordinates, {}, table)
    q = np.radians(degrees)
    outside = np.flatnonzero(~robot.reachable(q))
    if len(outside):
        first = int(outside[0])
        raise InputError(
            f"table of poses: {len(outside)} of {len(q)} poses cannot be taken; the first is pose {texts[first]}",
            code="A005",
            value="; ".join(robot.violations(q[first])),
            remedy="correct or remove them",
        )
    return q, tuple(texts), remarks


def readings_asked(
    given: Arm, data: Readings | Sequence[Readings] | None, *, confirm_units: bool = False
) -> Measurements:
    """Readings from a table, a data frame or as they were read before, or several of them as one, each checked.

    None, or no table at all: the bundled one, which is called "bundled" among several.

    Raises
    ------
    InputError
        A table that cannot be read, or readings that no arm like this gives.
    """
    from doe.tables.joined import join

    tables = cast("list[Readings | None]", list(data) or [None] if isinstance(data, list | tuple) else [data])
    return join([_read(given, one, k, confirm_units) for k, one in enumerate(tables, start=len(tables) > 1)])


def _read(given: Arm, data: Readings | None, number: int, confirm_units: bool) -> Measurements:
    if (table := getattr(data, "table", None)) is not None:
        return cast("Measurements", table)
    from doe.tables.columns import table_of_frame
    from doe.tables.reading import measurements_of
    from stiffarm.session.reading_checks import check_readings
    from stiffarm.session.readings import BUNDLED, read_data
    from stiffarm.session.table_kinds import DEFLECTIONS, expect

    if data is None or isinstance(data, str | Path):
        file = None if data is None or str(data) == BUNDLED else Path(data)
        if file is not None:
            expect(file, DEFLECTIONS)
        found = read_data(given.robot, file)
    else:
        found = measurements_of(
            table_of_frame(cast("pd.DataFrame", data), "data frame" if number == 0 else f"data frame {number}"),
            given.robot,
        )
    check_readings(given, found, confirm_units=confirm_units)
    return found


def positions_asked(given: Arm, data: Readings | Sequence[Readings]) -> AbsoluteReadings:
    """Absolute positions of targets from tables or data frames, as one.

    Raises
    ------
    InputError
        A table that cannot be read.
    """
    from doe.absolute.table import absolute_of, joined, read_absolute
    from doe.tables.columns import table_of_frame

    return joined(
        [
            read_absolute(one, given.robot)
            if isinstance(one, str | Path)
            else absolute_of(table_of_frame(cast("pd.DataFrame", one), f"data frame {k}"), given.robot)
            for k, one in enumerate(data if isinstance(data, list | tuple) else [data], start=1)
        ]
    )


def wrench_of(value: Any, name: str) -> Array:
    """A wrench (6,) in N and N m, by name or in order, not zero.

    Raises
    ------
    InputError
        Another name, or nothing that loads the arm.
    """
    wrench = in_order(value, WRENCH_NAMES, name)
    if not 0.0 < np.abs(wrench).max() <= LARGEST_LOAD:
        raise InputError(
            name,
            code="A006",
            value=_paired(value),
            allowed=f"a force or moment that is not zero, up to {LARGEST_LOAD:g} N or N m",
            remedy="give the load in N and N m, as in fz_N=-650",
        )
    return wrench


def _frame(value: Any, name: str) -> Array:
    if np.shape(value) == (4, 4):
        return np.array(value, dtype=np.float64)
    row = numbers_of(value, name, FRAME_FORM)
    if len(row) not in (3, 6):
        raise InputError(
            name, code="A004", value=value, allowed=FRAME_FORM, remedy=f"write it as in {name} 0,0,250,0,0,0"
        )
    return frame_mm_deg(row)


def word(alias: Any) -> Kind:
    """One of the words of a ``Literal``, or of a tuple."""
    words = alias if isinstance(alias, tuple) else get_args(alias)

    def checked(value: Any, name: str) -> Any:
        require_one_of(name, value, words, code="A001", remedy="choose one of them")
        return value

    return Kind("|".join(words), lambda text, name: text, checked)


DIRECTION: Final = row(3, allowed="three finite numbers x,y,z, not all zero: base axes", example="0,0,1", zero=False)
FORCE: Final = row(
    3, allowed="three finite numbers x,y,z, not all zero: N in base axes", example="0,0,-650", zero=False
)
FRAME: Final = Kind(
    "X,Y,Z[,A,B,C]", lambda text, name: _split(text, name, FRAME_FORM, "0,0,250,0,0,0"), _frame, lambda T: str(T)
)


def _names(value: Any, name: str) -> tuple[str, ...]:
    names = tuple(part.strip() for part in value.split(",")) if isinstance(value, str) else value
    good = isinstance(names, Sequence) and all(isinstance(one, str) for one in names)
    if not good or not names or not all(names) or twice(names):
        remedy = "name at least one, each once, separated by commas"
        raise InputError(name, code="A004", value=value, allowed="names, as in j2,j3", remedy=remedy)
    return tuple(names)


# Names in one value, separated by commas; what they may be, the arm or the readings say.
NAMES: Final = Kind("NAME,...", lambda text, name: text, _names, ",".join)


def _file(value: Any, name: str) -> Path:
    path = Path(value)
    if not path.is_file():
        raise InputError(name, code="A007", value=str(path), allowed="an existing file", remedy="check the path")
    return path


FILE: Final = Kind("FILE", lambda text, name: Path(text), _file)
# Files of tables, or what Python has in their place.
READINGS: Final = Kind(
    None, lambda text, name: Path(text), lambda value, name: Path(value) if isinstance(value, str) else value
)
TABLE: Final = READINGS
ANY_PATH: Final = READINGS
# Checked against the arm's names, by `pose_of`.
POSE: Final = Kind("NAME=DEG,...", _named, lambda value, name: value, _paired)
WRENCH: Final = Kind("NAME=VALUE,...", _named, wrench_of, _paired)


def _pair(text: str, name: str) -> dict[str, str]:
    """``NAME=VALUE``; the name may have an equals sign in it, the value never has."""
    key, _, value = (part.strip() for part in text.rpartition("="))
    if not key or not value:
        raise InputError(
            name, code="A004", value=text, allowed="NAME=VALUE", remedy="put it in quotes where it has blanks"
        )
    return {key: value}


def united(some: Sequence[Mapping[str, Any]], name: str) -> dict[str, Any]:
    """What was given by name, in one or several goes.

    Raises
    ------
    InputError
        A name twice.
    """
    if again := twice([key for one in some for key in one]):
        raise InputError(f"{name}: name", code="A004", value=again[0], allowed="each name once")
    return {key: value for one in some for key, value in one.items()}


# A text by name; several of them are :func:`united`.
PAIR: Final = Kind("NAME=VALUE", _pair, text=lambda value: ",".join(f"{key}={one}" for key, one in value.items()))
# What stays as it was typed: a text, or an arm that Python gives in place of a model's name or file.
TEXT: Final = Kind(None, lambda text, name: text)


def _loads(value: Any, name: str) -> tuple[float, ...]:
    allowed = f"forces above 0 N, up to {LARGEST_LOAD:g} N" + (", or all" if name.startswith("-") else "")
    if isinstance(value, str) and value.strip() == "all":
        return ()
    loads = numbers_of(value, name, allowed) if np.size(value) else ()
    if not all(0.0 < load <= LARGEST_LOAD for load in loads):
        remedy = "write it as in 150,650"
        raise InputError(name, code="A006", value=_typed(value), allowed=allowed, remedy=remedy)
    return loads


def _height(text: str, name: str) -> float | None:
    return None if text.strip().lower() == "none" else _split(text, name, "a height in mm, or none", "0")[0]


def _finite(value: Any, name: str) -> float:
    return numbers_of(value, name, "a height in mm, or none")[0]


def _box(value: Any, name: str) -> tuple[float, ...]:
    allowed = "two opposite corners x0,y0,z0,x1,y1,z1 of a box with a volume, in mm"
    row = numbers_of(value, name, allowed)
    if len(row) != 6 or any(a == b for a, b in zip(row[:3], row[3:], strict=True)):
        remedy = f"write it as in {name} 500,-800,0:1500,800,900"
        raise InputError(name, code="A004", value=_typed(value), allowed=allowed, remedy=remedy)
    return row


# Sizes of loads in N; no size: all loads.
LOADS: Final = Kind(
    "N,...",
    lambda text, name: () if text.strip() == "all" else _split(text, name, "'all', or forces in N", "150,650"),
    _loads,
    _joined,
)
# A height in mm; None: there is no floor.
HEIGHT: Final = Kind("MM", _height, _finite, lambda value: f"{value:g}")
# A box in mm by two opposite corners, six numbers.
BOX: Final = Kind(
    "X0,Y0,Z0:X1,Y1,Z1",
    lambda text, name: _split(text.replace(":", ","), name, "two corners in mm", "500,-800,0:1500,800,900"),
    _box,
)
