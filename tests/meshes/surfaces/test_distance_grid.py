"""Distance fields and their contours against shapes whose distances are known."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from refusals import refuses

from meshes.surfaces.distance_grid import (
    bodies,
    contour,
    distance,
    enclosed,
    grid_around,
    sample,
    signed_volume,
    thinned,
)

STEP_M = 0.02


def sphere(radius: float = 0.2) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=4, radius=radius)


def test_samples_are_no_further_apart_than_asked_and_slivers_cost_little() -> None:
    corners = np.array([[[0.0, 0, 0], [1.0, 0, 0], [0.0, 1.0, 0]], [[0.0, 0, 0], [1.0, 0, 0], [0.5, 1e-4, 0]]])
    points = sample(corners[:1], 0.1)
    inside = np.random.default_rng(0).dirichlet([1, 1, 1], 500) @ corners[0]
    near = np.linalg.norm(inside[:, None] - points, axis=2).min(axis=1)
    assert near.max() < 0.1
    np.testing.assert_allclose([np.abs(points - c).sum(axis=1).min() for c in corners[0]], 0.0, atol=1e-15)
    assert len(sample(corners[1:], 0.1)) < 30  # two rows of eleven, not a field


def test_the_distance_to_a_plane_is_exact_where_asked() -> None:
    plane = np.array([[[-1.0, -1, 0], [1, -1, 0], [0, 1, 0]]])
    grid = grid_around("plane", plane.reshape(-1, 3), 0.1, 0.35)
    field = distance(grid, sample(plane, 0.03), 0.1, 0.25)
    height = np.abs(grid.origin[2] + grid.step * np.arange(grid.shape[2]))
    column = field[grid.shape[0] // 2, grid.shape[1] // 2]
    asked = (height >= 0.1) & (height <= 0.25)
    # Samples 0.03 m apart: too far by up to 0.03^2 / (4 x 0.1) m.
    np.testing.assert_allclose(column[asked], height[asked], atol=0.0023)
    np.testing.assert_allclose(column, height, atol=grid.step)


def test_a_sphere_is_enclosed_and_contoured() -> None:
    ball = sphere()
    grid = grid_around("ball", ball.vertices, STEP_M, 3 * STEP_M)
    inside = enclosed(grid, ball.vertices, ball.faces)
    place = grid.origin + grid.step * np.argwhere(np.ones(grid.shape, dtype=bool))
    radius = np.linalg.norm(place, axis=1).reshape(grid.shape)
    assert inside[radius < 0.199].all()
    assert not inside[radius > 0.2].any()
    nodes, faces = contour(grid, radius - 0.15)
    assert trimesh.Trimesh(nodes, faces, process=False).is_watertight
    # A chord across a cell sags by up to 3 step^2 / 8 R, 1 mm; the volume is smaller by thrice that share at most.
    assert signed_volume(nodes, faces) == pytest.approx(4 / 3 * np.pi * 0.15**3, rel=0.02)
    assert np.abs(np.linalg.norm(nodes, axis=1) - 0.15).max() < STEP_M**2 / (8 * 0.15) + 1e-6


def test_a_contour_never_ends_at_the_grid() -> None:
    grid = grid_around("ball", sphere().vertices, STEP_M, STEP_M)
    with pytest.raises(ValueError, match="boundary"):
        contour(grid, -np.ones(grid.shape))
    nodes, faces = contour(grid, np.ones(grid.shape))
    assert len(nodes) == len(faces) == 0


def test_grids_too_large_are_refused() -> None:
    refuses("L005", "stray parts", grid_around, "far", np.array([[0.0, 0, 0], [100.0, 100, 100]]), STEP_M, 0.1)


def test_bodies_come_by_area() -> None:
    small = sphere(0.05).apply_translation([1.0, 0, 0])
    both = trimesh.util.concatenate([small, sphere()])
    found = bodies(np.asarray(both.vertices), np.asarray(both.faces))
    assert [round(signed_volume(*body), 4) for body in found] == [0.0334, 0.0005]


def test_thinning_keeps_a_surface_closed_and_its_volume() -> None:
    ball = sphere()
    nodes, faces = np.asarray(ball.vertices), np.asarray(ball.faces)
    less = thinned(nodes, faces, 1000)
    assert less is not None
    assert len(less[1]) < 1100
    assert trimesh.Trimesh(*less, process=False).is_watertight
    assert signed_volume(*less) == pytest.approx(signed_volume(nodes, faces), rel=0.01)
    assert thinned(nodes, faces, len(faces)) is None
