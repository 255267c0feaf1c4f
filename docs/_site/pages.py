"""Writes generated pages, so that a build after a build has nothing new to read."""

from __future__ import annotations

from pathlib import Path


def write_all(folder: Path, pages: dict[str, str]) -> None:
    """Make the folder hold these pages and no others; a page that is the same already is left alone."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.md"):
        if old.name not in pages:
            old.unlink()
    for name, text in pages.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def hidden_toctree(names: list[str]) -> list[str]:
    """The pages below this one, for the site's navigation; the page itself shows them as a table."""
    return ["```{toctree}", ":hidden:", "", *names, "```", ""]
