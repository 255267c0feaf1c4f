"""Text in any encoding and with any separator gives the same cells; what is no text is refused."""

from __future__ import annotations

from pathlib import Path

import pytest
from refusals import refuses

from doe.instruments.cells import SEPARATORS, read_grids
from doe.instruments.decoded import decoded

TEXT = "Pr\u00fcfpunkt;X [\u00b5m];Y [\u00b0]\nA;1,5;2,25\nB;3,5;4,75\n"


@pytest.mark.parametrize(
    ("encoding", "name"),
    [
        ("utf-8", "utf-8"),
        ("utf-8-sig", "utf-8"),
        ("utf-16", "utf-16"),
        ("utf-16-le", "utf-16-le"),
        ("utf-16-be", "utf-16-be"),
        ("cp1252", "windows-1252"),
        ("latin-1", "windows-1252"),
    ],
)
def test_the_encoding_is_found(encoding: str, name: str) -> None:
    assert decoded(TEXT.encode(encoding), "f") == (TEXT, name)


def test_an_encoding_that_is_asked_for_is_taken() -> None:
    text = "\u0442\u043e\u0447\u043a\u0430;1\n"
    assert decoded(text.encode("cp1251"), "f", "windows-1251") == (text, "windows-1251")
    for given in ("ebcdic", "utf-8"):
        refuses("I001", r"--encoding|not text in utf-8", decoded, text.encode("cp1251"), "f", given)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"PK\x03\x04rest", "workbook"),
        (b"\xd0\xcf\x11\xe0rest", "old workbook"),
        (bytes(range(1, 256)) * 3, "not text"),
        (b"a\x00b" * 10, "not text"),
    ],
)
def test_what_is_no_text_is_refused(data: bytes, says: str) -> None:
    refuses("I001", says, decoded, data, "f")


@pytest.mark.parametrize("name", SEPARATORS)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_the_separator_is_found(tmp_path: Path, name: str, end: str) -> None:
    rows = [["pose", "x_mm", "y_mm", "z_mm"], ["A", "1.5", "2.5", "-3"], ["B", "1.25", "2", "-3.5"]]
    file = tmp_path / "f.txt"
    file.write_bytes(end.join(SEPARATORS[name].join(row) for row in rows).encode())
    (grid,) = read_grids(file)
    assert [list(row) for row in grid.rows] == rows
    assert grid.lines == (1, 2, 3)


def test_words_with_blanks_and_their_units_stay_together(tmp_path: Path) -> None:
    file = tmp_path / "f.txt"
    file.write_text('Name X [mm] Y (mm)\nA 1 2\n"B C" 3 4\n', encoding="utf-8")
    (grid,) = read_grids(file)
    assert grid.rows[0] == ("Name", "X [mm]", "Y (mm)")
    assert grid.rows[2] == ("B C", "3", "4")


def test_comments_are_set_apart_and_numbered_rows_are_none(tmp_path: Path) -> None:
    file = tmp_path / "f.txt"
    file.write_text("// units: mm\n# made by hand\nid,x,y\n#1,2,3\n#2,4,5\n", encoding="utf-8")
    (grid,) = read_grids(file)
    assert grid.comments == ((1, "units: mm"), (2, "made by hand"))
    assert grid.rows[-1] == ("#2", "4", "5")


def test_the_first_line_of_a_spreadsheet_names_the_separator(tmp_path: Path) -> None:
    file = tmp_path / "f.csv"
    file.write_text("sep=;\na;b\n1,5;2,5\n", encoding="utf-8")
    assert read_grids(file)[0].rows[-1] == ("1,5", "2,5")


@pytest.mark.parametrize("content", ["", "  \n \n", "// nothing\n", "one word\nanother\n"])
def test_a_file_without_readings_is_refused(tmp_path: Path, content: str) -> None:
    file = tmp_path / "f.txt"
    file.write_text(content, encoding="utf-8")
    refuses("I002", r"empty|no line|no separator", read_grids, file)


def test_two_separators_that_make_other_tables_are_asked_about(tmp_path: Path) -> None:
    file = tmp_path / "f.txt"
    file.write_text("1;2|3\n4;5|6\n", encoding="utf-8")
    refuses("I002", "--separator", read_grids, file)
    assert read_grids(file, separator="bar")[0].rows[0] == ("1;2", "3")
