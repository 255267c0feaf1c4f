"""report.html: one self-contained file, built from blocks of text, tables and pictures."""

from __future__ import annotations

import base64
import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from stiffarm import __version__
from stiffarm.session.console import show_table
from stiffarm.session.outputs import OutputFolder

if TYPE_CHECKING:
    from doe import Measurements
    from doe.joint_twists.readings import TwistReadings


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
        return base64.b64encode(self.path.read_bytes()).decode("ascii")


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

    def show(self) -> None:
        """The same on the screen."""
        show_table(self.caption, list(self.columns), [list(row) for row in self.rows])


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


QUESTION = "how stiff is it, and how well do we know?"


def render(
    title: str,
    lede: str,
    key: Sequence[KeyFigure],
    sections: Sequence[Section],
    footer: str,
    question: str = QUESTION,
) -> str:
    """The page as HTML text; all content is escaped. ``question``: what the page answers about its title."""
    # Tables are for screens too, which need no templates.
    from stiffarm.pages.parts import rendered

    return rendered(
        "report.html.j2", title=title, question=question, lede=lede, key=key, sections=sections, footer=footer
    )


def data_words(data: Measurements | TwistReadings) -> str:
    """Which readings a page was made of."""
    return f"data {data.source} (SHA-256 {data.sha256[:12]}...)"


def write_page(
    folder: OutputFolder,
    title: str,
    lede: str,
    key: Sequence[KeyFigure],
    sections: Sequence[Section],
    question: str = QUESTION,
    made_of: str = "",
) -> None:
    """Write report.html; below it stand version, time and what it was ``made_of``."""
    version = f"stiffarm {__version__}, {dt.datetime.now(dt.UTC):%Y-%m-%d %H:%M} UTC"
    footer = f"{', '.join(filter(None, (version, made_of)))}. Versions, command and timings: run.json."
    folder.write_text("report.html", render(title, lede, key, sections, footer, question))
