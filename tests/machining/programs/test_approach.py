"""Positioning moves from one side: where points are put in, that joints turn the right way, and limits."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from program_cases import PLAIN, busy, cell_of, program_of, rail
from refusals import refuses

from machining.programs.approach import Approach, approached, positioned
from machining.programs.formats import FORMATS, parse_options, round_trip, write_program
from machining.programs.program import JointProgram, frame_distance
from machining.toolpaths.events import ordered
from machining.toolpaths.motions import Event
from machining.verification.courses import courses_of

WAYS = np.array([1.0, -1.0, 1.0, 0.0, 0.0, -1.0])
SIDE = Approach(WAYS)
BOTH = [(name, kind) for name, one in FORMATS.items() for kind in one.kinds]


def program(rapid: str, still: tuple[int, ...] = (), **more: Any) -> JointProgram:
    """A program with a move for each letter, R for a rapid one; those ``still`` lead nowhere."""
    fast = np.array([letter == "R" for letter in rapid])
    n = len(rapid)
    given = program_of(n=n, rapid=fast, feed=np.where(fast, np.nan, 0.02), **more)
    row = np.arange(n)
    for i in still:
        row[i] = row[i - 1]
    motions = replace(given.motions, points=given.motions.points[row], axes=given.motions.axes[row])
    return replace(given, motions=motions, q=given.q[row], T_part_tool=given.T_part_tool[row])


def said(kind: str, move: int, value: float = np.nan, text: str = "") -> Event:
    return Event(1, move, "", text, kind, value)


@pytest.mark.parametrize(
    ("moves", "more", "wanted"),
    [
        ("RRFFRRRF", {}, [1, 6]),
        ("FFRR", {}, [0]),
        ("RRRR", {}, []),
        ("RRRR", {"events": (said("dwell", 2, 1.0), said("stop", 4))}, [1, 3]),
        ("RRRR", {"events": (said("stop", 0), said("optional stop", 1))}, [0]),
        ("RRRR", {"events": (said("probe", 2, 1.0), said("probe", 3, 0.0))}, [1]),
        ("RRRR", {"events": (said("coolant", 2, text="flood"), said("spindle", 3, 9.0))}, []),
        ("RRRR", {"dwell": np.array([0.0, 0.0, 2.0, 0.0])}, [2]),
        # Moves that lead nowhere: one target, and none behind a move at feed.
        ("RRRF", {"still": (2,)}, [1]),
        ("RFRF", {"still": (2,)}, [0]),
    ],
)
def test_where_something_begins_behind_a_positioning_move(moves: str, more: dict[str, Any], wanted: list[int]) -> None:
    assert_array_equal(positioned(program(moves, **more)), wanted)


def test_every_joint_turns_its_last_bit_the_way_that_was_asked() -> None:
    given = program("RRFFRRF")
    found = approached(given, SIDE, straight=True)
    out, moves = found.program, found.moves
    assert_array_equal(moves, [1, 6])
    assert found.targets == 2
    assert not found.left_out
    assert_allclose(out.q[moves + 1] - out.q[moves], [SIDE.angle * WAYS] * 2, rtol=0.0, atol=1e-12)
    kept = np.setdiff1d(np.arange(out.n), moves)
    assert_array_equal(out.q[kept], given.q)
    assert_array_equal(out.motions.points[kept], given.motions.points)
    assert_array_equal(out.motions.feed[kept], given.motions.feed)
    assert_array_equal(out.motions.rapid, [1, 1, 1, 0, 0, 1, 1, 1, 0])
    assert out.inserted[moves].all()
    away, turned = frame_distance(out.reached(), out.T_part_tool)
    # Round-off of two metres through six rotations.
    assert max(away.max(), turned.max()) < 1e-12
    targets = np.linalg.norm(out.motions.points[moves] - out.motions.points[moves + 1], axis=1)
    assert found.away == pytest.approx(targets.max())
    assert -found.away <= found.deeper <= found.away
    # On the straight way, too, which a Cartesian program takes.
    values, followed = courses_of(out, "linear").sampled(moves + 1)
    assert followed.all()
    signed = np.diff(values[:, :, :6], axis=1)[:, :, WAYS != 0.0] * WAYS[WAYS != 0.0]
    assert (signed > 0.0).all()


def test_what_is_said_before_a_move_is_said_before_it_is_approached() -> None:
    events = (Event(3, 1, "COOLNT", "flood", "coolant"), Event(4, 2, "PPRINT", "cut"), Event(9, 4, "END", ""))
    given = program("RRFF", events=events)
    out = approached(given, SIDE).program
    assert [(event.move, event.word) for event in ordered(out.motions)] == [(1, "COOLNT"), (3, "PPRINT"), (5, "END")]
    full = approached(busy(), SIDE).program
    before, after = ordered(busy().motions), ordered(full.motions)
    assert [e.kind for e in after] == [e.kind for e in before]
    assert full.motions.dwell.sum() == busy().motions.dwell.sum()


def test_the_first_point_is_positioned_and_axes_stand_where_the_target_has_them() -> None:
    given = program("FFF", cell=cell_of(linear_axes=(rail(),)), travel=np.array([[0.1], [0.1], [0.1]]))
    out = approached(given, SIDE).program
    assert_array_equal(out.motions.rapid, [True, True, False, False])
    assert np.isnan(out.motions.feed[:2]).all()
    assert_array_equal(out.travel, np.full((4, 1), 0.1))


def test_a_joint_without_room_keeps_its_angle_and_is_counted() -> None:
    given = program("RRF")
    limits = given.robot.limits.copy()
    limits[1, 1] = given.q[1, 1] + 0.1 * SIDE.angle
    tight = replace(given, robot=replace(given.robot, limits=limits))
    found = approached(tight, SIDE)
    assert found.left_out == {given.robot.joint_names[1]: 1}
    assert_allclose(found.program.q[2] - found.program.q[1], SIDE.angle * WAYS * (np.arange(6) != 1), atol=1e-12)
    alone = approached(tight, Approach(np.array([0.0, -1.0, 0.0, 0.0, 0.0, 0.0])))
    assert (len(alone.moves), alone.targets, alone.program.n) == (0, 1, given.n)


def test_a_joint_that_turns_back_on_the_straight_way_is_refused() -> None:
    given = program("RRF")
    q = given.q.copy()
    # The wrist is all but stretched: on a straight line joints 4 and 6 whirl.
    q[1, 4] = 1e-4
    near = replace(given, q=q)
    approached(near, Approach(np.ones(6)))
    refuses("Q009", "turns back", approached, near, Approach(np.ones(6)), straight=True)


@pytest.mark.parametrize(("name", "kind"), BOTH)
def test_programs_with_it_are_read_back(name: str, kind: Any) -> None:
    options = parse_options({"decimals": {"length": 6, "angle": 8}, "arm": PLAIN}, "options")
    out = approached(busy(), SIDE).program
    texts = write_program(out, name, kind, options).texts()
    assert round_trip(out, texts, name, kind, options).difference(1e-6) is None


@pytest.mark.parametrize(
    "asked",
    [
        lambda: Approach(np.zeros(6)),
        lambda: Approach(np.full(6, 0.5)),
        lambda: Approach(WAYS, 0.0),
        lambda: Approach(WAYS, 0.1),
        lambda: Approach(WAYS, np.nan),
        lambda: approached(program("RF"), Approach(np.ones(5))),
    ],
)
def test_ways_and_angles_that_cannot_be_are_refused(asked: Any) -> None:
    refuses("Q009", "", asked)
