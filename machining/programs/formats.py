"""The formats by name; programs written, read back, and compared with what they were written from.

Controllers: ``krl`` (KUKA), ``rapid`` (ABB), ``val3`` (Staubli), ``sinumerik`` (Siemens; joint programs only). Neutral:
``json`` (everything; what a verification reads) and ``csv``. The neutral ones hold both kinds of coordinates at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from machining.programs import krl, rapid, sinumerik, val3
from machining.programs.commands import commands
from machining.programs.configuration import abb_configuration, kuka_status_turn, val3_configuration
from machining.programs.convention import Convention, convention_for, identity
from machining.programs.job import Job, Kind, external_axes, external_count, job_of, precision_notes
from machining.programs.neutral import csv_pieces, json_pieces
from machining.programs.neutral_reading import moves_from_csv, program_from_json
from machining.programs.orientation import framed, from_quaternions
from machining.programs.program import JointProgram, frame_distance, tool_in_part
from machining.programs.rendering import environment
from machining.programs.sandbox import Sandbox
from machining.programs.write_options import WriteOptions
from machining.programs.written import ProgramFile, ReadMoves, Written
from robots import InputError
from robots.arrays import Array


@dataclass(frozen=True, eq=False)
class Format:
    """A format: ``kinds`` that it writes; the rest is None for neutral ones.

    ``write``: files of a job; ``read``: moves of files; ``frames``: tool frames of their coordinates.
    """

    name: str
    title: str
    kinds: tuple[Kind, ...]
    write: Callable[[Job, Sandbox], list[ProgramFile]] | None = None
    frames: Callable[[Array], Array] | None = None

    @property
    def neutral(self) -> bool:
        """Without a controller's joint convention, and with both kinds of coordinates."""
        return self.write is None


FORMATS: dict[str, Format] = {
    f.name: f
    for f in (
        Format("krl", "KUKA KRL", ("cartesian", "joint"), krl.write, krl.frames),
        Format("rapid", "ABB RAPID", ("cartesian", "joint"), rapid.write, rapid.frames),
        Format("val3", "Staubli VAL3", ("cartesian", "joint"), val3.write, val3.frames),
        Format("sinumerik", "SINUMERIK 840D", ("joint",), sinumerik.write),
        Format("csv", "CSV", ("cartesian", "joint")),
        Format("json", "JSON", ("cartesian", "joint")),
    )
}


SIDES: dict[str, Callable[..., Iterable[Iterable[object]]]] = {
    "krl": kuka_status_turn,
    "rapid": abb_configuration,
    "val3": val3_configuration,
}
# Share by which a speed may differ: it is written to seven digits, and single precision on some controllers.
SAME_PACE = 1e-4


def format_of(name: str, kind: str) -> Format:
    """The format of a name. Raises InputError for an unknown name, or a kind that it does not write."""
    if name not in FORMATS:
        raise InputError("format of programs", value=name, allowed=", ".join(FORMATS))
    if kind not in FORMATS[name].kinds:
        raise InputError(f"kind of a {name} program", value=kind, allowed=" or ".join(FORMATS[name].kinds))
    return FORMATS[name]


def write_program(
    program: JointProgram,
    name: str,
    kind: Kind = "cartesian",
    options: WriteOptions | None = None,
    templates: str | Path | None = None,
) -> Written:
    """Write a program; the texts are made when the files are written.

    Parameters
    ----------
    name : of the format
    kind : "cartesian" (tool frames in the part frame) or "joint"; neutral formats hold both
    templates : a folder whose templates come before the bundled ones

    Raises
    ------
    InputError
        Unknown format or kind; an arm whose convention on that controller is not known; moves without a feed; external
        axes that the format cannot hold; an arm without a spherical wrist in a Cartesian program.
    """
    chosen, o = format_of(name, kind), options or WriteOptions()
    if chosen.write is None:
        pieces = json_pieces if name == "json" else csv_pieces
        return Written((ProgramFile(f"{o.name}.{name}", lambda: pieces(program)),), ())
    job = job_of(program, kind, o, _convention(program, name, o))
    files = chosen.write(job, environment(None if templates is None else Path(templates)))
    return Written(tuple(files), tuple(_notes(job, name)))


def _convention(program: JointProgram, name: str, options: WriteOptions) -> Convention:
    externals = external_count(program)
    if FORMATS[name].neutral:
        return identity(program.robot, externals)
    return convention_for(program.robot, externals, name, options.arm)


