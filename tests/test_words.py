"""Words of pages, README and help texts: spelt right, and none of the phrases that docs/_site/words.toml lists."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import oracles
import pytest
from glossary_page import PAGE, page, words
from test_docs import pages
from test_house import ROOT

PROSE = ROOT / "tests" / "stiffarm" / "session" / "prose"
# What reads as a slip of the pen and is none: mechanics, and words of controllers in examples.
NO_SLIPS = ("statics", "anout", "vor", "fro", "diamon")
TEXTS = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md", "llms.txt")),
    *pages(),
    *sorted(PROSE.glob("*.txt")),
]


def phrases(text: str) -> list[str]:
    """Phrases of a text that have a better one, with it; what stands in code is no prose."""
    prose = " ".join(re.sub(r"^ *(```|~~~).*?^ *\1|`[^`\n]*`", "", text, flags=re.MULTILINE | re.DOTALL).split())
    return [
        f"{found[0]}: {phrase['better']}"
        for phrase in words()["phrases"]
        for found in re.finditer(rf"\b(?:{phrase['not']})\b", prose, re.IGNORECASE)
    ]


def misspelt(texts: list[Path]) -> list[str]:
    command = [sys.executable, "-m", "codespell_lib", "--ignore-words-list", ",".join(NO_SLIPS), *map(str, texts)]
    run = subprocess.run(command, capture_output=True, encoding="utf-8", cwd=ROOT, check=False)  # noqa: S603 - ours
    assert run.returncode in (0, 65), run.stderr
    return run.stdout.splitlines()


def test_words_are_spelt_right() -> None:
    oracles.load("codespell_lib")
    assert len(TEXTS) > 80
    assert misspelt(TEXTS) == []


def test_a_slip_is_found(tmp_path: Path) -> None:
    oracles.load("codespell_lib")
    (tmp_path / "page.md").write_text("Stiffness is recieved.\n", encoding="utf-8")
    assert [line.split(": ", 1)[1] for line in misspelt([tmp_path / "page.md"])] == ["recieved ==> received"]


@pytest.mark.parametrize("text", TEXTS, ids=lambda p: str(p.relative_to(ROOT)))
def test_no_text_uses_a_phrase_that_has_a_better_one(text: Path) -> None:
    assert phrases(text.read_text(encoding="utf-8")) == []


def test_a_phrase_over_two_lines_is_found() -> None:
    assert phrases("What it hangs\non, `heed` and\n```\nheed\n```\n") == ["hangs on: depends on"]


def test_the_glossary_is_that_of_the_file_of_words() -> None:
    """`python docs/_site/glossary_page.py` writes it anew."""
    assert PAGE.read_text(encoding="utf-8") == page()
    assert len(words()["terms"]) > 20
