"""Ports against the fast path: what each place carries, and what a compliance there adds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from refusals import refuses

from fem import ArmModel, build_model, deflection, spring_influence
from fem.statics.ports import ROWS, port_of, ports
from robots import bundled_names, load_description

# Sums of some ten products of order one: rounding only.
ROUND_OFF = 1e-12


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
