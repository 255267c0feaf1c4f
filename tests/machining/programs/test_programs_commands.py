"""Spindle, coolant, rests, tools, stops and probe as each controller does them: in the source's order, read back."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from program_cases import PLAIN, cell_of, program_of, rail
from refusals import refuses
from scipy.spatial.transform import Rotation

from machining.cell import parse_cell
from machining.programs.formats import FORMATS, parse_options, round_trip, write_program
from machining.programs.program import JointProgram
from machining.programs.write_options import WriteOptions
from machining.toolpaths import read_toolpath
from machining.toolpaths.events import ordered
from machining.toolpaths.motions import Motions
from robots import InputError, InputErrors

BUNDLED = Path(__file__).parents[3] / "machining" / "programs" / "templates"
SOURCE = """G21 G90 G54
T3 M6
S6000 M3
M8
G0 X0 Y0 Z50
G1 Z0 F600
G4 P1.5
X20
M9
M5
M1
G0 Z50
S1500 M4
M7
G1 Z1
M0
G1 X40
G0 Z50
M30
"""
NUMBERS = """
spindle_clockwise = 1
spindle_counterclockwise = 2
spindle_speed = 0
spindle_full_rpm = 12000
coolant_flood = 3
coolant_mist = 4
optional_stop = 5
tool_change = "CHANGE_TOOL"
"""
NAMES = re.sub(r"= (\d)$", r'= "io\1"', NUMBERS, flags=re.M).replace("CHANGE_TOOL", "changeTool") + 'restart = "go"\n'
TABLES = {"krl": NUMBERS.replace("speed = 0", "speed = 6"), "rapid": NAMES, "val3": NAMES, "urscript": NUMBERS}
TABLES["sinumerik"] = TABLES["krl"]
# What stands between the moves, M, of the source, in each language.
WANTED = {
    "krl": """CHANGE_TOOL(3)|$OUT[2]=FALSE|$ANOUT[6]=0.50000|$OUT[1]=TRUE|
$OUT[3]=TRUE|M|M|WAIT SEC 1.500|M|$OUT[3]=FALSE|$OUT[4]=FALSE|$OUT[1]=FALSE|$OUT[2]=FALSE|
$ANOUT[6]=0.00000|IF $IN[5] THEN|HALT|ENDIF|M|$OUT[1]=FALSE|$ANOUT[6]=0.12500|$OUT[2]=TRUE|
$OUT[4]=TRUE|M|HALT|M|M|$OUT[1]=FALSE|$OUT[2]=FALSE|$ANOUT[6]=0.00000|$OUT[3]=FALSE|$OUT[4]=FALSE""",
    "rapid": """changeTool 3;|SetDO io2,0;|SetAO io0,6000.00000;|SetDO io1,1;|
SetDO io3,1;|M|M|WaitTime 1.500;|M|SetDO io3,0;|SetDO io4,0;|SetDO io1,0;|SetDO io2,0;|
SetAO io0,0.00000;|IF io5=1 THEN|Stop;|ENDIF|M|SetDO io1,0;|SetAO io0,1500.00000;|SetDO io2,1;|
SetDO io4,1;|M|Stop;|M|M|SetDO io1,0;|SetDO io2,0;|SetAO io0,0.00000;|SetDO io3,0;|SetDO io4,0;""",
    "val3": """call changeTool(3)|io2=false|io0=6000.00000|io1=true|io3=true|M|M|
delay(1.500)|M|io3=false|io4=false|io1=false|io2=false|io0=0.00000|if io5==true|wait(go==true)|
endIf|M|io1=false|io0=1500.00000|io2=true|io4=true|M|wait(go==true)|M|M|io1=false|io2=false|
io0=0.00000|io3=false|io4=false""",
    "sinumerik": """T3 M6|S6000.000 M3|M8|M|M|G4 F1.500|M|M9|$A_OUT[3]=0|$A_OUT[4]=0|M5|
M1|M|S1500.000 M4|M7|M|M0|M|M|M5|M9|$A_OUT[3]=0|$A_OUT[4]=0""",
    "urscript": """CHANGE_TOOL(3)|OUT(2, False)|ANALOG(0, 0.50000)|OUT(1, True)|
