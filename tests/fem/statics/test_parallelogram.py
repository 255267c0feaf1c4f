"""The parallelogram's load path against statics by hand.

Everything is written out from angles and lengths here: upper arm at ``q2`` from the vertical, forearm at
``phi = q2 + 180 deg - q3``, wrist bent by ``q5`` in a plane turned by ``q4`` about the forearm.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from refusals import refuses

from fem import ArmModel, build_model, compliance, deflection, deflection_by_part, spring_influence
from fem.statics.flexibility import CHUNK
from fem.statics.ports import ROWS, port_of, ports
from fem.statics.transfers import transfers
from robots import bundled_names, forward_kinematics, load_description, tool_position
from robots.arrays import Array

# The assumed geometry of the xr701 (robots/data/xr701.toml), m.
UPPER_ARM, FOREARM, WRIST, LEVER = 1.10, 1.25, 0.30, 0.40
K = {"j1": 2e6, "j2": 1.4e6, "j3": 0.76e6, "j4": 1.4e6, "j5": 0.9e6, "j6": 0.5e6}
FORCE = 650.0
DOWN = np.array([0, 0, -FORCE, 0, 0, 0])

# A few dozen products and sums of numbers of order one.
ROUND_OFF = 1e-12

POSES = np.array(  # q2, q3real, q4, q5
    [
        (-35, 40, 0, 0),
        (5, 77.5, 0, -60),
        (45, 115, 0, 100),
        (5, 77.5, 90, 50),
        (20, 90, -130, -80),
        (0, 60, 200, 100),
        (-20, 70, 45, 30),
    ],
    dtype=float,
)


def _q(poses: Array = POSES) -> Array:
    """Pose rows; joint 1 turns everything about the vertical and joint 6 about the tool: no influence."""
    q = np.zeros((len(poses), 6))
    q[:, 1:5] = np.radians(poses)
    q[:, 0], q[:, 5] = 0.7, -0.4
    return q


def _rigid(load_path: str) -> ArmModel:
    model = build_model(load_description("xr701"), links="rigid", load_path=load_path)  # type: ignore[arg-type]
    return model.with_springs(K)


def _levers(poses: Array = POSES) -> dict[str, Array]:
    """Torque about each joint axis per newton of downward force at the flange, m."""
    q2, q3, q4, q5 = np.radians(poses).T
    phi = q2 + np.pi - q3
    # Wrist centre to flange: in the arm's plane along x, and sideways along y.
    rx = WRIST * (np.sin(phi) * np.cos(q5) + np.cos(phi) * np.cos(q4) * np.sin(q5))
    ry = WRIST * np.sin(q4) * np.sin(q5)
    return {
        "upper": UPPER_ARM * np.sin(q2),
        "elbow": FOREARM * np.sin(phi) + rx,
        "j4": -np.sin(phi) * ry,
        "j5": np.cos(q4) * rx + np.sin(q4) * np.cos(phi) * ry,
    }


def _dz(levers: dict[str, Array], lever2: Array) -> Array:
    return -FORCE * (
        lever2**2 / K["j2"] + levers["elbow"] ** 2 / K["j3"] + levers["j4"] ** 2 / K["j4"] + levers["j5"] ** 2 / K["j5"]
    )


def test_joint_2_carries_only_the_upper_arms_lever() -> None:
    levers = _levers()
    dz = deflection(_rigid("parallelogram"), _q(), DOWN)[:, 2]
    np.testing.assert_allclose(dz, _dz(levers, levers["upper"]), rtol=ROUND_OFF)


def test_in_the_serial_load_path_joint_2_carries_the_whole_lever() -> None:
    levers = _levers()
    dz = deflection(_rigid("serial"), _q(), DOWN)[:, 2]
    np.testing.assert_allclose(dz, _dz(levers, levers["upper"] + levers["elbow"]), rtol=ROUND_OFF)
    # And that is another number: the load path is seen at every pose here.
    other = _dz(levers, levers["upper"])
    assert (np.abs(dz / other - 1.0) > 0.05).all()


def test_an_upright_upper_arm_hides_joint_2() -> None:
    upright = np.array([[0, 60, 30, 20], [0, 90, 0, -40], [0, 110, 0, 0]], dtype=float)
    influence, _ = spring_influence(_rigid("parallelogram"), _q(upright), DOWN)
    # sin 0 is 0; left is round-off of the bar's moment against the forearm's.
    assert np.abs(influence[:, 1]).max() < ROUND_OFF * np.abs(influence[:, 2]).max()
    serial, _ = spring_influence(_rigid("serial"), _q(upright), DOWN)
    assert (np.abs(serial[:, 1, 2]) > 0.1 * np.abs(serial[:, 2, 2])).all()


def test_influences_by_hand() -> None:
    levers = _levers()
    influence, rest = spring_influence(_rigid("parallelogram"), _q(), DOWN)
    for joint, lever in ((1, levers["upper"]), (2, levers["elbow"]), (3, levers["j4"]), (4, levers["j5"])):
        np.testing.assert_allclose(influence[:, joint, 2], -FORCE * lever**2, rtol=0, atol=ROUND_OFF * FORCE)
    # About the vertical and about the tool's axis a vertical force has no lever.
    assert np.abs(influence[:, [0, 5]]).max() < ROUND_OFF * FORCE
    np.testing.assert_array_equal(rest, 0.0)


def test_a_moment_about_the_elbow_leaves_joint_2_alone() -> None:
    # A pure moment about the joints' common direction: serial joints feel it in full, joint 2 of the
    # parallelogram not at all, because the bar returns it to the third actuator.
    q = _q(np.array([[20.0, 80.0, 0.0, 0.0]]))
    y = np.array([-np.sin(0.7), np.cos(0.7), 0.0])
    moment = np.concatenate([np.zeros(3), y])
    shares = deflection_by_part(_rigid("parallelogram"), q, moment)
    assert np.abs(shares["j2"]).max() < ROUND_OFF / K["j3"]
    assert shares["j3"][0, 3:] @ y == pytest.approx(1.0 / K["j3"], rel=ROUND_OFF)
    assert deflection_by_part(_rigid("serial"), q, moment)["j2"][0, 3:] @ y == pytest.approx(
        1.0 / K["j2"], rel=ROUND_OFF
    )


def test_bar_stretches_by_its_force() -> None:
    model = build_model(load_description("xr701"))
    dz = deflection_by_part(model, _q(), DOWN)["bar"][:, 2]
    # Equilibrium of the forearm about the elbow: the bar runs parallel to the upper arm and meets the
    # lever (in line with the forearm) at the elbow angle q3.
    bar_force = FORCE * _levers()["elbow"] / (LEVER * np.sin(np.radians(POSES[:, 1])))
    area = np.pi / 4.0 * (0.100**2 - 0.076**2)
    stretch = bar_force * UPPER_ARM / (206e9 * area)
    np.testing.assert_allclose(dz, -bar_force * stretch / FORCE, rtol=ROUND_OFF)


def test_crank_bends_as_a_cantilever_under_the_bars_force() -> None:
    model = build_model(load_description("xr701"))
    dz = deflection_by_part(model, _q(), DOWN)["crank"][:, 2]
    elbow = np.radians(POSES[:, 1])
    bar_force = FORCE * _levers()["elbow"] / (LEVER * np.sin(elbow))
    across, along = bar_force * np.sin(elbow), bar_force * np.cos(elbow)
    assert model.bar is not None
    assert model.bar.crank is not None
    f = model.bar.crank.element.flexibility
    # Crank along its z axis, bending in x-z; the force's components and the flexibility's entries.
    expected = -(across**2 * f[0, 0] + along**2 * f[2, 2]) / FORCE
    np.testing.assert_allclose(dz, expected, rtol=1e-9)  # the condensed entries have that round-off
    E, G, width, height, wall = 206e9, 206e9 / 2.6, 0.16, 0.24, 0.03
    second = (width * height**3 - (width - 2 * wall) * (height - 2 * wall) ** 3) / 12.0
    bending = LEVER**3 / (3.0 * E * second)
    # Bending in the crank's strong direction; its short length makes shear as large again, so only bounds.
    assert bending < f[0, 0] < bending + LEVER / (0.3 * G * 2.0 * height * wall)


def test_a_shifting_elbow_carries_the_load_and_the_bars_pull() -> None:
    shift = 1e8
    model = build_model(load_description("xr701"), links="rigid").with_rigid_joints()
    joints = list(model.joints)
    joints[2] = replace(joints[2], bearing=np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]) / shift)
    dz = deflection(replace(model, joints=tuple(joints)), _q(), DOWN)[:, 2]
    # Load in front of the elbow, heel behind it: the bar holds the heel, pulling it down along the upper
    # arm. The elbow carries that pull on top of the load.
    q2, q3 = np.radians(POSES[:, 0]), np.radians(POSES[:, 1])
    pull = FORCE * _levers()["elbow"] / (LEVER * np.sin(q3))
    energy = ((pull * np.sin(q2)) ** 2 + (pull * np.cos(q2) + FORCE) ** 2) / shift
    np.testing.assert_allclose(dz, -energy / FORCE, rtol=ROUND_OFF)


@pytest.mark.parametrize("function", [compliance, lambda m, q: deflection(m, q, DOWN)])
def test_a_flat_parallelogram_is_refused(function: object) -> None:
    q = _q(np.array([[0, 90, 0, 0]] * 4, dtype=float))
    q[2, 2] = np.pi  # forearm in line with the upper arm: lever and bar are in line too
    refuses("M007", r"pose 2: the parallelogram of xr701 is flat.*away from", function, _rigid("parallelogram"), q)
    # The serial load path has no such singularity.
    assert np.isfinite(function(_rigid("serial"), q)).all()  # type: ignore[operator]


@pytest.mark.parametrize(
    "function",
    [
        compliance,
        lambda m, q: deflection(m, q, DOWN),
        lambda m, q: deflection_by_part(m, q, DOWN),
        lambda m, q: spring_influence(m, q, DOWN),
    ],
    ids=["compliance", "deflection", "by part", "influence"],
)
def test_the_flat_pose_is_numbered_in_the_whole_batch(function: Callable[[ArmModel, Array], object]) -> None:
    q = _q(np.array([[0, 90, 0, 0]] * (CHUNK + 10), dtype=float))
    q[CHUNK + 7, 2] = 0.0
    refuses("M007", re.escape(f"pose {CHUNK + 7}:"), function, _rigid("parallelogram"), q)


def test_bar_pulls_crank_and_forearm_towards_each_other() -> None:
    """The sign of the bar's force, which no displacement shows: load in front of the elbow, heel behind it."""
    model = build_model(load_description("xr701"))
    q = _q(np.array([[0, 90, 0, 0]], dtype=float))
    frames = forward_kinematics(model.robot, q)
    parts = {p.name: p for p in transfers(model, frames, q, tool_position(model.robot, frames))}
    force = FORCE * (FOREARM + WRIST) / LEVER
    w = DOWN[:, None]
    # Upper arm upright, forearm along its own z and level, its x axis pointing down.
    heel = parts["forearm"].carried(w)[6:, 0]
    np.testing.assert_allclose(heel, [force, 0, 0, 0, 0, 0], rtol=ROUND_OFF, atol=ROUND_OFF * force)
    crank = parts["crank"].carried(w)[:, 0]
    np.testing.assert_allclose(crank, -heel, rtol=ROUND_OFF, atol=ROUND_OFF * force)
    # Counted positive when the bar pushes.
    assert parts["bar"].carried(w)[0, 0] == pytest.approx(-force, rel=ROUND_OFF)


