"""Values that a user puts in place of a model's own."""

from __future__ import annotations

import math

import numpy as np
import pytest
from refusals import refuses

from doe.model_file.changed import changed
from fem import compliance
from fem.arm import Arm
from robots import load_description


@pytest.fixture(scope="module")
def arm() -> Arm:
    return Arm.of(load_description("kr60-3"), "beam")


def test_a_value_stands_in_the_file_with_its_source(arm: Arm) -> None:
    new = changed(arm, {"j2.stiffness": 1.4e6, "j3.zero": "0.5 deg", "forearm.modulus": "60 GPa"})
    by_name = {joint.name: joint for joint in new.joint}
    assert by_name["j2"].stiffness.si == 1.4e6
    assert by_name["j2"].stiffness.source == "given"
    assert by_name["j3"].zero_error.si == pytest.approx(math.radians(0.5), rel=1e-12)  # round-off of the unit
    assert next(link for link in new.link if link.name == "forearm").youngs_modulus.si == 60e9
    assert "given" in new.sources


def test_the_arm_gives_way_as_the_new_value_says(arm: Arm) -> None:
    q = np.radians([[0.0, -60.0, 60.0, 0.0, 30.0, 0.0]])
    soft, stiff = (Arm.of(changed(arm, {"j2.stiffness": k}), "beam").model for k in (5e5, 1e6))
    turn = compliance(soft, q) - compliance(stiff, q)
    # What j2 alone adds is of rank one, and 1/5e5 - 1/1e6 times the square of its lever.
    values = np.linalg.eigvalsh(turn[0][3:, 3:])
    np.testing.assert_allclose(values, [0.0, 0.0, 1e-6], atol=1e-15)  # round-off of compliances of 1e-6


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"j2.stiffnes": 1e6}, "Did you mean j2.stiffness"),
        ({"j2.stiffness": "soft"}, "N m/rad"),
        ({"j2.stiffness": "5 GPa"}, "rotational stiffness"),
        ({"j2.stiffness": math.nan}, "1000 to 1e\\+09"),
        ({"j2.stiffness": -1.0}, "1000 to 1e\\+09"),
        ({"j2.stiffness": 1.0, "elbow.modulus": 1.0}, "2 problem"),
    ],
)
def test_what_cannot_be_is_refused(arm: Arm, values: dict[str, str | float], words: str) -> None:
    refuses("M001 M002", words, changed, arm, values)
