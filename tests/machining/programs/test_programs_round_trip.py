"""Written programs read back: within a micrometre and a microradian of the tool path, for any program and format."""

from __future__ import annotations

import json
import time
import tracemalloc
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from program_cases import PLAIN, busy, cell_of, motions_of, program_of, rail, random_poses, spindle, turntable
from refusals import refuses

from machining.cell import Cell, LinearAxis, Tool, Turntable
from machining.programs.format import RoundTrip
from machining.programs.formats import FORMATS, NEUTRAL, parse_options, round_trip, write_program
from machining.programs.program import JointProgram, tool_in_part
from machining.programs.read_back import ReadMove
from machining.programs.write_options import WriteOptions
from machining.toolpaths.events import added, ordered
from robots import load_robot

BOTH = [(name, kind) for name, f in FORMATS.items() for kind in f.kinds]


# What stands before a coordinate in Cartesian and joint programs.
WRONG = {"krl": ("X ", "A3 "), "rapid": ("[[", "[["), "val3": (' x="', ' j3="'), "sinumerik": ("", "A3=")}


def options(name: str, robot: str = "kr60-3", **more: Any) -> WriteOptions:
    bundled = {"krl": "kr60-3", "val3": "tx200", "sinumerik": robot}.get(name) == robot
    return parse_options(({} if bundled else {"arm": PLAIN}) | more, "options")


def checked(program: JointProgram, name: str, kind: Any, o: WriteOptions) -> RoundTrip:
    back = round_trip(program, write_program(program, name, kind, o).texts(), name, kind, o)
    assert back.within(1e-6), back
    # Seven digits of a speed; a time is rounded once more through its rate.
    assert back.pace < 1e-6
    return back


@pytest.mark.parametrize(("name", "kind"), BOTH)
@pytest.mark.parametrize("robot", ["kr60-3", "tx200"])
def test_round_trip(robot: str, name: str, kind: Any) -> None:
    checked(program_of(robot), name, kind, options(name, robot))


@pytest.mark.parametrize(("name", "kind"), [pair for pair in BOTH if FORMATS[pair[0]].external_axes == "moving"])
def test_round_trip_with_three_rails_and_a_turntable(name: str, kind: Any) -> None:
    up = LinearAxis("lift", np.array([0.0, 0.0, 1.0]), np.array([-1.0, 1.0]))
    cell = cell_of(linear_axes=(rail("a"), rail("b"), up), turntable=turntable())
    n = 6
    travel = np.stack([np.linspace(0, 0.1, n), np.linspace(0.05, -0.05, n), np.linspace(0, 0.02, n)], axis=1)
    program = program_of(n=n, cell=cell, travel=travel, table=np.linspace(-0.3, 0.3, n))
    checked(program, name, kind, options(name))
    signs = PLAIN | {"external_sign": [-1, 1, -1, 1], "external_offset": [100.0, 0.0, -20.0, 90.0]}
    o = parse_options({"arm": signs}, "options")
    checked(program, name, kind, o)


def any_program(seed: int, n: int, axes: int, table: bool) -> JointProgram:
    """Random poses within all limits, so that every configuration and turn comes up; far from a real path."""
    rng = np.random.default_rng(seed)
    robot = load_robot(("kr60-3", "tx200")[seed % 2])
    turning = Turntable(rng.normal(size=3), np.array([0.1, 0.0, 1.0]), np.array([-7.0, 7.0])) if table else None
    rails = tuple(LinearAxis(f"e{i}", rng.normal(size=3), np.array([-9.0, 9.0])) for i in range(axes))
    cell = Cell(tool=Tool(spindle()), linear_axes=rails, turntable=turning)
    q, travel = random_poses(robot, n, rng), rng.uniform(-3.0, 3.0, (n, axes))
    angle = rng.uniform(-6.0, 6.0, n) if table else np.zeros(n)
    T = tool_in_part(robot, cell, q, travel, angle, cell.tool.T_flange_tool)
    rapid = rng.random(n) < 0.3
    motions = motions_of(
        np.ascontiguousarray(T[:, :3, 3]),
        -T[:, :3, 2],
        rapid=rapid,
        feed=np.where(rapid, np.nan, 10.0 ** rng.uniform(-5.0, 0.5, n)),
        dwell=np.where(rng.random(n) < 0.2, 1.0, 0.0),
        spindle=rng.choice([0.0, 100.0, np.nan], n),
    )
    zeros = np.zeros(n, dtype=np.int64)
    return JointProgram(robot, cell, motions, T, q, travel, angle, np.zeros(n), zeros, ("any",), zeros > 0)


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 9),
    axes=st.integers(0, 3),
    table=st.booleans(),
    which=st.sampled_from(BOTH),
    rapid=st.sampled_from(["linear", "joint"]),
    per_file=st.integers(1, 5),
    feed=st.sampled_from(["inverse_time", "per_minute"]),
)
def test_any_program_round_trips(
    seed: int, n: int, axes: int, table: bool, which: tuple[str, Any], rapid: str, per_file: int, feed: str
) -> None:
    name, kind = which
    if FORMATS[name].external_axes != "moving":
        axes, table = 0, False
    program = any_program(seed, n, axes, table)
    o = options(name, program.robot.name, rapid=rapid, moves_per_file=per_file, sinumerik={"feed": feed})
    back = round_trip(program, write_program(program, name, kind, o).texts(), name, kind, o)
    assert back.within(1e-6), back
    assert back.pace < 2e-6


