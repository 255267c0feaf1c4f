"""Plans of position campaigns: what the tracker sees, and that the plan tells what it promises."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up_positions import Truth, position
from numpy.testing import assert_allclose
from refusals import refuses

from doe.absolute.calibrate import calibrate_positions
from doe.absolute.campaign import PlannedCampaign, Target, Wanted, plan_campaign, visible
from doe.absolute.readings import AbsoluteReadings, Labels, Payload
from doe.planning.zones import Zone
from fem import ArmModel
from robots import forward_kinematics

TARGETS = (
    Target("a", np.array([0.1, 0.0, 0.05])),
    Target("b", np.array([-0.1, 0.1, 0.05]), np.array([0.0, 0.0, 2.0])),
    Target("c", np.array([0.0, -0.15, 0.1])),
)
WANTED = Wanted(24, TARGETS, np.array([3.0, 1.0, 1.0]), free=("geometry",), sigma=3e-5, candidates=200)


@pytest.fixture(scope="module")
def planned(kr60: ArmModel) -> PlannedCampaign:
    return plan_campaign(kr60, WANTED)


def test_poses_are_reachable_seen_and_each_once(kr60: ArmModel, planned: PlannedCampaign) -> None:
    assert planned.q.shape == (24, 6)
    assert kr60.robot.reachable(planned.q).all()
    assert planned.seen.any(axis=1).all()
    assert (planned.seen == visible(kr60, planned.q, TARGETS, WANTED.tracker)).all()
    assert len(np.unique(planned.q, axis=0)) == 24
    # A target that looks along an axis is seen from fewer sides.
    assert planned.seen[:, 1].sum() < planned.seen[:, 0].sum()


def test_a_plan_tells_more_than_random_poses(planned: PlannedCampaign) -> None:
    better = [e.sd < e.random_sd for e in planned.expected]
    assert np.mean(better) > 0.8
    assert all(e.identified for e in planned.expected)
    assert {t.name for t in planned.twins} >= {"j1.zero", "j6.zero", "j1.frame.x"}


def test_a_calibration_on_the_plan_is_as_sure_as_it_promised(kr60: ArmModel, planned: PlannedCampaign) -> None:
    rng = np.random.default_rng(2)
    pose, target = np.nonzero(planned.seen)
    truth = Truth({f"target.{t.name}.{x}": float(v) for t in TARGETS for x, v in zip("xyz", t.point, strict=True)})
    nothing = Payload(0.0, np.zeros(3))
    y = np.array(
        [
            position(kr60, truth, planned.q[k], TARGETS[t].name, nothing, 0.0, (0.0, 0.0))
            for k, t in zip(pose, target, strict=True)
        ]
    )
    n = len(pose)
    data = AbsoluteReadings(
        "plan",
        "",
        planned.q[pose],
        y + 3e-5 * rng.normal(size=y.shape),
        Labels.of(("s",) * n),
        Labels.of(tuple(TARGETS[t].name for t in target)),
        np.zeros(n, dtype=np.int64),
        (nothing,),
        np.zeros(n),
        np.full(n, np.nan),
        np.arange(n),
    )
    found = calibrate_positions(kr60, data, ("geometry",), robust=False, parts=2).found
    scale = 3e-5 / found.variances.sigma
    sds = {one.name: one.factor * sd for one, sd in zip(found.layout.unknowns, found.sd, strict=True)}
    promised = {e.name: e.sd for e in planned.expected}
    # At the estimate, a little off the model: derivatives change by a thousandth or two.
    assert_allclose([sds[name] * scale for name in promised], list(promised.values()), rtol=0.02)


def test_lost_motion_is_planned_from_either_side(kr60: ArmModel, planned: PlannedCampaign) -> None:
    both = plan_campaign(kr60, replace(WANTED, free=("geometry", "reversal")))
    assert not planned.approach.size
    assert set(np.unique(both.approach)) == {-1.0, 1.0}
    assert both.approach.shape == both.q.shape
    assert both.readings == 2 * both.seen.sum()
    lost = [e for e in both.expected if e.name.endswith(".reversal")]
    # Turning back by a milliradian moves a target a metre away by a millimetre: told to some hundredths.
    assert [e.name for e in lost] == [f"j{j}.reversal" for j in range(1, 7)]
    assert all(e.identified for e in lost)


def test_few_candidates_are_twice_as_many_as_poses(kr60: ArmModel) -> None:
    assert plan_campaign(kr60, replace(WANTED, poses=9, candidates=1, free=("zeros",))).candidates == 18


def test_what_blocks_the_beam_and_where_targets_look(kr60: ArmModel) -> None:
    q = np.zeros((1, 6))
    at = forward_kinematics(kr60.robot, q)
    p, R = at.p_flange[0], at.R_flange[0]
    ahead, behind = p + 2.0 * R[:, 2], p - 2.0 * R[:, 2]
    point = np.zeros(3)
    looks = Target("x", point, np.array([0.0, 0.0, 1.0]))
    anywhere = Target("y", point)
    assert visible(kr60, q, (looks, anywhere), ahead).tolist() == [[True, True]]
    # From behind the beam runs along the forearm.
    assert visible(kr60, q, (looks, anywhere), behind).tolist() == [[False, False]]
    beside = p + 2.0 * R[:, 1] + 0.5 * R[:, 2]
    assert visible(kr60, q, (looks, anywhere), beside).tolist() == [[False, True]]


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        (
            {
                "tracker": np.array([0.0, 0.0, -40.0]),
                "targets": (Target("up", np.zeros(3), np.array([0.0, 0.0, 1.0])),),
                "zone": Zone(floor=5.0),
            },
            "sees",
        ),
        ({"targets": ()}, "targets"),
        ({"free": ("geometry", "periodic")}, "periodic"),
        ({"free": ("j9.zero",)}, "j9.zero"),
    ],
)
def test_plans_that_cannot_be_are_refused(kr60: ArmModel, changed: dict[str, object], words: str) -> None:
    refuses("C005 M001", words, plan_campaign, kr60, replace(WANTED, **changed))
