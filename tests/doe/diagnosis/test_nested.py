"""Poses that a diagnosis has not seen: every reading once, effects chosen without it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from made_up import campaign, exactly, found_friction, read, setting
from refusals import refuses

from doe.certainty.folds import folds_of, pose_numbers
from doe.diagnosis.candidates import standing
from doe.diagnosis.diagnose import Diagnosis, Rejected, diagnose, without_harm
from doe.diagnosis.hypotheses import Options
from doe.diagnosis.known import base_of
from doe.diagnosis.nested import nested, why_not_nested
from doe.diagnosis.proposals.next_readings import propose
from doe.diagnosis.setting import Setting, setting_of
from doe.diagnosis.where import hold_out, labels_of, own_noise, shares, spread, where
from doe.estimation.problem import problem
from doe.tables.measurements import Measurements
from fem import build_model
from fem.effects.frames import OFFSETS
from robots import InputError, load_description

FRICTION = {"share": 0.9, "friction": 120.0}


def _few(data: Measurements) -> Setting:
    """The setting with a few candidates, which is what takes time."""
    s = setting(data)
    known = {code: s.known[code] for code in ("friction:j2", "backlash:j2")}
    return replace(s, known=known)


def test_poses_stay_together_and_folds_are_even() -> None:
    pose = np.repeat(np.arange(23), 3)
    fold = folds_of(pose, 5, seed=1)
    assert all(len(set(fold[pose == k])) == 1 for k in range(23))
    counts = np.bincount(fold[::3])
    assert len(counts) == 5
    assert counts.max() - counts.min() <= 1
    assert (folds_of(pose, 5, seed=1) == fold).all()
    assert (folds_of(pose, 5, seed=2) != fold).any()
    assert int(folds_of(np.arange(7), 5, seed=0).max()) == 6  # few poses: one at a time


def test_equal_angles_are_one_pose_whatever_the_labels() -> None:
    data = read({}, poses=6, repeats=1)
    renamed = data.select(np.ones(data.n, dtype=bool))
    object.__setattr__(renamed, "pose", tuple(f"{k}" for k in range(data.n)))
    assert len(set(pose_numbers(renamed.q).tolist())) == 6


@pytest.mark.slow
def test_what_is_left_out_does_not_change_its_own_prediction() -> None:
    """A reading spoilt changes no prediction in its own fold: nothing of it was seen."""
    data = read({"friction:j2": FRICTION}, poses=10, repeats=1)
    found = nested(_few(data), data, Options(), folds=2, seed=4)
    assert found.folds == 2
    assert found.chosen["friction:j2"] == 2
    assert found.rms_after_mm < 0.7 * found.rms_before_mm
    spoilt = data.select(np.ones(data.n, dtype=bool))
    pose = pose_numbers(data.q)
    of_reading = folds_of(pose, 2, 4)
    shifted = np.where((of_reading == 0)[:, None], data.displacement * 1.3, data.displacement)
    object.__setattr__(spoilt, "displacement", shifted)
    other = nested(_few(spoilt), spoilt, Options(), folds=2, seed=4)
    mine = found.fold == 0
    predicted = data.displacement[data.used][mine] - found.after[mine]
    again = shifted[data.used][mine] - other.after[mine]
    # Steps of the fit start elsewhere; they end within a thousandth of a standard deviation.
    np.testing.assert_allclose(again, predicted, rtol=1e-6)


def test_too_few_poses_and_folds() -> None:
    data = read({}, poses=3, repeats=1)
    reason = why_not_nested(data, 5)
    assert reason is not None
    assert "too few" in reason
    refuses("C003", "folds", nested, setting(data), data, folds=1)


QUARTER = np.pi / 2.0


def _quarter_off(flat: bool) -> tuple[Setting, Measurements]:
    """An xr701 whose third angle was written down a quarter turn too small, read at ten poses.

    ``flat``: at the last one it reads 90 deg, where that convention would lay bar and lever in line: it cannot be
    right there.
    """
    description = load_description("xr701")
    model = build_model(description, "rigid").with_springs({"j2": 1.4e6, "j3": 9e5, "j5": 4e5})
    rng = np.random.default_rng(5)
    q = np.radians(rng.uniform([0, -30, 45, 0, -90, 0], [0, 40, 80, 0, 90, 0], (10, 6)))
    q[-1, 2] = np.radians(90.0 if flat else 70.0)
    data = campaign(poses=10, repeats=1)
    number = np.array([int(label[1:]) for label in data.pose])
    data = replace(data, q=q[number])
    true = data.q.copy()
    true[:, 2] += np.where(number == 9, 0.0 if flat else QUARTER, QUARTER)
    moved = exactly(model, replace(data, q=true), ()) * (1.0 + 0.01 * rng.normal(size=(data.n, 6)))
    data = replace(data, displacement=np.where(np.isnan(data.displacement), np.nan, moved))
    return setting_of(description, model, data), data


@pytest.mark.parametrize("flat", [False, True])
def test_a_convention_that_a_pose_left_out_could_not_have_is_no_candidate(flat: bool) -> None:
    s, data = _quarter_off(flat)
    elsewhere = problem(s.model, data.select(np.array([p == "P9" for p in data.pose])), ()).free.at
    known = {code: s.known[code] for code in ("angle-offset:j3", "payload")}
    narrowed = standing(replace(s, known=known), elsewhere)
    grid = narrowed["angle-offset:j3"].parameters[0].grid
    assert grid == ((-QUARTER / 2.0, QUARTER / 2.0, np.pi) if flat else OFFSETS)
    assert narrowed["payload"] is known["payload"]


@pytest.mark.slow
@pytest.mark.parametrize("flat", [False, True])
def test_such_a_convention_is_neither_found_nor_proposed_where_it_could_not_be(flat: bool) -> None:
    s, data = _quarter_off(flat)
    known = {code: s.known[code] for code in ("angle-offset:j3", "angle-sign:j3", "payload")}
    seen, unseen = (data.select(np.array([p == "P9" for p in data.pose]) == last) for last in (False, True))
    there = replace(setting_of(s.description, s.model, seen), known=known)
    narrowed = standing(there, problem(s.model, unseen, ()).free.at)
    d = diagnose(there)
    assert [f.code for f in d.effects] == ["angle-offset:j3"]
    # Nor is such a pose proposed: of the whole degrees between the joint's limits 90 is one.
    further = propose(there, d, candidates=300, coordinates=("q3real_deg",), rng=np.random.default_rng(0))
    assert (np.abs(further.q[:, 2] - QUARTER) > 1e-3).all()
    if flat:
        with pytest.raises(InputError, match="flat"):
            hold_out(d, seen, unseen)
    assert np.isfinite(hold_out(diagnose(replace(there, known=narrowed)), seen, unseen).after).all()
    found = nested(replace(s, known=known), data, folds=2)
    assert np.isfinite(found.after).all()
    assert (found.rms_after_mm < 0.1 * found.rms_before_mm) == (not flat)


def test_an_effect_with_which_unseen_poses_get_worse_is_not_in_the_model() -> None:
    data = read({"friction:j2": FRICTION}, poses=10, repeats=1)
    d = diagnose(_few(data))
    assert d.verdict == "named"
    assert without_harm(d, 0.2, 0.1) is d
    assert without_harm(d, 0.2, 0.2) is d
    harmed = without_harm(d, 0.1, 0.2)
    assert harmed.found == ()
    assert harmed.verdict == "ambiguous"
    assert harmed.after is d.before
    assert harmed.rejected == Rejected(tuple(f.code for f in d.found), 0.1, 0.2)
    nothing = without_harm(d, float("nan"), 0.2)
    assert nothing is d


# ------------------------------------------------------------
# A share of the disagreement has the uncertainty that springs and effects give it


def test_a_share_scatters_as_its_draws_do() -> None:
    z = np.array([3.0, 1.0, 2.0, 2.0])
    drawn = np.array([[3.0, 3.0], [1.0, 1.0], [1.0, 3.0], [2.0, 2.0]])
    first, second = shares(z, z, ["a", "a", "b", "b"], drawn)
    # Beyond their numbers: 8 of 14; in the draws 8 of 11 and 8 of 19.
    assert first.share == pytest.approx(8.0 / 14.0, rel=1e-12)  # round-off
    assert first.share_sd == pytest.approx(0.5 * (8.0 / 11.0 - 8.0 / 19.0), rel=1e-12)
    assert second.share_sd == pytest.approx(first.share_sd, rel=1e-12)
    assert math.isnan(shares(z, z, ["a", "a", "b", "b"])[0].share_sd)


def wider(d: Diagnosis, by: float) -> Diagnosis:
    """The diagnosis with springs and effects more uncertain by a factor."""
    refit = d.after.refit
    return replace(d, after=replace(d.after, refit=replace(refit, inverse=by**2 * refit.inverse)))


@pytest.mark.parametrize("kind", ["pose", "load", "phase"])
def test_it_is_what_the_covariance_of_springs_and_effects_makes_of_it(kind: str) -> None:
    """Against the first-order formula, where the covariance is so small that it holds."""
    d = wider(found_friction(), 0.02)
    found = where(d)[kind]
    s, refit = d.after.setting, d.after.refit
    numbers = [*range(len(s.free)), *refit.columns(0)]
    assert len(numbers) == len(s.free) + 2  # friction has a share and a torque
    A, sd = base_of(s).columns[:, numbers], spread(d.before.setting, own_noise(d))
    labels, z = labels_of(d.before.setting)[kind], d.before.residual / sd
    plain = np.array([g.share for g in shares(z, z, labels)])
    step = 1e-3 * np.sqrt(np.diag(refit.inverse)[numbers])
    there = [[g.share for g in shares(z + a * h / sd, z, labels)] for a, h in zip(A.T, step, strict=True)]
    G = ((np.array(there) - plain) / step[:, None]).T
    expected = np.sqrt(np.einsum("gk,kl,gl->g", G, refit.inverse[np.ix_(numbers, numbers)], G))
    assert d.counts.all()
    # 400 draws: four standard deviations of a standard deviation are 14 %.
    np.testing.assert_allclose([g.share_sd for g in found], expected, rtol=0.15, atol=1e-7)
    assert expected.max() > 1e-5
    np.testing.assert_allclose([g.share for g in found], plain, rtol=1e-12)


def test_shares_of_nothing_have_no_uncertainty() -> None:
    none = replace(found_friction(), verdict="none")
    assert all(math.isnan(g.share_sd) for groups in where(none).values() for g in groups)
