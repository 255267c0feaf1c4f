"""Rotations of a robot's frames."""

from __future__ import annotations

import numpy as np
import pytest

from robots.frames import rotation_rpy, rpy_of


@pytest.mark.parametrize("pitch", [0.0, 0.7, -1.2, np.pi / 2.0, -np.pi / 2.0])
def test_roll_pitch_and_yaw_give_their_rotation_back(pitch: float) -> None:
    R = rotation_rpy(np.array([0.4, pitch, -2.5]))
    np.testing.assert_allclose(rotation_rpy(rpy_of(R)), R, rtol=0, atol=1e-15)
    assert abs(pitch) < 1.5 or rpy_of(R)[2] == 0.0
