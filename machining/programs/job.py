"""A writing job: the program with the controller's angles, frames and axes, and its moves as formatted text."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from machining.programs.commands import Commands, Happening, commands, happenings
from machining.programs.convention import Convention
from machining.programs.program import JointProgram
from machining.programs.write_options import WriteOptions
from robots import InputError
from robots.arrays import Array
from robots.kinematics import stretched_length

Kind = Literal["cartesian", "joint"]

# Moves formatted at a time: what is in memory as text at once.
BLOCK = 1000
# What a program may differ from the tool path by its decimals, m and rad.
WANTED = 1e-6


@dataclass(slots=True)
class Move:
    """One move as templates see it; all numbers are text already.

    ``number`` from 1; ``line`` of the source, ``new_line`` where it differs from the move before; ``rapid``;
    ``joint``: a joint move; ``stop``: no blending at its end; ``words``: coordinates; ``external``: axes beyond the
    arm; ``configuration``; ``feed``: where it changes, else None; ``before``: happenings; ``dwell``: s, or None;
    ``place``: index from 0 within arrays of data.
    """

    number: int
    place: int
    line: int
    new_line: bool
    rapid: bool
    joint: bool
    stop: bool
    words: tuple[str, ...]
    external: tuple[str, ...]
    configuration: Sequence[object]
    feed: str | None
    before: Sequence[Happening]
    dwell: str | None


@dataclass(frozen=True, eq=False)
class Job:
    """What the writers share.

    ``external_names`` of the linear axes and the turntable, if there is one; ``T_base``: part frame in the
    controller's robot frame, None where the program cannot state it; ``T_tool`` in the controller's flange frame.
    """

    program: JointProgram
    kind: Kind
    options: WriteOptions
    convention: Convention
    commands: Commands
    happenings: dict[int, list[Happening]]
    T_base: Array | None
    T_tool: Array

    @property
    def n(self) -> int:
        """Number of moves."""
        return self.program.n

    def angles(self, part: slice) -> Array:
        """Controller's joint angles (m, dof) deg."""
        return self.convention.controller_deg(self.program.q[part])

    def externals(self, part: slice) -> Array:
        """Controller's external axes (m, k): linear ones in mm, then the turntable in deg."""
        return self.convention.external(external_axes(self.program, part))

    @property
    def external_decimals(self) -> tuple[int, ...]:
        """Digits of each external axis."""
        linear = (self.options.decimals.length,) * len(self.program.cell.linear_axes)
        return linear + (self.options.decimals.angle,) * (self.program.cell.turntable is not None)

    def moves(
        self,
        first: int,
        last: int,
        words: Callable[[slice], tuple[Array, Sequence[int]]],
        configurations: Callable[[slice], Sequence[Sequence[object]]],
        feeds: Callable[[slice], list[str]],
    ) -> Iterator[Move]:
        """Moves ``first`` to ``last`` (not with it), a block at a time.

        ``words``: coordinates (m, k) of a slice and the decimals of each; ``feeds``: text of each move's feed.
        """
        said: str | None = None
        motions, c, stops = self.program.motions, self.commands, self.stops()
        for start in range(first, last, BLOCK):
            part = slice(start, min(start + BLOCK, last))
            coordinates = formatted(*words(part))
            external = formatted(self.externals(part), self.external_decimals)
            sides, feed = configurations(part), feeds(part)
            before = motions.line[start - 1] if start else -1
            new_line = np.diff(motions.line[part], prepend=before) != 0
            rows = zip(
                range(part.start, part.stop),
                motions.line[part].tolist(),
                new_line.tolist(),
                motions.rapid[part].tolist(),
                c.joint[part].tolist(),
                motions.dwell[part].tolist(),
                coordinates,
                external,
                sides,
                feed,
                strict=True,
            )
            for i, line, new, rapid, joint, dwell, word, axes, side, value in rows:
                stop = i in stops or dwell > 0.0 or self.options.blend_mm == 0.0
                changed = value if value != said else None
                said = value
                text = f"{dwell:.3f}" if dwell > 0.0 else None
                here = self.happenings.get(i, ())
                yield Move(i + 1, i, line, new, rapid, joint, stop, word, axes, side, changed, here, text)

    def stops(self) -> set[int]:
        """Moves that end in an exact stop: the last, and those before a change of tool or spindle.

        In Cartesian programs those between joint and straight moves too, which controllers blend each in its own way;
        not those before other events: a stop in the cut would leave a mark.
        """
        changes = {m - 1 for m, found in self.happenings.items() if any(h.kind in ("tool", "spindle") for h in found)}
        if self.kind == "cartesian":
            changes.update(np.flatnonzero(np.diff(self.commands.joint)).tolist())
        return changes | {self.n - 1}

    def parts(self) -> list[tuple[int, int]]:
        """First and last (not with it) move of each file."""
        step = self.options.moves_per_file
        return [(start, min(start + step, self.n)) for start in range(0, self.n, step)]


