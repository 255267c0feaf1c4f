"""Budgets of a pose and of the workspace: numbers, sentences and figures."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from figure_texts import texts
from matplotlib.figure import Figure

from fem import Budget, PartKind, build_model, compliance_budget, deflection, deflection_by_part
from robots import InputError, forward_kinematics, load_description, tool_position
from robots.arrays import Array
from stiffarm.commands.simulate.budgets import PoseBudget, WorkspaceBudget, pose_budget, workspace_budget
from stiffarm.commands.simulate.figures import energy_share_figure, pose_shares_figure, workspace_budget_figure
from stiffarm.pages.bars import part_colours
from stiffarm.pages.style import save_png

KR60 = build_model(load_description("kr60-3"))
XR701 = build_model(load_description("xr701")).with_springs({"j2": 5e5, "j3": 5e5, "j5": 2e5})
Q = np.radians([0.0, -40.0, 60.0, 0.0, -30.0, 0.0])
DOWN = np.array([0.0, 0.0, -650.0, 0.0, 0.0, 0.0])


def test_motion_along_a_force_adds_up_to_the_deflection() -> None:
    budget = pose_budget(KR60, Q, DOWN)
    assert budget.along is not None
    assert budget.along_unit == "mm"
    parts = deflection_by_part(KR60, Q[None], DOWN)
    for name, along in zip(budget.parts, budget.along, strict=True):
        assert along == pytest.approx(-1e3 * parts[name][0, 2], rel=1e-9, abs=1e-15)  # round-off; mm
    assert budget.along.sum() == pytest.approx(-1e3 * deflection(KR60, Q[None], DOWN)[0, 2], rel=1e-12)
    assert budget.parts[budget.order[0]] == budget.largest == "j2"
    assert np.all(np.diff(budget.energy[budget.order]) <= 0.0)


def test_motion_along_a_moment_is_a_turn_and_along_both_is_none() -> None:
    moment = np.array([0.0, 0.0, 0.0, 0.0, 200.0, 0.0])
    turned = pose_budget(KR60, Q, moment)
    assert turned.along is not None
    assert turned.along_unit == "mrad"
    assert turned.along.sum() == pytest.approx(1e3 * deflection(KR60, Q[None], moment)[0, 4], rel=1e-12)
    both = pose_budget(KR60, Q, DOWN + moment)
    assert both.along is None
    assert "along_load_mm" not in both.payload()
    assert both.payload()["parts"][0].keys() == {"part", "kind", "share", "strain_energy_mJ"}


def test_payload_is_sorted_and_adds_up() -> None:
    content = pose_budget(XR701, np.radians([0.0, 5.0, 77.5, 0.0, 0.0, 0.0]), DOWN).payload()
    shares = [part["share"] for part in content["parts"]]
    assert shares == sorted(shares, reverse=True)
    # Six significant digits in each.
    assert sum(shares) == pytest.approx(1.0, rel=1e-5)
    assert sum(content["share_by_kind"].values()) == pytest.approx(1.0, rel=1e-5)
    assert sum(p["along_load_mm"] for p in content["parts"]) == pytest.approx(content["along_load_mm"], rel=1e-5)
    assert content["largest"] == content["parts"][0]["part"]


@pytest.fixture(scope="module")
def workspace() -> WorkspaceBudget:
    return workspace_budget(KR60)


def test_the_workspace_is_sampled_within_its_limits_and_always_alike(workspace: WorkspaceBudget) -> None:
    robot = KR60.robot
    assert workspace.q.shape == (2000, 6)
    assert robot.reachable(workspace.q).all()
    assert workspace.swept == ("q2_deg", "q3_deg", "q4_deg", "q5_deg")
    assert not workspace.q[:, [0, 5]].any()
    # Low discrepancy: in each eighth of a coordinate's range an eighth of the poses, give or take a few.
    for column in (1, 2, 3, 4):
        count = np.histogram(workspace.q[:, column], 8, tuple(robot.limits[column]))[0]
        assert np.abs(count - 250).max() < 12  # plain random numbers: some 15 in one standard deviation
    again = workspace_budget(KR60)
    assert (again.q == workspace.q).all()
    assert (again.budget.share == workspace.budget.share).all()
    tool = tool_position(robot, forward_kinematics(robot, workspace.q))
    assert workspace.reach_mm == pytest.approx(1e3 * np.linalg.norm(tool[:, :2], axis=1), rel=1e-12)


def test_couplings_hold_in_the_sample() -> None:
    found = workspace_budget(XR701, 200)
    assert XR701.robot.reachable(found.q).all()
    assert found.swept == ("q2_deg", "q3real_deg", "q4_deg", "q5_deg")


def test_shares_are_those_of_the_budget_in_each_pose(workspace: WorkspaceBudget) -> None:
    exact = compliance_budget(KR60, workspace.q[:5], DOWN)
    assert workspace.budget.share[:5] == pytest.approx(exact.share, abs=1e-12)


def test_mean_shares_by_reach_are_means(workspace: WorkspaceBudget) -> None:
    edges = workspace.edges_mm()
    assert len(edges) > 4
    assert edges[0] <= workspace.reach_mm.min()
    assert edges[-1] >= workspace.reach_mm.max()
    mean = workspace.mean_share(edges)
    for i, (low, high) in enumerate(itertools.pairwise(edges)):
        mine = (workspace.reach_mm >= low) & (workspace.reach_mm < high)
        assert mine.sum() >= 15
        assert mean[i] == pytest.approx(workspace.budget.share[mine].mean(axis=0), rel=1e-12)


def made_up(share: Array, kinds: tuple[PartKind, ...], reach: Array) -> WorkspaceBudget:
    names = tuple(f"{kind} {i}" for i, kind in enumerate(kinds))
    budget = Budget(names, kinds, share, np.ones(len(share)))
    return WorkspaceBudget(budget, np.zeros((len(share), 6)), reach, ("q2_deg",))


def test_sentences_say_what_the_numbers_say() -> None:
    reach = np.linspace(0.0, 999.0, 1000)
    first = np.where(reach < 400.0, 0.8, 0.1)
    found = made_up(np.stack([first, 0.9 - first, np.full(1000, 0.1)], axis=1), ("joint", "joint", "link"), reach)
    assert found.sentences() == [
        "Shares in the strain energy, as the median and the range of nine poses in ten: "
        "joints 90 % (90 % to 90 %), links 10 % (10 % to 10 %).",
        "The largest share is that of joint 1 in 60 % of the poses, joint 0 in 40 %.",
        "By the tool's horizontal reach, on average joint 0 up to 400 mm and joint 1 beyond lead.",
    ]
    alone = made_up(np.ones((50, 1)), ("link",), np.full(50, 700.0))
    assert alone.sentences() == [
        "The largest share is that of link 0 in every pose.",
        "On average link 0 leads at every horizontal reach of the tool.",
    ]
    third = np.where((reach >= 400.0) & (reach < 600.0), 0.8, 0.1)
    between = made_up(np.stack([0.5 - 0.5 * third, third, 0.5 - 0.5 * third], axis=1), ("link",) * 3, reach)
    assert between.sentences()[-1].startswith("By the tool's horizontal reach, on average link 0 up to 400 mm, ")
    assert "link 1 from 400 to 600 mm" in between.sentences()[-1]


# --- figures -----------------------------------------------------------------------------------------------


def long_budget() -> PoseBudget:
    """Fifteen parts of every kind, one of them next to nothing and one nothing but round-off."""
    joints = [f"j{i}" for i in range(1, 7)]
    names = ("pedestal", "carousel", "upper-arm", "forearm", "wrist", *joints, "j3 other directions", "bar", "crank")
    kinds: tuple[PartKind, ...] = (*("link",) * 5, *("joint",) * 7, *("parallelogram",) * 2)  # type: ignore[assignment]
    energy = np.geomspace(1.0, 1e-4, 15)
    energy[-1] = 1e-30
    return PoseBudget((*names, "floor"), (*kinds, "other"), energy, 3.0 * energy, "mm")


def energy_share() -> Figure:
    return energy_share_figure(long_budget(), "Where the arm deflects", "q2 5 deg; load fz_N=−650")


def workspace_kr60() -> Figure:
    return workspace_budget_figure(workspace_budget(KR60), "Where the compliance comes from", "2000 poses")


def workspace_of_links() -> Figure:
    return workspace_budget_figure(workspace_budget(build_model(load_description("tx200")), 300), "Links alone")


def shares_by_pose() -> Figure:
    q = np.radians([[0.0, angle, 60.0, 0.0, -30.0, 0.0] for angle in (-80.0, -40.0, 0.0)])
    return pose_shares_figure(compliance_budget(KR60, q, DOWN), ("$a_$", "b", "_c}$"), np.array([1.0, 2.0, 0.5]))


@pytest.mark.slow
@pytest.mark.parametrize("make", [energy_share, workspace_kr60, workspace_of_links, shares_by_pose])
def test_figures_can_be_read(make: Callable[[], Figure], tmp_path: Path) -> None:
    """No warning, nothing cut off, no text on another, type not too small, axes with units."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure = make()
        save_png(figure, tmp_path / "figure.png")
    seen = texts(figure)
    for one in seen:
        # As in test_figures: glyphs are placed on whole pixels.
        assert min(one.box.x0, one.box.y0) >= -1, one
        assert max(one.box.x1 - figure.bbox.x1, one.box.y1 - figure.bbox.y1) <= 1, one
        assert one.size >= 8.0
    # The title holds an empty second line, where the facts stand.
    apart = [one for one in seen if not one.text.endswith("\n ")]
    for one, other in itertools.combinations(apart, 2):
        wide = min(one.box.x1, other.box.x1) - max(one.box.x0, other.box.x0)
        high = min(one.box.y1, other.box.y1) - max(one.box.y0, other.box.y0)
        assert wide < 2 or high < 5, (one, other)
    for ax in figure.axes:
        assert "(%)" in ax.get_xlabel() or "(mm)" in ax.get_xlabel()
    assert plt.get_fignums() == []


