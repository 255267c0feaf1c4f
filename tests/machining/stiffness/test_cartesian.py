"""Compliance and stiffness at the tool: equations 2 to 4, other points and axes, and pinocchio."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import oracles
import pytest
from refusals import refuses

import fem
import robots
from machining import (
    INDICES,
    blocks,
    cartesian_stiffness,
    ellipsoid_radius,
    evaluate,
    in_axes,
    moved,
    softest_share,
    spring_jacobian,
    stiffness_ellipsoid,
    stiffness_index,
    translational,
)
from robots import forward_kinematics, jacobian
from robots.arrays import Array


def springs_of(model: fem.ArmModel) -> Array:
    return np.array([1.0 / joint.axial.compliance(np.zeros((1, model.robot.dof)))[0] for joint in model.joints])


def test_rigid_links_give_equation_3(kr60: fem.ArmModel, poses: Callable[..., Array], rng: np.random.Generator) -> None:
    q, point = poses(kr60.robot, 50, rng), np.array([0.1, -0.05, 0.2])
    J = jacobian(kr60.robot, q, point)
    expected = J @ np.diag(1.0 / springs_of(kr60)) @ np.swapaxes(J, 1, 2)
    C = fem.compliance(kr60, q, point)
    # Sums of six products.
    np.testing.assert_allclose(C, expected, rtol=0, atol=1e-13 * np.abs(expected).max())
    parts = blocks(C)
    np.testing.assert_array_equal(np.block([[parts.tt, parts.tr], [parts.rt, parts.rr]]), C)
    np.testing.assert_array_equal(translational(kr60, q, point), parts.tt)


@pytest.mark.parametrize("path", ["serial", "parallelogram"])
def test_spring_jacobian_gives_the_compliance(
    path: robots.LoadPath, poses: Callable[..., Array], rng: np.random.Generator
) -> None:
    """Also with a parallelogram, where joint 2's spring does not carry the forearm's moment."""
    model = fem.build_model(robots.load_description("xr701"), links="rigid", load_path=path)
    k = dict(zip(model.robot.joint_names, 10.0 ** rng.uniform(5, 6.5, 6), strict=True))
    model = model.with_springs({name: float(value) for name, value in k.items()})
    q, point = poses(model.robot, 30, rng), np.array([0.05, 0.02, 0.1])
    J = spring_jacobian(model, q, point)
    expected = J @ np.diag(1.0 / springs_of(model)) @ np.swapaxes(J, 1, 2)
    # The bar's force is found by a division by the sine of an angle of some degrees.
    np.testing.assert_allclose(fem.compliance(model, q, point), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_planar_arm_by_hand(planar: Callable[..., fem.ArmModel]) -> None:
    l1, l2, k1, k2, q1, q2 = 0.9, 0.7, 3e4, 1e4, 0.3, -0.8
    s1, c1, s12, c12 = math.sin(q1), math.cos(q1), math.sin(q1 + q2), math.cos(q1 + q2)
    x1, x2, y1, y2 = l1 * c1 + l2 * c12, l2 * c12, l1 * s1 + l2 * s12, l2 * s12
    cxx, cyy, cxy = y1**2 / k1 + y2**2 / k2, x1**2 / k1 + x2**2 / k2, -x1 * y1 / k1 - x2 * y2 / k2
    C = translational(planar(l1, l2, k1, k2), np.array([[q1, q2]]))
    np.testing.assert_allclose(C[0], [[cxx, cxy, 0], [cxy, cyy, 0], [0, 0, 0]], rtol=0, atol=1e-12 * cyy)
    by_hand = {
        "k_fs": 1.0 / math.hypot(cxy, cyy),
        "directional": 1.0 / cyy,
        "nspi": math.hypot(3.0, 4.0) / abs(3.0 * cxy + 4.0 * cyy),
        "rayleigh": math.hypot(3.0, 4.0) / math.hypot(3.0 * cxx + 4.0 * cxy, 3.0 * cxy + 4.0 * cyy),
        "weakest": 1.0 / ((cxx + cyy) / 2 + math.hypot((cxx - cyy) / 2, cxy)),
        "strongest": math.inf,
        "isotropy": 0.0,
        "mean": math.inf,
        "average": 3.0 / (cxx + cyy),
    }
    assert set(by_hand) == set(INDICES)
    for name, value in by_hand.items():
        found = evaluate(name, C, np.array([0.0, 2.0, 0.0]), np.array([3.0, 4.0, 0.0]))
        np.testing.assert_allclose(found, [value], rtol=1e-12, err_msg=name)


def pinocchio_arm(pin: Any, name: str, point: Array) -> tuple[Any, int]:
    """A bundled arm with Denavit-Hartenberg joints as pinocchio model, with the id of a frame at the tool point."""
    description, model, parent = robots.load_description(name), pin.Model(), 0
    for joint in description.joint:
        assert joint.dh is not None
        turn = pin.SE3(pin.rpy.rpyToMatrix(joint.dh.alpha.si, 0.0, 0.0), np.zeros(3))
        shift = pin.SE3(np.eye(3), np.array([joint.dh.a.si, 0.0, 0.0]))
        rise = pin.SE3(np.eye(3), np.array([0.0, 0.0, joint.dh.d.si]))
        parent = model.addJoint(parent, pin.JointModelRZ(), turn * shift * rise, joint.name)
    at = pin.SE3(np.eye(3), description.flange.xyz.si_array + point)
    return model, model.addFrame(pin.Frame("tool", parent, 0, at, pin.FrameType.OP_FRAME))


@pytest.mark.oracle
def test_jacobians_and_indices_equal_pinocchios(
    kr60: fem.ArmModel, poses: Callable[..., Array], rng: np.random.Generator
) -> None:
    """The indices by their formulas, one pose at a time, on pinocchio's Jacobian."""
    pin = oracles.load("pinocchio")
    point = np.array([0.15, -0.04, 0.23])
    model, frame = pinocchio_arm(pin, "kr60-3", point)
    data, C_theta = model.createData(), np.diag(1.0 / springs_of(kr60))
    q, F = poses(kr60.robot, 200, rng), np.array([200.0, 200.0, 200.0])
    normals = rng.normal(size=(len(q), 3))
    C_tt, J = translational(kr60, q, point), jacobian(kr60.robot, q, point)
    fast = stiffness_index(kr60, q, normals, point)
    found = {name: evaluate(name, C_tt, normals, F) for name in ("k_fs", "nspi", "rayleigh", "directional")}
    for i, pose in enumerate(q):
        pin.computeJointJacobians(model, data, pose)
        pin.updateFramePlacements(model, data)
        expected = pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        # Lengths near 3 m and some 20 products: round-off is 1e-14.
        np.testing.assert_allclose(J[i], expected, rtol=0, atol=1e-12)
        C, n = (expected @ C_theta @ expected.T)[:3, :3], normals[i] / np.linalg.norm(normals[i])
        d = C @ F
        # C's entries are exact to 1e-15 of the largest; k_fs and the others divide by small ones now and then.
        assert fast[i] == pytest.approx(1.0 / np.linalg.norm(C @ n), rel=1e-12)
        assert found["k_fs"][i] == pytest.approx(1.0 / np.linalg.norm(C @ n), rel=1e-12)
        assert found["directional"][i] == pytest.approx(1.0 / (n @ C @ n), rel=1e-11)
        assert found["rayleigh"][i] == pytest.approx(np.linalg.norm(F) / np.linalg.norm(d), rel=1e-12)
        assert found["nspi"][i] == pytest.approx(np.sqrt(F @ F / (n @ d) ** 2), rel=1e-9)


