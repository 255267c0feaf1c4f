"""Universal Robots URScript: joint programs of movej, each move with its time; and read back.

Syntax after the URScript manual (movej, set_tcp, textmsg) and public programs: one file, a function that the controller
runs, joints in rad in the order base, shoulder, elbow, wrist 1 to 3, lengths in m, orientations as rotation vectors.
``t`` is the time of a move in s, for which the controller ignores ``a`` and ``v``; the first move has no time, so it
has these. ``r`` is the radius (m) within which a corner may be cut. A move whose radius overlaps that of its
neighbour is skipped by the controller, so ``r`` stays below half the way to either neighbour.

There are no external axes in it, and no straight moves: movel leaves the branch of the inverse kinematics to the
controller, which an arm that was verified in another branch must not have.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from machining.cell import Cell
from machining.cell.schema import Positive, Strict
from machining.programs.actions import Pattern
from machining.programs.controller import ARM, Controller
from machining.programs.job import Commands, Job, ToolData, plain
from machining.programs.read_back import Grammar, ReadMove, ReadMoves, Scan, number, numbers
from machining.programs.write_options import WriteOptions
from robots import InputError, Robot
from robots.arrays import Array
from robots.constants import MM

_TIME = re.compile(r",\s*t\s*=\s*([^,\s]+)")
_OUT = r"\s*set_standard_{}_out\(\s*(?P<name>\d+)\s*,\s*(?P<{}>{})\s*\)\s*$"
_GRAMMAR = Grammar(
    main=".script",
    comment="#",
    move=re.compile(r"\s*movej\(\s*\[([^\[\]]*)\]\s*((?:,\s*\w+\s*=\s*[^,()]+)*)\)\s*$"),
    readable="movej([6 angles], ...)",
    motion=re.compile(
        r"\b(?:move[jlcp]|servo[jc]|speed[jl]|optimove[jl]|path_offset_set|teach_mode|freedrive_mode)\s*\("
    ),
    opens=re.compile(r"^\s*(?:if|while|thread)\b"),
    closes=re.compile(r"^\s*end\b"),
    jumps=re.compile(r"\b(?:jump|halt)\b"),
)
# Share of the way to a neighbour that a corner may take: two corners never meet.
CORNER = 0.45
# Digits of a radian beyond those of a degree.
FINER = 2


class UrScriptOptions(Strict):
    """``speed_rad_s``, ``acceleration_rad_s2``: of the leading axis on the way to the first point."""

    speed_rad_s: Positive = 0.2
    acceleration_rad_s2: Positive = 0.5


class UrScript(Controller):
    """Universal Robots URScript."""

    name, title = "urscript", "Universal Robots URScript"
    kinds = ("joint",)
    external_axes = "none"
    table = ("urscript", UrScriptOptions)
    words = frozenset(
        {"def", "end", "if", "while", "for", "return", "thread", "true", "false", "movej", "movel", "global"}
    )
    main = (("{name}.script", "main.j2"),)
    terminals = (0, 7)
    tool_frame = "figures"
    grammar = _GRAMMAR
    actions = (
        Pattern("await", re.compile(r"\s*while\s+not\s+get_standard_digital_in\(\s*(?P<name>\d+)\s*\)\s*:\s*$")),
        Pattern("payload", re.compile(r"\s*set_payload\(\s*(?P<value>.*)\)\s*$")),
        Pattern("output", re.compile(_OUT.format("digital", "on", "True|False"))),
        Pattern("analog", re.compile(_OUT.format("analog", "value", r"[\d.]+"))),
        Pattern("wait", re.compile(r"\s*sleep\(\s*(?P<value>[\d.]+)\s*\)\s*$")),
        Pattern("stop", re.compile(r"\s*popup\(.*\bblocking\s*=\s*True\s*\)\s*$")),
        Pattern("tool_frame", re.compile(r"\s*set_tcp\(\s*p\[(?P<value>[^\[\]]*)\]\s*\)\s*$")),
        Pattern("call", re.compile(r"\s*(?P<name>[A-Za-z]\w*)\(\s*(?P<value>\d+)\s*\)\s*$")),
    )
    asks = re.compile(r"\s*if\s+get_standard_digital_in\(\s*(?P<name>\d+)\s*\)\s*:\s*$")

    def check(self, robot: Robot, externals: int, options: WriteOptions) -> None:
        """See :class:`Controller`."""
        super().check(robot, externals, options)
        if externals or robot.dof != ARM:
            raise InputError(
                "axes in URScript",
                code="Q004",
                value=f"{robot.dof} joints, {externals} external axes",
                allowed=f"{ARM} joints, no external axes",
                remedy="choose another format",
            )

    def own_context(self, job: Job) -> dict[str, object]:
        """See :class:`Controller`."""
        return {
            "tcp": self.tool_value(job.first_tool.T, job.options),
            "load": self.load_value(job.first_tool, job.options),
        }

    def load_value(self, tool: ToolData, options: WriteOptions) -> str:
        """See :class:`Controller`: mass in kg and its centre in m; the controller takes no inertia here."""
        if tool.load is None:
            return ""
        return f"{tool.load.mass:.3f}, [{', '.join(f'{v:.6f}' for v in tool.load.T[:3, 3].tolist())}]"

    def tool_value(self, T: Array, options: WriteOptions) -> str:
        """See :class:`Controller`: m and a rotation vector in rad."""
        pose = [*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_rotvec()]
        return ", ".join(f"{v:.9f}" for v in pose)

    def coordinates(self, job: Job, part: slice) -> tuple[Array, Sequence[int]]:
        """See :class:`Controller`: in rad."""
        return np.radians(job.angles(part)), (job.options.decimals.angle + FINER,) * ARM

    def configurations(self, job: Job, part: slice) -> list[tuple[str, str]]:
        """What follows the joints: time or speed, and the corner's radius."""
        own = job.options.own(UrScriptOptions)
        start = f"a={plain(own.acceleration_rad_s2)}, v={plain(own.speed_rad_s)}"
        return [
            (start if np.isnan(t) else f"t={plain(t)}", plain(r) if r > 0.0 else "0")
            for t, r in zip(job.commands.duration[part].tolist(), corners(job, part).tolist(), strict=True)
        ]

    def moved(self, where: str, found: re.Match[str], scan: Scan, cell: Cell, options: WriteOptions) -> ReadMove:
        """See :class:`Controller`: movej to six joint angles."""
        angles = numbers(where, found[1].split(","))
        if len(angles) != ARM:
            raise InputError(where, code="Q005", value=f"{len(angles)} angles", allowed=f"{ARM}")
        time = _TIME.search(found[2])
        duration = np.nan if time is None else number(f"{where}, t", time[1])
        return ReadMove(where, "joint", np.degrees(angles).tolist(), (), joint=True, duration=duration)

    def pace(self, found: ReadMoves, wanted: Commands, options: WriteOptions) -> float:
        """See :class:`Controller`: times; the first move has none."""
        return self.off(found.duration[1:], wanted.duration[1:])

    def notes(self, job: Job) -> list[str]:
        """See :class:`Controller`."""
        short = int((job.commands.duration[1:] < 2e-3).sum())
        slow = [f"{short} moves take less than 2 ms, a controller's cycle: their time is not kept"] if short else []
        return [*super().notes(job), *slow, "joint signs and zeros are those of [arm]: check them on the robot"]


def corners(job: Job, part: slice) -> Array:
    """Radii (m,) m of corners: the blending asked for, less where neighbours are near, none at exact stops."""
    tip, i = job.program.T_part_tool[:, :3, 3], np.arange(part.start, part.stop)
    there = np.linalg.norm(tip[i] - tip[np.maximum(i - 1, 0)], axis=1)
    onward = np.linalg.norm(tip[np.minimum(i + 1, job.n - 1)] - tip[i], axis=1)
    radius = np.minimum(job.options.blend_mm * MM, CORNER * np.minimum(there, onward))
    return np.where(job.stops[part], 0.0, radius)


FORMAT = UrScript()
