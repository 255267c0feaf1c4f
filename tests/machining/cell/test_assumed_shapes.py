"""Arms without shape: capsules from the kinematics, the plane that they stand on, and what is said of both."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from refusals import refuses
from rigid_frames import rigid_frame

from machining.cell import Body, Cell, Tool, arm_bodies, clearance, parse_cell, scene_of, sphere
from machining.cell.assumed_shapes import ASSUMED, INNER, assumed_solids, joint_ways, shoulder_height, stands_on_base
from machining.cell.cell import Fixture
from machining.cell.separation import segment_distance
from robots import forward_kinematics, load_description, load_robot
from robots.library.models import library_names, parse_description, to_toml
from robots.robot import trial_poses
from robots.schema.quantities import PositiveLength

POSES = 20


def test_distance_of_segments_is_that_of_their_nearest_points() -> None:
    rng = np.random.default_rng(3)
    a0, a1, b0, b1 = rng.uniform(-1.0, 1.0, (4, 200, 3))
    # Parallel ones, points, and segments that cross.
    b1[:20] = b0[:20] + 0.7 * (a1[:20] - a0[:20])
    a1[20:30], b1[30:40] = a0[20:30], b0[30:40]
    b0[40:50], b1[40:50] = 0.5 * (a0 + a1)[40:50] + 0.3, 0.5 * (a0 + a1)[40:50] - 0.3
    found = segment_distance(a0, a1, b0, b1)
    s = np.linspace(0.0, 1.0, 401)
    x = a0[:, None] + s[:, None] * (a1 - a0)[:, None]
    y = b0[:, None] + s[:, None] * (b1 - b0)[:, None]
    # On the grid of both the least is above the true one, by no more than half a step of each.
    grid = np.array([np.sqrt(((p[:, None] - q[None]) ** 2).sum(axis=2)).min() for p, q in zip(x, y, strict=True)])
    step = (np.linalg.norm(a1 - a0, axis=1) + np.linalg.norm(b1 - b0, axis=1)) / 800.0
    assert (found <= grid + 1e-12).all()
    assert (grid - found <= step + 1e-12).all()
    assert np.abs(found[40:50]).max() < 1e-12


@pytest.mark.parametrize("name", library_names())
def test_capsules_hold_the_way_from_joint_to_joint_and_keep_off_the_floor(name: str) -> None:
    robot = load_robot(name)
    solids = assumed_solids(robot)
    frames = forward_kinematics(robot, trial_poses(robot, POSES, POSES))
    origins = [*np.moveaxis(frames.p[:, 1:], 1, 0), frames.p_flange]
    for at in origins:
        near = np.full(len(at), np.inf)
        for body, made in solids.items():
            for solid in made:
                ends = np.einsum("nij,kj->nki", frames.R[:, body], solid.nodes) + frames.p[:, body, None]
                near = np.minimum(near, segment_distance(at, at, ends[:, 0], ends[:, -1]) - solid.radius)
        assert near.max() < 0.0
    assert stands_on_base(robot)
    # The upper arm turns freely over the floor.
    assert max(solid.radius for solid in solids[2]) < shoulder_height(robot)
    thick = [made[0].radius for made in solids.values()]
    assert thick[0] >= thick[1] >= thick[-1]


def test_ways_lead_over_the_common_normal_and_stand_aside_where_the_chain_does() -> None:
    ur, kuka = joint_ways(load_robot("ur20")), joint_ways(load_robot("kr16-2"))
    assert [len(ways) for ways in kuka] == [1] * 7
    # The forearm of the KR 16 begins 35 mm under joint 3.
    np.testing.assert_allclose(kuka[3][0], [[0, 0, 0], [0, 0, -0.035]], atol=1e-12)
    # The upper arm of a UR stands 201 mm beside the plane of its joints' origins.
    near, far = ur[2]
    np.testing.assert_allclose(far - near, [[0, 0.201, 0]] * 2, atol=1e-9)


def test_the_plane_that_the_robot_stands_on_is_a_floor_unless_the_cell_says_otherwise(tmp_path: Path) -> None:
    arm = arm_bodies(load_description("ur10e"))
    elbow_low = np.radians([[0.0, 30.0, 60.0, 0.0, 90.0, 0.0]])
    head = 'schema = "stiffarm-cell/1"\n'
    said = {
        "": True,
        "[floor]\nheight_mm = -3000\n": False,
        "[floor]\nnone = true\n": False,
        "[floor]\nheight_mm = 0\n": True,
        "[robot]\nposition_mm = [0, 0, 900]\n": True,
        "[robot]\nposition_mm = [0, 0, 900]\n[floor]\nheight_mm = -2000\n": False,
        # On a wall the wall is the plane; on a ceiling, the ceiling.
        "[robot]\nrpy_deg = [90, 0, 0]\n": True,
        "[robot]\nrpy_deg = [180, 0, 0]\n": True,
    }
    for text, hit in said.items():
        scene = scene_of(parse_cell(head + text, "cell", tmp_path), arm)
        found = clearance(scene, elbow_low)
        assert bool(found.collides[0]) == hit, text
        if hit:
            assert found.nearest(0) == (f"j3{ASSUMED}", "floor") or found.nearest(0) == (f"j2{ASSUMED}", "floor")
    refuses("F011", "none = true", parse_cell, head + "[floor]\nheight_mm = 0\nnone = true\n", "cell", tmp_path)


def test_a_base_frame_at_axis_2_is_no_floor() -> None:
    described = load_description("ur10e")
    first = described.joint[0]
    assert first.frame is not None
    low = first.frame.model_copy(update={"xyz": first.frame.xyz.model_copy(update={"value": (0.0, 0.0, 0.0)})})
    joints = (first.model_copy(update={"frame": low}), *described.joint[1:])
    arm = arm_bodies(described.model_copy(update={"joint": joints}))
    scene = scene_of(Cell(stands=True), arm)
    assert scene.floor_members == ()
    assert any("no floor is checked" in note for note in scene.notes)


def test_assumed_bodies_meet_by_half_of_their_radii_and_the_cell_by_all_of_them() -> None:
    arm = arm_bodies(load_description("kr16-2"), beam_radius=0.1)
    q = np.radians([[0.0, -90.0, 150.0, 0.0, 60.0, 0.0]])
    scene = scene_of(Cell(), arm)
    found = clearance(scene, q, within=np.inf)
    assert found.names[found.pair[0]][0].endswith(ASSUMED)
    R, p = arm.frames(q)
    by_hand = np.inf
    for i, j in scene.pairs:
        for a in arm.bodies[i].solids:
            for b in arm.bodies[j].solids:
                x, y = (s.nodes @ R[0, arm.frame[k]].T + p[0, arm.frame[k]] for s, k in ((a, i), (b, j)))
                gap = segment_distance(x[:1], x[-1:], y[:1], y[-1:])[0] - INNER * (a.radius + b.radius)
                by_hand = min(by_hand, float(gap))
    assert found.distance[0] == pytest.approx(max(by_hand, -1e-3), abs=1e-9)
    # A ball 300 mm before the flange is met by the whole radius.
    ball = rigid_frame(p[0, arm.flange] + 0.3 * R[0, arm.flange][:, 2])
    cell = Cell(fixtures=(Fixture(Body("ball", (sphere(0.05),)).moved(ball)),))
    met = scene_of(cell, arm)
    pair = next(k for k, names in enumerate(met.names) if names == (arm.bodies[-1].name, "ball"))
    alone = replace(met, pairs=met.pairs[pair : pair + 1], solid_pairs=met.solid_pairs[met.solid_pairs[:, 0] == pair])
    alone = replace(alone, solid_pairs=np.where(np.arange(3) == 0, 0, alone.solid_pairs))
    assert clearance(alone, q, within=np.inf).distance[0] == pytest.approx(0.3 - 0.1 - 0.05, abs=1e-9)


def test_allowed_contacts_know_bodies_by_their_plain_names() -> None:
    arm = arm_bodies(load_description("kr16-2"))
    every = scene_of(Cell(stands=True), arm)
    fewer = scene_of(Cell(stands=True, allowed_contacts=(("j3", "floor"), (f"j2{ASSUMED}", "floor"))), arm)
    gone = set(every.names) - set(fewer.names)
    assert gone == {(f"j3{ASSUMED}", "floor"), (f"j2{ASSUMED}", "floor")}
    refuses("K001", "names no body", scene_of, Cell(allowed_contacts=(("j9", "floor"),)), arm)


def test_a_radius_of_the_model_counts_below_the_cell_s() -> None:
    described = load_description("kr16-2")
    told = described.model_copy(update={"beam_radius": PositiveLength(value=60, unit="mm", source="assumed")})
    assert parse_description(to_toml(told), "again").beam_radius == told.beam_radius
    assert {s.radius for s in arm_bodies(told).bodies[1].solids} == {0.06}
    assert {s.radius for s in arm_bodies(told, beam_radius=0.04).bodies[1].solids} == {0.04}
    assert scene_of(Cell(tool=Tool()), arm_bodies(told, beam_radius=0.0)).members == ()
