"""Programs as controllers read them: fragments of their manuals, splitting, hostile texts, options, templates."""

from __future__ import annotations

import json
import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from program_cases import PLAIN, busy, cell_of, motions_of, posed, program_of, rail, turntable
from refusals import refuses

from machining.cell import Cell, Tool
from machining.programs.formats import FORMATS, parse_options, read_options, round_trip, write_program
from machining.programs.job import formatted, plain
from machining.programs.rendering import environment, rendered
from machining.programs.sandbox import LARGEST, Budget
from machining.programs.source_text import SourceText, comment, word
from machining.programs.write_options import WriteOptions
from robots import InputError, inverse_kinematics, load_robot

CONTROLLERS = ("krl", "rapid", "val3", "sinumerik")
# Statements that move something, at the start of a line, in any of the languages.
MOTION = re.compile(
    r"^\s*(?:N\d+\s*)?(?:LIN|PTP|CIRC|Move\w+|movel|movej|movec|G0*[0-3])\b", re.IGNORECASE | re.MULTILINE
)


def options(name: str, **more: Any) -> WriteOptions:
    arm = {"arm": PLAIN} if name in ("rapid", "val3") else {}
    return parse_options(arm | more, "options")


def test_krl_in_the_form_of_the_manual() -> None:
    """KUKA's home and a move to the right: E6AXIS, E6POS with S and T, $VEL.CP in m/s."""
    robot = load_robot("kr60-3")
    home = np.radians([[0.0, -90.0, 0.0, 0.0, 0.0, 0.0], [10.0, -90.0, 0.0, 0.0, 45.0, -20.0]])
    small = options("krl", decimals={"length": 3, "angle": 4}, blend_mm=0.5)
    joint = write_program(posed(robot, home), "krl", "joint", small).texts()
    assert joint["part.src"].splitlines()[2] == "DEF part ( )"
    assert "BAS (#INITMOV,0)" in joint["part.src"]
    assert "part_001 ( )" in joint["part.src"]
    lines = joint["part_001.src"].splitlines()
    assert "PTP {A1 0.0000,A2 -90.0000,A3 90.0000,A4 0.0000,A5 0.0000,A6 0.0000} C_PTP" in lines
    assert "PTP {A1 -10.0000,A2 -90.0000,A3 90.0000,A4 0.0000,A5 45.0000,A6 20.0000}" in lines
    assert lines[-1] == "END"
    # The data sheet's home: 350 + 820 + 170 forward, 815 + 850 + 145 up; $FLANGE there has A 0, B 90, C 0.
    flange = posed(robot, home, Cell(tool=Tool(np.diag([-1.0, -1.0, 1.0, 1.0]))))
    lines = write_program(flange, "krl", "cartesian", small).texts()["part_001.src"].splitlines()
    assert "PTP {X 1340.000,Y 0.000,Z 1810.000,A 0.0000,B 90.0000,C 0.0000,S 2,T 2}" in lines
    assert "$VEL.CP = 0.02" in lines
    assert lines[-2].startswith("LIN {X ")
    assert lines[-2].endswith(",S 2,T 3}")


def test_krl_numbers_its_external_axes() -> None:
    cell = cell_of(linear_axes=(rail("x"), rail("y")), turntable=turntable())
    travel = np.stack([np.linspace(0.0, 0.1, 4), np.full(4, 0.25)], axis=1)
    program = program_of(n=4, cell=cell, travel=travel, table=np.linspace(0.0, 0.2, 4))
    lines = write_program(program, "krl", "joint").texts()["part_001.src"].splitlines()
    assert lines[-3].endswith(",E1 66.66667,E2 250.00000,E3 7.6394373} C_PTP")
    lines = write_program(program, "rapid", "cartesian", options("rapid")).texts()["part_001.mod"].splitlines()
    assert ",[66.66667,250.00000,7.6394373,9E9,9E9,9E9]],vMove,zMove,tCutter\\WObj:=fPart;" in lines[-4]
    lines = write_program(program, "sinumerik", "joint").texts()["PART_001.SPF"].splitlines()
    assert " X1=66.66667 X2=250.00000 C1=7.6394373 F" in lines[-3]


