"""The line protocol: ids and order, faults that leave the session alive, what is set and what is not."""

from __future__ import annotations

import io
import json
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from refusals import refuses
from rigid_frames import rigid_frame
from service_cases import POSE, ask, on_rail, plain, raw, refused, with_bodies

import fem
from machining.cell import Cell, Turntable
from machining.service import PROTOCOL, Session, serve
from machining.service.session import COMMANDS
from machining.service.wire import read_line


@pytest.fixture
def session(kr60: fem.ArmModel) -> Session:
    return plain(kr60)


def run(session: Session, text: bytes, longest: int = 1 << 20) -> list[Any]:
    """What a process would answer to a whole input."""
    out: list[bytes] = []
    serve(session, io.BytesIO(text), out.append, longest)
    for line in out:
        assert line.endswith(b"\n")
        assert line.count(b"\n") == 1
    return [json.loads(line) for line in out]


def test_hello_says_what_there_is(kr60: fem.ArmModel) -> None:
    answer = ask(with_bodies(kr60), "hello")
    assert answer["protocol"] == PROTOCOL
    assert answer["robot"] == "kr60-3"
    assert [j["coordinate"] for j in answer["joints"]] == list(kr60.robot.coordinates)
    assert answer["joints"][1]["lower_deg"] == pytest.approx(-135.0)
    assert answer["linear_axes"] == [{"name": "rail", "lower_mm": -1500.0, "upper_mm": 1500.0}]
    assert answer["collisions"]
    assert answer["commands"] == list(COMMANDS)
    assert answer["quantities"]["k_fs"] == "k_fs_N_per_mm"
    assert answer["turntable"] is None


@pytest.mark.slow
def test_ten_thousand_requests_keep_their_order(session: Session) -> None:
    requests = [{"id": i, "do": "ping"} if i % 3 else {"id": i, "do": "no such"} for i in range(10_000)]
    answers = run(session, "\n".join(map(json.dumps, requests)).encode())
    assert [a["id"] for a in answers] == list(range(10_000))
    assert [a["ok"] for a in answers] == [bool(i % 3) for i in range(10_000)]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (b"", "empty"),
        (b"  \t", "empty"),
        (b"{", "Expecting"),
        (b"[]", "a JSON list"),
        (b"17", "a JSON int"),
        (b"null", "a JSON NoneType"),
        (b'"ping"', "a JSON str"),
        (b'{"do": "ping"} {"do": "ping"}', "Extra data"),
        (b'{"do": "ping", "do": "ping"}', "stands twice"),
        (b'{"do": "fk", "q_deg": [NaN, 0, 0, 0, 0, 0]}', "NaN"),
        (b'{"do": "fk", "q_deg": [Infinity, 0, 0, 0, 0, 0]}', "Infinity"),
        (b'{"do": "fk", "q_deg": [1e999, 0, 0, 0, 0, 0]}', "beyond the largest number"),
        (b'{"do": "fk", "q_deg": [' + b"9" * 400 + b", 0, 0, 0, 0, 0]}", "beyond 64 bits"),
        (b'{"do": "fk", "q_deg": [' + b"9" * 9000 + b", 0, 0, 0, 0, 0]}", "beyond 64 bits"),
        (b'{"do": "fk", "q_deg": [true, 0, 0, 0, 0, 0]}', "6 numbers"),
        (b'{"do": "fk", "q_deg": ["1", 0, 0, 0, 0, 0]}', "6 numbers"),
        (b'{"do": "fk", "q_deg": [0, 0, 0, 0, 0]}', "6 numbers"),
        (b'{"do": "fk", "q_deg": {}}', "6 numbers"),
        (b'{"do": "fk"}', "q_deg"),
        (b'{"do": "fk", "q_deg": [0, 0, 0, 0, 0, 0], "q": 1}', "unknown key"),
        (b'{"do": "ik", "point_mm": [0, 0, 0]}', "tool_axis is missing"),
        (b'{"do": "ik", "point_mm": [0, 0, 0], "tool_axis": [0, 0, 0]}', "not all zero"),
        (b'{"do": "ik", "point_mm": [0, 0, 0], "tool_axis": [1, 0, 0]}', "reference"),
        (b'{"do": "ik", "frame_mm_deg": [0, 0, 0, 0, 0, 0], "gamma_deg": 1}', "together with point_mm"),
        (b'{"do": "ik", "matrix_mm": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1]]}', "rigid"),
        (b'{"do": "ik", "matrix_mm": [1, 0, 0, 0]}', "four rows"),
        (b'{"do": "ik"}', "where the tool shall be"),
        (b'{"do": "ping", "id": [1]}', "id"),
        (b'{"do": "ping", "id": true}', "id"),
        (b'{"do": "ping", "id": "' + b"x" * 300 + b'"}', "id"),
        (b'{"do": 1}', "do"),
        (b'{"do": ["ping"]}', "do"),
        (b'{"do": "PING"}', "hello, ping"),
        (b"{}", "do"),
        (b'{"do": "batch"}', "requests"),
        (b'{"do": "batch", "requests": [1]}', "requests, number 0"),
        (b'{"do": "set", "travel_mm": [1]}', "travel_mm"),
        (b'{"do": "set", "table_deg": 3}', "no turntable"),
        (b'{"do": "set", "force_N": [[1, 0, 0], [1, 0, 0]]}', "three numbers"),
        (b'{"do": "clearance", "q_deg": [0, -90, 0, 0, 0, 0]}', "--cell"),
        (b'\xff{"do": "ping"}', "UTF-8"),
        (b'{"do": "' + b"\xed\xa0\x80" + b'"}', "UTF-8"),
        (b"[" * 100_000, "nested more than 64 deep"),
        (b'{"a":' * 100_000, "nested more than 64 deep"),
    ],
)
def test_faults_are_answered_and_the_session_lives(session: Session, line: bytes, words: str) -> None:
    wrong, after = run(session, line + b'\n{"id": 2, "do": "ping"}\n')
    assert not wrong["ok"]
    assert words in json.dumps(wrong["error"]), wrong
    assert set(wrong["error"]) >= {"what", "value", "allowed", "remedy", "code"}
    assert len(json.dumps(wrong)) < 4000
    assert after == {"id": 2, "ok": True}


