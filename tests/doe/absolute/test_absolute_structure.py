"""What no readings can tell: known cases of parallel axes, a target on the last axis, joints that carry no weight."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from doe.absolute.chain import Nominal
from doe.absolute.readings import AbsoluteReadings, Labels, Payload
from doe.absolute.structure import twins
from doe.absolute.unknowns import Layout, unknowns
from fem import ArmModel, build_model
from robots import load_description

UR5 = Path(__file__).parents[3] / "docs" / "examples" / "ur5" / "ur5.toml"


@pytest.fixture(scope="module")
def ur5() -> ArmModel:
    return build_model(load_description(UR5), "rigid")


def names(model: ArmModel, free: tuple[str, ...], target: tuple[float, float, float]) -> dict[str, tuple[str, ...]]:
    n = np.zeros(4, dtype=np.int64)
    data = AbsoluteReadings(
        "",
        "",
        np.zeros((4, 6)),
        np.zeros((4, 3)),
        Labels(("s",), n),
        Labels(("t",), n),
        n,
        (Payload(0.0, np.zeros(3)),),
        np.zeros(4),
        np.full(4, np.nan),
        n,
    )
    layout = Layout(unknowns(model.robot, data, free))
    return {t.name: t.others for t in twins(model, data, layout, Nominal(np.array([target]), (0.0, 0.0)))}


def test_positions_tell_eighteen_numbers_of_the_geometry_of_six_joints(ur5: ArmModel, kr60: ArmModel) -> None:
    # 4 x 6 + 6 of a chain seen whole (Everett), less 6 of the tracker, 3 of the target, 3 of its orientation.
    for model in (ur5, kr60):
        assert 36 - len(names(model, ("geometry",), (0.1, 0.05, 0.2))) == 18


def test_parallel_axes_share_what_lies_along_them(ur5: ArmModel) -> None:
    found = names(ur5, ("geometry",), (0.1, 0.05, 0.2))
    assert found["j3.frame.z"] == ("j2.frame.z",)
    assert found["j4.frame.z"] == ("j2.frame.z",)
    assert set(found["j3.frame.y"]) == {"j2.zero", "j3.zero"}


def test_a_target_on_the_last_axis_does_not_see_it_turn(ur5: ArmModel) -> None:
    assert names(ur5, ("j6.ratio", "j6.sin1"), (0.0, 0.0, 0.1)) == {"j6.ratio": (), "j6.sin1": ()}
    assert not names(ur5, ("j6.ratio", "j6.sin1"), (0.1, 0.0, 0.1))


def test_joints_about_the_vertical_carry_no_weight_and_tilt_like_joint_2(ur5: ArmModel) -> None:
    found = names(ur5, ("springs", "tilts", "base"), (0.1, 0.05, 0.2))
    assert found["j1.stiffness"] == ()
    # The axis of joint 2 is across joint 1, turns with it and meets it.
    assert found["j1.ry"] == ("j2.stiffness",)
