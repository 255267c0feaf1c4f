from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl  # type: ignore[import-untyped]
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from refusals import refuses, refuses_each

from doe.tables.measurements import Measurements, largest_rows
from doe.tables.reading import bundled_data, read_measurements, write_measurements
from robots import Robot, load_robot
from robots.arrays import Array

HEADER = "q2_deg,q3real_deg,fz_N,dz_mm"
ROW = "5,77.5,-650,-1.88"
Write = Callable[..., Path]


@pytest.fixture(scope="module")
def xr701() -> Robot:
    return load_robot("xr701")


@pytest.fixture(scope="module")
def kr60() -> Robot:
    return load_robot("kr60-3")


@pytest.fixture
def table(tmp_path: Path) -> Write:
    def write(*lines: str, name: str = "data.csv") -> Path:
        path = tmp_path / name
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    return write


def workbook(path: Path, rows: list[list[object]]) -> Path:
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(row)
    book.create_sheet("second").append(["not", "read"])
    book.save(path)
    return path


def faults(path: Path, robot: Robot) -> tuple[str, ...]:
    caught = refuses_each("T002 T003 T004 T005 T006 T007", "", read_measurements, path, robot)
    return tuple(str(error) for error in caught.errors)


def places(found: tuple[str, ...], pattern: str) -> list[str]:
    return [match for fault in found for match in re.findall(pattern, fault)]


def only_fault(path: Path, robot: Robot) -> str:
    found = faults(path, robot)
    assert len(found) == 1, found
    return found[0]


def assert_same(a: Measurements, b: Measurements, rtol: float) -> None:
    for name in ("q", "wrench", "displacement", "point", "sigma", "step"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=rtol, atol=0.0, err_msg=name)
    for name in ("pose", "repeat", "phase", "extra"):
        assert getattr(a, name) == getattr(b, name), name


# --- the bundled table ---------------------------------------------------------------------------


def test_bundled_table_is_read_in_si(xr701: Robot) -> None:
    path = bundled_data("xr701")
    m = read_measurements(path, xr701)
    assert (m.n, m.q.shape, m.source) == (27, (27, 6), "xr701_gotlih.csv")
    assert m.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert m.row_numbers == tuple(range(2, 29))
    assert list(m.pose_groups()) == ["3", "4", "5", "39", "40", "41", "75", "76", "77"]
    assert m.pose_groups()["41"].tolist() == [5, 14, 23]
    np.testing.assert_array_equal(m.q[23], np.deg2rad([0, 5, 77.5, 0, 0, 0]))
    np.testing.assert_array_equal(m.wrench[23], [0, 0, -650, 0, 0, 0])
    # one rounding of the product with 1e-3
    assert m.displacement[23, 2] == pytest.approx(-1.88e-3, rel=2.3e-16)
    assert m.used.sum(axis=0).tolist() == [0, 0, 27, 0, 0, 0]
    assert sorted(set(m.loads_N)) == [150.0, 375.0, 650.0]
    assert np.isnan(m.point).all()
    assert np.isnan(m.sigma).all()
    assert np.isnan(m.step).all()
    assert set(m.repeat) == {None}
    assert set(m.phase) == {None}
    assert m.notes == (
        "joint columns missing, taken as 0: q1_deg, q6_deg",
        "load columns missing, taken as 0: fx_N, fy_N, mx_Nm, my_Nm, mz_Nm",
    )


def test_bundled_table_holds_the_charts_27_labels(xr701: Robot) -> None:
    m = read_measurements(bundled_data("xr701"), xr701)
    printed = [1.88, 1.55, 1.68, 2.14, 2.05, 1.36, 1.33, 1.46, 1.45, 1.25, 1.06, 1.16, 1.44, 1.41]
    printed += [0.83, 0.83, 0.60, 0.59, 0.24, 0.23, 0.35, 0.24, 0.23, 0.34, 0.27, 0.30, 0.39]
    # labels have two decimals: half of their last digit
    np.testing.assert_allclose(np.sort(-m.displacement[:, 2] * 1e3), np.sort(printed), atol=0.005)


def test_bundled_data_names_what_there_is() -> None:
    refuses("A011", r"kr60-3.*allowed: fanuc-r2000ic, xr701", bundled_data, "kr60-3")


