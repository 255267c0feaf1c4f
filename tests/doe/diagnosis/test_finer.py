"""Shapes between the points of a law's grid: found where the noise is small, charged for, within their range."""

from __future__ import annotations

import numpy as np
from made_up import read, setting

from doe.diagnosis.evidence import Whitened
from doe.diagnosis.finer import STEPS, finer
from doe.diagnosis.fits import fit_all
from doe.diagnosis.known import base_of
from doe.diagnosis.scatter import covariance
from doe.diagnosis.signatures import signatures
from doe.estimation.noise import Noise

# Between two points of the grid.
TRUE = {"share": 0.9, "torque": 95.0, "kept": 0.45}


def test_a_joint_that_lets_go_at_a_torque_between_two_points() -> None:
    s = setting(read({"stick-slip:j2": TRUE}, share=0.005, setup=0.0))
    w = Whitened(base_of(s), covariance(s, Noise(white=(1e-6, 1e-6), share=0.005), np.ones(len(s.data))))
    some = signatures(s, s.known["stick-slip:j2"])
    coarse = fit_all(w, some).log_evidence
    best = some[int(np.argmax(coarse))]
    found = finer(s, w, best)
    assert found is not None
    c, amplitude = found
    assert c.rarity in [-2.0 * np.log(step) for step, _, _ in STEPS]
    z = float(fit_all(w, [c]).log_evidence[0])
    # What it is charged for is in the evidence; a coarse grid misses by far more.
    assert z > coarse.max() + 20.0
    assert abs(c.values[1] - TRUE["torque"]) < 0.5 * abs(best.values[1] - TRUE["torque"]) + 3.0
    assert amplitude.shape == (1,)
    low, high = (f([x.values[1] for x in some]) for f in (min, max))
    assert low <= c.values[1] <= high


def test_laws_without_such_shapes_are_left_alone() -> None:
    s = setting(read({}, poses=6))
    w = Whitened(base_of(s), covariance(s, Noise(white=(1e-5, 1e-5)), np.ones(len(s.data))))
    assert finer(s, w, signatures(s, s.known["gauge-scale"])[0]) is None
