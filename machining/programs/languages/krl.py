"""KUKA KRL: Cartesian programs of LIN with E6POS, joint programs of PTP with E6AXIS; and both read back.

Syntax after the KUKA System Software programming manuals and public programs: coordinates stand in the motion
statement, sub-programs are files of their own called by name, $VEL.CP is in m/s, angles in deg, lengths in mm. $BASE is
the part frame in $WORLD (with $WORLD in the robot's foot with all linear axes at 0), $TOOL the tool frame on the
flange. With a turntable the part frame is coupled to it on the controller: BASE_DATA is used.

KRL has no straight line to joint coordinates: joint programs are PTP moves, whose speed is a percentage of the axes'
own (``joint_percent``). $VEL.CP is written there too; only the reader sees it. Reals are single precision.

S and T of a position (System Software programming manual; the same bits are SINUMERIK's STAT). S is a number of three
bits:

- bit 0: 0 in the basic area (wrist centre in front of axis 1: its x in the frame that turns with A1 is positive), 1 in
  the overhead area;
- bit 1: 0 where A3 is less than the angle at which the wrist centre lies on the line through axes 2 and 3, 1 beyond.
  Without an offset between A3 and A4 that angle is 0; with an offset a it is atan(a / length of the forearm);
- bit 2: 0 for A5 from 0 on, 1 for A5 less than 0 (each within half a turn).

T has bit i - 1 set where A_i is less than 0. Controllers ignore bits of T whose axis is within about 2 deg of 0, and S
and T of linear moves but for the first point.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Annotated

import numpy as np
from pydantic import Field

from machining.cell.schema import Strict
from machining.programs.configuration import sides
from machining.programs.controller import Controller
from machining.programs.job import Job
from machining.programs.orientation import from_zyx_degrees, zyx_degrees
from machining.programs.program import JointProgram
from machining.programs.rendering import rendered
from machining.programs.sandbox import Sandbox
from machining.programs.words import (
    ARM,
    configurations_of,
    frame_words,
    part_names,
    plain,
    speeds_of,
    words_of,
)
from machining.programs.write_options import Percent, WriteOptions
from machining.programs.written import Collector, Language, ProgramFile, ReadMoves, main_file, number, whole
from robots import InputError, Robot
from robots.arrays import Array, Integers
from robots.frames import framed

CARTESIAN = ("X", "Y", "Z", "A", "B", "C")
AXES = tuple(f"A{i + 1}" for i in range(ARM))
_MOTION = re.compile(r"\s*(LIN|PTP)\s*\{(?:\s*E6\w+\s*:)?([^{}]*)\}\s*(?:C_\w+\s*)*(?:;.*)?$", re.IGNORECASE)
_SPEED = re.compile(r"\s*\$VEL\.CP\s*=\s*(\S+)\s*(?:;.*)?$", re.IGNORECASE)
# Parts end in their number; other calls are the shop's own.
_CALL = re.compile(r"\s*([A-Za-z]\w*_\d{3,})\s*\(\s*\)\s*(?:;.*)?$")
# Motion that this reader does not know must not be passed over.
_LANGUAGE = Language(
    ";",
    re.compile(
        r"(?<![\w$.#])(?:LIN|PTP|CIRC|SLIN|SPTP|SCIRC|SPL|SPLINE|LIN_REL|PTP_REL|CIRC_REL|ASYPTP)\b(?!\s*[=(])",
        re.IGNORECASE,
    ),
    re.compile(r"^\s*(?:LOOP|FOR|WHILE|REPEAT|IF|SWITCH)\b", re.IGNORECASE),
    re.compile(r"^\s*(?:ENDLOOP|ENDFOR|ENDWHILE|UNTIL|ENDIF|ENDSWITCH)\b", re.IGNORECASE),
    re.compile(r"^\s*GOTO\b", re.IGNORECASE),
)


class KrlOptions(Strict):
    """``tool`` and ``base``: numbers in TOOL_DATA and BASE_DATA, used where a frame is not declared in the program.

    ``ptp_blend_percent``: $APO.CPTP, zone of joint moves, which KRL does not take in mm.
    """

    tool: Annotated[int, Field(ge=1, le=128)] = 1
    base: Annotated[int, Field(ge=1, le=128)] = 1
    ptp_blend_percent: Percent = 50.0
    advance: Annotated[int, Field(ge=0, le=5)] = 3


def kuka_status_turn(robot: Robot, q: Array, controller_deg: Array) -> Integers:
    """S and T (n, 2) of poses q (n, 6) rad with KUKA's angles A1 to A6 (n, 6) deg."""
    behind, backward, negative = sides(robot, q, controller_deg)
    status = 1 * behind + 2 * ~backward + 4 * negative
    turn = (controller_deg < 0.0) @ (1 << np.arange(6))
    return np.stack([status, turn], axis=1).astype(np.int64)


