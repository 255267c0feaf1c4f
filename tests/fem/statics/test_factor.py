"""The compliance as a sum of squares: the same matrices as by the statics, and rows as smooth as they should be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from refusals import refuses

from fem import ArmModel, build_model, compliance, compliance_factor
from fem.model import LinkKind
from fem.springs import FourierBasis, LawSpring
from fem.statics.factor import _square_root
from robots import LoadPath, load_description
from robots.arrays import Array

Random = np.random.Generator
Draw = Callable[..., Array]
Soften = Callable[..., ArmModel]

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
