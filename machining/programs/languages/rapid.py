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
from dataclasses import replace

import numpy as np

from machining.cell import Cell
from machining.cell.schema import Positive, Strict
from machining.programs.actions import Action, Pattern
from machining.programs.controller import ARM, Controller
from machining.programs.convention import sides
from machining.programs.job import FlangeLoad, Job, ToolData, external_count, plain
from machining.programs.orientation import QUATERNION
from machining.programs.program import JointProgram
from machining.programs.read_back import Grammar, ReadMove, Scan, file_of, numbers, whole
from machining.programs.write_options import WriteOptions
from robots import InputError, Robot
from robots.arrays import Array, Integers
from robots.frames import framed

EXTERNALS = 6
UNUSED = "9E9"
# Zones of ABB's own table: 1.5 times the path's zone for orientation and external axes, 0.15 deg a mm.
ZONE = (1.0, 1.5, 1.5, 0.15, 1.5, 0.15)
_GRAMMAR = Grammar(
    main=".mod",
    comment="!",
    move=re.compile(
        r"\s*(MoveL|MoveJ|MoveAbsJ)\s+(\[.*\])\s*(?:\\NoEOffs\s*)?,\s*\w+\s*,\s*\w+\s*,\s*(?P<tool>\w+).*;",
        re.IGNORECASE,
    ),
    readable="MoveL [[...]], MoveAbsJ [[...]]",
    motion=re.compile(r"\b(?:Move(?:L|J|C|AbsJ|Ext|Circ)\w*|SearchL|SearchC|Trigg[LJC])\b", re.IGNORECASE),
    opens=re.compile(r"^\s*(?:FOR|WHILE|TEST)\b|^\s*IF\b.*\bTHEN\b", re.IGNORECASE),
    closes=re.compile(r"\b(?:ENDFOR|ENDWHILE|ENDTEST|ENDIF)\b", re.IGNORECASE),
    jumps=re.compile(r"\bGOTO\b", re.IGNORECASE),
    # Parts end in their number; other calls are the shop's own.
    call=(re.compile(r"\s*([A-Za-z]\w*_\d{3,})\s*;\s*(?:!.*)?$"), ".mod"),
)
_TOOL = re.compile(r"^\s*PERS\s+tooldata\s+(\w+)\s*:=\s*\[TRUE,(\[\[.*?\]\]),\[(.*)\]\];", re.IGNORECASE | re.MULTILINE)
_WOBJ = re.compile(r'^\s*PERS\s+wobjdata\s+\w+\s*:=\s*\[FALSE,TRUE,"",(\[\[.*?\]\]),', re.IGNORECASE | re.MULTILINE)
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
    words = frozenset(
        (
            "do",
            "end",
            "endmodule",
            "endproc",
            "false",
            "for",
            "if",
            "main",
            "module",
            "movej",
            "movel",
            "proc",
            "return",
            "stop",
            "then",
            "true",
            "while",
        )
    )
    main, part = (("{name}.mod", "main.j2"), ("{name}.pgf", "program.j2")), "{name}_{number:03d}.mod"
    orientation = QUATERNION
    speed_unit = 1e-3
    grammar = _GRAMMAR
    speed = re.compile(r"\s*vMove\.v_tcp\s*:=\s*(?P<value>[^;]+);", re.IGNORECASE)
    scaled = False
    tool_frame = "name"
    actions = (
        Pattern("await", re.compile(r"\s*WaitDI\s+(?P<name>\w+)\s*,\s*1\s*;", re.IGNORECASE)),
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
        o, external = job.options, external_count(job.program)
        if external > EXTERNALS:
            raise InputError("external axes in RAPID", code="Q004", value=external, allowed=f"at most {EXTERNALS}")
        return {
            "unused": (UNUSED,) * (EXTERNALS - external),
            "tools": [(tool.name, self._frame(tool.T, o), self.load_value(tool, o)) for tool in job.used],
            "base": self.frame(job, job.T_base),
            "linear_mm_s": plain(o.rapid_mm_s),
            "zone": [plain(o.blend_mm * share) for share in ZONE],
        }

    def tools(self, program: JointProgram, options: WriteOptions) -> tuple[ToolData, ...]:
        """See :class:`Controller`; where the cell gives no weight, that of the options."""
        own, found = options.own(RapidOptions), super().tools(program, options)
        if own.tool_mass_kg is None:
            return found
        given = FlangeLoad(own.tool_mass_kg, framed(np.eye(3), np.array(own.tool_centre_mm) * 1e-3), np.zeros(3))
        made = {tool: tool if tool.load is not None else replace(tool, load=given) for tool in dict.fromkeys(found)}
        return tuple(made[tool] for tool in found)

    def _frame(self, T: Array, options: WriteOptions) -> str:
        words = self.frame_words(T, options)
        return f"[[{','.join(words[:3])}],[{','.join(words[3:])}]]"

    def tool_value(self, T: Array, options: WriteOptions) -> str:
        """See :class:`Controller`."""
        return ",".join(self.frame_words(T, options))

    def base_value(self, T: Array, options: WriteOptions) -> str:
        """See :class:`Controller`."""
        return self.tool_value(T, options)

    def load_value(self, tool: ToolData, options: WriteOptions) -> str:
        """See :class:`Controller`: loaddata, with the axes of the moments of inertia."""
        if tool.load is None:
            return ""
        centre, axes = (f"{v:.3f}" for v in tool.load.T[:3, 3] * 1e3), self.frame_words(tool.load.T, options)[3:]
        inertia = ",".join(f"{v:.6f}" for v in tool.load.inertia.tolist())
        return f"{plain(tool.load.mass)},[{','.join(centre)}],[{','.join(axes)}],{inertia}"

    def declared(self, files: Mapping[str, str], scan: Scan) -> Iterator[Action]:
        """See :class:`Controller`: tooldata and wobjdata of the main file."""
        _, text = file_of(files, ".mod")
        for name, frame, load in _TOOL.findall(text):
            yield Action("tool_frame", name, frame)
            yield Action("payload", name, load)
        for frame in _WOBJ.findall(text):
            yield Action("base_frame", value=frame)

    def notes(self, job: Job) -> list[str]:
        """See :class:`Controller`."""
        names = ", ".join(tool.name for tool in job.used if tool.load is None)
        return super().notes(job) + ([f"tooldata {names} has to stand on the controller"] if names else [])

    def moved(self, where: str, found: re.Match[str], scan: Scan, cell: Cell, options: WriteOptions) -> ReadMove:
        """See :class:`Controller`: MoveL, MoveJ and MoveAbsJ with the target in the instruction."""
        order, lists = found[1].lower(), re.findall(r"\[([^\[\]]*)\]", found[2])
        values = [numbers(where, part.split(",")) for part in lists]
        lengths = [len(part) for part in values]
        used = [v for v in values[-1] if v < 8.9e9] if values else []
        if order == "moveabsj" and lengths == [ARM, EXTERNALS]:
            return ReadMove(where, "joint", values[0], used, joint=True, speed=scan.speed())
        if order != "moveabsj" and lengths == [3, 4, 4, EXTERNALS]:
            if abs(np.linalg.norm(values[1]) - 1.0) > UNIT:
                raise InputError(
                    f"{where}, orientation", code="Q005", value=lists[1], allowed="a quaternion of length 1"
                )
            turns = [whole(f"{where}, configuration", item) for item in lists[2].split(",")]
            return ReadMove(where, "cartesian", values[0] + values[1], used, order == "movej", turns, scan.speed())
        raise InputError(
            where, code="Q005", value=found[2][:80], allowed="robtarget [[3],[4],[4],[6]], jointtarget [[6],[6]]"
        )


FORMAT = Rapid()
