"""Who measured when and where: poses, loads up and down, repeats, sessions, pauses; tables and sheets as text."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arms import Arm
from .spec import Rng, Spec, air, anywhere, usable

Array = NDArray[np.float64]
Ints = NDArray[np.int_]
Convention = Callable[[Array], Array]  # from stated angles (n,) in deg to true ones
DAY = 86400.0
NONE = np.zeros(3)
READ = ("dx_mm", "dy_mm", "dz_mm")


@dataclass(frozen=True)
class Table:
    """Readings to be taken, as columns: (R,) or (R, 3) or (R, n). s, deg, N, m."""

    visit: Ints
    cycle: Ints
    session: Ints
    time_s: Array
    since_s: Array  # the session's start
    hold_s: Array  # the load was put on
    zero_s: Array  # when the gauge was zeroed, at no load
    up: NDArray[np.bool_]
    q: Array
    force: Array
    moment: Array
    point: Array

    @property
    def load(self) -> Array:
        """Sizes of the loads."""
        return np.asarray(np.linalg.norm(self.force, axis=1))

    def of(self, rows: Ints) -> Table:
        """Some of the readings."""
        return Table(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    def blocks(self, one_by_one: bool) -> Iterator[Ints]:
        """Readings (V, K) of set-ups that went alike, or of one after the other."""
        cuts = np.flatnonzero(np.diff(self.visit)) + 1
        visits = np.split(np.arange(len(self.visit)), cuts)
        alike = {tuple(self.cycle[v].tolist()) for v in visits}
        if one_by_one or len(alike) > 1:
            yield from (v[None] for v in visits)
        else:
            yield np.stack(visits)


class Clock:
    """Goes on, and notes readings."""

    def __init__(self, start_s: float) -> None:
        self.now = self.start = start_s
        self.noted: list[tuple[Any, ...]] = []

    def read(self, visit: int, cycle: int, session: int, zero: float, wait: float, hold: float) -> None:
        """A reading ``wait`` seconds after the last, of which the load hangs a share ``hold``."""
        self.now += wait
        t = round(self.now, 1)
        self.noted.append((visit, cycle, session, t, t - self.start, hold * wait, zero))

    def columns(self) -> list[Any]:
        """Of a table, from ``visit`` to ``zero_s``."""
        return [np.array(column) for column in zip(*self.noted, strict=True)]


def steps_of(spec: Spec) -> list[tuple[float, bool]]:
    """Loads of a cycle, and whether they are being put on."""
    up = [(load, True) for load in sorted(spec.loads)]
    return up + [(load, False) for load, _ in reversed(up[:-1])] if spec.down else up


def timed(spec: Spec, visits: int, repeats: int, what: int) -> tuple[list[Any], list[tuple[float, bool]]]:
    """When each reading is taken, and each one's load: columns of a table from ``visit`` to ``zero_s``."""
    rng, steps = spec.rng(2, what), steps_of(spec)
    every, between, pauses = rng.uniform(15, 45), rng.uniform(60, 220), rng.uniform(0, 0.12)
    clock, session, hold = Clock(0.0), 0, rng.uniform(0.4, 0.8)
    for visit in range(visits):
        if visit * spec.sessions // visits != session:
            session += 1
            clock.now = clock.start = session * DAY + rng.uniform(-3600, 3600)
        clock.now += between * rng.uniform(0.6, 1.4) + (rng.uniform(600, 4000) if rng.random() < pauses else 0)
        for cycle in range(repeats):
            zero = round(clock.now, 1)
            for _ in steps:
                clock.read(visit, cycle, session, zero, every * rng.uniform(0.7, 1.4), hold)
            clock.now += 20.0
    columns = clock.columns()
    first = columns[3][0]
    columns[3], columns[6] = np.round(columns[3] - first, 1), columns[6] - first
    return columns, steps * (visits * repeats)


def session_span(spec: Spec) -> float:
    """Seconds of the longest session."""
    return float(timed(spec, spec.poses, spec.repeats, 0)[0][4].max())


def some_poses(rng: Rng, arm: Arm, count: int, grid: bool, true: Convention) -> Array:
    """Angles (count, n) in deg as the table states them, which stand for usable poses. ValueError: there are none."""

    def good(q: Array) -> NDArray[np.bool_]:
        return np.asarray(arm.allows(q) & usable(arm, true(q)))

    turned = [1, 2, 4, 3][: round(np.log(count) / np.log(3))]
    levels = np.stack(np.meshgrid(*[[-1, 0, 1]] * len(turned), indexing="ij"), axis=-1).reshape(-1, len(turned))
    for _ in range(12 if grid else 0):
        middles = anywhere(rng, arm, 1500)
        middles = middles[good(middles)][:40]
        half = np.minimum(0.4 * (arm.high - arm.low), 60.0) * rng.uniform(0.3, 1.0, middles.shape)
        plans = np.repeat(middles[:, None], len(levels), axis=1)
        plans[:, :, turned] += levels * half[:, None, turned]
        fits = np.flatnonzero(good(plans).all(axis=1))
        if fits.size:
            plan = np.round(plans[fits[0]], 3)
            return plan[rng.permutation(count)] if rng.random() < 0.5 else plan
    found = np.zeros((0, len(arm.low)))
    for _ in range(60):
        q = np.round(anywhere(rng, arm, 4000), 3)
        found = np.vstack([found, q[good(q)]])
        if len(found) >= count:
            return found[:count]
    raise ValueError("no such poses")