def _motion(out: Collector, where: str, order: str, text: str, speed: float) -> None:
    values: dict[str, float] = {}
    for item in text.split(","):
        pair = item.split()
        if len(pair) != 2:
            raise InputError(where, value=item.strip()[:40], allowed="a name and a number")
        values[pair[0].upper()] = number(where, pair[1])
    externals = [values[f"E{i}"] for i in range(1, 7) if f"E{i}" in values]
    for names, kind in ((CARTESIAN, "cartesian"), (AXES, "joint")):
        if all(name in values for name in names):
            sides: tuple[int, ...] = ()
            if "S" in values and "T" in values:
                sides = (whole(f"{where}, S", f"{values['S']:g}"), whole(f"{where}, T", f"{values['T']:g}"))
            words = [values[name] for name in names]
            out.add(where, kind, words, externals, sides, joint=order == "PTP", speed=speed)
            return
    raise InputError(where, value=text.strip()[:80], allowed="X Y Z A B C, or A1 to A6")


class Krl(Controller):
    """KUKA KRL."""

    name, title = "krl", "KUKA KRL"
    table = ("krl", KrlOptions)
    words = frozenset((
        "call", "def", "defdat", "end", "false", "for", "if", "lin", "loop", "ptp", "return", "sub", "then", "true",
        "wait", "while",
    ))  # fmt: skip

    def configuration(self, robot: Robot, q: Array, controller_deg: Array) -> Integers:
        """See :class:`Controller`."""
        return kuka_status_turn(robot, q, controller_deg)

    def files(self, job: Job, made: Sandbox) -> list[ProgramFile]:
        """The main file and the sub-programs."""
        digits = job.options.decimals.angle
        names = part_names(job, job.options.name)
        shared = self.context(job) | {"parts": names}

        def main() -> Iterator[str]:
            frames = {
                "tool": frame_words(job, job.T_tool, zyx_degrees, digits),
                "base": frame_words(job, job.T_base, zyx_degrees, digits),
                "ptp_blend": plain(job.options.own(KrlOptions).ptp_blend_percent),
            }
            return rendered(made, "krl/main.j2", shared | frames)

        moves = words_of(job, zyx_degrees, digits), configurations_of(job, self.configuration), speeds_of(job, 1.0)
        parts = self.part_files(job, made, names, ".src", shared, moves)
        return [ProgramFile(f"{job.options.name}.src", main), *parts]

    def read(self, files: Mapping[str, str], program: JointProgram, options: WriteOptions) -> ReadMoves:
        """See :class:`Controller`; lines that are neither motion nor speed are passed over."""
        out = Collector()
        speed = np.nan
        for line in _LANGUAGE.program(files, main_file(files, ".src"), _CALL, ".src"):
            found = _MOTION.match(line.code)
            line.check_read("LIN and PTP {coordinates}", read=found is not None)
            if found is not None:
                _motion(out, line.where, found[1].upper(), found[2], speed)
            elif (said := _SPEED.match(line.code)) is not None:
                speed = number(f"{line.where}, $VEL.CP", said[1])
        return out.moves()

    def frames(self, words: Array) -> Array:
        """Tool frames (n, 4, 4) m in $BASE of X Y Z A B C (n, 6)."""
        return framed(from_zyx_degrees(words[:, 3:]), words[:, :3] * 1e-3)

    def notes(self, job: Job) -> list[str]:
        """See :class:`Controller`."""
        percent = job.options.joint_percent
        slow = f"PTP moves at {percent:g} % of the axes' speed: the feed of the tool path is not kept"
        return super().notes(job) + ([slow] if job.kind == "joint" else [])


FORMAT = Krl()
