"""Where the table stands in a file: lines above it, names of its columns, a line of units, the readings."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from doe.instruments.cells import Grid, split_cells
from doe.instruments.figures import NOT_READ, bare_and_unit, is_number
from doe.instruments.meanings import WORDS, Meaning
from doe.instruments.recognised import split_unit
from doe.instruments.units import unit_of
from doe.instruments.vocabulary import MEANINGS
from robots import InputError
from robots.errors import line_ranges, listed
from robots.faults import Faults

# Rows among which the readings begin.
_LOOKED_AT: Final = 2000
_BRACKETS: Final = re.compile(r"^[\[(]\s*(.*?)\s*[\])]$")
# "Units: mm", "Length unit = inch", "Einheit mm": what a file says of its lengths and angles above the table.
# Arrays of a log: name[0] and position[0], field.name0 and field.position0; what stands before must be the same.
_PLACE: Final = re.compile(r"(.*?)(name|position)s?\s*(?:\[\s*(\d+)\s*\]|[._]?(\d+))", re.I)
_STATED: Final = re.compile(r"\b(?:units?|einheit(?:en)?)\b[^:=;,\t]*[:=;,\t ]+\s*([\w\u00b0\u00b5\u03bc,; /]+)", re.I)


@dataclass(frozen=True)
class Table:
    """Readings as text below the names of their columns.

    ``units`` (one for each column, "" where none): a line of units under the names; ``stated``: units that lines above
    the table state for all of it; ``how``: what was found in the file, in words.
    """

    name: str
    header: tuple[str, ...]
    units: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    stated: tuple[str, ...]
    how: tuple[str, ...]


def find_table(
    grid: Grid,
    *,
    columns: Sequence[str] = (),
    if_bare: bool = False,
    header: int | None = None,
    rows: tuple[int, int] | None = None,
) -> Table | None:
    """The table of a grid; None where it holds none (a cover sheet).

    ``columns``: names to take (``if_bare``: only where the file has none itself); ``header``: the line of the names;
    ``rows``: first and last line of the readings.

    Raises
    ------
    InputError
        The columns have no names, or lines among the readings are none.
    """
    inside = grid if rows is None else grid.between(*rows)
    if header is not None and rows is None:
        inside = grid.between(header + 1, max(grid.lines, default=0))
    first = _first_reading(inside)
    if first is None:
        return None
    # Where lines were named no row among them is passed over.
    start = inside.lines[first] if header is None and rows is None else _below(inside)
    body = inside.between(start, inside.lines[-1])
    if merged := [area for line, area in grid.merged if body.lines[0] <= line <= body.lines[-1]]:
        raise InputError(
            f"{grid.name}: merged cells {listed(merged)} among the readings: all but the first of each "
            "would count as empty",
            code="I002",
            allowed="one value in each cell",
            remedy="unmerge them and write the value into each cell",
        )
    above = [(k, row) for k, row in zip(grid.lines, grid.rows, strict=True) if k < start and any(row)]
    width = max(len(_trimmed(row)) for row in body.rows[:1])
    units: tuple[str, ...] = ()
    above, units = _units_line(above)
    found = None if columns and not if_bare else _names(grid, above, width, header)
    if found is None and not columns:
        raise InputError(
            f"{grid.name}: its {width} columns have no names",
            code="I002",
            allowed='names above the readings (--header LINE), or --names "pose,x_mm,y_mm,z_mm"',
            remedy=f"name the line that holds them, or all {width} columns separated by commas",
        )
    names, at = found or (tuple(columns), None)
    table = _checked(grid, body, names, units)
    head = [" ".join(row) for k, row in above if k != at] + [text for k, text in grid.comments if k < start]
    if out := [k for k, _ in grid.comments if k > start]:
        table = replace(table, how=(*table.how, f"comments left out: line {line_ranges(out)}"))
    how = (*grid.how, f"names in line {at}" if at else "names as given", f"readings from line {start} on")
    return replace(table, stated=_stated(head), how=(*how, *table.how))


def _first_reading(grid: Grid) -> int | None:
    counts = [sum(map(is_number, row)) for row in grid.rows[:_LOOKED_AT]]
    most = max(counts, default=0)
    if most < 2:
        return None
    # Rows have half of the numbers of the fullest one, or more: some cells were not read.
    enough = max(2, (most + 1) // 2)
    return next(k for k, count in enumerate(counts) if count >= enough)


def _below(grid: Grid) -> int:
    """The first line below the names that is neither blank nor one of units."""
    for line, row in zip(grid.lines, grid.rows, strict=True):
        if _trimmed(row) and not _units_line([(0, ()), (line, row)])[1]:
            return line
    return grid.lines[0]


def _units_line(above: list[tuple[int, tuple[str, ...]]]) -> tuple[list[tuple[int, tuple[str, ...]]], tuple[str, ...]]:
    """The lines above a table without a line of units, and these units."""
    if len(above) < 2:
        return above, ()
    cells = [_BRACKETS.sub(r"\1", cell).strip() for cell in above[-1][1]]
    known = [cell for cell in cells if cell and cell != "-"]
    if not known or not all(unit_of(cell) for cell in known):
        return above, ()
    return above[:-1], tuple("" if cell == "-" else cell for cell in cells)


def _names(
    grid: Grid, above: list[tuple[int, tuple[str, ...]]], width: int, header: int | None
) -> tuple[tuple[str, ...], int | None] | None:
    """Names of the columns and their line; None where they have none."""
    if header is not None:
        found = [(k, row) for k, row in zip(grid.lines, grid.rows, strict=True) if k == header]
        if not found:
            raise InputError(
                "--header",
                code="I002",
                value=header,
                allowed="a line of the file above the readings",
                remedy="count its lines from 1",
            )
        return _trimmed(found[0][1]), header
    if above:
        line, row = above[-1]
        names = _trimmed(row)
        if len(names) > 1 and not any(map(is_number, names)):
            return _with_groups(names, above[:-1]), line
    for line, text in reversed(grid.comments):
        for _, cells in split_cells(text, grid.split or ",", grid.name):
            if len(cells) == width > 1 and not any(map(is_number, cells)):
                return (cells[0].strip() or "#", *(cell.strip() for cell in cells[1:])), line
    return None


def _with_groups(names: tuple[str, ...], above: list[tuple[int, tuple[str, ...]]]) -> tuple[str, ...]:
    """Names that stand there twice, told apart by the line of headings above them."""
    counts = Counter(name for name in names if name)
    if not above or max(counts.values()) == 1:
        return names
    heading, out = "", []
    for k, name in enumerate(names):
        heading = (above[-1][1][k] if k < len(above[-1][1]) else "") or heading
        out.append(f"{heading} {name}".strip() if counts[name] > 1 else name)
    return tuple(out)


def _checked(grid: Grid, body: Grid, names: tuple[str, ...], units: tuple[str, ...]) -> Table:
    """The table with rows of one width; blank lines and names that stand there again are left out, and that is said."""
    faults, how = Faults(grid.name), list[str]()
    kept, lines, again = list[tuple[str, ...]](), list[int](), list[int]()
    for line, row in zip(body.lines, body.rows, strict=True):
        cells = _trimmed(row)
        if not cells:
            continue
        if cells == names:
            again.append(line)
        elif len(cells) > len(names) or (grid.split is not None and len(row) < len(names)):
            faults.add(
                line,
                "the row does not fit the names of the columns",
                code="I009",
                value=f"{len(row)} cells",
                allowed=f"{len(names)} cells",
                remedy="if it is no reading leave it out with --rows FIRST-LAST; else look for a missing or "
                "extra separator, or for commas that are both separator and decimal mark",
            )
        else:
            kept.append(row[: len(names)] + ("",) * (len(names) - len(row)))
            lines.append(line)
    if twice := [name for name, count in Counter(name for name in names if name).items() if count > 1]:
        faults.add(
            0,
            f"columns {listed(twice)} stand there twice",
            code="I002",
            allowed="a name for each column",
            remedy="name all columns with --names, or the line of the names with --header",
        )
    for k, name in enumerate(names):
        if not name and any(row[k].strip() for row in kept):
            faults.add(
                0,
                f"column number {k + 1} has cells but no name",
                code="I002",
                allowed="a name for each column",
                remedy="name all columns with --names, or the line of the names with --header",
            )
    faults.raise_if_any("readings")
    if again:
        how.append(f"names of the columns again in line {line_ranges(again)}, left out")
    used = [k for k, name in enumerate(names) if name]
    padded = (*units, *("",) * (len(names) - len(units)))
    rows = tuple(tuple(row[k] for k in used) for row in kept)
    return Table(
        grid.name, tuple(names[k] for k in used), tuple(padded[k] for k in used), rows, tuple(lines), (), tuple(how)
    )


def by_joint(table: Table) -> Table:
    """A log whose arrays name[k] hold the joints of position[k], with a column for each joint.

    Raises
    ------
    InputErrors
        Rows that name other joints than the first one, or one twice.
    """
    places = {k: found for k, name in enumerate(table.header) if (found := _PLACE.fullmatch(name))}
    index = {k: (found[1], found[3] or found[4]) for k, found in places.items()}
    names = {index[k]: k for k, found in places.items() if found[2].lower() == "name"}
    positions = {index[k]: k for k, found in places.items() if found[2].lower() == "position"}
    both = [(names[at], positions[at]) for at in positions if at in names]
    if len(both) < 2 or len(both) < len(names):
        return table
    label, value = map(list, zip(*both, strict=True))
    joints = tuple(table.rows[0][k] for k in label)
    rest = [k for k in range(len(table.header)) if k not in label and k not in value]
    faults, rows = Faults(table.name), list[tuple[str, ...]]()
    for line, row in zip(table.lines, table.rows, strict=True):
        cells = {row[n]: row[p] for n, p in both}
        if len(cells) < len(both) or set(cells) != set(joints) or "" in cells:
            faults.add(
                line,
                "names of joints",
                code="I002",
                value=", ".join(row[k] for k in label),
                allowed=", ".join(joints),
                remedy="leave out rows of other arms with --rows FIRST-LAST",
            )
        else:
            rows.append((*(cells[name] for name in joints), *(row[k] for k in rest)))
    if twice := sorted({*joints} & {table.header[k] for k in rest}):
        faults.add(
            0,
            f"columns {listed(twice)} are in the array of joints too",
            code="I002",
            allowed="a name for each column",
            remedy="name all columns with --names",
        )
    faults.raise_if_any("readings")
    return replace(
        table,
        header=(*joints, *(table.header[k] for k in rest)),
        rows=tuple(rows),
        units=(*(table.units[k] for k in value), *(table.units[k] for k in rest)),
        how=(*table.how, "joints as the array of names calls them"),
    )


def without_units(table: Table, given: Mapping[str, Meaning]) -> Table:
    """A table whose columns of numbers with units, as 52.4\u00b0, are numbers, with the unit as if below their names.

    ``given``: what columns hold, as the user has said.

    Raises
    ------
    InputErrors
        Cells of a column in several units, or without one, or in another one than its name or the user says.
    """
    faults, units, bare = Faults(table.name), list(table.units), dict[int, list[str]]()
    for k, name in enumerate(table.header):
        if MEANINGS.get(name.strip().lower()) in WORDS:
            continue
        first = [row[k] for row in table.rows[:_LOOKED_AT]]
        if 2 * sum(bare_and_unit(cell) is not None for cell in first) <= sum(cell not in NOT_READ for cell in first):
            continue
        meant = given[name].unit if name in given else split_unit(name)[1] or unit_of(units[k])
        bare[k] = []
        for line, row in zip(table.lines, table.rows, strict=True):
            number, unit = bare_and_unit(row[k]) or (row[k], None)
            if row[k].strip().lower() not in NOT_READ and unit != (meant := meant or unit):
                faults.add(
                    line,
                    f"column {name}",
                    code="I002",
                    value=row[k],
                    allowed=f"numbers in {meant}, as its others",
                    remedy="write all cells of a column in one unit",
                )
            bare[k].append(number)
        units[k] = meant or ""
    faults.raise_if_any("readings")
    rows = tuple(
        tuple(bare[k][i] if k in bare else cell for k, cell in enumerate(row)) for i, row in enumerate(table.rows)
    )
    return replace(table, rows=rows, units=tuple(units)) if bare else table


def _trimmed(row: Sequence[str]) -> tuple[str, ...]:
    end = len(row)
    while end and not row[end - 1].strip():
        end -= 1
    return tuple(row[:end])


def _stated(head: Sequence[str]) -> tuple[str, ...]:
    """Units that lines above the table state."""
    out = list[str]()
    for said in (said for line in head for said in _STATED.findall(line)):
        units = [unit_of(word) for word in re.split(r"[,;/ ]+", said) if word]
        # "Unit no. 3 in cell 4" states nothing.
        if units and all(units):
            out += [unit for unit in units if unit]
    return tuple(dict.fromkeys(out))
