"""Readings at the same angles are of one pose, whatever their labels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from doe import bundled_data, read_measurements
from doe.estimation.problem import problem
from fem import build_model
from robots import load_description


def test_labels_do_not_part_a_pose() -> None:
    model = build_model(load_description("xr701"), "rigid")
    data = read_measurements(bundled_data("xr701"), model.robot)
    apart = replace(data, pose=tuple(f"r{k}" for k in range(data.n)))
    one, other = problem(model, data, ()), problem(model, apart, ())
    np.testing.assert_array_equal(one.pose, other.pose)
    assert len(other.poses) == 9
