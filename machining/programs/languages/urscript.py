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
from collections.abc import Iterator, Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from machining.cell.schema import Positive, Strict
from machining.programs.commands import Commands
from machining.programs.controller import Controller
from machining.programs.job import Job
from machining.programs.program import JointProgram
from machining.programs.rendering import rendered
from machining.programs.sandbox import Sandbox
from machining.programs.words import ARM, plain
from machining.programs.write_options import WriteOptions
from machining.programs.written import Collector, Language, ProgramFile, ReadMoves, main_file, number
from robots import InputError, Robot
from robots.arrays import Array
from robots.constants import MM

_MOTION = re.compile(r"\s*movej\(\s*\[([^\[\]]*)\]\s*((?:,\s*\w+\s*=\s*[^,()]+)*)\)\s*$")
_TIME = re.compile(r",\s*t\s*=\s*([^,\s]+)")
_LANGUAGE = Language(
    "#",
    re.compile(r"\b(?:move[jlcp]|servo[jc]|speed[jl]|optimove[jl]|path_offset_set|teach_mode|freedrive_mode)\s*\("),
    re.compile(r"^\s*(?:if|while|thread)\b"),
    re.compile(r"(?!)"),
    re.compile(r"\b(?:jump|halt)\b"),
)
# Share of the way to a neighbour that a corner may take: two corners never meet.
CORNER = 0.45
# Digits of a radian beyond those of a degree.
FINER = 2


class UrScriptOptions(Strict):
    """``speed_rad_s``, ``acceleration_rad_s2``: of the leading axis on the way to the first point."""

    speed_rad_s: Positive = 0.2
    acceleration_rad_s2: Positive = 0.5


def corners(job: Job) -> Array:
    """Radii (n,) m of corners: the blending asked for, less where neighbours are near, none at exact stops."""
    tip = job.program.T_part_tool[:, :3, 3]
    way = np.linalg.norm(np.diff(tip, axis=0), axis=1)
    free = np.minimum(np.append(way, 0.0), np.concatenate([[0.0], way]))
    radius = np.minimum(job.options.blend_mm * MM, CORNER * free)
    stops = list(job.stops()) + np.flatnonzero(job.program.motions.dwell > 0.0).tolist()
    radius[stops] = 0.0
    return np.asarray(radius)


class UrScript(Controller):
    """Universal Robots URScript."""

    name, title = "urscript", "Universal Robots URScript"
    kinds = ("joint",)
    external_axes = "none"
    table = ("urscript", UrScriptOptions)
    words = frozenset(
        {"def", "end", "if", "while", "for", "return", "thread", "true", "false", "movej", "movel", "global"}
    )

    def check(self, robot: Robot, externals: int, options: WriteOptions) -> None:
        """See :class:`Controller`."""
        super().check(robot, externals, options)
        if externals or robot.dof != ARM:
            raise InputError(
                "axes in URScript",
                value=f"{robot.dof} joints, {externals} external axes",
                allowed=f"{ARM} joints, no external axes",
                remedy="choose another format",
            )

    def files(self, job: Job, made: Sandbox) -> list[ProgramFile]:
        """One script."""
        own, o = job.options.own(UrScriptOptions), job.options
        pose = [*job.T_tool[:3, 3], *Rotation.from_matrix(job.T_tool[:3, :3]).as_rotvec()]
        radius = corners(job)

        def timing(part: slice) -> list[tuple[str, ...]]:
            """What follows the joints: time or speed, and the corner's radius."""
            time, near = job.commands.duration[part], radius[part]
            start = f"a={plain(own.acceleration_rad_s2)}, v={plain(own.speed_rad_s)}"
            return [
                (start if np.isnan(t) else f"t={plain(t)}", plain(r) if r > 0.0 else "0")
                for t, r in zip(time.tolist(), near.tolist(), strict=True)
            ]

        def whole() -> Iterator[str]:
            digits = (o.decimals.angle + FINER,) * ARM
            moves = job.moves(
                0, job.n, lambda part: (np.radians(job.angles(part)), digits), timing,
                lambda part: [""] * (part.stop - part.start),
            )  # fmt: skip
            more = {"tcp": [f"{v:.9f}" for v in pose], "moves": moves}
            return rendered(made, "urscript/main.j2", self.context(job) | more)

        return [ProgramFile(f"{o.name}.script", whole)]

    def read(self, files: Mapping[str, str], program: JointProgram, options: WriteOptions) -> ReadMoves:
        """See :class:`Controller`; movej to six joint angles is read."""
        out = Collector()
        for line in _LANGUAGE.statements(*main_file(files, ".script")):
            found = _MOTION.match(line.code)
            line.check_read("movej([6 angles], ...)", read=found is not None)
            if found is not None:
                angles = [number(line.where, item) for item in found[1].split(",")]
                if len(angles) != ARM:
                    raise InputError(line.where, value=f"{len(angles)} angles", allowed=f"{ARM}")
                time = _TIME.search(found[2])
                duration = np.nan if time is None else number(f"{line.where}, t", time[1])
                out.add(line.where, "joint", np.degrees(angles).tolist(), (), joint=True, duration=duration)
        return out.moves()

    def pace(self, found: ReadMoves, wanted: Commands, options: WriteOptions) -> float:
        """See :class:`Controller`: times; the first move has none."""
        self.check_said(found.duration[1:])
        return float(np.abs(found.duration[1:] / wanted.duration[1:] - 1.0).max(initial=0.0))

    def notes(self, job: Job) -> list[str]:
        """See :class:`Controller`."""
        short = int((job.commands.duration[1:] < 2e-3).sum())
        slow = [f"{short} moves take less than 2 ms, a controller's cycle: their time is not kept"] if short else []
        return [*super().notes(job), *slow, "joint signs and zeros are those of [arm]: check them on the robot"]


FORMAT = UrScript()
