"""Combinations of parameters that trade off: which term leads."""

from __future__ import annotations

import numpy as np

from doe.certainty.identifiability import SMALL, _combination
from fem import build_model
from fem.free.parameters import parameter
from robots import load_description


def test_a_term_that_hardly_varies_leads_no_combination_however_large_its_weight() -> None:
    model = build_model(load_description("kr60-3"))
    springs = [parameter(model, f"{joint}.stiffness") for joint in ("j2", "j3", "j4")]
    # The first is known to a thousandth of what the others are: its part in the combination's spread is nothing.
    covariance = np.diag([1e-12, 1.0, 1.0])
    found = _combination(springs, np.array([5.0, 1.0, -0.5]), np.ones(3), covariance, SMALL)
    assert found.names == ("j3.stiffness", "j4.stiffness")
    assert found.value == 0.5