def test_bundled_tables_are_the_published_bytes_with_their_licence() -> None:
    fanuc = bundled_data("fanuc-r2000ic")
    digest = "365413b255c5bc46df5675079742b452d5f1165b88942defc3f2e1a2becf6405"
    assert hashlib.sha256(fanuc.read_bytes()).hexdigest() == digest
    m = read_measurements(fanuc, load_robot("fanuc-r2000ic"))
    assert (m.n, len(set(m.pose)), int(m.used.sum())) == (43, 43, 129)
    # 0.996 mm RMS over all components is the source's own figure of the campaign.
    assert np.sqrt(np.mean(m.displacement[:, :3] ** 2)) * 1e3 == pytest.approx(0.996, abs=5e-4)
    text = fanuc.with_name("fanuc_r2000ic_LICENSE").read_text(encoding="utf-8")
    assert text.startswith("MIT License")
    assert "longton2001-pixel" in text


# --- the container -------------------------------------------------------------------------------


def test_select_cuts_every_column(table: Write, xr701: Robot) -> None:
    head = "pose,repeat,phase,step,sigma_mm,px_mm,py_mm,pz_mm,who," + HEADER
    path = table(head, f"A,1,loading,1,0.01,1,2,3,x,{ROW}", f"B,2,unloading,2,0.02,4,5,6,y,{ROW}")
    m = read_measurements(path, xr701)
    s = m.select(np.array([False, True]))
    assert (s.n, s.pose, s.repeat, s.phase, s.row_numbers) == (1, ("B",), (2,), ("unloading",), (3,))
    assert (s.extra, s.notes, s.sha256) == ({"who": ("y",)}, m.notes, m.sha256)
    for name in ("q", "wrench", "displacement", "point", "sigma", "step"):
        np.testing.assert_array_equal(getattr(s, name), getattr(m, name)[1:])
    assert m.select(np.array([False, False])).n == 0


@pytest.mark.parametrize("mask", [np.array([0]), np.array([True]), np.array([[True, False]])])
def test_select_wants_a_boolean_for_each_reading(mask: Any, table: Write, xr701: Robot) -> None:
    m = read_measurements(table(HEADER, ROW, "0,77.5,-650,-1.9"), xr701)
    refuses("B001", "mask", m.select, mask)


@pytest.mark.parametrize(
    "change",
    [
        {"wrench": np.zeros((1, 3))},
        {"sigma": np.zeros(2)},
        {"pose": ("A", "B")},
        {"row_numbers": ()},
        {"extra": {"who": ("x", "y")}},
        {"q": np.full((1, 6), np.nan)},
        {"wrench": np.full((1, 6), np.inf)},
    ],
)
def test_container_refuses_what_does_not_fit(change: dict[str, Any], table: Write, xr701: Robot) -> None:
    m = read_measurements(table(HEADER, ROW), xr701)
    refuses("B001", f"measurements: .*{'who' if 'extra' in change else next(iter(change))}", replace, m, **change)


def test_labels_count_distinct_joint_vectors(table: Write, xr701: Robot) -> None:
    rows = (ROW, "0,77.5,-650,-1.9", "5,77.50,-375,-1.25", "-0.0,77.5,-375,-1.2")
    m = read_measurements(table(HEADER, *rows), xr701)
    assert m.pose == ("P1", "P2", "P1", "P2")


def test_an_unknown_column_may_bear_a_fields_name(table: Write, xr701: Robot) -> None:
    m = read_measurements(table(HEADER + ",wrench", ROW + ",10 mm key"), xr701)
    assert m.select(np.array([True])).extra == {"wrench": ("10 mm key",)}


# --- layouts that are accepted -------------------------------------------------------------------


@pytest.mark.parametrize(
    "content",
    [
        f"{HEADER}\n{ROW}\n",
        f"{HEADER}\n{ROW}",
        f"\ufeff{HEADER}\r\n{ROW}\r\n",
        " q2_deg , q3real_deg ,fz_N,dz_mm  \n 5 ,77.5 , -650\t,-1.88  \n",
        f"{HEADER},,\n{ROW},,\n",
        f"{HEADER};{ROW}".replace(";", "\n").replace(",", ";"),
        f"{HEADER}\r{ROW}\r".replace(",", ";"),
        f"{HEADER}\n{ROW}\n".replace(",", "\t"),
        f"{HEADER}\n5.,+77.5,-6.50e2,-.188E1\n",
        '"q2_deg","q3real_deg","fz_N","dz_mm"\n"5","77.5","-650","-1.88"\n',
    ],
)
def test_layouts_of_the_same_reading(content: str, tmp_path: Path, xr701: Robot) -> None:
    path = tmp_path / "data.csv"
    path.write_bytes(content.encode())
    m = read_measurements(path, xr701)
    np.testing.assert_array_equal(m.q, np.deg2rad([[0, 5, 77.5, 0, 0, 0]]))
    assert m.wrench[0].tolist() == [0, 0, -650, 0, 0, 0]
    assert m.displacement[0, 2] == pytest.approx(-1.88e-3, rel=2.3e-16)  # one rounding
    assert m.row_numbers == (2,)


