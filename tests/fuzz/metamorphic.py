"""Changes of a table that must not matter: the same springs, intervals, verdicts and simulated readings come out.

Order of rows and columns, labels, separators, workbooks, whole turns of joints, load and deflection scaled together,
repeats split into two tables. Each check compares with the plain table; a tolerance has its reason beside it.
"""

from __future__ import annotations

import csv
import io
import re
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

import doe
from doe import bundled_data, read_measurements
from doe.certainty.uncertainty import certainty
from doe.tables.joined import join
from doe.tables.loaded import simulate
from doe.tables.measurements import Measurements
from fem import deflection
from fem.arm import Arm
from robots import Robot
from stiffarm.commands.calibrate import step as calibrating
from stiffarm.commands.calibrate.command import CalibrateRequest, plan
from stiffarm.commands.diagnose import step as diagnosing
from stiffarm.commands.diagnose.command import DiagnoseRequest
from stiffarm.session.inputs import read_model
from stiffarm.session.readings import read_scheme

Table = list[list[str]]

# Springs and ends of intervals: the optimiser stops where a step changes ln k by less than about 1e-8, and the search
# for an interval's end where it is within 1e-6 of it.
SPRINGS, ENDS = 1e-6, 1e-4
# Simulated readings are sums of a few hundred products.
SIMULATED = 1e-12


@dataclass(frozen=True)
class Answer:
    """What one engine said of a table: numbers by name, and words."""

    numbers: dict[str, float]
    words: tuple[str, ...]


# --- engines ---------------------------------------------------------------------------------------------------------


@cache
def arm(name: str) -> Arm:
    """The bundled arm with beams, parallelogram and all; the KR60 with springs of its class."""
    return read_model(name, "beam", None)


def staged(tables: list[Measurements]) -> Answer:
    """The published scheme."""
    given = arm("xr701")
    scheme = read_scheme(given.robot, None)
    found = calibrating.calibrate(given, join(tables), calibrating.Request(scheme, scheme.loads_N))
    springs = {
        # A whole turn farther is the same place. The law between the points is of the coordinate, and no period is
        # assumed of it: what it predicts of a pose left out may differ.
        f"{joint} at {np.round(np.degrees(at) % 360.0, 6).tolist()}": float(k)
        for study in found.found.studies
        for joint, points in study.points.items()
        for at, k in zip(points.angles, points.stiffness, strict=True)
    }
    return Answer(springs | {"rms_mm": found.found.rms_mm, "left out": found.left_out_rms_mm}, found.remarks)


def free(tables: list[Measurements], name: str, joints: tuple[str, ...]) -> Answer:
    """Springs of joints set free at once, with their intervals."""
    given = arm(name)
    scheme = Path(doe.__file__).parent / "schemes" / "xr701.toml" if name == "xr701" else None
    data = join(tables)
    asked = CalibrateRequest(joints=joints, loads=(), scheme_file=scheme)
    found = calibrating.calibrate(given, data, plan(given, data, asked, staged=False))
    estimates = certainty(found.stages[0].result.estimate).estimates
    numbers = {"rms_mm": found.found.rms_mm, "left out": found.left_out_rms_mm}
    for e in estimates:
        numbers |= {
            e.parameter.name: e.value,
            f"{e.parameter.name} low": e.interval[0],
            f"{e.parameter.name} high": e.interval[1],
        }
    return Answer(numbers, tuple(e.status for e in estimates))


def diagnosed(tables: list[Measurements]) -> Answer:
    """The verdict of a diagnosis, and what it found."""
    found = diagnosing.diagnose(arm("xr701"), join(tables), DiagnoseRequest(next_poses=0)).found
    # One more than a probability, so that a share of it is a share of all: pages show them in percent.
    probable = {h.code: 1.0 + h.probability for h in found.rankings[0].hypotheses}
    return Answer(probable, (found.verdict, *(e.code for e in found.effects)))


def simulated(tables: list[Measurements]) -> Answer:
    """Each reading simulated, by its label and load."""
    data = join(tables)
    moved = simulate(arm("xr701").model, data)
    return Answer(
        {
            f"{pose} {load:.6g} N, {k}": float(v)
            for pose, load, row in zip(data.pose, data.loads_N, moved, strict=True)
            for k, v in enumerate(row)
        },
        (),
    )


# --- tables ----------------------------------------------------------------------------------------------------------


@cache
def published() -> tuple[tuple[str, ...], ...]:
    """The bundled table as cells."""
    text = bundled_data("xr701").read_text(encoding="utf-8")
    return tuple(tuple(row) for row in csv.reader(io.StringIO(text)))


