"""The fast path by hand: springs and beams in series, energy, reciprocity, superposition, the Jacobian."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from refusals import refuses
from scipy.optimize import brentq

import fem.statics.flexibility
from fem import (
    ArmModel,
    build_model,
    compliance,
    compliance_factor,
    deflection,
    deflection_by_part,
    directional_stiffness,
    spring_influence,
)
from fem.model import LinkKind
from fem.springs import FourierBasis, LawSpring
from fem.statics.factor import _square_root
from fem.statics.small_displacements import LIMIT, beyond_small, refuse_beyond, turn, worst_turns
from fem.statics.transfers import transfers
from robots import LoadPath, forward_kinematics, jacobian, load_description, tool_position
from robots.arrays import Array
from robots.kinematics import stretched_length

ROBOTS = ("xr701", "kr60-3", "tx200")

# A few dozen products and sums of well-scaled numbers: round-off, with room for cancellation in a pose.
ROUND_OFF = 1e-12

# The boom of conftest.py: steel tube 100 x 10 mm, E = 200 GPa, nu = 0.25.
E, NU = 200e9, 0.25
AREA = np.pi / 4.0 * (0.100**2 - 0.080**2)
SECOND = np.pi / 64.0 * (0.100**4 - 0.080**4)
G = E / (2.0 * (1.0 + NU))
_RATIO = 0.8
SHEAR = (
    AREA * (6 * (1 + NU) * (1 + _RATIO**2) ** 2) / ((7 + 6 * NU) * (1 + _RATIO**2) ** 2 + (20 + 12 * NU) * _RATIO**2)
)

Random = np.random.Generator
Draw = Callable[..., Array]
Soften = Callable[..., ArmModel]


@pytest.fixture(params=ROBOTS)
def soft_arm(request: pytest.FixtureRequest, soften: Soften, rng: Random) -> ArmModel:
    return soften(build_model(load_description(request.param)), rng, other=True)


def test_spring_and_beam_in_series(boom: Callable[..., object]) -> None:
    length, k, force = 1.5, 3e5, 800.0
    model = build_model(boom(length, stiffness=k))  # type: ignore[arg-type]
    d = deflection(model, np.zeros((1, 1)), np.array([0, 0, -force, 0, 0, 0]))[0]
    spring = force * length**2 / k
    beam = force * length**3 / (3 * E * SECOND) + force * length / (G * SHEAR)
    assert d[2] == pytest.approx(-(spring + beam), rel=ROUND_OFF)
    # Positive rotation about y lowers the tip.
    assert d[4] == pytest.approx(force * length / k + force * length**2 / (2 * E * SECOND), rel=ROUND_OFF)
    assert np.abs(d[[0, 1, 3, 5]]).max() < ROUND_OFF * abs(d[2])


def test_hanging_down_the_boom_only_stretches(boom: Callable[..., object]) -> None:
    length, force = 1.5, 800.0
    model = build_model(boom(length, stiffness=3e5))  # type: ignore[arg-type]
    d = deflection(model, np.array([[np.pi / 2]]), np.array([0, 0, -force, 0, 0, 0]))[0]
    # cos(pi/2) is 6e-17, not 0: the rest is round-off of the bending terms, 1000 times the stretch.
    assert d[2] == pytest.approx(-force * length / (E * AREA), rel=1e-10)


def test_tilt_and_translation_of_a_joint(boom: Callable[..., object]) -> None:
    length, tilt, shift = 2.0, 4e5, 5e7
    model = build_model(boom(length, tilt_stiffness=tilt, translational_stiffness=shift), links="rigid")  # type: ignore[arg-type]
    q = np.zeros((1, 1))
    lateral = deflection(model, q, np.array([0, 1.0, 0, 0, 0, 0]))[0]
    # A lateral force tilts the joint about base z and shifts it along base y.
    np.testing.assert_allclose(
        lateral, [0, length**2 / tilt + 1 / shift, 0, 0, 0, length / tilt], rtol=ROUND_OFF, atol=1e-20
    )
    twist = deflection(model, q, np.array([0, 0, 0, 1.0, 0, 0]))[0]
    np.testing.assert_allclose(twist, [0, 0, 0, 1 / tilt, 0, 0], rtol=ROUND_OFF, atol=1e-20)
    # A vertical force only shifts it: about its own axis the joint is rigid.
    vertical = deflection(model, q, np.array([0, 0, 1.0, 0, 0, 0]))[0]
    np.testing.assert_allclose(vertical, [0, 0, 1 / shift, 0, 0, 0], rtol=ROUND_OFF, atol=1e-20)


@pytest.mark.parametrize("robot", ["kr60-3", "tx200"])
def test_rigid_links_give_the_jacobian_formula(robot: str, soften: Soften, reachable: Draw, rng: Random) -> None:
    model = build_model(load_description(robot), links="rigid")
    if robot == "kr60-3":
        # Gao et al. 2024, table 1, in N m/rad.
        k = np.array([2.1977e6, 0.8994e6, 1.1118e6, 0.0644e6, 0.0254e6, 0.0200e6])
    else:
        model = soften(model, rng)
        k = np.array([1.0 / j.axial.compliance(np.zeros((1, 6)))[0] for j in model.joints])
    q = reachable(model.robot, 50, rng)
    J = jacobian(model.robot, q)
    expected = J / k @ np.swapaxes(J, 1, 2)
    C = compliance(model, q)
    np.testing.assert_allclose(C, expected, rtol=0, atol=ROUND_OFF * np.abs(expected).max())


def test_strain_energy_is_the_work_of_the_load(soft_arm: ArmModel, reachable: Draw, rng: Random) -> None:
    q = reachable(soft_arm.robot, 20, rng)
    w = rng.normal(size=(20, 6)) * [800, 800, 800, 200, 200, 200]
    work = 0.5 * np.einsum("ni,ni->n", w, deflection(soft_arm, q, w))
    frames = forward_kinematics(soft_arm.robot, q)
    energy = np.zeros(20)
    for part in transfers(soft_arm, frames, q, tool_position(soft_arm.robot, frames)):
        s = part.carried(w.T)
        energy += 0.5 * (s * part.deformation(s)).sum(axis=0)
    np.testing.assert_allclose(work, energy, rtol=ROUND_OFF)
    assert (energy > 0).all()


def test_full_transfer_matrix_is_what_unit_wrenches_carry(soft_arm: ArmModel, reachable: Draw, rng: Random) -> None:
    q = reachable(soft_arm.robot, 5, rng)
    frames = forward_kinematics(soft_arm.robot, q)
    for part in transfers(soft_arm, frames, q, tool_position(soft_arm.robot, frames)):
        T = part.matrix()
        units = part.carried(np.broadcast_to(np.eye(6)[:, :, None], (6, 6, 5)))
        np.testing.assert_allclose(T, units, rtol=0, atol=ROUND_OFF * np.abs(T).max())
        back = part.displacement(np.broadcast_to(np.eye(len(T))[:, :, None], (len(T), len(T), 5)))
        np.testing.assert_allclose(np.swapaxes(back, 0, 1), T, rtol=0, atol=ROUND_OFF * np.abs(T).max())


def test_reciprocity_between_two_tool_points(soft_arm: ArmModel, reachable: Draw, rng: Random) -> None:
    """Maxwell-Betti: a load at A moves B along the second load as the load at B moves A along the first.

    A wrench at A is the same as its transport to B, so the flange carries either; the displacement at B
    follows from the rigid flange.
    """
    q = reachable(soft_arm.robot, 15, rng)
    a, b = np.array([0.05, -0.1, 0.2]), np.array([-0.3, 0.15, 0.4])
    f, g = rng.normal(size=(2, 15, 6))
    frames = forward_kinematics(soft_arm.robot, q)
    span = tool_position(soft_arm.robot, frames, b) - tool_position(soft_arm.robot, frames, a)

    def seen_from(d: Array, r: Array) -> Array:
        moved = d.copy()
        moved[:, :3] += np.cross(d[:, 3:], r)
        return moved

    at_b_by_f = seen_from(deflection(soft_arm, q, f, a), span)
    at_a_by_g = seen_from(deflection(soft_arm, q, g, b), -span)
    left, right = np.einsum("ni,ni->n", g, at_b_by_f), np.einsum("ni,ni->n", f, at_a_by_g)
    scale = np.linalg.norm(g, axis=1) * np.linalg.norm(at_b_by_f, axis=1)
    assert np.abs(left - right).max() < ROUND_OFF * scale.max()


def test_superposition_and_the_compliance_matrix(soft_arm: ArmModel, reachable: Draw, rng: Random) -> None:
    q = reachable(soft_arm.robot, 12, rng)
    u, v = rng.normal(size=(2, 12, 6))
    together = deflection(soft_arm, q, 2.0 * u - 3.0 * v)
    apart = 2.0 * deflection(soft_arm, q, u) - 3.0 * deflection(soft_arm, q, v)
    np.testing.assert_allclose(together, apart, rtol=0, atol=ROUND_OFF * np.abs(apart).max())
    C = compliance(soft_arm, q)
    by_matrix = np.einsum("nij,nj->ni", C, u)
    np.testing.assert_allclose(by_matrix, deflection(soft_arm, q, u), rtol=0, atol=ROUND_OFF * np.abs(by_matrix).max())
    np.testing.assert_allclose(C, np.swapaxes(C, 1, 2), rtol=0, atol=ROUND_OFF * np.abs(C).max())
    assert (np.linalg.eigvalsh(0.5 * (C + np.swapaxes(C, 1, 2))) > 0).all()


def test_parts_add_up(soft_arm: ArmModel, reachable: Draw, rng: Random) -> None:
    q = reachable(soft_arm.robot, 10, rng)
    w = rng.normal(size=(10, 6))
    parts = deflection_by_part(soft_arm, q, w)
    names = {"j1", "j6", "forearm", "wrist", "j2 other directions"}
    assert names <= set(parts)
    assert {"bar", "crank"} & set(parts) == ({"bar", "crank"} if soft_arm.bar else set())
    total = deflection(soft_arm, q, w)
    np.testing.assert_allclose(sum(parts.values()), total, rtol=0, atol=ROUND_OFF * np.abs(total).max())


def test_deflection_is_linear_in_the_joint_compliances(soft_arm: ArmModel, reachable: Draw, rng: Random) -> None:
    q = reachable(soft_arm.robot, 10, rng)
    w = rng.normal(size=6)
    influence, rest = spring_influence(soft_arm, q, w)
    assert influence.shape == (10, 6, 6)
    c = np.stack([j.axial.compliance(q) for j in soft_arm.joints], axis=1)
    total = deflection(soft_arm, q, w)
    np.testing.assert_allclose(
        rest + np.einsum("nj,nji->ni", c, influence), total, rtol=0, atol=ROUND_OFF * np.abs(total).max()
    )
    # The influence does not depend on the springs, and is there for rigid joints too.
    rigid = soft_arm.with_springs(dict.fromkeys(soft_arm.robot.joint_names, np.inf))
    again, rest_again = spring_influence(rigid, q, w)
    np.testing.assert_array_equal(again, influence)
    np.testing.assert_array_equal(rest_again, rest)
    np.testing.assert_allclose(rest, deflection(rigid, q, w), rtol=0, atol=ROUND_OFF * np.abs(rest).max())


def test_directional_stiffness_is_force_over_displacement(soft_arm: ArmModel, reachable: Draw, rng: Random) -> None:
    q = reachable(soft_arm.robot, 10, rng)
    for force in (np.array([0, 0, -650.0]), np.array([300.0, -200.0, 100.0])):
        w = np.concatenate([force, np.zeros(3)])
        d = deflection(soft_arm, q, w)[:, :3]
        size = np.linalg.norm(force)
        k = directional_stiffness(soft_arm, q, force)
        np.testing.assert_allclose(k, size / np.abs(d @ force / size), rtol=ROUND_OFF)
    np.testing.assert_allclose(
        directional_stiffness(soft_arm, q), 1.0 / compliance(soft_arm, q)[:, 2, 2], rtol=ROUND_OFF
    )


def test_a_rigid_model_has_no_stiffness_to_report() -> None:
    model = build_model(load_description("xr701"), links="rigid").with_rigid_joints()
    q = np.radians([[0, 5.0, 77.5, 0, 0, 0]])
    np.testing.assert_array_equal(deflection(model, q, np.ones(6)), np.zeros((1, 6)))
    np.testing.assert_array_equal(compliance(model, q), np.zeros((1, 6, 6)))
    refuses("M005", r"pose 0: the model is rigid.*joint springs", directional_stiffness, model, q)


@pytest.mark.parametrize("direction", [[0, 0, 0], [0, 1], [0, 0, np.nan], [0, 0, np.inf]])
def test_a_direction_must_be_one(direction: list[float]) -> None:
    model = build_model(load_description("kr60-3"))
    refuses("B001", "load direction", directional_stiffness, model, np.zeros((1, 6)), np.array(direction))


def test_one_point_for_all_poses_or_one_each(soft_arm: ArmModel, reachable: Draw, rng: Random) -> None:
    q = reachable(soft_arm.robot, 6, rng)
    w = rng.normal(size=6)
    point = np.array([0.1, 0.05, 0.3])
    one = deflection(soft_arm, q, w, point)
    np.testing.assert_array_equal(one, deflection(soft_arm, q, w, np.tile(point, (6, 1))))
    points = np.tile(point, (6, 1))
    points[3] = [0.0, 0.2, -0.1]
    mixed = deflection(soft_arm, q, w, points)
    np.testing.assert_array_equal(np.delete(mixed, 3, axis=0), np.delete(one, 3, axis=0))
    alone = deflection(soft_arm, q[3:4], w, points[3])
    np.testing.assert_allclose(mixed[3:4], alone, rtol=0, atol=ROUND_OFF * np.abs(alone).max())
    assert np.abs(mixed[3] - one[3]).max() > 1e-3 * np.abs(one[3]).max()
    # The model's own tool point is the flange centre when the file names no tool.
    np.testing.assert_array_equal(deflection(soft_arm, q, w), deflection(soft_arm, q, w, np.zeros(3)))


@pytest.mark.parametrize("robot", ["xr701", "kr60-3"])
def test_batches_join_without_a_seam(robot: str, soften: Soften, reachable: Draw, rng: Random) -> None:
    model = soften(build_model(load_description(robot)), rng)
    n = fem.statics.flexibility.CHUNK + 3
    q, w = reachable(model.robot, n, rng), rng.normal(size=(n, 6))
    points = rng.normal(size=(n, 3)) * 0.2
    d, C = deflection(model, q, w, points), compliance(model, q, points)
    parts = deflection_by_part(model, q, w, points)
    influence, rest = spring_influence(model, q, w, points)
    # Not bit by bit: the linear algebra library may sum a batch's last columns in another order.
    close = {"rtol": 0, "atol": ROUND_OFF * np.abs(d).max()}
    for part in (slice(0, 10), slice(n - 8, n)):
        arguments = (model, q[part], w[part], points[part])
        np.testing.assert_allclose(d[part], deflection(*arguments), **close)
        np.testing.assert_allclose(C[part], compliance(model, q[part], points[part]), rtol=0, atol=ROUND_OFF * C.max())
        for name, share in deflection_by_part(*arguments).items():
            np.testing.assert_allclose(parts[name][part], share, **close)
        own_influence, own_rest = spring_influence(*arguments)
        np.testing.assert_allclose(rest[part], own_rest, **close)
        np.testing.assert_allclose(influence[part], own_influence, rtol=0, atol=ROUND_OFF * np.abs(influence).max())


def test_no_poses_give_no_rows() -> None:
    model = build_model(load_description("xr701"))
    none = np.zeros((0, 6))
    assert deflection(model, none, np.ones(6)).shape == (0, 6)
    assert compliance(model, none).shape == (0, 6, 6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"q": np.zeros((4, 5))}, r"pose array.*shape \(4, 5\)"),
        ({"q": np.full((4, 6), np.nan)}, "finite joint angles"),
        ({"wrench": np.zeros(3)}, r"wrench array.*shape \(3,\)"),
        ({"wrench": np.zeros((5, 6))}, r"wrench array.*shape \(5, 6\)"),
        ({"wrench": np.array([0, 0, np.nan, 0, 0, 0])}, "wrench array, row 0"),
        ({"point": np.zeros(2)}, r"tool point array.*shape \(2,\)"),
        ({"point": np.full((4, 3), np.inf)}, "tool point array, row 0"),
    ],
)
def test_bad_arrays_are_named(change: dict[str, Array], message: str) -> None:
    arguments = {"q": np.zeros((4, 6)), "wrench": np.ones(6), "point": None, **change}
    model = build_model(load_description("kr60-3"))
    for function in (deflection, deflection_by_part, spring_influence):
        refuses("A006 B001", message, function, model, **arguments)


@pytest.mark.parametrize(("pose", "measured_mm"), [((-35, 40), 2.05), ((5, 77.5), 1.88), ((45, 115), 2.14)])
def test_rigid_joints_are_far_stiffer_than_the_measured_robot(pose: tuple[float, float], measured_mm: float) -> None:
    """The project's first result: flexible links alone explain less than a tenth of what was measured."""
    model = build_model(load_description("xr701"))
    assert not any(joint.axial.compliance(np.zeros((1, 6))).any() for joint in model.joints)
    q = np.radians([[0.0, *pose, 0.0, 0.0, 0.0]])
    dz_mm = 1e3 * deflection(model, q, np.array([0, 0, -650.0, 0, 0, 0]))[0, 2]
    # Poses 5, 41 and 77 of the paper at 650 N; the links do give way, by more than a hundredth.
    assert -measured_mm / 10.0 < dz_mm < -measured_mm / 100.0