def test_all_columns_in_any_order(table: Write, xr701: Robot) -> None:
    cells = {
        "dz_mm": "-2",
        "dx_mm": "1",
        "dy_mm": "",
        "rx_mrad": "0.5",
        "ry_mrad": "0",
        "rz_mrad": "-1",
        "pose": "A, b",
        "fx_N": "10",
        "fy_N": "-20",
        "fz_N": "-300",
        "mx_Nm": "4",
        "my_Nm": "-5",
        "mz_Nm": "6",
        "sigma_mm": "0.02",
        "px_mm": "100",
        "py_mm": "0",
        "pz_mm": "-50",
        "repeat": "3",
        "phase": "unloading",
        "step": "7.5",
        "q6_deg": "1",
        "q5_deg": "2",
        "q4_deg": "3",
        "q3real_deg": "80",
        "q2_deg": "4",
        "q1_deg": "5",
        "who": "me",
    }
    row = ",".join(f'"{cell}"' for cell in cells.values())
    m = read_measurements(table(",".join(cells), row), xr701)
    np.testing.assert_array_equal(m.q, np.deg2rad([[5, 4, 80, 3, 2, 1]]))
    assert m.wrench[0].tolist() == [10, -20, -300, 4, -5, 6]
    # rtol: one rounding of the product with 1e-3
    np.testing.assert_allclose(m.displacement, [[1e-3, np.nan, -2e-3, 5e-4, 0, -1e-3]], rtol=2.3e-16)
    np.testing.assert_allclose(m.point, [[0.1, 0.0, -0.05]], rtol=2.3e-16)
    assert m.used.tolist() == [[True, False, True, True, True, True]]
    assert (m.pose, m.repeat, m.phase, m.step[0]) == (("A, b",), (3,), ("unloading",), 7.5)
    assert m.sigma[0] == pytest.approx(2e-5, rel=2.3e-16)
    assert m.extra == {"who": ("me",)}
    assert m.notes == ("unknown columns, kept but not used: who",)


def test_optional_cells_may_be_empty(table: Write, xr701: Robot) -> None:
    head = HEADER + ",repeat,phase,step,sigma_mm,px_mm,py_mm,pz_mm"
    m = read_measurements(table(head, ROW + ",,,,,,,"), xr701)
    assert (m.repeat, m.phase) == ((None,), (None,))
    assert np.isnan([m.step[0], m.sigma[0], *m.point[0]]).all()


def test_blank_lines_are_named_and_lines_still_counted(table: Write, xr701: Robot) -> None:
    m = read_measurements(table(HEADER, "", ROW, ",,,", "0,77.5,-650,-1.9", "", ""), xr701)
    assert m.row_numbers == (3, 5)
    assert m.notes[-1] == "blank lines skipped: 2, 4, 6-7"


def test_a_quoted_cell_over_two_lines_keeps_the_line_numbers(table: Write, xr701: Robot) -> None:
    m = read_measurements(table(HEADER + ",who", ROW + ',"a\nb"', "0,77.5,-650,-1.9,c"), xr701)
    assert m.row_numbers == (2, 4)


def test_xlsx_reads_like_csv(tmp_path: Path, xr701: Robot) -> None:
    plain = read_measurements(bundled_data("xr701"), xr701)
    lines = [line.split(",") for line in bundled_data("xr701").read_text().splitlines()]
    rows: list[list[object]] = [[*lines[0]]]
    rows += [[float(cell) for cell in line] for line in lines[1:]]
    m = read_measurements(workbook(tmp_path / "data.XLSX", rows), xr701)
    assert_same(m, plain, rtol=0.0)  # the same decimal texts give the same doubles
    left_out = "only the first sheet, Sheet, is read; left out: second"
    assert (m.row_numbers, m.notes) == (plain.row_numbers, (*plain.notes, left_out))


def test_xlsx_faults_have_line_numbers_after_blank_rows(tmp_path: Path, xr701: Robot) -> None:
    header: list[object] = [*HEADER.split(","), None]
    rows: list[list[object]] = [
        header,
        [5, 77.5, -650, -1.88],
        [None],
        [5, 77.5, "-650 N", None],
        [0, 77.5, True, "x"],
    ]
    found = faults(workbook(tmp_path / "data.xlsx", rows), xr701)
    assert places(found, r"row \d+, column \w+") == [
        "row 4, column fz_N",
        "row 5, column fz_N",
        "row 5, column dz_mm",
    ]


