"""What a controller is told besides coordinates: speeds, kinds of moves, times, and what happens between moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from machining.programs.program import JointProgram
from machining.programs.source_text import SourceText
from machining.programs.write_options import WriteOptions
from machining.toolpaths.motions import Motions
from robots import InputError
from robots.arrays import Array, Bools
from robots.constants import MM, MM_MIN, RPM

# Shortest time of a move (s): an inverse time must stay a number that a controller reads.
SHORTEST = 1e-4
# Changes of the tip (m) and of angles (rad) below these are rounding: they give no time to a move.
STILL = 1e-9


@dataclass(frozen=True, eq=False)
class Commands:
    """For n moves: tip ``speed`` (n,) m/s, ``joint`` (n,) joint moves, ``duration`` (n,) s, NaN of the first.

    A move takes the time of its tip, or longer if the tool would turn faster than ``rotation_deg_s``. Where neither tip
    nor tool moves in the part frame, the axes take the time that those speeds give them.
    """

    speed: Array
    joint: Bools
    duration: Array


def commands(program: JointProgram, options: WriteOptions) -> Commands:
    """Speeds, kinds and times of all moves.

    Raises
    ------
    InputError
        Moves at feed without a feed, and no default.
    """
    speed = _speed(program.motions, options)
    joint = np.full(program.n, False)
    if options.rapid == "joint":
        joint |= program.motions.rapid
    joint[:1] = True
    return Commands(speed, joint, _durations(program, speed, np.radians(options.rotation_deg_s), options))


def _speed(motions: Motions, options: WriteOptions) -> Array:
    rapid = motions.rapid.copy()
    rapid[:1] = True
    speed = np.where(rapid, options.rapid_mm_s * MM, motions.feed)
    unknown = np.isnan(speed)
    if unknown.any():
        if options.default_feed_mm_min is None:
            first = int(motions.line[np.argmax(unknown)])
            raise InputError(
                f"feed of {int(unknown.sum())} moves, the first of source line {first}",
                allowed="known for all moves that are not rapid",
                remedy="give default_feed_mm_min in the options",
            )
        speed[unknown] = options.default_feed_mm_min * MM_MIN
    return np.asarray(speed)


def _durations(program: JointProgram, speed: Array, turning: float, options: WriteOptions) -> Array:
    T = program.T_part_tool
    away = np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1)
    chord = np.linalg.norm(np.diff(T[:, :3, :3], axis=0), axis=(1, 2)) / np.sqrt(8.0)
    turned = 2.0 * np.arcsin(np.clip(chord, 0.0, 1.0))
    time = np.maximum(away / speed[1:], turned / turning)
    still = (away < STILL) & (turned < STILL)
    angles = np.diff(np.column_stack([program.q, program.table]), axis=0)
    axes = np.abs(angles).max(axis=1) / turning
    if program.travel.shape[1]:
        travel = np.linalg.norm(np.diff(program.travel, axis=0), axis=1)
        axes = np.maximum(axes, travel / (options.rapid_mm_s * MM))
    time = np.where(still, axes, time)
    return np.concatenate([np.full(min(1, program.n), np.nan), np.maximum(time, SHORTEST)])


@dataclass(frozen=True)
class Happening:
    """What is not motion: ``kind`` "tool", "spindle", "operation" or "event"; texts are :class:`SourceText`.

    Tool: ``number`` ("" without), ``name``, ``diameter_mm`` ("" without). Spindle: ``rpm`` ("0": stop), ``clockwise``.
    Operation: ``name``. Event: ``name`` its word, ``text``. ``line``: of the source, 0 unknown.
    """

    kind: str
    name: SourceText = SourceText("")  # noqa: RUF009 - immutable
    text: SourceText = SourceText("")  # noqa: RUF009
    number: str = ""
    diameter_mm: str = ""
    rpm: str = ""
    clockwise: bool = True
    line: int = 0


def happenings(motions: Motions) -> dict[int, list[Happening]]:
    """What comes before each move; after the last under ``motions.n``."""
    out: dict[int, list[Happening]] = {}

    def put(move: int, happening: Happening) -> None:
        out.setdefault(int(move), []).append(happening)

    for event in motions.events:
        put(
            min(max(event.move, 0), motions.n),
            Happening("event", SourceText(event.word), SourceText(event.text), line=event.line),
        )
    for move in _changes(motions.operation):
        name = motions.operations[motions.operation[move]]
        if name.strip():
            put(move, Happening("operation", SourceText(name), line=int(motions.line[move])))
    for move in _changes(motions.tool):
        tool = motions.tools[motions.tool[move]]
        if tool.number is None and not tool.name.strip():
            continue
        diameter = f"{tool.diameter * 1e3:.6g}" if np.isfinite(tool.diameter) else ""
        number = "" if tool.number is None else str(int(tool.number))
        put(
            move,
            Happening("tool", SourceText(tool.name), number=number, diameter_mm=diameter, line=int(motions.line[move])),
        )
    turning = 0.0
    for move in _changes(np.nan_to_num(motions.spindle, nan=np.inf)):
        spindle = float(motions.spindle[move])
        if np.isfinite(spindle) and spindle != turning:
            turning = spindle
            rpm = f"{abs(spindle) / RPM:.6g}"
            put(move, Happening("spindle", rpm=rpm, clockwise=spindle > 0.0, line=int(motions.line[move])))
    return out


def _changes(values: NDArray[np.generic]) -> list[int]:
    """Moves whose value differs from the one before; the first counts."""
    if len(values) == 0:
        return []
    return [0, *(np.flatnonzero(values[1:] != values[:-1]) + 1).tolist()]
