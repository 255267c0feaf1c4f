"""Clearance of arms in cells: by hand, against all pairs one by one, moved worlds, external axes, the named pair."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refuses
from rigid_frames import rigid_frame
from scipy.spatial.transform import Rotation

from machining import Drive
from machining.cell import (
    ArmBodies,
    Body,
    Cell,
    Fixture,
    LinearAxis,
    Scene,
    Tool,
    Turntable,
    arm_of,
    box,
    clearance,
    clearance_of,
    cylinder,
    scene_of,
    sphere,
    surface,
)
from machining.cell.separation import OVERLAP, exact_distance
from robots import forward_kinematics, inverse_kinematics
from robots.arrays import Array
from robots.frames import inverse


def at(x: float, y: float, z: float) -> Array:
    return rigid_frame((x, y, z))


def spindle_cell(**changes: object) -> Cell:
    """A table with a block in front of the robot, a spindle with a cutter on the flange, a floor."""
    spindle = Body("spindle", (box([0.2, 0.2, 0.3]), cylinder(0.04, 0.1).moved(at(0, 0, 0.3))))
    cell = Cell(
        tool=Tool(at(0, 0, 0.45), (spindle,), (Body("cutter", (cylinder(0.008, 0.06).moved(at(0, 0, 0.39)),)),)),
        part=Body("part", (box([0.4, 0.3, 0.15]).moved(at(1.3, 0, 0.7)),)),
        fixtures=(Fixture(Body("table", (box([0.6, 1.2, 0.7]).moved(at(1.35, 0, 0)),))),),
        floor=0.0,
    )
    return replace(cell, **changes)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def arm() -> ArmBodies:
    return arm_of("kr60-3")


@pytest.fixture(scope="module")
def scene(arm: ArmBodies) -> Scene:
    return scene_of(spindle_cell(), arm)


def pointing_down(arm: ArmBodies, cell: Cell, tips: Array) -> Array:
    """Poses (n, dof) with the tool straight down at the tips (n, 3), elbow up."""
    T = np.tile(np.diag([1.0, -1.0, -1.0, 1.0]), (len(tips), 1, 1))
    T[:, :3, 3] = tips
    found = inverse_kinematics(arm.robot, T, T_flange_tool=cell.tool.T_flange_tool)
    q = found.q[:, 0]
    assert np.isfinite(q).all()
    return np.asarray(q)


def one_by_one(scene: Scene, q: Array, e: Array | None = None, table: Array | None = None) -> Array:
    """Least exact distance over all pairs without any bound, and the lowest corner over the floor."""
    R, p = scene.frames(q, e, table)
    out = np.full(len(q), np.inf)
    frames = [scene.members[i].frame for i in scene.owner]
    to_world = scene.cell.T_world_base(e)
    for i in range(len(q)):
        for _, a, b in scene.solid_pairs:
            f, g = frames[a], frames[b]
            t = R[i, f].T @ (p[i, g] - p[i, f])
            distance = exact_distance(scene.solids[a], scene.solids[b], R[i, f].T @ R[i, g], t, np.inf)
            out[i] = min(out[i], distance)
        T = to_world[min(i, len(to_world) - 1)]
        for k in scene.floor_members:
            for solid in scene.members[k].body.solids:
                f = scene.members[k].frame
                z = ((solid.nodes @ R[i, f].T + p[i, f]) @ T[:3, :3].T + T[:3, 3])[:, 2].min() - solid.radius
                gap = z - (scene.cell.floor or 0.0)
                out[i] = min(out[i], gap if gap >= 0.0 else OVERLAP)
    return out


def test_heights_over_the_part_by_hand(arm: ArmBodies, scene: Scene) -> None:
    # The cutter may touch the part; the spindle's nose is 0.05 m above the tip, over the part whose top is at 0.85.
    heights = np.array([0.86, 0.87, 0.84, 0.805])
    q = pointing_down(arm, scene.cell, np.stack([np.full(4, 1.3), np.zeros(4), heights], axis=1))
    found = clearance(scene, q, within=0.2)
    np.testing.assert_allclose(found.distance, heights + 0.05 - 0.85, atol=1e-9)
    assert [found.nearest(i) for i in range(4)] == [("spindle", "part")] * 4
    assert not found.collides.any()


def test_offending_pairs_are_named(arm: ArmBodies, scene: Scene) -> None:
    # Tip 60 mm below the part's top: the spindle's nose is 10 mm in it.
    q = pointing_down(arm, scene.cell, np.array([[1.3, 0.0, 0.79], [1.3, 0.45, 0.69]]))
    found = clearance(scene, q)
    np.testing.assert_array_equal(found.collides, [True, True])
    np.testing.assert_array_equal(found.distance, OVERLAP)
    assert found.nearest(0) == ("spindle", "part")
    # Beside the part the cutter is 10 mm in the table, which it may not touch.
    assert found.nearest(1) == ("cutter", "table")
    # Wrist and spindle meet at the flange by design, which is no overlap to report.
    assert scene.switched_off == (("pedestal", "upper-arm"),)
    # An allowed contact is not looked at.
    free = scene_of(spindle_cell(allowed_contacts=(("table", "cutter"),)), arm)
    assert clearance(free, q[1:], within=0.5).nearest(0) == ("spindle", "table")


def test_the_floor_is_exact(arm: ArmBodies) -> None:
    ball = Body("ball", (sphere(0.1).moved(at(0, 0, 0.3)),))
    cell = Cell(tool=Tool(at(0, 0, 0.4), (ball,)), floor=-0.2)
    q = pointing_down(arm, cell, np.array([[1.4, 0.3, 0.0], [1.2, 0.2, -0.1], [1.4, 0, -0.19], [1.4, 0, -0.21]]))
    found = clearance(scene_of(cell, arm), q, within=0.15)
    np.testing.assert_allclose(found.distance, [0.15, 0.1, 0.01, OVERLAP], atol=1e-9)
    assert [found.nearest(i) for i in range(4)] == [None, *[("ball", "floor")] * 3]


def test_a_part_inside_a_body_and_a_body_inside_a_fixture(arm: ArmBodies) -> None:
    q = pointing_down(arm, spindle_cell(), np.array([[1.3, 0.0, 0.9]]))
    middle = forward_kinematics(arm.robot, q)
    inside = middle.p_flange[0] + 0.15 * middle.R_flange[0][:, 2]
    pea = Body("pea", (sphere(0.005).moved(at(*inside)),))
    hall = Body("hall", (box([9, 9, 9]).moved(at(0, 0, -4)),))
    ring = trimesh.creation.annulus(0.02, 0.05, 0.02)
    small = surface("ring", ring.vertices, ring.faces)
    found = clearance(scene_of(spindle_cell(fixtures=(Fixture(pea),)), arm), q)
    assert found.nearest(0) == ("spindle", "pea")
    found = clearance(scene_of(spindle_cell(fixtures=(Fixture(hall),)), arm), q)
    assert found.collides[0]
    found = clearance(scene_of(spindle_cell(fixtures=(Fixture(Body("ring", (small.moved(at(*inside)),))),)), arm), q)
    assert found.nearest(0) == ("spindle", "ring")


def test_bounds_leave_nothing_out(arm: ArmBodies, scene: Scene, rng: np.random.Generator) -> None:
    limits = arm.robot.limits
    q = rng.uniform(limits[:, 0], limits[:, 1], (60, arm.robot.dof))
    whole = one_by_one(scene, q)
    np.testing.assert_allclose(clearance(scene, q, within=np.inf).distance, whole, atol=1e-9)
    for within in (0.02, 0.3):
        np.testing.assert_allclose(clearance(scene, q, within=within).distance, np.minimum(whole, within), atol=1e-9)
    assert 5 < (whole < 0.0).sum() < 55


def test_a_hanging_robot_and_a_floor(arm: ArmBodies, rng: np.random.Generator) -> None:
    T = at(0.2, 0.0, 2.6)
    T[:3, :3] = Rotation.from_euler("xy", [np.pi - 0.2, 0.1]).as_matrix()
    hanging = scene_of(spindle_cell(T_world_base0=T, floor=0.1), arm)
    q = rng.uniform(arm.robot.limits[:, 0], arm.robot.limits[:, 1], (40, 6))
    found = clearance(hanging, q, within=np.inf)
    np.testing.assert_allclose(found.distance, one_by_one(hanging, q), atol=1e-9)
    assert any(found.names[k][1] == "floor" for k in found.pair)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6), st.floats(0.001, 0.5))
def test_within_only_clips(share: list[float], within: float) -> None:
    scene = scene_cached()
    limits = scene.arm.robot.limits
    q = (limits[:, 0] + np.array(share) * np.ptp(limits, axis=1))[None]
    whole, near = clearance(scene, q, within=np.inf), clearance(scene, q, within=within)
    np.testing.assert_allclose(near.distance, np.minimum(whole.distance, within), atol=1e-9)
    assert (near.pair[0] < 0) == (near.distance[0] == within)


def scene_cached(made: list[Scene] = []) -> Scene:  # noqa: B006 - one scene for all examples
    if not made:
        made.append(scene_of(spindle_cell(), arm_of("kr60-3")))
    return made[0]


def moved_world(cell: Cell, T: Array) -> Cell:
    return replace(
        cell,
        T_world_base0=T @ cell.T_world_base0,
        part=None if cell.part is None else cell.part.moved(T),
        fixtures=tuple(replace(f, body=f.body.moved(T)) for f in cell.fixtures),
        floor=None if cell.floor is None else cell.floor + T[2, 3],
    )


def test_the_world_s_place_plays_no_part(arm: ArmBodies, rng: np.random.Generator) -> None:
    # Turned about the vertical, so that the floor stays one.
    T = at(3.0, -7.0, 1.5)
    T[:3, :3] = Rotation.from_euler("z", 1.1).as_matrix()
    q = rng.uniform(arm.robot.limits[:, 0], arm.robot.limits[:, 1], (300, arm.robot.dof))
    here = clearance(scene_of(spindle_cell(), arm), q)
    there = clearance(scene_of(moved_world(spindle_cell(), T), arm), q)
    np.testing.assert_allclose(there.distance, here.distance, atol=1e-9)
    np.testing.assert_array_equal(there.pair[here.distance > 0.0], here.pair[here.distance > 0.0])


def test_linear_axes_move_the_base(arm: ArmBodies, rng: np.random.Generator) -> None:
    rail = LinearAxis("rail", np.array([0.0, 1.0, 0.0]), np.array([-2.0, 2.0]))
    lift = LinearAxis("lift", np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0]))
    carried = scene_of(spindle_cell(linear_axes=(rail, lift)), arm)
    e = rng.uniform(-0.4, 0.4, (4, 2))
    q = pointing_down(arm, spindle_cell(), np.tile([1.3, 0.0, 0.95], (4, 1)))
    found = clearance(carried, q, e, within=0.4)
    # The same as the arm standing still and the world moved against it.
    for i in range(len(q)):
        # The floor and all that stands on it go the other way.
        still = moved_world(spindle_cell(), at(0.0, -e[i, 0], -e[i, 1]))
        alone = clearance(scene_of(replace(still, T_world_base0=np.eye(4)), arm), q[i : i + 1], within=0.4)
        assert found.distance[i] == pytest.approx(alone.distance[0], abs=1e-9)
    np.testing.assert_allclose(clearance(carried, q, e[:1], within=0.4).distance, found.distance[0], atol=1e-12)
    # The tool's height over the part grows with the lift, one to one.
    tall = clearance(carried, q[:2], np.array([[0.0, -0.1], [0.0, -0.07]]), within=0.4).distance
    np.testing.assert_allclose(tall, [0.05, 0.08], atol=1e-9)


def test_the_turntable_moves_part_and_clamps(arm: ArmBodies) -> None:
    turntable = Turntable(np.array([1.3, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    post = Body("post", (box([0.05, 0.05, 0.4]).moved(at(1.3, 0.4, 0.7)),))
    q = pointing_down(arm, spindle_cell(), np.array([[1.0, 0.0, 0.9]]))
    cell = spindle_cell(fixtures=(Fixture(post, on_turntable=True),), turntable=turntable)
    scene = scene_of(cell, arm)
    # Turned by 90 degrees the post stands at x = 0.9: 0.1 from the tool's axis, inside the spindle's box.
    found = clearance(scene, np.repeat(q, 2, axis=0), table=np.array([0.0, np.pi / 2]), within=0.5)
    np.testing.assert_array_equal(found.collides, [False, True])
    assert found.nearest(1) == ("spindle", "post")
    whole = one_by_one(scene, np.repeat(q, 3, axis=0), table=np.array([0.3, 0.9, -2.0]))
    again = clearance(scene, np.repeat(q, 3, axis=0), table=np.array([0.3, 0.9, -2.0]), within=np.inf)
    np.testing.assert_allclose(again.distance, whole, atol=1e-9)


def test_carriages_are_in_the_way_too(arm: ArmBodies) -> None:
    carriage = Body("sled", (box([3.0, 1.0, 0.2]).moved(at(0.5, 0, -0.2)),))
    rail = LinearAxis("rail", np.array([0.0, 1.0, 0.0]), np.array([-2.0, 2.0]), carriage=carriage)
    stop = Fixture(Body("stop", (box([0.2, 0.2, 0.2]).moved(at(0.5, 1.0, -0.2)),)))
    cell = Cell(tool=spindle_cell().tool, linear_axes=(rail,), fixtures=(stop,))
    scene = scene_of(cell, arm)
    assert ("pedestal", "sled") not in scene.names
    q = pointing_down(arm, cell, np.array([[1.3, 0.0, 0.05], [1.2, 0.0, 0.5]]))
    found = clearance(scene, q, np.array([[0.0], [0.37]]), within=0.1)
    # The cutter is 0.05 m over the sled; the sled's side at 0.5 + 0.37 is 0.03 m from the stop at 0.9.
    np.testing.assert_allclose(found.distance, [0.05, 0.03], atol=1e-9)
    assert [found.nearest(i) for i in range(2)] == [("cutter", "sled"), ("sled", "stop")]


def test_what_the_robot_stands_on_is_said(arm: ArmBodies) -> None:
    plinth = Fixture(Body("plinth", (box([0.8, 0.8, 0.5]).moved(at(0, 0, -0.45)),)))
    rail = LinearAxis("rail", np.array([1.0, 0.0, 0.0]), np.array([-2.0, 2.0]))
    # Standing still they can never meet anew; on a rail the overlap at zero is by design and said.
    assert ("pedestal", "plinth") not in scene_of(Cell(fixtures=(plinth,)), arm).names
    moving = scene_of(Cell(fixtures=(plinth,), linear_axes=(rail,)), arm)
    assert ("pedestal", "plinth") in moving.switched_off
    # An arm that is in a wall at home is said, and stays checked.
    wall = Fixture(Body("wall", (box([0.1, 3.0, 3.0]).moved(at(0.6, 0, 0)),)))
    walled = scene_of(Cell(fixtures=(wall,)), arm)
    assert any("wall overlap at home; the pair stays checked" in note for note in walled.notes)
    assert clearance(walled, walled.home[None]).collides[0]


def test_a_drive_takes_the_callback(arm: ArmBodies) -> None:
    cell = spindle_cell(linear_axes=(LinearAxis("lift", np.array([0.0, 0, 1]), np.array([0.0, 1.0])),))
    distance = clearance_of(cell, arm, e=[0.02], within=0.08)
    tips = np.array([[1.3, 0.0, 0.855], [1.3, 0.0, 0.83], [1.3, 0.0, 0.7], [1.3, 0.0, 1.1]])
    q = pointing_down(arm, cell, tips)
    np.testing.assert_allclose(distance(q), [0.075, 0.05, OVERLAP, 0.08], atol=1e-9)
    cost, allowed = Drive(clearance_of=distance, clearance_zone=0.08, clearance_least=0.0).near_things(q)
    np.testing.assert_array_equal(allowed, [True, True, False, True])
    assert cost[3] == 0.0 < cost[0] < cost[1] < cost[2]
    assert distance(np.zeros((0, 6))).shape == (0,)


def test_frames_are_those_of_the_cell(arm: ArmBodies, rng: np.random.Generator) -> None:
    rail = LinearAxis("rail", np.array([0.0, 1.0, 0.0]), np.array([-2.0, 2.0]))
    cell = Cell(T_world_base0=at(1, 2, 3), linear_axes=(rail,), turntable=Turntable(np.ones(3), np.array([1.0, 0, 0])))
    scene = scene_of(cell, arm)
    q, e, angle = rng.uniform(-1, 1, (5, 6)), rng.uniform(-1, 1, (5, 1)), rng.uniform(-3, 3, 5)
    R, p = scene.frames(q, e, angle)
    to_base = inverse(cell.T_world_base(e))
    np.testing.assert_allclose(p[:, arm.count], to_base[:, :3, 3], atol=1e-14)
    np.testing.assert_allclose(R[:, arm.count + 1], (to_base @ cell.T_world_table(angle))[:, :3, :3], atol=1e-14)
    # The carriage keeps its place under the base.
    np.testing.assert_allclose(p[:, arm.count + 2], np.broadcast_to([-1.0, -2, -3], (5, 3)), atol=1e-14)


def test_bad_calls_are_refused(arm: ArmBodies, scene: Scene) -> None:
    q = np.zeros((2, 6))
    block = Fixture(Body("forearm", (box([1, 1, 1]).moved(at(5, 0, 0)),)))
    misspelt = Cell(allowed_contacts=(("tabel", "floor"),))
    for words, call in (
        ("pose array", lambda: clearance(scene, np.zeros((2, 5)))),
        ("pose 1", lambda: clearance(scene, np.array([[0.0] * 6, [np.nan] * 6]))),
        ("distance that matters", lambda: clearance(scene, q, within=0.0)),
        ("travels of the linear axes", lambda: clearance(scene, q, np.zeros((2, 1)))),
        ("angles of the turntable: got '3 rows'", lambda: clearance(scene, q, table=np.zeros(3))),
        ("body name used in robot and cell: got 'forearm'", lambda: scene_of(Cell(fixtures=(block,)), arm)),
        ("allowed contact names no body: got 'tabel'", lambda: scene_of(misspelt, arm)),
        ("joint speeds of the cell: got '5 figures'", lambda: scene_of(Cell(joint_speed=np.ones(5)), arm)),
        ("home pose", lambda: scene_of(Cell(home=np.zeros(1)), arm)),
    ):
        refuses("B001 K001", words, call)


# ------------------------------------------------------------
# Frames of the cell: linear axes carry the robot, the turntable carries the part


def frame(R: Array, p: list[float]) -> Array:
    return rigid_frame(p, R)


@pytest.fixture
def gantry(rotation: Array) -> Cell:
    """Two axes, the second aslant; a turntable about a tilted axis."""
    return Cell(
        T_world_base0=frame(rotation, [1.0, 2.0, 0.5]),
        T_world_part0=frame(np.eye(3), [3.0, 0.0, 1.0]),
        linear_axes=(
            LinearAxis("x", np.array([2.0, 0.0, 0.0]), np.array([-1.0, 4.0])),
            LinearAxis("lift", np.array([0.0, 0.6, 0.8]), np.array([0.0, 1.0])),
        ),
        turntable=Turntable(np.array([2.0, 0.0, 0.0]), np.array([0.0, 0.0, 3.0]), np.array([-np.pi, np.pi])),
    )


def test_an_empty_cell_needs_nothing() -> None:
    cell = Cell()
    np.testing.assert_array_equal(cell.T_base_part(), np.eye(4)[None])
    np.testing.assert_array_equal(cell.T_world_base(np.zeros((3, 0))), np.tile(np.eye(4), (3, 1, 1)))
    assert cell.inside_limits().all()


def test_travels_add_up_along_their_directions(gantry: Cell, rotation: Array) -> None:
    T = gantry.T_world_base(np.array([[0.0, 0.0], [1.5, 0.0], [1.5, 0.5]]))
    np.testing.assert_allclose(T[:, :3, 3], [[1, 2, 0.5], [2.5, 2, 0.5], [2.5, 2.3, 0.9]], atol=1e-15)
    np.testing.assert_allclose(T[:, :3, :3], np.broadcast_to(rotation, (3, 3, 3)))
    # What stands behind the first axis moves with it alone.
    np.testing.assert_allclose(gantry.carried(np.array([[1.5, 0.5]]))[0], [[0, 0, 0], [1.5, 0, 0], [1.5, 0.3, 0.4]])


def test_the_turntable_turns_the_part_about_its_axis(gantry: Cell) -> None:
    T = gantry.T_world_part(np.array([0.0, np.pi / 2, np.pi]))
    np.testing.assert_allclose(T[:, :3, 3], [[3, 0, 1], [2, 1, 1], [1, 0, 1]], atol=1e-15)
    np.testing.assert_allclose(T[1, :3, 0], [0, 1, 0], atol=1e-15)
    # Points on the axis stay.
    np.testing.assert_allclose(
        gantry.T_world_table(np.array([0.7]))[0] @ [2.0, 0.0, 5.0, 1.0], [2, 0, 5, 1], atol=1e-14
    )


def test_part_in_base_is_both_together(gantry: Cell) -> None:
    e, angle = np.array([[0.3, 0.2], [1.0, 0.9]]), np.array([0.4, -1.0])
    T = gantry.T_base_part(e, angle)
    np.testing.assert_allclose(gantry.T_world_base(e) @ T, gantry.T_world_part(angle), atol=1e-14)
    one = gantry.T_base_part(e[:1], angle)
    np.testing.assert_allclose(one[1], gantry.T_base_part(e[:1], angle[1:])[0], atol=1e-15)


def test_limits(gantry: Cell) -> None:
    e = np.array([[-1.0, 0.0], [-1.1, 0.0], [0.0, 1.01], [4.0, 1.0]])
    np.testing.assert_array_equal(gantry.inside_limits(e), [True, False, False, True])
    np.testing.assert_array_equal(gantry.inside_limits(e[:1], np.array([3.0, 4.0])), [True, False])
    endless = replace(gantry, turntable=Turntable(np.zeros(3), np.array([0.0, 0, 1])))
    assert endless.inside_limits(e[:1], np.array([40.0])).all()


def test_bad_cells_are_refused(gantry: Cell) -> None:
    up, pair = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0])
    block = Body("block", (box([1, 1, 1]),))
    for words, make in (
        ("direction", lambda: LinearAxis("z", np.zeros(3), pair)),
        ("linear axis z: limits", lambda: LinearAxis("z", up, pair[::-1])),
        ("linear axis z: speed", lambda: LinearAxis("z", up, pair, speed=0.0)),
        ("linear axis z: compliance", lambda: LinearAxis("z", up, pair, compliance=np.ones(5))),
        ("axis of the turntable", lambda: Turntable(np.zeros(3), np.zeros(3))),
        ("limits of the turntable", lambda: Turntable(np.zeros(3), up, np.array([1.0, 1.0]))),
        ("robot frame in the world", lambda: Cell(T_world_base0=2.0 * np.eye(4))),
        ("part frame in the world", lambda: Cell(T_world_part0=np.eye(3))),
        ("tool frame on the flange", lambda: Tool(np.full((4, 4), np.nan))),
        ("name in the cell: got 'block'", lambda: Cell(part=block, fixtures=(Fixture(block),))),
        ("fixture on the turntable", lambda: Cell(fixtures=(Fixture(block, on_turntable=True),))),
        ("linear axes: got 4", lambda: Cell(linear_axes=tuple(LinearAxis(n, up, pair) for n in "abcd"))),
        ("safety distance", lambda: Cell(safety=-1.0)),
        ("joint speeds", lambda: Cell(joint_speed=[1.0, 0.0])),
        ("travels of the linear axes", lambda: gantry.T_world_base(np.zeros((2, 3)))),
        ("travels of the linear axes", lambda: gantry.T_world_base(np.full((1, 2), np.nan))),
        ("angle of the turntable", lambda: Cell().T_world_part(np.array([0.1]))),
    ):
        refuses("B001 K001", words, make)