def _notes(job: Job, name: str) -> list[str]:
    o = job.options
    quaternion = ("quaternion", o.decimals.quaternion, 2.0)
    notes = precision_notes(
        job, quaternion if name == "rapid" else ("angles", o.decimals.angle, float(np.radians(1.0)))
    )
    if name != "sinumerik" and job.kind == "cartesian":
        if job.program.cell.turntable is not None:
            notes.append("the part frame turns with the turntable: couple it to the turntable on the controller")
        elif job.T_base is None:
            notes.append("the controller's robot frame is not known: set the part frame on the robot")
    if name == "rapid" and o.abb.tool_mass_kg is None:
        notes.append(f"the load of the tool is not known: tooldata {o.tool_name} has to stand on the controller")
    if name == "krl" and job.kind == "joint":
        notes.append(f"PTP moves at {o.joint_percent:g} % of the axes' speed: the feed of the tool path is not kept")
    if name == "sinumerik":
        notes.append("names, signs and zeros of the axes are as the machine was set up: check them there")
    joint_rapid = int((job.program.motions.rapid & job.commands.joint)[1:].sum())
    if joint_rapid:
        notes.append(f"{joint_rapid} rapid moves are joint moves: between their ends they leave the straight line")
    return notes


def read_moves(
    files: Mapping[str, str], program: JointProgram, name: str, options: WriteOptions | None = None
) -> ReadMoves:
    """Moves of a controller's program, main file first, written for the robot, cell and options given.

    Raises
    ------
    InputError
        The readers' errors; neutral formats.
    """
    o = options or WriteOptions()
    if name == "krl":
        return krl.read(files)
    if name == "rapid":
        return rapid.read(files)
    if name == "val3":
        return val3.read(files)
    if name == "sinumerik":
        cell = program.cell
        return sinumerik.read(files, o.sinumerik, len(cell.linear_axes), cell.turntable is not None)
    raise InputError("format of a controller's program", value=name, allowed="krl, rapid, val3, sinumerik")


@dataclass(frozen=True, eq=False)
class RoundTrip:
    """What a written program, read back, differs by from the tool path, the largest of all moves.

    ``tip`` m and ``turned`` rad of the tool frames (joint programs by forward kinematics); ``travel`` m of linear
    axes, ``table`` rad; ``pace``: speed or time of a move as a share of it; ``same_moves``: joint moves are where
    they were asked for; ``same_sides``: the arm's configuration is that of the joint angles, where it decides.
    """

    tip: float
    turned: float
    travel: float
    table: float
    pace: float
    same_moves: bool
    same_sides: bool = True

    def within(self, tolerance: float = 1e-6) -> bool:
        """Whether nothing differs, and tool frames and axes by less than so many m and rad."""
        return self.difference(tolerance) is None

    def difference(self, tolerance: float = 1e-6) -> InputError | None:
        """What differs first, as the error that it is; None where nothing does."""
        off = max(self.tip, self.turned, self.travel, self.table)
        template = "write it as the bundled template does"
        if not self.same_moves:
            return InputError("joint moves and straight ones", value="exchanged", allowed="as asked", remedy=template)
        if not off < tolerance:
            return InputError(
                "off the tool path",
                value=f"{max(self.tip, self.travel) * 1e6:.3g} um, {max(self.turned, self.table) * 1e6:.3g} urad",
                allowed=f"{tolerance * 1e6:g} um, {tolerance * 1e6:g} urad",
                remedy="give more decimals in the options; in your own templates write coordinates as bundled ones do",
            )
        if not self.same_sides:
            return InputError("configuration of the arm", value="another", allowed="the path's", remedy=template)
        if not self.pace < SAME_PACE:
            value, allowed = f"by {100.0 * self.pace:.3g} %", f"{100.0 * SAME_PACE:g} %"
            return InputError("speeds differ from the tool path's", value=value, allowed=allowed, remedy=template)
        return None


