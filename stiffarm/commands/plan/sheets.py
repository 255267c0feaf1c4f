"""Measurement sheets: set-ups to go through at the robot, as a table to fill in and as pages to print."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from doe import Measurements, write_measurements
from doe.planning.protocol import Protocol, table_to_fill
from robots import Robot
from robots.arrays import Array
from stiffarm.pages.parts import rendered
from stiffarm.session.words.directions import direction_words

# More boxes than these beside each other are too narrow to write into on A4.
MOST_BOXES = 9


@dataclass(frozen=True)
class Sheet:
    """Set-ups in the order of measuring, and what is done in each.

    ``q`` (n, dof) rad, ``direction`` (n, 3) base axes and ``labels`` (n,) of the set-ups; ``hints`` (n,): what to
    expect, in words. ``facts``: pairs of name and text for the head of the page; ``rules``: what to heed.
    """

    robot: Robot
    title: str
    q: Array
    direction: Array
    labels: tuple[str, ...]
    hints: tuple[str, ...]
    protocol: Protocol
    facts: tuple[tuple[str, str], ...] = ()
    rules: tuple[str, ...] = ()

    @property
    def table(self) -> Measurements:
        """The rows as a measurement table in which nothing is read yet."""
        return table_to_fill(self.title, self.q, self.direction, self.labels, self.protocol)


def write_table(sheet: Sheet, path: Path) -> None:
    """Write the CSV to fill in; ``calibrate`` reads it back, rows without a reading are skipped there."""
    write_measurements(sheet.table, path, sheet.robot, to_fill=sheet.protocol.columns)


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


def grid(protocol: Protocol, before: int = 0) -> Grid:
    """Boxes of a set-up: repeats side by side where there is room, else one below the other.

    ``before``: how many rows of the table come before it.
    """
    names = tuple(_head(column) for column in protocol.columns)
    count, arrows = protocol.repeats, {"loading": " ↑", "unloading": " ↓", None: ""}
    loads = [f"{f:.5g} N{arrows[p]}" for f, p in zip(protocol.course.tolist(), protocol.phases, strict=True)]
    steps = before + 1 + np.arange(count * len(loads)).reshape(count, -1)
    if len(names) * count > MOST_BOXES:
        heads = [f"{k + 1}: {load}" if count > 1 else load for k in range(count) for load in loads]
        return Grid(
            (), names, tuple((head, (s,) * len(names)) for head, s in zip(heads, steps.ravel().tolist(), strict=True))
        )
    lines = tuple(
        (load, tuple(np.repeat(line, len(names)).tolist())) for load, line in zip(loads, steps.T, strict=True)
    )
    titles = [f"repeat {k + 1}" for k in range(count)]
    if count > 1 and len(names) == 1:
        return Grid((), tuple(f"{title}: {names[0]}" for title in titles), lines)
    return Grid(tuple((title, len(names)) for title in titles) if count > 1 else (), names * count, lines)


def _head(column: str) -> str:
    name, _, unit = column.rpartition("_")
    return f"{name} ({unit})"


def angles(robot: Robot, q: Array) -> tuple[tuple[str, str], ...]:
    """Angles in deg as texts, as the controller counts them where that is known, else the model's coordinates."""
    names = robot.coordinates
    if robot.controller is not None:
        names, q = robot.controller.names, robot.controller.controller(q[None])[0]
    return tuple(
        (name.removesuffix("_deg"), f"{np.degrees(v):.5g}".replace("-", "−") if abs(v) > 1e-9 else "0")
        for name, v in zip(names, q, strict=True)
    )


def render_sheet(sheet: Sheet, pictures: Sequence[str]) -> str:
    """The page as HTML text, all content escaped; ``pictures``: a base64 PNG for each set-up, or "" for none."""
    each = len(sheet.protocol.course) * sheet.protocol.repeats
    blocks = [
        Block(
            k + 1,
            label,
            angles(sheet.robot, q),
            direction_words(way),
            hint,
            picture,
            grid(sheet.protocol, k * each),
            k > 0 and np.array_equal(q, sheet.q[k - 1]),
        )
        for k, (label, q, way, hint, picture) in enumerate(
            zip(sheet.labels, sheet.q, sheet.direction, sheet.hints, pictures, strict=True)
        )
    ]
    return rendered("sheet.html.j2", sheet=sheet, blocks=blocks, count=each * len(blocks))
