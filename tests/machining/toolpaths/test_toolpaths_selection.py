"""Operations and tools chosen from a file, and which of its moves mill: not plunges, holes and ramps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike
from refusals import refuses

from machining.cell import Cell
from machining.tooling import require_tools
from machining.toolpaths import read_given_path, read_toolpath, to_tool_path
from machining.toolpaths.engagement import mills, plunges
from machining.toolpaths.events import added, ordered
from machining.toolpaths.motions import Motions
from machining.toolpaths.selection import select

FILE = """UNITS/MM
TOOL PATH/ROUGH,TOOL,MILL
TLDATA/MILL,16,0,75,0,0
LOAD/TOOL,1
SPINDL/RPM,4000,CLW
COOLNT/FLOOD
RAPID
GOTO/0,0,50
FEDRAT/600,MMPM
GOTO/0,0,0
GOTO/50,0,0
DELAY/1
SPINDL/OFF
END-OF-PATH
TOOL PATH/HOLES,TOOL,DRILL
TLDATA/DRILL,6,0,50
LOAD/TOOL,2
SPINDL/RPM,1500,CLW
COOLNT/MIST
RAPID
GOTO/10,10,50
CYCLE/DRILL,RAPTO,3,FEDTO,-10,MMPM,100
GOTO/10,10,0
CYCLE/OFF
END-OF-PATH
TOOL PATH/FINISH,TOOL,MILL
TLDATA/MILL,16,0,75,0,0
LOAD/TOOL,1
SPINDL/RPM,6000,CLW
FEDRAT/900,MMPM
GOTO/0,20,0
GOTO/50,20,0
COOLNT/OFF
END-OF-PATH
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "part.cls"
    path.write_text(FILE, encoding="utf-8")
    return path


def said(motions: Motions) -> list[tuple[int, str, str]]:
    """Commands with the move that each comes before, and how much of it."""
    words = {"spindle": lambda e: f"{e.value * 30.0 / np.pi:.0f}", "tool": lambda e: str(int(e.value)), "dwell": str}
    return [
        (e.move, e.kind, words[e.kind](e) if e.kind in ("spindle", "tool") else e.text)
        for e in ordered(motions)
        if e.kind not in ("", "operation")
    ]


def test_a_file_with_several_tools_is_read_whole(file: Path) -> None:
    m = read_toolpath(file)
    assert m.operations == ("ROUGH", "HOLES", "FINISH")
    assert [t.number for t in m.tools] == [1, 2]
    assert not [e for e in added(m) if e.kind != "operation"]


def test_an_operation_keeps_its_commands_and_stops_what_it_started(file: Path) -> None:
    m = select(read_toolpath(file), operations=["holes"])
    assert {m.operations[i] for i in m.operation} == {"HOLES"}
    # The flood of the operation before still runs here; what runs behind the last move is stopped.
    assert said(m) == [
        (0, "coolant", "flood"),
        (0, "tool", "1"),
        (0, "spindle", "1500"),
        (0, "coolant", "mist"),
        (m.n, "spindle", "0"),
        (m.n, "coolant", "off"),
    ]
    first = select(read_toolpath(file), operations=["ROUGH"])
    assert said(first) == [
        (0, "tool", "0"),
        (0, "spindle", "4000"),
        (0, "coolant", "flood"),
        (3, "dwell", ""),
        (3, "spindle", "0"),
        (3, "coolant", "off"),
    ]


def test_a_tools_operations_and_the_way_into_one_that_begins_at_feed(file: Path) -> None:
    whole = read_toolpath(file)
    m = select(whole, tool_numbers=[1])
    assert [m.operations[i] for i in m.operation] == ["ROUGH"] * 3 + ["FINISH"] * 3
    # FINISH begins at feed where HOLES ended: that point is entered by a rapid move.
    assert m.rapid.tolist() == [True, False, False, True, False, False]
    assert any("begin at feed" in note.text for note in m.notes)
    assert said(m)[-5:] == [
        (3, "coolant", "mist"),
        (3, "spindle", "0"),
        (3, "spindle", "6000"),
        (6, "coolant", "off"),
        (6, "spindle", "0"),
    ]
    both = select(whole, operations=["Finish"], tool_numbers=[1])
    np.testing.assert_array_equal(both.points, m.points[3:])
    assert select(whole) is whole


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"operations": ["MILL"]}, "'ROUGH', 'HOLES'"),
        ({"tool_numbers": [7]}, "allowed: 1, 2|1, 2"),
        ({"operations": ["HOLES"], "tool_numbers": [1]}, "have no move"),
    ],
)
def test_a_choice_that_the_file_does_not_have(file: Path, choice: dict, message: str) -> None:
    refuses("P006", message, select, read_toolpath(file), **choice)