OUT(3, True)|M|M|sleep(1.500)|M|OUT(3, False)|OUT(4, False)|OUT(1, False)|OUT(2, False)|
ANALOG(0, 0.00000)|if get_standard_digital_in(5):|STOP|end|M|OUT(1, False)|ANALOG(0, 0.12500)|
OUT(2, True)|OUT(4, True)|M|STOP|M|M|OUT(1, False)|OUT(2, False)|ANALOG(0, 0.00000)|OUT(3, False)|
OUT(4, False)""",
}
BOTH = [(name, kind) for name in WANTED for kind in FORMATS[name].kinds]
MOTION = re.compile(r"(?:LIN|PTP|Move\w+|movel|movej|G0*[01])\b")
# Speeds, frames, and what a program needs at its head and end.
OTHERS = re.compile(
    r"(?:;|!|//|#|&|DEF\b|END$|end$|begin|\$VEL\.|vMove|mMove|mStop|waitEndMove|M17|PROC|ENDPROC|MODULE|ENDMODULE|"
    r"<|\]\]|def |set_tcp|$)"
)


def options(**more: Any) -> WriteOptions:
    return parse_options({"arm": PLAIN} | more, "options")


def read(tmp_path: Path, text: str = SOURCE, name: str = "part.nc") -> Motions:
    (tmp_path / name).write_text(text, encoding="utf-8")
    return read_toolpath(tmp_path / name)


def program(motions: Motions, table: str) -> JointProgram:
    """The commands of motions in a program of as many moves; where these lead does not matter here."""
    where = parse_cell(f'schema = "stiffarm-cell/1"\n[commands]\n{table}', "cell.toml", Path())
    given = program_of(n=motions.n, cell=replace(cell_of(), commands=where.commands))
    own = replace(motions, points=given.motions.points, axes=given.motions.axes)
    return replace(given, motions=replace(own, feed=np.where(own.rapid, np.nan, 0.02)))


def statements(texts: dict[str, str], name: str) -> list[str]:
    """Statements of a program between its moves (M), in order; shorter names for what is long."""
    body = texts[next(file for file in reversed(texts) if name == "urscript" or "001" in file)]
    out, depth = [], 0
    for line in (line.strip() for line in body.splitlines()):
        depth += name == "urscript" and line.startswith("if ")
        if MOTION.match(line):
            out.append("M")
        elif not OTHERS.match(line) or (line == "end" and depth):
            depth -= line == "end"
            line = line.replace("set_standard_digital_out", "OUT").replace("set_standard_analog_out", "ANALOG")
            out.append("STOP" if line.startswith("popup") else line)
    return out


@pytest.mark.parametrize(("name", "kind"), BOTH)
def test_moves_and_commands_stand_in_the_sources_order_and_are_read_back(tmp_path: Path, name: str, kind: Any) -> None:
    given, o = program(read(tmp_path), TABLES[name]), options()
    written = write_program(given, name, kind, o)
    texts = written.texts()
    assert statements(texts, name) == WANTED[name].replace("\n", "").split("|")
    assert written.undefined == ()
    trip = round_trip(given, texts, name, kind, o)
    assert trip.commands is None
    assert trip.within()


@pytest.mark.parametrize(("name", "kind"), BOTH)
def test_a_command_that_is_missing_exchanged_or_conditional_is_found(tmp_path: Path, name: str, kind: Any) -> None:
    given, o = program(read(tmp_path), TABLES[name]), options()
    texts = write_program(given, name, kind, o).texts()
    file = next(file for file in reversed(texts) if name == "urscript" or "001" in file)
    lines = texts[file].splitlines()
    off = {"krl": "$OUT[1]=FALSE", "rapid": "SetDO io1,0;", "val3": "io1=false", "sinumerik": "M5"}.get(
        name, "out(1, False)"
    )
    place = next(i for i, line in enumerate(lines) if line.strip().endswith(off))

    def difference(changed: list[str]) -> str:
        found = round_trip(given, texts | {file: "\n".join(changed)}, name, kind, o).commands
        return "" if found is None else str(found)

    assert difference(lines) == ""
    assert difference(lines[:place] + lines[place + 1 :]) != ""
    on = {"krl": "$OUT[1]=TRUE", "rapid": "SetDO io1,1;", "val3": "io1=true", "sinumerik": "S6000 M3"}.get(
        name, "set_standard_digital_out(1, True)"
    )
    assert "not in the tool path" in difference([*lines[:place], on, *lines[place:]])
    opens, closes = {
        "krl": ("IF $IN[9] THEN", "ENDIF"),
        "rapid": ("IF x=1 THEN", "ENDIF"),
        "val3": ("if x==true", "endIf"),
        "sinumerik": ("IF R1==1", "ENDIF"),
        "urscript": ("if x:", "end"),
    }[name]
    assert difference([*lines[:place], opens, lines[place], closes, *lines[place + 1 :]]) != ""
    # A shop's own rests and outputs, and calls that it does not name, are its own.
    own = {"krl": "WAIT SEC 2", "rapid": "WaitTime 2;", "val3": "delay(2)", "sinumerik": "G4 F2"}.get(name, "sleep(2)")
    assert difference([*lines[:place], own, *lines[place:]]) == ""


@pytest.mark.parametrize("name", WANTED)
def test_what_the_cell_does_not_define_is_said_and_stands_as_a_comment(tmp_path: Path, name: str) -> None:
    given, o = program(read(tmp_path, SOURCE.replace("M8\n", "M88\n")), ""), options()
    kind = FORMATS[name].kinds[0]
    written = write_program(given, name, kind, o)
    missing = {one.what: (one.count, one.line) for one in written.undefined}
    assert missing["coolant_through"] == (1, 4)
    if name == "sinumerik":
        assert set(missing) == {"coolant_through"}
    else:
        assert missing["spindle_clockwise"][1] == 3
        assert missing["spindle_counterclockwise"] == (1, 13)
        assert missing["tool_change"] == (1, 2)
        assert any("optional_stop" in what for what in missing)
    assert any("coolant_through" in note for note in written.notes)
    assert round_trip(given, written.texts(), name, kind, o).within()


@pytest.mark.parametrize(
    ("name", "table", "message"),
    [
        ("krl", 'coolant_flood = "doCool"', "a number from 1"),
        ("rapid", "coolant_flood = 3", "a name"),
        ("urscript", "coolant_flood = 9", "0 to 7"),
        ("krl", "spindle_clockwise = 0", "a number from 1"),
        ("val3", 'tool_change = "movej"', "no word of the language"),
        ("krl", "spindle_clockwise = 1\nspindle_speed = 2\nspindle_full_rpm = 5000", "up to 5000 rpm"),
    ],
)
def test_outputs_that_the_controller_does_not_have(tmp_path: Path, name: str, table: str, message: str) -> None:
    given = program(read(tmp_path), table)
    refuses("Q004", message, write_program, given, name, FORMATS[name].kinds[0], options())


@pytest.mark.parametrize(
    "table",
    [
        "coolant_flood = 1\ncoolant_mist = 1",
        'coolant_flood = "do cool"',
        "coolant_flood = -1",
        "spindle_speed = 2",
        "spindle_full_rpm = 2.0",
        'tool_change = "1st"',
        "coolant = 3",
        "probe = true",
    ],
)
def test_tables_of_commands_that_are_not_right(table: str) -> None:
    with pytest.raises((InputError, InputErrors), match="commands"):
        parse_cell(f'schema = "stiffarm-cell/1"\n[commands]\n{table}', "cell.toml", Path())


def test_the_neutral_programs_hold_the_commands_or_say_that_they_do_not(tmp_path: Path) -> None:
    given = program(read(tmp_path), "")
    assert write_program(given, "json").notes == ()
    (said,) = write_program(given, "csv").notes
    assert "holds none of" in said
    text = write_program(given, "json").texts()
    assert round_trip(given, text, "json", "joint").commands is None
    for old, new, how in (
        ('"kind": "coolant"', '"kind": ""', "another"),
        ('"spindle_rpm": 0.0', '"spindle_rpm": 5.0', ""),
    ):
        changed = {name: body.replace(old, new, 1) for name, body in text.items()}
        assert changed != text
        found = round_trip(given, changed, "json", "joint").difference()
        assert found is not None
        assert how in str(found)
    assert write_program(program_of(n=3), "csv").notes == ()


def test_a_stop_is_at_rest_and_a_command_in_a_cut_too(tmp_path: Path) -> None:
    """Controllers run ahead of a blended move: a command behind one would come too early."""
    texts = write_program(program(read(tmp_path), TABLES["rapid"]), "rapid", "cartesian", options()).texts()
    lines = [line.strip() for line in texts["part_001.mod"].splitlines() if not line.strip().startswith("!")]
    for i, line in enumerate(lines):
        if line.startswith(("SetDO", "Stop", "WaitTime")) and MOTION.match(lines[i - 1]):
            assert ",fine," in lines[i - 1]


APT = """UNITS/MM
LOADTL/1
CUTTER/10
SPINDL/RPM,3000,CLW
COOLNT/ON
RAPID
GOTO/0,0,50
FEDRAT/500,MMPM
GOTO/0,0,0
DELAY/0.5
GOTO/10,0,0
OPSTOP
LOADTL/2
CUTTER/6
SPINDL/RPM,2000,CCLW
PROBE/ON
GOTO/20,0,0
PROBE/OFF
STOP
GOTO/30,0,0
SPINDL/OFF
COOLNT/OFF
FINI
"""


def test_commands_of_apt_stay_where_they_stood(tmp_path: Path) -> None:
    found = [(e.move, e.line, e.kind) for e in ordered(read(tmp_path, APT, "part.apt")) if e.kind]
    assert found == [
        (0, 2, "tool"),
        (0, 4, "spindle"),
        (0, 5, "coolant"),
        (2, 10, "dwell"),
        (3, 12, "optional stop"),
        # The tool is not changed in a turning spindle.
        (3, 13, "spindle"),
        (3, 13, "tool"),
        (3, 15, "spindle"),
        (3, 16, "probe"),
        (4, 18, "probe"),
        (4, 19, "stop"),
        (5, 21, "spindle"),
        (5, 22, "coolant"),
    ]


def test_a_coolant_that_is_not_known_is_said_and_is_no_command(tmp_path: Path) -> None:
    motions = read(tmp_path, APT.replace("COOLNT/ON", "COOLNT/AIR"), "air.apt")
    assert any("COOLNT/AIR is no command" in note.text for note in motions.notes)
    assert [e.text for e in motions.events if e.word == "COOLNT" and e.kind] == ["off"]
    for word, kind in (("MIST", "mist"), ("ON,THRU", "through"), ("FLOOD,ON", "flood"), ("ON", "flood")):
        found = read(tmp_path, APT.replace("COOLNT/ON", f"COOLNT/{word}"), "some.apt")
        assert [e.text for e in found.events if e.kind == "coolant"] == [kind, "off"]


def test_the_end_of_a_program_stops_spindle_and_coolant(tmp_path: Path) -> None:
    for text, name in ((APT.replace("SPINDL/OFF\nCOOLNT/OFF\n", ""), "a.apt"), (SOURCE, "b.nc")):
        motions = read(tmp_path, text, name)
        last = [(e.kind, e.value, e.text) for e in ordered(motions) if e.move == motions.n and e.kind]
        assert ("spindle", 0.0, "OFF") in last
        assert [kind for kind, *_ in last] == ["spindle", "coolant"]
    stopped = read(tmp_path, SOURCE.replace("M30", "M5\nM9\nM30"), "c.nc")
    assert [e.kind for e in ordered(stopped) if e.move == stopped.n and e.kind] == ["spindle", "coolant"]


def test_a_tap_reverses_by_commands(tmp_path: Path) -> None:
    motions = read(tmp_path, "G21 G90\nT1 M6\nS500 M3\nG0 X0 Y0 Z10\nG84 X0 Y0 Z-5 R2 F500\nG80\nM30\n")
    turns = [round(e.value * 30.0 / np.pi) for e in ordered(motions) if e.kind == "spindle"]
    assert turns == [500, -500, 0]


# ------------------------------------------------------------
# URScript: what is written is what the manual says, and corners never meet


def lines_of(program: JointProgram, o: WriteOptions) -> list[str]:
    text = write_program(program, "urscript", "joint", o).texts()["part.script"]
    return text.splitlines()


def test_joints_are_radians_and_moves_have_times() -> None:
    program = program_of(n=5)
    lines = lines_of(program, options())
    assert lines[4].startswith("def part():")
    tcp = [float(v) for v in re.findall(r"-?\d+\.\d+", lines[5])]
    T = program.cell.tool.T_flange_tool
    np.testing.assert_allclose(tcp, [*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_rotvec()], atol=1e-9)
    moves = [line for line in lines if "movej" in line]
    assert "a=0.5, v=0.2" in moves[0]
    angles = [[float(v) for v in re.search(r"\[(.*)\]", line)[1].split(",")] for line in moves]  # type: ignore[index]
    # Nine decimals of a radian.
    np.testing.assert_allclose(angles, program.q, atol=1e-9)
    times = [float(re.search(r"t=([\d.]+)", line)[1]) for line in moves[1:]]  # type: ignore[index]
    away = np.linalg.norm(np.diff(program.T_part_tool[:, :3, 3], axis=0), axis=1)
    speed = np.where(program.motions.rapid, 0.25, program.motions.feed)
    np.testing.assert_allclose(times, away / speed[1:], rtol=1e-6)
    assert lines[-1] == "end"


def test_corners_never_meet() -> None:
    """A move whose corner overlaps its neighbour's is skipped by the controller."""
    program = program_of(n=8)
    radii = [
        float(re.search(r"r=([\d.]+)\)", line)[1])  # type: ignore[index]
        for line in lines_of(program, options(blend_mm=1000.0))
        if "movej" in line
    ]
    away = np.linalg.norm(np.diff(program.T_part_tool[:, :3, 3], axis=0), axis=1)
    assert max(radii) > 0.0
    assert (radii[0], radii[-1]) == (0.0, 0.0)
    assert (np.add(radii[:-1], radii[1:]) < away).all()


