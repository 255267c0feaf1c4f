"""Made-up campaigns for the tests of joint twists."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from doe.joint_twists import TwistReadings
from doe.joint_twists.synthetic import Campaign, Truth, draw_poses, draw_truth, make_readings
from fem import ArmModel, build_model
from robots import load_description

EXACT = Campaign(poses=2, noise_m=0.0, noise_rad=0.0, scatter=0.0)


@cache
def tx200() -> ArmModel:
    """The TX200 with rigid links."""
    return build_model(load_description("tx200"), "rigid")


@cache
def poses(campaign: Campaign = EXACT) -> np.ndarray:
    """Poses of a campaign, the same for all tests."""
    return draw_poses(tx200(), campaign, np.random.default_rng(1))


def truth(seed: int = 0, friction: float = 0.0, **change: object) -> Truth:
    """A truth; ``friction``: share of the usual one."""
    drawn = draw_truth(tx200(), np.random.default_rng(seed))
    return replace(drawn, friction=friction * drawn.friction, **change)  # type: ignore[arg-type]


def readings(of: Truth, campaign: Campaign = EXACT, seed: int = 0) -> TwistReadings:
    """Readings of a campaign over :func:`poses`."""
    return make_readings(tx200(), of, campaign, np.random.default_rng(seed), poses=poses(campaign))