def test_lines_of_all_kinds(session: Session) -> None:
    """Windows line ends, a byte order mark, no end of the last line; ids of all kinds."""
    first = b'\xef\xbb\xbf{"id": "a\\ud800", "do": "ping"}\r\n{"id": 1.5, "do": "ping"}\r\n'
    text = first + b'{"do": "ping"}\n{"id": -3, "do": "ping"}'
    assert [a["id"] for a in run(session, text)] == ["a\ud800", 1.5, None, -3]
    assert run(session, b"") == []


def test_a_line_too_long_is_passed_over(session: Session) -> None:
    long = b'{"id": 1, "do": "ping", "x": "' + b"y" * 5000 + b'"}\n'
    text = long + b'{"id": 2, "do": "ping"}\n' + long[:-1]
    first, second, third = run(session, text, longest=1000)
    assert "too long" in first["error"]["value"]
    assert second["id"] == 2
    assert "too long" in third["error"]["value"]
    exact = b'{"id": 3, "do": "ping"}\n'
    assert run(session, exact, longest=len(exact) - 1)[0]["ok"]


def test_quit_ends_and_is_answered(session: Session) -> None:
    answers = run(session, b'{"id": 1, "do": "quit"}\n{"id": 2, "do": "ping"}\n')
    assert answers == [{"id": 1, "ok": True}]


