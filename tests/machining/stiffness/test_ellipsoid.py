"""The force-stiffness ellipsoid: known ellipsoids, its equation, and arms with rigid directions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from refusals import refuses

from machining import ellipsoid_radius, stiffness_ellipsoid
from robots.arrays import Array


@pytest.fixture
def compliances(rng: np.random.Generator) -> Array:
    """Twenty symmetric positive compliances with stiffnesses from 1e5 to 1e7 N/m."""
    Q, _ = np.linalg.qr(rng.normal(size=(20, 3, 3)))
    return np.asarray((Q * 10.0 ** -rng.uniform(5.0, 7.0, (20, 1, 3))) @ np.swapaxes(Q, 1, 2))


def test_known_axes(rotation: Array) -> None:
    C = rotation @ np.diag([1 / 5e5, 1 / 2e5, 1 / 8e5]) @ rotation.T
    e = stiffness_ellipsoid(C[None])
    np.testing.assert_allclose(e.semi_axes[0], [2e5, 5e5, 8e5], rtol=1e-13)
    for axis, column in zip((1, 0, 2), range(3), strict=True):
        assert abs(rotation[:, axis] @ e.axes[0, :, column]) == pytest.approx(1.0, abs=1e-13)
    assert abs(e.axes[0, :, 0] @ rotation[:, 1]) == pytest.approx(1.0, abs=1e-13)
    assert abs(e.axes[0, :, 2] @ rotation[:, 2]) == pytest.approx(1.0, abs=1e-13)
    assert e.weakest[0] == pytest.approx(2e5)
    assert e.strongest[0] == pytest.approx(8e5)
    assert e.isotropy[0] == pytest.approx(0.25)
    assert e.mean[0] == pytest.approx((2e5 * 5e5 * 8e5) ** (1 / 3))
    assert e.volume[0] == pytest.approx(4 / 3 * math.pi * 8e16)


def test_a_sphere_is_isotropic() -> None:
    e = stiffness_ellipsoid(1e-6 * np.eye(3)[None])
    assert e.isotropy[0] == pytest.approx(1.0)
    assert e.weakest[0] == e.strongest[0] == pytest.approx(1e6)


def test_surface_solves_equation_9(compliances: Array) -> None:
    e = stiffness_ellipsoid(compliances)
    F = e.surface(7)
    assert F.shape == (25, 49, 3)
    d = np.einsum("ij,abj->abi", compliances[7], F)
    np.testing.assert_allclose(np.linalg.norm(d, axis=-1), 1.0, rtol=1e-12)


def test_radius_is_the_length_to_the_surface(compliances: Array, rng: np.random.Generator) -> None:
    n = rng.normal(size=(20, 3))
    radius = ellipsoid_radius(compliances, 1e200 * n)
    unit = n / np.linalg.norm(n, axis=1, keepdims=True)
    d = np.einsum("nij,nj->ni", compliances, radius[:, None] * unit)
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1.0, rtol=1e-12)
    e = stiffness_ellipsoid(compliances)
    assert (radius >= e.weakest * (1 - 1e-12)).all()
    assert (radius <= e.strongest * (1 + 1e-12)).all()
    np.testing.assert_allclose(ellipsoid_radius(compliances, e.axes[:, :, 0]), e.weakest, rtol=1e-12)
    # The stiffest direction is the smallest singular value, down by 100.
    np.testing.assert_allclose(ellipsoid_radius(compliances, e.axes[:, :, 2]), e.strongest, rtol=1e-12)


def test_unsymmetric_compliance_by_its_own_equation(compliances: Array, rng: np.random.Generator) -> None:
    C = compliances[:1] + 2e-7 * rng.normal(size=(1, 3, 3))
    d = np.einsum("ij,abj->abi", C[0], stiffness_ellipsoid(C).surface(0))
    np.testing.assert_allclose(np.linalg.norm(d, axis=-1), 1.0, rtol=1e-11)


def test_a_rigid_direction_is_infinite(rotation: Array) -> None:
    C = (rotation @ np.diag([1e-6, 2e-6, 0.0]) @ rotation.T)[None]
    e = stiffness_ellipsoid(C)
    assert np.isinf(e.strongest[0])
    assert np.isinf(e.mean[0])
    assert np.isinf(e.volume[0])
    assert e.isotropy[0] == 0.0
    assert e.weakest[0] == pytest.approx(5e5)
    assert abs(e.axes[0, :, 2] @ rotation[:, 2]) == pytest.approx(1.0, abs=1e-9)
    refuses("M005", r"pose 0.*finite semi-axes", e.surface, 0)
    assert ellipsoid_radius(np.diag([1e-6, 1e-6, 0.0])[None], [0, 0, 1])[0] == np.inf


def test_an_arm_in_which_nothing_gives_way_is_refused() -> None:
    refuses("M005", "pose 1: nothing deflects", stiffness_ellipsoid, np.stack([np.eye(3), np.zeros((3, 3))]))


def test_no_poses() -> None:
    assert stiffness_ellipsoid(np.empty((0, 3, 3))).semi_axes.shape == (0, 3)
