"""The schema of tables: the fast way through a column and the careful one agree, and needs are told apart."""

from __future__ import annotations

import numpy as np
import pytest

from doe.tables.columns import RawTable
from doe.tables.schema import Cells, Column, Need
from robots import InputErrors
from robots.faults import Faults

COLUMNS = (
    Column("x_mm", most=1000.0, least=-1000.0),
    Column("sigma_mm", "not known", positive=True),
    Column("line", whole=True, least=0.0, most=9.0),
)


def cells(header: str, *rows: str, needs: tuple[Need, ...] = ()) -> Cells:
    body = tuple(tuple(row.split("|")) for row in rows)
    table = RawTable("t.csv", "", tuple(header.split("|")), body, tuple(range(2, len(rows) + 2)), ())
    return Cells.of(table, COLUMNS, needs, Faults("t.csv"))


@pytest.mark.parametrize("column", COLUMNS, ids=lambda column: column.name)
def test_the_fast_way_agrees_with_the_careful_one(column: Column) -> None:
    rng = np.random.default_rng(1)
    pieces = ("1", "0", "5", "9", ".", "-", "+", "e", "E", "1e3", "12.5", "_", "nan", "\u0661", " ", ",", "")
    for _ in range(3000):
        text = "".join(rng.choice(pieces, size=rng.integers(0, 4)))
        fast, (value, why) = column.plain((text,)), column.number(text)
        if fast is None:
            # The careful way says what is wrong, or takes what the fast one does not look at.
            assert why or np.isnan(value) or column.plain((repr(value),)) is not None
        else:
            assert not why
            np.testing.assert_equal(fast[0], value)


def test_numbers_are_in_si_and_faults_name_row_column_and_remedy() -> None:
    good = cells("x_mm|line", "250|3", "-1e2|4")
    np.testing.assert_allclose(good.numbers("x_mm", "line"), [[0.25, 3.0], [-0.1, 4.0]])
    assert np.isnan(good.numbers("sigma_mm")).all()
    bad = cells("x_mm|sigma_mm|line", "1001|0|3.5", "1|1|1|1", "7||2")
    whole = bad.whole_rows()
    values = whole.numbers("x_mm", "sigma_mm", "line")
    assert np.isnan(values[0]).all()
    assert whole.good().tolist() == [False, True]
    with pytest.raises(InputErrors) as caught:
        bad.faults.raise_if_any("table")
    assert [(error.code, error.value) for error in caught.value.errors] == [
        ("T004", "1001"),
        ("T004", "0"),
        ("T004", "3.5"),
        ("T002", "4 cells"),
    ]


@pytest.mark.parametrize(
    ("rule", "header", "faults"),
    [
        ("one", "x_mm", 0),
        ("one", "sigma_mm", 1),
        ("all", "x_mm", 1),
        ("all", "x_mm|line", 0),
        ("all or none", "sigma_mm", 0),
        ("all or none", "x_mm", 1),
        ("all or none", "x_mm|line", 0),
        # A column in another unit is a fault of its own, and there.
        ("all", "x_m|line", 1),
    ],
)
def test_needs_of_a_header(rule: str, header: str, faults: int) -> None:
    need = Need(("x_mm", "line"), "no column {}", "both", "add them", rule=rule)  # type: ignore[arg-type]
    found = cells(header, "|".join("1" * (header.count("|") + 1)), needs=(need,))
    assert found.faults.count == faults