# ------------------------------------------------------------
# The compliance as a sum of squares: the same matrices as by the statics, and rows as smooth as they should be

ARMS: list[tuple[str, LoadPath]] = [
    ("xr701", "parallelogram"),
    ("xr701", "serial"),
    ("kr60-3", "serial"),
    ("tx200", "serial"),
]
# Entry by entry, of sqrt(C_ii C_jj): round-off of some hundred products; entries of a part's compliance below 1e-14 of
# its largest are left out.
EXACT = 1e-12
# Softer than any of the random springs, which the couplings of a bearing are scaled to.
LAW = LawSpring(FourierBasis(2, 1), np.array([8.5, 0.3, -0.2]))


def difference(a: Array, b: Array) -> float:
    size = np.sqrt(np.einsum("nii->ni", b))
    return float((np.abs(a - b) / (size[:, :, None] * size[:, None, :])).max())


@pytest.mark.parametrize("other", [False, True], ids=["axial", "six-way"])
@pytest.mark.parametrize("links", ["rigid", "beam"])
@pytest.mark.parametrize(("robot", "path"), ARMS)
def test_the_rows_add_up_to_the_compliance(
    robot: str, path: LoadPath, links: LinkKind, other: bool, soften: Soften, reachable: Draw, rng: Random
) -> None:
    model = soften(build_model(load_description(robot), links=links, load_path=path), rng, other=other)
    model = model.with_springs({model.robot.joint_names[2]: LAW})
    q = reachable(model.robot, 50, rng)
    points = 0.3 * rng.normal(size=(50, 3))
    for point in (None, points[0], points):
        made = compliance_factor(model, q, point)
        assert difference(made.compliance(), compliance(model, q, point)) < EXACT
    assert len(made.part) == len(made.group) == made.rows.shape[1]
    assert set(made.group) <= set(range(-1, made.weights.shape[1]))


