"""The whole arm as one shell model against the condensed path, and that the comparison can fail."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from refusals import refuses

from fem import ArmModel, build_model, compliance, deflection
from fem.elements.shell import CoupledShell, couple, rigid_motion
from fem.reference.shell_arm import couple_links, solve_shell_arm
from fem.statics.transfers import transfers
from robots import load_description
from robots.arrays import Array
from robots.kinematics import forward_kinematics, tool_position

Random = np.random.Generator
Draw = Callable[..., Array]
Soften = Callable[..., ArmModel]
Shells = dict[str, CoupledShell]

# Walls far stiffer than the arm is soft enlarge round-off. Measured: 2e-11 with rigid joints, 2e-10 to 2e-8 over
# sixteen draws of `soften`. The bound eps times the condition number of the scaled matrix, 5e10, would be 1e-5.
ROUND_OFF = 1e-7


@pytest.fixture(scope="module")
def looped() -> tuple[ArmModel, Shells]:
    model = build_model(load_description("xr701"), links="shell", load_path="parallelogram")
    return model, couple_links(model)


@pytest.fixture(
    scope="module",
    params=[
        "xr701 parallelogram",
        *(pytest.param(a, marks=pytest.mark.slow) for a in ("xr701 serial", "kr60-3 serial")),
    ],
)
def arm(request: pytest.FixtureRequest, looped: tuple[ArmModel, Shells]) -> tuple[ArmModel, Shells]:
    if request.param == "kr60-3 serial":
        model = build_model(load_description("kr60-3"), links="shell")
        return model, couple_links(model)
    if request.param == "xr701 parallelogram":
        return looped
    # The links are the same; to condense them again would cost a second.
    return replace(looped[0], load_path="serial", bar=None), looped[1]


def _difference(a: Array, b: Array) -> float:
    """Largest difference of two compliances (6, 6) relative to sqrt(C_ii C_jj), which bounds C_ij."""
    size = np.sqrt(np.diag(b))
    return float((np.abs(a - b) / (size[:, None] * size)).max())


@pytest.mark.slow
def test_condensed_path_equals_the_full_solve(
    arm: tuple[ArmModel, Shells], reachable: Draw, soften: Soften, furnish: Soften, rng: Random
) -> None:
    bare, shells = arm
    # Furnished: springs, tilts, structure and all.
    variants = [bare.with_rigid_joints(), furnish(soften(bare, rng, other=True), rng)]
    for model, q in zip(variants, reachable(bare.robot, 2, rng), strict=True):
        point, w = 0.3 * rng.normal(size=3), rng.normal(size=6) * [500, 500, 500, 100, 100, 100]
        full = solve_shell_arm(model, q, np.vstack([np.eye(6), w]), point, shells=shells)
        C = compliance(model, q[None], point)[0]
        assert _difference(full.displacement[:6].T, C) < ROUND_OFF
        bound = np.sqrt(np.diag(C) * (w @ C @ w))
        assert (np.abs(full.displacement[6] - deflection(model, q[None], w, point)[0]) / bound).max() < ROUND_OFF
        assert full.unknowns > 15_000  # every node is there


@pytest.mark.slow
@pytest.mark.parametrize("link", ["upper-arm", pytest.param("forearm", marks=pytest.mark.slow), "crank"])
def test_a_link_a_thousandth_thicker_is_noticed(
    looped: tuple[ArmModel, Shells], link: str, reachable: Draw, rng: Random
) -> None:
    model, shells = looped
    assert model.bar is not None
    assert model.bar.crank is not None
    part = {p.name: p for p in (*model.links, model.bar.crank)}[link]
    assert part.shell is not None
    thicker = couple(replace(part.shell, thickness=1.001 * part.shell.thickness), part.element.points)
    q = reachable(model.robot, 1, rng)
    full = solve_shell_arm(model, q[0], np.eye(6), shells={**shells, link: thicker})
    # Measured 6e-4 (upper arm), 4e-4 (forearm), 1e-4 (crank).
    assert _difference(full.displacement.T, compliance(model, q)[0]) > 10.0 * ROUND_OFF


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["flexible", pytest.param("rigid bar", marks=pytest.mark.slow), "rigid bar and crank"])
def test_the_bar(looped: tuple[ArmModel, Shells], kind: str, reachable: Draw, rng: Random) -> None:
    model, shells = looped
    assert model.bar is not None
    bar = model.bar if kind == "flexible" else replace(model.bar, compliance=0.0)
    bar = replace(bar, crank=None) if kind == "rigid bar and crank" else bar
    model = replace(model, bar=bar)
    q, w = reachable(model.robot, 1, rng), rng.normal(size=6) * 100.0
    full = solve_shell_arm(model, q[0], np.vstack([np.eye(6), w]), shells=shells)
    assert _difference(full.displacement[:6].T, compliance(model, q)[0]) < ROUND_OFF
    # Statics' bar force, whether or not the bar gives way, is what an elastic bar carries.
    elastic = replace(model, bar=replace(bar, compliance=1e-9))
    frames = forward_kinematics(model.robot, q)
    parts = transfers(elastic, frames, q, tool_position(model.robot, frames))
    expected = next(part for part in parts if part.name == "bar").carried(w[:, None])[0, 0]
    assert abs(expected) > 10.0  # N: enough to compare with
    assert full.bar_force is not None
    assert full.bar_force[6] == pytest.approx(expected, rel=ROUND_OFF)


@pytest.mark.slow
def test_parts_hold_together_where_they_meet(arm: tuple[ArmModel, Shells], reachable: Draw, rng: Random) -> None:
    """Base at rest; through rigid joints a link's root ring follows the ring below as one rigid body."""
    model, shells = arm[0].with_rigid_joints(), arm[1]
    q = reachable(model.robot, 1, rng)
    full = solve_shell_arm(model, q[0], [100.0, -50.0, -400.0, 10.0, 20.0, 30.0], shells=shells)
    frames = forward_kinematics(model.robot, q)
    below, above = (next(link for link in model.links if link.body == body) for body in (0, 1))
    assert below.shell is not None
    assert above.shell is not None
    root, tip = below.shell.interfaces["root"], below.shell.interfaces["tip"]
    assert np.array_equal(full.links[below.name][0, root, :3], np.zeros((root.size, 3)))
    joint = above.shell.interfaces["root"]
    at = frames.p[0, 1] + above.shell.nodes[joint] @ frames.R[0, 1].T
    # Displacements alone tell a ring's motion: about the wall's normal its nodes turn freely.
    body = rigid_motion(below.shell.nodes[tip])[:, :3].reshape(-1, 6)
    motion, rest, *_ = np.linalg.lstsq(body, full.links[below.name][0, tip, :3].ravel(), rcond=None)
    moved = rigid_motion(at)[:, :3] @ motion
    size = np.abs(moved).max()
    assert size > 1e-8  # it moves: metres
    # The same numbers through products of a dozen terms, and a fit of condition 1e2.
    assert np.sqrt(rest) < 1e-11 * size
    assert np.abs(full.links[above.name][0, joint, :3] - moved).max() < 1e-11 * size


def test_what_cannot_be_solved_is_refused(looped: tuple[ArmModel, Shells]) -> None:
    model, shells = looped
    w = np.ones(6)
    refuses("M003", "shell", solve_shell_arm, build_model(load_description("kr60-3"), links="beam"), np.zeros(6), w)
    refuses("M003", "shell", solve_shell_arm, build_model(load_description("kr60-3"), links="rigid"), np.zeros(6), w)
    refuses("B003", "one at a time", solve_shell_arm, model, np.zeros((2, 6)), w, shells=shells)
    refuses("A006", "finite", solve_shell_arm, model, np.zeros(6), w * np.nan, shells=shells)
    refuses("M007", "flat", solve_shell_arm, model, np.zeros(6), w, shells=shells)
