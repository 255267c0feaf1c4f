"""Collisions planted at known lines are found there, on whole moves and not only at points; clean ones are clean."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from verification_cases import ARM, cell, line, pillar, placed, program, tool, zigzag

from machining.cell import Body, Cell, Fixture, LinearAxis, Turntable, arm_of, box, clearance, scene_of
from machining.programs.formats import NEUTRAL, write_program
from machining.programs.program import JointProgram
from machining.toolpaths.motions import Event, Tool
from machining.verification import Demands, Kind, Severity, moving_axes, verify
from machining.verification.courses import courses_of
from machining.verification.sweep import motion_bound, sweep
from robots.arrays import Array

Faulty = tuple[JointProgram, int, set[str]]

# Along x over the part in 5 mm moves; point i is at -150 mm + 5 i mm, its line is i + 11.
ACROSS = line(61, (-0.15, 0.0, 0.0), (0.15, 0.0, 0.0))


def line_at(x: float) -> int:
    """Line of ACROSS' move within which the tip passes x."""
    return int(np.ceil((x + 0.15) / 0.005)) + 11


def mill_and_pillar(fault: bool) -> Faulty:
    # The mill is 8 mm thick, the pillar 20 mm; the clean one stands 10 mm beside the mill.
    where = cell(pillar(0.053, 0.0 if fault else 0.024, 0.05))
    return program(ACROSS, where=where), line_at(0.053 - 0.01 - 0.004), {"mill", "pillar"}


def spindle_and_pillar(fault: bool) -> Faulty:
    # The spindle is 100 mm wide and starts 100 mm above the tip.
    where = cell(pillar(0.053, 0.04, 0.2 if fault else 0.07))
    return program(ACROSS, where=where), line_at(0.053 - 0.01 - 0.05), {"spindle", "pillar"}


def plate_stepped_over(fault: bool) -> Faulty:
    # A plate of 1 mm between two points 300 mm apart.
    points = np.array([[-0.15, 0.0, 0.02], [-0.1, 0.0, 0.02], [0.15, 0.0, 0.02], [0.15, 0.05, 0.02]])
    where = cell(placed(Body("plate", (box((0.001, 0.1, 0.05 if fault else 0.01)),)), 1.3333, 0.1, 0.6))
    return program(points, np.ones(4), where=where), 13, {"mill", "plate"}


def spindle_and_part(fault: bool) -> Faulty:
    # The tip is 100 mm below the spindle.
    depth = -0.115 if fault else -0.095
    points = line(18, (0.0, 0.0, 0.02), (0.0, 0.0, depth))
    first = int(np.argmax(points[:, 2] < -0.1)) + 11
    return program(points), first, {"spindle", "part"}


def rapid_through_part(fault: bool) -> Faulty:
    depth = -0.005 if fault else 0.01
    points = np.array([[-0.25, 0.0, 0.02], [-0.22, 0.0, depth], [-0.1, 0.0, depth], [-0.1, 0.0, 0.05]])
    return program(points, np.ones(4)), 13, {"mill", "part"}


def mill_and_table(fault: bool) -> Faulty:
    # Beside the part, whose side is at -150 mm, down to the table's top at -110 mm.
    points = line(17, (-0.1, -0.3, 0.03), (-0.1, -0.3, -0.127 if fault else -0.095))
    return program(points), int(np.argmax(points[:, 2] < -0.11)) + 11, {"mill", "table"}


def forearm_and_beam(fault: bool) -> Faulty:
    where = cell(placed(Body("beam", (box((0.1, 0.1, 0.1)),)), 0.9, 0.0 if fault else 0.9, 1.2))
    given = program(line(61, (0.0, 0.3, 0.0), (0.0, -0.1, 0.0)), where=where)
    return given, first_by_sampling(given), {"forearm", "beam"}


def tool_and_forearm(fault: bool) -> Faulty:
    # The wrist turns until mill and spindle meet the forearm.
    base = program(ACROSS[:12], where=cell())
    q = base.q[:1] + np.linspace(0.0, 1.0, 12)[:, None] * np.radians([0, 0, 0, 0, 45 if fault else 20, 180])
    T = replace(base, q=q).reached()
    motions = replace(base.motions, points=T[:, :3, 3], axes=-T[:, :3, 2], rapid=np.ones(12, dtype=np.bool_))
    given = replace(base, q=q, T_part_tool=T, motions=motions)
    given = replace(given, cell=replace(base.cell, part=None, fixtures=()))
    return given, first_by_sampling(given), {"forearm"}