def test_more_poses_than_are_worked_on_at_once(soften: Soften, reachable: Draw, rng: Random) -> None:
    model = soften(build_model(load_description("kr60-3"), links="rigid"), rng)
    q = reachable(model.robot, 2 * 2000 + 7, rng)
    assert difference(compliance_factor(model, q).compliance(), compliance(model, q)) < EXACT


def test_a_spring_that_depends_on_the_pose_stays_outside_of_the_rows(
    soften: Soften, reachable: Draw, rng: Random
) -> None:
    model = soften(build_model(load_description("kr60-3"), links="rigid"), rng)
    q = reachable(model.robot, 20, rng)
    constant, varied = (compliance_factor(m, q) for m in (model, model.with_springs({"j3": LAW})))
    np.testing.assert_array_equal(varied.rows, constant.rows)
    (g,) = {int(g) for g, part in zip(varied.group, varied.part, strict=True) if "j3" in part}
    np.testing.assert_allclose(varied.weights[:, g], LAW.compliance(q), rtol=1e-15)


def test_the_rows_of_a_serial_arm_are_products_of_one_sine_or_cosine_of_each_angle(
    soften: Soften, reachable: Draw, rng: Random
) -> None:
    """What the factored surrogate rests on; the compliance itself takes the second order."""
    model = soften(build_model(load_description("tx200"), links="beam"), rng)
    q = np.zeros((700, 6))
    q[:, 1:5] = reachable(model.robot, 700, rng)[:, 1:5]
    one = np.stack([np.ones((700, 4)), np.cos(q[:, 1:5]), np.sin(q[:, 1:5])], axis=2)
    terms = np.array([np.prod(one[:, range(4), list(t)], axis=1) for t in product(range(3), repeat=4)]).T
    basis = np.linalg.qr(terms)[0]

    def left(values: Array) -> float:
        return float(np.abs(values - basis @ (basis.T @ values)).max() / np.abs(values).max())

    # 1e-11: round-off times the condition of the terms (below 1e4).
    assert left(compliance_factor(model, q).rows.reshape(700, -1)) < 1e-11
    assert left(compliance(model, q).reshape(700, -1)) > 1e-3


