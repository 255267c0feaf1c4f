"""The scripts of the gallery run as they are written: each asks one question, draws one picture, prints one number."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from gallery_runs import DOCS, EXAMPLES, ROOT, alternative_text, missing

SCRIPTS = sorted(EXAMPLES.glob("*.py"))
LONGEST, LONGEST_TITLE, WIDEST = 60, 45, 88
UNITS = r"(?:mm|um|N m/rad|N/mm|%|times|readings|set-ups|effects)"
NAMES = re.compile(r":doc:`[^`]*`|`[^`]*`|\b(?=\w*[A-Z])[\w-]*\d[\w-]*|\d-D|[Jj]oints? \d(?: and \d)?")
FIGURE = re.compile(r"\d+(?:\.\d+)?")


def parts(script: str) -> tuple[str, str, str]:
    """Docstring, code, and the text below the code."""
    _, docstring, rest = script.split('"""', 2)
    code, below = rest.split("\n# %%\n")
    return docstring, code, re.sub(r"^# ?", "", below, flags=re.MULTILINE)


def typed_figures(script: str, printed: str = "") -> set[str]:
    """Figures in a script's texts that are neither in its code nor in what it printed: nothing holds them right."""
    docstring, code, below = parts(script)
    commands = "\n".join(line for line in code.splitlines() if not line.startswith("#"))
    texts = NAMES.sub(" ", f"{docstring}\n{alternative_text(script)}\n{below}")
    return set(FIGURE.findall(texts)) - set(FIGURE.findall(commands)) - set(FIGURE.findall(printed))


@pytest.mark.slow
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_runs_as_it_is_written_and_prints_its_number(script: Path, tmp_path: Path) -> None:
    text = script.read_text(encoding="utf-8")
    if lacks := missing(text):
        pytest.skip(f"needs {lacks}")
    (tmp_path / "docs").symlink_to(DOCS, target_is_directory=True)
    done = subprocess.run(  # noqa: S603 - our own interpreter and our own file
        [
            sys.executable,
            "-c",
            "import sys, runpy; sys.path.insert(0, sys.argv[1]); runpy.run_path(sys.argv[2])",
            str(ROOT),
            str(script),
        ],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env={**os.environ, "MPLBACKEND": "agg"},
    )
    assert done.returncode == 0, done.stderr
    assert [drawn.name for drawn in tmp_path.glob("*.png")] == [f"{script.stem}.png"]
    answer = done.stdout.splitlines()[-1]
    assert re.search(rf"\d ?{UNITS}|{UNITS} .*\d", answer), answer
    assert len(answer) <= WIDEST
    assert len(done.stdout.splitlines()) <= LONGEST
    assert typed_figures(text, done.stdout) == set()


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_has_what_its_page_needs(script: Path) -> None:
    text = script.read_text(encoding="utf-8")
    lines = text.splitlines()
    title = lines[0].removeprefix('"""')
    assert title.endswith("?")
    assert len(title) <= LONGEST_TITLE
    assert set(lines[1]) == {"="}
    assert 20 <= len(lines) <= LONGEST
    docstring, code, below = parts(text)
    assert len(re.findall(r"[.?]\s", docstring.split("\n\n")[1] + "\n")) in (2, 3)
    assert "\nassert " in code
    assert f"{script.stem}.png" in code
    assert len(alternative_text(text)) > 40
    assert "Read on: :doc:`/" in re.sub(r"\s+", " ", below)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_the_gallery_shows_each_script_once(script: Path) -> None:
    index = (DOCS / "gallery" / "index.md").read_text(encoding="utf-8").splitlines()
    assert index.count(script.stem) == 1
    assert index.count(f"scripts/{script.stem}") == 1


def test_a_figure_that_was_typed_is_found() -> None:
    script = '"""Why?\n\nOf 43 poses.\n"""\nx = 650\n# Picture: seen at 650 N.\n\n# %%\n# It is 12.5 mm in the XR701.\n'
    assert typed_figures(script) == {"43", "12.5"}
    assert typed_figures(script, "12.5 mm at 43 poses") == set()
