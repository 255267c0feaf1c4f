"""Results: what a capability answers, held once, from which screen, page, JSON, CSV and data frame are made.

A result is an answer in three sentences, facts that hold for all of it, and tables of named quantities. It is what the
Python function returns; the command line shows the same object and writes it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from robots import InputError, require_one_of
from robots.arrays import Array
from robots.files.csv_text import columns_parts
from robots.quantities import Quantity, interval_json, ranged, rounded
from stiffarm.session.console import say, show_table

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from fem.arm import Arm
    from stiffarm.pages import report as page
    from stiffarm.pages.blocks import Pictures
    from stiffarm.pages.picture import Picture
    from stiffarm.session.outputs import OutputFolder

# Rows of a table that a screen, a notebook and a page show; files have all.
SHOWN: Final = 30
IN_BRIEF: Final = 12
INTERVAL: Final = "interval95"
# Rows up to which a wide table stands on its side for people: a column a row.
TURNED: Final = 6


@dataclass(frozen=True, eq=False)
class Table:
    """Rows of named quantities.

    ``labels``: texts of each row by name, or whether something holds of it; ``values``: SI values (n,) by quantity, NaN
    where one is not known; ``intervals``: ends (n,), (n,) of the 95 % interval of some of them, infinite where there is
    no upper one; ``in_files``: further quantities, which people find in files; ``extra``: what else JSON says of each
    row, and CSV unless it is a list; ``folded``: on pages only, behind its title; ``is_extract``: it repeats rows of
    another table for people, and no file has it; ``only_in``: where people do not see it: "files", or "csv" where JSON
    would be too long with it; ``shown``: rows that people see.
    """

    name: str
    caption: str
    labels: Mapping[str, Sequence[str | bool]]
    values: Mapping[Quantity, Array]
    intervals: Mapping[Quantity, tuple[Array, Array]] = field(default_factory=dict)
    in_files: Mapping[Quantity, Array] = field(default_factory=dict)
    extra: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    folded: bool = False
    is_extract: bool = False
    shown: int = SHOWN
    only_in: Literal["", "files", "csv"] = ""

    def __len__(self) -> int:
        return len(next(iter(self.labels.values())))

    def rows(self) -> list[dict[str, Any]]:
        """One dictionary a row, for JSON: numbers in shown units, None where one is not known."""
        columns: dict[str, Sequence[Any]] = dict(self.labels)
        for quantity, values in {**self.in_files, **self.values}.items():
            columns[quantity.column] = quantity.stored_values(values)
            if quantity in self.intervals:
                low, high = (quantity.factor * end for end in self.intervals[quantity])
                columns[quantity.column_of(INTERVAL)] = [
                    interval_json(a, b, quantity.stored) for a, b in zip(low, high, strict=True)
                ]
        columns |= self.extra
        return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]

    def columns(self) -> dict[str, Sequence[Any]]:
        """The columns of CSV and data frames: the ends of an interval are columns of their own, lists are left out."""
        columns: dict[str, Sequence[Any]] = dict(self.labels)
        columns |= {q.column: q.stored_values(values) for q, values in {**self.in_files, **self.values}.items()}
        for quantity, ends in self.intervals.items():
            for what, values in zip(("low95", "high95"), ends, strict=True):
                columns[quantity.column_of(what)] = quantity.stored_values(values)
        plain = {key: v for key, v in self.extra.items() if not any(isinstance(one, list | dict) for one in v)}
        return columns | plain

    def frame(self) -> pd.DataFrame:
        """All rows as a data frame, numbers in shown units."""
        import pandas as pd

        made = pd.DataFrame(self.columns())
        numbers = [name for name in made if name not in self.labels and name not in self.extra]
        return made.astype(dict.fromkeys(numbers, "float64"))

    def texts(self, rows: int = SHOWN, *, turned: bool = True) -> tuple[list[str], list[list[str]]]:
        """Headings and cells of the first rows for people; if ``turned``, few rows of many quantities on their side."""
        n = min(len(self), rows)
        names = [*(name.replace("_", " ") for name in self.labels), *(q.heading for q in self.values)]
        columns = [[_word(text) for text in texts[:n]] for texts in self.labels.values()]
        for quantity, values in self.values.items():
            cells = [quantity.text(value) for value in values[:n]]
            if quantity in self.intervals:
                ends = zip(*self.intervals[quantity], strict=True)
                cells = [
                    cell if np.isnan(low) else f"{cell} ({ranged(quantity.factor * low, quantity.factor * high)})"
                    for cell, (low, high) in zip(cells, ends, strict=False)
                ]
            columns.append(cells)
        if turned and len(self) <= TURNED < len(names):
            # A number needs to be told what it is of; a name speaks for itself.
            heads = [text if text[:1].isalpha() else f"{names[0]} {text}" for text in columns[0]]
            return ["", *heads], [[name, *cells] for name, cells in zip(names[1:], columns[1:], strict=True)]
        return names, [list(row) for row in zip(*columns, strict=True)]

    def show(self) -> None:
        """The table on the screen, which turns it where it is too wide."""
        show_table(self.caption, *self.texts(self.shown, turned=False))
        if len(self) > self.shown:
            say(f"({len(self) - self.shown} more rows are in the files of --out and with --json)")

    def block(self) -> page.Table:
        """The table on a page, in a section that has its caption for a title."""
        from stiffarm.pages import report as page

        names, cells = self.texts(2 * self.shown)
        texts = tuple(range(len(self.labels))) if names[0] else (0,)
        return page.Table("", tuple(names), tuple(map(tuple, cells)), texts)

    def placed(self, pictures: Pictures) -> page.Table:
        """The table where a section has it, with its caption."""
        return replace(self.block(), caption=self.caption, folded=self.folded)


@dataclass(frozen=True)
class Number:
    """One number of a result, SI, and the ends of its 95 % interval: NaN where they are not known.

    None: a number of this kind has no interval; infinite: no upper end.
    """

    value: float
    low: float | None = None
    high: float | None = None

    @property
    def ends(self) -> tuple[float, float]:
        """The ends, NaN where there are none."""
        return (np.nan, np.nan) if self.low is None or self.high is None else (self.low, self.high)


@dataclass(frozen=True, eq=False)
class Drawing:
    """A picture of a result, drawn when it is asked for; ``caption`` says what to see, ``alt`` what it is."""

    name: str
    caption: str
    alt: str
    draw: Callable[[], Figure]

    def placed(self, pictures: Pictures) -> page.Picture:
        """The picture where a section has it."""
        return pictures.add(self.draw(), self.name, self.caption, self.alt)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Result:
    """What a capability found.

    ``answer``, ``how_sure``, ``what_next``: a sentence each; ``facts``: what holds for all of it, by key;
    ``numbers``: single numbers; ``key``: figures to see first; ``sections``: what a page says besides, or what works
    that out, where tables and pictures stand that stand nowhere else; ``warnings``: what makes the figures wrong, said
    before them; ``remarks``: what the reader must know; ``arm``: the arm that it is about, ``caution``: what pages and
    pictures warn of, where that is not what the arm says; ``found``: the arrays and objects behind it; ``more``: writes
    further files into the folder and returns facts about them; ``made_of``: which readings a page was made of;
    ``exit_code``: what the command ends with, other than 0 where the answer is one that a script must not run past.
    """

    name: str
    title: str
    question: str
    answer: str
    how_sure: str = ""
    what_next: str = ""
    facts: Mapping[str, Any] = field(default_factory=dict)
    numbers: Mapping[Quantity, Number] = field(default_factory=dict)
    tables: tuple[Table, ...] = ()
    drawings: tuple[Drawing, ...] = ()
    key: tuple[page.KeyFigure, ...] = ()
    sections: tuple[page.Section, ...] | Callable[[], Sequence[page.Section]] = ()
    warnings: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    arm: Arm | None = None
    caution: str | None = None
    found: Any = None
    more: Callable[[OutputFolder], Mapping[str, Any]] | None = None
    made_of: str = ""
    exit_code: int = 0

    @cached_property
    def as_json(self) -> dict[str, Any]:
        """The result as JSON: the answer, facts, then each table as a list of rows."""
        sentences = {"answer": self.answer, "how_sure": self.how_sure, "what_next": self.what_next}
        return {
            "schema": f"stiffarm-{self.name.replace('_', '-')}/2",
            **{key: text for key, text in sentences.items() if text},
            **self.facts,
            **{quantity.column: quantity.stored_value(one.value) for quantity, one in self.numbers.items()},
            **{
                quantity.column_of(INTERVAL): interval_json(
                    quantity.factor * one.ends[0], quantity.factor * one.ends[1]
                )
                for quantity, one in self.numbers.items()
                if one.low is not None
            },
            **({"remarks": list(self.remarks)} if self.remarks else {}),
            **{t.name: t.rows() for t in self.tables if not t.is_extract and t.only_in != "csv"},
        }

    @cached_property
    def story(self) -> tuple[page.Section, ...]:
        """What a page says besides, worked out when it is asked for."""
        return tuple(self.sections() if callable(self.sections) else self.sections)

    @property
    def pictures(self) -> list[Drawing]:
        """All its pictures, those of its sections last."""
        from stiffarm.pages.blocks import within

        own = (block for section in self.story for block in within(section.blocks) if isinstance(block, Drawing))
        return list(dict.fromkeys((*self.drawings, *own)))

    def to_frame(self, table: str | None = None) -> pd.DataFrame:
        """A table as a data frame, units in the names of its columns; by default the first.

        Raises
        ------
        InputError
            No table of that name.
        """
        names = [one.name for one in self.tables]
        if table is not None:
            require_one_of("table", table, names, code="B003")
        return self.tables[0 if table is None else names.index(table)].frame()

    def __getitem__(self, name: str) -> Array:
        """Values (n,) of a quantity, or its one value (): by its key in SI, by its column in that unit.

        ``found["k_fs"]`` is in N/m, ``found["k_fs_N_per_mm"]`` in N/mm.

        Raises
        ------
        InputError
            No table has it.
        """
        known: dict[Quantity, Array] = {}
        for table in reversed(self.tables):
            known |= {**table.in_files, **table.values}
        known |= {quantity: np.array(one.value) for quantity, one in self.numbers.items()}
        by_name = {quantity.key: values for quantity, values in known.items()}
        by_name |= {q.column: q.factor * values for q, values in known.items() if q.unit}
        require_one_of("quantity", name, by_name, code="S015")
        return by_name[name]

    def interval(self, name: str) -> tuple[Array, Array]:
        """Ends (n,), (n,) of the 95 % interval of a quantity, or of its one value, in SI; NaN where none is known.

        Raises
        ------
        InputError
            No table has an interval of it.
        """
        known = {quantity.key: (np.array(one.ends[0]), np.array(one.ends[1])) for quantity, one in self.numbers.items()}
        known |= {quantity.key: ends for table in self.tables for quantity, ends in table.intervals.items()}
        require_one_of("quantity with an interval", name, known, code="S015")
        return known[name]

    def plot(self, name: str | None = None, file: str | Path | None = None) -> Picture:
        """One of the result's pictures, by default the first; ``file``: a PNG to write.

        Raises
        ------
        InputError
            The result has no picture of that name.
        """
        from stiffarm.pages.picture import Picture

        names = [one.name for one in self.pictures]
        if not names:
            raise InputError(
                f"picture of {self.name}", code="B003", value=name, allowed="none: this result has no picture"
            )
        if name is not None:
            require_one_of("picture", name, names, code="B003")
        return Picture.of(self.pictures[0 if name is None else names.index(name)].draw()).kept(file)

    @property
    def warning(self) -> str:
        """What its pages and pictures warn of; empty where there is nothing to warn of."""
        from stiffarm.session.caution import caveats

        return caveats(self.arm) if self.caution is None and self.arm is not None else self.caution or ""

    def save(self, folder: str | Path) -> Path:
        """Write the page, JSON, CSV, pictures and all other files into a folder, whole or not at all; returns it.

        Raises
        ------
        InputError
            The folder cannot be made or written.
        """
        from stiffarm.session.caution import cautioned
        from stiffarm.session.outputs import OutputFolder

        with OutputFolder(Path(folder), [f"stiffarm.{self.name}"], {}, None) as out, cautioned(self.warning):
            self.write(out)
        return Path(folder)

    def __repr__(self) -> str:
        return as_text(f"{self.title}\n{self.answer}", self.to_frame() if self.tables else None)

    def _repr_html_(self) -> str:
        return as_html(f"{self.title}. {self.answer}", self.to_frame() if self.tables else None)

    # What the command line does with it.

    def show(self) -> None:
        """The result on the screen: the answer, the first table, remarks."""
        for text in self.warnings:
            say(f"warning: {text}", code=getattr(text, "code", ""))
        say(self.answer)
        for text in (self.how_sure, self.what_next):
            if text:
                say(text)
        for table in self.tables:
            if not table.folded and not table.only_in:
                table.show()

    def write(self, folder: OutputFolder) -> dict[str, Any]:
        """JSON, CSV, pictures and the page into a folder; returns the JSON, with facts about further files."""
        from stiffarm.pages import report as page
        from stiffarm.pages.blocks import Pictures, placed, within

        content, shown = self.write_files(folder)
        pictures = Pictures(folder)
        first = next(iter(self.pictures), None)
        lead = shown[0] if shown else None if first is None else first.placed(pictures)
        there = [block for section in self.story for block in within(section.blocks)]
        own = (table for table in self.tables if len(table) and not table.only_in and table not in there)
        tables = sorted(own, key=lambda table: table.folded)
        sections = [page.Section(t.caption, (t.block(),), folded=t.folded) for t in tables]
        sections.append(page.Section("Pictures", tuple(shown[1:])))
        if self.remarks and (remarks := page.Bullets(self.remarks)) not in there:
            sections.append(page.Section("Remarks", (remarks,)))
        sections += [replace(s, blocks=placed(s.blocks, pictures, first)) for s in self.story]
        warnings = tuple(map(sentence, self.warnings))
        answer = page.Answer(self.how_sure, self.what_next, lead, warnings)
        page.write_page(folder, self.title, self.answer, self.key, sections, self.question, self.made_of, answer)
        return content

    def write_files(self, folder: OutputFolder) -> tuple[dict[str, Any], list[page.Picture]]:
        """All but the page, which has its pictures; the first table is named as the result, unless a file is so."""
        from stiffarm.pages import report as page

        further = {} if self.more is None else self.more(folder)
        content = {**self.as_json, **further}
        folder.write_json(f"{self.name}.json", content)
        for i, table in enumerate(table for table in self.tables if not table.is_extract):
            own = i > 0 or f"{self.name}.csv" in folder.names()
            folder.write_parts(f"{table.name if own else self.name}.csv", columns_parts(table.columns()))
        pictures = []
        for drawing in self.drawings:
            # A result without pictures loads nothing that draws.
            from stiffarm.pages.style import save_png

            path = folder.path(f"{drawing.name}.png")
            save_png(drawing.draw(), path)
            pictures.append(page.Picture(path, drawing.caption, drawing.alt))
        return content, pictures


def sentence(text: str) -> str:
    """A remark as a sentence; a column's name at its beginning stays as it is."""
    text = text.removesuffix(".")
    return f"{text}." if "_" in text.partition(" ")[0] else f"{text[:1].upper()}{text[1:]}."


def _word(label: str | bool) -> str:
    return label if isinstance(label, str) else "yes" if label else ""


def as_text(title: str, table: pd.DataFrame | None) -> str:
    """A result in a terminal: never pages of arrays."""
    if table is None or table.empty:
        return title
    shown = table.head(IN_BRIEF).to_string(index=False, na_rep="-", float_format=lambda v: f"{v:.6g}")
    return "\n".join([title, shown, *_more(len(table))])


def as_html(title: str, table: pd.DataFrame | None) -> str:
    """The same in a notebook."""
    import html

    if table is None:
        return f"<p>{html.escape(title)}</p>"
    shown = table.head(IN_BRIEF).to_html(index=False, na_rep="-", border=0, float_format=lambda v: f"{v:.6g}")
    more = "".join(f"<p>{line}</p>" for line in _more(len(table)))
    return f"<p>{html.escape(title)}</p>{shown}{more}"


def _more(rows: int) -> list[str]:
    return [f"({IN_BRIEF} of {rows} rows; to_frame() has all)"] if rows > IN_BRIEF else []


def plain(values: Sequence[float] | Array, factor: float = 1.0) -> list[float | None]:
    """A vector or point among a result's facts."""
    return [rounded(factor * float(v)) for v in values]
