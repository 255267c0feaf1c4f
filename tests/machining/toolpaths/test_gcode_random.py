"""Random programs read by the project and by a plain interpreter that shares no code with it."""

from __future__ import annotations

import math

import gcode_stray
import gcode_traps
import gcode_traps_siemens
import pytest
from gcode_random import RIGHT, WRONG, program, run
from gcode_traps import EITHER, READ, Trap
from gcode_traps_open import RANDOM
from moves_compared import Move, disagreement
from plain_gcode import moves

DIALECT = {"nc": "fanuc", "ngc": "linuxcnc", "mpf": "siemens"}


@pytest.mark.parametrize("dialect", DIALECT.values())
def test_no_random_program_is_read_wrong(dialect: str, request: pytest.FixtureRequest) -> None:
    if dialect in RANDOM:
        request.applymarker(pytest.mark.xfail(strict=True, reason="open"))
    outcomes, why = run(range(100), dialect)
    assert not outcomes[dialect, WRONG], why
    assert outcomes[dialect, RIGHT] > 10, why


@pytest.mark.parametrize("dialect", DIALECT.values())
def test_no_stray_word_is_dropped(dialect: str, request: pytest.FixtureRequest) -> None:
    if dialect in RANDOM:
        request.applymarker(pytest.mark.xfail(strict=True, reason="open"))
    outcomes, words = gcode_stray.run(range(60), dialect)
    assert not words
    assert outcomes["refused"] > 10


def test_programs_of_a_seed_are_the_same() -> None:
    assert program(7) == program(7)
    assert program(7) != program(8)


READABLE = [t for t in (*gcode_traps.TRAPS, *gcode_traps_siemens.TRAPS) if t.right in (READ, EITHER)]


@pytest.mark.parametrize(
    "trap", READABLE, ids=[f"{t.ending}: {t.name}".encode("unicode_escape").decode() for t in READABLE]
)
def test_the_plain_interpreter_knows_what_was_worked_out_by_hand(trap: Trap) -> None:
    try:
        found = moves(trap.program, DIALECT[trap.ending])
    except ValueError:
        # Not in its grammar.
        return
    points, rapid, feed = [m.end for m in found], [m.rapid for m in found], [m.feed for m in found]
    straight = [Move(m.end, m.rapid, m.feed) for m in trap.moves]
    assert disagreement(points, rapid, feed, straight) == ""
    arcs = [[m for m in some if m.centre is not None] for some in (found, trap.moves)]
    for a, b in zip(*arcs, strict=True):
        assert a.sense == b.sense
        assert math.dist((a.centre or a.end)[:2], (b.centre or b.end)[:2]) < 1e-6


def test_a_difference_is_seen() -> None:
    corner = [Move((0, 0, 0), True), Move((10, 0, 0), False, 600)]
    arc = [*corner, Move((10, 10, 0), False, 600, (10, 5, 0), 2, 1)]
    chords = [
        (10 + 5 * math.cos(a), 5 + 5 * math.sin(a), 0) for a in (math.pi * (k / 100 - 0.5) for k in range(1, 101))
    ]
    points, rapid, feed = [(0, 0, 0), (10, 0, 0), *chords], [True, *[False] * 101], [math.nan, *[600] * 101]
    assert disagreement(points, rapid, feed, arc) == ""
    assert "none" in disagreement(points[:2], rapid[:2], feed[:2], arc)
    assert "more" in disagreement(points, rapid, feed, corner)
    assert "feed" in disagreement(points, rapid, [math.nan, *[300] * 101], arc)
    assert "rapid" in disagreement(points, [True] * 102, feed, arc)
    assert "off its arc" in disagreement([*points[:2], (10, 10, 0)], rapid[:3], feed[:3], arc)
    assert "turns" in disagreement([*points[:2], *((20 - x, y, z) for x, y, z in chords)], rapid, feed, arc)
