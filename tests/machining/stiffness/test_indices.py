"""The indices: what each depends on and what not, how they are ordered, and bad input."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
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
from machining.stiffness.criterion import Criterion
from machining.stiffness.indices import CHANGES, Change
from robots import forward_kinematics, tool_position
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


# ------------------------------------------------------------
# K_sf (eq. 4 of the TX200 paper): closed form, units, weights


def test_the_published_formula_by_hand() -> None:
    """Three points of 100, 200, 300 N/mm: sum k^2 = 140000, mean^4 = 200^4."""
    terms = Criterion(1e-4, 1e-9).terms(np.array([1e5, 2e5, 3e5]))
    assert terms.squares == pytest.approx(14.0, rel=1e-14)
    assert terms.mean == pytest.approx(1.6, rel=1e-14)
    assert terms.value == pytest.approx(15.6, rel=1e-14)


def test_comparable_weights_make_both_terms_one() -> None:
    criterion = Criterion.comparable(7.3e5, 40)
    terms = criterion.terms(np.full((2, 40), 7.3e5))
    np.testing.assert_allclose(terms.squares, 1.0, rtol=1e-14)
    np.testing.assert_allclose(terms.mean, 1.0, rtol=1e-14)
    # mm^2/N^2 and mm^4/N^4 for 730 N/mm.
    assert criterion.alpha == pytest.approx(1.0 / (40 * 730.0**2))
    assert criterion.beta == pytest.approx(1.0 / 730.0**4)


@given(st.lists(st.floats(1e4, 1e7), min_size=1, max_size=20))
def test_points_taken_twice_double_the_sum_only(stiffness: list[float]) -> None:
    criterion, k = Criterion(1e-6, 1e-12), np.array(stiffness)
    once, twice = criterion.terms(k), criterion.terms(np.repeat(k, 2))
    np.testing.assert_allclose(twice.squares, 2.0 * once.squares, rtol=1e-12)
    np.testing.assert_allclose(twice.mean, once.mean, rtol=1e-12)


def test_shares_undo_dense_sampling() -> None:
    """A stretch sampled ten times as densely counts the same by length."""
    criterion = Criterion(1e-6, 1e-12)
    even = np.array([1e5, 5e5])
    dense = np.array([1e5] * 10 + [5e5])
    share = np.array([0.05] * 10 + [0.5])
    expected = criterion.value(even)
    assert criterion.value(dense, share, 2) == pytest.approx(expected, rel=1e-12)
    assert abs(float(criterion.value(dense)) - float(expected)) > 0.1 * float(expected)


def test_even_shares_are_the_paper_s_sum() -> None:
    criterion, k = Criterion(2e-6, 3e-12), np.array([1e5, 2e5, 4e5])
    assert criterion.value(k, np.full(3, 1.0 / 3.0)) == pytest.approx(float(criterion.value(k)), rel=1e-14)


def test_the_slope_is_the_derivative() -> None:
    criterion = Criterion(0.0, 1e-12)
    step = 1.0  # N/m
    up, down = (float(criterion.terms(np.array([4e5 + s])).mean) for s in (step, -step))
    # Per N/mm; central difference, error of order (step / k)^2.
    assert criterion.slope(4e5) == pytest.approx((up - down) / (2e-3 * step), rel=1e-8)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Criterion(-1.0, 1.0), "weight alpha of K_sf: got -1.0; allowed: 0 or more"),
        (lambda: Criterion(1.0, float("nan")), "weight beta"),
        (lambda: Criterion(0.0, 0.0), "both 0"),
        (lambda: Criterion.comparable(0.0, 3), "stiffness of reference"),
        (lambda: Criterion.comparable(1e5, 0), "points of the path"),
        (lambda: Criterion(1.0, 1.0).value(np.array([1e5, -1.0])), "stiffness along the path"),
        (lambda: Criterion(1.0, 1.0).value(np.zeros(0)), "stiffness along the path"),
        (lambda: Criterion(1.0, 1.0).value(np.array([1e5, 1e5]), np.array([0.5, 0.6])), "adding up to 1"),
    ],
)
def test_bad_input(make: object, words: str) -> None:
    refuses("G004", words, make)


# ------------------------------------------------------------
# The paper's Table 4 with the two readings of it that come close (docs/validation/kr60_indices.md)

# Gao 2024, Table 4: x on the path from P1 to P2, k_fs.
X_MM = np.array([-40.0, -20.0, 0.0, 10.0, 30.0])
KFS_N_PER_MM = np.array([530.5647, 482.9829, 474.9636, 476.0073, 480.9952])
P1_M, P2_M = np.array([-0.043, 0.834, 0.486]), np.array([0.057, 0.947, 0.486])
UP = np.array([0.0, 0.0, 1.0])

# Reading A0: the flange axis level, Jacobian at the flange, one branch, joint limits broken.
A0_DEG = [
    [94.3761557843, 136.8287123512, -234.3116465963, -30.4396494693, 8.6623319271, 30.1533369804],
    [92.1005376125, 133.7088621269, -233.5802131891, -12.0760107306, 10.0901973797, 11.8945933704],
    [90.0, 130.6066090306, -232.7549718919, 0.0, 12.1483628613, 0.0],
    [89.010858487, 129.0703050932, -232.3077877876, 4.3118970834, 13.2737288625, -4.1971188029],
    [87.1460947859, 126.0404431426, -231.3461436813, 10.6945119782, 15.5632433788, -10.3109621796],
]
A0_TOOL_M = np.array([0.002, 0.0, 0.1447])
# Reading B: the paper's stated rule with a fitted tool, its point beside the flange axis.
B_DEG = [
    [84.4719347209, -50.1803137293, 53.9968430188, 60.1123385645, 4.6099689963, -23.1183822138],
    [83.4650911523, -49.9056266048, 52.2350401853, 45.2943018744, 5.4744067976, -9.2530792375],
    [82.5064110238, -49.5782231692, 50.4352394369, 35.1333763647, 6.5851456642, 0.0],
    [82.0442269615, -49.3955180157, 49.5212718034, 31.3269384442, 7.194914202, 3.3685269845],
    [81.152455391, -48.9935246776, 47.6654567618, 25.4698928849, 8.4794175171, 8.3802191207],
]
B_TOOL_M = np.array([-0.1750072386, -0.0040741652, 0.0076208662])


def path() -> Array:
    share = (X_MM * 1e-3 - P1_M[0]) / (P2_M[0] - P1_M[0])
    return np.asarray(P1_M + share[:, None] * (P2_M - P1_M))


@pytest.mark.parametrize(("deg", "tool"), [(A0_DEG, A0_TOOL_M), (B_DEG, B_TOOL_M)])
def test_the_angles_put_one_tool_on_the_path(kr60: fem.ArmModel, deg: list[list[float]], tool: Array) -> None:
    frames = forward_kinematics(kr60.robot, np.radians(deg))
    # Angles are given to 1e-10 deg, tools to 1e-10 m.
    np.testing.assert_allclose(tool_position(kr60.robot, frames, tool), path(), rtol=0, atol=1e-9)
    np.testing.assert_allclose(frames.R_flange, np.broadcast_to(frames.R_flange[2], (5, 3, 3)), rtol=0, atol=1e-10)


def test_reading_a0_gives_table_4_to_2e_4(kr60: fem.ArmModel) -> None:
    q = np.radians(A0_DEG)
    level = forward_kinematics(kr60.robot, q).R_flange[:, :, 2]
    np.testing.assert_allclose(level, np.broadcast_to([0.0, 1.0, 0.0], (5, 3)), rtol=0, atol=1e-10)
    k = stiffness_index(kr60, q, UP) * 1e-3
    # What two fitted lengths leave; the table has seven digits.
    np.testing.assert_allclose(k, KFS_N_PER_MM, rtol=2e-4)
    assert not kr60.robot.reachable(q).any()


def test_reading_b_gives_table_4_to_0_3_percent(kr60: fem.ArmModel) -> None:
    q = np.radians(B_DEG)
    k = normal_stiffness_index(translational(kr60, q, B_TOOL_M), UP) * 1e-3
    # Five fitted figures leave 0.04 %; 0.3 % is what siblings of this tool reach too.
    np.testing.assert_allclose(k, KFS_N_PER_MM, rtol=3e-3)
    assert kr60.robot.reachable(q).all()


def test_a_usual_spindle_does_not(kr60: fem.ArmModel) -> None:
    """In the poses of reading B, but with the tool point 200 mm ahead of the flange: no longer the table."""
    k = stiffness_index(kr60, np.radians(B_DEG), UP, np.array([0.065, 0.0, 0.2])) * 1e-3
    assert (np.abs(k / KFS_N_PER_MM - 1.0) > 0.05).any()