def carriage_into_wall(fault: bool) -> Faulty:
    # The base is on a rail along y and moves on while the arm holds still; the wall is thick.
    rail = LinearAxis("rail", np.array([0.0, 1.0, 0.0]), np.array([-1.0, 3.0]), speed=1.0)
    wall = placed(Body("wall", (box((2.5, 0.1, 2.0)),)), 0.6, 1.6 if fault else 2.9, 0.0)
    where = replace(cell(), part=None, linear_axes=(rail,), fixtures=(Fixture(wall),))
    base = program(np.repeat(ACROSS[:1], 20, axis=0), np.ones(20), where=where)
    travel = np.linspace(0.0, 1.8, 20)[:, None]
    moved = replace(base, travel=travel)
    T = moved.reached()
    given = replace(moved, T_part_tool=T, motions=replace(base.motions, points=T[:, :3, 3]))
    return given, first_by_sampling(given), set()


def clamp_on_turntable(fault: bool) -> Faulty:
    # The table turns a clamp into the standing mill.
    table = Turntable(np.array([1.3, 0.1, 0.0]), np.array([0.0, 0.0, 1.0]))
    clamp = Fixture(placed(Body("clamp", (box((0.03, 0.03, 0.05 if fault else 0.01)),)), 1.42, 0.1, 0.6), True)
    where = replace(cell(), turntable=table, fixtures=(clamp,))
    base = program(np.repeat([[0.0, 0.12, 0.02]], 25, axis=0), np.ones(25), where=where)
    moved = replace(base, table=np.linspace(0.0, np.radians(120.0), 25))
    T = moved.reached()
    given = replace(moved, T_part_tool=T, motions=replace(base.motions, points=T[:, :3, 3], axes=-T[:, :3, 2]))
    # The clamp's corner of 15 mm meets the mill of 4 mm radius 90 deg on, less asin(19 / 120) of its side.
    return given, int(np.ceil((90.0 - np.degrees(np.arcsin(0.019 / 0.12))) / 5.0)) + 11, {"mill", "clamp"}


CASES: list[Callable[[bool], Faulty]] = [
    mill_and_pillar,
    spindle_and_pillar,
    plate_stepped_over,
    spindle_and_part,
    rapid_through_part,
    mill_and_table,
    forearm_and_beam,
    tool_and_forearm,
    carriage_into_wall,
    clamp_on_turntable,
]