def test_rapid_in_the_form_of_the_manual() -> None:
    program = program_of(n=3)
    texts = write_program(program, "rapid", "cartesian", options("rapid", abb={"tool_mass_kg": 20})).texts()
    main = texts["part.mod"]
    assert main.startswith("MODULE part_\n")
    tool = "[[200.00000,0.00000,80.00000],[0.707106781,0.000000000,0.707106781,0.000000000]]"
    assert f"PERS tooldata tCutter := [TRUE,{tool}" in main
    assert (
        "],[20,[0.000,0.000,1.000],[1.000000000,0.000000000,0.000000000,0.000000000],0.000000,0.000000,0.000000]];"
        in main
    )
    assert 'PERS wobjdata fPart := [FALSE,TRUE,"",[[1200.00000,200.00000,600.00000],[1.' in main
    assert "VAR speeddata vMove := [250,90,250,90];" in main
    assert "CONST zonedata zMove := [FALSE,0.1,0.15,0.15,0.015,0.15,0.015];" in main
    assert re.search(r"PROC part\(\)\n.*part_001;\n  ENDPROC\nENDMODULE\n$", main, re.DOTALL)
    part = texts["part_001.mod"]
    number = r"-?\d+\.\d+"
    target = rf"\[\[({number},){{2}}{number}\],\[({number},){{3}}{number}\],\[(-?\d,){{3}}\d\],\[(9E9,){{5}}9E9\]\]"
    moves = [line for line in part.splitlines() if line.strip().startswith("Move")]
    assert re.fullmatch(rf"    MoveJ {target},vMove,fine,tCutter\\WObj:=fPart;", moves[0])
    assert re.fullmatch(rf"    MoveL {target},vMove,zMove,tCutter\\WObj:=fPart;", moves[1])
    assert re.fullmatch(rf"    MoveL {target},vMove,fine,tCutter\\WObj:=fPart;", moves[2])
    joint = write_program(program, "rapid", "joint", options("rapid")).texts()["part_001.mod"]
    assert re.search(
        rf"    MoveAbsJ \[\[({number},){{5}}{number}\],\[(9E9,){{5}}9E9\]\],vMove,zMove,tCutter\\WObj:=", joint
    )


def test_val3_is_an_application_of_well_formed_xml() -> None:
    from xml.etree import ElementTree  # own files, written a line above

    texts = write_program(busy(), "val3", "cartesian", options("val3", moves_per_file=5)).texts()
    assert sorted(texts) == ["p001.pgx", "p002.pgx", "p003.pgx", "part.dtx", "part.pjx", "start.pgx", "stop.pgx"]
    for text in texts.values():
        ElementTree.fromstring(text)  # noqa: S314
    space = "{http://www.staubli.com/robotics/VAL3/Data/2}"
    data = ElementTree.fromstring(texts["part.dtx"])  # noqa: S314
    found = {d.attrib["name"]: d for d in data.iter(f"{space}Data")}
    points = found["pPath"].findall(f"{space}Value")
    assert len(points) == int(found["pPath"].attrib["size"]) == 12
    wanted = ["key", "x", "y", "z", "rx", "ry", "rz", "shoulder", "elbow", "wrist", "fatherId"]
    assert [list(p.attrib) for p in points] == [wanted] * 12
    assert {p.attrib["fatherId"] for p in points} == {"fPart[0]"}
    assert "movel(pPath[2],tCutter,mMove)" in texts["p001.pgx"]
    assert ' blend="cartesian" leave="0.1" reach="0.1" />' in texts["part.dtx"]
    assert "  call p001()\n  call p002()\n  call p003()\n  waitEndMove()\nend" in texts["start.pgx"]


def test_val3_refuses_external_axes_that_move_and_keeps_those_that_stand() -> None:
    cell = cell_of(linear_axes=(rail(),))
    moving = program_of(n=4, cell=cell, travel=np.linspace(0.0, 0.1, 4)[:, None])
    refuses("Q004", "external axes that move", write_program, moving, "val3", "joint", options("val3"))
    still = program_of(n=4, cell=cell, travel=np.full((4, 1), 0.123))
    texts = write_program(still, "val3", "joint", options("val3")).texts()
    assert '<Value key="0" value="123.00000" />' in texts["part.dtx"]
    assert round_trip(still, texts, "val3", "joint", options("val3")).within()


