"""Controllers' own programs replayed: what is planted in their files is found; home, leads, run-up and names."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from posture_cases import part, spindle
from program_cases import PLAIN, busy, cell_of, motions_of, posed, program_of, rail
from refusals import refuses
from rigid_frames import rigid_frame

from machining.cell import Cell, Fixture, Tool, arm_bodies
from machining.cell.cell import Load
from machining.cell.schema import CommandsTable, MovesTable
from machining.cell.solids import Body, box
from machining.programs.approach import Approach, approached, positioned, with_home, with_leads
from machining.programs.formats import FORMATS, parse_options, read_program, round_trip, write_program
from machining.programs.program import JointProgram, frame_distance
from machining.programs.write_options import WriteOptions
from machining.toolpaths.events import ordered
from machining.toolpaths.motions import Event
from machining.verification import Demands, Verification, verify
from machining.verification.courses import courses_of
from machining.verification.offences import Kind
from robots import load_description, load_robot

MAIN = {
    "krl": "part.src",
    "rapid": "part.mod",
    "fanuc": "PART.LS",
    "sinumerik": "PART.MPF",
    "val3": "start.pgx",
    "urscript": "part.script",
}
KINDS = [(name, kind) for name in MAIN for kind in FORMATS[name].kinds]
NUMBERED = {"spindle_clockwise": 5, "spindle_speed": 1, "spindle_full_rpm": 24000.0, "coolant_flood": 6}
NAMED = {"spindle_clockwise": "doCw", "spindle_speed": "aoSpeed", "spindle_full_rpm": 24000.0, "coolant_flood": "doAir"}
RPM = 12000.0 * 2.0 * np.pi / 60.0


def options(**more: Any) -> WriteOptions:
    return WriteOptions.model_validate({"arm": PLAIN, **more})


def commands(name: str, **more: Any) -> CommandsTable:
    named = name in ("rapid", "val3")
    ready = {"spindle_ready": "diReady" if named else 7}
    return CommandsTable.model_validate({**(NAMED if named else NUMBERED), **(more or ready)})


def turning(cell: Cell, n: int = 8) -> JointProgram:
    """A path that starts the spindle and coolant before its first cut, and stops them at the end."""
    events = (
        Event(10, 1, "S", "", "spindle", RPM),
        Event(10, 1, "M8", "flood", "coolant"),
        Event(99, n, "M5", "", "spindle", 0.0),
        Event(99, n, "M9", "off", "coolant"),
    )
    return program_of(n=n, cell=cell, events=events, spindle=np.where(np.arange(n) < 1, 0.0, RPM))


def written(folder: Path, program: JointProgram, name: str, kind: Any, **more: Any) -> tuple[Path, dict[str, str]]:
    texts = write_program(program, name, kind, options(**more)).texts()
    assert round_trip(program, texts, name, kind, options(**more)).within()
    folder.mkdir(parents=True)
    for file, text in texts.items():
        (folder / file).write_text(text, encoding="utf-8")
    return folder / MAIN[name], texts


def checked(path: Path, program: JointProgram, against: Path | None = None) -> Verification:
    bodies = arm_bodies(load_description("kr60-3"))
    found = read_program(path, program.robot, program.cell, options(), against)
    return verify(found, bodies, Demands(tolerance=1.0, singular_least=0.0))


def told(path: Path, program: JointProgram, against: Path | None = None) -> list[str]:
    """What is said of commands."""
    return [o.text for o in checked(path, program, against).errors if o.kind is Kind.COMMAND]


def neutral(folder: Path, program: JointProgram) -> Path:
    path = folder / "part.json"
    path.write_text(write_program(program, "json").texts()["part.json"], encoding="utf-8")
    return path


def edited(path: Path, number: re.Pattern[str], by: float) -> None:
    """Change a number in the middle of the file of moves."""
    file = max(path.parent.iterdir(), key=lambda one: len(number.findall(one.read_text("utf-8"))))
    text = file.read_text(encoding="utf-8")
    places = list(number.finditer(text))
    at = places[len(places) // 2]
    changed = f"{float(at[1]) + by:.6f}"
    file.write_text(text[: at.start(1)] + changed + text[at.end(1) :], encoding="utf-8")


FIRST_NUMBER = {
    ("krl", "cartesian"): r"LIN \{X (-?[\d.]+)",
    ("krl", "joint"): r"PTP \{A1 (-?[\d.]+)",
    ("rapid", "cartesian"): r"MoveL \[\[(-?[\d.]+)",
    ("rapid", "joint"): r"MoveAbsJ \[\[(-?[\d.]+)",
    ("fanuc", "cartesian"): r"\tX = (-?[\d.]+) mm",
    ("fanuc", "joint"): r"\tJ1 = (-?[\d.]+) deg",
    ("sinumerik", "joint"): r"G1 A1=(-?[\d.]+)",
    ("val3", "cartesian"): r'" x="(-?[\d.]+)" y="-?[\d.]+" z="[^"]*" rx',
    ("val3", "joint"): r' j1="(-?[\d.]+)"',
    ("urscript", "joint"): r"movej\(\[(-?[\d.]+)",
}


@pytest.mark.parametrize(("name", "kind"), KINDS)
def test_a_program_is_replayed_as_it_was_written_and_an_edited_number_is_found(
    tmp_path: Path, name: str, kind: str
) -> None:
    program = turning(cell_of(commands=commands(name)))
    path, _ = written(tmp_path / f"{name}_{kind}", program, name, kind)
    twin = neutral(tmp_path, program)
    back = read_program(path, program.robot, program.cell, options())
    np.testing.assert_allclose(back.q, program.q, atol=2e-8)
    np.testing.assert_allclose(back.T_part_tool, program.T_part_tool, atol=2e-8)
    assert back.motions.rapid.tolist() == program.motions.rapid.tolist()
    assert back.faults == ()
    known = np.isfinite(program.motions.feed)
    # A time of seven digits, and decimals of points 30 mm apart.
    np.testing.assert_allclose(back.motions.feed[known], program.motions.feed[known], rtol=2e-4)
    turns = [(e.move, e.kind) for e in back.motions.events]
    assert turns == [(1, "spindle"), (1, "coolant"), (8, "spindle"), (8, "coolant")]
    assert read_program(path, program.robot, program.cell, options(), twin).faults == ()
    # A tenth of a degree or of a millimetre, radians in URScript.
    by = 2e-3 if name == "urscript" else 0.1
    edited(path, re.compile(FIRST_NUMBER[name, kind]), by)
    found = checked(path, program, twin)
    assert not found.clean
    assert Kind.OTHER_POINT in {o.kind for o in found.errors}
    faults = read_program(path, program.robot, program.cell, options(), twin).faults
    assert len(faults) == 1
    assert faults[0].place
    assert 2 < faults[0].move < 7


@pytest.mark.parametrize("name", MAIN)
@pytest.mark.parametrize("how", ["input", "dwell"])
def test_a_start_of_the_spindle_that_nothing_waits_for_is_found(tmp_path: Path, name: str, how: str) -> None:
    table = commands(name) if how == "input" else commands(name, spindle_dwell_s=2.5)
    program, kind = turning(cell_of(commands=table)), FORMATS[name].kinds[-1]
    path, texts = written(tmp_path / name, program, name, kind)
    waits = (
        {
            "krl": "WAIT FOR $IN[7]",
            "rapid": "WaitDI diReady,1;",
            "fanuc": "WAIT DI[7]=ON",
            "val3": "wait(diReady==true)",
            "sinumerik": "WHILE NOT $A_IN[7]\nENDWHILE",
            "urscript": "while not get_standard_digital_in(7):\n    sync()\n  end",
        }
        if how == "input"
        else {
            "krl": "WAIT SEC 2.500",
            "rapid": "WaitTime 2.500;",
            "fanuc": "WAIT 2.500(sec)",
            "val3": "delay(2.500)",
            "sinumerik": "G4 F2.500",
            "urscript": "sleep(2.500)",
        }
    )
    whole = "".join(texts.values())
    assert whole.count(waits[name]) == 1
    assert told(path, program) == []
    for file in path.parent.iterdir():
        lines = file.read_text(encoding="utf-8").replace(waits[name], "")
        file.write_text(re.sub(r"^ *\d+:   ;$", "", lines, flags=re.MULTILINE), encoding="utf-8")
    assert told(path, program) == ["a cut begins and nothing waits for the spindle's speed"]
    assert any("differs from the neutral program" in text for text in told(path, program, neutral(tmp_path, program)))


@pytest.mark.parametrize("name", ["krl", "rapid", "fanuc"])
def test_an_elbow_under_the_table_is_found(tmp_path: Path, name: str) -> None:
    """The upper arm 20 deg down, the forearm 40 deg up again through a plate; files that say nothing else wrong."""
    robot = load_robot("kr60-3")
    q = np.radians([0.0, 20.0, -150.0, 0.0, 60.0, 0.0]) + np.linspace(0.0, 0.02, 6)[:, None]
    table = Fixture(Body("table", (box(np.array([0.8, 1.2, 0.04])).moved(_at(1.4, 0.0, 0.72)),)))
    planted = posed(robot, q, replace(cell_of(), fixtures=(table,)))
    for kind in FORMATS[name].kinds:
        path, _ = written(tmp_path / f"{name}_{kind}", planted, name, kind)
        offences = [o for o in checked(path, planted).errors if o.kind is Kind.COLLISION]
        assert any("table" in (o.bodies or ()) for o in offences), kind


def _at(x: float, y: float, z: float) -> np.ndarray:
    return rigid_frame((x, y, z))


def test_programs_go_home_and_operations_are_led_in_and_out() -> None:
    home = np.radians([0.0, -90.0, 0.0, 0.0, 30.0, 0.0])
    cell = replace(cell_of(), home=home, moves=MovesTable(home=True, approach_mm=20.0, retract_mm=35.0))
    n = 6
    points, axes = np.zeros((n, 3)), np.tile([0.0, 0.0, 1.0], (n, 1))
    points[:, 0] = np.arange(n) * 0.01
    operation = np.array([0, 0, 0, 1, 1, 1])
    motions = motions_of(
        points,
        axes,
        operation=operation,
        operations=("a", "b"),
        events=(Event(13, 3, "M5", "", "spindle", 0.0), Event(99, n, "END", "")),
    )
    led, row, added = with_leads(motions, cell.moves)
    assert row.tolist() == [0, 0, 1, 2, 2, 3, 3, 4, 5, 5]
    assert np.flatnonzero(added).tolist() == [0, 4, 5, 9]
    np.testing.assert_allclose(led.points[[0, 4, 5, 9], 2], [0.02, 0.035, 0.02, 0.035])
    assert led.rapid[[0, 4, 5, 9]].all()
    # The stop between the operations is behind the retract of the first, before the approach of the second.
    assert [event.move for event in led.events] == [5, 10]
    program = with_home(program_of(n=5, cell=cell))
    assert program.n == 7
    np.testing.assert_allclose(program.q[[0, -1]], [home, home])
    assert program.loose.tolist() == [True, True, False, False, False, False, True]
    for name in ("krl", "rapid", "fanuc", "val3"):
        texts = write_program(program, name, "cartesian", options()).texts()
        assert round_trip(program, texts, name, "cartesian", options()).within()
    said = " ".join(write_program(program, "krl", "cartesian", options()).texts().values())
    assert said.count("\nPTP {") == 3
    bodies = arm_bodies(load_description("kr60-3"))
    not_said = verify(program, bodies, Demands()).not_looked_at
    assert not any("home in [moves]" in text for text in not_said)
    assert any("home in [moves]" in text for text in verify(program_of(n=5), bodies, Demands()).not_looked_at)


def test_names_are_the_files_made_legal() -> None:
    plain = WriteOptions()
    assert plain.named("bracket.mpf", "", ()).name == "bracket"
    assert plain.named("bracket.mpf", "_c", ()).name == "bracket_c"
    assert plain.named("4711-a b.nc", "", ()).name == "P4711_a_b"
    assert plain.named("Büchse.nc", "", ()).name == "Buchse"
    assert plain.named("main.nc", "", {"main"}).name == "main_p"
    assert plain.named("tCutter.nc", "", ()).name == "tCutter_p"
    long = [plain.named(f"a_long_name_of_a_part_{side}.nc", "_c", ()).name for side in ("left", "right")]
    assert len(set(long)) == 2
    assert all(len(name) == 16 and name.endswith("_c") for name in long)
    assert WriteOptions(name="mine").named("bracket.mpf", "_c", ()).name == "mine"
    for source in ("", "...", "日本", "_", "x" * 300):
        name = plain.named(source, "_c", ()).name
        assert WriteOptions(name=name).name == name


@pytest.mark.parametrize("name", MAIN)
def test_a_payload_is_written_read_back_and_missed(name: str) -> None:
    load = Load(12.5, np.array([0.01, 0.0, 0.12]), np.array([0.05, 0.06, 0.07]))
    kind: Any = FORMATS[name].kinds[-1]
    program = program_of(n=4, cell=replace(cell_of(), tool=Tool(spindle(), load=load)))
    made = write_program(program, name, kind, options())
    texts = made.texts()
    assert round_trip(program, texts, name, kind, options()).within()
    assert not any("mass_kg" in note for note in made.notes)
    figure = {
        "krl": "M 12.500",
        "rapid": "[12.5,",
        "urscript": "set_payload(12.500",
        "fanuc": "PAYLOAD[1]",
        "val3": "M 12.5 CM",
        "sinumerik": "M 12.5 CM",
    }[name]
    assert sum(text.count(figure) for text in texts.values()) == 1
    for changed in (figure.replace("12", "13").replace("[1]", "[2]"), ""):
        wrong = {file: text.replace(figure, changed) for file, text in texts.items()}
        difference = round_trip(program, wrong, name, kind, options()).difference()
        assert difference is not None
        assert "payload" in difference.what
    without = program_of(n=4)
    bare = write_program(without, name, kind, options())
    assert any("mass_kg and centre_mm are not in the cell file" in note for note in bare.notes)
    point = replace(program, cell=replace(program.cell, tool=Tool(spindle(), load=replace(load, inertia=None))))
    assert any("a point mass" in note for note in write_program(point, name, kind, options()).notes)


def test_files_that_cannot_be_replayed_are_refused(tmp_path: Path) -> None:
    program = program_of(n=5)
    path, _ = written(tmp_path / "krl", program, "krl", "cartesian")
    moved = replace(program, cell=replace(program.cell, T_world_part0=part(x=9.0)))
    refuses("Q005", r"part_001.src, line \d+: frame", read_program, path, moved.robot, moved.cell, options())
    longer = program_of(n=6)
    refuses("Q005", "5 moves", read_program, path, program.robot, program.cell, options(), neutral(tmp_path, longer))
    refuses("Q002", r"\.script", read_program, tmp_path / "program.xyz", program.robot, program.cell)


# ------------------------------------------------------------
# Positioning moves from one side: where points are put in, that joints turn the right way, and limits

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