def test_several_tools_and_no_choice_names_the_options(file: Path) -> None:
    refuses(
        "K003",
        r"tool number 1 for 'ROUGH', 'FINISH'; tool number 2 for 'HOLES'.*--tool-number or",
        require_tools,
        Cell(),
        read_given_path(file).motions,
    )
    table = file.with_name("path.csv")
    table.write_text("x_mm,y_mm,z_mm,nx,ny,nz\n0,0,0,0,0,1\n1,0,0,0,0,1\n", encoding="utf-8")
    refuses("P009", "neither operations nor tools", read_given_path, table, operations=["A"])


def test_a_path_for_judging_has_no_plunge_and_no_rapid_move(file: Path) -> None:
    given = read_given_path(file, tool_numbers=[1])
    np.testing.assert_allclose(given.path.points[:, 0] * 1e3, [0, 50, 0, 50])
    assert given.free.tolist() == [False, True, False]
    assert given.moves.tolist() == [1, 2, 4, 5]
    assert any("1 moves at feed plunge" in note.text or "plunge" in note.text for note in given.notes)
    assert not given.drilled
    holes = read_given_path(file, operations=["HOLES"])
    assert holes.drilled


def test_a_table_that_plunges_is_judged_where_it_mills(tmp_path: Path) -> None:
    table = tmp_path / "path.csv"
    rows = ["0,0,5", "0,0,0", "10,0,0", "20,0,0", "20,0,5", "20,10,5", "20,10,0", "0,10,0"]
    table.write_text("x_mm,y_mm,z_mm,nx,ny,nz\n" + "".join(f"{r},0,0,1\n" for r in rows), encoding="utf-8")
    given = read_given_path(table)
    assert given.moves.tolist() == [1, 2, 3, 4, 5, 6, 7]
    assert given.free.tolist() == [False, False, True, False, True, False]
    assert given.count == 8


UP = np.array([0.0, 0.0, 1.0])


def at_feed(points: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    p = np.asarray(points, dtype=np.float64) * 1e-3
    return p, np.tile(UP, (len(p), 1)), np.arange(len(p)) > 0


def test_a_ramp_into_a_pocket_is_no_cut_and_a_slope_of_the_surface_is_one() -> None:
    ramp = [[0, 0, 5], [10, 0, 2.5], [0, 0, 0], [20, 0, 0], [20, 20, 0]]
    assert mills(*at_feed(ramp)).tolist() == [False, False, False, True, True]
    angle = np.linspace(0.0, 4.0 * np.pi, 41)
    helix = np.stack([5.0 * np.cos(angle), 5.0 * np.sin(angle), 4.0 - 4.0 * angle / angle[-1]], axis=1)
    level = helix[-1] + np.array([[100.0 * i, 0.0, 0.0] for i in range(1, 4)])
    found = mills(*at_feed(np.vstack([helix, level])))
    assert not found[:41].any()
    assert found[41:].all()
    # A bowl goes down and up again without a level stretch: all of it is cut.
    x = np.linspace(-20.0, 20.0, 41)
    assert mills(*at_feed(np.stack([x, 0 * x, x**2 / 40.0], axis=1)))[1:].all()
    # Down a slope to the end.
    assert mills(*at_feed(np.stack([x, 0 * x, -x], axis=1)))[1:].all()
    # A level stretch that is shorter than the slope before it is a part of the surface.
    assert mills(*at_feed([[0, 0, 10], [20, 0, 0], [21, 0, 0], [40, 0, 10]]))[1:].all()


def test_plunges_retracts_and_rests_are_told_apart() -> None:
    points, axes, cutting = at_feed([[0, 0, 5], [0, 0, 0], [10, 0, 0], [10, 0, 0], [10, 0, 5]])
    assert mills(points, axes, cutting).tolist() == [False, False, True, False, False]
    assert plunges(points, axes, cutting).tolist() == [False, True, False, False, False]
    assert not plunges(points, axes, cutting & False).any()
    for none in (mills, plunges):
        assert none(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=bool)).tolist() == []
        assert none(np.zeros((1, 3)), UP[None], np.zeros(1, dtype=bool)).tolist() == [False]


def test_a_file_that_only_drills_is_taken_whole(file: Path) -> None:
    m = select(read_toolpath(file), operations=["HOLES"])
    found = to_tool_path(m)
    assert found.path.n == 2
    np.testing.assert_allclose(found.path.points[:, 2] * 1e3, [3, -10])
