"""Quantities of a map: held to closed forms of a planar arm, to each other and to the functions they come from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from map_arms import DOWN, K1, K2, L1, L2, engine, kr60, one_spring, planar
from refusals import refuses

import fem
from machining import INDICES
from machining.stiffness.indices import evaluate
from machining.stiffness.map_rows import ON_MAPS, index_rows
from robots import load_description
from robots.arrays import Array
from surrogate.maps.layouts import joint_layout, poses_of
from surrogate.maps.quantities import NEAR_SINGULAR, TABLE, Kind, Poses, Quantities, Quantity, named, uncertainty

ALL = slice(None)


def poses(model: fem.ArmModel, n: int, rng: np.random.Generator) -> Array:
    q = rng.uniform(*model.robot.limits.T, (4 * n, model.robot.dof))
    return q[model.robot.reachable(q)][:n]


ROWS = (*TABLE, *index_rows(np.array([0.0, 0.0, 1.0])))
MERITS = [row.short for row in ROWS if row.merit is not None]


def of(model: fem.ArmModel, *wanted: str, **more: object) -> Quantities:
    return Quantities(model, DOWN, named(ROWS, wanted), **more)  # type: ignore[arg-type]


def test_a_planar_arm_over_its_joints_in_closed_form() -> None:
    model = planar()
    grid = joint_layout(model.robot, model.robot.coordinates, 7)
    load = np.array([0.6, 0.8, 0.0])
    made = engine(model, grid, wanted=("stiffness", "worst", "singular"), direction=load).block(ALL)
    q1, q2 = poses_of(grid, model.robot, ALL).T
    tip = np.stack([L1 * np.cos(q1) + L2 * np.cos(q1 + q2), L1 * np.sin(q1) + L2 * np.sin(q1 + q2)])
    elbow = np.stack([L1 * np.cos(q1), L1 * np.sin(q1)])
    np.testing.assert_allclose(np.asarray(made["points"])[:, :2], tip.T, atol=1e-12)
    # Each spring turns the arm about its joint: columns of the Jacobian, J K^-1 J^T.
    J1, J2 = np.stack([-tip[1], tip[0]]), np.stack([-(tip - elbow)[1], (tip - elbow)[0]])
    C = np.einsum("in,jn->nij", J1, J1) / K1 + np.einsum("in,jn->nij", J2, J2) / K2
    along = np.einsum("i,nij,j->n", load[:2], C, load[:2])
    some = along > 1e-12 * along.max()
    np.testing.assert_allclose(np.asarray(made["stiffness_N_per_mm"])[some], 1e-3 / along[some], rtol=1e-9)
    largest = 0.5 * (np.trace(C, axis1=1, axis2=2) + np.hypot(C[:, 0, 0] - C[:, 1, 1], 2.0 * C[:, 0, 1]))
    np.testing.assert_allclose(made["worst_stiffness_N_per_mm"], 1e-3 / largest, rtol=1e-9)


def test_figures_agree_with_the_indices_of_machining(rng: np.random.Generator) -> None:
    model = kr60()
    q = poses(model, 50, rng)
    found = of(model, "stiffness", "worst", "best", "isotropy", "k_fs").values(q)
    C = fem.compliance(model, q)[:, :3, :3]
    normal = np.array([0.0, 0.0, 1.0])
    for name, index in (
        ("stiffness_N_per_mm", "directional"),
        ("worst_stiffness_N_per_mm", "weakest"),
        ("best_stiffness_N_per_mm", "strongest"),
        ("isotropy", "isotropy"),
    ):
        factor = 1e-3 if INDICES[index].degree else 1.0
        # The best direction of six springs is some 1e3 times stiffer than the worst: so many digits fewer.
        np.testing.assert_allclose(found[name], factor * evaluate(index, C, normal), rtol=1e-9, err_msg=name)


def test_the_worst_direction_is_the_one_with_the_worst_stiffness(rng: np.random.Generator) -> None:
    model = kr60()
    q = poses(model, 20, rng)
    found = of(model, "worst", "directions").values(q)
    direction = np.column_stack([found[f"worst_direction_{name}"] for name in "xyz"])
    along = np.einsum("ni,nij,nj->n", direction, fem.compliance(model, q)[:, :3, :3], direction)
    np.testing.assert_allclose(1e-3 / along, found["worst_stiffness_N_per_mm"], rtol=1e-9)
    rows = np.arange(len(q))
    assert (direction[rows, np.abs(direction).argmax(axis=1)] > 0.0).all()


def test_the_part_that_gives_way_most_is_that_of_the_budget(rng: np.random.Generator) -> None:
    model = kr60()
    q = poses(model, 30, rng)
    made = of(model, "softest", shares=True)
    found = made.values(q)
    budget = fem.compliance_budget(model, q, np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0]))
    assert made.parts == budget.parts
    np.testing.assert_allclose(found["shares"], budget.share)
    np.testing.assert_allclose(found["shares"].sum(axis=1), 1.0)
    names = [made.categories("softest_part")[int(i)] for i in found["softest_part"]]
    assert names == [budget.parts[i] for i in budget.share.argmax(axis=1)]


def test_poses_in_which_nothing_gives_way_along_the_load_do_not_stop_a_map(rng: np.random.Generator) -> None:
    # Joint 1 stands upright: a vertical load does not turn it, a level one does, and it has it all.
    model, q = one_spring(1e5), poses(kr60(), 5, rng)
    found = of(model, "softest", "stiffness", "isotropy").values(q)
    assert (found["softest_part"] == -1.0).all()
    assert np.isnan(found["softest_part_share"]).all()
    assert np.isnan(found["stiffness_N_per_mm"]).all()
    assert (found["isotropy"] == 0.0).all()
    level = replace(of(model, "softest"), direction=np.array([1.0, 1.0, 0.0]))
    assert level.parts == (model.robot.joint_names[0],)
    np.testing.assert_allclose(level.values(q)["softest_part_share"], 1.0)


def test_near_singular_poses_are_told() -> None:
    model = kr60()
    straight = np.radians([[0.0, -90.0, 90.0, 0.0, 0.0, 0.0], [0.0, -90.0, 90.0, 0.0, 60.0, 0.0]])
    found = of(model, "singular").values(straight)
    np.testing.assert_array_equal(found["near_singular"], [1.0, 0.0])
    assert found["jacobian_smallest_singular_value"][0] < NEAR_SINGULAR < found["jacobian_smallest_singular_value"][1]


def test_uncertainty_comes_from_what_is_given(rng: np.random.Generator) -> None:
    q = poses(kr60(), 5, rng)
    made = Quantities(kr60(), DOWN, (uncertainty(lambda q: 0.01 * np.abs(q[:, 0])),))
    np.testing.assert_allclose(made.values(q)["uncertainty_percent"], np.abs(q[:, 0]))


def test_the_tool_point_moves_with_the_tool(rng: np.random.Generator) -> None:
    q, point = poses(kr60(), 10, rng), np.array([0.1, 0.0, 0.3])
    found = of(kr60(), "stiffness", point=point).values(q)["stiffness_N_per_mm"]
    np.testing.assert_allclose(found, 1e-3 * fem.directional_stiffness(kr60(), q, DOWN, point), rtol=1e-10)


@pytest.mark.parametrize("short", MERITS)
def test_merits_are_the_fields_themselves(short: str, rng: np.random.Generator) -> None:
    q = poses(kr60(), 10, rng)
    made = of(kr60(), short)
    np.testing.assert_allclose(made.merit(made.rows[0])(q), made.values(q)[made.kinds[0].name], rtol=1e-12)


def test_many_poses_at_once_are_the_same_as_few(rng: np.random.Generator) -> None:
    model = fem.build_model(load_description("xr701"))
    q = poses(model, 5000, rng)
    made = of(model, *(row.short for row in ROWS if row.common))
    whole, part = made.values(q), made.values(q[:50])
    for name, values in part.items():
        # Above some number of poses compiled loops take over: the same to rounding.
        np.testing.assert_allclose(whole[name][:50], values, rtol=1e-8, atol=1e-12, err_msg=name)


def test_names_are_used_once_and_carry_units() -> None:
    kinds = [kind for row in ROWS for kind in row.kinds]
    for names in ([row.short for row in ROWS], [kind.name for kind in kinds]):
        assert len(set(names)) == len(names)
    assert all(kind.name.endswith("_N_per_mm") for kind in kinds if kind.unit == "N/mm")


@pytest.mark.parametrize("name", ON_MAPS)
def test_indices_of_machining_are_rows_like_any_other(name: str, rng: np.random.Generator) -> None:
    q, normal = poses(kr60(), 20, rng), np.array([0.0, 0.0, 1.0])
    made = of(kr60(), name)
    C = fem.compliance(kr60(), q)[:, :3, :3]
    # The force is along the load; no index depends on its size.
    np.testing.assert_allclose(
        made.values(q)[made.kinds[0].name], 1e-3 * evaluate(name, C, normal, 7.0 * DOWN), rtol=1e-9
    )


def test_a_row_of_ones_own_is_mapped_like_the_others(rng: np.random.Generator) -> None:
    def vertical(p: Poses) -> list[Array]:
        return [1e3 * p.translational[:, 2, 2]]

    q = poses(kr60(), 10, rng)
    own = Quantity("dip", (Kind("dip_mm_per_N", "mm/N", "dip under a vertical newton"),), vertical)
    made = Quantities(kr60(), DOWN, (*named(TABLE, ["stiffness"]), own)).values(q)
    np.testing.assert_allclose(made["dip_mm_per_N"], 1.0 / made["stiffness_N_per_mm"], rtol=1e-9)


def test_the_matrix_is_that_of_the_model_entry_by_entry(rng: np.random.Generator) -> None:
    q = poses(kr60(), 20, rng)
    found = of(kr60(), "compliance").values(q)
    C = fem.compliance(kr60(), q)
    assert len(found) == 21
    names = {"compliance_x_x_m_per_N": (0, 0), "compliance_y_rz_per_N": (1, 5), "compliance_rx_rz_rad_per_Nm": (3, 5)}
    for name, (i, j) in names.items():
        np.testing.assert_allclose(found[name], C[:, i, j], rtol=1e-9, atol=1e-20)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda q: named(TABLE, ("stifness",)), "quantities of a map"),
        (lambda q: named(TABLE, ()), "none"),
        (lambda q: replace(q, rows=()), "none"),
        (lambda q: replace(q, direction=np.zeros(3)), "load direction"),
        (lambda q: replace(q, direction=np.array([0.0, np.nan, 1.0])), "load direction"),
        (lambda q: replace(q, rows=named(TABLE, ["softest"]), model=kr60().with_rigid_joints()), "nothing deflects"),
        (lambda q: q.merit(named(TABLE, ["softest"])[0]), "chosen by"),
    ],
)
def test_what_is_refused(change: Callable[[Quantities], object], words: str) -> None:
    refuses("B001 S015", words, change, of(kr60(), "stiffness"))
