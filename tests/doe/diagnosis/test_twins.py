"""Effects that readings cannot tell apart are named together, and neither is named for sure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up import campaign, exactly, few, kr60, setting

from doe.diagnosis.diagnose import Diagnosis, diagnose
from doe.tables.measurements import Measurements
from fem.effects.catalogue import effect_of


def readings(code: str, values: dict[str, float]) -> Measurements:
    """X, Y and Z under forces in all directions, with an effect."""
    description, model = kr60()
    data = campaign(poses=12, repeats=1, components=(0, 1, 2))
    rng = np.random.default_rng(3)
    way = rng.normal(size=(12, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    number = np.array([int(label[1:]) for label in data.pose])
    size = np.linalg.norm(data.wrench[:, :3], axis=1, keepdims=True)
    data = replace(data, wrench=np.hstack([size * way[number], np.zeros((data.n, 3))]))
    exact = exactly(model, data, (effect_of(code, model, description).placed(values),))
    noisy = exact * (1.0 + 0.01 * rng.normal(size=exact.shape)) + 2e-6 * rng.normal(size=exact.shape)
    return replace(data, displacement=np.where(np.isnan(data.displacement), np.nan, noisy))


@pytest.fixture(scope="module")
def turned() -> Diagnosis:
    return diagnose(few(setting(readings("turned-frame", {"rx": 0.0, "ry": 0.0, "rz": np.radians(3.0)}))))


def test_exact_twins_make_the_verdict_ambiguous(turned: Diagnosis) -> None:
    assert turned.verdict == "ambiguous"
    assert {turned.provisional[0].code, *turned.same} == {"turned-frame", "joint-zero-offset:j1"}
    angle = turned.provisional[0].placed.by_name
    assert abs(angle.get("rz", angle.get("angle", 0.0))) == pytest.approx(np.radians(3.0), abs=np.radians(0.3))


def test_each_is_the_others_twin(turned: Diagnosis) -> None:
    twins = turned.twins(["turned-frame", "joint-zero-offset:j1"])
    assert "joint-zero-offset:j1" in twins["turned-frame"]
    assert "turned-frame" in twins["joint-zero-offset:j1"]


@pytest.mark.slow
def test_a_flipped_sign_is_found_like_another_load_path() -> None:
    d = diagnose(few(setting(readings("angle-sign:j3", {})), "angle-sign:j3"))
    assert d.rankings[0].hypotheses[0].code == "angle-sign:j3"
    assert d.after.fit_rms_mm < 0.2 * d.before.fit_rms_mm
