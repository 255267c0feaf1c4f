"""Readings, poses, loads and names in the forms in which users have them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

import stiffarm as sa
from robots import InputError

POSE = [0.0, 5.0, 77.5, 0.0, 10.0, 0.0]
LOAD = [0.0, 0.0, -650.0, 0.0, 0.0, 0.0]


@pytest.fixture(scope="module")
def arm() -> sa.Arm:
    return sa.load("xr701", values={"j2.stiffness": 1.4e6, "j3.stiffness": 0.8e6})


@pytest.mark.parametrize("form", [list, tuple, np.array])
def test_rows_of_numbers_are_what_names_say(arm: sa.Arm, form: Any) -> None:
    by_name = dict(zip(arm.coordinates, POSE, strict=True))
    wanted = sa.simulate(arm, pose=by_name, load={"fz_N": -650})
    found = sa.simulate(arm, pose=form(POSE), load=form(LOAD))
    assert found["dz"] == wanted["dz"]
    one, several = sa.index(arm, pose=form(POSE)), sa.index(arm, pose=[form(POSE), by_name])
    assert several["directional"].tolist() == [one["directional"][0]] * 2


@pytest.mark.parametrize("wrong", [POSE[:4], "abc", [[1.0]], ["x"] * 6, 3.0, {"q2_deg": "x"}, {"q2_deg": None}])
def test_what_is_no_pose_is_one_clear_error(arm: sa.Arm, wrong: Any) -> None:
    with pytest.raises(InputError, match="pose"):
        sa.simulate(arm, pose=wrong, load=LOAD)


def test_files_and_data_frames_are_readings(arm: sa.Arm) -> None:
    file = sa.bundled("xr701")
    table = pd.read_csv(file, comment="#")
    wanted = sa.calibrate(arm, sa.read_readings(file, arm), free=["j2.stiffness", "j3.stiffness"])
    for given in (file, str(file), table, table.sample(frac=1.0, random_state=1)):
        found = sa.calibrate(arm, given, free="j2.stiffness, j3.stiffness")
        # The bundled readings in any form and order: the published loads, and the same springs.
        assert found.loads == wanted.loads == (650.0,)
        assert found["j2.stiffness"].value == pytest.approx(wanted["j2.stiffness"].value, rel=1e-6)
    assert sa.simulate(arm, data=table).as_json == sa.simulate(arm, data=file).as_json


def test_loads_may_be_one_number_and_names_must_be_names(arm: sa.Arm) -> None:
    one = sa.calibrate(arm, sa.bundled("xr701"), free=["j2.stiffness"], loads=375)
    assert one.loads == (375.0,)
    for wrong in (3, [3], {"j2.stiffness": 1}):
        with pytest.raises(InputError, match="free"):
            sa.calibrate(arm, sa.bundled("xr701"), free=wrong)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="loads"):
        sa.calibrate(arm, sa.bundled("xr701"), free=["j2.stiffness"], loads="many")  # type: ignore[arg-type]
