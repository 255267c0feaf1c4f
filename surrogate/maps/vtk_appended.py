"""VTK XML files with raw appended data, of which any part can be written at any time.

All sizes are known before the data, so the head of the file with the offsets comes first and arrays are then filled in
block by block. Format: VTK's documentation, "XML File Formats" (version 1.0, appended data, header_type UInt64) and
"VTK XML Reader/Writer Information Format" (UNITS_LABEL).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self
from xml.sax.saxutils import escape, quoteattr

import numpy as np
from numpy.typing import ArrayLike

from surrogate.maps.columns import valid_text
from surrogate.maps.whole_file import claim_disk

_TYPES = {"f4": "Float32", "f8": "Float64", "i4": "Int32", "i8": "Int64", "u1": "UInt8"}
# Before each array: its length in bytes, as UInt64.
_LENGTH_BYTES = 8
_FOOT = b"\n  </AppendedData>\n</VTKFile>\n"


@dataclass(frozen=True, eq=False)
class DataArray:
    """An array of a file: name, type, tuples of ``components`` numbers; ``unit`` becomes VTK's UNITS_LABEL."""

    name: str
    dtype: np.dtype[np.generic]
    tuples: int
    components: int = 1
    unit: str = ""

    @property
    def n_bytes(self) -> int:
        """Bytes of the data."""
        return self.tuples * self.components * self.dtype.itemsize

    def xml(self, offset: int) -> str:
        """The element that describes it."""
        head = f'<DataArray type="{_TYPES[self.dtype.str[1:]]}" Name={_quoted(self.name)}'
        head += f' NumberOfComponents="{self.components}" format="appended" offset="{offset}"'
        if not self.unit:
            return f"{head}/>"
        key = '<InformationKey name="UNITS_LABEL" location="vtkDataArray">'
        return f"{head}>{key}{escape(valid_text(self.unit))}</InformationKey></DataArray>"


@dataclass(frozen=True, eq=False)
class Section:
    """An element of a piece with its arrays: PointData, Points, Cells, Verts; ``scalars`` names the active array."""

    tag: str
    arrays: tuple[DataArray, ...] = ()
    scalars: str | None = None


class AppendedFile:
    """A VTK XML file under construction; it is complete once every array has been written in full.

    Parameters
    ----------
    kind : VTK's name of the data set ('ImageData', 'UnstructuredGrid', 'PolyData')
    attributes, piece : attributes of the data set's and of the piece's element
    texts : field data, name -> strings
    """

    def __init__(
        self,
        path: Path,
        kind: str,
        attributes: Mapping[str, str],
        piece: Mapping[str, str],
        texts: Mapping[str, Sequence[str]],
        sections: Sequence[Section],
    ) -> None:
        encoded = {name: _zero_ended(values) for name, values in texts.items()}
        offset, fields = 0, ["<FieldData>"]
        for name, values in texts.items():
            fields.append(
                f'<Array type="String" Name={_quoted(name)} NumberOfTuples="{len(values)}"'
                f' format="appended" offset="{offset}"/>'
            )
            offset += _LENGTH_BYTES + len(encoded[name])
        self._places: dict[DataArray, int] = {}
        lines = []
        for section in sections:
            active = "" if section.scalars is None else f" Scalars={_quoted(section.scalars)}"
            lines.append(f"<{section.tag}{active}>")
            for array in section.arrays:
                lines.append(array.xml(offset))
                self._places[array] = offset
                offset += _LENGTH_BYTES + array.n_bytes
            lines.append(f"</{section.tag}>")
        head = [
            '<?xml version="1.0" encoding="UTF-8"?>',
            f'<VTKFile type="{kind}" version="1.0" byte_order="LittleEndian" header_type="UInt64">',
            f"<{kind}{_attributes(attributes)}>",
            *fields,
            "</FieldData>",
            f"<Piece{_attributes(piece)}>",
            *lines,
            "</Piece>",
            f"</{kind}>",
            '<AppendedData encoding="raw">\n_',
        ]
        start = "\n".join(head).encode()
        self._data_start, self._size = len(start), len(start) + offset
        self._stream = path.open("wb")
        try:
            claim_disk(self._stream, self._size + len(_FOOT))
            self._stream.write(start)
            for content in encoded.values():
                self._stream.write(_length(len(content)) + content)
            for array, place in self._places.items():
                self._stream.seek(self._data_start + place)
                self._stream.write(_length(array.n_bytes))
            self._stream.seek(self._size)
            self._stream.write(_FOOT)
        except BaseException:
            self._stream.close()
            raise

    def write(self, array: DataArray, start: int, values: ArrayLike) -> int:
        """Write tuples from number ``start`` on; the number of the tuple after them."""
        content = np.asarray(values).astype(array.dtype, copy=False).tobytes()
        per_tuple = array.components * array.dtype.itemsize
        self._stream.seek(self._data_start + self._places[array] + _LENGTH_BYTES + start * per_tuple)
        self._stream.write(content)
        return start + len(content) // per_tuple

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stream.close()


def _quoted(text: str) -> str:
    # VTK's reader does not show a line break in an attribute unless it is written as a reference.
    return quoteattr(valid_text(text), {"\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})


def _attributes(values: Mapping[str, str]) -> str:
    return "".join(f" {name}={_quoted(value)}" for name, value in values.items())


def _zero_ended(values: Sequence[str]) -> bytes:
    return b"".join(valid_text(value).encode() + b"\0" for value in values)


def _length(n_bytes: int) -> bytes:
    return n_bytes.to_bytes(_LENGTH_BYTES, "little")
