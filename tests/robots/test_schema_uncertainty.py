"""The table [calibration.uncertainty] of a model file: written, read back, refused where it is none."""

from __future__ import annotations

import hashlib
import json
import math
import tomllib
from typing import Any

import pytest
import tomlkit
from refusals import refuses

from robots import (
    ModelDescription,
    bundled_names,
    content_hash,
    load_description,
    require_at_least,
    require_one_of,
    require_positive,
)
from robots.library.commented import commented_toml
from robots.library.models import parse_description, to_toml
from robots.schema.description import Calibration, CalibrationUncertainty, UndeterminedNumber
from robots.schema.key_words import KEY_WORDS, json_schema
from robots.schema.units import DIMENSIONS

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


# ------------------------------------------------------------
# Every key of a model file is explained, in the schema and in new files; and what is written reads back the same

SCHEMA = json_schema()
TABLES = {"ModelDescription": SCHEMA, **SCHEMA["$defs"]}


def test_every_key_of_every_table_has_its_sentence() -> None:
    keys = {(name, key) for name, table in TABLES.items() for key in table["properties"]}
    said = {(name, key) for name, table in KEY_WORDS.items() for key in table}
    assert said <= keys
    assert all(entry["description"] for table in TABLES.values() for entry in table["properties"].values())


def test_the_schema_lists_the_units_of_each_quantity() -> None:
    assert TABLES["Length"]["properties"]["unit"]["enum"] == list(DIMENSIONS["length"].units)
    assert "enum" not in TABLES["EffectNumber"]["properties"]["unit"]
    assert json.loads(json.dumps(SCHEMA)) == SCHEMA


@pytest.mark.parametrize("name", [*bundled_names(), "r2000ic-270f", "kr210-r2700-2"])
def test_a_commented_file_reads_back_the_same(name: str) -> None:
    description = load_description(name)
    text = commented_toml(description)
    assert parse_description(text, name) == description
    missing = [key for key in KEY_WORDS["ModelDescription"] if f"{key}" not in text]
    assert set(missing) <= {"calibration", "positions"}


# ------------------------------------------------------------
# Checks of single arguments: what passes, and what is said of the rest


def test_a_known_word_passes_and_another_is_refused_with_all_of_them() -> None:
    require_one_of("aim", "mean", ("mean", "worst"), code="X004")
    error = refuses(
        "X004", "", require_one_of, "aim", "wurst", {"mean": 1, "worst": 2}, code="X004", remedy="choose one"
    )
    assert (error.what, error.value) == ("aim", "wurst")
    assert (error.allowed, error.remedy) == ("mean, worst", "choose one")
    assert "Did you mean worst?" in str(error)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_a_number_that_is_not_above_zero_is_refused(value: float) -> None:
    refuses(
        "X004", r"tolerance: got .*; allowed: greater than 0 m$", require_positive, "tolerance", value, "m", code="X004"
    )


@pytest.mark.parametrize("value", [1, -math.inf, math.nan, math.inf])
def test_a_number_below_the_least_is_refused(value: float) -> None:
    refuses(
        "X004",
        r"steps: got .*; allowed: 2 or more. To fix it: take more",
        require_at_least,
        "steps",
        value,
        2,
        code="X004",
        remedy="take more",
    )


def test_numbers_within_pass_and_so_does_what_is_not_given() -> None:
    for value in (1e-300, 1e300, None):
        require_positive("scale", value, code="X004")
    for value in (0.0, 1e300, None):
        require_at_least("safety", value, 0.0, "m", code="X004")
