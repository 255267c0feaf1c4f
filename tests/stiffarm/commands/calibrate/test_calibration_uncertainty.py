"""`calibrate` writes how sure its numbers are; the loaded model says the same and propagates it."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from doe.certainty.propagation import ParameterUncertainty, parameter_uncertainty, propagate
from fem import ArmModel, build_model, spring_influence
from robots import InputError, ModelDescription, load_description

POSES = np.radians([[0.0, 10, 80, 0, 0, 0], [20, -15, 70, 90, 40, 0]])


def loaded(file: Path) -> tuple[ModelDescription, ArmModel, ParameterUncertainty]:
    given = load_description(file)
    u = parameter_uncertainty(given)
    assert u is not None
    return given, build_model(given), u


def test_the_written_covariance_is_the_calibration_s(calibrated: Path) -> None:
    results = json.loads((calibrated / "calibration.json").read_text(encoding="utf-8"))["parameters"]
    _, _, u = loaded(calibrated / "model.toml")
    numbers = {n["name"]: n for n in results}
    assert set(u.names) == {name for name, n in numbers.items() if n["status"] != "at bound"}
    assert {one.name for one in u.undetermined} == {name for name, n in numbers.items() if n["status"] == "at bound"}
    told = [numbers[name] for name in u.names]
    # calibration.json holds six digits.
    np.testing.assert_allclose(u.sd, [n["sd_of_variable"] for n in told], rtol=1e-5)
    np.testing.assert_allclose(1.0 / u.estimate, [n["value"] for n in told], rtol=1e-5)
    np.testing.assert_allclose(u.degrees_of_freedom, [n["degrees_of_freedom"] for n in told], rtol=1e-5)
    assert list(u.status) == [n["status"] for n in told]
    for one in u.undetermined:
        assert one.low == pytest.approx(numbers[one.name]["value_interval95"][0], rel=1e-5)


def test_the_loaded_model_propagates_it(calibrated: Path) -> None:
    _, model, u = loaded(calibrated / "model.toml")
    answer = propagate(model, u, POSES)
    influence, _ = spring_influence(model, POSES, np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0]))
    columns = [model.robot.joint_names.index(name.removesuffix(".stiffness")) for name in u.names]
    down = -influence[:, columns, 2]
    by_hand = np.sqrt(np.einsum("ni,ij,nj->n", down, u.widened, down)) / answer.compliance
    np.testing.assert_allclose(answer.relative_sd, by_hand, rtol=1e-9)


def test_a_number_changed_by_hand_is_told_from_the_calibrated_one(calibrated: Path, tmp_path: Path) -> None:
    text = (calibrated / "model.toml").read_text(encoding="utf-8")
    value = next(j["stiffness"]["value"] for j in tomllib.loads(text)["joint"] if j["name"] == "j3")
    (tmp_path / "model.toml").write_text(text.replace(repr(value), repr(2.0 * value)), encoding="utf-8")
    _, model, u = loaded(tmp_path / "model.toml")
    with pytest.raises(InputError, match=r"j3\.stiffness.*changed after the calibration"):
        propagate(model, u, POSES)