# --- the file as a whole -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("data.csv", None, "does not exist"),
        ("data.txt", b"x", "allowed: a file ending in .csv or .xlsx"),
        ("data.xls", b"x", "allowed: a file ending in .csv or .xlsx"),
        ("data.csv", b"", "is empty"),
        ("data.xlsx", b"", "is empty"),
        ("data.csv", b" \n\n", "is empty"),
        ("data.csv", HEADER.encode(), "header but no readings"),
        ("data.csv", f"{HEADER}\n,,,\n".encode(), "header but no readings"),
        ("data.csv", f"\n{HEADER}\n{ROW}\n".encode(), "no column names in line 1"),
        ("data.csv", f"{HEADER},µ\n{ROW},1\n".encode("latin-1"), "not UTF-8"),
        ("data.csv", f"{HEADER}\n{ROW}\n".encode("utf-16"), "not UTF-8"),
        ("data.csv", f'{HEADER}\n"{ROW}\n'.encode(), "row 2 is not valid CSV"),
        ("data.xlsx", f"{HEADER}\n{ROW}\n".encode(), "not a readable XLSX"),
        ("data.xlsx", b"PK\x03\x04broken", "not a readable XLSX"),
    ],
)
def test_files_that_cannot_be_read(name: str, content: bytes | None, words: str, tmp_path: Path, xr701: Robot) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    caught = refuses("F001 T001 T002 T010", words, read_measurements, path, xr701)
    assert str(path) in str(caught)


def test_a_folder_is_not_a_file(tmp_path: Path, xr701: Robot) -> None:
    folder = tmp_path / "data.csv"
    folder.mkdir()
    refuses("F001", "it is a folder", read_measurements, folder, xr701)


def test_an_empty_workbook(tmp_path: Path, xr701: Robot) -> None:
    refuses("T001", "no column names", read_measurements, workbook(tmp_path / "data.xlsx", []), xr701)


# --- the header ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        ("dz_m", "dz_mm"),
        ("dz_um", "dz_mm"),
        ("dz_µm", "dz_mm"),
        ("dz", "dz_mm"),
        ("dz [mm]", "dz_mm"),
        ("DZ_mm", "dz_mm"),
        ("dz_microns", "dz_mm"),
        ("dzmm", "dz_mm"),
        ("dz_inch", "dz_mm"),
        ("rx_deg", "rx_mrad"),
        ("rx", "rx_mrad"),
        ("fz_kN", "fz_N"),
        ("fz", "fz_N"),
        ("Fz_N", "fz_N"),
        ("fz_kg", "fz_N"),
        ("fz_lbf", "fz_N"),
        ("mx_Nmm", "mx_Nm"),
        ("mx_N_m", "mx_Nm"),
        ("mx_kNm", "mx_Nm"),
        ("mx", "mx_Nm"),
        ("q2_rad", "q2_deg"),
        ("q2", "q2_deg"),
        ("Q2_deg", "q2_deg"),
        ("q3real", "q3real_deg"),
        ("q3real_rad", "q3real_deg"),
        ("sigma", "sigma_mm"),
        ("sigma_um", "sigma_mm"),
        ("Pose", "pose"),
        ("REPEAT", "repeat"),
        ("Phase", "phase"),
    ],
)
def test_wrong_units_are_faults_not_unknown_columns(wrong: str, right: str, table: Write, xr701: Robot) -> None:
    kept = {name: cell for name, cell in zip(HEADER.split(","), ROW.split(","), strict=True) if name != right}
    head, row = ",".join([*kept, wrong]), ",".join([*kept.values(), "1"])
    fault = only_fault(table(head, row), xr701)
    assert f"row 1, column {wrong} has a wrong or missing unit" in fault
    assert f"allowed: {right}." in fault


@pytest.mark.parametrize("name", ["dz_note", "operator", "temperature_degC", "steps", "gauge mm", "dz_mm_raw"])
def test_other_columns_are_kept_and_named(name: str, table: Write, xr701: Robot) -> None:
    m = read_measurements(table(f"{HEADER},{name}", f"{ROW}, NA "), xr701)
    assert m.extra == {name: ("NA",)}
    assert f"unknown columns, kept but not used: {name}" in m.notes


@pytest.mark.parametrize(
    ("head", "words"),
    [
        ("q2_deg,fz_N", "no deflection column; allowed: at least one of dx_mm"),
        ("q2_deg,dz_mm", "no load column; allowed: at least one of fx_N"),
        ("fz_N,dz_mm", "no joint column of xr701; allowed: at least one of q1_deg, q2_deg, q3real_deg"),
        (f"{HEADER},px_mm", "no column py_mm, pz_mm; allowed: all of px_mm, py_mm, pz_mm, or none"),
        (f"{HEADER},dz_mm", "column dz_mm stands there twice"),
        (f"{HEADER},dz_mm.1", "column dz_mm.1 stands there twice"),
        (f"{HEADER},who,who", "column who stands there twice"),
        (f"{HEADER},", "column number 5 has cells but no name"),
    ],
)
def test_header_faults(head: str, words: str, table: Write, xr701: Robot) -> None:
    row = ",".join("1" for _ in head.split(","))
    fault = only_fault(table(head, row), xr701)
    assert "data.csv, row 1" in fault
    assert words in fault
    assert "To fix it:" in fault