def test_square_roots_of_compliances_of_any_rank(rng: Random) -> None:
    for rank in (1, 3, 6):
        F = rng.normal(size=(rank, 6)) * np.array([1e-4] * 3 + [1e-2] * 3)
        C = F.T @ F
        root = _square_root(C)
        assert root.shape == (rank, 6)
        d = np.sqrt(np.diag(C))
        # 1e-13 of the entries' size: round-off of an eigenvalue problem.
        np.testing.assert_allclose((root.T @ root) / np.outer(d, d), C / np.outer(d, d), atol=1e-13)


def test_a_joint_whose_coupled_compliance_is_no_compliance(soften: Soften, rng: Random) -> None:
    model = soften(build_model(load_description("kr60-3"), links="rigid"), rng, other=True)
    stiff = model.with_springs({"j3": 1e12})
    # Such an arm would give energy: in some direction it moves against the load.
    assert np.linalg.eigvalsh(stiff.joints[2].bearing + np.diag([0.0] * 5 + [1e-12]))[0] < 0.0
    refuses(
        "M004",
        r"compliance of j3 with what couples it.*positive semidefinite",
        compliance_factor,
        stiff,
        np.zeros((1, 6)),
    )


def test_nothing_that_gives_way(rng: Random) -> None:
    model = build_model(load_description("kr60-3"), links="rigid").with_rigid_joints()
    rigid = replace(model, bar=None)
    refuses(
        "M005", r"nothing in it deflects.*flexible links or joint springs", compliance_factor, rigid, np.zeros((1, 6))
    )