def test_sinumerik_inverse_time_and_degrees_per_minute() -> None:
    """A block of 20 mm at 20 mm/s takes 1 s: F60 with G93; with G94 the way of all axes in a minute."""
    program = program_of(n=3)
    step = np.linalg.norm(np.diff(program.T_part_tool[:, :3, 3], axis=0), axis=1)[-1]
    texts = write_program(program, "sinumerik", "joint", options("sinumerik", rotation_deg_s=1e6)).texts()
    last = texts["PART_001.SPF"].splitlines()[-2]
    assert last.startswith("G1 A1=")
    assert float(last.split(" F")[1].removesuffix(" G9")) == pytest.approx(60.0 * 0.02 / step, rel=1e-6)
    assert "\nG93\n" in texts["PART.MPF"]
    assert texts["PART.MPF"].endswith("PART_001\nM30\n")
    # 0.1 mm at 350 + 850 + hypot(145, 820) + 170 mm and the tool's hypot(200, 80): 0.1 mm / 2.4 m = 0.0024 deg.
    found = re.search(r"G641 ADIS=([0-9.]+) ADISPOS=\1\n", texts["PART.MPF"])
    assert found is not None
    reach = 0.35 + 0.85 + np.hypot(0.145, 0.82) + 0.17 + np.hypot(0.2, 0.08)
    assert 0.5 < float(found[1]) / np.degrees(1e-4 / reach) <= 1.0
    own = options("sinumerik", sinumerik={"feed": "per_minute", "axes": ["Q1", "Q2", "Q3", "Q4", "Q5", "Q6"]})
    texts = write_program(program, "sinumerik", "joint", own).texts()
    assert "\nFGROUP(Q1,Q2,Q3,Q4,Q5,Q6)\nG94\n" in texts["PART.MPF"]
    assert round_trip(program, texts, "sinumerik", "joint", own).pace < 1e-6


def test_what_is_not_motion_stands_before_its_move() -> None:
    for name in CONTROLLERS:
        kind = FORMATS[name].kinds[0]
        texts = write_program(busy(), name, kind, options(name)).texts()
        text = texts[list(texts)[-1]]
        order = [
            text.index(t) for t in ("tool 3 ball D12 mm", "spindle 10000 rpm counter", "event: COOLNT ON", "1.500")
        ]
        order += [text.index(t) for t in ("operation: finish", "tool 4 flat", "spindle 12000 rpm clock", "event: END")]
        assert order == sorted(order)
        # The tool rests at a point, not on the way through a corner.
        before_dwell = text[: order[3]].splitlines()[-2]
        assert MOTION.match(before_dwell)
        assert {"krl": "}", "rapid": "fine", "val3": "mStop", "sinumerik": " G9"}[name] in before_dwell[-30:]
        assert not before_dwell.endswith("C_DIS")
        # One move leads to the first event, one more to the dwell, and the last is before the event at the end.
        assert len(MOTION.findall(text[: order[2]])) == 2
        assert len(MOTION.findall(text[: order[3]])) == 5
        assert len(MOTION.findall(text[order[7] :])) == 0


@pytest.mark.parametrize("per_file", [1, 4, 12, 100])
@pytest.mark.parametrize("name", CONTROLLERS)
def test_splitting_keeps_every_move_and_says_the_speed_again(name: str, per_file: int) -> None:
    program = busy()
    kind = FORMATS[name].kinds[0]
    o = options(name, moves_per_file=per_file)
    texts = write_program(program, name, kind, o).texts()
    parts = [t for t in texts.values() if len(MOTION.findall(t)) > 0]
    assert [len(MOTION.findall(t)) for t in parts] == [min(per_file, 12 - i) for i in range(0, 12, per_file)]
    for text in parts:
        first = MOTION.search(text)
        assert first is not None
        if name != "sinumerik":
            # A part can be started on its own, so the speed of the part before it does not count.
            assert re.search(r"VEL\.CP|v_tcp|mMove\.tvel", text[: first.start()])
    back = round_trip(program, texts, name, kind, o)
    assert back.within()
    assert back.pace < 1e-6