def round_trip(
    program: JointProgram, files: Mapping[str, str], name: str, kind: Kind, options: WriteOptions | None = None
) -> RoundTrip:
    """Read a program and compare it with what it was written from.

    ``files``: texts by name, the main one first, as :meth:`Written.texts` gives them.

    Raises
    ------
    InputError
        What the readers refuse, or another number of moves than was written.
    """
    chosen, o = format_of(name, kind), options or WriteOptions()
    if chosen.neutral:
        return _neutral(program, next(iter(files.values())), name)
    found, wanted = read_moves(files, program, name, o), commands(program, o)
    if len(found.words) != program.n:
        raise InputError(f"{name} program", value=f"{len(found.words)} moves", allowed=f"{program.n}, as written")
    if found.kind != kind:
        raise InputError(f"{name} program", value=f"{found.kind} coordinates", allowed=kind)
    if found.external.shape[1] != external_count(program):
        value = f"{found.external.shape[1]} external axes"
        raise InputError(f"{name} program", value=value, allowed=f"{external_count(program)}, as the cell has")
    convention = _convention(program, name, o)
    linear = len(program.cell.linear_axes)
    external = convention.external_back(found.external)
    travel = external[:, :linear] * 1e-3
    table = np.radians(external[:, linear]) if program.cell.turntable is not None else np.zeros(program.n)
    if kind == "joint":
        T = tool_in_part(program.robot, program.cell, convention.radians(found.words), travel, table)
        joint = wanted.joint if name == "sinumerik" else np.full(program.n, True)
    else:
        if chosen.frames is None:
            raise AssertionError("a format that writes frames reads them")
        T, joint = chosen.frames(found.words), wanted.joint
    away, turned = frame_distance(T, program.T_part_tool)
    away_axes = np.abs(external - external_axes(program, slice(None)))
    return RoundTrip(
        tip=float(away.max()),
        turned=float(turned.max()),
        travel=float(away_axes[:, :linear].max(initial=0.0)) * 1e-3,
        table=float(np.radians(away_axes[:, linear:].max(initial=0.0))),
        pace=_pace(found, wanted.speed, wanted.duration, options=o, name=name),
        same_moves=bool((found.joint == joint).all()),
        same_sides=kind == "joint" or _same_sides(found, program, convention, name),
    )


def _same_sides(found: ReadMoves, program: JointProgram, convention: Convention, name: str) -> bool:
    """Whether configurations are those of the joint angles; straight moves may do without, their start decides."""
    wanted = SIDES[name](program.robot, program.q, convention.controller_deg(program.q))
    rows = zip(found.configuration, wanted, found.joint.tolist(), strict=True)
    return all(list(map(str, row)) == list(map(str, right)) if row else not joint for row, right, joint in rows)


def _pace(found: ReadMoves, speed: Array, duration: Array, options: WriteOptions, name: str) -> float:
    said = found.speed if name != "sinumerik" else np.where(found.joint, 0.0, found.duration)
    if np.isnan(said).any():
        number = int(np.argmax(np.isnan(said))) + 1
        raise InputError(f"{name} program, move {number}", value="no speed", allowed="a speed before each move")
    if name != "sinumerik":
        return float(np.abs(found.speed / speed - 1.0).max())
    timed = ~found.joint
    off = np.abs(found.duration[timed] / duration[timed] - 1.0)
    if options.sinumerik.feed == "per_minute":
        # A block in which no axis moves has no time of its own.
        off = off[found.duration[timed] > 0.0]
    return float(off.max(initial=0.0))


def _neutral(program: JointProgram, text: str, name: str) -> RoundTrip:
    robot, cell = program.robot, program.cell
    linear = len(cell.linear_axes)
    if name == "json":
        back = program_from_json(text, robot, cell)
        T, q, travel, table = back.T_part_tool, back.q, back.travel, back.table
        rapid, feed = back.motions.rapid, back.motions.feed
    else:
        read = moves_from_csv(text, robot.dof, linear)
        n = len(read["line"])
        frame = np.stack([read[k] for k in ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")], axis=1)
        T = framed(from_quaternions(frame[:, 3:]), frame[:, :3] * 1e-3)
        q = np.radians(np.stack([read[f"q{i + 1}_deg"] for i in range(robot.dof)], axis=1))
        travel = np.array([read[f"e{i + 1}_mm"] for i in range(linear)]).reshape(linear, n).T * 1e-3
        table, rapid, feed = np.radians(read["table_deg"]), read["rapid"] != 0.0, read["feed_mm_min"] / 6e4
    if len(T) != program.n:
        raise InputError(f"{name} program", value=f"{len(T)} moves", allowed=f"{program.n}, as written")
    by_frames = frame_distance(T, program.T_part_tool)
    by_joints = frame_distance(tool_in_part(robot, cell, q, travel, table), program.T_part_tool)
    known = np.isfinite(program.motions.feed)
    return RoundTrip(
        tip=float(max(by_frames[0].max(), by_joints[0].max())),
        turned=float(max(by_frames[1].max(), by_joints[1].max())),
        travel=float(np.abs(travel - program.travel).max(initial=0.0)),
        table=float(np.abs(table - program.table).max()),
        pace=float(np.abs(feed[known] / program.motions.feed[known] - 1.0).max(initial=0.0)),
        same_moves=bool((rapid == program.motions.rapid).all() and (np.isfinite(feed) == known).all()),
    )
