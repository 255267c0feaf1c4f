"""Mutations of tables: columns and rows of CSV, sheets of XLSX."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable, Sequence

from .mutate_bytes import Mutation, members_of, mutated
from .samples import NUMBERS, TEXTS, Rng, below, chance, one

Rows = list[list[bytes]]


def _split(data: bytes) -> tuple[Rows, bytes]:
    first = data.split(b"\n", 1)[0]
    separator = next((mark for mark in (b",", b";", b"\t") if mark in first), b",")
    return [line.split(separator) for line in data.replace(b"\r\n", b"\n").split(b"\n")], separator


def table(data: bytes, rng: Rng, others: Sequence[bytes]) -> bytes:
    """A change of rows, columns, cells or separators of a CSV."""
    rows, separator = _split(data)
    rows = one(rng, _CHANGES)(rows, rng)
    if chance(rng, 0.1):
        separator = one(rng, (b",", b";", b"\t", b"|", b" ", b", "))
    return b"\n".join(separator.join(row) for row in rows)


def _drop_column(rows: Rows, rng: Rng) -> Rows:
    k = below(rng, len(rows[0]))
    return [row[:k] + row[k + 1 :] for row in rows]


def _double_column(rows: Rows, rng: Rng) -> Rows:
    k = below(rng, len(rows[0]))
    return [row + row[k : k + 1] for row in rows]


def _order_columns(rows: Rows, rng: Rng) -> Rows:
    order = rng.permutation(len(rows[0]))
    return [[row[k] for k in order] if len(row) == len(order) else row for row in rows]


def _swap_names(rows: Rows, rng: Rng) -> Rows:
    head = list(rows[0])
    a, b = below(rng, len(head)), below(rng, len(head))
    head[a], head[b] = head[b], head[a]
    return [head, *rows[1:]]


def _rename_column(rows: Rows, rng: Rng) -> Rows:
    head = list(rows[0])
    k = below(rng, len(head))
    extra = (
        b"",
        b"Q1_DEG",
        b"sigma_mm",
        b"px_mm",
        b"repeat",
        b"phase",
        b"step",
        b"pose",
        b"dx_mm",
        b"rz_mrad",
        b"joint",
    )
    head[k] = one(
        rng, (head[k].replace(b"_mm", b"_m"), head[k].replace(b"_deg", b"_rad"), head[k] + b".1", *extra, *TEXTS)
    )
    return [head, *rows[1:]]


def _shuffle_rows(rows: Rows, rng: Rng) -> Rows:
    return [rows[0], *(rows[1 + i] for i in rng.permutation(len(rows) - 1))]


def _header_again(rows: Rows, rng: Rng) -> Rows:
    at = below(rng, len(rows) + 1)
    return [*rows[:at], rows[0], *rows[at:]]


def _ragged(rows: Rows, rng: Rng) -> Rows:
    k = below(rng, len(rows))
    changed = rows[k][:-1] if chance(rng, 0.5) else [*rows[k], b"1"]
    return [*rows[:k], changed, *rows[k + 1 :]]


def _cell(rows: Rows, rng: Rng) -> Rows:
    k = below(rng, len(rows))
    row = list(rows[k])
    new = (
        b'"',
        b'""',
        b'"1',
        b"=A1",
        b"=1/0",
        b"#DIV/0!",
        b"1,5",
        b"2026-11-22",
        b"loading",
        b"unloading",
        b"1e400",
        b" 1 ",
    )
    row[below(rng, len(row))] = one(rng, (*NUMBERS, *TEXTS, *new))
    return [*rows[:k], row, *rows[k + 1 :]]


def _column_of_one(rows: Rows, rng: Rng) -> Rows:
    """A whole column with one value: a gauge that is stuck, an empty column, a unit."""
    k, value = below(rng, len(rows[0])), one(rng, (b"0", b"1", b"", b"-0.5", b"1e300", b"loading", *NUMBERS[:16]))
    return [rows[0], *([*row[:k], value, *row[k + 1 :]] if len(row) > k else row for row in rows[1:])]


def _more_rows(rows: Rows, rng: Rng) -> Rows:
    times = one(rng, (2, 3, 30))
    return [rows[0], *(rows[1:] * times)]


def _more_columns(rows: Rows, rng: Rng) -> Rows:
    n = one(rng, (1, 30, 2000))
    return [[*row, *(b"c%d" % k if i == 0 else b"1" for k in range(n))] for i, row in enumerate(rows)]


def _fewer_rows(rows: Rows, rng: Rng) -> Rows:
    return rows[: 1 + below(rng, len(rows))]


_CHANGES: tuple[Callable[[Rows, Rng], Rows], ...] = (
    _drop_column,
    _double_column,
    _order_columns,
    _swap_names,
    _rename_column,
    _shuffle_rows,
    _header_again,
    _ragged,
    _cell,
    _cell,
    _cell,
    _column_of_one,
    _more_rows,
    _more_columns,
    _fewer_rows,
)

_CELL = re.compile(rb"<c\b[^>]*?(?:/>|>.*?</c>)", re.S)
_PLACE = re.compile(rb'\br="[A-Z]+\d+"')
_INSTEAD = (
    b"<c r=%s><f>A1+1</f></c>",
    b"<c r=%s><f>A1+1</f><v></v></c>",
    b'<c r=%s t="e"><v>#DIV/0!</v></c>',
    b'<c r=%s t="b"><v>1</v></c>',
    b'<c r=%s t="s"><v>99999</v></c>',
    b'<c r=%s t="inlineStr"><is><t>1,5</t></is></c>',
    b'<c r=%s t="d"><v>2026-11-22</v></c>',
    b"<c r=%s><v>1e400</v></c>",
    b"<c r=%s><v>nan</v></c>",
    b'<c r=%s t="x"><v>1</v></c>',
    b"<c r=%s/>",
    b"",
)


def workbook(data: bytes, rng: Rng, others: Sequence[bytes]) -> bytes:
    """A change of one member of an XLSX, its archive whole: a cell, a merge, a far cell, the XML, a lost member."""
    members = members_of(data)
    if not members:
        return data
    sheet = next((name for name in members if "sheet1" in name), next(iter(members)))
    how = below(rng, 10)
    if how < 6:
        members[sheet] = one(rng, _SHEET)(members[sheet], rng)
    elif how == 6:
        members[one(rng, list(members))] = b""
    elif how == 7:
        del members[one(rng, list(members))]
    else:
        name = one(rng, list(members))
        members[name] = mutated(members[name], rng, ())
    return _zipped(members, zipfile.ZIP_DEFLATED if chance(rng, 0.5) else zipfile.ZIP_STORED)


def _zipped(members: dict[str, bytes], method: int) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as archive:
        for name, content in members.items():
            # A time of day would make another file of the same seed.
            archive.writestr(zipfile.ZipInfo(name), content, method)
    return buffer.getvalue()


def _other_cell(sheet: bytes, rng: Rng) -> bytes:
    found = list(_CELL.finditer(sheet))
    if not found:
        return sheet
    at = one(rng, found)
    place = _PLACE.search(at.group())
    new = one(rng, _INSTEAD)
    new = new.replace(b"%s", b'"A1"' if place is None else place.group()[2:])
    return sheet[: at.start()] + new + sheet[at.end() :]


def _merged(sheet: bytes, rng: Rng) -> bytes:
    area = one(rng, (b"A1:B2", b"B2:B4", b"A2:G2", b"A1:XFD1048576", b"D3", b"Z9:A1", b""))
    return sheet.replace(
        b"</sheetData>", b'</sheetData><mergeCells count="1"><mergeCell ref="%s"/></mergeCells>' % area
    )


def _far_cell(sheet: bytes, rng: Rng) -> bytes:
    place = one(rng, (b"XFD1048576", b"A1048576", b"XFD1", b"ZZZZ1", b"A0", b"A99999999999"))
    row = re.sub(rb"[A-Z]+", b"", place)
    return sheet.replace(b"</sheetData>", b'<row r="%s"><c r="%s"><v>1</v></c></row></sheetData>' % (row, place))


def _dimension(sheet: bytes, rng: Rng) -> bytes:
    new = one(rng, (b"A1:XFD1048576", b"A1", b"", b"B2:A1"))
    return re.sub(rb'<dimension ref="[^"]*"', b'<dimension ref="%s"' % new, sheet)


def _sheet_bytes(sheet: bytes, rng: Rng) -> bytes:
    return mutated(sheet, rng, ())


_SHEET: tuple[Callable[[bytes, Rng], bytes], ...] = (
    _other_cell,
    _other_cell,
    _other_cell,
    _merged,
    _far_cell,
    _dimension,
    _sheet_bytes,
)
TABLE: tuple[Mutation, ...] = (table,)
WORKBOOK: tuple[Mutation, ...] = (workbook, workbook, workbook)