HOSTILE = (
    "\nLIN {X 0,Y 0,Z 0,A 0,B 0,C 0}\nPTP HOME\r\nMoveL p1,v100,fine,tool0;\u2028MoveJ p;\x85G1 A1=0 F1\x0bG0 A1=9\x0c"
    "\"; MoveL p1; '); movej(jZero,t,m) ]]> <P> {{ 7 * 7 }} {% raw %} \x00\x1b \u202e ; G1 A1=0 & < > $OUT[1]=TRUE"
)


@pytest.mark.parametrize(("name", "kind"), [(name, kind) for name in CONTROLLERS for kind in FORMATS[name].kinds])
def test_no_text_of_a_source_file_becomes_a_statement(name: str, kind: Any) -> None:
    o = options(name, source_lines=True)
    plain_texts = write_program(busy(), name, kind, o).texts()
    texts = write_program(busy(hostile=HOSTILE), name, kind, o).texts()
    mark = {"krl": ";", "rapid": "!", "val3": "//", "sinumerik": ";"}[name]
    for file, text in texts.items():
        lines, wanted = text.splitlines(), plain_texts[file].splitlines()
        assert len(lines) == len(wanted)
        for line, own in zip(lines, wanted, strict=True):
            if line != own:
                assert line.lstrip().startswith(mark)
                assert not set(line.lstrip().removeprefix(mark)) & set("\"'{}[]<>;&%$\\!")
                assert line.isascii()
                assert line.isprintable()
    assert round_trip(busy(hostile=HOSTILE), texts, name, kind, o).within()


def test_hostile_texts_in_neutral_programs() -> None:
    program = busy(hostile=HOSTILE)
    data = json.loads(write_program(program, "json").files[0].text())
    assert data["tools"][0]["name"] == "ball" + HOSTILE
    texts = write_program(busy(hostile=",=cmd|' /C calc'!A0\n" + HOSTILE), "csv").texts()
    assert len(texts["part.csv"].splitlines()) == 14
    assert round_trip(program, texts, "csv", "joint").within()
    evil = write_program(program_of(n=3, operations=("=1+1",)), "csv").files[0].text()
    assert ",'=1+1," in evil


def test_filters() -> None:
    assert comment(SourceText("  Fräsen\n\r; M30 ")) == "Frasen___ M30"
    assert comment(SourceText("x" * 1000)) == "x" * 80
    assert word(SourceText(" M8;x ")) == "M8_X"
    text = SourceText("secret")
    for use in (str, repr, "{}".format, lambda t: f"{t}"):
        refuses("Q010", "comment", use, text)


def test_a_shops_template_replaces_one_file_and_has_to_clean_texts(tmp_path: Path) -> None:
    (tmp_path / "krl").mkdir()
    own = tmp_path / "krl" / "events.j2"
    bundled = Path(__file__).parents[3] / "machining" / "programs" / "templates" / "krl" / "events.j2"
    text = bundled.read_text(encoding="utf-8")
    coolant = '{% if h.name | word == "COOLNT" %}\n$OUT[5] = TRUE\n{% endif %}\n; event: '
    own.write_text(text.replace("; event: ", coolant), encoding="utf-8")
    program = busy()
    texts = write_program(program, "krl", "cartesian", templates=tmp_path).texts()
    assert texts["part_001.src"].count("$OUT[5] = TRUE\n; event: COOLNT ON") == 1
    assert round_trip(program, texts, "krl", "cartesian").within()
    for template, message in (
        ("{% macro event(h) %}{{ h.text }}{% endmacro %}", "| comment"),
        ("{% macro event(h) %}{{ h.text ~ 'x' }}{% endmacro %}", "| comment"),
        ("{% macro event(h) %}{{ h.text | upper }}{% endmacro %}", "| comment"),
        ("{% macro event(h) %}{{ h.text | e }}{% endmacro %}", "No filter named 'e'"),
        ("{% macro event(h) %}{{ '%s' | format(h.text) }}{% endmacro %}", "| comment"),
        ("{% macro event(h) %}{{ h.text._text }}{% endmacro %}", "krl/moves.j2"),
        ("{% macro event(h) %}{{ h.__class__.__mro__ }}{% endmacro %}", "krl/moves.j2"),
        ("{% macro event(h) %}{{ h.nothing }}{% endmacro %}", "no attribute 'nothing'"),
        ("{% macro event(h) %}{% if %}{% endmacro %}", "line 1"),
    ):
        own.write_text(text.replace("{% macro event(h) %}", template + "{% macro old(h) %}"), encoding="utf-8")
        refuses("Q010", re.escape(message), write_program(program, "krl", "cartesian", templates=tmp_path).texts)
    refuses("A007", "folder of templates", write_program, program, "krl", templates=tmp_path / "none")


