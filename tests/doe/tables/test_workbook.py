"""Workbooks: what a cell does not show is refused by its address, and none costs more than a table may."""

from __future__ import annotations

import io
import time
import zipfile
from collections.abc import Callable
from typing import Any

import openpyxl  # type: ignore[import-untyped]
import pytest

from doe.tables.workbook import MOST_CELLS, MOST_COLUMNS, Sheet, read_first_sheet
from robots import InputError

HEADER = ["pose", "fz_N", "dz_mm"]
ROWS = [["A", -100, -0.5], ["B", -200, -1.25], ["C", -300, -1.5]]
SHEET = "xl/worksheets/sheet1.xml"
Edit = Callable[[Any], None]


def workbook(edit: Edit = lambda sheet: None) -> bytes:
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "data"
    for row in (HEADER, *ROWS):
        sheet.append(row)
    edit(sheet)
    file = io.BytesIO()
    book.save(file)
    return file.getvalue()


def rewritten(data: bytes, part: str, change: Callable[[bytes], bytes]) -> bytes:
    """The archive with one of its files changed."""
    file = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            new.writestr(name, change(old.read(name)) if name == part else old.read(name))
    return file.getvalue()


def in_sheet(old: str, new: str, data: bytes | None = None) -> bytes:
    def change(xml: bytes) -> bytes:
        assert old.encode() in xml
        return xml.replace(old.encode(), new.encode(), 1)

    return rewritten(workbook() if data is None else data, SHEET, change)


def calculated(data: bytes) -> bytes:
    """As a spreadsheet program leaves it: nothing waits to be calculated."""
    return rewritten(data, "xl/workbook.xml", lambda xml: xml.replace(b'fullCalcOnLoad="1"', b""))


def read(data: bytes) -> Sheet:
    return read_first_sheet(data, "measurement file data.xlsx")


def refusal(data: bytes) -> str:
    with pytest.raises(InputError) as caught:
        read(data)
    return str(caught.value)


def formula(sheet: Any) -> None:
    sheet["C3"] = "=-1.25"


def test_cells_come_back_as_they_are_shown() -> None:
    def edit(sheet: Any) -> None:
        sheet["C2"], sheet["C3"], sheet["C4"], sheet["E5"] = 1.0, True, "-0.35", "note"

    assert read(workbook(edit)).rows == [
        [*HEADER, "", ""],
        ["A", "-100", "1", "", ""],
        ["B", "-200", "True", "", ""],
        ["C", "-300", "-0.35", "", ""],
        ["", "", "", "", "note"],
    ]


def test_a_formula_without_a_stored_value_is_refused_by_its_cell() -> None:
    said = refusal(calculated(workbook(formula)))
    assert "sheet data: a formula without a stored value in C3; " in said
    assert "save it" in said
    assert "paste them as values" in said


def test_the_value_beside_a_formula_counts_if_it_was_calculated() -> None:
    plain = calculated(workbook())
    formula_with = "<f>-1-0.25</f><v>-1.25</v>"
    assert read(in_sheet("<v>-1.25</v>", formula_with, plain)).rows[2] == ["B", "-200", "-1.25"]
    # Writers that do not calculate put 0 there and ask for it when the file is opened.
    assert "in C3" in refusal(in_sheet("<v>-1.25</v>", "<f>-1-0.25</f><v>0</v>"))


def test_a_formula_that_gives_empty_text_is_an_empty_cell() -> None:
    old, new = '<c r="C3" t="n"><v>-1.25</v>', '<c r="C3" t="str"><f>""</f><v></v>'
    assert read(in_sheet(old, new, calculated(workbook()))).rows[2] == ["B", "-200", ""]
    assert "in C3" in refusal(in_sheet(old, new.replace("<v></v>", ""), calculated(workbook())))


@pytest.mark.parametrize("area", ["C2:C4", "A4:B4", "C3:F9"])
def test_merged_cells_of_the_table_are_refused(area: str) -> None:
    said = refusal(workbook(lambda sheet: sheet.merge_cells(area)))
    assert f"merged cells {area}" in said
    assert "unmerge" in said


