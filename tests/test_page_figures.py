"""Figures in pages are those of results files, of tests, or of the script that writes the page."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from page_figures import MARK, MOST_NUMBERS, Block, blocks, figures, lines_of, missing, not_printed, numbers_of
from test_docs import DOCS, pages
from test_house import ROOT

MEASURED = sorted(page for folder in ("validation", "performance") for page in (DOCS / folder).glob("*.md"))
MARKED = [page for page in (ROOT / "README.md", *pages()) if MARK.search(page.read_text(encoding="utf-8"))]
# "Written by `python benchmarks/... --write`": the whole page, or what stands above its line of notes.
WRITTEN = re.compile(r"(?:Written|Measured|made again) by `python (benchmarks/[\w/]+\.py)[^`]*--(?:write|page)")
NOTES = "<!-- notes -->"
# Pages that say it in other words.
WRITERS = {
    "diagnosis_study.md": "benchmarks/diagnosis/protocol.py",
    "positions.md": "benchmarks/absolute/measured_positions.py",
    "positions_diagnosis.md": "benchmarks/absolute/position_study.py",
    "power.md": "benchmarks/diagnosis/power_study.py",
    "tool_path_corpus.md": "benchmarks/toolpaths/tool_path_corpus.py",
    "placement.md": "benchmarks/shop/placement_grid.py",
}


def writer(page: Path) -> str:
    """The script that writes a page, if one does."""
    if page.name in WRITERS:
        return WRITERS[page.name]
    found = WRITTEN.search(" ".join(page.read_text(encoding="utf-8").split()))
    return found[1] if found else ""


def by_hand(page: Path) -> list[Block]:
    """Blocks that no script writes."""
    text = page.read_text(encoding="utf-8")
    kept = text.partition(NOTES)[0].count("\n") if NOTES in text else 10**6
    return [block for block in blocks(text) if not writer(page) or block.line > kept]


@pytest.mark.parametrize("page", MARKED, ids=lambda p: str(p.relative_to(ROOT)))
def test_figures_are_those_of_the_files_named(page: Path) -> None:
    assert missing(page) == {}, "line: figures that no file of the mark above has"


@pytest.mark.parametrize("page", MEASURED, ids=lambda p: f"{p.parent.name}/{p.name}")
def test_measured_figures_say_where_they_are_from(page: Path) -> None:
    bare = {b.line: [f.said for f in figures(b)] for b in by_hand(page) if not b.kind and figures(b)}
    assert bare == {}, "line: figures under no mark"


@pytest.mark.parametrize("page", [p for p in MEASURED if writer(p)], ids=lambda p: f"{p.parent.name}/{p.name}")
def test_the_script_that_a_page_names_writes_it(page: Path) -> None:
    script = ROOT / writer(page)
    assert page.stem in script.read_text(encoding="utf-8"), f"{script} does not name {page.name}"


@pytest.mark.parametrize("page", MARKED, ids=lambda p: str(p.relative_to(ROOT)))
def test_marks_are_well_made(page: Path) -> None:
    """None is misspelt or stands above nothing; files exist, and hold few enough numbers to prove something."""
    text = page.read_text(encoding="utf-8")
    assert len(re.findall(r"^ *<!-- figures\b", text, re.MULTILINE)) == len(MARK.findall(text))
    held = {(block.kind, block.named) for block in blocks(text)}
    for kind, names, printed in MARK.findall(text):
        assert (kind or printed, tuple(names.split())) in held, names
        for name in names.split():
            path = ROOT / name
            assert path.is_file(), name
            if kind == "asserted by":
                assert name.startswith("tests/")
                assert page.name in path.read_text(encoding="utf-8"), f"{name} does not name {page.name}"
            elif path != page:
                assert len(numbers_of(lines_of(path))) <= MOST_NUMBERS, f"{name}: nearly every number occurs in it"


RESULTS = "[one]\nrms_mm = 0.2714\nshare = 0.4561\nms = 1218.4\nends = [-0.158, 96.2]\n"


@pytest.mark.parametrize(
    ("said", "wrong"),
    [
        ("It is 0.27 mm, 45.6 % of all and 1200 times as fast.", []),
        ("It is 0.28 mm, 45.7 % of all and 1300 times as fast.", ["0.28", "45.7", "1300"]),
        ("From -0.158 to 0.271 mm.", []),
        ("From 0.2714 to 0.272 mm.", ["0.272"]),
        ("Of 27 sets of 95 % intervals 46 and 96.2 % hold, with Python 3.11 and `0.5 mm`.", []),
        ("| a | b, % |\n|---|---|\n| 9 mm of x | 46 (45.6 to 96.2) |\n| y | 47 |", ["47"]),
        ("- one: 0.3 mm\n\n- another: 0.4 mm", ["0.4"]),
        ("# A heading of 7 mm\n\n```sh\nsleep 8 s\n```\n\nIt is [0.3](a_9.9_mm.md) mm.", []),
    ],
)
def test_a_figure_that_is_not_in_the_file_is_found(said: str, wrong: list[str], tmp_path: Path) -> None:
    results, page = tmp_path / "results.toml", tmp_path / "page.md"
    results.write_text(f"# On 2026-11-27 0.28 and 47 were 0.4 and 1300\n{RESULTS}", encoding="utf-8")
    page.write_text(f"<!-- figures from: {results} -->\n{said}\n", encoding="utf-8")
    assert [figure for lost in missing(page).values() for figure in lost] == wrong


def test_a_mark_holds_for_its_block_or_its_section() -> None:
    first = "One: 1 mm.\n\n<!-- figures from: a b -->\nTwo: 2 mm.\n\n- three\n\n"
    section = "<!-- figures asserted by: c -->\n\n## Four\n\n| five |\n|---|\n\n### Six\n\nSeven\n\n"
    page = f"{first}{section}<!-- figures printed -->\nEight: 8 mm.\n\n## Nine\n\nTen\n"
    assert [(b.text[:3], b.kind, b.named) for b in blocks(page)] == [
        ("One", "", ()),
        ("Two", "from", ("a", "b")),
        ("- t", "", ()),
        ("| f", "asserted by", ("c",)),
        ("Sev", "asserted by", ("c",)),
        ("Eig", "printed", ()),
        ("Ten", "", ()),
    ]
    assert not_printed(page, "found 7.6 mm") == []
    assert not_printed(page, "found 7.4 mm") == ["8"]


def test_a_page_is_no_proof_of_itself(tmp_path: Path) -> None:
    """Its own tables are, and what its commands print."""
    page = tmp_path / "page.md"
    text = f"<!-- figures from: {page} -->\nSo 3.2 and 4 %, 5.5 and 6.6 mm.\n\nAlso 6.6 mm.\n\n"
    table = "| a |\n|---|\n| 3.21 |\n| 0.04 |\n\n"
    page.write_text(f"{text}{table}<!-- shown -->\n```text\nRMS 5.5 mm\n```\n", encoding="utf-8")
    assert missing(page) == {2: ["6.6"]}
