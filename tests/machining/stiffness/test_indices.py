"""The indices: what each depends on and what not, how they are ordered, and bad input."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from refusals import refuses
from rigid_frames import rigid_frame

import fem
import robots
from machining import (
    INDICES,
    blocks,
    directional_stiffness,
    evaluate,
    moved,
    normal_stiffness_index,
    nspi,
    rayleigh_of_force,
    rayleigh_quotient,
    stiffness_ellipsoid,
    stiffness_index,
    translational,
)
from machining.stiffness.indices import CHANGES, Change
from robots import forward_kinematics
from robots.arrays import Array

# The smallest principal compliance is some 1e-4 of the largest, and the indices are quotients of those.
SAME = 1e-10


class Case(NamedTuple):
    model: fem.ArmModel
    q: Array
    C: Array
    normal: Array
    force: Array


@pytest.fixture
def case(kr60: fem.ArmModel, poses: Callable[..., Array], rng: np.random.Generator) -> Case:
    q = poses(kr60.robot, 30, rng)
    C = fem.compliance(kr60, q, np.array([0.1, 0.02, 0.15]))
    return Case(kr60, q, C, rng.normal(size=(30, 3)), 200.0 * rng.normal(size=(30, 3)))


def value(name: str, C: Array, normal: Array, force: Array) -> Array:
    return evaluate(name, C[:, :3, :3] if C.shape[1] == 6 else C, normal, force)


def changed(case: Case, change: Change) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(9)
    unit = case.normal / np.linalg.norm(case.normal, axis=1, keepdims=True)
    return {
        "normal": lambda: (case.C, rng.normal(size=(30, 3)), case.force),
        "normal sign": lambda: (case.C, -case.normal, case.force),
        "force direction": lambda: (case.C, case.normal, rng.normal(size=(30, 3))),
        "force sign": lambda: (case.C, case.normal, -case.force),
        "force size": lambda: (case.C, case.normal, 7.3 * case.force),
        "tool point along the normal": lambda: (moved(case.C, 0.1 * unit), case.normal, case.force),
    }[change]()


def assert_other(found: Array, before: Array) -> None:
    """Most poses differ clearly; a few may not by chance."""
    assert (np.abs(found / before - 1.0) > 1e-4).mean() > 0.9


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", INDICES)
def test_an_index_is_unchanged_by_what_it_says_and_by_nothing_else(name: str, change: Change, case: Case) -> None:
    before = value(name, case.C, case.normal, case.force)
    after = value(name, *changed(case, change))
    if change in INDICES[name].unchanged_by:
        np.testing.assert_allclose(after, before, rtol=SAME)
    else:
        assert_other(after, before)


@pytest.mark.parametrize("name", INDICES)
def test_an_index_reads_what_it_says(name: str) -> None:
    index = INDICES[name]
    assert ("normal" in index.uses) == ("normal" not in index.unchanged_by)
    assert ("force" in index.uses) == ("force direction" not in index.unchanged_by)


@pytest.mark.parametrize("name", INDICES)
def test_turned_base_axes_change_no_index(
    name: str, case: Case, turned_base: Callable[..., fem.ArmModel], rotation: Array
) -> None:
    C = translational(turned_base(case.model, rotation), case.q, np.array([0.1, 0.02, 0.15]))
    found = value(name, C, case.normal @ rotation.T, case.force @ rotation.T)
    np.testing.assert_allclose(found, value(name, case.C, case.normal, case.force), rtol=SAME)
    if INDICES[name].uses:
        # A normal or force left behind in the old axes is another one.
        assert_other(value(name, C, case.normal, case.force), found)


@pytest.mark.parametrize("name", INDICES)
def test_turned_tool_axes_change_no_index(name: str, case: Case, rotation: Array) -> None:
    def with_tool(R: Array) -> fem.ArmModel:
        T = rigid_frame((0.1, 0.02, 0.15), R)
        return replace(case.model, robot=replace(case.model.robot, T_flange_tool=T))

    a, b = (translational(with_tool(R), case.q) for R in (np.eye(3), rotation))
    np.testing.assert_allclose(
        value(name, a, case.normal, case.force), value(name, b, case.normal, case.force), rtol=SAME
    )


@pytest.mark.parametrize("name", INDICES)
def test_the_tool_point_changes_every_index(name: str, case: Case) -> None:
    after = value(name, moved(case.C, np.array([0.05, -0.08, 0.06])), case.normal, case.force)
    assert_other(after, value(name, case.C, case.normal, case.force))


@pytest.mark.parametrize("name", INDICES)
def test_the_load_on_the_arm_changes_every_index(name: str, case: Case) -> None:
    w, point = np.array([2e3, -3e3, -4e3, 50.0, 0.0, 100.0]), np.array([0.1, 0.02, 0.15])
    after = value(name, translational(case.model, case.q, point, w), case.normal, case.force)
    assert_other(after, value(name, case.C, case.normal, case.force))


@pytest.mark.parametrize("name", INDICES)
def test_stiffer_springs_and_other_units_scale_an_index(name: str, case: Case) -> None:
    before = value(name, case.C, case.normal, case.force)
    degree = INDICES[name].degree
    springs = {j.name: 2.0 / float(j.axial.compliance(case.q[:1])[0]) for j in case.model.joints}
    C = translational(case.model.with_springs(springs), case.q, np.array([0.1, 0.02, 0.15]))
    np.testing.assert_allclose(value(name, C, case.normal, case.force), before * 2.0**degree, rtol=SAME)
    in_mm = value(name, case.C * 1e3, case.normal * 1e3, case.force)
    np.testing.assert_allclose(in_mm, before * 1e-3**degree, rtol=SAME)


def test_wrist_flip_leaves_k_fs_unchanged(case: Case) -> None:
    flipped = case.q + np.array([0.0, 0.0, 0.0, np.pi, 0.0, np.pi])
    flipped[:, 4] *= -1.0
    frames = [forward_kinematics(case.model.robot, q).p_flange for q in (case.q, flipped)]
    np.testing.assert_allclose(frames[0], frames[1], rtol=0, atol=1e-12)
    k = [stiffness_index(case.model, q, case.normal, np.array([0.1, 0.02, 0.15])) for q in (case.q, flipped)]
    np.testing.assert_allclose(k[0], k[1], rtol=SAME)


def test_tool_point_on_the_last_axis_makes_k_fs_independent_of_q6(case: Case) -> None:
    other = case.q + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.3])
    on_axis, beside = np.array([0.0, 0.0, 0.3]), np.array([0.1, 0.0, 0.3])
    a, b = (stiffness_index(case.model, q, case.normal, on_axis) for q in (case.q, other))
    np.testing.assert_allclose(a, b, rtol=SAME)
    assert_other(*(stiffness_index(case.model, q, case.normal, beside) for q in (case.q, other)))


@pytest.mark.parametrize("path", ["rigid", "beam"])
def test_k_fs_without_the_matrix_equals_k_fs_with_it(
    path: fem.LinkKind, case: Case, poses: Callable[..., Array]
) -> None:
    model = fem.build_model(robots.load_description("xr701"), links=path)
    model = model.with_springs(dict.fromkeys(model.robot.joint_names, 1e6))
    q = poses(model.robot, 30, np.random.default_rng(4))
    point = np.array([0.05, 0.0, 0.2])
    expected = normal_stiffness_index(translational(model, q, point), case.normal)
    np.testing.assert_allclose(stiffness_index(model, q, case.normal, point), expected, rtol=SAME)


def test_order_and_identities(case: Case) -> None:
    C, n, F = case.C[:, :3, :3], case.normal, case.force
    k_fs, e = normal_stiffness_index(C, n), stiffness_ellipsoid(C)
    assert (e.weakest <= k_fs * (1 + SAME)).all()
    assert (k_fs < directional_stiffness(C, n)).all()
    assert (e.weakest < e.mean).all()
    assert (e.mean < e.strongest).all()
    np.testing.assert_allclose(nspi(C, n, n), directional_stiffness(C, n), rtol=SAME)
    np.testing.assert_allclose(rayleigh_of_force(C, n), k_fs, rtol=SAME)
    d = np.einsum("nij,nj->ni", C, F)
    np.testing.assert_allclose(rayleigh_quotient(C, d), rayleigh_of_force(C, F), rtol=1e-8)
    np.testing.assert_allclose(rayleigh_of_force(C, F) * np.linalg.norm(d, axis=1), np.linalg.norm(F, axis=1))
    np.testing.assert_allclose(
        directional_stiffness(C, np.array([0, 0, -1.0])),
        fem.directional_stiffness(case.model, case.q, point=np.array([0.1, 0.02, 0.15])),
        rtol=SAME,
    )


def test_average_stiffness_is_the_mean_over_directions(case: Case, rng: np.random.Generator) -> None:
    C = case.C[:1, :3, :3]
    n = rng.normal(size=(200_000, 3))
    mean = (1.0 / directional_stiffness(np.broadcast_to(C, (len(n), 3, 3)), n)).mean()
    # Sampling: relative scatter of n.Cn is below 1, so 1/sqrt(2e5) = 0.2 %; three of those.
    assert evaluate("average", C)[0] == pytest.approx(1.0 / mean, rel=7e-3)


def test_the_rotational_block_has_indices_too(case: Case) -> None:
    e = stiffness_ellipsoid(blocks(case.C).rr)
    # Softer than the softest spring in series with others, stiffer than all six in one direction.
    assert (e.weakest < 2.0e4).all()
    assert (e.weakest > 4e3).all()


@pytest.mark.parametrize("bad", [[0.0, 0.0, 0.0], [0.0, np.nan, 1.0], [0.0, 1.0], [np.inf, 0.0, 0.0]])
def test_a_bad_normal_is_refused(bad: list[float], case: Case) -> None:
    C, F = case.C[:, :3, :3], case.force
    calls = [
        lambda: normal_stiffness_index(C, bad),
        lambda: stiffness_index(case.model, case.q, bad),
        lambda: nspi(C, bad, F),
        lambda: evaluate("k_fs", C, bad),
    ]
    for call in calls:
        caught = refuses("B001", r"surface normal.*not all zero|surface normal.*direction", call)
        assert caught.remedy


def test_a_bad_row_is_named(case: Case) -> None:
    normal = case.normal.copy()
    normal[17] = 0.0
    refuses("B001", r"surface normal, row 17", normal_stiffness_index, case.C[:, :3, :3], normal)
    C = case.C[:, :3, :3].copy()
    C[4, 1, 1] = np.nan
    refuses("B001", "pose 4", normal_stiffness_index, C, case.normal)


def test_missing_or_unknown_input_is_refused(case: Case) -> None:
    C = case.C[:, :3, :3]
    refuses("S015", "normal for index k_fs", evaluate, "k_fs", C)
    refuses("S015", "force for index nspi", evaluate, "nspi", C, case.normal)
    refuses("S015", r"stiffness index.*k_fs, nspi", evaluate, "stiffest", C)
    refuses("B001", r"force.*not all zero", rayleigh_of_force, C, np.zeros(3))
    refuses("B001", r"\(n, 3, 3\)", evaluate, "weakest", case.C)
    refuses("B001", r"displacement.*not all zero", rayleigh_quotient, C, np.zeros(3))


def test_rayleigh_without_an_inverse_is_refused() -> None:
    C = np.stack([np.eye(3), np.diag([1.0, 1.0, 0.0])])
    refuses("M005", "pose 1", rayleigh_quotient, C, [1.0, 0.0, 0.0])
    assert rayleigh_of_force(C, [1.0, 0.0, 0.0]) == pytest.approx([1.0, 1.0])


def test_nspi_of_a_force_along_the_surface_is_infinite() -> None:
    assert nspi(np.eye(3)[None], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])[0] == np.inf


def test_no_poses(kr60: fem.ArmModel) -> None:
    assert stiffness_index(kr60, np.empty((0, 6)), np.array([0.0, 0.0, 1.0])).shape == (0,)
    for name in INDICES:
        assert evaluate(name, np.empty((0, 3, 3)), [0, 0, 1], [0, 0, 1]).shape == (0,)
