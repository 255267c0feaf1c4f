"""Staubli VAL3: an application of project, data (points, frame, tool) and programs of movel or movej; read back too.

Syntax after the VAL3 reference manual, the description of its XML files, and public applications: a pointRx is x y z
(mm) rx ry rz (deg, about X, the new Y, the new Z) with its configuration in a frame, a jointRx six angles in deg. A
motion descriptor limits the tip's speed (``tvel``, mm/s; tmax in the data file) for movej as well as for movel; it is
set where the feed changes. Numbers are double precision.

A pointRx has no external axes. A cell whose external axes stand still is written; their places are in ``nExternal``.

Configurations (reference manual, arm configuration; public postprocessors): shoulder ``lefty`` in front and ``righty``
behind, elbow ``epositive`` and ``enegative`` by the sign of joint 3 from the stretched arm, wrist ``wpositive`` and
``wnegative`` by the sign of joint 5.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

import numpy as np

from machining.programs.configuration import sides
from machining.programs.controller import Controller
from machining.programs.job import Job, external_axes, formatted
from machining.programs.orientation import from_xyz_degrees, xyz_degrees
from machining.programs.program import JointProgram
from machining.programs.rendering import rendered
from machining.programs.sandbox import Sandbox
from machining.programs.words import configurations_of, frame_words, plain, speeds_of, words_of
from machining.programs.write_options import WriteOptions
from machining.programs.written import Collector, Language, ProgramFile, ReadMoves, main_file, number, whole
from robots import InputError, Robot
from robots.arrays import Array
from robots.frames import framed

_VALUE = re.compile(r"\s*<Value\s+([^<>]*?)/>\s*$")
_DATA = re.compile(r'\s*<Data\s+name="(\w+)"')
_ATTRIBUTE = re.compile(r'(\w+)="([^"]*)"')
_MOTION = re.compile(r"\s*(movel|movej)\(\s*(pPath|jPath)\[([0-9]{1,9})\]\s*,\s*(\w+)\s*,\s*(\w+)\s*\)\s*$")
_SPEED = re.compile(r"\s*(\w+)\.tvel\s*=\s*(\S+)\s*$")
# Parts are named by their number; other calls are the shop's own.
_CALL = re.compile(r"\s*call\s+(p\d{3,})\(\s*\)\s*$")
_LANGUAGE = Language(
    "//",
    re.compile(r"\b(?:movel|movej|movec|movejf|compliantMove\w*)\s*\("),
    re.compile(r"^\s*(?:if|for|while|do|switch)\b"),
    re.compile(r"^\s*(?:endIf|endFor|endWhile|until|endSwitch)\b"),
    re.compile(r"\bgoto\b"),
)
CARTESIAN, JOINTS, SIDES = (
    ("x", "y", "z", "rx", "ry", "rz"),
    tuple(f"j{i}" for i in range(1, 7)),
    ("shoulder", "elbow", "wrist"),
)
CONFIGURATIONS = (("lefty", "righty"), ("epositive", "enegative"), ("wpositive", "wnegative"))
# Motion of an external axis below this (mm, deg) is rounding.
STILL = 1e-6


def val3_configuration(robot: Robot, q: Array, controller_deg: Array) -> list[tuple[str, ...]]:
    """Words for shoulder, elbow and wrist, n tuples, of poses q (n, 6) rad with Staubli's angles (n, 6) deg."""
    found = np.stack(sides(robot, q, controller_deg), axis=1).astype(int).tolist()
    return [tuple(words[i] for words, i in zip(CONFIGURATIONS, row, strict=True)) for row in found]


def _nothing(part: slice) -> tuple[Array, tuple[int, ...]]:
    return np.zeros((part.stop - part.start, 0)), ()


def _data(source: str, text: str) -> dict[str, dict[int, dict[str, str]]]:
    """Attributes of each value, by name and key, of a data file that has each value on a line of its own."""
    out: dict[str, dict[int, dict[str, str]]] = {}
    here: dict[int, dict[str, str]] = {}
    for i, line in enumerate(text.splitlines(), 1):
        value = _VALUE.match(line)
        if value is not None:
            attributes = dict(_ATTRIBUTE.findall(value[1]))
            key = attributes.get("key", "")
            if not (key.isascii() and key.isdecimal() and len(key) < 10) or int(key) in here:
                raise InputError(f"{source}, line {i}, key", value=key, allowed="a whole number, each once")
            here[int(key)] = attributes
        elif (found := _DATA.match(line)) is not None:
            if found[1] in out:
                raise InputError(f"{source}, line {i}: data {found[1]} stands there twice", allowed="each name once")
            here = out.setdefault(found[1], {})
    return out