@pytest.mark.parametrize(("name", "kind"), [pair for pair in BOTH if pair[0] in WRONG])
def test_a_changed_digit_is_seen(name: str, kind: Any) -> None:
    """The comparison is worth something: a coordinate off by more than the tolerance fails."""
    program = program_of()
    o = options(name)
    texts = write_program(program, name, kind, o).texts()
    mark = WRONG[name][kind == "joint"]
    file = "part.dtx" if name == "val3" else list(texts)[-1]
    at = texts[file].rindex(mark) + len(mark)
    end = at + next(i for i, c in enumerate(texts[file][at:]) if c not in "-.0123456789")
    value = float(texts[file][at:end])
    texts[file] = f"{texts[file][:at]}{value + 3e-3:.7f}{texts[file][end:]}"
    back = round_trip(program, texts, name, kind, o)
    assert back.tip > 1e-6
    assert not back.within()


@pytest.mark.parametrize("name", ["krl", "rapid", "val3", "sinumerik"])
def test_a_shops_own_calls_and_statements_are_passed_over(name: str) -> None:
    program, o = program_of(n=4), options(name, moves_per_file=3)
    kind: Any = FORMATS[name].kinds[0]
    own = {
        "krl": ("part_001 ( )", "SPINDLE_ON ( )\n$OUT[3] = TRUE\npart_001 ( )"),
        "rapid": ("    part_001;", "    SpindleOn;\n    SetDO doAir,1;\n    part_001;"),
        "val3": ("  call p001()", "  call spindle()\n  dAir=true\n  call p001()"),
        "sinumerik": ("\nPART_001\n", "\nM3 S9000\nSPINDLE_ON\nPART_001\n"),
    }[name]
    texts = {k: v.replace(*own) for k, v in write_program(program, name, kind, o).texts().items()}
    assert own[1] in "".join(texts.values())
    assert round_trip(program, texts, name, kind, o).within()


def test_axes_and_kinds_that_differ_are_seen() -> None:
    cell = cell_of(linear_axes=(rail(),), turntable=turntable())
    program = program_of(n=3, cell=cell, travel=np.zeros((3, 1)))
    texts = write_program(program, "krl").texts()
    good = texts["part_001.src"]
    back = round_trip(program, texts | {"part_001.src": good.replace("E1 0.00000", "E1 0.01000")}, "krl", "cartesian")
    assert back.travel == pytest.approx(1e-5, abs=1e-12)
    assert not back.within()
    back = round_trip(
        program, texts | {"part_001.src": good.replace("E2 0.0000000", "E2 0.0010000")}, "krl", "cartesian"
    )
    assert back.table == pytest.approx(np.radians(1e-3), abs=1e-12)
    back = round_trip(program, texts | {"part_001.src": good.replace("LIN", "PTP")}, "krl", "cartesian")
    assert not back.same_moves
    assert not back.within()
    back = round_trip(program, texts | {"part_001.src": good.replace("CP = 0.02", "CP = 0.03")}, "krl", "cartesian")
    assert back.pace == pytest.approx(0.5)
    joint = good.replace("LIN {X", "PTP {A1 1,A2 2,A3 3,A4 4,A5 5,A6 6,Q")
    refuses("Q005", "one kind", round_trip, program, texts | {"part_001.src": joint}, "krl", "cartesian")
    refuses(
        "Q005",
        "as many as",
        round_trip,
        program,
        texts | {"part_001.src": good.replace(",E2 0.0000000}", "}", 1)},
        "krl",
        "cartesian",
    )
    refuses(
        "Q001",
        "1 external axes",
        round_trip,
        program,
        texts | {"part_001.src": good.replace(",E2 0.0000000}", "}")},
        "krl",
        "cartesian",
    )


