"""FANUC TP programs as ASCII (.LS): Cartesian positions with CONFIG, or joint positions; and both read back.

Syntax after FANUC's operator's manuals and public programs: instructions in ``/MN``, positions in ``/POS`` with user
frame (UF), user tool (UT) and group (GP1), lengths in mm, angles in deg; a program a file, sub-programs by ``CALL``.
Straight moves (``L``) take their speed from a register in mm/s, which a program can set to any digit; in joint programs
the positions are joint angles and the moves are straight all the same, so that feeds are kept.

UFRAME and UTOOL are set through a position register; UFRAME counts from the controller's world, whose origin lies on
axis 1 at the height of axis 2. J3 counts from the horizontal, whatever J2 does (``matrix`` of the convention; published
driver of ROS-Industrial, J23_factor, and its issue fanuc_experimental 17: J3 of the pendant is J3 of the arm less J2).

CONFIG is ``'F U T, t4, t5, t6'``: F (flip) where J5 is 0 or more, else N; U or D by the elbow, as J3 says whichever way
the arm faces; T where the wrist centre is in front of axis 1, else B (``robot_config.h`` of the public planner
Tesseract has the same rules); turns of J4, J5 and J6 (Remote Motion Interface manual): 0 within half a turn, 1 from 180
to 539 deg. A payload is a number of a schedule that stands on the controller: a program cannot state its figures.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from machining.cell import Cell
from machining.cell.schema import Strict
from machining.programs.actions import Action, Pattern
from machining.programs.controller import Controller
from machining.programs.convention import sides
from machining.programs.job import Commands, Job, Kind, ToolData
from machining.programs.orientation import WPR
from machining.programs.program import JointProgram
from machining.programs.read_back import Grammar, ReadMove, Scan, numbers
from machining.programs.source_text import comment
from machining.programs.write_options import WriteOptions
from robots import InputError, Robot
from robots.arrays import Array, Bools

CARTESIAN, JOINTS = ("X", "Y", "Z", "W", "P", "R"), tuple(f"J{i}" for i in range(1, 7))
LETTERS = np.array([("F", "N"), ("U", "D"), ("T", "B")])
# Longest remark of a line.
REMARK = 32
_HEAD = r"\s*\d*\s*:\s*"
_NUMBER = r"\(?\s*(-?[\d.]+)\s*\)?"
_GRAMMAR = Grammar(
    main=".LS",
    comment="!",
    move=re.compile(_HEAD + r"([JL])\s+P\[(\d{1,9})\]\s+(\S+)\s+(?:FINE|CNT\s*\d+)\s*;", re.IGNORECASE),
    readable="J P[i] and L P[i] with a speed and FINE or CNT",
    motion=re.compile(r":\s*[JLCAS]\s+PR?\[", re.IGNORECASE),
    opens=re.compile(r":\s*(?:FOR\b|IF\b.*\bTHEN\b)", re.IGNORECASE),
    closes=re.compile(r":\s*(?:ENDFOR|ENDIF)\b", re.IGNORECASE),
    jumps=re.compile(r":\s*(?:JMP|LBL|SELECT|SKIP|IF\b(?!.*\bTHEN\b))", re.IGNORECASE),
    call=(re.compile(_HEAD + r"CALL\s+([A-Za-z]\w*_\d{3,})\s*;"), ".LS"),
)
_POINT = re.compile(r"^\s*P\[(\d{1,9})[^\]]*\]\s*\{(.*?)\}\s*;", re.DOTALL | re.MULTILINE)
_WORD = re.compile(r"\b([A-Z]+\d?)\s*[=:]\s*(?:'([^']*)'|\"([^\"]*)\"|(-?[\d.]+(?:E[-+]?\d+)?))", re.IGNORECASE)
_REGISTER = re.compile(_HEAD + r"PR\[(\d+),([1-6])\]\s*=\s*" + _NUMBER + r"\s*;")
_FRAME = re.compile(_HEAD + r"U(TOOL|FRAME)\[(\d+)\]\s*=\s*PR\[(\d+)\]\s*;", re.IGNORECASE)
_SPEED = re.compile(r"(?:R\[(\d+)\]|([\d.]+))mm/sec", re.IGNORECASE)


class FanucOptions(Strict):
    """Numbers on the controller: of the user ``frame``, the first user ``tool`` and payload schedule, and registers.

    ``cnt``: how far a corner is cut, 0 to 100 (FANUC takes no mm here); with ``blend_mm = 0`` every move ends FINE.
    """

    frame: Annotated[int, Field(ge=1, le=61)] = 1
    tool: Annotated[int, Field(ge=1, le=29)] = 1
    speed_register: Annotated[int, Field(ge=1, le=200)] = 1
    position_register: Annotated[int, Field(ge=1, le=100)] = 90
    cnt: Annotated[int, Field(ge=0, le=100)] = 100


class Fanuc(Controller):
    """FANUC TP."""

    name, title = "fanuc", "FANUC TP"
    table = ("fanuc", FanucOptions)
    words = frozenset({"call", "end", "fine", "for", "if", "jmp", "lbl", "pause", "prog", "select", "then", "wait"})
    main, part = (("{NAME}.LS", "main.j2"),), "{NAME}_{number:03d}.LS"
    orientation = WPR
    speed_unit = 1e-3
    scaled = False
    terminals = (1, 8192)
    tool_frame = "name"
    moves_twice = True
    grammar = _GRAMMAR
    speed = re.compile(_HEAD + r"R\[(?P<name>\d+)\]\s*=\s*(?P<value>[\d.]+)\s*;", re.IGNORECASE)
    actions = (
        Pattern("await", re.compile(_HEAD + r"WAIT\s+DI\[(?P<name>\d+)\]\s*=\s*ON\s*;", re.IGNORECASE)),
        Pattern("output", re.compile(_HEAD + r"DO\[(?P<name>\d+)\]\s*=\s*(?P<on>ON|OFF)\s*;", re.IGNORECASE)),
        Pattern("analog", re.compile(_HEAD + r"AO\[(?P<name>\d+)\]\s*=\s*(?P<value>[\d.]+)\s*;", re.IGNORECASE)),
        Pattern("wait", re.compile(_HEAD + r"WAIT\s+(?P<value>[\d.]+)\s*\(sec\)\s*;", re.IGNORECASE)),
        Pattern("payload", re.compile(_HEAD + r"PAYLOAD\[(?P<value>\d+)\]\s*;", re.IGNORECASE)),
        Pattern("tool_frame", re.compile(_HEAD + r"UTOOL_NUM\s*=\s*(?P<name>\d+)\s*;", re.IGNORECASE)),
        Pattern("call", re.compile(_HEAD + r"CALL\s+(?P<name>[A-Za-z]\w*)\((?P<value>\d+)\)\s*;", re.IGNORECASE)),
        Pattern("stop", re.compile(_HEAD + r"PAUSE\s*;", re.IGNORECASE)),
    )
    asks = re.compile(_HEAD + r"IF\s*\(?\s*DI\[(?P<name>\d+)\]\s*=\s*ON\s*\)?\s*THEN\s*;", re.IGNORECASE)

    def configuration(self, robot: Robot, q: Array, controller_deg: Array) -> NDArray[np.str_]:
        """Three letters and three turns (n, 6); see :class:`Controller`."""
        behind, backward, negative = sides(robot, q, controller_deg)
        letters = LETTERS[np.arange(3), np.stack([negative, backward, behind], axis=1).astype(int)]
        turns = np.floor((controller_deg[:, 3:6] + 180.0) / 360.0).astype(int)
        return np.concatenate([letters, turns.astype(str)], axis=1)

    def joint_moves(self, wanted: Commands, kind: Kind) -> Bools:
        """See :class:`Controller`: straight moves to joint positions too."""
        return wanted.joint

    def tools(self, program: JointProgram, options: WriteOptions) -> tuple[ToolData, ...]:
        """See :class:`Controller`: numbers of user tools, which those of payload schedules follow."""
        found, first = super().tools(program, options), options.own(FanucOptions).tool
        numbered = {tool: replace(tool, name=str(first + i)) for i, tool in enumerate(dict.fromkeys(found))}
        return tuple(numbered[tool] for tool in found)

    def frames_of_changes(self, program: JointProgram, options: WriteOptions) -> tuple[tuple[Action, ...], ...]:
        """See :class:`Controller`: the payload schedule too."""
        tools = self.tools(program, options)
        loads = [Action("payload", value=self.load_value(tool, options)) for tool in tools]
        return tuple(
            (*frame, *((load,) if load.value else ()))
            for frame, load in zip(super().frames_of_changes(program, options), loads, strict=False)
        )

    def heading(self, program: JointProgram, options: WriteOptions) -> list[tuple[int, Action]]:
        """See :class:`Controller`: schedules have no names besides their numbers; the first tool's is called."""
        first = self.tools(program, options)[int(program.motions.tool[0])]
        load = Action("payload", value=self.load_value(first, options))
        return [one for one in super().heading(program, options) if one[1].kind != "payload"] + [(0, load)] * bool(
            load.value
        )

    def load_value(self, tool: ToolData, options: WriteOptions) -> str:
        """See :class:`Controller`: the number of the schedule."""
        return "" if tool.load is None else tool.name

    def tool_value(self, T: Array, options: WriteOptions) -> str:
        """See :class:`Controller`."""
        return ",".join(self.frame_words(T, options))

    def base_value(self, T: Array, options: WriteOptions) -> str:
        """See :class:`Controller`."""
        return self.tool_value(T, options)

    def own_context(self, job: Job) -> dict[str, object]:
        """See :class:`Controller`; negative constants stand in brackets."""
        own = job.options.own(FanucOptions)
        framed = [("UTOOL", tool.name, tool.T) for tool in job.used]
        if job.T_base is not None:
            framed.append(("UFRAME", str(own.frame), job.T_base))
        texts = [comment(line) for line in job.head]
        return {
            "NAME": job.options.name.upper(),
            "remarks": [text[i : i + REMARK] for text in texts for i in range(0, len(text), REMARK)],
            "frames": [
                (kind, number, [f"({v})" if v.startswith("-") else v for v in self.frame_words(T, job.options)])
                for kind, number, T in framed
            ],
            "first_tool": job.first_tool.name,
            "load": self.load_value(job.first_tool, job.options),
            "names": CARTESIAN if job.kind == "cartesian" else JOINTS,
            "units": ("mm",) * 3 + ("deg",) * 3 if job.kind == "cartesian" else ("deg",) * 6,
            "axis_units": job.external_units,
        }

    def finished(self, pieces: Iterator[str]) -> Iterator[str]:
        """See :class:`Controller`: lines of instructions are numbered, remarks cut to what a controller holds."""
        count, rest = 0, ""
        for piece in pieces:
            *lines, rest = (rest + piece).split("\n")
            for line in lines:
                if line.startswith("  :"):
                    count += 1
                    if line.startswith("  :  !"):
                        line = f"{line.removesuffix(' ;')[: REMARK + 6].rstrip()} ;"
                    yield f"{count:4d}{line[2:]}\n"
                else:
                    yield line + "\n"
        yield rest

    def data(self, files: Mapping[str, str]) -> Mapping[str, Mapping[int, Mapping[str, str]]]:
        """See :class:`Controller`: positions by file and number."""
        out: dict[str, dict[int, dict[str, str]]] = {}
        for name, text in files.items():
            for number, body in _POINT.findall(text.partition("\n/POS")[2]):
                words = {key.upper(): "".join(values).strip() for key, *values in _WORD.findall(body)}
                if int(number) in out.setdefault(name, {}):
                    raise InputError(
                        f"{name}, P[{number}] stands there twice", code="Q005", allowed="each position once"
                    )
                out[name][int(number)] = words
        return out

    def remembered(self, where: str, code: str, scan: Scan, options: WriteOptions) -> Action | None:
        """See :class:`Controller`: a frame that is set through a position register."""
        if (part := _REGISTER.match(code)) is not None:
            scan.own.setdefault(part[1], [np.nan] * 6)[int(part[2]) - 1] = numbers(where, [part[3]])[0]
        elif (framed := _FRAME.match(code)) is not None:
            value = ",".join(f"{v:.12g}" for v in scan.own.get(framed[3], [np.nan] * 6))
            if framed[1].upper() == "TOOL":
                return Action("tool_frame", framed[2], value)
            return Action("base_frame", value=value)
        return None

    def moved(self, where: str, found: re.Match[str], scan: Scan, cell: Cell, options: WriteOptions) -> ReadMove:
        """See :class:`Controller`: J and L to a position of the same file."""
        own = options.own(FanucOptions)
        point = scan.data.get(where.rpartition(", line")[0], {}).get(int(found[2]))
        if point is None:
            raise InputError(f"{where}: P[{found[2]}]", code="Q005", allowed="a position of the same file")
        if point.get("UF") != str(own.frame):
            raise InputError(
                f"{where}: user frame of P[{found[2]}]",
                code="Q005",
                value=point.get("UF", "none"),
                allowed=str(own.frame),
            )
        speed = _SPEED.fullmatch(found[3])
        if speed is None and not (found[1].upper() == "J" and found[3].endswith("%")):
            raise InputError(
                f"{where}, speed", code="Q005", value=found[3], allowed="mm/sec of a number or register; % behind J"
            )
        rate = scan.speed(str(own.speed_register) if speed is None else speed[1] or "")
        if speed is not None and speed[2]:
            rate = numbers(where, [speed[2]])[0] * 1e-3
        joint, external = found[1].upper() == "J", [point[f"E{i}"] for i in range(1, 7) if f"E{i}" in point]
        for names, kind in ((CARTESIAN, "cartesian"), (JOINTS, "joint")):
            if all(name in point for name in names):
                words = numbers(where, [point[name] for name in names])
                sides_said = re.findall(r"[A-Z]|-?\d+", point.get("CONFIG", "").upper()) if kind == "cartesian" else []
                return ReadMove(where, kind, words, numbers(where, external), joint, sides_said, rate)
        raise InputError(
            f"{where}: P[{found[2]}]", code="Q005", value=", ".join(point)[:80], allowed="X Y Z W P R, or J1 to J6"
        )

    def notes(self, job: Job) -> list[str]:
        """See :class:`Controller`."""
        own = job.options.own(FanucOptions)
        registers = f"R[{own.speed_register}] and PR[{own.position_register}] are overwritten"
        out = [*super().notes(job), f"corners are cut by CNT{own.cnt}, not by a zone in mm; {registers}"]
        out += [f"set payload schedule {tool.name} to {tool.weight} (kg, mm, kg m2)" for tool in job.used if tool.load]
        return out


FORMAT = Fanuc()