# ------------------------------------------------------------
# Ports against the fast path: what each place carries, and what a compliance there adds

# Sums of some ten products of order one: rounding only.


def _loaded(model: ArmModel, n: int = 20, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    low, high = model.robot.limits.T
    return rng.uniform(low, high, (n, model.robot.dof)), rng.normal(size=(n, 6)) * [300, 300, 300, 50, 50, 50]


@pytest.fixture(scope="module", params=bundled_names())
def model(request: pytest.FixtureRequest) -> ArmModel:
    return build_model(load_description(request.param)).with_rigid_joints()


def test_axial_rows_are_those_of_the_springs(model: ArmModel) -> None:
    q, w = _loaded(model)
    influence, _ = spring_influence(model, q, w)
    places = ports(model, q, w)
    for j, name in enumerate(model.robot.joint_names):
        np.testing.assert_allclose(places[name].influence(5, 5), influence[:, j], rtol=ROUND_OFF)


def test_links_and_bar_add_up_to_the_deflection_with_rigid_joints(model: ArmModel) -> None:
    q, w = _loaded(model)
    places = ports(model, q, w)
    total = sum(p.share(p.flexibility) for p in places.values() if p.flexibility is not None)
    expected = deflection(model, q, w)
    np.testing.assert_allclose(total, expected, atol=ROUND_OFF * np.abs(expected).max())


def test_other_directions_of_a_joint_are_those_of_the_statics(model: ArmModel) -> None:
    q, w = _loaded(model)
    c = np.array([1e-9, 2e-9, 3e-9, 4e-7, 5e-7])
    plain = deflection(model, q, w)
    places = ports(model, q, w)
    for j, name in enumerate(model.robot.joint_names):
        joints = list(model.joints)
        joints[j] = replace(joints[j], bearing=np.diag([*c, 0.0]))
        change = deflection(replace(model, joints=tuple(joints)), q, w) - plain
        np.testing.assert_allclose(places[name].share(np.diag([*c, 0.0])), change, atol=1e-10 * np.abs(change).max())


def test_the_base_turns_the_arm_as_a_rigid_body() -> None:
    model = build_model(load_description("kr60-3"), "rigid")
    q, w = _loaded(model)
    base = ports(model, q, w)["base"]
    about_y = base.influence(4, 4)
    # The moment about the base's y axis turns everything about it: a rotation and r x theta at the tool.
    moment = base.carried[4]
    np.testing.assert_allclose(about_y[:, 4], moment, rtol=ROUND_OFF)
    np.testing.assert_allclose(about_y[:, 3], 0.0, atol=0.0)
    np.testing.assert_allclose(about_y[:, 1], 0.0, atol=1e-9)


def test_the_tool_gives_way_along_its_own_axes() -> None:
    model = build_model(load_description("tx200"), "rigid")
    q, w = _loaded(model)
    tool = ports(model, q, w)["tool"]
    # The same compliance along all three axes is blind to the tool's orientation.
    share = tool.share(np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(share[:, :3], w[:, :3], rtol=1e-12)
    one = tool.influence(0, 0)
    assert np.linalg.matrix_rank(one[:, :3] @ one[:, :3].T, tol=1e-6) > 1  # the axis turns with the pose


def test_entries_off_the_diagonal_are_symmetric_and_add_up(model: ArmModel) -> None:
    q, w = _loaded(model, 5)
    place = ports(model, q, w)[model.robot.joint_names[1]]
    rng = np.random.default_rng(3)
    C = rng.normal(size=(6, 6))
    C = C + C.T
    total = sum(C[a, b] * place.influence(a, b) for a in range(6) for b in range(a, 6))
    np.testing.assert_allclose(total, place.share(C), rtol=1e-10, atol=1e-9 * np.abs(total).max())
    np.testing.assert_allclose(place.influence(1, 4), place.influence(4, 1), rtol=ROUND_OFF)


def test_an_unknown_place_is_named() -> None:
    model = build_model(load_description("kr60-3"), "rigid")
    places = ports(model, *_loaded(model, 2))
    refuses("B003", "elbow", port_of, places, "elbow")
    assert set(places) == {"base", "tool", *model.robot.joint_names}
    assert len(ROWS) == 6