def test_configurations_come_back() -> None:
    program = program_of()
    for name, wanted in (("krl", (2, 3)), ("rapid", (0, -2, -1, 0)), ("val3", ("lefty", "epositive", "wpositive"))):
        o = options(name)
        texts = write_program(program, name, "cartesian", o).texts()
        found = [move for move in FORMATS[name].read(texts, program.cell, o) if isinstance(move, ReadMove)]
        assert len(found) == program.n
        assert len(found[0].configuration) == len(wanted)
        assert [type(v) for v in found[0].configuration] == [type(v) for v in wanted]


def test_json_holds_everything() -> None:
    cell = cell_of(linear_axes=(rail(),))
    program = replace(
        busy(hostile='"\\\u2028ä'), inserted=np.arange(12) % 3 == 1, branch=np.full(12, 2), gamma=np.linspace(0, 1, 12)
    )
    text = write_program(program, "json").files[0].text()
    back = NEUTRAL[".json"].program(text, program.robot, program.cell)
    m, own = back.motions, program.motions
    np.testing.assert_allclose(back.q, program.q, rtol=0, atol=1e-15)
    np.testing.assert_allclose(m.feed, own.feed, rtol=1e-15)
    np.testing.assert_allclose(m.spindle, own.spindle, rtol=1e-15)
    np.testing.assert_allclose(m.points, own.points, atol=1e-15)
    np.testing.assert_allclose(m.axes, own.axes, atol=1e-15)
    for name in ("rapid", "line", "tool", "operation", "dwell"):
        np.testing.assert_array_equal(getattr(m, name), getattr(own, name))
    for name in ("inserted", "branch", "names"):
        np.testing.assert_array_equal(getattr(back, name), getattr(program, name))
    np.testing.assert_allclose(back.gamma, program.gamma, atol=1e-15)
    assert (m.operations, m.source) == (own.operations, own.source)
    # Columns that change without an event have become events; then nothing is left to add.
    assert all(a.same(b) for a, b in zip(m.events, ordered(own), strict=True))
    assert not added(m)
    assert [(t.number, t.name) for t in m.tools] == [(t.number, t.name) for t in own.tools]
    assert m.tools[0].diameter == pytest.approx(0.012, abs=1e-15)
    assert np.isnan(m.tools[1].diameter)
    refuses("Q005", "linear_axes", NEUTRAL[".json"].program, text, program.robot, cell)
    refuses("Q005", "robot", NEUTRAL[".json"].program, text, load_robot("tx200"), program.cell)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("schema", "stiffarm-program/1", "schema"),
        ("columns", ["line"], "columns"),
        ("moves", {}, "a list"),
        ("moves", [[1, 2]], "move 1"),
        ("tools", [{"number": 1}], "KeyError"),
        ("tools", [3], "TypeError"),
        ("events", [{"line": "x", "before_move": 0, "word": "", "text": ""}], "program"),
    ],
)
def test_json_that_is_not_right(key: str, value: Any, message: str) -> None:
    program = program_of(n=3)
    data = json.loads(write_program(program, "json").files[0].text())
    data[key] = value
    refuses("Q005", message, NEUTRAL[".json"].program, json.dumps(data), program.robot, program.cell)
    del data[key]
    refuses("Q005", key, NEUTRAL[".json"].program, json.dumps(data), program.robot, program.cell)


def test_neutral_moves_that_are_not_right() -> None:
    program = program_of(n=3)
    text = write_program(program, "json").files[0].text()
    data = json.loads(text)
    for column, value, message in (
        ("q3_deg", None, "q3_deg"),
        ("qw", 0.5, "unit"),
        ("x_mm", "1", "numbers"),
        ("tool", 7, "tool"),
    ):
        changed = json.loads(text)
        changed["moves"][1][data["columns"].index(column)] = value
        refuses("B001 Q005", message, NEUTRAL[".json"].program, json.dumps(changed), program.robot, program.cell)
    refuses("F005", "JSON", NEUTRAL[".json"].program, text[:-5], program.robot, program.cell)
    table = write_program(program, "csv").files[0].text()
    lines = table.splitlines()
    for bad, message in (
        ("", "first line"),
        (table.replace("/2", "/1"), "first line"),
        (table.replace("q1_deg", "q1"), "columns"),
        ("\n".join([*lines[:2], lines[2] + ",1"]), "fields"),
        ("\n".join([*lines[:2], lines[2].replace(",0.0,", ",x,")]), "line 3"),
        ("\n".join([*lines[:2], lines[2].replace(",0.0,", ",nan,")]), "finite"),
        (table + '"' + "x" * 200_000, "not valid CSV"),  # beyond what the csv module takes for one field
    ):
        refuses("Q005", message, NEUTRAL[".csv"].program, bad, program.robot, program.cell)