@pytest.mark.parametrize("name", ["q3_deg", "q3", "q7_deg", "q3_rad", "A3_deg", "joint3_deg", "axis_3_deg"])
def test_coordinates_of_another_robot(name: str, table: Write, xr701: Robot) -> None:
    fault = only_fault(table(f"{name},fz_N,dz_mm", "1,-650,-1"), xr701)
    assert f"column {name} is not a joint coordinate of xr701" in fault
    assert "q1_deg, q2_deg, q3real_deg, q4_deg, q5_deg, q6_deg" in fault


def test_the_same_table_for_the_other_robot(kr60: Robot) -> None:
    fault = only_fault(bundled_data("xr701"), kr60)
    assert "column q3real_deg is not a joint coordinate of kr60-3" in fault


def test_header_and_cell_faults_come_together(table: Write, xr701: Robot) -> None:
    found = faults(table("q2_deg,fz_kN,dx_um,dz_mm", "x,1,1,-1", "1,2,3"), xr701)
    assert places(found, r"^data.csv, row (\d+)") == list("1123")


# --- the cells -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("abc", "write digits"),
        ("1.2 mm", "write digits"),
        ("1_000", "write digits"),
        ("0x1", "write digits"),
        ("1 000", "write digits"),
        ("--1", "write digits"),
        ("1e", "write digits"),
        (".", "write digits"),
        ("'-1", "write digits"),
        ("٣", "write digits"),
        ('"1.234,5"', "write digits"),
        ('"-1,5"', "decimal comma: write -1.5"),
        ('",5"', "decimal comma: write .5"),
        ("\u22121.5", "typographic minus"),
        ("nan", "only an empty cell means"),
        ("NaN", "only an empty cell means"),
        ("-inf", "only an empty cell means"),
        ("Infinity", "only an empty cell means"),
        ("1e999", "too large"),
        ("N/A", "write digits"),
        ("NA", "write digits"),
    ],
)
@pytest.mark.parametrize("column", ["q2_deg", "fz_N", "dz_mm", "sigma_mm", "step", "px_mm"])
def test_what_is_not_a_number(text: str, words: str, column: str, table: Write, xr701: Robot) -> None:
    cells = {"q2_deg": "5", "q3real_deg": "77.5", "fz_N": "-650", "dz_mm": "-1", "sigma_mm": "", "step": ""}
    cells |= {"px_mm": "0", "py_mm": "0", "pz_mm": "0", column: text}
    fault = only_fault(table(",".join(cells), ",".join(cells.values())), xr701)
    assert f"data.csv, row 2, column {column}: got " in fault
    assert text.strip('"') in fault
    assert "allowed: a finite number" in fault
    assert words in fault


def test_decimal_commas_in_a_semicolon_file(table: Write, xr701: Robot) -> None:
    found = faults(table(HEADER.replace(",", ";"), "5;77,5;-650;-1,88"), xr701)
    assert ["decimal comma: write 77.5" in found[0], "decimal comma: write -1.88" in found[1]] == [True, True]


@pytest.mark.parametrize("column", HEADER.split(",")[:3])
def test_empty_joint_or_load_cell(column: str, table: Write, xr701: Robot) -> None:
    cells = dict(zip(HEADER.split(","), ROW.split(","), strict=True)) | {column: " "}
    fault = only_fault(table(HEADER, ROW, ",".join(cells.values())), xr701)
    assert f"row 3, column {column} is empty; allowed: a finite number. To fix it: fill in" in fault


@pytest.mark.parametrize(
    ("head", "cells", "words"),
    [
        ("pose", "", "column pose is empty; allowed: a label"),
        ("repeat", "1.5", "column repeat: got '1.5'; allowed: a whole number"),
        ("repeat", "first", "column repeat: got 'first'"),
        ("repeat", "-1", "column repeat: got '-1'"),
        ("repeat", "1" * 5000, "column repeat"),
        ("phase", "up", "column phase: got 'up'; allowed: loading, unloading"),
        ("phase", "Loading", "column phase: got 'Loading'"),
        ("sigma_mm", "0", "column sigma_mm: got '0'; allowed: a finite number above 0, or an empty cell"),
        ("sigma_mm", "-0.01", "column sigma_mm: got '-0.01'"),
        ("px_mm,py_mm,pz_mm", "1,,3", "the point is incomplete"),
        ("mx_Nm", "", "column mx_Nm is empty"),
    ],
)
def test_cells_of_the_other_columns(head: str, cells: str, words: str, table: Write, xr701: Robot) -> None:
    fault = only_fault(table(f"{HEADER},{head}", f"{ROW},{cells}"), xr701)
    assert "data.csv, row 2, " in fault
    assert words in fault
    assert "To fix it:" in fault