def test_a_batch_is_its_requests(session: Session) -> None:
    requests: list[Any] = [
        {"id": "a", "do": "fk", "q_deg": POSE},
        {"id": "b", "do": "set", "tool_mm_deg": [0, 0, 100, 0, 0, 0]},
        {"id": "c", "do": "fk", "q_deg": POSE},
        {"id": "d", "do": "quit"},
        {"id": "e", "do": "batch", "requests": []},
    ]
    a, b, c, d, e = ask(session, "batch", requests=requests)["answers"]
    assert [x["id"] for x in (a, b, c, d, e)] == list("abcde")
    assert [x["ok"] for x in (a, b, c, d, e)] == [True, True, True, False, False]
    assert c == raw(session, {"id": "c", "do": "fk", "q_deg": POSE})
    assert a["point_mm"] != c["point_mm"]
    assert not session.stopped


def test_what_is_set_stays_and_what_a_request_brings_does_not(kr60: fem.ArmModel) -> None:
    session = on_rail(kr60)
    start = ask(session, "set")
    changed = ask(
        session,
        "set",
        tool_mm_deg=[10, 0, 300, 0, 45, 0],
        part_mm_deg=[1300, 0, 500, 0, 0, 90],
        travel_mm=[100],
        reference=[0, 2, 0],
        force_N=[0, 0, -50],
        direction=[0, 0, 1],
        relative_to="base",
    )
    assert changed["tool_mm_deg"] == pytest.approx([10, 0, 300, 0, 45, 0])
    assert changed["part_mm_deg"] == pytest.approx([1300, 0, 500, 0, 0, 90])
    assert changed["travel_mm"] == [100.0]
    assert changed["reference"] == [0.0, 1.0, 0.0]
    assert changed["relative_to"] == "base"
    kept = ask(session, "fk", q_deg=POSE)
    assert ask(session, "fk", q_deg=POSE, tool_mm_deg=[0, 0, 0, 0, 0, 0])["point_mm"] != kept["point_mm"]
    assert ask(session, "fk", q_deg=POSE) == kept
    # The part moves against the base when the base moves; a failed set changes nothing.
    part = ask(session, "fk", q_deg=POSE, relative_to="part")["point_mm"]
    moved = ask(session, "fk", q_deg=POSE, relative_to="part", travel_mm=[0])["point_mm"]
    assert np.linalg.norm(np.subtract(part, moved)) == pytest.approx(100.0, abs=1e-6)
    refused(session, "set", tool_mm_deg=[0, 0, 0, 0, 0, 0], travel_mm=[1e6])
    refused(session, "set", tool_mm_deg=[0, 0, 0, 0, 0, 0], nonsense=1)
    assert ask(session, "set") == changed | {"id": "x"}
    assert ask(session, "deflection", q_deg=POSE)["along_direction_mm"] < 0.0
    assert ask(session, "set", reset=True) == start


def test_the_tool_of_a_cell_with_its_surface_stays(kr60: fem.ArmModel) -> None:
    session = with_bodies(kr60)
    assert "surface" in refused(session, "set", tool_mm_deg=[0, 0, 0, 0, 0, 0])["allowed"]
    assert ask(session, "set", part_mm_deg=[1000, 0, 600, 0, 0, 0])["part_mm_deg"][0] == pytest.approx(1000.0)


def test_the_turntable_turns_the_part(kr60: fem.ArmModel) -> None:
    T = rigid_frame((1.2, 0.0, 0.5))
    table = Turntable(np.array([1.2, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]), np.radians([-90.0, 90.0]))
    session = Session(kr60, Cell(T_world_part0=T, turntable=table))
    at_rest = np.array(ask(session, "fk", q_deg=POSE)["point_mm"])
    turned = ask(session, "fk", q_deg=POSE, table_deg=90)["point_mm"]
    assert turned == pytest.approx([at_rest[1], -at_rest[0], at_rest[2]], abs=1e-6)
    assert "-90 to 90" in refused(session, "fk", q_deg=POSE, table_deg=91)["allowed"]
    assert ask(session, "hello")["turntable"] == {"lower_deg": -90.0, "upper_deg": 90.0}


