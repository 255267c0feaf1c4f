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
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from machining.cell import Cell
from machining.programs.actions import Pattern
from machining.programs.controller import Controller
from machining.programs.convention import sides
from machining.programs.job import Job, external_axes, formatted
from machining.programs.orientation import RX_RY_RZ
from machining.programs.read_back import Grammar, ReadMove, Scan, file_of, number, whole
from machining.programs.write_options import WriteOptions
from robots import InputError, Robot
from robots.arrays import Array

_VALUE = re.compile(r"\s*<Value\s+([^<>]*?)/>\s*$")
_DATA = re.compile(r'\s*<Data\s+name="(\w+)"')
_ATTRIBUTE = re.compile(r'(\w+)="([^"]*)"')
_GRAMMAR = Grammar(
    main="start.pgx",
    comment="//",
    move=re.compile(
        r"\s*(movel|movej)\(\s*(pPath|jPath)\[([0-9]{1,9})\]\s*,\s*(?P<tool>\w+(?:\[\d+\])?)\s*,\s*(\w+)\s*\)\s*$"
    ),
    readable="movel or movej to pPath[i] or jPath[i]",
    motion=re.compile(r"\b(?:movel|movej|movec|movejf|compliantMove\w*)\s*\("),
    opens=re.compile(r"^\s*(?:if|for|while|do|switch)\b"),
    closes=re.compile(r"^\s*(?:endIf|endFor|endWhile|until|endSwitch)\b"),
    jumps=re.compile(r"\bgoto\b"),
    # Parts are named by their number; other calls are the shop's own.
    call=(re.compile(r"\s*call\s+(p\d{3,})\(\s*\)\s*$"), ".pgx"),
)
CARTESIAN, JOINTS, SIDES = (
    ("x", "y", "z", "rx", "ry", "rz"),
    tuple(f"j{i}" for i in range(1, 7)),
    ("shoulder", "elbow", "wrist"),
)
CONFIGURATIONS = np.array([("lefty", "righty"), ("epositive", "enegative"), ("wpositive", "wnegative")])
# Motion of an external axis below this (mm, deg) is rounding.
STILL = 1e-6


class Val3(Controller):
    """Staubli VAL3."""

    name, title = "val3", "Staubli VAL3"
    external_axes = "still"
    words = frozenset(
        (
            "begin",
            "call",
            "do",
            "end",
            "false",
            "for",
            "if",
            "movej",
            "movel",
            "return",
            "start",
            "stop",
            "then",
            "true",
            "wait",
            "while",
        )
    )
    main = (
        ("start.pgx", "start.j2"),
        ("stop.pgx", "stop.j2"),
        ("{name}.pjx", "project.j2"),
        ("{name}.dtx", "data.j2"),
    )
    part = "p{number:03d}.pgx"
    orientation = RX_RY_RZ
    speed_unit = 1e-3
    grammar = _GRAMMAR
    speed = re.compile(r"\s*(?P<name>\w+)\.tvel\s*=\s*(?P<value>\S+)\s*$")
    scaled = False
    own_stop = False
    tool_frame = "name"
    weighs = False
    actions = (
        Pattern("await", re.compile(r"\s*wait\(\s*(?P<name>[A-Za-z]\w*)\s*==\s*true\s*\)\s*$")),
        Pattern("output", re.compile(r"\s*(?P<name>[A-Za-z]\w*)\s*=\s*(?P<on>true|false)\s*$")),
        Pattern("wait", re.compile(r"\s*delay\(\s*(?P<value>[\d.]+)\s*\)\s*$")),
        Pattern("call", re.compile(r"\s*call\s+(?P<name>[A-Za-z]\w*)\(\s*(?P<value>\d+)\s*\)\s*$")),
        Pattern("stop", re.compile(r"\s*wait\(\s*(?P<name>[A-Za-z]\w*)\s*==\s*true\s*\)\s*$")),
        Pattern("analog", re.compile(r"\s*(?P<name>[A-Za-z]\w*)\s*=\s*(?P<value>[\d.]+)\s*$")),
    )
    asks = re.compile(r"\s*if\s+(?P<name>[A-Za-z]\w*)\s*==\s*true\s*$")

    def configuration(self, robot: Robot, q: Array, controller_deg: Array) -> NDArray[np.str_]:
        """Words (n, 3) for shoulder, elbow and wrist; see :class:`Controller`."""
        other = np.stack(sides(robot, q, controller_deg), axis=1).astype(int)
        return np.asarray(CONFIGURATIONS[np.arange(3), other])

    def tool_name(self, options: WriteOptions, number: int, place: int) -> str:
        """See :class:`Controller`: a place in the array of tools."""
        return f"{options.tool_name}[{place}]"

    def own_context(self, job: Job) -> dict[str, object]:
        """See :class:`Controller`."""
        axes = external_axes(job.program, slice(None))
        if axes.shape[1] and np.ptp(axes, axis=0).max() > STILL:
            raise InputError(
                "external axes that move, in VAL3",
                code="Q004",
                allowed="axes that stand still",
                remedy="choose another format, or split the path where they move",
            )
        return {
            "tools": [self.frame(job, tool.T) for tool in job.used],
            "base": self.frame(job, job.T_base),
            "external": formatted(job.externals(slice(0, 1)), job.external_decimals)[0],
            "blend": "off" if job.options.blend_mm == 0.0 else job.kind,
        }

    def notes(self, job: Job) -> list[str]:
        """See :class:`Controller`."""
        named = sorted({a.name for _, a in job.between.actions if a.name and a.kind != "call"})
        said = f"{', '.join(named)}: declare them in the application's data as dio and aio, and link them"
        return super().notes(job) + ([said] if named else [])

    def data(self, files: Mapping[str, str]) -> Mapping[str, Mapping[int, Mapping[str, str]]]:
        """See :class:`Controller`: the data file, by name and key."""
        return _data(*file_of(files, ".dtx"))

    def moved(self, where: str, found: re.Match[str], scan: Scan, cell: Cell, options: WriteOptions) -> ReadMove:
        """See :class:`Controller`: movel and movej to points of pPath and jPath in the data file."""
        external = [number("nExternal", item["value"]) for item in scan.data.get("nExternal", {}).values()]
        order, path, place, _, descriptor = found.groups()
        point = scan.data.get(path, {}).get(whole(f"{where}, {path}", place))
        if point is None:
            raise InputError(f"{where}: {path}[{place}]", code="Q005", allowed="a point of the data file")
        kind, names = ("cartesian", CARTESIAN) if path == "pPath" else ("joint", JOINTS)
        missing = [key for key in names if key not in point]
        if missing:
            raise InputError(
                f"{where}: {path}[{place}]", code="Q005", value=f"no {missing[0]}", allowed=" ".join(names)
            )
        words = [number(where, point[key]) for key in names]
        turns = [point[key] for key in SIDES if key in point]
        return ReadMove(where, kind, words, external, order == "movej", turns, scan.speed(descriptor))


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
                raise InputError(
                    f"{source}, line {i}, key", code="Q005", value=key, allowed="a whole number, each once"
                )
            here[int(key)] = attributes
        elif (found := _DATA.match(line)) is not None:
            if found[1] in out:
                raise InputError(
                    f"{source}, line {i}: data {found[1]} stands there twice", code="Q005", allowed="each name once"
                )
            here = out.setdefault(found[1], {})
    return out


FORMAT = Val3()
