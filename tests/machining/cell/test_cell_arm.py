"""Bodies of arms: casings, imported surfaces, URDF shapes, capsules; and what overlaps at home."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh

from machining.cell import ArmBodies, Body, Cell, Tool, arm_bodies, arm_of, box, scene_of
from machining.cell.solids import all_nodes
from meshes import casing_mesh, link_beam_mesh, save_shell
from robots import load_description, load_robot
from robots.arrays import Array
from robots.library.models import parse_description
from robots.robot import middle_pose, robot_from
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