@pytest.mark.parametrize("row", ["5,77.5,-650", "5,77.5,-650,-1.88,", "5,77,5,-650,-1.88"])
def test_ragged_rows(row: str, table: Write, xr701: Robot) -> None:
    fault = only_fault(table(HEADER, ROW, row), xr701)
    assert f"row 3, the row does not fit the header: got '{row.count(',') + 1} cells'; allowed: 4 cells" in fault


# --- the rows ------------------------------------------------------------------------------------


@pytest.mark.parametrize("load", ["0", "-0.0", "0e5"])
def test_zero_load(load: str, table: Write, xr701: Robot) -> None:
    assert "row 2, the load is zero" in only_fault(table(HEADER, f"5,77.5,{load},-1"), xr701)


def test_a_moment_alone_is_a_load(table: Write, xr701: Robot) -> None:
    m = read_measurements(table("q2_deg,q3real_deg,my_Nm,ry_mrad", "5,77.5,100,0.2"), xr701)
    assert m.loads_N.tolist() == [0.0]
    assert len(m.notes) == 2


def test_rows_without_a_reading_are_skipped_and_named(table: Write, xr701: Robot) -> None:
    rows = ["0,77.5,-650,,", "0,77.5,-375,0,", "1,77.5,-650,,", "2,77.5,-650,,"]
    m = read_measurements(table(HEADER + ",dx_mm", ROW + ",", *rows), xr701)
    assert m.row_numbers == (2, 4)
    assert "3 row(s) without any reading skipped: 3, 5-6" in m.notes


def test_faults_of_rows_without_a_reading_are_still_named(table: Write, xr701: Robot) -> None:
    assert "q2_deg = 50 is outside" in only_fault(table(HEADER, ROW, "50,77.5,-650,"), xr701)


def test_no_reading_at_all(table: Write, xr701: Robot) -> None:
    path = table(HEADER + ",dx_mm", "0,77.5,-650,,", "0,77.5,-375,,")
    assert "row 2, no deflection was read, here or in any row; allowed: at least one of dx" in only_fault(path, xr701)


def test_columns_to_fill_in_are_written_empty(table: Write, xr701: Robot, tmp_path: Path) -> None:
    m = read_measurements(table(HEADER, ROW), xr701)
    write_measurements(m, tmp_path / "out.csv", xr701, to_fill=("dx_mm", "dz_mm"))
    head, row = (tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()
    assert head.endswith("mz_Nm,dx_mm,dz_mm")
    assert row.split(",")[-2] == ""
    assert read_measurements(tmp_path / "out.csv", xr701).displacement[0, 2] == m.displacement[0, 2]


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("45.1,115,-650,-1", "q2_deg = 45.1 is outside -35 to 45 deg"),
        ("5,39.9,-650,-1", "q3real_deg = 39.9 is outside 40 to 115 deg"),
        ("-35,115,-650,-1", "forearm_deg = 30 is outside 65 to 190 deg"),
    ],
)
def test_poses_out_of_reach(row: str, words: str, table: Write, xr701: Robot) -> None:
    path = table(HEADER, ROW, row)
    fault = only_fault(path, xr701)
    assert "row 3, pose P2 cannot be taken" in fault
    assert words in fault
    assert read_measurements(path, xr701, check_reach=False).n == 2


def test_a_label_for_two_joint_vectors(table: Write, xr701: Robot) -> None:
    fault = only_fault(table("pose," + HEADER, "A," + ROW, "A,5.001,77.5,-650,-1.9"), xr701)
    assert "row 3, column pose" in fault
    assert "got 'A'; allowed: the angles of row 2" in fault


def test_two_labels_for_one_joint_vector_are_a_pose_taken_twice(table: Write, xr701: Robot) -> None:
    m = read_measurements(table("pose," + HEADER, "A," + ROW, "B,5,77.5,-375,-1.25"), xr701)
    assert list(m.pose_groups()) == ["A", "B"]


@pytest.mark.parametrize(("reading", "verb"), [("-1.88", "repeats"), ("-1.90", "contradicts")])
def test_duplicate_rows(reading: str, verb: str, table: Write, xr701: Robot) -> None:
    path = table(HEADER, ROW, "0,77.5,-650,-1.8", f"5.0,77.50,-650,{reading}")
    fault = only_fault(path, xr701)
    assert f"row 4, the reading {verb} that of row 2" in fault
    assert "a number in the column repeat" in fault


