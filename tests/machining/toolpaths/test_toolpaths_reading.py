"""Files as a whole: kinds, limits, hostile content, conversion, neutral CSV."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import os
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from refusals import refuses, refuses_each
from toolpath_cases import SAMPLES, apt, gcode

from machining import ToolPath, read_path
from machining.toolpaths import (
    Motions,
    ReadOptions,
    Tool,
    cutting_runs,
    read_apt,
    read_motions,
    read_toolpath,
    to_tool_path,
    write_motions,
)
from robots import InputError, InputErrors


def write(tmp_path: Path, name: str, text: str | bytes) -> Path:
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize("name", ["nx.cls", "catia.aptsource", "creo.ncl", "autodesk.apt", "mill.nc"])
def test_the_kind_is_found_by_suffix_and_by_content(tmp_path: Path, name: str) -> None:
    by_suffix = read_toolpath(SAMPLES / name)
    text = (SAMPLES / name).read_bytes()
    by_content = read_toolpath(write(tmp_path, "program.txt", text))
    np.testing.assert_array_equal(by_suffix.points, by_content.points)
    wrong = write(tmp_path, "program" + (".cls" if name.endswith("nc") else ".nc"), text)
    refuses("P001", "suffix says", read_toolpath, wrong)
    kind = "gcode" if name.endswith("nc") else "apt"
    assert read_toolpath(wrong, kind=kind).n == by_suffix.n


def test_kinds_that_are_not_clear_or_not_read(tmp_path: Path) -> None:
    refuses("P001", "not clear", read_toolpath, write(tmp_path, "a.txt", "hello\nworld\n"))
    assert read_toolpath(write(tmp_path, "a.nc", "0 BEGIN PGM A MM\n1 L X+0 Y+0 Z+0 R0 FMAX\n")).n == 1
    refuses("P001", "kind of the tool path", read_toolpath, SAMPLES / "nx.cls", kind="krl")
    refuses("F001", "does not exist", read_toolpath, tmp_path / "none.cls")
    refuses("F001", "it is a folder", read_toolpath, tmp_path)


def test_a_path_in_csv_becomes_motions(tmp_path: Path) -> None:
    text = "x_mm,y_mm,z_mm,nx,ny,nz,feed_mm_per_min\n1,2,3,0,0,1,600\n\n4,5,6,0,1,0,\n"
    path = write(tmp_path, "path.csv", text)
    m = read_toolpath(path)
    np.testing.assert_allclose(m.points, read_path(path).points)
    np.testing.assert_allclose(m.feed, [0.01, np.nan])
    assert m.line.tolist() == [2, 4]
    assert not m.rapid.any()


def test_size_is_checked_before_the_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "big.cls"
    with path.open("wb") as file:
        file.truncate(300 * 2**20)
    tracemalloc.start()
    refuses("F002", r"314572800 bytes.*split it", read_toolpath, path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1e6
    refuses("P002", "empty", read_toolpath, write(tmp_path, "a.cls", b""))
    refuses(
        "P005",
        "max_moves",
        read_apt,
        write(tmp_path, "b.apt", "UNITS/MM\n" + "GOTO/0,0,0\n" * 20),
        ReadOptions(max_moves=19),
    )


def test_what_is_no_ordinary_text_file_is_refused(tmp_path: Path) -> None:
    refuses("P002", "NUL", read_toolpath, write(tmp_path, "a.cls", "GOTO/1,2,3\n".encode("utf-16")))
    refuses(
        "P002",
        "line 2: length",
        read_toolpath,
        write(tmp_path, "b.cls", "GOTO/1,2,3\n" + "PPRINT/" + "x" * 20000 + "\n"),
    )
    pipe = tmp_path / "pipe.cls"
    os.mkfifo(pipe)
    refuses("F001", "", read_apt, pipe)


def test_hostile_text_stays_data(tmp_path: Path) -> None:
    evil = "\x1b[2J\x07$(rm -rf /) ${x} {0} %s \x9b31m" + "A" * 5000
    m = apt(tmp_path, f"PPRINT/{evil}\nGOTO/0,0,0\n{evil}/1\nFINI\n".replace("$", "S"), unknown_motion="report")
    for text in [e.text for e in m.events] + [e.word for e in m.events] + [str(n) for n in m.notes]:
        assert text.isprintable()
        assert len(text) < 300
    with pytest.raises(InputErrors) as info:
        apt(tmp_path, f"GOTO/0,0,\x1b[2J{'B' * 5000}\n")
    assert "\x1b" not in str(info.value)
    assert len(str(info.value)) < 1500
    with pytest.raises(InputErrors) as info:
        gcode(tmp_path, f"G1 X\x1b[2J{'B' * 5000}\n")
    assert "\x1b" not in str(info.value)
    assert len(str(info.value)) < 1500


def test_absurd_arcs_are_refused_before_memory_is_taken(tmp_path: Path) -> None:
    for text in (
        "GOTO/0,0,0\nCIRCLE/0,1e9,0,0,0,1,1e9\nGOTO/0,2e9,0\n",
        "GOTO/0,0,0\nCIRCLE/0,900000,0,0,0,1,900000,TIMES,10000\nGOTO/0,0,0\n",
    ):
        with pytest.raises((InputErrors, InputError)):
            apt(tmp_path, text, max_moves=10**6)


def test_bytes_that_are_not_utf8_are_read_in_text_only(tmp_path: Path) -> None:
    m = apt(tmp_path, "TOOL PATH/Fr\xe4sen,TOOL,\xc3\xa9\nGOTO/0,0,0\n")
    assert m.operations == ("Fr\xe4sen",)
    assert m.tools[0].name == "\xe9"
    refuses_each("P020", "line 2", apt, tmp_path, "GOTO/0,0,\xb2\n")


finite = st.floats(-1e4, 1e4)
unit = st.tuples(finite, finite, finite).filter(lambda v: math.hypot(*v) > 1e-3)


@st.composite
def motions(draw: st.DrawFn) -> Motions:
    n = draw(st.integers(1, 8))

    def column(values: st.SearchStrategy[float]) -> list[float]:
        return draw(st.lists(values, min_size=n, max_size=n))

    axes = np.array(draw(st.lists(unit, min_size=n, max_size=n)))
    names = st.text(st.characters(min_codepoint=32, max_codepoint=0x2FF, exclude_categories=("Cc", "Cf")), max_size=12)
    operations = tuple(dict.fromkeys(draw(st.lists(names, min_size=1, max_size=3))))
    size = st.one_of(st.just(math.nan), st.floats(0, 1))
    number = st.one_of(st.none(), st.integers(0, 99))
    tools = tuple(draw(st.lists(st.builds(Tool, number, names, size, size, size), min_size=1, max_size=3)))
    return Motions(
        points=np.array(draw(st.lists(st.tuples(finite, finite, finite), min_size=n, max_size=n))),
        axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
        rapid=np.array(column(st.booleans()), dtype=bool),
        feed=np.array(column(st.one_of(st.just(math.nan), st.floats(1e-6, 10)))),
        line=np.array(column(st.integers(0, 10**9)), dtype=np.int64),
        tool=np.array(column(st.integers(0, len(tools) - 1)), dtype=np.int64),
        spindle=np.array(column(st.one_of(st.just(math.nan), st.floats(-1e4, 1e4)))),
        dwell=np.array(column(st.floats(0, 1e3))),
        operation=np.array(column(st.integers(0, len(operations) - 1)), dtype=np.int64),
        tools=tools,
        operations=operations,
    )


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(motions())
def test_motions_come_back_from_csv(tmp_path: Path, m: Motions) -> None:
    path = tmp_path / "m.csv"
    write_motions(path, m)
    back = read_toolpath(path)
    # Two products per number: a few units of the last digit of 10 km.
    np.testing.assert_allclose(back.points, m.points, rtol=1e-15, atol=1e-9)
    np.testing.assert_allclose(back.axes, m.axes, atol=1e-15)
    np.testing.assert_allclose(back.feed, m.feed, rtol=1e-14)
    np.testing.assert_allclose(back.spindle, m.spindle, rtol=1e-14)
    for name in ("rapid", "line", "tool", "dwell", "operation"):
        np.testing.assert_array_equal(getattr(back, name), getattr(m, name))
    assert back.operations == m.operations
    for a, b in zip(back.tools, m.tools, strict=True):
        assert (a.number, a.name) == (b.number, b.name)
        np.testing.assert_allclose(
            [a.diameter, a.corner_radius, a.length], [b.diameter, b.corner_radius, b.length], rtol=1e-14
        )


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(finite, finite, finite, unit), min_size=1, max_size=20))
def test_goto_lines_give_back_what_was_written(tmp_path: Path, rows: list[tuple[float, float, float, tuple]]) -> None:
    text = "".join(f"GOTO/{x!r},{y!r},{z!r},{a[0]!r},{a[1]!r},{a[2]!r}\n" for x, y, z, a in rows)
    m = apt(tmp_path, text)
    np.testing.assert_allclose(m.points, [[x * 1e-3, y * 1e-3, z * 1e-3] for x, y, z, _ in rows], rtol=1e-15)
    axes = np.array([a for *_, a in rows])
    np.testing.assert_allclose(m.axes, axes / np.linalg.norm(axes, axis=1, keepdims=True), atol=1e-15)


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.text(st.characters(max_codepoint=255), max_size=40), max_size=8), st.sampled_from(["apt", "gcode"]))
def test_no_text_makes_more_than_a_message(tmp_path: Path, rows: list[str], kind: str) -> None:
    words = [
        "GOTO/",
        "CIRCLE/",
        "CYCLE/DRILL,",
        "G1 X",
        "G2 I",
        "(",
        "$",
        "TLON,GOFWD/",
        "MOVARC/",
        "FEDRAT/",
        "#",
        "G83",
    ]
    text = "\n".join(words[i % len(words)] + row for i, row in enumerate(rows))
    path = write(tmp_path, "any.txt", ("UNITS/MM\n" if kind == "apt" else "G21\n").encode() + text.encode("latin-1"))
    # Any other exception fails the test.
    with contextlib.suppress(InputError):
        read_toolpath(path, kind=kind)


def test_events_come_back_from_csv_and_bad_ones_are_told(tmp_path: Path) -> None:
    text = "SPINDL/RPM,3000,CLW\nCOOLNT/MIST\nGOTO/0,0,0\nDELAY/2\nOPSTOP\nPPRINT a,b\nGOTO/1,0,0\nFINI\n"
    path, m = tmp_path / "m.csv", apt(tmp_path, text)
    write_motions(path, m)
    back = read_motions(path)
    assert len(m.events) == 8
    assert all(a.same(b) for a, b in zip(back.events, m.events, strict=True))
    good = path.read_text()
    for old, new, message in (
        ("#event,2,0,spindle", "#event,2,x,spindle", "no whole number"),
        (",spindle,3000.0000000000005,", ",spindle,fast,", "could not convert"),
        (",spindle,3000", ",spinning,3000", "allowed: operation"),
        (",coolant,,", ",coolant,,7,", "8 cells"),
        ("#event,2,0,spindle", "#event,2,9,spindle", "before move 9"),
        (",COOLNT,mist", ",COOLNT,warm", "flood, mist, through, off"),
    ):
        assert old in good
        path.write_text(good.replace(old, new))
        refuses("B001 P008", message, read_motions, path)


def test_bad_rows_of_motions_come_at_once(tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    write_motions(path, apt(tmp_path, "GOTO/0,0,0\nGOTO/1,0,0\n"))
    rows = path.read_text().splitlines()
    bad = [*rows[:-2], rows[-2].replace("0.0", "nan", 1), rows[-1] + ",7", "1,2", *["x"] * 40]
    path.write_text("\n".join(bad))
    info = refuses_each("P008", "", read_motions, path)
    assert (str(info).count("  - "), info.count) == (20, 43)
    refuses("P008", "line 1", read_motions, write(tmp_path, "n.csv", "x,y\n1,2\n"))
    refuses("P002", "no moves", read_motions, write(tmp_path, "n.csv", "\n".join(rows[:-2])))


def test_conversion_takes_the_cutting_moves_and_their_starts(tmp_path: Path) -> None:
    text = (
        "FEDRAT/600,MMPM\nRAPID\nGOTO/0,0,5\nGOTO/0,0,0\nGOTO/1,0,0\nGOTO/1,0,0,0,1,0\nGOTO/2,0,0\nRAPID\nGOTO/2,0,5\n"
        "RAPID\nGOTO/5,0,5\nGOTO/5,0,0\nGOTO/6,0,0\n"
    )
    m = apt(tmp_path, text)
    runs = cutting_runs(m)
    assert [run.tolist() for run in runs] == [[0, 1, 2, 3, 4], [6, 7, 8]]
    first = to_tool_path(m, moves=runs[0])
    assert isinstance(first.path, ToolPath)
    np.testing.assert_allclose(first.path.points[:, 0] * 1e3, [0, 0, 1, 2])
    # The turn on the spot is in the axis of its point; the feed is that of the move that leads to it.
    np.testing.assert_allclose(first.path.axes, [[0, 0, 1], [0, 0, 1], [0, 1, 0], [0, 1, 0]])
    np.testing.assert_allclose(first.path.feed, [np.nan, 0.01, 0.01, 0.01])
    assert first.moves.tolist() == [0, 1, 3, 4]
    assert first.points.tolist() == [0, 1, 2, 2, 3, -1, -1, -1, -1]
    both = to_tool_path(m)
    # Only what mills: the plunge along z is left out; later the tool lies along y, so z is sideways.
    np.testing.assert_allclose(both.path.feed, [np.nan, 0.01, 0.01, np.nan, 0.01, 0.01])
    assert both.points.tolist() == [-1, 0, 1, 1, 2, -1, 3, 4, 5]
    assert both.free.tolist() == [False, False, True, False, False]
    np.testing.assert_allclose(to_tool_path(m, [0, 1, 1]).path.normals[0], [0, math.sqrt(0.5), math.sqrt(0.5)])
    # Moves that do not follow each other are joined by no feed.
    np.testing.assert_allclose(to_tool_path(m, moves=[1, 2, 4]).path.feed, [np.nan, 0.01, np.nan])
    per_move = np.tile([0.0, 0.0, 1.0], (m.n, 1))
    per_move[3] = [1, 0, 0]
    np.testing.assert_allclose(to_tool_path(m, per_move, moves=runs[0]).path.normals[2], [1, 0, 0])


def test_conversion_refuses(tmp_path: Path) -> None:
    m = apt(tmp_path, "RAPID\nGOTO/0,0,5\nRAPID\nGOTO/1,0,5\n")
    refuses("P002", "no move at feed", to_tool_path, m)
    for bad in ([], [[0]], [5], [-1], [1, 0]):
        refuses("P009", "moves", to_tool_path, m, moves=bad)


def test_motions_check_themselves(tmp_path: Path) -> None:
    m = apt(tmp_path, "GOTO/0,0,5\nGOTO/1,0,5\n")
    for bad in (
        {"points": np.zeros((3, 3))},
        {"points": np.array([[0, 0, 0], [0, np.nan, 0]])},
        {"axes": np.ones((2, 3))},
        {"feed": np.array([1.0, -1.0])},
        {"feed": np.array([1.0, np.inf])},
        {"dwell": np.array([0.0, -1.0])},
        {"tool": np.array([0, 1])},
        {"operation": np.array([0, -1])},
        {"rapid": np.zeros(3, dtype=bool)},
    ):
        refuses("B001", "motions", dataclasses.replace, m, **bad)


def test_repeated_points_far_and_near(tmp_path: Path) -> None:
    steps = np.cumsum([0, 4e-10, 4e-10, 4e-10, 2e-9, 4e-10, 1e-3])
    m = apt(tmp_path, "FEDRAT/1,MMPM\n" + "".join(f"GOTO/{x * 1e3!r},0,0\n" for x in steps.tolist()))
    found = to_tool_path(m)
    # Each point kept is at least a nanometre from the last one kept.
    assert (found.path.lengths >= 1e-9).all()
    assert found.path.n >= 3
    assert found.points[-1] == found.path.n - 1
