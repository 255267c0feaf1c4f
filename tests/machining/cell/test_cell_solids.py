"""Solids, bounds and exact distances of the cell against closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refuses
from rigid_frames import rigid_frame
from scipy.spatial.transform import Rotation

from machining.cell import (
    Body,
    Cell,
    Fixture,
    Scene,
    Solid,
    Tool,
    arm_of,
    box,
    capsule,
    cylinder,
    hull,
    mesh_file,
    scene_of,
    sphere,
    surface,
)
from machining.cell.nearest import gaps, nearest
from machining.cell.separation import OVERLAP, ExactSolid, bounds_of, box_gaps, exact_distance, sphere_gaps
from machining.cell.solids import inside
from robots.arrays import Array, Integers


def apart(a: Solid, b: Solid, t: Array, R: Array | None = None, below: float = np.inf) -> float:
    place = np.eye(3) if R is None else R
    return exact_distance(ExactSolid(a), ExactSolid(b), place, np.asarray(t, dtype=np.float64), below)


def tube_surface() -> trimesh.Trimesh:
    """A closed ring: inner radius 0.3, outer 0.5, from z = 0 to 0.4; not convex."""
    mesh: trimesh.Trimesh = trimesh.creation.annulus(0.3, 0.5, 0.4, sections=96)
    mesh.apply_translation([0, 0, 0.2 - mesh.bounds.mean(axis=0)[2]])
    return mesh


def shell_surface() -> tuple[Array, Integers]:
    """A box of 1 m with a cavity of 0.6 m: two surfaces, the inner one facing inward."""
    outer, inner = trimesh.creation.box((1, 1, 1)), trimesh.creation.box((0.6, 0.6, 0.6))
    nodes = np.vstack([outer.vertices, inner.vertices])
    return nodes, np.vstack([outer.faces, inner.faces[:, ::-1] + len(outer.vertices)])


def test_spheres_capsules_boxes_by_hand() -> None:
    assert apart(sphere(0.1), sphere(0.2), [1.0, 2.0, 2.0]) == pytest.approx(3.0 - 0.3, abs=1e-12)
    rod = capsule([0, 0, 0], [0, 0, 1], 0.05)
    assert apart(rod, sphere(0.1), [0.3, 0.4, 0.5]) == pytest.approx(0.5 - 0.15, abs=1e-12)
    assert apart(rod, sphere(0.1), [0.3, 0.4, 2.2]) == pytest.approx(1.3 - 0.15, abs=1e-12)
    # Two crossed rods: the way between the lines is along y.
    other = capsule([-1, 0, 0], [1, 0, 0], 0.02)
    assert apart(rod, other, [0.1, 0.7, 0.4]) == pytest.approx(0.7 - 0.07, abs=1e-12)
    # The boxes stand on z = 0; corner to corner 0.3, 0.4, 1.2 away.
    assert apart(box([1, 1, 1]), box([1, 1, 1]), [1.3, 1.4, 2.2]) == pytest.approx(1.3, abs=1e-12)
    # A box turned by 45 degrees points an edge at the other's face.
    turned = Rotation.from_euler("z", 45, degrees=True).as_matrix()
    assert apart(box([1, 1, 1]), box([1, 1, 1]), [2, 0, 0], turned) == pytest.approx(1.5 - np.sqrt(0.5), abs=1e-12)
    assert apart(sphere(0.1), box([1, 1, 1]), [0.3, 0.9, 0.2]) == pytest.approx(np.sqrt(0.2) - 0.1, abs=1e-12)


def test_aligned_bodies_where_the_search_for_hulls_stops_early() -> None:
    # On this grid FCL's own distance of a point and a box is too large at 500 of 9000 places, by up to 1 m.
    block, point = ExactSolid(box([1, 1, 1])), ExactSolid(sphere(0.01))
    grid = np.stack(np.meshgrid(*[np.arange(0.0, 2.05, 0.1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    corner = np.array([0.5, 0.5, 1.0])
    expected = np.linalg.norm(np.maximum(grid - corner, 0.0), axis=1) - 0.01
    found = np.array([exact_distance(block, point, np.eye(3), t, np.inf) for t in grid])
    clear = expected > 1e-9
    np.testing.assert_allclose(found[clear], expected[clear], rtol=0.0, atol=1e-7)
    assert (found[~clear] == OVERLAP).all()


def test_cylinders_hold_the_round_ones_and_little_more() -> None:
    for angle in np.linspace(0.0, 0.1, 7):
        way = np.array([np.cos(angle), np.sin(angle), 0.0])
        gap = apart(cylinder(0.5, 1.0), sphere(0.1), 2.0 * way + [0, 0, 0.5])
        # Never farther than the round cylinder; nearer by the corners' 1 / cos(pi / 64) - 1 = 0.12 % at most.
        assert 1.4 - 0.5 * 0.00121 <= gap <= 1.4 + 1e-12


def test_a_wide_ring_not_its_hull_counts() -> None:
    mesh = tube_surface()
    ring = surface("ring", mesh.vertices, mesh.faces)
    assert not ring.convex
    # In the hole: from the faces of the polygon with 96 sides, cos(pi / 96) of the radius away.
    expected = 0.3 * np.cos(np.pi / 96) - 0.1
    assert apart(ring, sphere(0.1), [0, 0, 0.2]) == pytest.approx(expected, abs=1e-4)
    assert apart(ring, sphere(0.1), [0.4, 0, 0.2]) == OVERLAP
    assert apart(ring, sphere(0.1), [0.22, 0, 0.2]) == OVERLAP


@pytest.mark.parametrize("small", [sphere(0.02), box([0.04, 0.04, 0.04]), capsule([0, 0, 0], [0.02, 0, 0], 0.01)])
def test_a_body_inside_another_overlaps_it(small: Solid) -> None:
    mesh = tube_surface()
    ring = surface("ring", mesh.vertices, mesh.faces)
    big = box([1, 1, 1])
    for a, b, t in ((big, small, [0, 0, 0.5]), (small, big, [0, 0, -0.5]), (ring, small, [0.4, 0, 0.2])):
        assert apart(a, b, np.array(t)) == OVERLAP
    # Both surfaces not convex, one wholly in the other's wall: no surface touches.
    tiny = surface("tiny", 0.05 * mesh.vertices, mesh.faces)
    assert not tiny.convex
    assert apart(ring, tiny, np.array([0.4, 0, 0.2])) == OVERLAP
    assert apart(tiny, ring, np.array([-0.4, 0, -0.2])) == OVERLAP
    assert apart(ring, tiny, np.array([0.0, 0, 0.2])) > 0.2


def test_a_cavity_is_free_space() -> None:
    shell = surface("shell", *shell_surface())
    assert apart(shell, sphere(0.1), np.zeros(3)) == pytest.approx(0.2, abs=1e-12)
    assert apart(shell, sphere(0.05), np.array([0.4, 0, 0])) == OVERLAP
    assert not inside(np.zeros(3), shell)
    assert inside(np.array([0.4, 0.1, 0.0]), shell)
    assert not inside(np.array([0.6, 0.0, 0.0]), shell)


def test_below_clips_and_leaves_near_ones_alone() -> None:
    mesh = tube_surface()
    ring = surface("ring", mesh.vertices, mesh.faces)
    for a in (ring, box([1, 1, 0.4])):
        whole = apart(a, sphere(0.1), np.array([0.8, 0, 0.2]))
        assert apart(a, sphere(0.1), np.array([0.8, 0, 0.2]), below=0.05) == 0.05
        assert apart(a, sphere(0.1), np.array([0.8, 0, 0.2]), below=1.0) == whole


def test_below_counts_from_rounded_surfaces() -> None:
    mesh = tube_surface()
    ring = surface("ring", mesh.vertices, mesh.faces, 0.03)
    whole = apart(ring, sphere(0.1), np.array([0.8, 0, 0.2]))
    assert apart(ring, sphere(0.1), np.array([0.8, 0, 0.2]), below=whole + 0.01) == whole


def test_rounded_surfaces_and_hulls() -> None:
    mesh = tube_surface()
    round_ring = surface("ring", mesh.vertices, mesh.faces, 0.03)
    sharp_ring = surface("ring", mesh.vertices, mesh.faces)
    t = np.array([0.9, 0.1, 0.6])
    assert apart(round_ring, sphere(0.1), t) == pytest.approx(apart(sharp_ring, sphere(0.1), t) - 0.03, abs=1e-12)
    block = hull(box([1, 1, 1]).nodes, 0.1)
    assert apart(block, sphere(0.1), np.array([1.0, 0, 0.5])) == pytest.approx(0.3, abs=1e-12)


def some_solids() -> list[Solid]:
    rng = np.random.default_rng(5)
    mesh = tube_surface()
    return [
        box([0.5, 0.3, 0.8]),
        cylinder(0.1, 0.6),
        sphere(0.2),
        capsule([0, 0, 0], [0.3, 0.2, 0.5], 0.05),
        hull(rng.normal(size=(30, 3)) * [0.1, 0.2, 0.4]),
        surface("ring", 0.5 * mesh.vertices, mesh.faces),
    ]


SOLIDS = some_solids()
EXACT = [ExactSolid(solid) for solid in SOLIDS]
BOUNDS = [bounds_of(solid) for solid in SOLIDS]
numbers = st.floats(-1.0, 1.0, allow_nan=False)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(
    st.integers(0, len(SOLIDS) - 1),
    st.integers(0, len(SOLIDS) - 1),
    st.tuples(*[numbers] * 3),
    st.tuples(*[st.sampled_from([0.0, 1e-9, 1e-6, 0.5, np.pi / 2]) | numbers] * 3),
)
def test_bounds_are_never_above_the_distance(i: int, j: int, t: Array, turn: Array) -> None:
    a, b = BOUNDS[i], BOUNDS[j]
    R, t = Rotation.from_rotvec(np.asarray(turn)).as_matrix(), np.asarray(t)
    middle = R @ b.middle + t
    distance = exact_distance(EXACT[i], EXACT[j], R, t, np.inf)
    spheres = sphere_gaps(a.middle, a.radius, middle, b.radius)
    boxes = box_gaps((a.R.T @ R @ b.R)[None], (a.R.T @ (middle - a.middle))[None], a.half[None], b.half[None])[0]
    assert max(float(spheres), float(boxes)) <= max(distance, 0.0)


def test_the_box_bound_is_the_distance_of_facing_boxes_and_crossed_edges() -> None:
    half = np.full((1, 3), 0.5)
    assert box_gaps(np.eye(3)[None], np.array([[1.7, 0.2, 0.1]]), half, half)[0] == pytest.approx(0.7, abs=1e-8)
    # An edge across another: only the axis across both edges shows the gap.
    R = Rotation.from_euler("x", 45, degrees=True).as_matrix() @ Rotation.from_euler("z", 45, degrees=True).as_matrix()
    S = Rotation.from_euler("y", 45, degrees=True).as_matrix()
    way = np.cross(S[:, 1], R[:, 2])
    gap = box_gaps((S.T @ R)[None], (S.T @ way * 2.5)[None], half, half)[0]
    faces_only = max(
        (np.abs(S.T @ way * 2.5) - 0.5 - 0.5 * np.abs(S.T @ R).sum(axis=1)).max(),
        (np.abs(R.T @ way * 2.5) - 0.5 - 0.5 * np.abs(S.T @ R).sum(axis=0)).max(),
    )
    assert gap > faces_only + 0.01


def test_bounds_hold_all_nodes() -> None:
    for solid, bound in zip(SOLIDS, BOUNDS, strict=True):
        assert (np.linalg.norm(solid.nodes - bound.middle, axis=1) + solid.radius <= bound.radius + 1e-12).all()
        assert (np.abs((solid.nodes - bound.middle) @ bound.R) + solid.radius <= bound.half + 1e-12).all()
        np.testing.assert_allclose(bound.R.T @ bound.R, np.eye(3), atol=1e-12)


def test_moved_solids_keep_their_distances(rotation: Array) -> None:
    T = rigid_frame([0.3, -2.0, 1.0], rotation)
    for a, b in ((0, 1), (3, 5), (5, 4)):
        t = np.array([0.9, 0.8, 0.1])
        moved = exact_distance(
            ExactSolid(SOLIDS[a].moved(T)), ExactSolid(SOLIDS[b].moved(T)), np.eye(3), rotation @ t, np.inf
        )
        assert moved == pytest.approx(exact_distance(EXACT[a], EXACT[b], np.eye(3), t, np.inf), abs=1e-9)


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1e-3), ("m", 1.0)])
def test_mesh_files_have_their_unit(tmp_path: Path, unit: str, factor: float) -> None:
    trimesh.creation.box((2, 2, 2)).export(tmp_path / "block.stl")
    solid = mesh_file(tmp_path / "block.stl", unit)
    assert solid.convex
    np.testing.assert_allclose(np.ptp(solid.nodes, axis=0), 2.0 * factor, rtol=1e-6)


def test_overlapping_parts_are_not_their_hull() -> None:
    # The parts of the L share so much that their volumes add up to more than the hull's.
    a, b = (
        trimesh.creation.box((1.0, 0.8, 1.0)),
        trimesh.creation.box((0.8, 1.0, 1.0)).apply_translation([-0.11, 0.1, 0]),
    )
    both = trimesh.util.concatenate([a, b])
    solid = surface("L", both.vertices, both.faces)
    assert not solid.convex
    assert len(solid.seeds) == 2
    ball = sphere(0.01)
    assert apart(solid, ball, np.array([0.4, 0.5, 0.0])) == pytest.approx(0.09, abs=1e-9)
    assert apart(solid, ball, np.zeros(3)) == OVERLAP


def test_faces_wound_inward_are_turned() -> None:
    mesh = tube_surface()
    ring = surface("ring", mesh.vertices, mesh.faces[:, ::-1])
    assert inside(np.array([0.4, 0, 0.2]), ring)


def test_bad_solids_are_refused(tmp_path: Path) -> None:
    open_box = trimesh.creation.box((1, 1, 1))
    trimesh.Trimesh(open_box.vertices, open_box.faces[1:]).export(tmp_path / "open.stl")
    refuses("L003", r"open.stl is not closed: got '3 open edges'", mesh_file, tmp_path / "open.stl", "m")
    refuses("L001", r"unit of open.stl: got 'inch'; allowed: mm or m", mesh_file, tmp_path / "open.stl", "inch")
    refuses("F001", r"surface file .* does not exist", mesh_file, tmp_path / "none.stl", "mm")
    # Two boxes that share an edge.
    pair = trimesh.util.concatenate([open_box, open_box.copy().apply_translation([1, 1, 0])])
    refuses(
        "L003",
        "surface of pair is not closed: got 'edges with more than two faces'",
        surface,
        "pair",
        pair.vertices,
        pair.faces,
    )
    for make in (
        lambda: sphere(0.0),
        lambda: box([1, 1, -1]),
        lambda: cylinder(1.0, np.nan),
        lambda: capsule([0, 0, 0], [0, 0, 0], 0.1),
        lambda: hull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]),
        lambda: surface("x", [[0, 0, 0]], [[0, 0, 1]]),
    ):
        refuses("K002", "", make)


# ------------------------------------------------------------
# Nearest points of two bodies, and how far they reach into each other, against positions that are known

ARM = arm_of("kr60-3")
Q = np.zeros(ARM.robot.dof)


def scene_with(*solids: tuple[str, Body], floor: float | None = None) -> Scene:
    """The arm's base and fixtures at fixed places."""
    return scene_of(Cell(fixtures=tuple(Fixture(body) for _, body in solids), floor=floor), ARM)


