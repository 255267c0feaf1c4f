"""What absolute readings say is missing: evidence by its definition, effects of made-up arms, nothing where none is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up_positions import Plan, Truth, campaign
from scipy.stats import multivariate_normal

from doe.absolute.calibrate import fitted
from doe.absolute.identified import findings
from doe.absolute.missing import evidence
from doe.absolute.missing.candidates import candidates
from doe.absolute.missing.diagnose import Missing, diagnose_positions
from doe.absolute.readings import AbsoluteReadings
from doe.absolute.reduced import FRAME
from doe.absolute.start import started
from doe.absolute.unknowns import Layout, unknowns
from fem import ArmModel

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
