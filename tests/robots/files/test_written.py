"""Files are there whole or not at all, on the disk before they bear their names, however the writing ends."""

from __future__ import annotations

import csv
import errno
import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.files import written
from robots.files.csv_text import as_read, cell, columns_text, records_text, rows_text
from robots.files.written import is_draft, settle, write_whole, written_whole


def test_a_file_appears_whole_and_replaces_the_one_before(tmp_path: Path) -> None:
    path = tmp_path / "a.vtu"
    path.write_text("old")
    with written_whole(path) as draft:
        assert draft.parent == tmp_path
        assert draft.suffix == ".vtu"
        assert is_draft(draft.name)
        draft.write_text("new")
        assert path.read_text() == "old"
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"a.vtu": "new"}
    for content in ("ü\n", b"\0\xff"):
        write_whole(path, content)
        assert path.read_bytes() == (content.encode() if isinstance(content, str) else content)


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(errno.ENOSPC, "No space left on device")])
def test_an_error_while_it_is_written_leaves_the_file_before(tmp_path: Path, error: BaseException) -> None:
    path = tmp_path / "a"
    path.write_text("old")
    with pytest.raises(type(error)), written_whole(path) as draft:  # noqa: PT012 - the block is what is tested
        draft.write_text("half")
        raise error
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"a": "old"}


def test_the_content_is_on_the_disk_before_it_has_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []

    def noted(name: str) -> Callable[..., Any]:
        function = getattr(os, name)

        def call(*args: Any) -> Any:
            done.append(name)
            return function(*args)

        return call

    for name in ("fsync", "replace"):
        monkeypatch.setattr(os, name, noted(name))
    write_whole(tmp_path / "a", "x")
    assert done == ["fsync", "replace", "fsync"]  # the file, its name, the folder


def test_a_disk_that_cannot_take_it_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(code: int) -> Callable[[int], None]:
        def fsync(descriptor: int) -> None:
            raise OSError(code, os.strerror(code))

        return fsync

    monkeypatch.setattr(os, "fsync", refuse(errno.EIO))
    with pytest.raises(OSError, match="error"):
        write_whole(tmp_path / "a", "x")
    assert not list(tmp_path.iterdir())
    # A system that has no such call for a folder is none that refuses.
    monkeypatch.setattr(os, "fsync", refuse(errno.EINVAL))
    settle(tmp_path)
    with pytest.raises(FileNotFoundError):
        settle(tmp_path / "gone")


def test_what_is_unfinished_is_put_away_where_the_process_stops(tmp_path: Path) -> None:
    done: list[int] = []

    def fail() -> None:
        raise OSError("busy")

    with written_whole(tmp_path / "a") as draft:
        draft.write_text("half")
        with written.tidied_by(lambda: done.append(1)), written.tidied_by(fail):
            written.tidy()
        assert done == [1]
        assert not draft.exists()
        draft.write_text("whole")
    written.tidy()
    assert [p.name for p in tmp_path.iterdir()] == ["a"]
    assert written.sha256_of(tmp_path / "a") == "5d5766cf2d78701614200418ee1450690d9af12c84d52545e4802f001ad53099"


def test_names_that_the_locale_could_not_read_keep_their_bytes(tmp_path: Path) -> None:
    """With an ASCII locale Python has the bytes of an umlaut as surrogates."""
    read = os.fsencode("dä.csv").decode("ascii", "surrogateescape")
    write_whole(tmp_path / "a.txt", f"from {read}")
    assert (tmp_path / "a.txt").read_text(encoding="utf-8") == "from dä.csv"


# ------------------------------------------------------------
# CSV that a spreadsheet opens: no text becomes a formula, and all of it comes back

FORMULAS = ("=1+1", "+1+1", "-1+1", "@SUM(A1)", "\t=1", "\r=1", " =1", "\uff1d1", "=HYPERLINK(A1)", "-", "'=1")
NUMBERS = ("-5", "+5", "-1.5e-3", "-.5", "1", "")


@pytest.mark.parametrize("text", FORMULAS)
def test_a_formula_becomes_a_text(text: str) -> None:
    assert cell(text) == f"'{text}"
    assert as_read(cell(text)) == text


@pytest.mark.parametrize("text", [*NUMBERS, "pose 1", "'quoted'", "a=b", "'"])
def test_what_is_none_stays(text: str) -> None:
    assert cell(text) == text
    assert as_read(text) == text


def test_a_quoted_number_stays_a_text() -> None:
    # Somebody's '-5 is no reading: what cell never writes is not unwrapped.
    assert as_read("'-5") == "'-5"


@given(st.text(alphabet=st.sampled_from("'=+-@\t\r\n 1a.e"), max_size=6))
def test_every_text_comes_back(text: str) -> None:
    rows = list(csv.reader(io.StringIO(rows_text([[text, "x"]]), newline="")))
    assert [as_read(v) for v in rows[0]] == [text, "x"]
    assert cell(text)[:1] not in "=+-@\t\r" or cell(text) == "" or float(cell(text)) == float(text)


def test_numbers_keep_all_their_digits() -> None:
    values = (1, 0.1, -1e-300, np.float64(1 / 3), np.int64(-4), float("nan"), None, True, float("-inf"))
    assert rows_text([values]) == "1,0.1,-1e-300,0.3333333333333333,-4,,,True,-inf\n"


def test_records_and_columns() -> None:
    assert records_text([{"a": 1, "b": "=x"}, {"b": None, "c": 2.5}]) == "a,b,c\n1,'=x,\n,,2.5\n"
    assert columns_text({"=n": ["-a", "b"], "x": np.array([1 / 3, np.nan])}, digits=3) == "'=n,x\n'-a,0.333\nb,\n"


def test_nothing_else_writes_csv() -> None:
    root = Path(__file__).parents[3]
    packages = ("robots", "meshes", "fem", "doe", "surrogate", "machining", "rehearsal", "stiffarm")
    files = [file for name in packages for file in (root / name).rglob("*.py") if file.name != "csv_text.py"]
    assert len(files) > 300
    for file in files:
        text = file.read_text(encoding="utf-8")
        assert not any(word in text for word in ("csv.writer", "csv.DictWriter", "to_csv(", "to_excel(")), file