@pytest.mark.parametrize("links", ["rigid", "beam"])
def test_moved_equals_the_compliance_at_that_point(
    links: fem.LinkKind, poses: Callable[..., Array], rng: np.random.Generator
) -> None:
    model = fem.build_model(robots.load_description("kr60-3"), links=links)
    q, point = poses(model.robot, 20, rng), np.array([0.1, -0.3, 0.2])
    lever = forward_kinematics(model.robot, q).R_flange @ point
    expected = fem.compliance(model, q, point)
    np.testing.assert_allclose(moved(fem.compliance(model, q), lever), expected, rtol=0, atol=1e-13)


def test_in_axes_equals_the_arm_on_a_turned_base(
    kr60: fem.ArmModel, poses: Callable[..., Array], turned_base: Callable[..., fem.ArmModel], rotation: Array
) -> None:
    q = poses(kr60.robot, 20, np.random.default_rng(1))
    C = fem.compliance(kr60, q)
    turned = fem.compliance(turned_base(kr60, rotation), q)
    np.testing.assert_allclose(in_axes(turned, rotation), C, rtol=0, atol=1e-13 * np.abs(C).max())
    R_flange = forward_kinematics(kr60.robot, q).R_flange
    back = in_axes(in_axes(C, R_flange), np.swapaxes(R_flange, 1, 2))
    np.testing.assert_allclose(back, C, rtol=0, atol=1e-13 * np.abs(C).max())


