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
from typing import Annotated

import numpy as np
from pydantic import Field

from machining.cell import Cell
from machining.cell.schema import Strict
from machining.programs.actions import Pattern
from machining.programs.controller import ARM, Controller
from machining.programs.convention import sides
from machining.programs.job import Job, ToolData, external_count, plain
from machining.programs.read_back import Grammar, ReadMove, Scan, numbers, whole
from machining.programs.write_options import Percent, WriteOptions
from robots import InputError, Robot
from robots.arrays import Array, Integers

CARTESIAN = ("X", "Y", "Z", "A", "B", "C")
AXES = tuple(f"A{i + 1}" for i in range(ARM))
EXTERNALS = tuple(f"E{i + 1}" for i in range(6))
_GRAMMAR = Grammar(
    main=".src",
    comment=";",
    move=re.compile(r"\s*(LIN|PTP)\s*\{(?:\s*E6\w+\s*:)?([^{}]*)\}\s*(?:C_\w+\s*)*(?:;.*)?$", re.IGNORECASE),
    readable="LIN and PTP {coordinates}",
    # Motion that this reader does not know must not be passed over.
    motion=re.compile(
        r"(?<![\w$.#])(?:LIN|PTP|CIRC|SLIN|SPTP|SCIRC|SPL|SPLINE|LIN_REL|PTP_REL|CIRC_REL|ASYPTP)\b(?!\s*[=(])",
        re.IGNORECASE,
    ),
    opens=re.compile(r"^\s*(?:LOOP|FOR|WHILE|REPEAT|IF|SWITCH)\b", re.IGNORECASE),
    closes=re.compile(r"^\s*(?:ENDLOOP|ENDFOR|ENDWHILE|UNTIL|ENDIF|ENDSWITCH)\b", re.IGNORECASE),
    jumps=re.compile(r"^\s*GOTO\b", re.IGNORECASE),
    # Parts end in their number; other calls are the shop's own.
    call=(re.compile(r"\s*([A-Za-z]\w*_\d{3,})\s*\(\s*\)\s*(?:;.*)?$"), ".src"),
)


class KrlOptions(Strict):
    """``tool`` and ``base``: numbers in TOOL_DATA and BASE_DATA, used where a frame is not declared in the program.

    ``ptp_blend_percent``: $APO.CPTP, zone of joint moves, which KRL does not take in mm.
    """

    tool: Annotated[int, Field(ge=1, le=128)] = 1
    base: Annotated[int, Field(ge=1, le=128)] = 1
    ptp_blend_percent: Percent = 50.0
    advance: Annotated[int, Field(ge=0, le=5)] = 3


