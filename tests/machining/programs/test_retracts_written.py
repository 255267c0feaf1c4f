"""Twenty programs with places of the machine: in the robot program no rapid below the retract changes x or y.

Judged are the texts of KRL and RAPID, by a parser of their own that knows moves and speeds and nothing of the writers.
The heights are worked out by hand: 10 mm above the highest point of each path.
"""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from program_cases import PLAIN
from verification_cases import placed

import fem
from machining.cell import Body, Cell, Tool, arm_of, box, capsule
from machining.programs.formats import NEUTRAL, parse_options, write_program
from machining.programs.posting import PostSettings, post
from machining.programs.program import JointProgram
from machining.toolpaths import ReadOptions, read_toolpath
from machining.verification import Kind, Severity, verify
from robots.arrays import Array
from robots.frames import framed

HEAD = "G21 G90 G17 G54\nT1 M6\nS5000 M3\nG0 X0 Y0 Z15\nG1 Z-5 F600\nX20\n"
INCH = "G20 G90\nG0 X0 Y0 Z0.5\nG1 Z-0.2 F20\nX1\n"
CUT = "G1 Z-5\nX100\n"
SIEMENS = 'G71 G90 G17 G54\nT="MILL"\nM6\nS5000 M3\nG0 X0 Y0 Z15\nG1 Z-5 F600\nX20\n'
APT = "UNITS/MM\nLOADTL/1\nSPINDL/RPM,5000,CLW\nRAPID\nGOTO/0,0,15\nFEDRAT/600,MMPM\nGOTO/0,0,-5\nGOTO/20,0,-5\n"


def _klartext(*lines: str) -> str:
    return "\n".join(f"{k} {line}" for k, line in enumerate(["BEGIN PGM A MM", *lines, "END PGM A MM"]))


KLARTEXT = ("TOOL CALL 1 Z S5000", "L X+0 Y+0 Z+15 R0 FMAX M3", "L Z-5 F300", "L X+20")


class Case(NamedTuple):
    """A program, and the lowest height mm of rapid moves across in it."""

    suffix: str
    text: str
    height: float = 25.0


CASES = {
    # FANUC
    "g53_then_xy": Case("nc", f"{HEAD}G53 G0 Z0\nG0 X80 Y40\nG43 H1 Z5\n{CUT}G0 Z15\nM30"),
    "g28_incremental": Case("nc", f"{HEAD}G91 G28 Z0\nG90\nG0 X80 Y40\nG43 H1 Z5\n{CUT}G0 Z15\nG28 G91 Z0\nM30"),
    "g28_by_a_point": Case("nc", f"{HEAD}G0 Z15\nG28 X10 Y10 Z15\nG0 X80 Y40\nG0 Z5\n{CUT}M5\nM30", 15.0),
    "another_tool": Case(
        "nc", f"{HEAD}M5\nG91 G28 Z0\nG90\nT2 M6\nS3000 M3\nG0 X80 Y40\nG43 H2 Z50\nZ5\n{CUT}G28 G91 Z0\nM30", 60.0
    ),
    "several_in_a_row": Case(
        "nc",
        f"{HEAD}G91 G28 Z0\nG28 X0 Y0\nG30 P2 Z0\nG90\nG53 X-200 Y0\nG0 X80 Y40\nZ5\n{CUT}G28 G91 Z0\nG28 X0 Y0\nM30",
    ),
    # LinuxCNC and Haas
    "all_in_one_block": Case("ngc", f"{HEAD}G53 G0 Z0.\nG0 X80. Y40. Z5.\n{CUT}M2"),
    "home_of_all_axes": Case("ngc", f"{HEAD}G30\nG0 X80 Y40 Z5\n{CUT}G28\nM2"),
    "arc_behind": Case("ngc", f"{HEAD}G53 G0 Z0\nG53 G0 X0 Y0\nG0 X80\nY40\nZ5\nG1 Z-5\nG2 X100 I10 J0\nG53 Z0\nM2"),
    "inches": Case("ngc", f"{INCH}G53 G0 Z0\nG0 X3 Y1\nG43 H1 Z0.2\nG1 Z-0.2\nX4\nG0 Z0.5\nM2", 22.7),
    "down_at_feed": Case("ngc", f"{HEAD}G53 G0 Z0\nG0 X80 Y40\n{CUT}G53 G0 Z0\nG0 X0\nG1 X0 Y0 Z-5\nX20\nM2"),
    # Sinumerik
    "supa": Case("mpf", f"{SIEMENS}SUPA G0 Z300 D0\nG0 X80 Y40 D1\nZ5\n{CUT}G0 Z15\nSUPA G0 Z300\nM30"),
    "g153": Case("mpf", f"{SIEMENS}G0 G153 Z0\nG0 G153 X0 Y0\nG0 X80 Y40\nZ5\n{CUT}M30"),
    "cycle_behind": Case("mpf", f"{SIEMENS}G0 G53 Z0\nG0 X80 Y40\nG0 Z5\nCYCLE81(5,0,2,-10)\nG0 G53 Z0\nM30"),
    # Heidenhain
    "m140_and_m91": Case(
        "h",
        _klartext(
            *KLARTEXT,
            "L M140 MB MAX",
            "L X+80 Y+40 R0 FMAX",
            "L Z+5 R0 FMAX",
            "L Z-5 F300",
            "L X+100",
            "L Z+15 R0 FMAX",
            "L Z-1 R0 FMAX M91",
        ),
    ),
    "m91_with_xy": Case(
        "h",
        _klartext(
            *KLARTEXT,
            "L Z-1 R0 FMAX M91",
            "L X+0 Y+0 R0 FMAX M91",
            "TOOL CALL 2 Z S3000",
            "L X+80 Y+40 R0 FMAX M3",
            "L Z+5 R0 FMAX",
            "L Z-5 F300",
            "L X+100",
            "L Z+0 FMAX M92",
        ),
    ),
    "m140_by_a_way": Case(
        "h",
        _klartext(
            *KLARTEXT,
            "L M140 MB 50",
            "L X+80 Y+40 R0 FMAX",
            "L Z+5 R0 FMAX",
            "L Z-5 F300",
            "L X+100",
            "M140 MB MAX",
        ),
        45.0,
    ),
    # APT
    "gohome": Case("apt", f"{APT}GOHOME\nRAPID\nGOTO/80,40,5\nGOTO/80,40,-5\nGOTO/100,40,-5\nGOHOME\nFINI\n"),
    "retrct": Case("apt", f"{APT}RETRCT\nRAPID\nGOTO/80,40,5\nGOTO/80,40,-5\nGOTO/100,40,-5\nRETRCT\nGOHOME\nFINI\n"),
    "gohome_to_a_point": Case("apt", f"{APT}GOHOME/0,0,60\nRAPID\nGOTO/80,40,5\nGOTO/80,40,-5\nGOHOME/0,0,60\nFINI\n"),
    "gohome_for_a_tool": Case(
        "apt",
        f"{APT}SPINDL/OFF\nGOHOME\nLOADTL/2\nSPINDL/RPM,900,CLW\nRAPID\nGOTO/80,40,5\nGOTO/80,40,-5\nGOTO/100,40,-5\n"
        "GOHOME\nFINI\n",
    ),
}