def campaign(spec: Spec, true: Convention, visits: int, repeats: int, what: int, grid: bool = False) -> Table:
    """All readings to be taken. ``what`` tells the campaign from others of the same set."""
    poses = some_poses(spec.rng(1, what), spec.of, visits, grid, true)
    columns, steps = timed(spec, visits, repeats, what)
    visit = columns[0]
    ways = np.array([[0.0, 0, -1], list(spec.second) or [0.0, 0, -1]])[visit % 2]
    load, up = (np.array(column) for column in zip(*steps, strict=True))
    point = np.tile(spec.loaded, (len(visit), 1))
    return Table(*columns, up, poses[visit], load[:, None] * ways, np.zeros_like(ways), point)


def later(table: Table, after: Table, visit: int) -> Table:
    """A campaign of one session that goes on ten minutes after another's end."""
    last = after.time_s[-1] + 600.0
    return replace(
        table,
        visit=table.visit + visit,
        session=0 * table.session + after.session[-1],
        zero_s=table.zero_s + last,
        time_s=np.round(table.time_s + last, 1),
        since_s=after.since_s[-1] + 600.0 + table.time_s,
    )


def own_columns(spec: Spec, table: Table, first: int) -> list[dict[str, str]]:
    """What the table says of when a reading was taken, from step ``first`` on."""
    warm = 20 + 4 * air(spec.air, table.since_s)
    said = {
        "step": [str(first + i) for i in range(len(warm))],
        "time_s": [f"{t:.1f}" for t in table.time_s],
        "session": [f"S{s + 1}" for s in table.session],
        "temperature_C": [f"{t:.1f}" for t in warm],
    }
    return [{name: said[name][i] for name in said if name in spec.columns} for i in range(len(warm))]


def as_text(lines: list[dict[str, Any]], names: list[str]) -> str:
    """CSV."""
    text = io.StringIO()
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    return text.getvalue()


def measurement_table(spec: Spec, table: Table, said: Array, label: str = "P", first: int = 1, digits: int = 4) -> str:
    """As CSV, of readings (R, 3) in m."""
    lines = []
    own = own_columns(spec, table, first)
    number = np.unique(table.visit, return_inverse=True)[1] + 1
    for i, d in enumerate(said):
        line: dict[str, Any] = {"pose": f"{label}{number[i]:02d}"}
        line |= {c: f"{a:.3f}" for c, a in zip(spec.of.columns, table.q[i], strict=True)}
        line |= {f"f{x}_N": f"{f + 0.0:.4f}" for x, f in zip("xyz", table.force[i], strict=True)}
        if spec.point:
            line |= {f"p{x}_mm": f"{1e3 * p + 0.0:.3f}" for x, p in zip("xyz", table.point[i], strict=True)}
        line["repeat"] = int(table.cycle[i]) + 1
        if spec.down:
            line["phase"] = "loading" if table.up[i] else "unloading"
        lines.append(line | own[i] | {READ[k]: f"{1e3 * d[k]:.{digits}f}" for k in spec.axes})
    return as_text(lines, list(lines[0]))


def of_sheet(spec: Spec, lines: list[dict[str, str]], visit: int, session: int, start_s: float) -> Table:
    """A sheet's lines as measured in order: a set-up is a run of lines at one pose, a cycle one of its repeats."""

    def numbers(line: dict[str, str], names: list[str], missing: Array) -> Array:
        return np.array([float(line[c]) if line.get(c) else m for c, m in zip(names, missing, strict=True)])

    clock, arrays, last, zero, cycle = Clock(start_s), [], ((), ""), start_s, 0
    visit -= 1
    for line in lines:
        q = numbers(line, list(spec.of.columns), np.zeros(len(spec.of.columns)))
        force, moment = (
            numbers(line, [f"{a}{x}_{b}" for x in "xyz"], np.zeros(3)) for a, b in (("f", "N"), ("m", "Nm"))
        )
        point = numbers(line, [f"p{x}_mm" for x in "xyz"], 1e3 * spec.loaded) / 1e3
        here = (line.get("pose"), *q, *np.round(force / (np.linalg.norm(force) or 1), 6)), line.get("repeat") or ""
        if here != last:
            moves = here[0] != last[0]
            visit, cycle, clock.now = visit + moves, 0 if moves else cycle + 1, clock.now + (120.0 if moves else 20.0)
            zero = clock.now
        last = here
        clock.read(visit, cycle, session, zero, 30.0, 0.6)
        arrays.append((line.get("phase") != "unloading", q, force, moment, point))
    return Table(*clock.columns(), *(np.array(column) for column in zip(*arrays, strict=True)))
