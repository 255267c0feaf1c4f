"""SINUMERIK 840D: joint programs, an axis word for each joint; and read back.

Syntax after the SINUMERIK programming manuals (Fundamentals, Job planning): G1 with ``name=value`` of machine axes,
TRAFOOF before, sub-programs called by name and ended by M17, G641 with ADIS for corners (deg: what ``blend_mm`` is at
the arm's full reach), G9 for an exact stop. Feed is inverse time (G93, F in 1/min in every block: 60 / s of the move),
or G94 with F in deg/min over all axes of FGROUP, where a mm of a linear axis counts as a deg (the control's reference
radius of 180/pi mm). Axis names, signs and zeros are what the machine was set up with: check them on the machine.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Literal, Self

import numpy as np
from pydantic import model_validator

from machining.cell import Cell
from machining.cell.schema import CommandsTable, Strict
from machining.programs.actions import Action, Pattern, by_table, digits, run_up
from machining.programs.controller import Controller
from machining.programs.job import Commands, Job, Kind, farthest, plain
from machining.programs.read_back import Grammar, ReadMove, ReadMoves, Scan, number, numbers
from machining.programs.write_options import WriteOptions
from machining.toolpaths.motions import Event, Motions
from robots import InputError
from robots.arrays import Bools
from robots.constants import RPM

AXIS = re.compile(r"[A-Z][A-Z0-9_]{0,15}")
# Address letters that are no axes.
NOT_AXES = frozenset("DEFGHLMNPRST")

_WORD = re.compile(r"([A-Z][A-Z0-9_]*)=(\S+)")
_FEED = re.compile(r"(?<![A-Z0-9_])F=?(-?[0-9.]+)(?![\w=])")
# What may stand before the words of a block.
_BLOCK = r"\s*(?:N\d+\s+)?"
_GRAMMAR = Grammar(
    main=".MPF",
    comment=";",
    move=re.compile(r"\s*(?:N\d+\s+)?G0*([01])\s+(.*)$", re.IGNORECASE),
    readable="G0 and G1 at the start of a block",
    motion=re.compile(r"\b(?:G0*[0123]|CIP|CT|POS|POSA|POLY|BSPLINE)\b", re.IGNORECASE),
    opens=re.compile(r"^\s*(?:N\d+\s+)?(?:LOOP|FOR|WHILE|REPEAT|IF(?!.*\bGOTO))\b", re.IGNORECASE),
    closes=re.compile(r"^\s*(?:N\d+\s+)?(?:ENDLOOP|ENDFOR|ENDWHILE|UNTIL|ENDIF)\b", re.IGNORECASE),
    jumps=re.compile(r"\bGOTO[BFCS]?\b", re.IGNORECASE),
    call=(re.compile(r"\s*([A-Za-z]\w*_\d{3,})\s*(?:;.*)?$"), ".SPF"),
)


class SinumerikOptions(Strict):
    """``feed``: "inverse_time" (G93, 1/min) or "per_minute" (G94, deg/min over all axes, mm counted as deg)."""

    axes: tuple[str, ...] = ("A1", "A2", "A3", "A4", "A5", "A6")
    linear: tuple[str, ...] = ("X1", "X2", "X3")
    table: str = "C1"
    feed: Literal["inverse_time", "per_minute"] = "inverse_time"

    @model_validator(mode="after")
    def _names(self) -> Self:
        names = (*self.axes, *self.linear, self.table)
        for name in names:
            if not AXIS.fullmatch(name) or name in NOT_AXES:
                raise ValueError(f"axis name {name!r} must be capitals and digits, and no address such as F or G")
        if len(set(names)) != len(names):
            raise ValueError("axis names must differ")
        return self

    def names_of(self, cell: Cell) -> list[str]:
        """Names of the joints, the linear axes, and the turntable. Raises InputError where names are missing."""
        linear, table = len(cell.linear_axes), cell.turntable is not None
        if linear > len(self.linear):
            raise InputError("names of linear axes", code="Q004", value=len(self.linear), allowed=f"{linear}")
        return [*self.axes, *self.linear[:linear], *([self.table] if table else [])]


class Sinumerik(Controller):
    """SINUMERIK 840D."""

    name, title = "sinumerik", "SINUMERIK 840D"
    kinds = ("joint",)
    table = ("sinumerik", SinumerikOptions)
    words = frozenset(
        (
            "call",
            "def",
            "do",
            "end",
            "false",
            "for",
            "if",
            "loop",
            "proc",
            "return",
            "stop",
            "sub",
            "then",
            "true",
            "while",
        )
    )
    main, part = (("{NAME}.MPF", "main.j2"),), "{NAME}_{number:03d}.SPF"
    terminals = (1, 8192)
    grammar = _GRAMMAR
    weighs = False
    actions = (
        Pattern("await", re.compile(_BLOCK + r"WHILE\s+NOT\s+\$A_IN\[(?P<name>\d+)\]\s*$", re.IGNORECASE)),
        Pattern("spindle", re.compile(_BLOCK + r"(?:S=?(?P<value>[\d.]+)\s+)?M0?3\s*$", re.IGNORECASE), "cw"),
        Pattern("spindle", re.compile(_BLOCK + r"(?:S=?(?P<value>[\d.]+)\s+)?M0?4\s*$", re.IGNORECASE), "ccw"),
        Pattern("spindle", re.compile(_BLOCK + r"M0?5\s*$", re.IGNORECASE), "off"),
        Pattern("coolant", re.compile(_BLOCK + r"M0?7\s*$", re.IGNORECASE), "mist", on=True),
        Pattern("coolant", re.compile(_BLOCK + r"M0?8\s*$", re.IGNORECASE), "flood", on=True),
        Pattern("coolant", re.compile(_BLOCK + r"M0?9\s*$", re.IGNORECASE), "off"),
        Pattern("tool", re.compile(_BLOCK + r"T=?(?P<value>\d+)\s+M0?6\s*$", re.IGNORECASE)),
        Pattern(
            "output", re.compile(_BLOCK + r"\$A_OUT\[(?P<name>\d+)\]\s*=\s*(?P<on>[01]|TRUE|FALSE)\s*$", re.IGNORECASE)
        ),
        Pattern("wait", re.compile(_BLOCK + r"G0?4\s+F=?(?P<value>[\d.]+)\s*$", re.IGNORECASE)),
        Pattern("stop", re.compile(_BLOCK + r"M0?0\s*$", re.IGNORECASE)),
        Pattern("optional_stop", re.compile(_BLOCK + r"M0?1\s*$", re.IGNORECASE)),
    )

    def means(self, event: Event, motions: Motions, table: CommandsTable) -> tuple[tuple[Action, ...], str]:
        """See :class:`Controller`: M codes, and the table for what has none; the spindle is the control's master."""
        if event.kind == "spindle":
            name = "off" if event.value == 0.0 else "cw" if event.value > 0.0 or event.text == "CLW" else "ccw"
            rpm = abs(event.value) / RPM
            turn = Action("spindle", name, digits("spindle", rpm) if rpm > 0.0 else "")
            return (turn, *(() if name == "off" else run_up(table))), ""
        if event.kind == "coolant" and event.text in ("mist", "flood"):
            return (Action("coolant", event.text, on=True),), ""
        if event.kind == "coolant" and event.text == "off":
            others, _ = by_table(event, motions, table, scaled=True, stops=True)
            return (Action("coolant", "off"), *others), ""
        if event.kind == "optional stop":
            return (Action("optional_stop"),), ""
        if event.kind == "tool" and motions.tools[int(event.value)].number is not None:
            return (Action("tool", value=str(motions.tools[int(event.value)].number)),), ""
        return super().means(event, motions, table)

    def own_context(self, job: Job) -> dict[str, object]:
        """See :class:`Controller`."""
        own, dof = job.options.own(SinumerikOptions), job.program.robot.dof
        if len(own.axes) != dof:
            raise InputError("[sinumerik] axes", code="Q004", value=len(own.axes), allowed=f"{dof} names, one a joint")
        axes, per_minute = own.names_of(job.program.cell), own.feed == "per_minute"
        # Of an axis that turns the farthest point by the zone.
        blend = np.degrees(job.options.blend_mm * 1e-3 / farthest(job.program))
        return {
            "names": axes,
            "group": axes if per_minute else [],
            "per_minute": per_minute,
            "blend_deg": plain(blend),
        }

    def pattern(self, job: Job) -> str:
        """See :class:`Controller`; the F word is none of the coordinates."""
        names, dof = job.options.own(SinumerikOptions).names_of(job.program.cell), job.program.robot.dof
        arm, others = ("".join(f" {name}=%s" for name in some) for some in (names[:dof], names[dof:]))
        return f"{arm}%.0s{others}"

    def configurations(self, job: Job, part: slice) -> list[tuple[str]]:
        """F words of moves: 1/min, or deg/min over all axes; the first move has none."""
        time = job.commands.duration[part]
        rate = 60.0 / time
        if job.options.own(SinumerikOptions).feed == "per_minute":
            # One move more in front, for the difference.
            wide = slice(max(part.start - 1, 0), part.stop)
            values = np.column_stack([job.angles(wide), job.externals(wide)])
            rate = rate * np.linalg.norm(np.diff(values, axis=0, prepend=values[:1]), axis=1)[-len(time) :]
            # A block in which nothing moves still needs an F.
            rate = np.where(rate > 0.0, rate, 1.0)
        return [("",) if not np.isfinite(v) else (plain(v),) for v in rate.tolist()]

    def remembered(self, where: str, code: str, scan: Scan, options: WriteOptions) -> Action | None:
        """See :class:`Controller`: inverse time (G93) or deg/min (G94)."""
        if per := {"G93", "G94"}.intersection(code.upper().split()):
            scan.own["per minute"] = [float("G94" in per)]
        return None

    def moved(self, where: str, found: re.Match[str], scan: Scan, cell: Cell, options: WriteOptions) -> ReadMove:
        """See :class:`Controller`; durations come from G93, with G94 from the way of all axes, mm counted as deg."""
        own = options.own(SinumerikOptions)
        (order, text), dof = found.groups(), len(own.axes)
        values, inverse = _values(where, text, own.names_of(cell)), scan.own.get("per minute", [0.0]) == [0.0]
        way = 0.0 if inverse else float(np.linalg.norm(np.subtract(values, scan.own.get("before", values))))
        time = _time(where, text, inverse, way) if order == "1" else np.nan
        scan.own["before"] = values
        return ReadMove(where, "joint", values[:dof], values[dof:], order == "0", duration=time)

    def joint_moves(self, wanted: Commands, kind: Kind) -> Bools:
        """See :class:`Controller`: G0 where a rapid joint move is asked for, else G1."""
        return wanted.joint

    def pace(self, found: ReadMoves, wanted: Commands, options: WriteOptions) -> float:
        """See :class:`Controller`: times, for speeds are of axes."""
        timed = ~found.joint
        if options.own(SinumerikOptions).feed == "per_minute":
            # A block in which no axis moves has no time of its own.
            timed &= found.duration > 0.0
        return self.off(found.duration[timed], wanted.duration[timed])

    def notes(self, job: Job) -> list[str]:
        """See :class:`Controller`."""
        return [
            *super().notes(job),
            "names, signs and zeros of the axes are as the machine was set up: check them there",
        ]


def _values(where: str, text: str, axes: Sequence[str]) -> list[float]:
    words = dict(_WORD.findall(text.upper()))
    missing = [name for name in axes if name not in words]
    if missing:
        raise InputError(
            where, code="Q005", value=f"no {', '.join(missing)}", allowed="a word for every axis in every block"
        )
    return numbers(where, [words[name] for name in axes])


def _time(where: str, text: str, inverse: bool, way: float) -> float:
    feed = _FEED.search(text.upper())
    rate = 0.0 if feed is None else number(where, feed[1])
    if rate <= 0.0:
        raise InputError(where, code="Q005", value=text.strip()[:80], allowed="an F of more than 0 in every G1 block")
    return 60.0 / rate if inverse else 60.0 * way / rate


FORMAT = Sinumerik()
