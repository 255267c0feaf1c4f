"""Bodies of arms: casings, imported surfaces, URDF shapes, capsules; and what overlaps at home."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh
from refusals import refuses
from rigid_frames import rigid_frame

from machining.cell import ArmBodies, Body, Cell, Tool, arm_bodies, arm_of, box, clearance, parse_cell, scene_of, sphere
from machining.cell.assumed_shapes import ASSUMED, INNER, assumed_solids, joint_ways, shoulder_height, stands_on_base
from machining.cell.cell import Fixture
from machining.cell.separation import segment_distance
from machining.cell.solids import all_nodes
from meshes import casing_mesh, link_beam_mesh, save_shell
from robots import forward_kinematics, load_description, load_robot
from robots.arrays import Array
from robots.library.models import library_names, parse_description, to_toml
from robots.robot import middle_pose, robot_from, trial_poses
from robots.schema.description import ModelDescription, Surface
from robots.schema.quantities import PositiveLength

URDF = """<?xml version="1.0"?>
<robot name="two">
  <link name="foot"><collision><geometry><box size="0.2 0.2 0.4"/></geometry>
    <origin xyz="0 0 0.2"/></collision></link>
  <link name="arm"><visual><geometry><mesh filename="arm.stl" scale="0.001 0.001 0.001"/></geometry></visual></link>
  <link name="hand"/>
  <link name="tool0"/>
  <joint name="j1" type="revolute"><parent link="foot"/><child link="arm"/><origin xyz="0 0 0.5"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
  <joint name="j2" type="revolute"><parent link="arm"/><child link="hand"/><origin xyz="0.6 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
  <joint name="f" type="fixed"><parent link="hand"/><child link="tool0"/><origin xyz="0.3 0 0"/></joint>