def put(body: Body, x: float, y: float, z: float) -> Body:
    T = rigid_frame((x, y, z))
    return body.moved(T)


def pose_of(scene: Scene) -> tuple[Array, Array, float]:
    return Q, np.zeros(len(scene.cell.linear_axes)), 0.0


@pytest.mark.parametrize(("x", "gap"), [(0.15, 0.05), (0.09, -0.01), (0.02, -0.08)])
def test_boxes_and_their_shift(x: float, gap: float) -> None:
    a, b = Body("a", (box([0.1, 0.1, 0.1]),)), put(Body("b", (box([0.1, 0.1, 0.1]),)), x, 0.0, 0.0)
    scene = scene_with(("a", put(a, 0.0, 0.0, 0.0)), ("b", b))
    found = nearest(scene, ("a", "b"), *pose_of(scene))
    assert found.gap == pytest.approx(gap, abs=1e-9)
    if gap > 0.0:
        np.testing.assert_allclose(found.points[:, 0], [0.05, x - 0.05], atol=1e-9)
    else:
        # The middle of what they share, and the shift parts them.
        assert x - 0.05 - 1e-9 <= found.points[0, 0] <= 0.05 + 1e-9
        parted = scene_with(("a", a), ("b", put(b, -gap + 1e-6, 0.0, 0.0)))
        assert nearest(parted, ("a", "b"), *pose_of(parted)).gap > 0.0


