"""Readings of one pose are left out together: repeats that an encoder scatters, but not what lies along a path."""

from __future__ import annotations

import numpy as np

from doe.certainty.folds import SAME_rad, folds_of, pose_numbers


def test_readings_of_a_pose_that_an_encoder_scatters_are_one_pose() -> None:
    rng = np.random.default_rng(0)
    q = rng.uniform(-1.0, 1.0, (30, 6))
    read = np.repeat(q, 4, axis=0) + rng.uniform(-0.2, 0.2, (120, 6)) * SAME_rad
    order = rng.permutation(120)
    number = pose_numbers(read[order])
    assert len(set(number)) == 30
    for k in range(30):
        assert len(set(number[order // 4 == k])) == 1


def test_poses_along_a_path_stay_apart() -> None:
    q = np.linspace(0.0, 1.0, 5000)[:, None] * np.ones(6)
    assert len(set(pose_numbers(q).tolist())) == 5000


def test_folds_take_groups_whole_and_few_groups_one_at_a_time() -> None:
    group = np.repeat(np.arange(25), 3)
    fold = folds_of(group, 10, 0)
    assert all(len(set(fold[group == k])) == 1 for k in range(25))
    assert int(folds_of(group, 10, 0, split=40).max()) == 24