AT = {"point_mm": [0, 0, 0], "tool_axis": [0.1, 0.2, 1]}
SWEEP = {"gamma_from_deg": -80, "gamma_to_deg": -40, "gamma_step_deg": 20}
FINE: dict[str, dict[str, Any]] = {
    "hello": {},
    "ping": {},
    "quit": {},
    "set": {"tool_mm_deg": [1, 2, 3, 4, 5, 6], "reset": True},
    "fk": {"q_deg": POSE},
    "ik": {"gamma_deg": -60, "which": "stiffest", "near_deg": POSE, **AT},
    "stiffness": {"q_deg": [POSE, POSE], "direction": [0, 0, 1], "indices": "all"},
    "deflection": {"gamma_deg": -60, "force_N": [1, 2, 3], **AT},
    "clearance": {"q_deg": POSE},
    "best_angle": {"quantity": "k_fs", **SWEEP, **AT},
    "best_path": {"points_mm": [[0, 0, 0], [5, 0, 0]], "tool_axis": [0.1, 0.2, 1], **SWEEP},
    "best_base": {"range_mm": {"rail": [-50, 50]}, **SWEEP, **AT},
    "batch": {"requests": [{"do": "ping"}]},
}
KEYS = sorted({key for request in FINE.values() for key in request} | {"jump_deg", "travel_mm", "reference", "id", "x"})
NUMBERS = st.one_of(st.integers(-400, 400), st.floats(), st.integers(), st.none(), st.booleans(), st.text(max_size=3))
VALUES = st.one_of(
    NUMBERS,
    st.lists(st.floats(-200, 200), min_size=6, max_size=6),
    st.lists(st.integers(-1, 1), min_size=3, max_size=3),
    st.lists(st.lists(st.floats(-900, 900), min_size=3, max_size=3), max_size=4),
    st.lists(NUMBERS, max_size=7),
    st.dictionaries(st.text(max_size=3), NUMBERS, max_size=2),
    st.sampled_from(["part", "base", "all", "nspi", "displacement", "worst"]),
)


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(do=st.sampled_from(list(FINE)), changed=st.dictionaries(st.sampled_from(KEYS), VALUES, max_size=2))
def test_no_request_breaks_the_session(kr60: fem.ArmModel, do: str, changed: dict[str, Any]) -> None:
    """Requests that are fine but for a key or two."""
    _unbroken(on_rail(kr60), {"do": do} | FINE[do] | changed)


@pytest.mark.slow
@settings(max_examples=2000, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(do=st.sampled_from(list(FINE)), changed=st.dictionaries(st.sampled_from(KEYS), VALUES, max_size=4))
def test_no_request_breaks_the_session_of_many(kr60: fem.ArmModel, do: str, changed: dict[str, Any]) -> None:
    _unbroken(on_rail(kr60), {"do": do} | FINE[do] | changed)


@pytest.mark.parametrize("do", [do for do in FINE if do != "clearance"])
def test_the_requests_are_fine_before_they_are_changed(kr60: fem.ArmModel, do: str) -> None:
    ask(on_rail(kr60), do, **FINE[do])


def _unbroken(session: Session, request: dict[str, Any]) -> None:
    answers = run(session, json.dumps(request).encode() + b"\n")
    assert len(answers) == 1
    assert answers[0]["ok"] or "internal error" not in answers[0]["error"]["what"], answers
    session.stopped = False
    assert run(session, b'{"do": "ping"}') == [{"id": None, "ok": True}]


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(text=st.one_of(st.binary(max_size=200), st.text(max_size=100).map(lambda t: t.encode("utf-8", "replace"))))
def test_no_bytes_break_the_session(session: Session, text: bytes) -> None:
    lines = text.split(b"\n")
    wanted = len(lines) if lines[-1] else len(lines) - 1
    answers = run(session, text)
    assert len(answers) == wanted
    assert run(session, b'{"do": "ping"}') == [{"id": None, "ok": True}]


def test_numbers_of_thousands_of_digits_are_refused_in_our_words() -> None:
    refuses("V001", "a whole number beyond 64 bits", read_line, b'{"id": ' + b"9" * 5000 + b', "do": "ping"}')