def test_merged_cells_away_from_the_table_do_no_harm() -> None:
    assert len(read(workbook(lambda sheet: sheet.merge_cells("E1:G2"))).rows) == 4


def test_error_values_and_hidden_rows_are_refused_all_at_once() -> None:
    def edit(sheet: Any) -> None:
        sheet["C2"] = "#N/A"
        sheet.row_dimensions[3].hidden = sheet.row_dimensions[4].hidden = True

    said = refusal(workbook(edit))
    assert "2 problem(s)" in said
    assert "an error in place of a value in C2" in said
    assert "rows 3-4 are hidden" in said


def test_other_sheets_and_hidden_columns_are_said() -> None:
    def edit(sheet: Any) -> None:
        sheet.parent.create_sheet("more").append(HEADER)
        sheet.column_dimensions["C"].hidden = True

    assert read(workbook(edit)).notes == (
        "only the first sheet, data, is read; left out: more",
        "hidden columns of sheet data are read too: C",
    )


def test_a_hidden_first_sheet_is_refused() -> None:
    def edit(sheet: Any) -> None:
        sheet.parent.create_sheet("more")
        sheet.sheet_state = "hidden"

    assert "the first sheet, data, is hidden" in refusal(workbook(edit))


def test_what_the_sheet_says_of_its_size_does_not_count() -> None:
    assert len(read(in_sheet('ref="A1:C4"', 'ref="A1:B2"')).rows) == 4
    assert len(read(in_sheet('ref="A1:C4"', 'ref="A1:XFD1048576"')).rows) == 4


def test_formatted_cells_without_content_do_not_count() -> None:
    data = in_sheet("</sheetData>", '<row r="1048576"><c r="XFD1048576" s="0"/></row></sheetData>')
    assert len(read(data).rows) == 4


@pytest.mark.parametrize(("cell", "says"), [("XFD1048576", "16384 columns"), ("A1048576", "1048576 rows")])
def test_one_cell_far_away_is_named_at_once(cell: str, says: str) -> None:
    start = time.monotonic()
    said = refusal(workbook(lambda sheet: sheet.__setitem__(cell, 1)))
    assert f"cell {cell}" in said
    assert says in said
    assert f"up to {MOST_COLUMNS} columns, and {MOST_CELLS} cells" in said
    assert time.monotonic() - start < 60.0  # it took minutes to fill the cells between; this takes milliseconds


@pytest.mark.slow
def test_a_bomb_is_refused_by_its_size_when_unpacked() -> None:
    data = rewritten(workbook(), "xl/styles.xml", lambda xml: xml + b" " * 210 * 2**20)
    assert len(data) < 300_000
    assert "unpacked: got '210 MB" in refusal(data)


@pytest.mark.parametrize("part", [SHEET, "xl/styles.xml", "xl/workbook.xml", "[Content_Types].xml"])
def test_a_document_type_is_refused_wherever_it_stands(part: str) -> None:
    def change(xml: bytes) -> bytes:
        head, mark, rest = xml.rpartition(b"?>")
        return head + mark + b'<!DOCTYPE x [<!ENTITY a "1">]>' + rest

    assert "document type" in refusal(rewritten(workbook(), part, change))


@pytest.mark.parametrize(
    ("old", "new"),
    [('r="A3"', 'r="A2"'), ('r="B3"', 'r="A3"'), ('<row r="3"', '<row r="2"'), ('r="A3"', 'r="AAAA3"')],
)
def test_cells_out_of_place_are_refused(old: str, new: str) -> None:
    assert "stands" in refusal(in_sheet(old, new))


@pytest.mark.parametrize("data", [b"PK\x03\x04broken", b"\xd0\xcf\x11\xe0" + bytes(600), b"x"])
def test_what_is_no_workbook_is_bad_input(data: bytes) -> None:
    assert "not a readable XLSX workbook" in refusal(data)
