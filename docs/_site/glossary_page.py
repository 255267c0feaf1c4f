"""Writes docs/reference/glossary.md from words.toml: `python docs/_site/glossary_page.py`."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
PAGE = HERE.parent / "reference" / "glossary.md"
INTRODUCTION = """# Glossary

What the words mean here. Units of each quantity stand beside it wherever it is printed.
"""


def words() -> dict[str, list[dict[str, Any]]]:
    """What the file of words holds."""
    return tomllib.loads((HERE / "words.toml").read_text(encoding="utf-8"))


def page() -> str:
    """Terms as a table, each with the page that explains it."""
    terms = sorted(words()["terms"], key=lambda term: term["name"].lower())
    lines = [INTRODUCTION, "| term | meaning | more |", "|---|---|---|"]
    for term in terms:
        title = (PAGE.parent / term["page"]).read_text(encoding="utf-8").split("\n", 1)[0].lstrip("# ")
        lines.append(f"| {term['name']} | {term['meaning']} | [{title}]({term['page']}) |")
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
