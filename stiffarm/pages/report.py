"""report.html: one self-contained file, built from blocks of text, tables and pictures."""

from __future__ import annotations

import base64
import datetime as dt
import struct
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol, runtime_checkable

from stiffarm import __version__
from stiffarm.pages.files import LAST
from stiffarm.session.console import show_table
from stiffarm.session.outputs import OutputFolder

if TYPE_CHECKING:
    from doe import Measurements
    from doe.joint_twists.readings import TwistReadings
    from stiffarm.pages.blocks import Pictures


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


# What a PNG's own table says of one that holds a rendered body: its light and shade stay as they are on dark pages.
SCENE = "scene"


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

    @property
    def is_scene(self) -> bool:
        """Whether it holds a rendered body, whose light and shade dark pages keep."""
        return f"Holds\0{SCENE}".encode("ascii") in self.path.read_bytes()[:4096]

    @property
    def width(self) -> int | None:
        """Width at which it is shown, in pixels of the page, where there is room; None of what is no whole PNG."""
        return None if (size := self._size) is None else size[0]

    @property
    def height(self) -> int | None:
        """Height that goes with it."""
        return None if (size := self._size) is None else size[1]

    @cached_property
    def _size(self) -> tuple[int, int] | None:
        head = self.path.read_bytes()[:24]
        if len(head) < 24:
            return None
        wide, high = struct.unpack(">II", head[16:24])
        return round(wide * _SHOWN), round(high * _SHOWN)


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


@dataclass(frozen=True)
class Fold:
    """What folds away on a screen, under its title: method, tables, further pictures. In print it is unfolded."""

    title: str
    blocks: tuple[Block, ...]
    kind: str = "fold"


@runtime_checkable
class Later(Protocol):
    """What becomes a block when the page is written: a table or a picture of a result."""

    def placed(self, pictures: Pictures) -> Block:
        """The block; ``pictures`` keeps those that are drawn."""


Block = Text | Note | Bullets | Picture | Table | Fold | Later


@dataclass(frozen=True)
class Section:
    """A numbered section of the report; ``folded``: only its title is seen until a reader opens it."""

    title: str
    blocks: tuple[Block, ...]
    folded: bool = False


@dataclass(frozen=True)
class KeyFigure:
    """A number that a reader should see first, with its unit, and what it is; ``interval``: how far it may be off."""

    value: str
    label: str
    interval: str = ""


@dataclass(frozen=True)
class Answer:
    """What the first screen says beside the figures: how sure, what to do next, and one picture.

    ``warnings``: what makes the figures wrong, so that nobody reads them without.
    """

    sure: str = ""
    todo: str = ""
    picture: Picture | None = None
    warnings: tuple[str, ...] = ()


QUESTION = "how stiff is it, and how well do we know?"
# Pixels of a page for one of a picture: ten inches of a figure fill the width, and its smallest letters have 11 pixels.
_SHOWN: Final = 0.72


def render(
    title: str,
    lede: str,
    key: Sequence[KeyFigure],
    sections: Sequence[Section],
    footer: str,
    question: str = QUESTION,
    answer: Answer | None = None,
    files: Collection[str] = (),
) -> str:
    """The page as HTML text; all content is escaped.

    ``question``: what the page answers about its title, another for each command; ``files`` beside the page, to which
    it leads wherever it names them.
    """
    # Tables are for screens too, which need no templates.
    from stiffarm.pages.files import listed
    from stiffarm.pages.parts import rendered

    return rendered(
        "report.html.j2",
        files=frozenset(files),
        title=title,
        question=question,
        lede=lede,
        key=key,
        answer=answer or Answer(),
        sections=[s for s in sections if s.blocks],
        footer=footer,
        listed=listed(files),
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
    answer: Answer | None = None,
    name: str = "report.html",
) -> None:
    """Write a page once all other results are there; below it stand version, time and what it was ``made_of``."""

    def write() -> None:
        files = {*folder.names(), LAST}
        folder.write_text(name, render(title, lede, key, sections, footer(made_of), question, answer, files))

    folder.at_end(name, write)


def footer(made_of: str = "") -> str:
    """The line below a page: version, time, and what it was made of."""
    version = f"stiffarm {__version__}, {dt.datetime.now(dt.UTC):%Y-%m-%d %H:%M} UTC"
    return f"{', '.join(filter(None, (version, made_of)))}. Versions, command and timings: {LAST}."