def test_each_surplus_row_is_reported_once(table: Write, xr701: Robot) -> None:
    found = faults(table(HEADER, ROW, ROW, ROW), xr701)
    assert places(found, r"row \d+, the reading repeats that of row \d+") == [
        "row 3, the reading repeats that of row 2",
        "row 4, the reading repeats that of row 2",
    ]


@pytest.mark.parametrize(
    ("column", "first", "second"),
    [
        ("repeat", "1", "2"),
        ("repeat", "", "1"),
        ("phase", "loading", "unloading"),
        ("step", "1", "2"),
        ("fx_N", "0", "1"),
        ("px_mm,py_mm,pz_mm", "0,0,0", ",,"),
    ],
)
def test_rows_that_differ_in_their_setting(column: str, first: str, second: str, table: Write, xr701: Robot) -> None:
    lines = (f"{HEADER},{column}", f"{ROW},{first}", f"{ROW},{second}")
    assert read_measurements(table(*lines), xr701).n == 2
    assert "repeats" in only_fault(table(lines[0], lines[1], lines[1]), xr701)


def test_components_may_be_read_one_after_another(table: Write, xr701: Robot) -> None:
    path = table(HEADER + ",dx_mm", ROW + ",", "5,77.5,-650,,0.1", "5,77.5,-650,,0.2")
    assert "row 4, the reading contradicts that of row 3" in only_fault(path, xr701)


def test_all_bad_rows_are_reported_in_order(table: Write, xr701: Robot) -> None:
    rows = [
        ROW,
        "x,77.5,-650,-1",
        "5,77.5,,nan",
        "5,77.5,0,-1",
        "90,77.5,-650,-1",
        ROW,
        "1,2",
        "5,77.5,-375,-1.2",
    ]
    found = faults(table(HEADER, *rows), xr701)
    assert places(found, r"^data.csv, row (\d+)") == list("34456678")
    refuses_each(
        "T002 T004 T005 T006 T007",
        re.escape("measurements data.csv: 8 problem(s)"),
        read_measurements,
        table(HEADER, *rows),
        xr701,
    )


# --- plausibility --------------------------------------------------------------------------------


def odd_notes(m: Measurements) -> tuple[str, ...]:
    return tuple(note for note in m.notes if "missing" not in note)


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (
            ["5,77.5,-650,1.88", "0,77.5,-650,1.9", "1,77.5,-650,-1.9"],
            "2 of 3 readings move against the load",
        ),
    ],
)
def test_implausible_tables_are_noted(rows: list[str], words: str, table: Write, xr701: Robot) -> None:
    found = odd_notes(read_measurements(table(HEADER, *rows), xr701))
    assert len(found) == 1
    assert words in found[0]


@pytest.mark.parametrize(
    "rows",
    [
        ["5,77.5,-650,0"],  # below the gauge's resolution
        ["5,77.5,-650,-188", "0,77.5,-375,-1"],  # one of two
        ["5,77.5,-650,1.88", "0,77.5,-650,-1.9"],  # half of them
    ],
)
def test_odd_but_possible_tables_are_not(rows: list[str], table: Write, xr701: Robot) -> None:
    assert odd_notes(read_measurements(table(HEADER, *rows), xr701)) == ()


def test_unread_load_direction_gives_no_verdict(table: Write, xr701: Robot) -> None:
    m = read_measurements(table("q2_deg,q3real_deg,fx_N,fz_N,dx_mm", "5,77.5,1,-650,-0.5"), xr701)
    assert odd_notes(m) == ()


# --- writing -------------------------------------------------------------------------------------


def test_bundled_round_trip_is_exact(tmp_path: Path, xr701: Robot) -> None:
    m = read_measurements(bundled_data("xr701"), xr701)
    write_measurements(m, tmp_path / "a.csv", xr701)
    again = read_measurements(tmp_path / "a.csv", xr701)
    assert_same(again, m, rtol=0.0)  # written digits are those of the source
    assert again.notes == ()
    assert (tmp_path / "a.csv").read_text().splitlines()[6].startswith("41,0,5,77.5,0,0,0,0,0,-150,0,0,0,-0.34")
    write_measurements(again, tmp_path / "b.csv", xr701)
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "b.csv"]