def test_stiffness_is_equation_2(kr60: fem.ArmModel, poses: Callable[..., Array]) -> None:
    q = poses(kr60.robot, 20, np.random.default_rng(2))
    J_inv = np.linalg.inv(jacobian(kr60.robot, q))
    expected = np.swapaxes(J_inv, 1, 2) @ np.diag(springs_of(kr60)) @ J_inv
    size = np.abs(expected).max(axis=(1, 2), keepdims=True)
    # Two inverses of matrices with condition numbers up to 1e6 between them.
    np.testing.assert_allclose(cartesian_stiffness(kr60, q) / size, expected / size, rtol=0, atol=1e-8)


def test_beam_links_soften(kr60: fem.ArmModel, poses: Callable[..., Array], rng: np.random.Generator) -> None:
    beam = fem.build_model(robots.load_description("kr60-3"), links="beam")
    q, normal = poses(kr60.robot, 20, rng), np.array([0.0, 0.0, 1.0])
    assert (evaluate("directional", translational(beam, q), normal) < stiffness_of(kr60, q, normal)).all()


def stiffness_of(model: fem.ArmModel, q: Array, normal: Array) -> Array:
    return evaluate("directional", translational(model, q), normal)


def test_the_load_hardly_matters_for_the_kr60(
    kr60: fem.ArmModel, poses: Callable[..., Array], rng: np.random.Generator
) -> None:
    """The paper leaves K_C out; under its 200 N the springs lose less than 3 % in any direction."""
    F = np.array([200.0, 200.0, 200.0, 0.0, 0.0, 0.0])
    share = softest_share(kr60, poses(kr60.robot, 2000, rng), F, np.array([0.0, 0.0, 0.15]))
    assert 1e-4 < share.max() < 0.03


def test_a_singular_pose_has_no_stiffness_and_says_so(kr60: fem.ArmModel) -> None:
    q = np.radians([[10.0, -60.0, 40.0, 20.0, 50.0, 0.0], [10.0, -60.0, 40.0, 20.0, 0.0, 0.0]])
    refuses("M005", r"pose 1 \(1 of 2 poses\).*singular poses", cartesian_stiffness, kr60, q)
    assert np.isfinite(stiffness_index(kr60, q, np.array([0.0, 0.0, 1.0]))).all()


def test_an_arm_of_two_joints_has_no_stiffness_matrix(planar: Callable[..., fem.ArmModel]) -> None:
    refuses(
        "M005",
        "no direction in which the tool is rigid",
        cartesian_stiffness,
        planar(1.0, 1.0, 1e4, 1e4),
        np.array([[0.1, 0.5]]),
    )


@pytest.mark.parametrize("bad", [np.zeros((3, 3)), np.zeros((2, 6, 5)), np.zeros(6)])
def test_compliances_of_another_shape_are_refused(bad: Array) -> None:
    for function in (blocks, lambda C: moved(C, np.zeros(3)), lambda C: in_axes(C, np.eye(3))):
        refuses("B001", r"compliance: .*shape.*\(n, 6, 6\)", function, bad)


@pytest.mark.parametrize("bad", [2.0 * np.eye(3), np.diag([1.0, 1.0, -1.0]), np.full((3, 3), np.nan), np.eye(4)])
def test_axes_that_are_no_rotation_are_refused(bad: Array) -> None:
    refuses("B001", "axes", in_axes, np.eye(6)[None], bad)


@pytest.mark.parametrize("bad", [[0.0, np.nan, 0.0], [1.0, 2.0], np.zeros((3, 3))])
def test_bad_levers_are_refused(bad: Array) -> None:
    refuses("B001", "lever", moved, np.eye(6)[None], bad)


# ------------------------------------------------------------
# The force-stiffness ellipsoid: known ellipsoids, its equation, and arms with rigid directions


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