# ------------------------------------------------------------
# The limit of linear statics: what it is off by there, and what is beyond

SPRINGS = {f"j{k}": 1e6 for k in range(1, 7)}


@pytest.fixture(scope="module")
def arm():
    return build_model(load_description("xr701"), "rigid").with_springs(SPRINGS)


@pytest.mark.parametrize("angle", [0.0, 0.8, -0.8])
def test_linear_statics_is_off_by_as_much_as_the_arm_turns(angle: float) -> None:
    """An arm of 1 m on one spring, exactly: k t = F cos(angle + t), down is negative."""
    errors = []
    for t in (LIMIT / 4, LIMIT, 10.0 * LIMIT):
        load = t / np.cos(angle)
        exact = brentq(lambda x, load=load: x - load * np.cos(angle - x), 0.0, 3.0)
        errors.append(abs(t / exact - 1.0))
    # First order in the turn: tan(0.8) = 1.03 times it, with a quarter of room for the second order.
    assert errors[1] <= 1.25 * LIMIT
    assert errors[0] <= 1.25 * LIMIT / 4
    # Far beyond, the result is of no use.
    assert errors[2] > 2.0 * LIMIT


def test_turn_is_the_larger_of_rotation_and_displacement_over_length(arm) -> None:
    length = stretched_length(arm.robot)
    d = np.array([[0.1 * length, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0.07, 0], [0, 0, 0.01 * length, 0.02, 0, 0]])
    np.testing.assert_allclose(turn(arm.robot, d), [0.1, 0.07, 0.02])
    assert beyond_small(arm.robot, d).tolist() == [True, True, False]
    # What was not read says nothing.
    assert turn(arm.robot, np.array([[np.nan, np.nan, 0.1 * length]])) == pytest.approx([0.1])


