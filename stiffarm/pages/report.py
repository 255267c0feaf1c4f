"""report.html: one self-contained file, built from blocks of text, tables and pictures."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from stiffarm import __version__
from stiffarm.pages.parts import rendered
from stiffarm.pages.style import png_base64


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    text: str
    kind: str = "text"


@dataclass(frozen=True)
class Note:
    """A paragraph that must not be overlooked: doubt, limit, assumption."""

    text: str
    kind: str = "note"


@dataclass(frozen=True)
class Bullets:
    """A list of short remarks."""

    entries: tuple[str, ...]
    kind: str = "list"


@dataclass(frozen=True)
class Picture:
    """A PNG embedded in the page, with a caption that says what to see."""

    path: Path
    caption: str
    alt: str
    kind: str = "figure"

    @property
    def data(self) -> str:
        """The picture as base64."""
        return png_base64(self.path)


@dataclass(frozen=True)
class Table:
    """A table; columns in ``text_columns`` are left-aligned, row ``best`` is highlighted.

    ``code_columns``: commands, written as code that never breaks.
    """

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    text_columns: tuple[int, ...] = (0,)
    best: int = -1
    folded: bool = False
    code_columns: tuple[int, ...] = ()
    kind: str = "table"


Block = Text | Note | Bullets | Picture | Table


@dataclass(frozen=True)
class Section:
    """A numbered section of the report."""

    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class KeyFigure:
    """A number that a reader should see first, with its unit, and what it is."""

    value: str
    label: str


def made_by() -> str:
    """The line at the foot of a page: version and time."""
    return f"stiffarm {__version__}, {dt.datetime.now(dt.UTC):%Y-%m-%d %H:%M} UTC. Versions and command: run.json."


def render(
    title: str,
    lede: str,
    key: Sequence[KeyFigure],
    sections: Sequence[Section],
    footer: str,
    question: str = "how stiff is it, and how well do we know?",
) -> str:
    """The page as HTML text; all content is escaped. ``question``: what the page answers about its title."""
    return rendered(
        "report.html.j2", title=title, question=question, lede=lede, key=key, sections=sections, footer=footer
    )
