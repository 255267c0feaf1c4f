"""Every command that a page shows runs, where the page does not say why not."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from page_commands import NOT_RUN, RUN_IN, RUN_WITH, SHELL, Typed, by_the_shell, filled_in, lay_out, not_said, typed
from page_figures import not_printed
from test_docs import DOCS, pages
from test_house import ROOT

SHOWING = [
    page
    for page in (ROOT / "README.md", *pages())
    if any(line.words[0] not in SHELL for line in typed(page.read_text(encoding="utf-8")))
]


def run(words: list[str], folder: Path) -> tuple[str, str]:
    """What a command says where it fails, and all that it prints."""
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
    failed = "" if done.returncode == 0 else f"stiffarm {' '.join(words)}: {done.returncode}: {done.stderr[-1500:]}"
    return failed, done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("page", SHOWING, ids=lambda p: str(p.relative_to(ROOT)))
def test_commands_of_a_page_run_as_they_stand(page: Path, tmp_path: Path) -> None:
    shutil.copytree(DOCS / "examples", tmp_path / "docs" / "examples")
    folder, failed, said = tmp_path, [], ""
    text = page.read_text(encoding="utf-8")
    for line in typed(text):
        if line.skipped or line.run_in:
            continue
        lay_out(line.given, folder)
        if line.words[0] in SHELL:
            folder = by_the_shell(line.words, folder)
            continue
        wrong, printed = run(filled_in(line.words, line.given), folder)
        failed.append(wrong)
        said += printed
    assert [one for one in failed if one] == []
    assert not_said(text, said) == []
    assert not_printed(text, said) == []


def asked(line: Typed) -> list[str]:
    """A command without the folder that it writes to."""
    words = filled_in(line.words, line.given)
    return words[: words.index("--out")] if "--out" in words else words


def test_most_commands_are_run() -> None:
    lines = [line for page in SHOWING for line in typed(page.read_text(encoding="utf-8")) if line.words[0] not in SHELL]
    skipped = sum(bool(line.skipped) for line in lines)
    assert len(lines) > 80
    assert skipped < len(lines) / 3, f"{skipped} of {len(lines)} are not run"


@pytest.mark.parametrize("page", SHOWING, ids=lambda p: str(p.relative_to(ROOT)))
def test_what_another_page_runs_is_there_word_for_word(page: Path) -> None:
    for line in typed(page.read_text(encoding="utf-8")):
        if line.run_in and not line.skipped:
            there = typed((DOCS / line.run_in).read_text(encoding="utf-8"))
            assert asked(line) in [asked(x) for x in there if not (x.skipped or x.run_in)], line.words


@pytest.mark.parametrize("page", SHOWING, ids=lambda p: str(p.relative_to(ROOT)))
def test_a_page_says_why_a_command_is_not_run(page: Path) -> None:
    """No mark is misspelt, stands away from its block, or leaves out a command that the block does not have."""
    text = page.read_text(encoding="utf-8")
    lines = list(typed(text))
    marks = re.findall(r"<!-- (?:not )?run\b.*", text)
    assert [mark for mark in marks if not any(known.fullmatch(mark) for known in (RUN_WITH, RUN_IN, NOT_RUN))] == []
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


def test_files_are_copied_and_joined(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("one\n", encoding="utf-8")
    text = "```sh\ncp a.toml b.toml\ncat a.toml >> b.toml\n```\n"
    for line in typed(text):
        assert by_the_shell(line.words, tmp_path) == tmp_path
    assert (tmp_path / "b.toml").read_text(encoding="utf-8") == "one\none\n"
    with pytest.raises(ValueError, match="mv"):
        by_the_shell(("mv", "a", "b"), tmp_path)


def test_what_a_page_shows_must_have_been_printed() -> None:
    text = "<!-- shown -->\n```text\n│ j2 │  1.5 │\n...\n2 of 3\n```\n\n```text\nnobody says it\n```\n"
    assert not_said(text, "┃ head\n│ j2 │ 1.5 │\n") == ["2 of 3"]
