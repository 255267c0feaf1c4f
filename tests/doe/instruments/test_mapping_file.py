"""The mapping file: what was found once is read back the same, and faults in it are all named."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from refusals import refuses

from doe.instruments.mapping_file import Settings, mapping_text, read_mapping
from doe.instruments.meanings import meaning_of
from robots import InputErrors

FULL = Settings(
    columns={"Z vor": meaning_of("z mm before", ""), 'odd "name" \\ \t=': meaning_of("x um negated of my ball", "")},
    fill={"session": "day 1"},
    encoding="latin-1",
    separator="tab",
    decimal="comma",
    sheets=("A", "B"),
    names=("a", "b"),
    header=3,
    units=("mm", "deg"),
    sigma_mm=0.02,
    axes="0,0,90",
    join="order",
    target="ball",
    kind="deflections",
)


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    file = tmp_path / "m.toml"
    for made in (FULL, Settings()):
        file.write_text(mapping_text(made, "a file"), encoding="utf-8")
        assert read_mapping(file) == made


@given(
    st.dictionaries(
        st.text(st.characters(exclude_categories=("Cs",)), max_size=8), st.sampled_from(["keep", "q3 deg"])
    ),
    st.text(st.characters(exclude_categories=("Cs",)), max_size=20),
)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=40)
def test_any_name_of_a_column_is_read_back(tmp_path: Path, names: dict[str, str], source: str) -> None:
    made = Settings(columns={name: meaning_of(text, "") for name, text in names.items()})
    file = tmp_path / "m.toml"
    file.write_bytes(mapping_text(made, source).encode())
    assert read_mapping(file) == made


def test_options_go_before_the_file() -> None:
    own = Settings(columns={"Z vor": meaning_of("ignore", "")}, decimal="point", fill={"session": "day 2"})
    both = own.over(FULL)
    assert (both.decimal, both.axes, both.fill) == ("point", "0,0,90", {"session": "day 2"})
    assert str(both.columns["Z vor"]) == "ignore"
    assert len(both.columns) == 2


def test_every_fault_is_named(tmp_path: Path) -> None:
    file = tmp_path / "m.toml"
    file.write_text(
        'schema = "other"\ncolour = 1\ndecimal = 3\nheader = "x"\nsigma_mm = "y"\n'
        'sheets = "a"\n[columns]\na = "z kg"\n',
        encoding="utf-8",
    )
    with pytest.raises(InputErrors) as refused:
        read_mapping(file)
    assert refused.value.count == 7
    for text in (
        "[[[",
        'schema = "stiffarm-readings/1"\ncolumns = 3\n',
        'schema = "stiffarm-readings/1"\n[fill]\na = 1\n',
    ):
        file.write_text(text, encoding="utf-8")
        refuses("F005 I011", "", read_mapping, file)
