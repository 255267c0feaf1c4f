"""Measurement sheets: set-ups to go through at the robot, as a table to fill in and as pages to print."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np

from doe import Measurements, write_measurements
from doe.tables.columns import DISPLACEMENTS, LOADS
from robots import Robot
from robots.arrays import Array
from stiffarm.pages.parts import rendered
from stiffarm.session.direction_words import direction_words

# More boxes than these beside each other are too narrow to write into on A4.
MOST_BOXES = 9


@dataclass(frozen=True)
class SetUp:
    """One pose with one direction of the load: ``q`` (dof,) rad, ``direction`` (3,) base axes, ``forces`` N rising.

    ``hint``: what to expect, in words.
    """

    label: str
    q: Array
    direction: Array
    forces: tuple[float, ...]
    hint: str = ""


@dataclass(frozen=True)
class Sheet:
    """Set-ups in the order of measuring, and what is done in each.

    ``components`` (0..5) are read; each load ``repeats`` times, from the unloaded arm up, and down again if
    ``unloading``. ``facts``: pairs of name and text for the head of the page; ``rules``: what to heed.
    """

    robot: Robot
    title: str
    setups: tuple[SetUp, ...]
    components: tuple[int, ...]
    repeats: int
    unloading: bool
    facts: tuple[tuple[str, str], ...] = ()
    rules: tuple[str, ...] = ()


@dataclass(frozen=True)
class Reading:
    """One row: number in the order of measuring, its set-up, load in N, repeat from 1, phase or None."""

    step: int
    setup: SetUp
    force: float
    repeat: int
    phase: str | None


def readings(sheet: Sheet) -> list[Reading]:
    """All rows in the order of measuring: set-up by set-up, repeat by repeat, the load rising (and falling)."""
    out: list[Reading] = []
    for setup in sheet.setups:
        up = [(force, "loading" if sheet.unloading else None) for force in setup.forces]
        # The largest load is read once: nothing changes between the last step up and the first one down.
        down = [(force, "unloading") for force in setup.forces[-2::-1]] if sheet.unloading else []
        for repeat in range(1, sheet.repeats + 1):
            out += [Reading(len(out) + 1 + k, setup, f, repeat, ph) for k, (f, ph) in enumerate([*up, *down])]
    return out


def as_table(sheet: Sheet) -> Measurements:
    """The rows as a measurement table in which nothing is read yet."""
    rows = readings(sheet)
    n = len(rows)
    wrench = np.zeros((n, len(LOADS)))
    wrench[:, :3] = [row.force * row.setup.direction for row in rows]
    return Measurements(
        source=sheet.title, sha256="", q=np.array([row.setup.q for row in rows]).reshape(n, -1), wrench=wrench + 0.0,
        displacement=np.full((n, len(DISPLACEMENTS)), np.nan), point=np.full((n, 3), np.nan),
        sigma=np.full(n, np.nan), pose=tuple(row.setup.label for row in rows),
        repeat=tuple(row.repeat if sheet.repeats > 1 else None for row in rows),
        phase=tuple(row.phase for row in rows), step=np.array([float(row.step) for row in rows]),
        row_numbers=tuple(range(2, n + 2)), extra={}, notes=(),
    )  # fmt: skip


def write_table(sheet: Sheet, path: Path) -> None:
    """Write the CSV to fill in; ``calibrate`` reads it back, rows without a reading are skipped there."""
    write_measurements(as_table(sheet), path, sheet.robot, to_fill=tuple(DISPLACEMENTS[k] for k in sheet.components))


@dataclass(frozen=True)
class Grid:
    """Boxes of one set-up: heads of groups of columns (with their widths) and of columns, then lines of boxes.

    A line has its name and the step number that each box belongs to.
    """

    groups: tuple[tuple[str, int], ...]
    columns: tuple[str, ...]
    lines: tuple[tuple[str, tuple[int, ...]], ...]


@dataclass(frozen=True)
class Block:
    """What the page says of one set-up."""

    number: int
    label: str
    angles: tuple[tuple[str, str], ...]
    direction: str
    hint: str
    picture: str
    grid: Grid
    again: bool = False


def grid(sheet: Sheet, rows: Sequence[Reading]) -> Grid:
    """Boxes for the rows of one set-up: repeats side by side where there is room, else one below the other."""
    names = tuple(_head(DISPLACEMENTS[k]) for k in sheet.components)
    by_repeat = [list(group) for _, group in groupby(rows, key=lambda row: row.repeat)]
    count = len(by_repeat)
    if len(names) * count > MOST_BOXES:
        lines = tuple((_load(row, count > 1), (row.step,) * len(names)) for row in rows)
        return Grid((), names, lines)
    lines = tuple(
        (_load(case[0]), tuple(row.step for row in case for _ in names)) for case in zip(*by_repeat, strict=True)
    )
    titles = [f"repeat {k + 1}" for k in range(count)]
    if count > 1 and len(names) == 1:
        return Grid((), tuple(f"{title}: {names[0]}" for title in titles), lines)
    return Grid(tuple((title, len(names)) for title in titles) if count > 1 else (), names * count, lines)


def _head(column: str) -> str:
    name, _, unit = column.rpartition("_")
    return f"{name} ({unit})"


def _load(row: Reading, with_repeat: bool = False) -> str:
    text = f"{row.force:.5g} N" + {"loading": " ↑", "unloading": " ↓"}.get(row.phase or "", "")
    return f"{row.repeat}: {text}" if with_repeat else text


def angles(robot: Robot, q: Array) -> tuple[tuple[str, str], ...]:
    """Joint coordinates with their angles in deg, as texts."""
    return tuple(
        (name.removesuffix("_deg"), f"{np.degrees(v):.5g}".replace("-", "−") if abs(v) > 1e-9 else "0")
        for name, v in zip(robot.coordinates, q, strict=True)
    )


def render_sheet(sheet: Sheet, pictures: Sequence[str]) -> str:
    """The page as HTML text, all content escaped; ``pictures``: a base64 PNG for each set-up, or "" for none."""
    rows = readings(sheet)
    blocks: list[Block] = []
    for k, (setup, picture) in enumerate(zip(sheet.setups, pictures, strict=True)):
        mine = [row for row in rows if row.setup is setup]
        same = k > 0 and np.array_equal(setup.q, sheet.setups[k - 1].q)
        blocks.append(
            Block(
                k + 1,
                setup.label,
                angles(sheet.robot, setup.q),
                direction_words(setup.direction),
                setup.hint,
                picture,
                grid(sheet, mine),
                same,
            )
        )
    return rendered("sheet.html.j2", sheet=sheet, blocks=blocks, count=len(rows))
