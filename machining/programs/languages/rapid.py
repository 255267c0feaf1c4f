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
from machining.programs.configuration import sides
from machining.programs.controller import Controller
from machining.programs.job import Job
from machining.programs.orientation import from_quaternions, quaternions
from machining.programs.program import JointProgram
from machining.programs.rendering import rendered
from machining.programs.sandbox import Sandbox
from machining.programs.words import ARM, configurations_of, frame_words, part_names, plain, speeds_of, words_of
from machining.programs.write_options import WriteOptions
from machining.programs.written import Collector, Language, ProgramFile, ReadMoves, main_file, number, whole
from robots import InputError, Robot
from robots.arrays import Array, Integers
from robots.frames import framed

EXTERNALS = 6
UNUSED = "9E9"
# Zones of ABB's own table: 1.5 times the path's zone for orientation and external axes, 0.15 deg a mm.
ZONE = (1.0, 1.5, 1.5, 0.15, 1.5, 0.15)
_MOTION = re.compile(r"\s*(MoveL|MoveJ|MoveAbsJ)\s+(\[.*\])\s*(?:\\NoEOffs\s*)?,\s*\w+\s*,\s*\w+\s*,.*;", re.IGNORECASE)
_SPEED = re.compile(r"\s*vMove\.v_tcp\s*:=\s*([^;]+);", re.IGNORECASE)
# Parts end in their number; other calls are the shop's own.
_CALL = re.compile(r"\s*([A-Za-z]\w*_\d{3,})\s*;\s*(?:!.*)?$")
_LANGUAGE = Language(
    "!",
    re.compile(r"\b(?:Move(?:L|J|C|AbsJ|Ext|Circ)\w*|SearchL|SearchC|Trigg[LJC])\b", re.IGNORECASE),
    re.compile(r"^\s*(?:FOR|WHILE|TEST)\b|^\s*IF\b.*\bTHEN\b", re.IGNORECASE),
    re.compile(r"\b(?:ENDFOR|ENDWHILE|ENDTEST|ENDIF)\b", re.IGNORECASE),
    re.compile(r"\bGOTO\b", re.IGNORECASE),
)
# Length of a quaternion: its decimals are the user's choice.
UNIT = 0.01


class RapidOptions(Strict):
    """``tool_mass_kg``, ``tool_centre_mm``: load of the tool; without it the tooldata must stand on the controller."""

    tool_mass_kg: Positive | None = None
    tool_centre_mm: tuple[float, float, float] = (0.0, 0.0, 1.0)


def abb_configuration(robot: Robot, q: Array, controller_deg: Array) -> Integers:
    """cf1, cf4, cf6, cfx (n, 4) of poses q (n, 6) rad with ABB's angles (n, 6) deg."""
    behind, backward, negative = sides(robot, q, controller_deg)
    quarters = np.floor(controller_deg[:, [0, 3, 5]] / 90.0)
    cfx = 4 * behind + 2 * backward + 1 * negative
    return np.column_stack([quarters, cfx]).astype(np.int64)


def _motion(out: Collector, where: str, order: str, text: str, speed: float) -> None:
    lists = re.findall(r"\[([^\[\]]*)\]", text)
    values = [[number(where, item) for item in part.split(",")] for part in lists]
    lengths = [len(part) for part in values]
    used = [v for v in values[-1] if v < 8.9e9] if values else []
    if order == "moveabsj" and lengths == [ARM, EXTERNALS]:
        out.add(where, "joint", values[0], used, joint=True, speed=speed)
    elif order != "moveabsj" and lengths == [3, 4, 4, EXTERNALS]:
        if abs(np.linalg.norm(values[1]) - 1.0) > UNIT:
            raise InputError(f"{where}, orientation", value=lists[1], allowed="a quaternion of length 1")
        sides = tuple(whole(f"{where}, configuration", item) for item in lists[2].split(","))
        out.add(where, "cartesian", values[0] + values[1], used, sides, joint=order == "movej", speed=speed)
    else:
        raise InputError(where, value=text[:80], allowed="robtarget [[3],[4],[4],[6]], jointtarget [[6],[6]]")


class Rapid(Controller):
    """ABB RAPID."""

    name, title = "rapid", "ABB RAPID"
    table = ("abb", RapidOptions)
    words = frozenset((
        "do", "end", "endmodule", "endproc", "false", "for", "if", "main", "module", "movej", "movel", "proc",
        "return", "stop", "then", "true", "while",
    ))  # fmt: skip

    def configuration(self, robot: Robot, q: Array, controller_deg: Array) -> Integers:
        """See :class:`Controller`."""
        return abb_configuration(robot, q, controller_deg)

    def files(self, job: Job, made: Sandbox) -> list[ProgramFile]:
        """The main module and one for each part."""
        o = job.options
        names = part_names(job, o.name)
        external = len(job.external_decimals)
        if external > EXTERNALS:
            raise InputError("external axes in RAPID", value=external, allowed=f"at most {EXTERNALS}")
        shared = self.context(job) | {"parts": names, "unused": (UNUSED,) * (EXTERNALS - external)}

        def main() -> Iterator[str]:
            load = o.own(RapidOptions)
            mass = load.tool_mass_kg
            own = {
                "tool": None if mass is None else frame_words(job, job.T_tool, quaternions, o.decimals.quaternion),
                "base": frame_words(job, job.T_base, quaternions, o.decimals.quaternion),
                "mass": "" if mass is None else plain(mass),
                "centre": [f"{v:.3f}" for v in load.tool_centre_mm],
                "first_speed": plain(float(job.commands.speed[0]) * 1e3),
                "linear_mm_s": plain(o.rapid_mm_s),
                "zone": [plain(o.blend_mm * share) for share in ZONE],
            }
            return rendered(made, "rapid/main.j2", shared | own)

        moves = (
            words_of(job, quaternions, o.decimals.quaternion),
            configurations_of(job, self.configuration),
            speeds_of(job, 1e-3),
        )
        return [ProgramFile(f"{o.name}.mod", main), *self.part_files(job, made, names, ".mod", shared, moves)]

    def read(self, files: Mapping[str, str], program: JointProgram, options: WriteOptions) -> ReadMoves:
        """See :class:`Controller`; MoveL, MoveJ and MoveAbsJ with the target in the instruction are read."""
        out = Collector()
        speed = np.nan
        for line in _LANGUAGE.program(files, main_file(files, ".mod"), _CALL, ".mod"):
            motion = _MOTION.match(line.code)
            line.check_read("MoveL [[...]], MoveAbsJ [[...]]", read=motion is not None)
            if motion is not None:
                _motion(out, line.where, motion[1].lower(), motion[2], speed)
            elif (said := _SPEED.match(line.code)) is not None:
                speed = number(f"{line.where}, v_tcp", said[1]) * 1e-3
        return out.moves()

    def frames(self, words: Array) -> Array:
        """Tool frames (n, 4, 4) m in the work object of positions (mm) and quaternions (n, 7)."""
        return framed(from_quaternions(words[:, 3:]), words[:, :3] * 1e-3)

    def orientation_digits(self, options: WriteOptions) -> tuple[str, int, float]:
        """See :class:`Controller`."""
        return "quaternion", options.decimals.quaternion, 2.0

    def notes(self, job: Job) -> list[str]:
        """See :class:`Controller`."""
        o = job.options
        unknown = f"the load of the tool is not known: tooldata {o.tool_name} has to stand on the controller"
        return super().notes(job) + ([unknown] if o.own(RapidOptions).tool_mass_kg is None else [])


FORMAT = Rapid()