def test_the_worst_displacement_is_refused_with_what_is_allowed(arm) -> None:
    refuse_beyond(arm.robot, np.full((3, 6), 1e-3), "readings")
    info = refuses(
        "M006", "", refuse_beyond, arm.robot, np.array([[0, 0, 0.2, 0, 0, 0], [0, 0, -68.0, 0, 0, 0]]), "readings"
    )
    text = str(info)
    assert "6.8e+04 mm" in text
    assert f"up to {LIMIT:g} rad" in text


def test_worst_turns_are_those_of_the_worst_force(arm) -> None:
    """No direction among many turns the tool by more displacement; a tenth of the stiffness is ten times the turn."""
    least = worst_turns(arm).min()
    soft = worst_turns(arm.with_springs(dict.fromkeys(SPRINGS, 100000.0))).min()
    assert soft == pytest.approx(10.0 * least)
    rng = np.random.default_rng(0)
    q = np.radians([[0.0, 5.0, 77.5, 0.0, 0.0, 0.0]])
    force = rng.normal(size=(200, 3))
    force /= np.linalg.norm(force, axis=1, keepdims=True)
    moved = deflection(arm, np.repeat(q, 200, axis=0), np.hstack([force, np.zeros_like(force)]))
    assert turn(arm.robot, moved).max() > least


def test_a_rigid_arm_turns_nowhere() -> None:
    assert not worst_turns(build_model(load_description("xr701"), "rigid")).any()