def test_rapid_moves_are_straight_unless_asked_for_and_said_aloud() -> None:
    program = program_of(n=6, rapid=np.arange(6) == 3, feed=np.where(np.arange(6) == 3, np.nan, 0.02))
    straight = write_program(program, "krl", "cartesian")
    assert straight.texts()["part_001.src"].count("\nPTP ") == 1
    o = options("krl", rapid="joint")
    joint = write_program(program, "krl", "cartesian", o)
    text = joint.texts()["part_001.src"]
    assert text.count("\nPTP ") == 2
    # No blending from a straight move into a joint move, nor back.
    assert [line.endswith("}") for line in text.splitlines() if line[:4] in ("PTP ", "LIN ")] == [1, 0, 1, 1, 0, 1]
    assert any("leave the straight line" in note for note in joint.notes)
    assert not any("straight line" in note for note in straight.notes)
    assert round_trip(program, joint.texts(), "krl", "cartesian", o).same_moves


def test_zero_blend_stops_at_each_point() -> None:
    for name, motion, stop in (
        ("krl", "LIN", "}"),
        ("rapid", "MoveL", "fine"),
        ("val3", "movel", "mStop"),
        ("sinumerik", "G1", "G9"),
    ):
        texts = write_program(program_of(n=4), name, FORMATS[name].kinds[0], options(name, blend_mm=0.0)).texts()
        lines = [line for t in texts.values() for line in t.splitlines() if line.strip().startswith(motion)]
        assert len(lines) == 3
        assert all(stop in line and "zMove" not in line and "C_" not in line for line in lines)


def test_feeds_that_are_not_known() -> None:
    program = program_of(n=5, feed=np.array([np.nan, np.nan, 0.02, np.nan, 0.02]))
    error = refuses("Q007", "feed of 1 moves, the first of source line 13", write_program, program, "krl")
    assert "default_feed_mm_min" in str(error)
    text = write_program(program, "krl", options=options("krl", default_feed_mm_min=600)).texts()["part_001.src"]
    assert "$VEL.CP = 0.01\n" in text


def test_a_move_that_only_turns_takes_time() -> None:
    robot = load_robot("kr60-3")
    q = np.tile(np.radians([0.0, -60.0, 20.0, 0.0, 40.0, 0.0]), (3, 1))
    q[1:, 5] = 0.3
    program = posed(robot, q, Cell())
    text = write_program(program, "sinumerik", "joint", options("sinumerik", rotation_deg_s=30)).texts()["PART_001.SPF"]
    feeds = [float(f) for f in re.findall(r" F([0-9.]+)", text)]
    # 0.3 rad about the flange at 30 deg/s; then nothing moves: the shortest time of a block.
    assert feeds == pytest.approx([60.0 * np.radians(30.0) / 0.3, 60.0 / 1e-4], rel=1e-6)


def test_a_move_of_the_rail_under_a_still_tool_takes_its_time() -> None:
    program = program_of(n=3, cell=cell_of(linear_axes=(rail(),)), travel=np.zeros((3, 1)))
    T, travel = program.T_part_tool.copy(), np.array([[0.0], [0.0], [0.1]])
    T[2] = T[1]
    target = np.linalg.inv(program.cell.T_world_base(travel)) @ program.cell.T_world_part(np.zeros(3)) @ T
    solved = inverse_kinematics(program.robot, target, T_flange_tool=program.cell.tool.T_flange_tool)
    q, column = solved.nearest(program.q[1])
    assert (column >= 0).all()
    # At 10 mm/s the rail needs 10 s; the joints at 90 deg/s are ready long before.
    o = options("sinumerik", rapid_mm_s=10)
    motions = motions_of(T[:, :3, 3].copy(), -T[:, :3, 2], rapid=np.zeros(3, dtype=np.bool_), feed=np.full(3, 0.02))
    still = replace(program, motions=motions, T_part_tool=T, travel=travel, q=q)
    texts = write_program(still, "sinumerik", "joint", o).texts()
    assert texts["PART_001.SPF"].splitlines()[-2].endswith(" F6 G9")
    assert round_trip(still, texts, "sinumerik", "joint", o).within()