class Val3(Controller):
    """Staubli VAL3."""

    name, title = "val3", "Staubli VAL3"
    external_axes = "still"
    words = frozenset((
        "begin", "call", "do", "end", "false", "for", "if", "movej", "movel", "return", "start", "stop", "then",
        "true", "wait", "while",
    ))  # fmt: skip

    def configuration(self, robot: Robot, q: Array, controller_deg: Array) -> list[tuple[str, ...]]:
        """See :class:`Controller`."""
        return val3_configuration(robot, q, controller_deg)

    def files(self, job: Job, made: Sandbox) -> list[ProgramFile]:
        """Project, start and stop programs, data, and a program for each part."""
        o, digits = job.options, job.options.decimals.angle
        everything = slice(0, job.n)
        axes = external_axes(job.program, everything)
        if axes.shape[1] and np.ptp(axes, axis=0).max() > STILL:
            raise InputError(
                "external axes that move, in VAL3",
                allowed="axes that stand still",
                remedy="choose another format, or split the path where they move",
            )
        names = [f"p{i + 1:03d}" for i in range(len(job.parts()))]
        shared = self.context(job) | {"parts": names, "base": frame_words(job, job.T_base, xyz_degrees, digits)}

        words, sides_of = words_of(job, xyz_degrees, digits), configurations_of(job, self.configuration)

        def data() -> Iterator[str]:
            own = {
                "tool": frame_words(job, job.T_tool, xyz_degrees, digits),
                "external": formatted(job.externals(slice(0, 1)), job.external_decimals)[0],
                "first_speed": plain(float(job.commands.speed[0]) * 1e3),
                "blend": "off" if o.blend_mm == 0.0 else "cartesian" if job.kind == "cartesian" else "joint",
                "moves": job.moves(0, job.n, words, sides_of, lambda part: [""] * (part.stop - part.start)),
            }
            return rendered(made, "val3/data.j2", shared | own)

        def simple(template: str) -> Iterator[str]:
            return rendered(made, f"val3/{template}.j2", shared)

        files = [
            ProgramFile("start.pgx", lambda: simple("start")),
            ProgramFile("stop.pgx", lambda: simple("stop")),
            ProgramFile(f"{o.name}.pjx", lambda: simple("project")),
            ProgramFile(f"{o.name}.dtx", data),
        ]
        spoken = _nothing, lambda part: [()] * (part.stop - part.start), speeds_of(job, 1e-3)
        return [*files, *self.part_files(job, made, names, ".pgx", shared, spoken)]

    def read(self, files: Mapping[str, str], program: JointProgram, options: WriteOptions) -> ReadMoves:
        """See :class:`Controller`; movel and movej to points of pPath and jPath in the data file are read."""
        start = main_file({k: v for k, v in files.items() if k.endswith("start.pgx")}, ".pgx")
        data = _data(*main_file(files, ".dtx"))
        external = [number("nExternal", item["value"]) for item in data.get("nExternal", {}).values()]
        out = Collector()
        speeds: dict[str, float] = {}
        for line in _LANGUAGE.program(files, start, _CALL, ".pgx"):
            where = line.where
            motion = _MOTION.match(line.code)
            line.check_read("movel or movej to pPath[i] or jPath[i]", read=motion is not None)
            if motion is not None:
                point = data.get(motion[2], {}).get(whole(f"{where}, {motion[2]}", motion[3]))
                if point is None:
                    raise InputError(f"{where}: {motion[2]}[{motion[3]}]", allowed="a point of the data file")
                kind, names = ("cartesian", CARTESIAN) if motion[2] == "pPath" else ("joint", JOINTS)
                missing = [key for key in names if key not in point]
                if missing:
                    raise InputError(
                        f"{where}: {motion[2]}[{motion[3]}]", value=f"no {missing[0]}", allowed=" ".join(names)
                    )
                words = [number(where, point[key]) for key in names]
                sides = tuple(point[key] for key in SIDES if key in point)
                speed = speeds.get(motion[5], np.nan)
                out.add(where, kind, words, external, sides, joint=motion[1] == "movej", speed=speed)
            elif (said := _SPEED.match(line.code)) is not None:
                speeds[said[1]] = number(f"{where}, tvel", said[2]) * 1e-3
        return out.moves()

    def frames(self, words: Array) -> Array:
        """Tool frames (n, 4, 4) m in the part's frame of x y z rx ry rz (n, 6)."""
        return framed(from_xyz_degrees(words[:, 3:]), words[:, :3] * 1e-3)


FORMAT = Val3()
