"""When readings were taken: time, session and temperature of a table, and what becomes of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from refusals import refuses

from doe import read_measurements, write_measurements
from doe.tables.loaded import history_of
from fem import build_model
from robots import load_description

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
