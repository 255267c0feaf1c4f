"""Poses that a diagnosis has not seen: every reading once, effects chosen without it."""

from __future__ import annotations

import numpy as np
import pytest
from made_up import read, setting

from doe.diagnosis.hypotheses import Options
from doe.diagnosis.nested import folds_of, nested, pose_numbers, why_not_nested
from robots import InputError

FRICTION = {"share": 0.9, "friction": 120.0}


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
    assert len(set(pose_numbers(renamed).tolist())) == 6


def test_what_is_left_out_does_not_change_its_own_prediction() -> None:
    """A reading spoilt changes no prediction in its own fold: nothing of it was seen."""
    data = read({"friction:j2": FRICTION}, poses=12, repeats=1)
    found = nested(setting(data), data, Options(), folds=3, seed=4)
    assert found.folds == 3
    assert found.chosen["friction:j2"] == 3
    assert found.rms_after_mm < 0.7 * found.rms_before_mm
    spoilt = data.select(np.ones(data.n, dtype=bool))
    pose = pose_numbers(data)
    of_reading = folds_of(pose, 3, 4)
    shifted = np.where((of_reading == 0)[:, None], data.displacement * 1.3, data.displacement)
    object.__setattr__(spoilt, "displacement", shifted)
    other = nested(setting(spoilt), spoilt, Options(), folds=3, seed=4)
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
    with pytest.raises(InputError, match="folds"):
        nested(setting(data), data, folds=1)