def test_a_failed_write_leaves_the_old_file_and_no_other(
    tmp_path: Path, xr701: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    m = read_measurements(bundled_data("xr701"), xr701)
    target = tmp_path / "data.csv"
    target.write_text("old")

    def full(source: Path, place: Path) -> None:
        raise OSError("disk full")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(OSError, match="disk full"):
        write_measurements(m, target, xr701)
    assert [path.name for path in tmp_path.iterdir()] == ["data.csv"]
    assert target.read_text() == "old"


def test_writing_refuses_other_endings_folders_and_robots(tmp_path: Path, xr701: Robot) -> None:
    m = read_measurements(bundled_data("xr701"), xr701)
    for path in (tmp_path / "a.xlsx", tmp_path / "none" / "a.csv"):
        refuses("B004", "existing folder", write_measurements, m, path, xr701)
    refuses("A010", "got 5; allowed: 6", write_measurements, replace(m, q=m.q[:, :5]), tmp_path / "a.csv", xr701)


texts = st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=6)
number = st.floats(-1e3, 1e3).filter(lambda x: x == 0 or abs(x) > 1e-6)
optional = st.none() | number


@st.composite
def tables(draw: st.DrawFn) -> Measurements:
    n = draw(st.integers(1, 4))

    def block(values: st.SearchStrategy[float | None], width: int) -> Array:
        rows = st.lists(st.lists(values, min_size=width, max_size=width), min_size=n, max_size=n)
        return np.array(draw(rows), dtype=np.float64)

    limits = load_robot("xr701").limits
    q = limits[:, 0] + np.abs(block(number, 6)) / 1e3 * (limits[:, 1] - limits[:, 0])
    wrench, displacement = block(number, 6), block(optional, 6)
    wrench[:, 2], displacement[:, 0] = -650.0, 1e-3
    point = np.where(block(st.sampled_from([0.0, 1.0]), 1) > 0, block(number, 3), np.nan)
    sigma = np.abs(block(optional, 1)[:, 0])
    return Measurements(
        source="made",
        sha256="",
        q=q,
        wrench=wrench,
        displacement=displacement,
        point=point,
        sigma=np.where(sigma > 0, sigma, np.nan),
        pose=tuple(f"{draw(texts)}/{i}" for i in range(n)),
        repeat=tuple(range(1, n + 1)),
        phase=tuple(draw(st.sampled_from([None, "loading", "unloading"])) for _ in range(n)),
        step=block(optional, 1)[:, 0],
        row_numbers=tuple(range(2, n + 2)),
        extra={"free text": tuple(draw(texts) for _ in range(n))},
        notes=(),
    )


@pytest.mark.slow
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(m=tables())
def test_round_trip(m: Measurements, tmp_path: Path, xr701: Robot) -> None:
    path = tmp_path / "made.csv"
    write_measurements(m, path, xr701)
    again = read_measurements(path, xr701, check_reach=False)
    assert_same(again, m, rtol=1e-14)  # 15 written digits: 5e-15, and two roundings of the unit's factor
    assert again.row_numbers == m.row_numbers
    assert {item.name for item in fields(again)} == {item.name for item in fields(m)}


def test_angles_in_radians_that_leave_the_limits_are_one_fault(table: Write, xr701: Robot) -> None:
    """q3real of 77.5 deg typed as 1.35 is below its 40 deg: said once, not row by row."""
    rows = [f"{np.radians(q2):.6f},{np.radians(77.5):.6f},-650,-1.9" for q2 in (0, 5, 10)]
    info = refuses("T005", "", read_measurements, table(HEADER, *rows), xr701)
    assert "3 of 3 poses cannot be taken as typed, all of them with angles read as radians" in str(info)
    assert "1 problem(s)" in str(info)
    # One slip among degrees is what it was: a row with its own fault.
    refuses(
        "T005",
        r"q3real_deg = 1\.35 is outside",
        read_measurements,
        table(HEADER, "5,77.5,-650,-1.9", "6,1.35,-650,-1.9"),
        xr701,
    )


def test_what_was_read_largest(table: Write, xr701: Robot) -> None:
    path = table(
        "q2_deg,q3real_deg,fz_N,dx_mm,dz_mm,ry_mrad,pose",
        "5,77.5,-100,0.3,-0.4,,a",
        "5,77.5,-200,0.6,-0.8,,a",
        "10,77.5,-200,,-2,,b",
        "15,77.5,-200,,,1,c",
    )
    m = read_measurements(path, xr701)
    component, size = m.largest
    assert component[:3].tolist() == [2, 2, 2]
    assert size == pytest.approx([4e-4, 8e-4, 2e-3, np.nan], nan_ok=True)
    assert m.deflection == pytest.approx([5e-4, 1e-3, 2e-3, np.nan], nan_ok=True)
    # A NaN is less than anything, and where there is nothing else its row is taken.
    assert largest_rows(m.pose, size).tolist() == [1, 2, 3]
    assert largest_rows(("a", "a", "b"), np.array([np.nan, -1.0, 3.0])).tolist() == [1, 2]