@pytest.mark.parametrize(
    ("name", "good", "bad", "message"),
    [
        ("krl", "LIN {X", "CIRC {X", "LIN and PTP"),
        ("krl", "LIN {X", "SLIN {X", "LIN and PTP"),
        ("krl", "LIN {X", "LIN_REL {X", "LIN and PTP"),
        ("krl", "LIN {X", "LIN P1 ;{X", "LIN and PTP"),
        ("krl", ",Z ", ",Q ", "X Y Z A B C"),
        ("krl", ",Z ", ",Z z", "a number"),
        ("krl", ",Z ", ",Z nan;", "part_001.src"),
        ("krl", "$VEL.CP = 0", "$VEL.CP = x", "VEL.CP"),
        ("rapid", "MoveL [[", "MoveC [[", "MoveL"),
        ("rapid", "MoveL [[", "MoveL Offs([[", "MoveL"),
        ("rapid", ",9E9]],", "]],", "robtarget"),
        ("val3", "movel(pPath[", "movec(pPath[", "movel or movej"),
        ("val3", "movel(pPath[1]", "movel(pPath[99]", "pPath"),
        ("val3", 'key="1"', 'key="x"', "whole number"),
        ("sinumerik", "G1 A1=", "G2 A1=", "G0 and G1"),
        ("sinumerik", "G1 A1=", "G1 B1=", "every axis"),
        ("sinumerik", " F", " S", "an F"),
    ],
)
def test_readers_refuse_what_they_do_not_know(name: str, good: str, bad: str, message: str) -> None:
    program = program_of(n=4)
    o = options(name)
    kind: Any = FORMATS[name].kinds[0]
    texts = {k: t.replace(good, bad) for k, t in write_program(program, name, kind, o).texts().items()}
    refuses("Q005", message, round_trip, program, texts, name, kind, o)


@pytest.mark.parametrize("name", ["krl", "rapid", "val3", "sinumerik"])
def test_missing_files_and_moves(name: str) -> None:
    program = program_of(n=4)
    o = options(name, moves_per_file=2)
    kind: Any = FORMATS[name].kinds[0]
    texts = write_program(program, name, kind, o).texts()
    last = list(texts)[-1]
    refuses(
        "Q005", "sub-program", list, FORMATS[name].read({k: v for k, v in texts.items() if k != last}, program.cell, o)
    )
    refuses("Q005", "main file", list, FORMATS[name].read({}, program.cell, o))
    short = {k: "" if k == last else v for k, v in texts.items()}
    refuses("Q001", "2 moves", round_trip, program, short, name, kind, o)
    if name != "sinumerik":
        refuses("Q001", "cartesian coordinates", round_trip, program, texts, name, "joint", o)


def long_program(n: int) -> JointProgram:
    short = program_of(n=100)
    k = n // 100
    tiled = {
        name: np.tile(getattr(short, name), (k, *[1] * (getattr(short, name).ndim - 1)))
        for name in ("T_part_tool", "q", "travel", "table", "gamma", "branch", "inserted")
    }
    points, axes = np.tile(short.motions.points, (k, 1)), np.tile(short.motions.axes, (k, 1))
    motions = motions_of(points, axes, feed=np.linspace(0.01, 0.02, n), rapid=np.zeros(n, dtype=np.bool_))
    return replace(short, motions=motions, **tiled)


@pytest.mark.slow
def test_memory_does_not_grow_with_the_program() -> None:
    """Texts are made a block at a time: a program twice as long needs no more at once."""
    peaks = []
    for n in (2500, 5000):
        job = write_program(long_program(n), "krl", "cartesian", options("krl", moves_per_file=10_000))
        tracemalloc.start()
        for file in job.files:
            for _ in file.pieces():
                pass
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # Two blocks of 1000 moves are held at most; 130 characters a move would be 0.3 MB more if all were.
    assert peaks[1] < peaks[0] + 1e5


@pytest.mark.slow
@pytest.mark.parametrize(("name", "kind"), [pair for pair in BOTH if pair[1] == FORMATS[pair[0]].kinds[0]])
def test_long_programs_take_time_by_their_length(name: str, kind: Any) -> None:
    o, spent = options(name), []
    for moves in (2_000, 20_000):
        program = long_program(moves)
        start = time.process_time()
        texts = write_program(program, name, kind, o).texts()
        spent.append(time.process_time() - start)
    # Ten times the moves: a time with their square would be a hundred times as long.
    assert spent[1] < 30.0 * spent[0]
    assert round_trip(program, texts, name, kind, o).within()