def test_a_changed_digit_a_lost_time_and_other_motion_are_seen() -> None:
    program, o = program_of(n=5), options()
    texts = write_program(program, "urscript", "joint", o).texts()
    good = texts["part.script"]
    at = good.index("movej([") + len("movej([")
    moved = good[:at] + f"{float(good[at : good.index(',', at)]) + 1e-5:.9f}" + good[good.index(",", at) :]
    assert not round_trip(program, {"part.script": moved}, "urscript", "joint", o).within()
    slower = re.sub(r"t=([\d.]+)", lambda m: f"t={2.0 * float(m[1])}", good, count=1)
    assert round_trip(program, {"part.script": slower}, "urscript", "joint", o).pace == pytest.approx(1.0)
    for wrong, words in (
        (good.replace("movej([", "movel(p[", 1), "movej"),
        (good.replace("  movej", "  while True:\n  movej", 1), "loop"),
        (re.sub(r"t=[\d.]+, ", "", good), "no speed"),
        (good.replace(", t=", ", 0.1], t=", 1).replace("], 0.1]", ", 0.1]", 1), "7 angles"),
    ):
        refuses("Q001 Q005", words, round_trip, program, {"part.script": wrong}, "urscript", "joint", o)


def test_external_axes_and_words_of_the_language_are_refused() -> None:
    cell = cell_of(linear_axes=(rail(),))
    refuses("Q004", "no external axes", write_program, program_of(n=3, cell=cell), "urscript", "joint", options())
    refuses("Q004", "no word of a language", options, name="thread")
    refuses("F011", r"urscript\.speed_rad_s", options, urscript={"speed_rad_s": -1.0})
