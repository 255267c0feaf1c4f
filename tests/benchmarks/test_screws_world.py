"""The world by screws: its rigid springs are ours, its sets repeat byte for byte, nothing hidden stands out nowhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import block_diag

from benchmarks.worlds.screws.arm import arm, body_motions
from benchmarks.worlds.screws.joint_laws import maxwell
from benchmarks.worlds.screws.mechanics import HANDLING_S, Campaign, World, lagging, readings
from benchmarks.worlds.screws.outside_laws import CATALOGUE, OUTSIDE
from benchmarks.worlds.screws.sets import conducted, model_of
from benchmarks.worlds.screws.truth import SORTS, Truth, anywhere, blocks, truth, unexplained
from fem import build_model, deflection
from robots.library.models import parse_description


def alone(q_deg: np.ndarray, force: np.ndarray) -> Campaign:
    n = len(q_deg)
    one, zero = np.arange(n), np.zeros(n, dtype=np.int64)
    return Campaign(
        q_deg,
        force,
        np.zeros((n, 3)),
        one,
        zero + 1,
        one,
        one,
        one,
        zero > 0,
        np.linspace(0.0, 600.0, n),
        zero,
        np.full(n, 20.0),
    )


# This world has no beams beside a parallelogram's bar.
ARMS = [(name, links) for name in ("kr60-3", "tx200", "mast7", "picker5") for links in ("rigid", "beam")]


@pytest.mark.parametrize(("name", "links"), [*ARMS, ("xr701", "rigid")])
def test_it_moves_as_our_arms_do(name: str, links: str) -> None:
    a, rng = arm(name), np.random.default_rng(3)
    t = replace(truth(1, "none", 0), arm=a, free=tuple(range(a.size)), nominal=a.springs)
    t = replace(t, model_path=0.0 if a.pin is None else 1.0)
    description = parse_description(model_of(t), name)
    q, force = anywhere(a, rng, 12), rng.normal(size=(12, 3)) * 300.0
    share = {link.name: 1.0 for link in a.links} if links == "beam" else {}
    world = World(a, 1.0 / a.springs, t.model_path, share, np.zeros(a.size))
    ours = readings(world, (), alone(q, force))
    model = build_model(description, links=links)  # type: ignore[arg-type]
    theirs = deflection(model, np.deg2rad(q), np.concatenate([force, np.zeros((12, 3))], axis=1))[:, :3]
    scale = np.linalg.norm(theirs, axis=1).max()
    # Beams: both have their own idea of a taper, a shear factor and a torsion constant.
    assert np.abs(ours - theirs).max() < (1e-6 if links == "rigid" else 0.02) * scale


def test_home_is_where_the_tool_point_is() -> None:
    a = arm("tx200")
    motion = body_motions(a.screws, a.joint_angles(np.zeros((1, a.size))))[0, -1] @ a.flange
    np.testing.assert_allclose(motion[:3, 3], [0.25, 0.0, 0.642 + 0.95 + 0.8 + 0.194], atol=1e-12)


def test_maxwell_elements_hold_at_first_and_slip_in_the_end() -> None:
    k, limits, breaks = 1e6, np.array([20.0, 40.0]), np.array([2e-5, 8e-5])
    law = maxwell(k, limits, limits / breaks)
    up = [float(law(np.array([t]))[0]) for t in (10.0, 500.0)]
    down = float(law(np.array([10.0]))[0])
    assert up[0] < 10.0 / k
    assert up[1] == pytest.approx((500.0 - 60.0) / k, rel=1e-6)
    assert down > up[0] + 1e-5


def relaxing(_t: float, y: np.ndarray, aim: float, lag: float) -> np.ndarray:
    return (aim - y) / lag


def test_creep_climbs_while_loaded_and_recovers_while_not() -> None:
    c = alone(np.zeros((4, 6)), np.zeros((4, 3)))
    c = replace(c, cycle=np.array([0, 0, 1, 1]), time_s=np.array([100.0, 400.0, 1000.0, 1300.0]))
    lag, load = 250.0, np.array([1.0, 2.0, 1.0, 0.5])
    x, t, out = 0.0, 100.0 - HANDLING_S, []
    zero, held = 0.0, 0.0
    for i in range(4):
        for end, aim in ((c.time_s[i] - HANDLING_S, 0.0 if i == 2 else held), (c.time_s[i], load[i])):
            x = float(solve_ivp(relaxing, (t, end), [x], args=(aim, lag), rtol=1e-9, atol=1e-12).y[0, -1])
            zero = x if i in {0, 2} and end < c.time_s[i] else zero
            t = end
        held = load[i]
        out.append(x - zero)
    np.testing.assert_allclose(lagging(c, load, lag), out, rtol=1e-6)


def test_what_stands_out_is_weighted_by_the_whole_covariance() -> None:
    rng = np.random.default_rng(1)
    springs, seen = rng.normal(size=(12, 3, 2)), rng.normal(size=(12, 3))
    root = blocks(np.arange(12) // 4, 0.3 * rng.normal(size=(12, 3)))
    half = rng.normal(size=(12, 3, 3))
    own = half @ np.swapaxes(half, 1, 2) + np.eye(3)
    seen = seen + springs @ np.array([2.0, 3.0])
    dense = block_diag(*own) + root.reshape(36, -1) @ root.reshape(36, -1).T
    A, b, W = springs.reshape(36, 2), seen.reshape(36), np.linalg.inv(dense)
    best = np.linalg.solve(A.T @ W @ A, A.T @ W @ b)
    assert best.min() > 0.0
    assert unexplained(own, root, springs, seen) == pytest.approx(float((b - A @ best) @ W @ (b - A @ best)), rel=1e-9)


def test_a_sheet_that_begins_by_unloading_is_read_after_the_largest_load() -> None:
    t = truth(5, "none", 0)
    q = dict.fromkeys(t.arm.coordinates, "10")
    sheet = [
        {**q, "pose": "a", "fz_N": f"{fz}", "phase": phase} for fz, phase in ((-50, "unloading"), (-20, "unloading"))
    ]
    sheet += [{**q, "pose": "b", "fz_N": "-20", "phase": "loading"}]
    campaign, rows = conducted(t, sheet, 1)
    np.testing.assert_array_equal(rows, [1, 2, 3])
    np.testing.assert_array_equal(campaign.cycle, [0, 0, 0, 1])
    assert campaign.force[0, 2] == pytest.approx(-np.linalg.norm(t.campaign.force, axis=1).max())


@pytest.mark.slow
@pytest.mark.parametrize("sort", ["single", "outside"])
def test_each_law_goes_on_over_a_later_visit(sort: str) -> None:
    for index in range(len(CATALOGUE if sort == "single" else OUTSIDE)):
        t = truth(3, sort, index)
        force = dict(zip(("fx_N", "fy_N", "fz_N"), map(str, t.campaign.force[0]), strict=True))
        angles = dict(zip(t.arm.coordinates, map(str, t.campaign.q_deg[0]), strict=True))
        campaign, _ = conducted(t, [{**angles, **force, "pose": "again"}], 1)
        d = readings(t.built, t.effects, t.campaign.joined(campaign))[-1]
        assert np.isfinite(d).all()
        # The same arm under the same load: what time and history do to it is less than half of all.
        first = readings(t.built, t.effects, t.campaign)[0]
        assert np.linalg.norm(d - first) < 0.5 * np.linalg.norm(first) + 1e-4, t.effects[0].code


@pytest.mark.slow
@pytest.mark.parametrize("sort", SORTS)
def test_each_law_works_and_most_stand_out(sort: str) -> None:
    count = {"single": len(CATALOGUE), "none": 5, "outside": len(OUTSIDE), "pairs": 5}[sort]
    made: list[Truth] = [truth(2, sort, index) for index in range(count)]
    codes = {e.code.removeprefix("other:").split(":")[0] for t in made for e in t.effects}
    for t in made:
        assert np.isfinite(readings(t.built, t.effects, t.campaign)).all()
    if sort in {"single", "outside"}:
        assert codes == set(CATALOGUE if sort == "single" else OUTSIDE)
        assert sum(t.both >= 30.0 for t in made) > 0.5 * count
    if sort == "none":
        assert max(t.both for t in made) < 1e-4
