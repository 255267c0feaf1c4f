"""Every key of a model file is explained, in the schema and in new files; and what is written reads back the same."""

from __future__ import annotations

import json

import pytest

from robots import bundled_names, load_description
from robots.library.commented import commented_toml
from robots.library.models import parse_description
from robots.schema.key_words import KEY_WORDS, json_schema
from robots.schema.units import DIMENSIONS

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
