"""The page of ratios is what its script makes of the pages that measured them."""

from __future__ import annotations

import performance_ratios as page
import pytest
from performance_ratios import FASTER, SLOWER, Ratio, ratio

TEXT = """# A page

Ratios repeat to
within a third. It takes 3 s, 12.5 times as long.

| arm | links | plain | before, now |
|---|---|---|---|
| a | beam | 36.2 | 12, 8 |
| b | beam | 1 204 | 3, 3 |
| b | rigid | 1.1 to 1.5 | 3, 3 |
"""


def of(column: str = "", rows: tuple[str, ...] = (), **options: object) -> Ratio:
    return Ratio("what", "peer", "page.md", "file.py", column, rows, **options)  # type: ignore[arg-type]


def test_the_page_is_what_the_script_writes() -> None:
    assert page.PAGE.read_text(encoding="utf-8") == page.page()


def test_a_range_goes_over_the_rows_that_are_meant() -> None:
    assert ratio(of("plain", ("beam",)), TEXT) == "36 to 1200"
    assert ratio(of("plain", ("| a |",)), TEXT) == "36"
    assert ratio(of("plain", ("rigid",)), TEXT) == "1.1 to 1.5"
    assert ratio(of("before", ("| a |",), parts=(0, 1)), TEXT) == "1.5"
    assert ratio(of(sentence=r"3 s, ([\d.]+) times"), TEXT) == "12.5"
    assert page.lasts(TEXT) == "a third"
    assert page.lasts("") == "not stated"


@pytest.mark.parametrize("gone", [of("plain", ("solid",)), of("slow", ("beam",)), of(sentence=r"(\d+) times as short")])
def test_a_row_that_is_gone_stops_the_script(gone: Ratio) -> None:
    with pytest.raises(SystemExit, match=r"page\.md"):
        ratio(gone, TEXT)


def test_each_command_is_a_file_that_is_there() -> None:
    root = page.DOCS.parent
    assert [
        r.command for r in (*FASTER, *SLOWER) if r.command.endswith(".py") and not (root / r.command).is_file()
    ] == []