def at(x: float, y: float, z: float) -> Array:
    return framed(np.eye(3), np.array([x, y, z]))


def cell(**more: object) -> Cell:
    tools = tuple(Tool(at(0, 0, length), number=k, name=name) for k, name, length in ((1, "MILL", 0.15), (2, "", 0.2)))
    return replace(Cell(T_world_part0=at(1.2, 0.0, 0.6), tool=Tool(at(0, 0, 0.15)), tools=tools), **more)  # type: ignore[arg-type]


def read(tmp_path: Path, case: Case, **options: object) -> JointProgram | object:
    file = tmp_path / f"part.{case.suffix}"
    file.write_text(case.text)
    return read_toolpath(file, options=ReadOptions(**options))  # type: ignore[arg-type]


def program_of(kr60: fem.ArmModel, tmp_path: Path, case: Case, **options: object) -> JointProgram:
    return post(kr60, cell(), read(tmp_path, case, **options), PostSettings(gamma=0.0)).program  # type: ignore[arg-type]


NUMBER = r"(-?\d+\.\d+)"
KRL = re.compile(rf"^(PTP|LIN) {{X {NUMBER},Y {NUMBER},Z {NUMBER},")
KRL_SPEED = re.compile(r"^\$VEL\.CP = ([\d.]+)")
RAPID = re.compile(rf"^\s*Move([JL]) \[\[{NUMBER},{NUMBER},{NUMBER}\]")
RAPID_SPEED = re.compile(r"^\s*vMove\.v_tcp := ([\d.]+)")


def moves(text: str) -> list[tuple[bool, float, Array]]:
    """Of each move of a program in KRL or RAPID: whether joints move, its speed in mm/s, and its end in mm."""
    out, speed = [], 0.0
    for line in text.splitlines():
        if found := KRL_SPEED.match(line):
            speed = 1e3 * float(found[1])
        elif found := RAPID_SPEED.match(line):
            speed = float(found[1])
        elif found := KRL.match(line) or RAPID.match(line):
            out.append((found[1] in ("PTP", "J"), speed, np.array([float(found[k]) for k in (2, 3, 4)])))
    return out


# mm/s of rapid moves in programs without options; all feeds of the cases are below.
FAST = 250.0
# mm: five decimals, and points put in to 10 um.
ROUNDED = 0.02


