r"""ABB RAPID: Cartesian programs of MoveL with robtarget, joint programs of MoveAbsJ with jointtarget; read back too.

Syntax after the RAPID reference manuals and public programs: targets stand in the instruction, speeds in mm/s in a
speeddata whose ``v_tcp`` is set where it changes, zones in a zonedata of ``blend_mm``, unused external axes 9E9, one
module and procedure a part. MoveAbsJ moves the joints, and holds ``v_tcp`` as MoveL does. The wobjdata is the part
frame in the robot's base frame; with a turntable it belongs to a mechanical unit and stands on the controller. Numbers
are single precision on the controller.

Configurations (``confdata``, serial-link robots): cf1, cf4 and cf6 are the quarter turns of axes 1, 4, 6 (0: 0 to 90
deg, 1: 90 to 180, -1: -90 to 0). cfx = 4 (wrist centre behind axis 1) + 2 (behind the lower arm) + 1 (axis 5 negative).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

import numpy as np

from machining.cell.schema import Positive, Strict
from machining.programs.actions import Action, Pattern
from machining.programs.controller import ARM, Controller
from machining.programs.convention import sides
from machining.programs.job import Job, external_count, plain
from machining.programs.orientation import QUATERNION
from machining.programs.program import JointProgram
from machining.programs.read_back import Grammar, ReadMove, number, numbers, whole
from machining.programs.write_options import WriteOptions
from robots import InputError, Robot
from robots.arrays import Array, Integers

EXTERNALS = 6
UNUSED = "9E9"
# Zones of ABB's own table: 1.5 times the path's zone for orientation and external axes, 0.15 deg a mm.
ZONE = (1.0, 1.5, 1.5, 0.15, 1.5, 0.15)
_SPEED = re.compile(r"\s*vMove\.v_tcp\s*:=\s*([^;]+);", re.IGNORECASE)
_GRAMMAR = Grammar(
    main=".mod",
    comment="!",
    move=re.compile(
        r"\s*(MoveL|MoveJ|MoveAbsJ)\s+(\[.*\])\s*(?:\\NoEOffs\s*)?,\s*\w+\s*,\s*\w+\s*,\s*(\w+).*;", re.IGNORECASE
    ),
    readable="MoveL [[...]], MoveAbsJ [[...]]",
    motion=re.compile(r"\b(?:Move(?:L|J|C|AbsJ|Ext|Circ)\w*|SearchL|SearchC|Trigg[LJC])\b", re.IGNORECASE),
    opens=re.compile(r"^\s*(?:FOR|WHILE|TEST)\b|^\s*IF\b.*\bTHEN\b", re.IGNORECASE),
    closes=re.compile(r"\b(?:ENDFOR|ENDWHILE|ENDTEST|ENDIF)\b", re.IGNORECASE),
    jumps=re.compile(r"\bGOTO\b", re.IGNORECASE),
    # Parts end in their number; other calls are the shop's own.
    call=(re.compile(r"\s*([A-Za-z]\w*_\d{3,})\s*;\s*(?:!.*)?$"), ".mod"),
)
# Length of a quaternion: its decimals are the user's choice.
UNIT = 0.01


class RapidOptions(Strict):
    """``tool_mass_kg``, ``tool_centre_mm``: load of the tool; without it the tooldata must stand on the controller."""

    tool_mass_kg: Positive | None = None
    tool_centre_mm: tuple[float, float, float] = (0.0, 0.0, 1.0)


class Rapid(Controller):
    """ABB RAPID."""

    name, title = "rapid", "ABB RAPID"
    table = ("abb", RapidOptions)
    words = frozenset((
        "do", "end", "endmodule", "endproc", "false", "for", "if", "main", "module", "movej", "movel", "proc",
        "return", "stop", "then", "true", "while",
    ))  # fmt: skip
    main, part = (("{name}.mod", "main.j2"),), "{name}_{number:03d}.mod"
    orientation = QUATERNION
    speed_unit = 1e-3
    scaled = False
    tool_frame = "name"
    actions = (
        Pattern("output", re.compile(r"\s*SetDO\s+(?P<name>\w+)\s*,\s*(?P<on>[01])\s*;", re.IGNORECASE)),
        Pattern("analog", re.compile(r"\s*SetAO\s+(?P<name>\w+)\s*,\s*(?P<value>[\d.]+)\s*;", re.IGNORECASE)),
        Pattern("wait", re.compile(r"\s*WaitTime\s+(?:\\InPos\s*,\s*)?(?P<value>[\d.]+)\s*;", re.IGNORECASE)),
        Pattern("call", re.compile(r"\s*(?P<name>[A-Za-z]\w*)\s+(?P<value>\d+)\s*;")),
        Pattern("stop", re.compile(r"\s*Stop\s*;", re.IGNORECASE)),
    )
    asks = re.compile(r"\s*IF\s+(?P<name>\w+)\s*=\s*1\s+THEN\s*$", re.IGNORECASE)

    def configuration(self, robot: Robot, q: Array, controller_deg: Array) -> Integers:
        """cf1, cf4, cf6, cfx (n, 4); see :class:`Controller`."""
        behind, backward, negative = sides(robot, q, controller_deg)
        quarters = np.floor(controller_deg[:, [0, 3, 5]] / 90.0)
        cfx = 4 * behind + 2 * backward + 1 * negative
        return np.column_stack([quarters, cfx]).astype(np.int64)

    def own_context(self, job: Job) -> dict[str, object]:
        """See :class:`Controller`."""
        o, load, external = job.options, job.options.own(RapidOptions), external_count(job.program)
        if external > EXTERNALS:
            raise InputError("external axes in RAPID", value=external, allowed=f"at most {EXTERNALS}")
        known = load.tool_mass_kg is not None
        return {
            "unused": (UNUSED,) * (EXTERNALS - external),
            "tools": [(tool.name, self.frame(job, tool.T) if known else None) for tool in job.used],
            "base": self.frame(job, job.T_base),
            "mass": plain(load.tool_mass_kg or 0.0),
            "centre": [f"{v:.3f}" for v in load.tool_centre_mm],
            "linear_mm_s": plain(o.rapid_mm_s),
            "zone": [plain(o.blend_mm * share) for share in ZONE],
        }

    def read(
        self, files: Mapping[str, str], program: JointProgram, options: WriteOptions
    ) -> Iterator[ReadMove | Action]:
        """See :class:`Controller`; MoveL, MoveJ and MoveAbsJ with the target in the instruction are read."""
        speed, tool = np.nan, ""
        for line in _GRAMMAR.lines(files, self.reader(program)):
            if line.action is not None:
                yield line.action
            elif line.move is not None:
                if line.move[3] != tool:
                    tool = line.move[3]
                    yield Action("tool_frame", tool)
                yield _moved(line.where, line.move, speed)
            elif (said := _SPEED.match(line.code)) is not None:
                speed = number(f"{line.where}, v_tcp", said[1]) * 1e-3

    def notes(self, job: Job) -> list[str]:
        """See :class:`Controller`."""
        o = job.options
        names = ", ".join(tool.name for tool in job.used)
        unknown = f"the load of the tool is not known: tooldata {names} has to stand on the controller"
        return super().notes(job) + ([unknown] if o.own(RapidOptions).tool_mass_kg is None else [])


def _moved(where: str, found: re.Match[str], speed: float) -> ReadMove:
    order, lists = found[1].lower(), re.findall(r"\[([^\[\]]*)\]", found[2])
    values = [numbers(where, part.split(",")) for part in lists]
    lengths = [len(part) for part in values]
    used = [v for v in values[-1] if v < 8.9e9] if values else []
    if order == "moveabsj" and lengths == [ARM, EXTERNALS]:
        return ReadMove(where, "joint", values[0], used, joint=True, speed=speed)
    if order != "moveabsj" and lengths == [3, 4, 4, EXTERNALS]:
        if abs(np.linalg.norm(values[1]) - 1.0) > UNIT:
            raise InputError(f"{where}, orientation", value=lists[1], allowed="a quaternion of length 1")
        turns = [whole(f"{where}, configuration", item) for item in lists[2].split(",")]
        return ReadMove(where, "cartesian", values[0] + values[1], used, order == "movej", turns, speed)
    raise InputError(where, value=found[2][:80], allowed="robtarget [[3],[4],[4],[6]], jointtarget [[6],[6]]")


FORMAT = Rapid()
