"""The table [calibration.uncertainty] of a model file: written, read back, refused where it is none."""

from __future__ import annotations

import hashlib
import json
import tomllib
from typing import Any

import pytest
import tomlkit
from refusals import refuses

from robots import ModelDescription, content_hash, load_description
from robots.library.models import parse_description, to_toml
from robots.schema.description import Calibration, CalibrationUncertainty, UndeterminedNumber

TABLE = CalibrationUncertainty(
    parameters=("j2.stiffness", "j3.law[0]", "forearm.wall"),
    unit=("N m/rad", "ln(N m/rad)", "m"),
    variable=("1/value", "value", "ln value"),
    estimate=(5.000000000000001e-07, 13.8, -4.6),
    covariance=((1e-15, 2e-10, 0.0), (2e-10, 4e-3, 1e-4), (0.0, 1e-4, 1e-3)),
    degrees_of_freedom=(5.0, 12.5, 1e6),
    status=("determined", "one-sided", "not identified"),
    undetermined_directions=((0.0, 0.6, 0.8),),
    undetermined=(UndeterminedNumber(name="j5.stiffness", status="at bound", unit="N m/rad", low=3e5, note="stiff"),),
    note="made up",
)


def calibrated(table: CalibrationUncertainty | None) -> ModelDescription:
    origin = Calibration(
        scheme="global",
        load_path="parallelogram",
        links="beam",
        data="made up",
        data_sha256="0" * 64,
        rms_mm=0.01,
        loads_N=(),
        uncertainty=table,
    )
    return load_description("xr701").model_copy(update={"calibration": origin})


def changed(**keys: Any) -> str:
    """The file's text with keys of the table replaced, as a hand at an editor would."""
    data = tomllib.loads(to_toml(calibrated(TABLE)))
    data["calibration"]["uncertainty"] |= keys
    return tomlkit.dumps(data)


def test_the_table_comes_back_to_the_last_digit() -> None:
    given = calibrated(TABLE)
    again = parse_description(to_toml(given), "round trip")
    assert again == given
    assert again.calibration is not None
    assert again.calibration.uncertainty == TABLE
    assert content_hash(again) == content_hash(given)


def test_a_file_without_the_table_loads_and_keeps_its_hash() -> None:
    text = to_toml(calibrated(None))
    assert "uncertainty" not in text
    again = parse_description(text, "old")
    assert again.calibration is not None
    assert again.calibration.uncertainty is None
    # As it was made before there was such a table.
    data = again.model_dump(mode="json", by_alias=True)
    del data["effect"], data["controller"], data["calibration"]["uncertainty"]
    for link in data["link"]:
        assert link["surface"] is None
        for key in ("rigid_to", "rigid_from", "solid"):
            assert link.pop(key) is None
    assert data.pop("positions") is None
    assert data.pop("beam_radius") is None
    for joint in data["joint"]:
        assert joint.pop("error") is None
    before = hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
    assert content_hash(again) == before


def test_a_covariance_is_content() -> None:
    other = TABLE.model_copy(update={"degrees_of_freedom": (5.0, 12.5, 9.0)})
    assert len({content_hash(calibrated(table)) for table in (None, TABLE, other)}) == 3


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"covariance": [[1e-15, 2e-10, 0.0], [2.1e-10, 4e-3, 0.0], [0.0, 0.0, 1e-3]]}, "covariance is not symmetric"),
        ({"covariance": [[1e-15, 3e-9, 0.0], [3e-9, 4e-3, 0.0], [0.0, 0.0, 1e-3]]}, "not positive semi-definite"),
        ({"covariance": [[-1e-15, 0.0, 0.0], [0.0, 4e-3, 0.0], [0.0, 0.0, 1e-3]]}, "j2.stiffness is negative"),
        ({"covariance": [[0.0, 1e-12, 0.0], [1e-12, 4e-3, 0.0], [0.0, 0.0, 1e-3]]}, "without variance"),
        ({"covariance": [[1e-15, 2e-10], [2e-10, 4e-3]]}, "covariance has 2 entries for 3 parameters"),
        ({"covariance": [[1e-15], [2e-10], [0.0]]}, "every row of covariance needs 3 numbers"),
        ({"estimate": [5e-7]}, "estimate has 1 entries"),
        ({"estimate": [float("nan"), 13.8, -4.6]}, "finite number"),
        ({"degrees_of_freedom": [5.0, 0.0, 3.0]}, "degrees_of_freedom must be above zero"),
        ({"parameters": ["j2.stiffness", "j2.stiffness", "forearm.wall"]}, "named twice: j2.stiffness"),
        ({"variable": ["1/value", "value", "log"]}, "ln value"),
        ({"status": ["determined", "at bound", "determined"]}, "one-sided"),
        ({"undetermined_directions": [[0.0, 0.0, 0.0]]}, "all zeros"),
        ({"standard_deviation": [1.0]}, "unknown key"),
        ({"note": ""}, "note"),
    ],
)
def test_what_is_no_covariance_is_refused(keys: dict[str, Any], said: str) -> None:
    error = refuses("F011", r"model\.toml: calibration\.uncertainty", parse_description, changed(**keys), "model.toml")
    assert said in str(error)


def test_round_off_of_a_matrix_written_in_full_is_none() -> None:
    # Rank one but for the last digit: an eigenvalue of some -1e-17.
    a, b = 1.0 / 3.0, 1.0 / 7.0
    parse_description(
        changed(covariance=[[a * a, a * b, 0.0], [a * b * (1.0 + 1e-16), b * b, 0.0], [0.0, 0.0, 0.0]]), "model.toml"
    )