def first_by_sampling(given: JointProgram, each: int = 40) -> int:
    """Line of the first move with an overlap at one of many even samples; 0 where there is none."""
    scene = scene_of(given.cell, ARM)
    s = np.arange(1, each + 1) / each

    def dense(values: Array) -> Array:
        steps = values[:-1, None] + s[:, None] * np.diff(values, axis=0)[:, None]
        return np.concatenate([values[:1], steps.reshape(each * (len(values) - 1), values.shape[1])])

    seen = clearance(scene, dense(given.q), dense(given.travel), dense(given.table[:, None])[:, 0], within=0.01)
    hits = np.flatnonzero(seen.collides)
    return int(given.motions.line[-(-hits[0] // each)]) if len(hits) else 0


@pytest.mark.parametrize("case", CASES)
def test_a_planted_collision_is_found_at_its_line(case: Callable[[bool], Faulty]) -> None:
    given, at, bodies = case(True)
    found = verify(given, ARM, Demands(tolerance=1.0, axis_tolerance=9.0))
    first = next(o for o in found.offences if o.kind in (Kind.COLLISION, Kind.RAPID_CONTACT))
    assert first.severity is Severity.ERROR
    assert first.line == at
    assert first.bodies is not None
    assert bodies <= set(first.bodies)
    assert not found.clean


@pytest.mark.parametrize("case", CASES)
def test_its_clean_neighbour_is_clean(case: Callable[[bool], Faulty]) -> None:
    found = verify(case(False)[0], ARM, Demands(tolerance=1.0, axis_tolerance=9.0))
    touches = {Kind.COLLISION, Kind.RAPID_CONTACT, Kind.UNPROVEN, Kind.CLEARANCE}
    assert [o for o in found.offences if o.kind in touches] == []
    assert (found.swept.proven > 0.0).all()


def test_straight_moves_are_swept_too() -> None:
    given, at, _ = plate_stepped_over(True)
    for interpolation in ("joint", "linear"):
        found = verify(given, ARM, Demands(interpolation=interpolation, singular_least=0.0))  # type: ignore[arg-type]
        first = next(o for o in found.offences if o.kind is Kind.COLLISION)
        # From -100 mm to the plate's face less the mill's radius: 128.8 of 250 mm. Joints leave that line by 5 mm.
        assert first.line == at
        if interpolation == "linear":
            assert first.at == pytest.approx(0.1288 / 0.25, abs=0.001 / 0.25)
    assert "plate" in first.bodies  # type: ignore[operator]


@pytest.mark.parametrize("robot", ["kr60-3", "xr701", "tx200"])
def test_the_bound_holds_the_motion_of_all_bodies(robot: str) -> None:
    """No node of any body goes a longer way than the bound says, on random motions of all axes; crank and bar too."""
    model = arm_of(robot)
    table = Turntable(np.array([1.3, 0.1, 0.0]), np.array([0.0, 0.6, 0.8]))
    rail = LinearAxis("rail", np.array([0.0, 1.0, 0.0]), np.array([-1.0, 3.0]))
    where = replace(cell(), turntable=table, linear_axes=(rail,), joint_speed=None, joint_acceleration=None)
    scene, axes = scene_of(where, model), moving_axes(model.robot, where)
    bound = motion_bound(scene, axes)
    rng = np.random.default_rng(3)
    start = rng.uniform(-2.0, 2.0, (120, axes.count))
    # Many joints at once, by up to a radian, and single ones.
    way = rng.normal(size=start.shape) * 10.0 ** rng.uniform(-2.0, 0.0, (120, 1))
    way[60:] *= np.eye(axes.count)[rng.integers(0, axes.count, 60)]
    steps = 20

    def nodes(share: float) -> list[Array]:
        R, p = scene.frames(*axes.parts(start + share * way))
        return [np.einsum("nij,kj->nki", R[:, f], s.solid.nodes) + p[:, f, None] for f, s in placed_solids]

    placed_solids = list(zip(scene.solid_frames, scene.solids, strict=True))
    courses = [nodes(k / steps) for k in range(steps + 1)]
    ways = [
        sum(np.linalg.norm(b[k] - a[k], axis=2) for a, b in pairwise(courses)).max(axis=1)  # type: ignore[union-attr]
        for k in range(len(placed_solids))
    ]
    L, of_solids = bound(start, np.abs(way)), bound.solids(start, np.abs(way))
    moving = [k for k, (f, _) in enumerate(placed_solids) if 0 < f < model.count]
    for column, k in enumerate(moving):
        # Sides of a polygon are shorter than the arc, so the bound is above all of them.
        assert (ways[k] <= of_solids[:, column]).all(), scene.members[scene.owner[k]].body.name
    # The rest as seen from the base, which the rail carries; on the rail alone the bound is the motion.
    rest = np.max([w for (f, _), w in zip(placed_solids, ways, strict=True) if f >= model.count], axis=0)
    assert (rest <= L + 1e-12).all()
    # It is of use: little more than what single axes move; several partly cancel.
    largest = np.max(ways, axis=0)
    assert np.median(L[60:] / largest[60:]) < 1.2
    assert np.median(L[:60] / largest[:60]) < 4.0


def test_nothing_is_stepped_over_on_a_rail() -> None:
    """The bound is exact there: 95 mm free at both ends of 200 mm, and a plate between."""
    rail = LinearAxis("rail", np.array([0.0, 1.0, 0.0]), np.array([-1.0, 3.0]))
    plate = placed(Body("plate", (box((0.1, 0.001, 0.05)),)), 1.3, 0.2, 0.6)
    where = replace(cell(plate), linear_axes=(rail,), part=None, fixtures=(Fixture(plate),))
    base = program(np.repeat([[0.0, 0.0, 0.02]], 2, axis=0), np.ones(2), where=where)
    given = replace(base, travel=np.array([[0.0], [0.2]]))
    found = sweep(courses_of(given, "joint"), scene_of(where, ARM), horizon=0.3)
    assert found.hit[1] == pytest.approx((0.1 - 0.0005 - 0.004) / 0.2, abs=0.001 / 0.2)


def test_proven_distances_are_below_dense_samples() -> None:
    """Between points nothing is nearer than what was proven, and nothing seen is below it."""
    where = cell(pillar(0.05, 0.05, 0.09), safety=0.03)
    rng = np.random.default_rng(5)
    points = np.column_stack([rng.uniform(-0.15, 0.15, (12, 2)), rng.uniform(0.0, 0.1, 12)])
    given = program(points, np.ones(12), where=where)
    scene, courses = scene_of(where, ARM), courses_of(given, "joint")
    found = sweep(courses, scene, safety=0.03)
    s = np.linspace(0.0, 1.0, 101)
    for move in range(1, 12):
        values, _ = courses.at(np.full(101, move), s)
        dense = clearance(scene, *courses.axes.parts(values), within=found.within).distance
        assert dense.min() >= found.proven[move] - 1e-9
        assert dense.min() <= found.distance[move] + 1e-3
        assert (dense.min() < 0.0) == np.isfinite(found.hit[move])


def test_clearance_below_safety_is_an_offence_of_its_own() -> None:
    # The mill passes 10 mm beside the pillar; 2 mm more are asked for.
    given = program(ACROSS, where=cell(pillar(0.053, 0.024, 0.05), safety=0.012))
    found = verify(given, ARM)
    assert {o.kind for o in found.errors} == {Kind.CLEARANCE}
    (offence,) = found.errors
    # Nearer than 12 mm to the pillar's corner: 10 mm aside, so sqrt(16^2 - 14^2) mm from the corner along x.
    assert offence.line == line_at(0.053 - 0.01 - np.sqrt(0.016**2 - 0.014**2))
    x = -0.15 + 0.005 * (offence.move - 1 + offence.at)
    assert x == pytest.approx(0.053 - 0.01 - np.sqrt(0.016**2 - 0.014**2), abs=1e-3)
    assert offence.value == pytest.approx(0.010, abs=1e-4)
    assert offence.limit == 0.012


def test_a_distance_equal_to_the_safety_distance_is_no_offence() -> None:
    given = program(ACROSS, where=cell(pillar(0.053, 0.024, 0.05)))
    least = 0.01
    # Joints leave the straight line by micrometres: the distance is looked for where it is asked about.
    for _ in range(2):
        least = float(verify(given, ARM, Demands(safety=least)).swept.distance.min())
    assert least == pytest.approx(0.01, abs=1e-4)
    assert verify(given, ARM, Demands(safety=least)).clean
    # A nanometre is rounding, a micrometre is not.
    assert verify(given, ARM, Demands(safety=least + 0.5e-9)).clean
    assert {o.kind for o in verify(given, ARM, Demands(safety=least + 1e-6)).errors} == {Kind.CLEARANCE}


def test_what_cannot_be_decided_is_said() -> None:
    # The mill slides along the pillar with 0.1 um between them: no division of 1 mm tells that from a touch.
    given = program(ACROSS, where=cell(pillar(0.053, 0.0140001, 0.05)))
    found = verify(given, ARM)
    assert {o.kind for o in found.errors} <= {Kind.UNPROVEN, Kind.COLLISION}
    assert not found.clean


def test_a_retract_from_the_cut_is_a_warning_and_rapid_through_stock_is_none() -> None:
    points = np.array([[0.0, 0.0, 0.02], [0.0, 0.0, -0.005], [0.02, 0.0, -0.005], [0.02, 0.0, 0.05]])
    up = verify(program(points, [1, 0, 0, 1]), ARM, Demands(tolerance=1.0))
    assert [(o.kind, o.severity, o.line) for o in up.offences] == [(Kind.RAPID_CONTACT, Severity.WARNING, 14)]
    assert up.clean
    across = points.copy()
    across[3] = 0.1, 0.0, -0.005
    through = verify(program(across, [1, 0, 0, 1]), ARM, Demands(tolerance=1.0))
    assert [(o.kind, o.severity, o.line) for o in through.offences] == [(Kind.RAPID_CONTACT, Severity.ERROR, 14)]


def test_a_lasting_collision_is_one_offence() -> None:
    found = verify(program(ACROSS, where=cell(pillar(0.053, 0.0, 0.05))), ARM)
    (offence,) = found.errors
    # In touch over 28 mm: at most seven moves of 5 mm.
    assert 6 <= offence.moves <= 7
    assert offence.bodies == ("mill", "pillar")
    # It shows first where the mill meets the pillar's side, to the resolution of 1 mm.
    x = -0.15 + 0.005 * (offence.move - 1 + offence.at)
    assert x == pytest.approx(0.053 - 0.014, abs=1e-3)


def test_a_tool_without_bodies_is_said() -> None:
    where: Cell = replace(cell(), tool=replace(tool(), holder=(), cutter=()), floor=None)
    found = verify(program(ACROSS, where=where), ARM)
    assert any("tool" in text for text in found.not_looked_at)
    assert any("floor" in text for text in found.not_looked_at)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_random_pillars_are_found_where_dense_sampling_finds_them(seed: int) -> None:
    rng = np.random.default_rng(seed)
    hits = 0
    for _ in range(12):
        points = np.column_stack([rng.uniform(-0.3, 0.3, (12, 2)), rng.uniform(0.02, 0.3, 12)])
        post = pillar(*rng.uniform(-0.3, 0.3, 2), rng.uniform(0.05, 0.4), rng.uniform(0.005, 0.05))
        given = program(points, np.ones(12), where=replace(cell(post), part=None))
        found = verify(given, ARM)
        first = next((o.line for o in found.offences if o.kind is Kind.COLLISION), 0)
        assert first == first_by_sampling(given, 400)
        hits += first > 0
    # Both answers are asked for.
    assert 0 < hits < 12


# ------------------------------------------------------------
# Commands between moves: a missing spindle stop is found, and so is a cut that the spindle stands in

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
