"""A table in other axes, points and conventions than the model: by hand, and as the twins that they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from effect_arms import SPRINGS, of

from fem import ArmModel, build_model, deflection
from fem.effects import Effect, PlacedEffect, catalogue, observed
from fem.free.model import FreeModel
from fem.free.parameters import parameter
from fem.statics.loads import LoadedPoses, as_loaded
from robots import load_description
from robots.frames import rotation_rpy

# A dozen products of numbers of order one.
ROUND_OFF = 1e-12


@pytest.fixture(scope="module")
def arm() -> ArmModel:
    return build_model(load_description("kr60-3"), links="rigid").with_springs(SPRINGS)


@pytest.fixture(scope="module")
def at(arm: ArmModel) -> LoadedPoses:
    rng = np.random.default_rng(5)
    q, w = rng.uniform(*arm.robot.limits.T, (12, 6)), rng.normal(size=(12, 6)) * [500, 500, 500, 50, 50, 50]
    return LoadedPoses(q, w, np.tile([0.1, -0.2, 0.3], (12, 1)))


def close(a: np.ndarray, b: np.ndarray) -> None:
    np.testing.assert_allclose(a, b, atol=ROUND_OFF * np.abs(b).max(), rtol=0.0)


def test_a_turned_frame_turns_forces_in_and_displacements_out(arm: ArmModel, at: LoadedPoses) -> None:
    turn = dict(zip(("rx", "ry", "rz"), np.radians([0.4, -0.7, 6.0]), strict=True))
    R = rotation_rpy(np.array([*turn.values()]))
    found = observed(arm, at, [of(arm, "turned-frame", **turn)])
    inside = np.hstack([at.wrench[:, :3] @ R.T, at.wrench[:, 3:] @ R.T])
    d = deflection(arm, at.q, inside, at.point)
    close(found, np.hstack([d[:, :3] @ R, d[:, 3:] @ R]))


def test_a_turned_azimuth_is_an_error_of_the_first_zero(arm: ArmModel, at: LoadedPoses) -> None:
    # The first axis is vertical and the base is rigid: only the sign differs.
    angle = np.radians(2.9)
    zero = observed(arm, at, [of(arm, "joint-zero-offset:j1", angle=-angle)])
    close(observed(arm, at, [of(arm, "turned-frame", rz=angle)]), zero)


def test_a_frame_turns_what_the_table_says_of_a_load_not_the_arm_that_holds_it(arm: ArmModel, at: LoadedPoses) -> None:
    loaded = replace(arm, load_offset=np.array([0.02, 0.0, 0.1]), load_tilt=np.radians([1.0, 0.0, 2.0]))
    turn = np.radians([0.3, 0.0, 5.0])
    R = rotation_rpy(turn)
    turned = np.hstack([at.wrench[:, :3] @ R.T, at.wrench[:, 3:] @ R.T])
    real = as_loaded(loaded, at.q, turned, at.point)
    d = deflection(loaded, real.q, real.wrench, real.point)
    acts = as_loaded(loaded, at.q, at.wrench, at.point)
    effect = of(arm, "turned-frame", rx=turn[0], ry=turn[1], rz=turn[2])
    close(observed(loaded, acts, [effect]), np.hstack([d[:, :3] @ R, d[:, 3:] @ R]))
    # The same by free numbers, on top of what the model has.
    names = ("frame.rx", "frame.rz", "load.x", "load.z", "load.tilt_x", "load.tilt_z")
    free = FreeModel(arm, tuple(parameter(arm, n) for n in names), at)
    u = np.array([turn[0], turn[2], 0.02, 0.1, *np.radians([1.0, 2.0])])
    close(free.evaluate(u)[0], observed(loaded, acts, [effect]))
    J = free.evaluate(u)[1]
    for k in range(len(u)):
        step = 1e-4 * np.eye(len(u))[k]
        slope = (free.displacement(u + step) - free.displacement(u - step)) / 2e-4
        np.testing.assert_allclose(J[:, :, k], slope, atol=1e-6 * np.abs(slope).max())


def test_a_free_turn_adds_to_the_one_that_the_arm_has(arm: ArmModel, at: LoadedPoses) -> None:
    has = of(arm, "turned-frame", rz=0.03)
    free = FreeModel(arm, (parameter(arm, "frame.rz"),), at, effects=(has,))
    close(free.displacement(np.array([0.02])), observed(arm, at, [of(arm, "turned-frame", rz=0.05)]))


def test_read_and_loaded_point_can_be_wrong_together(arm: ArmModel, at: LoadedPoses) -> None:
    found = observed(arm, at, [of(arm, "tool-point-offset", x=0.01, y=0.0, z=-0.02)])
    close(found, deflection(arm, at.q, at.wrench, at.point + np.array([0.01, 0.0, -0.02])))


def test_conventions_of_angles(arm: ArmModel, at: LoadedPoses) -> None:
    known = catalogue(arm)

    def by(effect: Effect, *values: float) -> np.ndarray:
        return observed(arm, at, [PlacedEffect(effect, np.array(values))])

    flipped, away, coupled = at.q.copy(), at.q.copy(), at.q.copy()
    flipped[:, 3] *= -1.0
    away[:, 4] += np.pi / 2.0
    coupled[:, 2] -= at.q[:, 1]
    close(by(known["angle-sign:j4"]), deflection(arm, flipped, at.wrench, at.point))
    close(by(known["angle-offset:j5"], np.pi / 2.0), deflection(arm, away, at.wrench, at.point))
    close(by(known["angle-coupling:j3"], -1.0), deflection(arm, coupled, at.wrench, at.point))
    # Only joint 3 turns about an axis parallel to the one before it.
    assert [code for code in known if code.startswith("angle-coupling")] == ["angle-coupling:j3"]