class Krl(Controller):
    """KUKA KRL."""

    name, title = "krl", "KUKA KRL"
    table = ("krl", KrlOptions)
    words = frozenset(
        (
            "call",
            "def",
            "defdat",
            "end",
            "false",
            "for",
            "if",
            "lin",
            "loop",
            "ptp",
            "return",
            "sub",
            "then",
            "true",
            "wait",
            "while",
        )
    )
    main, part = (("{name}.src", "main.j2"),), "{name}_{number:03d}.src"
    speed_unit = 1.0
    grammar = _GRAMMAR
    speed = re.compile(r"\s*\$VEL\.CP\s*=\s*(?P<value>\S+)\s*$", re.IGNORECASE)
    terminals = (1, 8192)
    tool_frame = "figures"
    actions = (
        Pattern("await", re.compile(r"\s*WAIT\s+FOR\s+\$IN\[(?P<name>\d+)\]\s*$", re.IGNORECASE)),
        Pattern("base_frame", re.compile(r"\s*\$BASE\s*=\s*\{(?P<value>[^{}]*)\}\s*$", re.IGNORECASE)),
        Pattern("payload", re.compile(r"\s*\$LOAD\s*=\s*\{(?P<value>.*)\}\s*$", re.IGNORECASE)),
        Pattern("output", re.compile(r"\s*\$OUT\[(?P<name>\d+)\]\s*=\s*(?P<on>TRUE|FALSE)\s*$", re.IGNORECASE)),
        Pattern("analog", re.compile(r"\s*\$ANOUT\[(?P<name>\d+)\]\s*=\s*(?P<value>[\d.]+)\s*$", re.IGNORECASE)),
        Pattern("wait", re.compile(r"\s*WAIT\s+SEC\s+(?P<value>[\d.]+)\s*$", re.IGNORECASE)),
        Pattern("call", re.compile(r"\s*(?P<name>[A-Za-z]\w*)\s*\(\s*(?P<value>\d+)\s*\)\s*$")),
        Pattern("stop", re.compile(r"\s*HALT\s*$", re.IGNORECASE)),
        Pattern("tool_frame", re.compile(r"\s*\$TOOL\s*=\s*\{(?P<value>[^{}]*)\}\s*$", re.IGNORECASE)),
    )
    asks = re.compile(r"\s*IF\s+\$IN\[(?P<name>\d+)\]\s+THEN\s*$", re.IGNORECASE)

    def configuration(self, robot: Robot, q: Array, controller_deg: Array) -> Integers:
        """S and T (n, 2); see :class:`Controller`."""
        behind, backward, negative = sides(robot, q, controller_deg)
        status = 1 * behind + 2 * ~backward + 4 * negative
        turn = (controller_deg < 0.0) @ (1 << np.arange(6))
        return np.stack([status, turn], axis=1).astype(np.int64)

    def tool_value(self, T: Array, options: WriteOptions) -> str:
        """See :class:`Controller`."""
        return ",".join(f"{name} {value}" for name, value in zip(CARTESIAN, self.frame_words(T, options), strict=True))

    def base_value(self, T: Array, options: WriteOptions) -> str:
        """See :class:`Controller`."""
        return self.tool_value(T, options)

    def load_value(self, tool: ToolData, options: WriteOptions) -> str:
        """See :class:`Controller`: mass in kg, a frame in its centre, moments of inertia in kg m^2 about its axes."""
        if tool.load is None:
            return ""
        axes = ",".join(f"{name} {value:.6f}" for name, value in zip("XYZ", tool.load.inertia.tolist(), strict=True))
        return f"M {tool.load.mass:.3f},CM {{{self.tool_value(tool.load.T, options)}}},J {{{axes}}}"

    def pattern(self, job: Job) -> str:
        """See :class:`Controller`."""
        names = (*CARTESIAN, "S", "T") if job.kind == "cartesian" else AXES
        external = (f"E{i + 1}" for i in range(external_count(job.program)))
        return ",".join(f"{name} %s" for name in (*names, *external))

    def own_context(self, job: Job) -> dict[str, object]:
        """See :class:`Controller`."""
        return {
            "tool": self.frame(job, job.first_tool.T),
            "base": self.frame(job, job.T_base),
            "load": self.load_value(job.first_tool, job.options),
            "ptp_blend": plain(job.options.own(KrlOptions).ptp_blend_percent),
        }

    def notes(self, job: Job) -> list[str]:
        """See :class:`Controller`."""
        percent = job.options.joint_percent
        slow = f"PTP moves at {percent:g} % of the axes' speed: the feed of the tool path is not kept"
        return super().notes(job) + ([slow] if job.kind == "joint" else [])

    def moved(self, where: str, found: re.Match[str], scan: Scan, cell: Cell, options: WriteOptions) -> ReadMove:
        """See :class:`Controller`."""
        pairs = [item.split() for item in found[2].split(",")]
        for pair in pairs:
            if len(pair) != 2:
                raise InputError(where, code="Q005", value=" ".join(pair)[:40], allowed="a name and a number")
        given = [pair[0].upper() for pair in pairs]
        values = dict(zip(given, numbers(where, [pair[1] for pair in pairs]), strict=True))
        externals = [values[name] for name in EXTERNALS if name in values]
        for names, kind in ((CARTESIAN, "cartesian"), (AXES, "joint")):
            if values.keys() >= set(names):
                words, joint = [values[name] for name in names], found[1].upper() == "PTP"
                said = ("S", "T") if "S" in values and "T" in values else ()
                turns = [
                    int(values[name]) if values[name].is_integer() else whole(f"{where}, {name}", f"{values[name]:g}")
                    for name in said
                ]
                return ReadMove(where, kind, words, externals, joint, turns, scan.speed())
        raise InputError(where, code="Q005", value=found[2].strip()[:80], allowed="X Y Z A B C, or A1 to A6")


FORMAT = Krl()