def test_spheres_are_rounded_points() -> None:
    a, b = put(Body("a", (sphere(0.05),)), 0.0, 0.0, 1.0), put(Body("b", (sphere(0.02),)), 0.0, 0.1, 1.0)
    scene = scene_with(("a", a), ("b", b))
    found = nearest(scene, ("a", "b"), *pose_of(scene))
    assert found.gap == pytest.approx(0.03, abs=1e-9)
    np.testing.assert_allclose(found.points, [[0.0, 0.05, 1.0], [0.0, 0.08, 1.0]], atol=1e-9)
    touching = scene_with(("a", a), ("b", put(b, 0.0, -0.04, 0.0)))
    assert nearest(touching, ("a", "b"), *pose_of(touching)).gap == pytest.approx(-0.01, abs=1e-9)


def test_the_floor_is_under_the_lowest_point() -> None:
    tool = Tool(holder=(put(Body("ball", (sphere(0.04),)), 0.0, 0.0, 0.1),))
    scene = scene_of(Cell(tool=tool, floor=-0.2), ARM)
    q = np.radians([[0.0, -60.0, 40.0, 0.0, 30.0, 0.0], [10.0, -40.0, 30.0, 0.0, 20.0, 0.0]])
    R, p = scene.frames(q)
    lowest = (p[:, ARM.flange] + 0.1 * R[:, ARM.flange, :, 2])[:, 2] - 0.04
    seen = gaps(scene, ("ball", "floor"), q, np.zeros((2, 0)), np.zeros(2))
    np.testing.assert_allclose(seen, lowest + 0.2, atol=1e-12)
    found = nearest(scene, ("ball", "floor"), q[0], np.zeros(0), 0.0)
    assert found.points[1, 2] == pytest.approx(-0.2)


def test_an_unknown_body_is_named() -> None:
    scene = scene_with(("a", Body("a", (sphere(0.05),))))
    refuses("K001", "nobody", nearest, scene, ("a", "nobody"), *pose_of(scene))
