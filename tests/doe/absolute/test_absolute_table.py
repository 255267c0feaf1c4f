"""Tables of positions are read, joined, and their faults named with line and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from refusals import refuses

from doe.absolute.table import is_absolute, joined, read_absolute
from robots.robot import Robot

HEADER = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm"
ROW = "10,-60,-90,20,30,40,1000,2000,3000"


@pytest.fixture
def robot(kr60) -> Robot:
    return kr60.robot


def written(folder: Path, text: str, name: str = "t.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_columns_are_read_in_si(tmp_path: Path, robot: Robot) -> None:
    head = f"{HEADER},session,target,payload_kg,payload_z_mm,rail_mm,sigma_mm,operator"
    data = read_absolute(
        written(tmp_path, f"{head}\n{ROW},s1,ball,5,100,1500,0.02,Ann\n{ROW},s2,ball,,,0,,Bo\n"), robot
    )
    assert_allclose(data.position[0], [1.0, 2.0, 3.0])
    assert_allclose(data.q[0, 1], np.radians(-60.0))
    assert data.session.names == ("s1", "s2")
    assert data.target.names == ("ball",)
    assert_allclose(data.rail, [1.5, 0.0])
    assert_allclose([data.payloads[k].kg for k in data.payload], [5.0, 0.0])
    assert_allclose(data.payloads[data.payload[0]].centre, [0.0, 0.0, 0.1])
    assert_allclose(data.sigma, [2e-5, np.nan])
    assert any("operator" in note for note in data.notes)


def test_times_temperatures_and_approaches_are_read(tmp_path: Path, robot: Robot) -> None:
    head = f"{HEADER},time_s,temperature_C,approach"
    data = read_absolute(written(tmp_path, f"{head}\n{ROW},0,20.5,+-+00-\n{ROW},60,21,\n"), robot)
    assert_allclose(data.time, [0.0, 60.0])
    assert_allclose(data.temperature, [20.5, 21.0])
    assert_allclose(data.approach, [[1, -1, 1, 0, 0, -1], [0] * 6])
    # A time that is not there in every row is none.
    assert not len(read_absolute(written(tmp_path, f"{HEADER},time_s\n{ROW},0\n{ROW},\n"), robot).time)
    assert_allclose(data.take(np.array([1])).approach, np.zeros((1, 6)))
    for wrong in ("+-+", "up", "+-+-+x"):
        refuses("T003", "approach", read_absolute, written(tmp_path, f"{HEADER},approach\n{ROW},{wrong}\n"), robot)


def test_files_without_sessions_are_sessions_of_their_own(tmp_path: Path, robot: Robot) -> None:
    tables = [read_absolute(written(tmp_path, f"{HEADER}\n{ROW}\n", f"{name}.csv"), robot) for name in "ab"]
    data = joined(tables)
    assert data.session.names == data.target.names == ("a", "b")
    assert len(data) == 2


def test_every_fault_is_named(tmp_path: Path, robot: Robot) -> None:
    bad = f"{HEADER},payload_kg\n{ROW},0\n10,-60,-90,20,30,40,1000,x,3000,0\n{ROW.replace('3000', '3e9')},0\n"
    caught = refuses("T004", "", read_absolute, written(tmp_path, bad), robot)
    assert all(word in str(caught) for word in ("row 3", "y_mm", "row 4", "mm"))
    refuses("T004", "payload_kg", read_absolute, written(tmp_path, f"{HEADER},payload_kg\n{ROW},-1\n"), robot)
    refuses("T001", "z_mm", read_absolute, written(tmp_path, "q1_deg,x_mm,y_mm\n1,2,3\n"), robot)
    refuses("T005", "q3_deg", read_absolute, written(tmp_path, f"{HEADER}\n{ROW.replace('-90', '300')}\n"), robot)


def test_a_table_of_positions_is_told_by_its_columns() -> None:
    assert is_absolute(("q1_deg", "x_mm", "y_mm", "z_mm"))
    assert not is_absolute(("q1_deg", "x_mm", "y_mm", "z_mm", "fz_N"))
    assert not is_absolute(("q1_deg", "fz_N", "dz_mm"))
    assert not is_absolute(("q1_deg", "x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg"))