def test_decimals_that_do_not_do_are_said() -> None:
    program = program_of(n=4)
    assert any(note.startswith("PTP moves") for note in write_program(program, "krl", "joint").notes)
    for kind, decimals, found in (
        ("joint", {"angle": 5}, ["tip"]),
        ("joint", {"angle": 4}, ["tip", "turn"]),
        ("cartesian", {"length": 2}, ["tip"]),
        ("cartesian", {"angle": 4}, ["turn"]),
        ("cartesian", {"length": 4, "angle": 6}, []),
    ):
        notes = [
            n for n in write_program(program, "krl", kind, options("krl", decimals=decimals)).notes if "decimals" in n
        ]  # type: ignore[arg-type]
        assert len(notes) == len(found)
        assert all(word_ in note for word_, note in zip(found, notes, strict=True))
    few = options("krl", decimals={"angle": 3})
    back = round_trip(program, write_program(program, "krl", "joint", few).texts(), "krl", "joint", few)
    assert not back.within()
    assert back.tip < 1e-3


def test_numbers_as_text() -> None:
    assert formatted(np.array([[-1e-9, 2.5, 179.99999999]]), (3, 0, 4)) == [("0.000", "2", "180.0000")]
    for bad in (np.nan, np.inf):
        refuses("Q007", "finite", formatted, np.array([[bad]]), (3,))
    assert [plain(v) for v in (0.0, 1e-7, 0.1, 250.0, 1234567.8, 1 / 3)] == [
        "0",
        "0.0000001",
        "0.1",
        "250",
        "1234568",
        "0.3333333",
    ]


def test_options(tmp_path: Path) -> None:
    file = tmp_path / "post.toml"
    file.write_text('schema = "stiffarm-post/1"\nname = "wing"\nblend_mm = 1\n[decimals]\nlength = 4\n')
    found = read_options(file)
    assert (found.name, found.blend_mm, found.decimals.length) == ("wing", 1.0, 4)
    (tmp_path / "post.json").write_text('{"name": "wing"}')
    assert read_options(tmp_path / "post.json").name == "wing"
    for bad, text in (
        ({"nmae": "x"}, "nmae"),
        ({"name": "a b"}, "name"),
        ({"name": "main"}, "name"),
        ({"name": "a\nG1"}, "name"),
        ({"tool_name": 't";'}, "tool_name"),
        ({"blend_mm": -1}, "blend_mm"),
        ({"blend_mm": float("nan")}, "blend_mm"),
        ({"rapid": "fast"}, "rapid"),
        ({"schema": "stiffarm-post/2"}, "schema"),
        ({"sinumerik": {"axes": ["F", "A2", "A3", "A4", "A5", "A6"]}}, "sinumerik"),
        ({"sinumerik": {"axes": ["A1 G0", "A2", "A3", "A4", "A5", "A6"]}}, "sinumerik"),
        ({"sinumerik": {"table": "A1"}}, "sinumerik"),
        ([], "options"),
    ):
        refuses("F011 Q004", text, parse_options, bad, "options")
    (tmp_path / "bad.json").write_text("{")
    refuses("F005", "JSON", read_options, tmp_path / "bad.json")


def test_formats_and_kinds_by_name() -> None:
    program = program_of(n=3)
    refuses("Q002", ", ".join(FORMATS), write_program, program, "yaskawa")
    refuses("Q002", "kind of a sinumerik program", write_program, program, "sinumerik", "cartesian")


def test_files_are_written_where_the_caller_says(tmp_path: Path) -> None:
    written = write_program(program_of(n=4), "krl", "joint")
    written.save(lambda name: tmp_path / f"new-{name}")
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {f"new-{k}": v for k, v in written.texts().items()}


# ------------------------------------------------------------
# Templates that run for ever, grow without bound, call what is not theirs, or cannot be opened: one clear error

