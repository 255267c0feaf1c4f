"""KUKA KRL: Cartesian programs of LIN with E6POS, joint programs of PTP with E6AXIS; and both read back.

Syntax after the KUKA System Software programming manuals and public programs: coordinates stand in the motion
statement, sub-programs are files of their own called by name, $VEL.CP is in m/s, angles in deg, lengths in mm. $BASE is
the part frame in $WORLD (with $WORLD in the robot's foot with all linear axes at 0), $TOOL the tool frame on the
flange. With a turntable the part frame is coupled to it on the controller: BASE_DATA is used.

KRL has no straight line to joint coordinates: joint programs are PTP moves, whose speed is a percentage of the axes'
own (``joint_percent``). $VEL.CP is written there too; only the reader sees it. Reals are single precision.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

import numpy as np

from machining.programs.configuration import kuka_status_turn
from machining.programs.job import Job
from machining.programs.orientation import framed, from_zyx_degrees, zyx_degrees
from machining.programs.rendering import rendered
from machining.programs.sandbox import Sandbox
from machining.programs.words import (
    ARM,
    common,
    configurations_of,
    frame_words,
    part_names,
    plain,
    speeds_of,
    words_of,
)
from machining.programs.written import Collector, Language, ProgramFile, ReadMoves, called, main_file, number, whole
from robots import InputError
from robots.arrays import Array

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


def write(job: Job, made: Sandbox) -> list[ProgramFile]:
    """The main file and the sub-programs."""
    digits = job.options.decimals.angle
    names = part_names(job, job.options.name)
    shared = common(job) | {"parts": names}

    def main() -> Iterator[str]:
        frames = {
            "tool": frame_words(job, job.T_tool, zyx_degrees, digits),
            "base": frame_words(job, job.T_base, zyx_degrees, digits),
            "ptp_blend": plain(job.options.krl.ptp_blend_percent),
        }
        return rendered(made, "krl/main.j2", shared | frames)

    def part(name: str, first: int, last: int) -> Iterator[str]:
        moves = job.moves(
            first,
            last,
            words_of(job, zyx_degrees, digits),
            configurations_of(job, kuka_status_turn),
            speeds_of(job, 1.0),
        )
        after = shared["after"] if last == job.n else []
        own = {"part": name, "first": first + 1, "last": last, "moves": moves, "after": after}
        return rendered(made, "krl/moves.j2", shared | own)

    files = [ProgramFile(f"{job.options.name}.src", main)]
    for name, (first, last) in zip(names, job.parts(), strict=True):
        files.append(ProgramFile(f"{name}.src", lambda n=name, a=first, b=last: part(n, a, b)))  # type: ignore[misc]
    return files


def read(files: Mapping[str, str]) -> ReadMoves:
    """Moves of a main file (the first) and its sub-programs; lines that are neither motion nor speed are passed over.

    Raises
    ------
    InputError
        Motion that is not LIN or PTP with all coordinates, a number that is none, a sub-program that is not there.
    """
    name, text = main_file(files, ".src")
    lines = text.splitlines()
    calls = [found[1] for line in lines if (found := _CALL.match(line)) is not None]
    out = Collector()
    speed = np.nan
    for source, body in [(name, text), *called(files, calls, ".src")]:
        for line in _LANGUAGE.statements(source, body):
            found = _MOTION.match(line.code)
            line.check_read("LIN and PTP {coordinates}", read=found is not None)
            if found is not None:
                _motion(out, line.where, found[1].upper(), found[2], speed)
            elif (said := _SPEED.match(line.code)) is not None:
                speed = number(f"{line.where}, $VEL.CP", said[1])
    return out.moves()


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


def frames(words: Array) -> Array:
    """Tool frames (n, 4, 4) m in $BASE of X Y Z A B C (n, 6)."""
    return framed(from_zyx_degrees(words[:, 3:]), words[:, :3] * 1e-3)