</robot>"""


def body(arm: ArmBodies, name: str) -> Body:
    return next(b for b in arm.bodies if b.name == name)


def extents(bodies: Body) -> Array:
    nodes = all_nodes(bodies.solids)
    r = max(s.radius for s in bodies.solids)
    return np.stack([nodes.min(axis=0) - r, nodes.max(axis=0) + r])


@pytest.mark.parametrize("model", ["kr60-3", "tx200", "xr701"])
def test_bodies_hold_the_casings_that_shell_links_are_made_of(model: str) -> None:
    description, robot = load_description(model), load_robot(model)
    arm = arm_of(model)
    assert [b.name for b in arm.bodies if b.name not in ("crank", "bar")] == [link.name for link in description.link]
    for link in description.link:
        mesh = casing_mesh(link_beam_mesh(description, robot, link))
        hulls = [trimesh.Trimesh(s.nodes, s.faces) for s in body(arm, link.name).solids]
        held = np.zeros(len(mesh.nodes), dtype=bool)
        for hull in hulls:
            away = np.einsum("mi,nmi->nm", hull.face_normals, mesh.nodes[:, None] - hull.triangles_center)
            held |= (away < 1e-9).all(axis=1)
        if link.name == "carousel" and model == "xr701":
            # Its casing is cut square to a slanting centre line; the body is cut flat across the joint.
            held |= mesh.nodes[:, 2] < 0.0
        assert held.all(), link.name


def test_sections_are_the_outer_ones() -> None:
    arm = arm_of("kr60-3")
    np.testing.assert_allclose(extents(body(arm, "carousel"))[:, 1], [-0.21, 0.21], atol=1e-12)
    np.testing.assert_allclose(extents(body(arm, "pedestal"))[:, 2], [0.0, 0.815], atol=1e-12)
    # A round section is drawn around: 24 sides.
    wrist = all_nodes(body(arm, "wrist").solids)
    np.testing.assert_allclose(np.hypot(wrist[:, 0], wrist[:, 1]), 0.07 / np.cos(np.pi / 24), rtol=1e-12)


def test_crank_and_bar_follow_the_parallelogram(rng: np.random.Generator) -> None:
    arm = arm_of("xr701")
    robot = arm.robot
    p = robot.parallelogram
    assert p is not None
    q = rng.uniform(robot.limits[:, 0], robot.limits[:, 1], (20, robot.dof))
    R, o = arm.frames(q)
    crank, bar = arm.frame[-2:]
    own, driven = p.crank_about + 1, p.driven + 1
    # The bar's far end is the pin of the lever, in every pose.
    lever_pin = o[:, driven] + R[:, driven] @ p.pin
    np.testing.assert_allclose(o[:, bar] + R[:, bar] @ robot.T_pre[p.driven][:3, 3], lever_pin, atol=1e-12)
    np.testing.assert_allclose(o[:, crank], o[:, own])
    length = np.linalg.norm(robot.T_pre[p.driven][:3, 3])
    assert np.linalg.norm(np.ptp(all_nodes(arm.bodies[-1].solids), axis=0)) == pytest.approx(length, rel=0.02)
    names = scene_of(Cell(), arm).names
    assert ("forearm", "crank") in names
    assert ("crank", "bar") not in names
    assert ("forearm", "bar") not in names


def test_urdf_shapes_and_what_is_missing(tmp_path: Path) -> None:
    block = trimesh.creation.box((600, 100, 100)).apply_translation([300, 0, 0])
    trimesh.Trimesh(block.vertices, block.faces[1:]).export(tmp_path / "arm.stl")
    (tmp_path / "two.urdf").write_text(URDF, encoding="utf-8")
    arm = arm_of(tmp_path / "two.urdf")
    assert [b.name for b in arm.bodies] == ["base", "j1", "j2 (assumed shape)"]
    np.testing.assert_allclose(extents(body(arm, "base")), [[-0.1, -0.1, 0], [0.1, 0.1, 0.4]], atol=1e-12)
    np.testing.assert_allclose(extents(body(arm, "j1")), [[0, -0.05, -0.05], [0.6, 0.05, 0.05]], atol=1e-7)
    said = "\n".join(arm.notes)
    assert "body j1: no collision shape, its visual shape is taken" in said
    assert "body j1: the hull of arm.stl is taken (surface of arm.stl is not closed)" in said
    assert "body j2: no shape known, capsules from the kinematics" in said
    wider = arm_of(tmp_path / "two.urdf", beam_radius=0.04)
    np.testing.assert_allclose(
        extents(body(wider, "j2 (assumed shape)")), [[-0.04, -0.04, -0.04], [0.34, 0.04, 0.04]], atol=1e-12
    )
    assert "body j2: no shape known, a capsule of radius 40 mm (as asked for) is taken" in "\n".join(wider.notes)


def without(description: ModelDescription, name: str) -> ModelDescription:
    kept = tuple(link for link in description.link if link.name != name)
    return description.model_copy(update={"link": kept})


def test_a_body_without_a_link_gets_a_capsule() -> None:
    arm = arm_bodies(without(load_description("kr60-3"), "upper-arm"))
    (solid,) = body(arm, "j2").solids
    # As thick as half of the carousel's largest side, along a2.
    assert solid.radius == pytest.approx(0.21)
    np.testing.assert_allclose(solid.nodes, [[0, 0, 0], [0.85, 0, 0]], atol=1e-12)
    assert any("body j2: no shape known, a capsule of radius 210 mm" in note for note in arm.notes)


def test_an_arm_without_any_shape_is_capsules() -> None:
    bare = load_description("kr60-3").model_copy(update={"link": ()})
    arm = arm_bodies(bare)
    names = ("base", "j1", "j2", "j3", "j6")
    assert [b.name for b in arm.bodies] == [f"{name} (assumed shape)" for name in names]
    radii = [max(s.radius for s in b.solids) for b in arm.bodies]
    assert all(a >= b for a, b in pairwise(radii))
    assert {b.solids[0].radius for b in arm_bodies(bare, beam_radius=0.1).bodies} == {0.1}
    assert arm_bodies(bare, beam_radius=0.0).bodies == ()


def test_prepared_surfaces_take_the_casing_s_place(tmp_path: Path) -> None:
    description, robot = load_description("kr60-3"), load_robot("kr60-3")
    links = []
    for link in description.link:
        if link.name == "forearm":
            mesh = casing_mesh(link_beam_mesh(description, robot, link), openings=link.opening)
            path = tmp_path / "forearm.npz"
            size = PositiveLength(value=30, unit="mm", source="assumed")
            surface = Surface(
                file=str(path), sha256=save_shell(mesh, path), wall=link.section.wall, size=size, source="assumed"
            )
            link = link.model_copy(update={"surface": surface})
        links.append(link)
    arm = arm_bodies(description.model_copy(update={"link": tuple(links)}))
    (solid,) = body(arm, "forearm").solids
    # Closed though the casing has rings and an opening; half of the wall is added to the mid-surface.
    assert not solid.convex
    assert solid.radius == pytest.approx(0.006)
    assert arm.notes == ()
    np.testing.assert_allclose(extents(body(arm, "forearm"))[:, 2], [-0.12, 0.12], atol=1e-9)


def test_overlaps_at_home_are_switched_off_and_said() -> None:
    arm = arm_of("kr60-3")
    scene = scene_of(Cell(), arm)
    assert scene.switched_off == (("pedestal", "upper-arm"),)
    assert "pedestal and upper-arm overlap at home: this pair is not checked" in scene.notes
    assert ("pedestal", "upper-arm") not in scene.names
    assert ("carousel", "upper-arm") not in scene.names
    assert ("carousel", "forearm") in scene.names
    # Folded back the arm overlaps more; a user's home pose says what is meant.
    folded = scene_of(Cell(home=np.radians([0, -120, -204, 0, 0, 0])), arm)
    assert ("carousel", "forearm") in folded.switched_off
    # A tool that reaches back over the wrist overlaps the forearm whatever the pose.
    tool = Tool(holder=(Body("back", (box([0.1, 0.1, 0.5]).moved(np.diag([1.0, -1.0, -1.0, 1.0])),)),))
    assert ("forearm", "back") in scene_of(Cell(tool=tool), arm).switched_off


def test_the_middle_pose_keeps_couplings() -> None:
    for model in ("kr60-3", "tx200", "xr701"):
        robot = load_robot(model)
        assert robot.reachable(middle_pose(robot)[None])[0]
    text = """
schema = "stiffarm-model/1"
name = "bound"
title = "two joints whose sum is bound away from the middle"
sources = {}
[[joint]]
name = "a"
coordinate = "a_deg"
limits = { value = [-90, 90], unit = "deg", source = "assumed" }
frame = { xyz = { value = [0, 0, 0], unit = "m", source = "assumed" } }
[[joint]]
name = "b"
coordinate = "b_deg"
limits = { value = [-30, 30], unit = "deg", source = "assumed" }
frame = { xyz = { value = [1, 0, 0], unit = "m", source = "assumed" } }
[flange]
xyz = { value = [1, 0, 0], unit = "m", source = "assumed" }
[[coupling]]
name = "sum_deg"
terms = [{ coordinate = "a_deg", factor = 1 }, { coordinate = "b_deg", factor = 1 }]
limits = { value = [100, 120], unit = "deg", source = "assumed" }
"""
    robot = robot_from(parse_description(text, "bound"))
    assert robot.reachable(middle_pose(robot)[None])[0]


# ------------------------------------------------------------
# Arms without shape: capsules from the kinematics, the plane that they stand on, and what is said of both

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