def external_axes(program: JointProgram, part: slice) -> Array:
    """Travels in mm and, with a turntable, its angle in deg, (m, k)."""
    columns = [program.travel[part] * 1e3]
    if program.cell.turntable is not None:
        columns.append(np.degrees(program.table[part])[:, None])
    return np.concatenate(columns, axis=1)


def external_count(program: JointProgram) -> int:
    """Number of external axes."""
    return len(program.cell.linear_axes) + (program.cell.turntable is not None)


def formatted(values: Array, decimals: Sequence[int]) -> list[tuple[str, ...]]:
    """Numbers (m, k) as text with the decimals of each column; never "-0.00".

    Raises
    ------
    InputError
        A number that is not finite.
    """
    if not np.isfinite(values).all():
        raise InputError("coordinate of a program", value="not a finite number", allowed="finite numbers")
    if values.shape[1] == 0:
        return [()] * len(values)
    # Adding 0 turns -0 into 0.
    rounded = np.stack([np.round(c, d) for c, d in zip(values.T, decimals, strict=True)], axis=1) + 0.0
    pattern = " ".join(f"%.{d}f" for d in decimals)
    return [tuple((pattern % tuple(row)).split(" ")) for row in rounded.tolist()]


def job_of(program: JointProgram, kind: Kind, options: WriteOptions, convention: Convention) -> Job:
    """Collect what a writer needs. Raises InputError for an empty program, or feeds that are not known."""
    if program.n == 0:
        raise InputError("program", value="no moves", allowed="one move or more")
    T_base = None
    # A part that turns has no fixed frame: the controller couples it to the turntable.
    if convention.T_base is not None and program.cell.turntable is None:
        T_base = np.linalg.inv(program.cell.T_world_base0 @ convention.T_base) @ program.cell.T_world_part0
    T_tool = np.linalg.inv(convention.T_flange) @ program.cell.tool.T_flange_tool
    return Job(
        program, kind, options, convention, commands(program, options), happenings(program.motions), T_base, T_tool
    )


def farthest(program: JointProgram) -> float:
    """Farthest (m) that the tip can be from any joint axis."""
    return stretched_length(program.robot, program.cell.tool.T_flange_tool[:3, 3])


def precision_notes(job: Job, orientation: tuple[str, int, float]) -> list[str]:
    """Say where the decimals alone move the tool by more than ``WANTED``.

    ``orientation``: what orientations are written as, their decimals, and rad for each unit of the last digit.
    """
    decimals, program = job.options.decimals, job.program
    half_mm, half_deg = 0.5 * 10.0**-decimals.length, 0.5 * 10.0**-decimals.angle
    reach = farthest(program)
    linear = program.travel.shape[1] * half_mm * 1e-3
    turning = np.radians(half_deg) * program.robot.dof
    tip, turned = turning * reach + linear, turning
    if program.cell.turntable is not None:
        lever = float(np.abs(program.T_part_tool[:, :3, 3]).max()) + reach
        tip, turned = tip + np.radians(half_deg) * lever, turned + np.radians(half_deg)
    if job.kind == "cartesian":
        _, digits, unit = orientation
        tip, turned = np.sqrt(3.0) * half_mm * 1e-3, 3.0 * 0.5 * 10.0**-digits * unit
    notes = []
    if tip > WANTED:
        notes.append(f"decimals: rounding alone can move the tip by {tip * 1e6:.2g} um, more than {WANTED * 1e6:g} um")
    if turned > WANTED:
        notes.append(f"decimals: rounding alone can turn the tool by {turned:.2g} rad, more than {WANTED:g} rad")
    return notes
