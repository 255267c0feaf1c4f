"""Nearest points of two bodies, and how far they reach into each other, against positions that are known."""

from __future__ import annotations

import numpy as np
import pytest
from refusals import refuses
from rigid_frames import rigid_frame

from machining.cell import Body, Cell, Fixture, Scene, Tool, arm_of, box, scene_of, sphere
from machining.cell.nearest import gaps, nearest
from robots.arrays import Array

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
