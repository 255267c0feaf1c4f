"""What loaded poses keep of an arm's statics against what is worked out anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem import ArmModel, build_model
from fem.compiled.compliance import deflection
from fem.effects.base import PlacedEffect
from fem.effects.catalogue import effect_of
from fem.effects.observed import observed
from fem.effects.situation import Situation, plain_history
from fem.statics.loads import LoadedPoses
from robots import load_description


@pytest.fixture(scope="module")
def arm() -> ArmModel:
    return build_model(load_description("xr701"), "beam")


def loaded(arm: ArmModel) -> LoadedPoses:
    rng = np.random.default_rng(3)
    middle, half = arm.robot.limits.mean(axis=1), 0.1 * np.ptp(arm.robot.limits, axis=1)
    q = np.repeat(middle + half * rng.uniform(-1.0, 1.0, (4, arm.robot.dof)), 3, axis=0)
    wrench = rng.normal(size=(12, 6)) * [300.0, 300.0, 300.0, 50.0, 50.0, 50.0]
    return LoadedPoses(q, wrench, 0.05 * rng.normal(size=(12, 3)))


def others(arm: ArmModel) -> dict[str, ArmModel]:
    """Arms of one geometry: other springs, base and tool; other bearings and links, which are worked out anew."""
    some = np.diag([1e-7, 1e-7, 1e-7, 1e-6, 2e-6, 3e-6])
    soft = 1e-7 * np.diag([1.0, 1.0, 1.0, 3.0, 3.0, 0.0])
    names = arm.robot.joint_names
    return {
        "as it is": arm,
        "springs": arm.with_springs({names[1]: 8e5, names[2]: 6e5, names[4]: 1e5}),
        "base": replace(arm, base=arm.base + some),
        "tool": replace(arm, tool=arm.tool + some, base=arm.base + 2.0 * some),
        "bearing": arm.with_joint(names[1], bearing=arm.joints[1].bearing + soft),
        "links": replace(arm, links=()),
    }


def test_arms_of_one_geometry_share_their_statics(arm: ArmModel) -> None:
    at = loaded(arm)
    history = plain_history(len(at))
    plain = {name: deflection(one, at.q, at.wrench, at.point) for name, one in others(arm).items()}
    assert len({d.tobytes() for d in plain.values()}) == len(plain)
    for _ in range(2):
        for name, one in others(arm).items():
            d = Situation(one, at, history).deflection
            # Rounding of displacements of some millimetres.
            np.testing.assert_allclose(d, plain[name], rtol=1e-11, atol=1e-16, err_msg=name)
            # What a caller does with it stays the caller's.
            d[:] = 0.0


def test_loads_that_come_out_the_same_are_known_again(arm: ArmModel) -> None:
    at = loaded(arm)
    first, again = (replace(at, wrench=1.1 * at.wrench) for _ in range(2))
    assert at.recalled(first) is first
    assert at.recalled(again) is first
    other = replace(at, q=at.q + 1e-9)
    assert at.recalled(other) is other
    for k in range(10):
        at.recalled(replace(at, wrench=(2.0 + k) * at.wrench))
    assert at.recalled(again) is again


def test_readings_do_not_depend_on_what_was_asked_before(arm: ArmModel) -> None:
    """Effects of all stages, one after the other on the same poses and on fresh ones."""
    codes = ["turned-frame", "base-vertical", "joint-zero-offset:j2", "hardening:j2", "gauge-scale"]
    placed = []
    for code in codes:
        effect = effect_of(code, arm)
        placed.append(PlacedEffect(effect, np.array([p.grid[0] if p.grid else p.size[1] for p in effect.parameters])))
    at = loaded(arm)
    sets = [placed[:k] for k in range(len(placed) + 1)] + [[one] for one in placed]
    for model in (*others(arm).values(), arm):
        for some in sets:
            # As above: sums in another order.
            np.testing.assert_allclose(
                observed(model, at, some), observed(model, loaded(arm), some), rtol=1e-10, atol=1e-15
            )
