"""Every word counts: a word in the middle of a contour is read right or its block is refused by line."""

from __future__ import annotations

import math
from pathlib import Path

import gcode_stray
import gcode_traps
import gcode_traps_siemens
import klartext_traps
import numpy as np
import pytest
from gcode_random import RIGHT, WRONG, program, run
from gcode_traps import EITHER, READ, REFUSED, RETRACT, Trap
from gcode_traps_open import OPEN, RANDOM
from moves_compared import Move, disagreement
from plain_gcode import moves
from refusals import refuses

from machining.toolpaths import Motions, ReadOptions, read_toolpath
from robots import InputError

TRAPS = [*gcode_traps.TRAPS, *gcode_traps_siemens.TRAPS, *klartext_traps.TRAPS]


def judged(trap: Trap, folder: Path) -> str:
    """What is wrong with how a trap is read; "" for nothing."""
    file = folder / f"trap.{trap.ending}"
    file.write_bytes(trap.program.encode("latin-1"))
    try:
        m = read_toolpath(file, kind="heidenhain" if trap.ending == "h" else "gcode", options=ReadOptions())
    except InputError as error:
        if trap.right == READ:
            return f"refused: {' '.join(str(error).split())[:150]}"
        return "" if ", line " in str(error) else f"refused without its line: {error}"
    points = 1e3 * m.points
    if trap.right == REFUSED:
        return "read: " + " ".join(",".join(f"{v:g}" for v in p) for p in points[:8])
    if trap.right == RETRACT:
        return _retract(m)
    return disagreement(points, m.rapid, m.feed * 60e3, trap.moves)


def _retract(m: Motions) -> str:
    """No rapid crosses below the height of the first approach; the tool comes down where it is told to."""
    points = 1e3 * m.points
    across = np.hypot(*np.diff(points[:, :2], axis=0).T)
    lower = np.minimum(points[1:, 2], points[:-1, 2])
    low = m.rapid[1:] & (across > 1e-6) & (lower < 5 - 1e-6)
    if low.any():
        return f"a rapid crosses at Z{lower[low][0]:g}"
    return "" if math.dist(points[-1], (50, 50, 0)) < 1e-6 else f"ends at {points[-1]}"


def _named(trap: Trap) -> str:
    return f"{trap.ending}: {trap.name}"


@pytest.mark.parametrize("trap", TRAPS, ids=[_named(one).encode("unicode_escape").decode() for one in TRAPS])
def test_no_word_is_dropped(trap: Trap, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    if _named(trap) in OPEN:
        request.applymarker(pytest.mark.xfail(strict=True, reason="open"))
    assert judged(trap, tmp_path) == ""


def test_there_are_enough_traps_and_each_is_one() -> None:
    assert len(TRAPS) >= 100
    assert len({_named(one) for one in TRAPS}) == len(TRAPS)
    assert {_named(one) for one in TRAPS} >= OPEN
    # A square without any word is read as it stands.
    for ending in ("nc", "ngc", "mpf"):
        plain = Trap("plain", ending, gcode_traps.block("M8", ending), READ, gcode_traps.SQUARE)
        assert plain.moves[-1].rapid


def test_words_are_left_out_only_where_they_mean_nothing(tmp_path: Path) -> None:
    file = tmp_path / "program.nc"
    text = gcode_traps.body("G1 X20 I5 M136\nG3 I-5 J0\nG1 Y20\nG0 Z5")
    file.write_text(text)
    m = read_toolpath(file, kind="gcode", options=ReadOptions(ignore=("I", "M136")))
    file.write_text(text.replace("X20 I5 M136", "X20"))
    np.testing.assert_array_equal(m.points, read_toolpath(file, kind="gcode").points)
    assert {note.text.split()[0] for note in m.notes if "as asked" in note.text} == {"I", "M136"}


@pytest.mark.parametrize(
    "word", ["G1", "G91", "G52", "G41", "G51", "M98", "M30", "M3", "TRANS", "CYCLE81", "CIP", "TOROT"]
)
def test_words_that_move_are_never_left_out(word: str, tmp_path: Path) -> None:
    file = tmp_path / "program.nc"
    file.write_text(gcode_traps.block("M8"))
    refuses("P020", "option ignore", read_toolpath, file, kind="gcode", options=ReadOptions(ignore=(word,)))


# ------------------------------------------------------------
# Random programs read by the project and by a plain interpreter that shares no code with it

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
