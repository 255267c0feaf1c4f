"""The chances of a power analysis: as the noncentral chi-square has them, whatever is asked stays in bounds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from doe.diagnosis import setting
from doe.diagnosis.evidence import Whitened
from doe.diagnosis.known import base_of
from doe.diagnosis.scatter import covariance
from doe.diagnosis.signatures import shapes, signature
from doe.estimation.noise import Noise
from doe.power.chances import ALARMS, CAMPAIGNS, POWER, Chance, chances, found_alone, smallest
from doe.power.planned import Planned
from doe.tables.measurements import Measurements
from fem import ArmModel, deflection
from fem.effects.catalogue import catalogue
from fem.model import build_model
from robots import load_description

FAMILIES = ("backlash", "payload", "gauge-scale", "base-vertical", "joint-tilt")


@pytest.fixture(scope="module")
def planned() -> Planned:
    """A small arm read without noise, few effects known."""
    description = load_description("kr60-3")
    model = build_model(description, "rigid")
    table = campaign(model)

    def few(*given: object, **more: object) -> dict[str, object]:
        return {code: e for code, e in catalogue(*given, **more).items() if code.partition(":")[0] in FAMILIES}  # type: ignore[arg-type]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(setting, "catalogue", few)
        return Planned.of(description, model, table, Noise((5e-6, 5e-6), 0.03, pose_share=0.005))


def campaign(model: ArmModel) -> Measurements:
    """Eight poses, three loads, two repeats, read without noise."""
    rng = np.random.default_rng(4)
    low, high = np.radians([[-90, -120, 30, -90, -80, 0], [90, -50, 110, 90, 80, 0]])
    poses, loads = rng.uniform(low, high, (8, 6)), (100.0, 200.0, 300.0)
    q = np.repeat(poses, 6, axis=0)
    wrench = np.zeros((48, 6))
    wrench[:, 2] = -np.tile(np.repeat(loads, 2), 8)
    d = deflection(model, q, wrench)
    d[:, 3:] = np.nan
    nan = np.full(48, np.nan)
    return Measurements(
        "campaign",
        "",
        q,
        wrench,
        d,
        np.full((48, 3), np.nan),
        nan,
        tuple(f"P{k // 6}" for k in range(48)),
        (1, 2) * 24,
        ("loading",) * 48,
        nan,
        tuple(range(2, 50)),
        {},
        (),
    )


def change(p: Planned, code: str, size: float) -> np.ndarray:
    effect = p.effects[code]
    c = signature(p.s, effect, next(iter(shapes(effect))))
    return c.columns @ np.full(len(c.mean), size)


def test_a_change_by_an_effect_is_explained_by_that_effect(planned: Planned) -> None:
    big = change(planned, "payload", 40.0)
    e = planned.explained(big[:, None])
    # The whole of it, whatever the springs follow: the chi-square by the whitened base, worked out the long way.
    w = Whitened(base_of(planned.s), covariance(planned.s, planned.noise, np.ones(len(big))))
    W = w.V.whiten(np.column_stack([big, w.base.columns]))
    A = np.vstack([W[:, 1:], np.diag(np.sqrt(w.base.precision))])
    b = np.concatenate([W[:, 0], np.zeros(A.shape[1])])
    left = b - A @ np.linalg.lstsq(A, b, rcond=None)[0]
    assert e.total[0] == pytest.approx(left @ left, rel=1e-6)
    # The prior keeps a little of it back.
    assert e.left["payload"][0] < 1e-2 * e.total[0]
    assert min(e.left, key=lambda code: e.left[code][0]) == "payload"


def test_chances_grow_with_the_size_and_reach_both_ends(planned: Planned) -> None:
    sizes = np.array([0.05, 1.0, 5.0, 20.0, 60.0])
    changes = np.column_stack([change(planned, "payload", size) for size in sizes])
    c = chances(planned, "payload", planned.explained(changes), slice(None))
    assert (np.diff(c.found) >= -1e-9).all()
    assert c.found[0] == pytest.approx(ALARMS, abs=0.02)
    assert c.found[-1] > 0.95
    assert (c.named <= c.found + 1e-12).all()
    assert c.named[0] < 0.05


def test_the_smallest_size_has_just_the_power_asked_for(planned: Planned) -> None:
    usual = planned.explained(change(planned, "payload", 40.0)[:, None])
    size = smallest(planned, "payload", usual, slice(None))
    assert size is not None
    just = planned.explained(change(planned, "payload", size)[:, None])
    power = found_alone(planned, "payload", just.total, float(usual.charge("payload")[0]))
    assert power[0] == pytest.approx(POWER, abs=0.02)
    # A scale is all springs at once.
    scale = planned.explained(change(planned, "gauge-scale", 0.05)[:, None])
    assert smallest(planned, "gauge-scale", scale, slice(None)) is None


def test_an_interval_holds_the_shares_of_campaigns() -> None:
    exact = Chance.of(0.5, 1e-9)
    low, high = binom.ppf([0.025, 0.975], CAMPAIGNS, 0.5) / CAMPAIGNS
    assert (exact.low, exact.high) == pytest.approx((low, high))
    wide = Chance.of(0.5, 1.0)
    assert wide.low < exact.low < exact.high < wide.high
    for value in (0.0, 0.03, 1.0):
        c = Chance.of(value, 0.8)
        assert 0.0 <= c.low <= value <= c.high <= 1.0


def test_a_law_that_leaves_much_is_not_named(planned: Planned) -> None:
    big = change(planned, "payload", 40.0)
    rough = big * np.where(np.arange(len(big)) % 2 == 0, 1.7, 0.3)
    c = chances(planned, "payload", planned.explained(np.column_stack([big, rough])), slice(None))
    assert c.found[0] > 0.95
    assert c.named[1] < 0.2 < c.named[0]
