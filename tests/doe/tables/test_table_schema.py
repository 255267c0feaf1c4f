"""The schema of tables: the fast way through a column and the careful one agree, and needs are told apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from refusals import refuses, refuses_each

from doe import read_measurements, write_measurements
from doe.tables.columns import RawTable
from doe.tables.loaded import history_of
from doe.tables.schema import Cells, Column, Need
from fem import build_model
from robots import load_description
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
    caught = refuses_each("T002 T004", "", bad.faults.raise_if_any, "table")
    assert [(error.code, error.value) for error in caught.errors] == [
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


# ------------------------------------------------------------
# When readings were taken: time, session and temperature of a table, and what becomes of them

HEAD = "pose,step,phase,q2_deg,fz_N,dz_mm,time_s,session,temperature_C"
ROWS = (
    "A,1,loading,10,-100,-0.1,0,monday,21.5",
    "A,2,loading,10,-200,-0.2,60,monday,",
    "B,3,loading,20,-100,-0.1,3600,tuesday,22.5",
    "B,4,loading,20,-200,-0.2,7200,tuesday,23",
)
ROBOT = build_model(load_description("kr60-3"), "rigid").robot


def table(folder: Path, *rows: str, head: str = HEAD) -> Path:
    path = folder / "t.csv"
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return path


def test_time_session_and_temperature_are_read_and_written(tmp_path: Path) -> None:
    m = read_measurements(table(tmp_path, *ROWS), ROBOT)
    np.testing.assert_array_equal(m.time, [0.0, 60.0, 3600.0, 7200.0])
    np.testing.assert_array_equal(m.temperature, [21.5, np.nan, 22.5, 23.0])
    assert m.session == ("monday", "monday", "tuesday", "tuesday")
    assert not any("unknown columns" in note for note in m.notes)
    write_measurements(m, tmp_path / "again.csv", ROBOT)
    again = read_measurements(tmp_path / "again.csv", ROBOT)
    np.testing.assert_array_equal(again.temperature, m.temperature)
    assert again.session == m.session


def test_the_clock_is_the_time_where_it_is_given(tmp_path: Path) -> None:
    h = history_of(read_measurements(table(tmp_path, *ROWS), ROBOT))
    np.testing.assert_allclose(h.clock, [0.0, 60.0 / 7200.0, 0.5, 1.0])
    np.testing.assert_array_equal(h.session, [0, 0, 1, 1])
    late = [row.replace(",3600,", ",,") for row in ROWS]
    np.testing.assert_allclose(history_of(read_measurements(table(tmp_path, *late), ROBOT)).clock, [0, 1 / 3, 2 / 3, 1])


def test_a_table_that_tells_nothing_of_time_has_one_session(tmp_path: Path) -> None:
    m = read_measurements(table(tmp_path, "A,10,-100,-0.1", head="pose,q2_deg,fz_N,dz_mm"), ROBOT)
    assert m.session == ("",)
    assert np.isnan(m.time).all()
    np.testing.assert_array_equal(history_of(m).session, [0])


@pytest.mark.parametrize(("wrong", "column"), [("noon", "time_s"), ("inf", "time_s"), ("warm", "temperature_C")])
def test_times_that_are_no_numbers_are_refused(tmp_path: Path, wrong: str, column: str) -> None:
    place = HEAD.split(",").index(column)
    cells = ROWS[0].split(",")
    cells[place] = wrong
    refuses("T004", column, read_measurements, table(tmp_path, ",".join(cells), *ROWS[1:]), ROBOT)