@pytest.mark.slow
def test_bars_are_sorted_and_say_per_cent_and_millimetres() -> None:
    budget = long_budget()
    figure = energy_share()
    widths = [bar.get_width() for bar in figure.axes[0].patches]
    assert widths == pytest.approx(sorted(100.0 * budget.share, reverse=True), rel=1e-12)
    seen = "\n".join(one.text for one in texts(figure))
    assert "pedestal deflects most, 48 %" in seen
    assert "48.2 %   3 mm" in seen
    assert "carries nothing" in seen
    assert "joints" in seen
    mixed = PoseBudget(budget.parts, budget.kinds, budget.energy, None, "mm")
    assert " mm" not in "\n".join(one.text for one in texts(energy_share_figure(mixed, "Mixed load")))
    with pytest.raises(InputError, match="no parts"):
        energy_share_figure(PoseBudget((), (), np.zeros(0), None, "mm"), "Nothing")


def test_bands_are_the_mean_shares() -> None:
    found = workspace_budget(KR60)
    edges = found.edges_mm()
    bars = workspace_budget_figure(found, "Bands").axes[1].patches
    heights = np.array([bar.get_height() for bar in bars]).reshape(-1, len(edges) - 1)
    assert heights.sum(axis=0) == pytest.approx(np.full(len(edges) - 1, 100.0), rel=1e-9)
    j2 = found.budget.parts.index("j2")
    assert heights[0] == pytest.approx(100.0 * found.mean_share(edges)[:, j2], rel=1e-12)


def test_columns_of_poses_add_up() -> None:
    figure = shares_by_pose()
    (ax,) = figure.axes
    heights = np.array([bar.get_height() for bar in ax.patches]).reshape(-1, 3)
    assert heights.sum(axis=0) == pytest.approx(np.full(3, 100.0), rel=1e-9)
    # Names come from files: a dollar is a dollar.
    assert {"$a_$\n1.00", "b\n2.00", "_c}$\n0.50"} <= {one.text for one in texts(figure)}
    with pytest.raises(InputError, match="one a pose"):
        pose_shares_figure(compliance_budget(KR60, Q[None], DOWN), ("a", "b"))


def test_joints_are_coloured_and_structure_is_grey() -> None:
    budget = long_budget()
    colours = part_colours(budget.parts, budget.kinds)
    assert colours.keys() == set(budget.parts)
    assert len(set(colours.values())) == len(colours)
    for name, kind in zip(budget.parts, budget.kinds, strict=True):
        red, green, blue = (int(colours[name][i : i + 2], 16) for i in (1, 3, 5))
        assert (max(red, green, blue) - min(red, green, blue) < 16) == (kind != "joint"), name
