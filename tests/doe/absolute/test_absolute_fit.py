"""Numbers are found again, wrong readings named, and nothing is claimed that readings do not hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up_positions import Plan, Truth, campaign, position
from numpy.testing import assert_allclose
from refusals import refuses
from scipy.stats import multivariate_normal

from doe.absolute.calibrate import Positions, calibrate_positions, check_no_worse, fitted
from doe.absolute.campaign import PlannedCampaign, Target, Wanted, plan_campaign, visible
from doe.absolute.fit import fit
from doe.absolute.gross import Gross, gross
from doe.absolute.identified import findings
from doe.absolute.missing import evidence
from doe.absolute.missing.candidates import candidates
from doe.absolute.missing.diagnose import Missing, diagnose_positions
from doe.absolute.prediction import carried_over, folds, left_out, sessions_left_out
from doe.absolute.readings import AbsoluteReadings, Labels, Payload
from doe.absolute.reduced import FRAME
from doe.absolute.start import doubt, started
from doe.absolute.turns import rotation
from doe.absolute.unknowns import Layout, unknowns
from doe.planning.zones import Zone
from fem import ArmModel, build_model
from robots import forward_kinematics, load_description

FREE = ("geometry", "springs", "ratios", "periodic4")


@pytest.fixture(scope="module")
def found(kr60: ArmModel, two_targets: AbsoluteReadings) -> Positions:
    return calibrate_positions(kr60, two_targets, FREE, parts=5)


def test_numbers_are_found_again(found: Positions, truth: Truth) -> None:
    assert found.found.settled
    assert_allclose(found.found.variances.sigma, 2e-5, rtol=0.25)
    inside = []
    for f in found.findings:
        one = next(u for u in found.found.layout.unknowns if u.name == f.name)
        true = truth.get(f.name)
        if one.kind == "spring":
            true = 1.0 / true if true else np.inf
        if f.status == "not identified":
            assert one.kind == "periodic", f.name
            continue
        inside.append(f.interval95[0] <= one.factor * true <= f.interval95[1])
    # Of some 70 intervals of 95 % eight or more miss the truth once in forty campaigns; this one is fixed.
    assert inside.count(False) <= 7
    assert found["j2.stiffness"].value == pytest.approx(1e6, rel=0.05)
    assert found["j4.sin2"].value == pytest.approx(0.3, abs=0.05)
    assert found["j5.stiffness"].value is None
    assert np.isinf(found["j5.stiffness"].interval95[1])


def test_readings_left_out_lie_in_their_intervals(found: Positions) -> None:
    assert found.left_out.rms_m < 1.6 * np.sqrt(3.0) * 2e-5
    assert 0.9 <= found.left_out.coverage.share <= 0.99


def test_leaving_out_is_what_a_fit_without_them_gives(kr60: ArmModel, found: Positions) -> None:
    first = found.found
    whole = fit(kr60, first.data, first.layout, first.start, robust=False, variances=first.variances)
    part = folds(whole.data, 5)
    rest = whole.data.take(part != 0)
    # Names of sessions and targets stand in the order of the whole, which both parts begin with.
    again = fit(kr60, rest, whole.layout, started(kr60.robot, rest), robust=False, variances=whole.variances)
    there = carried_over(again, whole.data.take(part == 0))[0]
    error = left_out(whole, part).error[part == 0]
    assert_allclose(error, there.error, atol=0.1 * whole.variances.sigma)


def test_frames_and_targets_of_another_session_are_fitted_and_no_more(
    kr60: ArmModel, truth: Truth, found: Positions
) -> None:
    rng = np.random.default_rng(9)
    other = campaign(kr60, truth, Plan(40, targets=2, noise=2e-5), rng)
    other = replace(
        other, session=Labels(("new",), other.session.number), target=Labels(("c", "d"), other.target.number)
    )
    predicted, there = carried_over(found.found, other)
    assert predicted.rms_m < 2.0 * np.sqrt(3.0) * 2e-5
    assert predicted.coverage.share > 0.85
    held = [k for k, one in enumerate(there.layout.unknowns) if one.kind != "target"]
    assert_allclose(there.u[held], found.found.u[: len(held)])


def test_wrong_readings_are_named_with_their_cause_and_turn_no_frame(
    kr60: ArmModel, two_targets: AbsoluteReadings, found: Positions
) -> None:
    data = two_targets
    q, y, target = data.q.copy(), data.position.copy(), data.target.number.copy()
    q[7, 4] += np.pi / 2.0
    target[20] = 1 - target[20]
    y[33] += [0.05, -0.02, 0.4]
    wrong = replace(data, q=q, position=y, target=Labels(data.target.names, target))
    there = fit(kr60, wrong, found.found.layout, started(kr60.robot, wrong), variances=found.found.variances)
    by_row = {g.row: g.cause for g in gross(there)}
    assert set(by_row) == {7, 20, 33}
    assert "j5 turned by -90 deg" in by_row[7]
    assert "label is wrong" in by_row[20]
    assert "no single slip" in by_row[33]
    for a, b in zip(there.frames, found.found.frames, strict=True):
        assert np.linalg.norm(a.t - b.t) < 1e-4
    assert not found.gross


def test_curves_are_not_identified_where_no_angle_was_read(kr60: ArmModel) -> None:
    curves = Truth(
        {f"j{j}.{w}{n}": 2e-4 * (-1) ** n for j in range(1, 7) for w in ("sin", "cos") for n in (1, 2, 3)}
        | {f"target.a.{a}": 0.15 for a in "xyz"}
    )
    data = campaign(kr60, curves, Plan(220, noise=2e-5), np.random.default_rng(3))
    keep = np.abs(data.q[:, 3]) < 1.2
    c = calibrate_positions(kr60, data.take(keep), ("zeros", "periodic6"), parts=3)
    curve = next(one for one in c.curves if one.joint == "j4")
    beyond = np.abs(np.angle(np.exp(1j * curve.angle))) > 1.6
    assert curve.known[~beyond].mean() > 0.5
    assert not curve.known[beyond].any()
    far = carried_over(c.found, data.take(np.abs(data.q[:, 3]) > 2.0))[0]
    assert np.median(far.half95) > 1.5 * np.median(c.left_out.half95)


def test_springs_need_something_that_weighs(two_targets: AbsoluteReadings) -> None:
    model = build_model(load_description("kr16-2"), "rigid")
    refuses("C004", "masses", calibrate_positions, model, two_targets, ("springs",))


def test_names_that_are_none_and_sessions_too_short_are_refused(kr60: ArmModel, two_targets: AbsoluteReadings) -> None:
    refuses("M001", r"j9\.zero", unknowns, kr60.robot, two_targets, ("j9.zero",))
    refuses("C001", "readings of session", started, kr60.robot, two_targets.take(np.arange(5)))


@pytest.mark.parametrize(("factors", "words"), [((1e-3,) * 3, "0.001 times"), ((1.0, -1.0, 1.0), "mirror")])
def test_positions_in_another_unit_or_mirrored_are_refused(
    kr60: ArmModel, two_targets: AbsoluteReadings, factors: tuple[float, ...], words: str
) -> None:
    refuses("C007", words, started, kr60.robot, replace(two_targets, position=two_targets.position * np.array(factors)))


def test_positions_in_a_plane_have_a_frame(kr60: ArmModel) -> None:
    rng = np.random.default_rng(4)
    truth = Truth({"target.a.x": 0.1, "target.a.z": 0.2})
    data = campaign(kr60, truth, Plan(40), rng)
    q = data.q.copy()
    q[:, [0, 3, 5]] = 0.0
    y = np.array([position(kr60, truth, one, "a", data.payloads[0], 0.0, (0.0, 0.0)) for one in q])
    turn = rotation(np.array([0.3, -0.5, 0.8]))
    flat = replace(data, q=q, position=y @ turn.T + [1.0, 2.0, 0.5] + 1e-5 * rng.normal(size=y.shape))
    begin = started(kr60.robot, flat)
    assert_allclose(begin.frames[0].R, turn, atol=1e-3)
    assert np.median(begin.error) < 1e-3


def test_angles_that_are_not_the_arms_are_refused_or_doubted(kr60: ArmModel, two_targets: AbsoluteReadings) -> None:
    signs = np.array([1.0, 1.0, 1.0, 1.0, -1.0, 1.0])
    begin = started(kr60.robot, replace(two_targets, q=two_targets.q * signs))
    assert "misses half of its readings" in doubt(kr60.robot, begin.error)[0]
    assert not doubt(kr60.robot, started(kr60.robot, two_targets).error)
    same = replace(two_targets, q=np.repeat(two_targets.q[:1], len(two_targets), axis=0))
    refuses("C007", "no frame", started, kr60.robot, same)


def test_readings_held_out_keep_known_frames_and_bring_new_targets_and_payloads(found: Positions) -> None:
    data = found.found.data
    known = carried_over(found.found, data.take(np.arange(20)))[0]
    assert_allclose(known.error, found.found.residual[:20], atol=5e-8)
    renamed = replace(data.take(np.arange(40)), target=Labels(("z",), np.zeros(40, dtype=np.int64)))
    renamed = renamed.take(data.target.number[:40] == 0)
    heavy = (Payload(50.0, np.zeros(3)), *renamed.payloads)
    moved = replace(renamed, payloads=heavy, payload=renamed.payload + 1)
    one, other = (carried_over(found.found, x)[0] for x in (renamed, moved))
    assert_allclose(one.error, other.error, atol=1e-9)
    assert one.rms_m < 3.0 * np.sqrt(3.0) * 2e-5


def test_single_names_and_groups_free_the_same_once(kr60: ArmModel, two_targets: AbsoluteReadings) -> None:
    some = Layout(unknowns(kr60.robot, two_targets, ("zeros", "j2.zero", "j3.per.j2", "j4.cos7", "j2.rx", "base.ry")))
    curve = Layout(unknowns(kr60.robot, two_targets, ("j2.periodic",)))
    names = [one.name for one in some.unknowns if one.kind != "target"]
    assert names == [*(f"j{k}.zero" for k in range(1, 7)), "j3.per.j2", "j4.cos7", "j2.rx", "base.ry"]
    assert {one.index[0] for one in curve.unknowns if one.kind == "periodic"} == {1}
    refuses("M001", r"rail\.x", unknowns, kr60.robot, two_targets, ("rail.x",))


def test_springs_that_the_model_has_stay_where_they_are_not_free(
    kr60: ArmModel, truth: Truth, two_targets: AbsoluteReadings
) -> None:
    rigid = {f"j{j}": np.inf for j in range(1, 7)}
    soft = kr60.with_springs(rigid | {"j2": 1e6, "j3": 5e5})
    free = ("geometry", "ratios", "periodic4")
    with_them, without = (calibrate_positions(m, two_targets, free, parts=3) for m in (soft, kr60.with_springs(rigid)))
    assert with_them.left_out.rms_m < 1.7 * np.sqrt(3.0) * 2e-5
    assert without.left_out.rms_m > 3.0 * with_them.left_out.rms_m
    assert not [f for f in with_them.findings if "stiffness" in f.name]
    predicted = carried_over(with_them.found, two_targets.take(np.arange(10)))[0]
    assert_allclose(predicted.error, with_them.found.residual[:10], atol=1e-7)


def test_targets_of_a_pose_are_left_out_together(kr60: ArmModel) -> None:
    """Printed is what fits anew without the poses give, where joints have errors that nobody asked for."""
    rng = np.random.default_rng(21)
    curves = Truth(
        {f"j{j}.{w}{n}": 4e-4 * rng.normal() for j in range(1, 7) for w in ("sin", "cos") for n in (3, 4)}
        | {f"target.{t}.{a}": float(rng.uniform(-0.2, 0.2)) for t in "abc" for a in "xyz"}
    )
    one = campaign(kr60, curves, Plan(42, noise=2e-5), rng)
    data = several_targets(kr60, curves, one)
    c = calibrate_positions(kr60, data, ("geometry", "periodic1"), robust=False)
    assert len(set(folds(data, 10).tolist())) == 10
    error = np.empty((len(data), 3))
    part = folds(data, 5)
    for k in range(5):
        rest = data.take(part != k)
        again = fit(kr60, rest, c.found.moving, started(kr60.robot, rest), robust=False)
        error[part == k] = carried_over(again, data.take(part == k))[0].error
    anew = float(np.sqrt(np.mean(np.sum(error**2, axis=1))))
    rows = np.random.default_rng(0).permutation(len(data)) % 10
    assert left_out(c.found, rows).rms_m < 0.85 * anew
    assert c.left_out.rms_m == pytest.approx(anew, rel=0.1)


def several_targets(model: ArmModel, truth: Truth, data: AbsoluteReadings) -> AbsoluteReadings:
    """The poses of a campaign with three targets at each, in its frame (positions of the arm's base: no noise)."""
    nothing, n = Payload(0.0, np.zeros(3)), len(data)
    rows, target = np.repeat(np.arange(n), 3), np.tile(np.arange(3, dtype=np.int64), n)
    y = np.array(
        [
            position(model, truth, data.q[k], "abc"[t], nothing, 0.0, (0.0, 0.0))
            for k, t in zip(rows, target, strict=True)
        ]
    )
    y += 2e-5 * np.random.default_rng(4).normal(size=y.shape)
    many = data.take(rows)
    return replace(many, position=y, target=Labels(("a", "b", "c"), target), line=np.arange(3 * n) + 2)


def test_sessions_left_out_bring_no_frame_with_them(kr60: ArmModel, truth: Truth, found: Positions) -> None:
    apart = sessions_left_out(found.found, 10)
    assert apart is not None
    data, k = found.found.data, 1
    other = data.session.number == k
    rest = data.take(~other)
    again = fit(
        kr60, rest, found.found.moving.with_targets(rest), started(kr60.robot, rest), variances=found.found.variances
    )
    moved = replace(data.take(other), position=data.position[other] + [1.0, -2.0, 0.5])
    assert_allclose(apart.error[other], carried_over(again, moved)[0].error, atol=0.2 * found.found.variances.sigma)
    assert calibrate_positions(kr60, rest, ("zeros",), parts=2).sessions_out is None


def test_an_estimate_that_ends_worse_than_it_began_is_refused(found: Positions) -> None:
    worse = replace(found.before, residual=1.01 * found.before.residual)
    refuses("C008", "RMS of the readings", check_no_worse, found.before, worse, ())
    check_no_worse(found.before, found.found, found.gross)
    # A wrong reading that a good estimate leaves far out decides nothing.
    residual = found.found.residual.copy()
    residual[3] += 100.0 * found.before.rms_m
    spoilt = replace(found.found, residual=residual)
    check_no_worse(found.before, spoilt, (Gross(5, 3, 1.0, ""),))
    refuses("C008", "", check_no_worse, found.before, spoilt, ())


@pytest.mark.parametrize("way", [(1.0, 0.0, 0.0), (0.004, 1.0, 0.0), (0.004, 0.0, 1.0), (0.7, -0.6, 0.4)])
@pytest.mark.parametrize("free", [("geometry", "rail.x", "rail.y", "rail.z"), ("geometry",), ("zeros",)])
def test_a_base_may_be_carried_any_way(kr60: ArmModel, way: tuple[float, ...], free: tuple[str, ...]) -> None:
    """The way is known from the start, whichever of it are twins of frames, and whatever is free."""
    truth = Truth(
        {f"rail.{a}": v for a, v in zip("xyz", way, strict=True)}
        | {"j2.zero": 1e-3, "j3.zero": -2e-3, "j4.zero": 1e-3}
        | {f"target.{t}.{a}": 0.1 for t in "ab" for a in "xyz"}
        | {"target.b.x": -0.1}
    )
    data = campaign(kr60, truth, Plan(60, targets=2, rail=1.2, noise=2e-5), np.random.default_rng(8))
    c = calibrate_positions(kr60, data, free, parts=3)
    before, after, out = (float(np.sqrt(np.mean(d**2))) for d in c.distances().values())
    assert before < 0.01
    assert after < 1.2 * np.sqrt(3.0) * 2e-5
    assert out < 1.6 * np.sqrt(3.0) * 2e-5


# ------------------------------------------------------------
# Plans of position campaigns: what the tracker sees, and that the plan tells what it promises

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


# ------------------------------------------------------------
# What absolute readings say is missing: evidence by its definition, effects of made-up arms, nothing where none is

SIZE = 3e-4


@pytest.fixture(scope="module")
def few(kr60: ArmModel) -> AbsoluteReadings:
    return campaign(kr60, Truth({"target.a.x": 0.1, "j3.ratio": 2e-4}), Plan(14), np.random.default_rng(3))


def test_evidence_is_that_of_a_normal_distribution(kr60: ArmModel, few: AbsoluteReadings) -> None:
    layout = Layout(unknowns(kr60.robot, few, ("zeros",)))
    found = fitted(kr60, few, layout, started(kr60.robot, few), robust=False)
    ratio = next(c for c in candidates(kr60, few) if c.code == "gear-ratio:j3")
    g = evidence.ground(found, [ratio])
    sigma, column = found.variances.sigma, np.array([g.place["j3.ratio"]])
    at = evidence._At.of(g, sigma)
    gains, _ = evidence._Columns.of(at, column, np.ones(1), None).gains(np.array([SIZE]), np.ones(1))

    # The same by the readings' whole covariance, frames projected out.
    u = np.concatenate([found.u, np.zeros(1)])
    whole = Layout((*layout.unknowns, *ratio.unknowns))
    rows = evidence._rows(found, whole, u, np.arange(len(u)), np.ones(len(few)), np.arange(len(few)), 0)
    Q = np.linalg.svd(rows[:, :FRAME])[0][:, FRAME:]
    A, c, y = Q.T @ rows[:, FRAME : FRAME + len(layout)], Q.T @ rows[:, FRAME + len(layout)], Q.T @ rows[:, -1]
    sd = found.variances.sds(layout.unknowns)
    y = y + A @ found.u  # from the priors' means, where the unknowns are zero
    without = sigma**2 * np.eye(len(y)) + (A * sd**2) @ A.T
    density = [multivariate_normal(cov=V).logpdf(y) for V in (without, without + SIZE**2 * np.outer(c, c))]
    # Priors of a metre on targets beside readings of micrometres leave some six digits.
    assert float(gains[0, 0]) == pytest.approx(density[1] - density[0], rel=1e-5)


def test_compliances_are_none_below_zero(kr60: ArmModel, few: AbsoluteReadings) -> None:
    s, y = np.array([50.0]), np.array([3.0])
    both, positive = (
        evidence._Columns(s, way * y, np.eye(1), np.array([True])).gains(np.array([1.0]), np.ones(1))[0][0, 0]
        for way in (-1.0, 1.0)
    )
    free = evidence._Columns(s, y, np.eye(1), np.array([False])).gains(np.array([1.0]), np.ones(1))[0][0, 0]
    # The half of the prior below zero goes to the half above; a number surely below has all but no mass left.
    assert positive - free == pytest.approx(np.log(2.0), abs=0.01)
    assert both < free - 5.0


def found_of(kr60: ArmModel, hidden: dict[str, float], seed: int) -> Missing:
    rng = np.random.default_rng(seed)
    usual = {
        f"j{j}.{name}": float(5e-4 * rng.normal()) for j in range(2, 7) for name in ("frame.x", "frame.rx", "zero")
    }
    data = campaign(kr60, Truth(usual | {"target.a.x": 0.1, "target.a.z": 0.2} | hidden), Plan(80), rng)
    data = replace(data, time=np.arange(80.0), temperature=np.linspace(18.0, 24.0, 80))
    return diagnose_positions(kr60, data)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "hidden"),
    [
        ("gear-ratio:j2", {"j2.ratio": 4e-4}),
        ("joint-coupling:j5.j4", {"j5.per.j4": 6e-4}),
        ("joint-error:j3", {"j3.sin1": 3e-4, "j3.cos2": 1e-4}),
        ("joint-compliance:j3", {"j3.stiffness": 1.5e-6}),
    ],
)
def test_what_is_hidden_is_named_and_nothing_else(kr60: ArmModel, code: str, hidden: dict[str, float]) -> None:
    m = found_of(kr60, hidden, 7)
    assert m.verdict == "named", m.reason
    assert [one.candidate.code for one in m.effects] == [code]
    before, after = m.left_out_rms()
    assert after < before


@pytest.mark.slow
def test_lost_motion_is_named_where_poses_were_come_to_from_both_sides(kr60: ArmModel) -> None:
    rng = np.random.default_rng(4)
    data = campaign(kr60, Truth({"target.a.x": 0.1, "target.a.z": 0.2}), Plan(80), rng)
    way = rng.choice([-1.0, 1.0], data.q.shape)
    # What the joint says is ahead of where it is.
    said = data.q + 0.5 * way * np.array([0.0, 4e-4, 0.0, 0.0, 0.0, 0.0])
    m = diagnose_positions(kr60, replace(data, q=said, approach=way))
    assert [one.candidate.code for one in m.effects] == ["lost-motion:j2"]
    one = next(f for f in findings(m.after) if f.name == "j2.reversal")
    assert one.interval95[0] < 0.4 < one.interval95[1]


@pytest.mark.slow
def test_nothing_is_named_where_nothing_is_missing(kr60: ArmModel) -> None:
    for seed in (1, 2, 3):
        m = found_of(kr60, {}, seed)
        assert (m.verdict, m.found) == ("none", ())
