"""Commands between moves: a missing spindle stop is found, and so is a cut that the spindle stands in."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from verification_cases import ARM, program, zigzag

from machining.programs.formats import NEUTRAL, write_program
from machining.programs.program import JointProgram
from machining.toolpaths.motions import Event, Tool
from machining.verification import Demands, Kind, Severity, verify

LOOSE = Demands(tolerance=1e-3, smoothing=0.5)
RPM = np.pi / 30.0


def milling() -> JointProgram:
    """Two tools; spindle and coolant are stopped between them, before the probe, and at the end."""
    given = program(zigzag(4, 10), np.arange(40) % 20 == 0)
    turns = np.where(np.arange(40) < 20, 3000.0, 2000.0) * RPM
    turns[18:20] = 0.0
    tool = (np.arange(40) >= 20).astype(np.int64)
    rapid = given.motions.rapid | (turns == 0.0)
    events = (
        Event(1, 0, "LOADTL", "1", "tool", 0.0),
        Event(2, 0, "SPINDL", "CLW", "spindle", 3000.0 * RPM),
        Event(3, 0, "COOLNT", "flood", "coolant"),
        Event(29, 18, "COOLNT", "off", "coolant"),
        Event(30, 18, "SPINDL", "OFF", "spindle", 0.0),
        Event(31, 20, "LOADTL", "2", "tool", 1.0),
        Event(32, 20, "SPINDL", "CLW", "spindle", 2000.0 * RPM),
        Event(60, 40, "SPINDL", "OFF", "spindle", 0.0),
    )
    feed = np.where(rapid, np.nan, 0.05)
    motions = replace(
        given.motions, spindle=turns, tool=tool, tools=(Tool(1), Tool(2)), events=events, rapid=rapid, feed=feed
    )
    return replace(given, motions=motions)


def without(given: JointProgram, line: int) -> JointProgram:
    """The program as JSON with the events of a source line taken out, read again."""
    data = json.loads(write_program(given, "json").files[0].text())
    kept = [event for event in data["events"] if event["line"] != line]
    assert len(kept) < len(data["events"])
    return NEUTRAL[".json"].program(json.dumps(data | {"events": kept}), given.robot, given.cell)


def commands(given: JointProgram) -> list[tuple[int, Severity, str]]:
    found = verify(given, ARM, LOOSE)
    return [(o.move, o.severity, o.text) for o in found.offences if o.kind is Kind.COMMAND]


def test_a_program_with_all_its_commands_is_clean() -> None:
    assert commands(milling()) == []


@pytest.mark.parametrize(
    ("line", "move", "says"),
    [
        (30, 18, "spindle stop: the moves say it"),
        (60, 39, "turns at the end"),
        (32, 20, "spindle at 2000 rpm: the moves say it"),
        (31, 20, "change to tool 2: the moves say it"),
    ],
)
def test_a_planted_missing_command_is_found(line: int, move: int, says: str) -> None:
    found = commands(without(milling(), line))
    assert any(at == move and severity is Severity.ERROR and says in text for at, severity, text in found), found


def test_a_missing_coolant_stop_at_the_end_is_a_warning() -> None:
    ((move, severity, text),) = commands(without(milling(), 29))
    assert (move, severity) == (39, Severity.WARNING)
    assert "coolant" in text


def test_a_cut_with_the_spindle_at_rest_and_a_tool_changed_in_a_turning_one() -> None:
    given = milling()
    stopped = replace(
        given.motions,
        spindle=np.where(np.arange(40) < 30, given.motions.spindle, 0.0),
        events=(*given.motions.events[:-1], Event(50, 30, "SPINDL", "OFF", "spindle", 0.0)),
    )
    found = verify(replace(given, motions=stopped), ARM, LOOSE)
    (offence,) = [o for o in found.offences if o.kind is Kind.COMMAND]
    assert (offence.move, offence.moves) == (30, 10)
    turning = replace(
        given.motions,
        spindle=np.where(given.motions.spindle == 0.0, 3000.0 * RPM, given.motions.spindle),
        events=tuple(e for e in given.motions.events if e.line != 30),
    )
    assert [
        (move, "while the spindle turns" in text) for move, _, text in commands(replace(given, motions=turning))
    ] == [(20, True)]


def test_a_program_without_commands_says_that_they_were_not_looked_at() -> None:
    found = verify(program(zigzag(2, 5)), ARM, LOOSE)
    assert found.not_looked_at[0].startswith("Commands to spindle")
