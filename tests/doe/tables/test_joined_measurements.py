"""Several tables as one: set-ups kept apart by their angles, readings that stand in two files refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from refusals import refuses, refuses_each

from doe.tables.joined import files_of, join
from doe.tables.measurements import Measurements
from doe.tables.reading import read_measurements, write_measurements
from robots import Robot, load_robot

HEAD = "pose,q2_deg,q3real_deg,fz_N,dz_mm,repeat"
FIRST = ("A,5,77.5,-650,-1.88,1", "B,10,70,-650,-1.7,1")
Read = Callable[..., Measurements]


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot("xr701")


@pytest.fixture
def read(tmp_path: Path, robot: Robot) -> Read:
    def work(name: str, *rows: str, head: str = HEAD) -> Measurements:
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
        return read_measurements(path, robot)

    return work


def test_one_table_stays_as_it_is(read: Read) -> None:
    one = read("a.csv", *FIRST)
    assert join([one]) is one
    assert files_of(one) is None


def test_readings_lines_and_files_stay_together(read: Read) -> None:
    a, b = read("a.csv", *FIRST), read("b.csv", "C,-5,60,-375,-0.9,1", head=HEAD)
    both = join([a, b])
    np.testing.assert_array_equal(both.q, np.vstack([a.q, b.q]))
    np.testing.assert_array_equal(both.displacement, np.vstack([a.displacement, b.displacement]))
    assert both.pose == ("A", "B", "C")
    assert both.row_numbers == (2, 3, 2)
    assert files_of(both) == ("a.csv", "a.csv", "b.csv")
    assert both.source == "a.csv + b.csv"
    assert len({a.sha256, b.sha256, both.sha256}) == 3
    assert all(note.startswith(("a.csv: ", "b.csv: ")) for note in both.notes)
    assert both.select(np.array([False, True, True])).extra["data file"] == ("a.csv", "b.csv")


def test_a_label_is_the_same_set_up_only_where_the_angles_agree(read: Read) -> None:
    a = read("a.csv", *FIRST)
    b = read("b.csv", "A,6,77.5,-650,-1.9,1", "B,10,70,-375,-1.0,1")
    c = read("c.csv", "A,7,77.5,-650,-1.9,1", "A,7,77.5,-375,-1.1,1")
    assert join([a, b, c]).pose == ("A", "B", "A (b.csv)", "B", "A (c.csv)", "A (c.csv)")


def test_files_of_one_name_are_told_apart(read: Read) -> None:
    both = join([read("x/a.csv", *FIRST), read("y/a.csv", "A,6,77.5,-650,-1.9,1")])
    assert files_of(both) == ("a.csv", "a.csv", "a.csv (2)")
    assert both.pose[-1] == "A (a.csv (2))"


def test_the_same_reading_in_two_files_is_refused_as_within_one(read: Read) -> None:
    a = read("a.csv", *FIRST)
    # Another label does not make it another reading.
    b = read("b.csv", "Z,5,77.5,-650,-1.5,1", "B,10,70,-650,-1.7,1")
    caught = refuses_each("T007", "", join, [a, b])
    first, second = (str(e) for e in caught.errors)
    assert "b.csv, row 2, the reading contradicts that of row 2 of a.csv" in first
    assert "b.csv, row 3, the reading repeats that of row 3 of a.csv" in second
    assert "column repeat" in first
    numbered_on = read("c.csv", "A,5,77.5,-650,-1.5,2")
    assert join([a, numbered_on]).pose[-1] == "A"


def test_the_same_file_twice_and_another_robot_are_refused(read: Read, tmp_path: Path) -> None:
    a = read("a.csv", *FIRST)
    refuses("T008", "are the same", join, [a, read("b.csv", *FIRST)])
    refuses("T008", "1 or more", join, [])


def test_a_joined_table_is_written_with_its_files(read: Read, robot: Robot, tmp_path: Path) -> None:
    both = join([read("a.csv", *FIRST), read("b.csv", "A,6,77.5,-650,-1.9,1")])
    write_measurements(both, tmp_path / "both.csv", robot)
    again = read_measurements(tmp_path / "both.csv", robot)
    assert files_of(again) == files_of(both)
    assert again.pose == both.pose
