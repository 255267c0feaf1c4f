"""An arm with masses, and made-up campaigns of positions whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest
from made_up_positions import Plan, Truth, campaign

from doe.absolute.readings import AbsoluteReadings
from fem import ArmModel, build_model
from robots import load_description


@pytest.fixture(scope="session")
def kr60() -> ArmModel:
    return build_model(load_description("kr60-3"), "rigid").with_rigid_joints()


@pytest.fixture(scope="session")
def truth() -> Truth:
    rng = np.random.default_rng(5)
    numbers = {
        f"j{j}.{name}": float(1e-3 * rng.normal()) for j in range(2, 6) for name in ("frame.x", "frame.rx", "zero")
    }
    numbers |= {"j2.stiffness": 1e-6, "j3.stiffness": 2e-6, "j4.sin2": 3e-4, "j2.cos1": -2e-4, "j3.ratio": 5e-4}
    numbers |= {f"target.{t}.{a}": float(rng.uniform(-0.2, 0.2)) for t in "ab" for a in "xyz"}
    return Truth(numbers)


@pytest.fixture(scope="session")
def two_targets(kr60: ArmModel, truth: Truth) -> AbsoluteReadings:
    """Two sessions and two targets, scatter 0.02 mm."""
    return campaign(kr60, truth, Plan(90, sessions=2, targets=2, noise=2e-5), np.random.default_rng(6))
