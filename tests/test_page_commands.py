"""Every command that a page shows runs, where the page does not say why not."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from page_commands import NOT_RUN, RUN_WITH, Typed, filled_in, lay_out, typed
from test_docs import DOCS, pages
from test_house import ROOT

SHOWING = [
    page
    for page in (ROOT / "README.md", *pages())
    if any(line.words[0] != "cd" for line in typed(page.read_text(encoding="utf-8")))
]


def run(words: list[str], folder: Path) -> str:
    """What a command says where it fails."""
    done = subprocess.run(  # noqa: S603 - our own command
        [sys.executable, "-m", "stiffarm", *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "utf-8"},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        encoding="utf-8",
        timeout=600,
        check=False,
    )
    return "" if done.returncode == 0 else f"stiffarm {' '.join(words)}: {done.returncode}: {done.stderr[-1500:]}"


@pytest.mark.slow
@pytest.mark.parametrize("page", SHOWING, ids=lambda p: str(p.relative_to(ROOT)))
def test_commands_of_a_page_run_as_they_stand(page: Path, tmp_path: Path) -> None:
    shutil.copytree(DOCS / "examples", tmp_path / "docs" / "examples")
    folder, failed = tmp_path, []
    for line in typed(page.read_text(encoding="utf-8")):
        if line.skipped:
            continue
        if line.words[0] == "cd":
            folder = folder / line.words[1]
            continue
        lay_out(line.given, folder)
        failed.append(run(filled_in(line.words, line.given), folder))
    assert [one for one in failed if one] == []


def test_most_commands_are_run() -> None:
    lines = [line for page in SHOWING for line in typed(page.read_text(encoding="utf-8")) if line.words[0] != "cd"]
    skipped = sum(bool(line.skipped) for line in lines)
    assert len(lines) > 80
    assert skipped < len(lines) / 3, f"{skipped} of {len(lines)} are not run"


@pytest.mark.parametrize("page", SHOWING, ids=lambda p: str(p.relative_to(ROOT)))
def test_a_page_says_why_a_command_is_not_run(page: Path) -> None:
    """No mark is misspelt, stands away from its block, or leaves out a command that the block does not have."""
    text = page.read_text(encoding="utf-8")
    lines = list(typed(text))
    marks = re.findall(r"<!-- (?:not )?run\b.*", text)
    assert [mark for mark in marks if not (RUN_WITH.fullmatch(mark) or NOT_RUN.fullmatch(mark))] == []
    assert all("=" in word for some in RUN_WITH.findall(text) for word in some.split())
    for names, why in NOT_RUN.findall(text):
        assert why in {line.skipped for line in lines}, "no block below this mark"
        for name in filter(None, names.split(",")):
            assert any(" ".join(line.words).startswith(name.strip()) for line in lines), name


def test_marks_are_read() -> None:
    text = (
        "<!-- run with: MODEL=xr701 a.csv=b.csv -->\n<!-- not run (map slice): minutes -->\n```sh\ncd folder\n"
        "stiffarm run MODEL a.csv \\\n  [--x 1]   # note\nstiffarm map slice MODEL\nmake run\n```\n\n"
        "<!-- not run: no -->\n```sh\nstiffarm robots\n```\n```sh\nstiffarm new\n```\n"
    )
    given = {"MODEL": "xr701", "a.csv": "b.csv"}
    found = list(typed(text))
    assert found == [
        Typed(("cd", "folder"), given),
        Typed(("run", "MODEL", "a.csv", "[--x", "1]"), given),
        Typed(("map", "slice", "MODEL"), given, "minutes"),
        Typed(("robots",), {}, "no"),
        Typed(("new",), {}),
    ]
    assert filled_in(found[1].words, given) == ["run", "xr701", "a.csv", "--x", "1"]
    assert filled_in(("plan", "[DATA]", "x"), given) == ["plan", "x"]