def low(text: str, height: float) -> list[tuple[Array, Array]]:
    """Rapid moves (both ends, mm) that change x or y below ``height`` mm; the way to the first point is none."""
    found = moves(text)
    assert len(found) > 8
    return [
        (a, b)
        for (_, _, a), (_, speed, b) in pairwise(found)
        if speed == FAST and np.abs(b - a)[:2].max() > ROUNDED and min(a[2], b[2]) < height - ROUNDED
    ]


def written(program: JointProgram, name: str) -> str:
    options = parse_options({"arm": PLAIN}, "options") if name == "rapid" else None
    return "\n".join(write_program(program, name, "cartesian", options).texts().values())


@pytest.mark.parametrize("name", CASES)
def test_no_rapid_below_the_retract_changes_x_or_y(kr60: fem.ArmModel, tmp_path: Path, name: str) -> None:
    case = CASES[name]
    program = program_of(kr60, tmp_path, case)
    for language in ("krl", "rapid"):
        text = written(program, language)
        assert low(text, case.height) == []
        # What is cut is still there, at one level, from x = 0 on.
        ends = np.array([end for _, speed, end in moves(text) if speed < FAST])
        assert ends[:, 0].min() == 0.0
        assert ends[:, 0].max() >= 80.0
    read_back = NEUTRAL[".json"].program(written(program, "json"), program.robot, program.cell)
    found = verify(read_back, arm_of("kr60-3"))
    assert Kind.LOW_RAPID not in {o.kind for o in found.offences}
    assert any("the cell gives no surface of it" in text for text in found.not_looked_at)


def test_a_rapid_that_was_lowered_by_hand_is_found(kr60: fem.ArmModel, tmp_path: Path) -> None:
    """Both by the checker of these tests and by `verify`, which replays the joints."""
    case = CASES["g53_then_xy"]
    program = program_of(kr60, tmp_path, case)
    text = written(program, "krl")
    lowered = text.replace("LIN {X 50.00000,Y 20.00000,Z 25.0", "LIN {X 50.00000,Y 20.00000,Z 24.0")
    assert len(low(lowered, case.height)) == 2
    across = int(np.argmin(np.abs(program.motions.points[:, 0] - 0.05)))
    q = program.q.copy()
    q[across, 1] += 1e-3
    found = verify(replace(program, q=q), arm_of("kr60-3"))
    offences = [o for o in found.offences if o.kind is Kind.LOW_RAPID]
    assert [(o.line, o.severity) for o in offences] == [(8, Severity.ERROR)]
    assert offences[0].limit == pytest.approx(0.025, abs=1e-5)
    assert 0.022 < offences[0].value < 0.0245


def test_a_straight_way_out_of_the_pocket_is_found(kr60: fem.ArmModel, tmp_path: Path) -> None:
    """What was written before there were retracts: from the bottom of the pocket to the next start in one line."""
    case = Case("nc", f"{HEAD}G0 X80 Y40 Z5\n{CUT}G0 Z15\nM30")
    program = program_of(kr60, tmp_path, case)
    assert low(written(program, "krl"), 5.0) != []
    found = verify(program, arm_of("kr60-3"))
    (offence,) = [o for o in found.offences if o.kind is Kind.LOW_RAPID]
    assert (offence.line, offence.severity) == (7, Severity.ERROR)
    assert (offence.value, offence.limit) == (pytest.approx(-0.005, abs=1e-5), pytest.approx(0.015, abs=1e-5))
    assert not found.clean


def with_stock(kr60: fem.ArmModel, tmp_path: Path, text: str) -> set[tuple[Kind, Severity]]:
    """Offences of cutter and part, whose top is z = 0, with an 8 mm mill of 40 mm."""
    tool = Tool(at(0, 0, 0.15), cutter=(Body("mill", (capsule((0, 0, 0.11), (0, 0, 0.146), 0.004),)),))
    stock = placed(Body("stock", (box((0.3, 0.3, 0.02)),)), 1.2, 0.0, 0.58)
    where = Cell(T_world_part0=at(1.2, 0.0, 0.6), tool=tool, part=stock)
    motions = read(tmp_path, Case("nc", text))
    program = post(kr60, where, motions, PostSettings(gamma=0.0)).program  # type: ignore[arg-type]
    found = verify(program, arm_of("kr60-3"))
    return {(o.kind, o.severity) for o in found.offences if o.kind in (Kind.RAPID_CONTACT, Kind.LOW_RAPID)}


def test_with_stock_in_the_cell_contacts_are_looked_for_instead(kr60: fem.ArmModel, tmp_path: Path) -> None:
    retracted = with_stock(kr60, tmp_path, CASES["g53_then_xy"].text)
    # Out of the cut along the tool: a warning.
    assert retracted == {(Kind.RAPID_CONTACT, Severity.WARNING)}
    straight = with_stock(kr60, tmp_path, f"{HEAD}G0 X80 Y40 Z5\n{CUT}G0 Z15\nM30")
    assert (Kind.RAPID_CONTACT, Severity.ERROR) in straight
    assert Kind.LOW_RAPID not in {kind for kind, _ in straight}