ENDLESS, LARGE, DEEP, BARRED = "come to an end", "too large", "nested too deep", "may not be called"


def render(folder: Path, text: str, **context: Any) -> str:
    (folder / "krl").mkdir(exist_ok=True)
    (folder / "krl" / "main.j2").write_text(text, encoding="utf-8")
    made = environment(folder)
    return "".join(rendered(made, "krl/main.j2", {"o": WriteOptions(), "count": 1, **context}))


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few steps: the tests need not wait for all."""
    monkeypatch.setattr("machining.programs.sandbox.STEPS", 20_000)
    monkeypatch.setattr("machining.programs.rendering.PRINTED", 200_000)


GROWN = (
    "{% set n = namespace(s='aaaaaaaa') %}{% for i in range(60) %}{% set n.s = GROW %}{% endfor %}{{ n.s | length }}"
)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{% for i in range(10 ** 9) %}x{% endfor %}", "Range too big"),
        ("{% for i in range(9999) %}{% for j in range(9999) %}x{% endfor %}{% endfor %}", ENDLESS),
        ("{% for i in range(9999) %}{% for j in range(9999) %}{% endfor %}{% endfor %}", ENDLESS),
        ("{% macro a(n) %}{% if n %}{{ a(n - 1) }}{{ a(n - 1) }}{% endif %}{% endmacro %}{{ a(60) }}", ENDLESS),
        ("{% set x = 'a' * 90000 %}{% for i in range(99) %}{{ x }}{% endfor %}", "prints too much"),
        ("{{ 'a' * 10 ** 11 }}", LARGE),
        ("{{ 10 ** 11 * 'a' }}", LARGE),
        ("{{ (range(99999) | list * 99) | length }}", LARGE),
        ("{{ 9 ** 9 ** 9 }}", LARGE),
        ("{% set n = namespace(s=9) %}{% for i in range(60) %}{% set n.s = n.s * n.s %}{% endfor %}", LARGE),
        (GROWN.replace("GROW", "n.s ~ n.s"), LARGE),
        (GROWN.replace("GROW", "n.s + n.s"), LARGE),
        (GROWN.replace("GROW", "n.s | replace('a', 'aaaaaaaa')"), LARGE),
        (GROWN.replace("GROW", "[n.s, n.s] | join"), LARGE),
        (GROWN.replace("GROW", "[n.s, n.s]"), LARGE),
        (GROWN.replace("GROW", "{1: n.s, 2: n.s}"), LARGE),
        (GROWN.replace("{% set n.s = GROW %}", "{% set n.s %}{{ n.s }}{{ n.s }}{% endset %}"), LARGE),
        ("{{ ['a', 'b'] | join('x' * 90000) }}", LARGE),
        ("{{ '%99999999d' | format(1) }}", LARGE),
        ("{{ '%*d' % (99999999, 1) }}", LARGE),
        ("{{ 15 | round(-10 ** 8) }}", LARGE),
        ("{% macro a(n) %}{{ a(n + 1) }}{% endmacro %}{{ a(0) }}", DEEP),
        ("{% include 'krl/main.j2' %}", DEEP),
        ("{% import 'krl/main.j2' as x %}", DEEP),
        ("{% extends 'krl/main.j2' %}", DEEP),
        ("{% for x in [[1]] recursive %}{{ loop([[1]]) }}{% endfor %}", DEEP),
        ("{{ " + "(" * 5000 + "1" + ")" * 5000 + " }}", DEEP),
        ("{% for i in [1] %}" * 60 + "x" + "{% endfor %}" * 60, "too many statically nested blocks"),
        ("{{ 'a'.ljust(10 ** 11) }}", BARRED),
        ("{{ '{:>99999999}'.format(1) }}", BARRED),
        ("{{ (5).to_bytes(10 ** 10, 'big') }}", BARRED),
        ("{{ o.model_dump() }}", BARRED),
        ("{{ lipsum(n=10 ** 9) }}", "'lipsum' is undefined"),
        ("{{ 'a' | center(10 ** 11) }}", "No filter named 'center'"),
        ("{{ [1] }}", "prints a list"),
        ("{{ (1e308 * 10) | int }}", "infinity"),
        ("{{ " + "9" * 5000 + " }}", "krl/main.j2"),
    ],
)
def test_what_does_not_end_is_one_error(tmp_path: Path, small: None, text: str, message: str) -> None:
    caught = refuses("Q010", message, render, tmp_path, text)
    assert len(str(caught)) < 1000


def test_templates_unpickle_nothing(tmp_path: Path) -> None:
    # The options are a pydantic model; its parse_raw takes proto="pickle", and a pickle runs what it likes.
    bomb = "cbuiltins\\neval\\n(S'1 / 0'\\ntR."
    refuses(
        "Q010",
        "parse_raw may not be called",
        render,
        tmp_path,
        "{{ o.parse_raw(" + f'"{bomb}"' + ", proto='pickle', allow_pickle=True) }}",
    )


def test_what_a_shop_needs_still_works(tmp_path: Path, small: None) -> None:
    text = """{% for a, b in zip(x, y) %}{{ loop.index }}:{{ a }}={{ "%.2f" % b }}{{ "," if not loop.last }}{% endfor %}
{{ x | join("-") }} {{ "N" ~ 10 }} {{ "a b".split() | last | upper }} {{ y | sum | round(1) }}
{% set n = namespace(k=0) %}{% for v in range(0, 100, 10) %}{% set n.k = n.k + 10 %}{% endfor %}N{{ n.k }}
{{ {"M8": "on"}.get("M8") }} {{ cycler("u", "v").next() }} {{ y | map("int") | list | join }}
"""
    found = render(tmp_path, text, x=("X", "Y"), y=(1.0, 2.5))
    assert found == "1:X=1.00,2:Y=2.50X-Y N10 B 3.5\nN100\non u 12\n"


def test_a_budget_ends_by_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("machining.programs.sandbox.SECONDS", -1.0)
    refuses("Q010", "template t does not come to an end", Budget.of("t", 1).spend, 1.0)


def test_lists_are_counted_within_lists() -> None:
    budget = Budget.of("t", 1)
    assert budget.sized([[1] * 10] * 10) == [[1] * 10] * 10
    refuses("Q010", "too large", budget.sized, [["a" * 100] * 100] * (LARGEST // 10_000))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda file: file.mkdir(), "it is a folder"),
        (os.mkfifo, "a pipe, socket or device"),
        (lambda file: file.symlink_to("/dev/zero"), "a pipe, socket or device"),
        (lambda file: file.symlink_to(file.parent / "nowhere"), "main.j2 cannot be read"),
        (lambda file: file.symlink_to(file), "main.j2 cannot be read"),
        (lambda file: file.write_bytes(b"; \xff\xfe"), "no UTF-8 text"),
        (lambda file: file.write_bytes(b"x" * 2**21), "size"),
    ],
)
def test_a_template_that_cannot_be_opened_is_not_passed_over(tmp_path: Path, make: Any, message: str) -> None:
    (tmp_path / "krl").mkdir()
    make(tmp_path / "krl" / "main.j2")
    made = environment(tmp_path)
    caught = refuses("F001 F002 F004", message, list, rendered(made, "krl/main.j2", {"count": 1}))
    assert "main.j2" in str(caught)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_template_without_the_right_to_read_it_is_named(tmp_path: Path) -> None:
    (tmp_path / "krl").mkdir()
    (tmp_path / "krl" / "main.j2").write_text("x")
    (tmp_path / "krl" / "main.j2").chmod(0)
    with pytest.raises(InputError, match=r"main\.j2"):
        list(rendered(environment(tmp_path), "krl/main.j2", {"count": 1}))


def test_a_folder_of_templates_that_nothing_is_taken_from_is_refused(tmp_path: Path) -> None:
    (tmp_path / "KRL").mkdir()
    (tmp_path / "KRL" / "Main.j2").write_text("x")
    refuses("Q010", "holds no template that is used", environment, tmp_path)
    (tmp_path / "krl").write_text("a file where a folder is meant")
    refuses("F001", "krl", environment, tmp_path)


def test_a_byte_order_mark_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "krl").mkdir()
    (tmp_path / "krl" / "main.j2").write_bytes(b"\xef\xbb\xbfDEF x")
    assert "".join(rendered(environment(tmp_path), "krl/main.j2", {"count": 1})) == "DEF x"
