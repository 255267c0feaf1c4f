"""Programs for a robot's controller: its joint convention, its templates, what it is told, and reading it back."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from machining.programs.commands import Commands, commands
from machining.programs.convention import Convention, convention_for
from machining.programs.format import Format
from machining.programs.job import Job, Kind, external_axes, external_count, job_of, precision_notes
from machining.programs.program import JointProgram, frame_distance, tool_in_part
from machining.programs.rendering import environment, rendered
from machining.programs.round_trip import RoundTrip
from machining.programs.sandbox import Sandbox
from machining.programs.words import Configurations, Words, common
from machining.programs.write_options import WriteOptions
from machining.programs.written import ProgramFile, ReadMoves, Written
from robots import InputError, Robot
from robots.arrays import Array, Bools, Integers


class Controller(Format):
    """A controller's language."""

    @abstractmethod
    def files(self, job: Job, made: Sandbox) -> list[ProgramFile]:
        """The files of a job, the main one first.

        Raises
        ------
        InputError
            What the language cannot hold.
        """

    @abstractmethod
    def read(self, files: Mapping[str, str], program: JointProgram, options: WriteOptions) -> ReadMoves:
        """Moves of a program's files, main file first, written for the robot, cell and options given.

        Raises
        ------
        InputError
            Motion that the reader does not know, a number that is none, a sub-program that is not there.
        """

    def frames(self, words: Array) -> Array:
        """Tool frames (n, 4, 4) m in the part frame of the coordinates (n, k) of a Cartesian program."""
        raise AssertionError("a format that writes frames reads them")

    def configuration(
        self, robot: Robot, q: Array, controller_deg: Array
    ) -> Sequence[Sequence[object]] | Integers | None:
        """Configurations (n) of a Cartesian program at q (n, dof) rad, also given in the controller's deg.

        None: the language has no words for them.
        """
        return None

    def orientation_digits(self, options: WriteOptions) -> tuple[str, int, float]:
        """What orientations are written as, their decimals, and rad for each unit of the last digit."""
        return "angles", options.decimals.angle, float(np.radians(1.0))

    def joint_moves(self, wanted: Commands, kind: Kind) -> Bools:
        """Which moves (n,) are joint moves: all of a joint program."""
        return wanted.joint if kind == "cartesian" else np.full(len(wanted.joint), True)

    def pace(self, found: ReadMoves, wanted: Commands, options: WriteOptions) -> float:
        """Largest difference of a move's speed, or time, from what was wanted, as a share of it."""
        self.check_said(found.speed)
        return float(np.abs(found.speed / wanted.speed - 1.0).max())

    def notes(self, job: Job) -> list[str]:
        """What a user has to know before the program runs."""
        out = precision_notes(job, self.orientation_digits(job.options))
        if job.kind == "cartesian":
            if job.program.cell.turntable is not None:
                out.append("the part frame turns with the turntable: couple it to the turntable on the controller")
            elif job.T_base is None:
                out.append("the controller's robot frame is not known: set the part frame on the robot")
        return out

    def check(self, robot: Robot, externals: int, options: WriteOptions) -> None:
        """See :class:`Format`: an arm whose convention on that controller is not known."""
        super().check(robot, externals, options)
        self.convention(robot, externals, options)

    def convention(self, robot: Robot, externals: int, options: WriteOptions) -> Convention:
        """How the controller counts the joints of an arm. Errors as :func:`convention_for`."""
        return convention_for(robot, externals, self.name, options.arm)

    def write(self, program: JointProgram, kind: Kind, options: WriteOptions, templates: Path | None) -> Written:
        """See :class:`Format`."""
        convention = self.convention(program.robot, external_count(program), options)
        job = job_of(program, kind, options, convention)
        files = self.files(job, environment(templates))
        joint_rapid = int((program.motions.rapid & job.commands.joint)[1:].sum())
        notes = self.notes(job)
        if joint_rapid:
            notes.append(f"{joint_rapid} rapid moves are joint moves: between their ends they leave the straight line")
        return Written(tuple(files), tuple(notes))

    def context(self, job: Job) -> dict[str, object]:
        """What every template of this language knows, its own options among ``o``."""
        own = {} if self.table is None else {self.table[0]: job.options.own(self.table[1]).model_dump()}
        return common(job) | {"o": job.options.model_dump() | own}

    def part_files(
        self,
        job: Job,
        made: Sandbox,
        names: Sequence[str],
        suffix: str,
        shared: Mapping[str, object],
        moves: tuple[Words, Configurations, Callable[[slice], list[str]]],
    ) -> list[ProgramFile]:
        """A file for each part of the moves, by the template ``moves.j2``; ``moves`` as :meth:`Job.moves` has them."""

        def part(name: str, first: int, last: int) -> Iterator[str]:
            own = {
                "part": name,
                "first": first + 1,
                "last": last,
                "moves": job.moves(first, last, *moves),
                "after": shared["after"] if last == job.n else [],
            }
            return rendered(made, f"{self.name}/moves.j2", {**shared, **own})

        return [
            ProgramFile(f"{name}{suffix}", lambda n=name, a=first, b=last: part(n, a, b))  # type: ignore[misc]
            for name, (first, last) in zip(names, job.parts(), strict=True)
        ]

    def round_trip(
        self, program: JointProgram, files: Mapping[str, str], kind: Kind, options: WriteOptions
    ) -> RoundTrip:
        """See :class:`Format`."""
        found, wanted = self.read(files, program, options), commands(program, options)
        self._check_same(found, program, kind)
        convention = self.convention(program.robot, external_count(program), options)
        linear = len(program.cell.linear_axes)
        external = convention.external_back(found.external)
        travel = external[:, :linear] * 1e-3
        table = np.radians(external[:, linear]) if program.cell.turntable is not None else np.zeros(program.n)
        if kind == "joint":
            T = tool_in_part(program.robot, program.cell, convention.radians(found.words), travel, table)
        else:
            T = self.frames(found.words)
        away, turned = frame_distance(T, program.T_part_tool)
        away_axes = np.abs(external - external_axes(program, slice(None)))
        return RoundTrip(
            tip=float(away.max()),
            turned=float(turned.max()),
            travel=float(away_axes[:, :linear].max(initial=0.0)) * 1e-3,
            table=float(np.radians(away_axes[:, linear:].max(initial=0.0))),
            pace=self.pace(found, wanted, options),
            same_moves=bool((found.joint == self.joint_moves(wanted, kind)).all()),
            same_sides=kind == "joint" or self._same_sides(found, program, convention),
        )

    def check_said(self, said: Array) -> None:
        """Raise InputError for a move whose speed (n,) a program does not say."""
        if np.isnan(said).any():
            number = int(np.argmax(np.isnan(said))) + 1
            raise InputError(
                f"{self.name} program, move {number}", value="no speed", allowed="a speed before each move"
            )

    def _check_same(self, found: ReadMoves, program: JointProgram, kind: Kind) -> None:
        """Raise InputError for another number of moves, another kind or other axes than were written."""
        axes = external_count(program)
        for is_same, value, allowed in (
            (len(found.words) == program.n, f"{len(found.words)} moves", f"{program.n}, as written"),
            (found.kind == kind, f"{found.kind} coordinates", kind),
            (found.external.shape[1] == axes, f"{found.external.shape[1]} external axes", f"{axes}, as the cell has"),
        ):
            if not is_same:
                raise InputError(f"{self.name} program", value=value, allowed=allowed)

    def _same_sides(self, found: ReadMoves, program: JointProgram, convention: Convention) -> bool:
        """Whether configurations are those of the joint angles; straight moves may do without, their start decides."""
        wanted = self.configuration(program.robot, program.q, convention.controller_deg(program.q))
        if wanted is None:
            return True
        rows = zip(found.configuration, wanted, found.joint.tolist(), strict=True)
        return all(list(map(str, row)) == list(map(str, right)) if row else not joint for row, right, joint in rows)