@cache
def repeated() -> tuple[tuple[str, ...], ...]:
    """A made-up table of the KR60: ten poses, two directions, two repeats with noise."""
    given = arm("kr60-3")
    robot = given.robot
    model = given.model.with_springs(dict.fromkeys(robot.joint_names, 1e6))
    rng = np.random.default_rng(3)
    low, high = robot.limits.T
    rows: list[tuple[str, ...]] = [
        ("pose", "repeat", *robot.coordinates, "fx_N", "fy_N", "fz_N", "dx_mm", "dy_mm", "dz_mm")
    ]
    for k, q in enumerate(rng.uniform(0.5 * low, 0.5 * high, (10, len(low)))):
        for force in ((0.0, 0.0, -600.0), (0.0, 400.0, 0.0)):
            moved = deflection(model, q[None], np.array([[*force, 0.0, 0.0, 0.0]]))[0, :3] * 1e3
            for repeat in (1, 2):
                read = moved + 0.01 * rng.normal(size=3)
                rows.append(
                    (
                        f"P{k}",
                        str(repeat),
                        *(f"{v:.4f}" for v in np.degrees(q)),
                        *(f"{f:g}" for f in force),
                        *(f"{v:.4f}" for v in read),
                    )
                )
    return tuple(rows)


def read(robot: Robot, text: str, name: str = "table.csv") -> Measurements:
    """A table as a command reads it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_text(text, encoding="utf-8")
        return read_measurements(path, robot)


def text_of(rows: Table, separator: str = ",") -> str:
    """The table as a file."""
    stream = io.StringIO()
    csv.writer(stream, delimiter=separator, lineterminator="\n").writerows(rows)
    return stream.getvalue()


def _workbook(robot: Robot, rows: Table) -> Measurements:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table.xlsx"
        pd.read_csv(io.StringIO(text_of(rows))).to_excel(path, index=False)
        return read_measurements(path, robot)


# --- changes ---------------------------------------------------------------------------------------------------------


def _one(change: Callable[[Table], Table], separator: str = ",") -> Callable[[Robot, Table], list[Measurements]]:
    return lambda robot, rows: [read(robot, text_of(change(rows), separator))]


def _as_is(rows: Table) -> Table:
    return rows


def _renamed(rows: Table) -> Table:
    """Other labels in another alphabetical order."""
    return _mapped(rows, "pose", lambda cell: f"{cell[::-1]} (ä)")


def _rows(rows: Table) -> Table:
    order = np.random.default_rng(5).permutation(len(rows) - 1)
    return [rows[0], *(rows[1 + i] for i in order)]


def _backwards(rows: Table) -> Table:
    return [rows[0], *rows[:0:-1]]


def _columns(rows: Table) -> Table:
    order = np.random.default_rng(5).permutation(len(rows[0]))
    return [[row[k] for k in order] for row in rows]


def _mapped(rows: Table, pattern: str, change: Callable[[str], str]) -> Table:
    """Cells of the columns whose names match, changed."""
    hit = [re.fullmatch(pattern, name) is not None for name in rows[0]]
    return [rows[0], *([change(cell) if k else cell for cell, k in zip(row, hit, strict=True)] for row in rows[1:])]


def _times(factor: float) -> Callable[[str], str]:
    return lambda cell: repr(float(cell) * factor) if cell else cell


def _exponents(rows: Table) -> Table:
    return _mapped(rows, "(q|f|d).*", lambda cell: f"{float(cell):+.15e}" if cell else cell)


def _turned(rows: Table) -> Table:
    """Joint 4 a whole turn farther: the same pose."""
    return _mapped(rows, "q4_deg", lambda cell: repr(float(cell) + (360.0 if float(cell) < 0 else 0.0)))


def _zeros(rows: Table) -> Table:
    """Columns that are 0 where they are missing, written out."""
    more = [name for name in ("fx_N", "mx_Nm") if name not in rows[0]]
    return [rows[0] + more, *([*row, *("0" for _ in more)] for row in rows[1:])]


def _split(robot: Robot, rows: Table) -> list[Measurements]:
    """First repeats in one table, second ones in another."""
    k = rows[0].index("repeat")
    return [read(robot, text_of([rows[0], *(r for r in rows[1:] if r[k] == n)]), f"part{n}.csv") for n in ("1", "2")]


def _halves(robot: Robot, rows: Table) -> list[Measurements]:
    """The upper half of the rows in one table, the lower half in another, which comes first."""
    middle = 1 + (len(rows) - 1) // 2
    return [read(robot, text_of([rows[0], *rows[a:b]]), f"rows{a}.csv") for a, b in ((middle, len(rows)), (1, middle))]


def _scaled(rows: Table) -> Table:
    """Twice the load bends a linear arm twice as far."""
    return _mapped(rows, "(f|d).*", _times(2.0))


Change = Callable[[Robot, Table], list[Measurements]]
# Nothing of the answer may change.
CHANGES: dict[str, Change] = {
    "rows shuffled": _one(_rows),
    "rows backwards": _one(_backwards),
    "columns shuffled": _one(_columns),
    "semicolons": _one(_as_is, ";"),
    "tabs": _one(_as_is, "\t"),
    "a workbook": lambda robot, rows: [_workbook(robot, rows)],
    "numbers with exponents": _one(_exponents),
    "columns of zeros": _one(_zeros),
    "rows in two tables": _halves,
    "labels renamed": _one(_renamed),
}
TURNED: Change = _one(_turned)


def _differences(
    plain: Answer, changed: Answer, springs: float, ends: float, ignore: tuple[str, ...] = ()
) -> list[str]:
    out = [] if plain.words == changed.words else [f"says {changed.words} instead of {plain.words}"]
    if plain.numbers.keys() != changed.numbers.keys():
        return [*out, f"has numbers of {sorted(plain.numbers.keys() ^ changed.numbers.keys())} in one of both only"]
    for name, a in plain.numbers.items():
        b = changed.numbers[name]
        tolerance = ends if name.endswith((" low", " high")) else springs
        if not name.startswith(ignore or ("\0",)) and not (a == b or abs(a - b) <= tolerance * max(abs(a), abs(b))):
            out.append(f"{name} is {b:.9g} instead of {a:.9g}")
    return out


@dataclass(frozen=True)
class Engine:
    """A table, what is asked of it, and to what it must agree."""

    robot: str
    table: Callable[[], tuple[tuple[str, ...], ...]]
    ask: Callable[[list[Measurements]], Answer]
    springs: float = SPRINGS
    ends: float = ENDS

    @property
    def rows(self) -> Table:
        """The plain table."""
        return [list(row) for row in self.table()]


ENGINES: dict[str, Engine] = {
    "calibrate, staged": Engine("xr701", published, staged),
    "calibrate, free springs": Engine("xr701", published, lambda t: free(t, "xr701", ("j2", "j3", "j4", "j5"))),
    "calibrate, repeats": Engine("kr60-3", repeated, lambda t: free(t, "kr60-3", ("j1", "j2", "j3", "j5"))),
    "simulate": Engine("xr701", published, simulated, SIMULATED),
    # Noises are optimised to 1e-4 or so in their logarithm, and evidence follows them; order changes the last bits.
    "diagnose": Engine("xr701", published, diagnosed, 1e-3),
}


@cache
def _plain(name: str) -> Answer:
    engine = ENGINES[name]
    return engine.ask([read(arm(engine.robot).robot, text_of(engine.rows))])


def compare(
    name: str, change: Change, ignore: tuple[str, ...] = (), springs: float | None = None, ends: float | None = None
) -> list[str]:
    """What an engine says otherwise of a changed table."""
    engine = ENGINES[name]
    changed = engine.ask(change(arm(engine.robot).robot, engine.rows))
    return _differences(_plain(name), changed, springs or engine.springs, ends or engine.ends, ignore)


Check = Callable[[], list[str]]


def _check(engine: str, change: Change, ignore: tuple[str, ...] = ()) -> Check:
    return lambda: compare(engine, change, ignore)


CHECKS: dict[str, Check] = {
    f"{engine}: {words}": _check(engine, change) for engine in ENGINES for words, change in CHANGES.items()
}
del CHECKS["calibrate, staged: labels renamed"]  # the scheme names the poses
del CHECKS["simulate: labels renamed"]  # answers go by labels here
CHECKS |= {
    f"{engine}: q4 a whole turn farther": _check(engine, TURNED, ("left out",))
    for engine in ENGINES
    if ENGINES[engine].robot == "xr701"
}
CHECKS |= {
    "calibrate, repeats: repeats in two tables": _check("calibrate, repeats", _split),
    # Noise is estimated, and twice the readings have twice of it; only the gauge's 0.01 mm stays.
    "calibrate, free springs: twice the load": lambda: compare(
        "calibrate, free springs", _one(_scaled), ("rms", "left"), 1e-3, 1e-2
    ),
    "calibrate, repeats: twice the load": lambda: compare(
        "calibrate, repeats", _one(_scaled), ("rms", "left"), 1e-3, 1e-2
    ),
}


def failures() -> list[str]:
    """Each check that fails, with what differs."""
    out = []
    for name, check in CHECKS.items():
        try:
            found = check()
        except Exception as error:
            found = [f"{type(error).__name__}: {error}"]
        if found:
            out.append(f"{name}: {'; '.join(found[:6])}")
    return out
