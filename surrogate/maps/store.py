"""A map on disk while it is made: one .npy file an array, and a record of the blocks that are done, with hashes.

Blocks are written as parts of files, not through memory maps, whose pages would count as the process's memory.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from robots import InputError
from robots.files.reading import parse_json, read_text
from robots.files.written import is_draft, write_whole

Array = NDArray[np.generic]

FORM = "stiffarm-map-work/2"
_RECORD, _DONE = "work.json", "done.txt"
_LINE = re.compile(r"(\d{1,18}) ([0-9a-f]{64})", re.ASCII)
# A disk that spoils what is written more often than this is no place for a map.
TRIES = 3

_log = logging.getLogger("stiffarm")


@dataclass(frozen=True)
class Column:
    """Type of an array as numpy writes it ('<f8'), and its shape after the number of points."""

    dtype: str
    shape: tuple[int, ...] = ()


@dataclass(eq=False)
class MapStore:
    """Arrays of n points in .npy files of a folder, written block by block, in any order.

    A folder that holds the same map (``key``) already is gone on with. A block counts as done when the record has its
    line with the SHA-256 of what the arrays hold, which are on the disk before; so a process may die at any time, and
    a block that has changed since is made again and named in the log.

    Parameters
    ----------
    folder : made if it is not there; parents too
    key : of the request, its hash; ``n`` points; ``size`` points a block; ``columns`` by name

    Raises
    ------
    InputError
        The folder holds something else, cannot be written, or the disk has no room.
    """

    folder: Path
    key: str
    n: int
    size: int
    columns: Mapping[str, Column]
    done: dict[int, str] = field(init=False, default_factory=dict)
    starts: dict[str, int] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        record = {"form": FORM, "key": self.key, "n": self.n, "block": self.size, "arrays": sorted(self.columns)}
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            if (self.folder / _RECORD).exists():
                self._go_on(record)
            else:
                self._begin(record)
        except OSError as error:
            raise InputError(
                f"work folder {self.folder} of the map ({error.strerror or error})",
                code="S013",
                allowed=f"a folder that can be written, with {self.bytes / 1e9:.3g} GB free",
                remedy="choose another one",
            ) from error

    @property
    def bytes(self) -> int:
        """Size of all arrays."""
        return sum(self.n * np.dtype(c.dtype).itemsize * int(np.prod(c.shape)) for c in self.columns.values())

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return -(-self.n // self.size)

    @property
    def points_done(self) -> int:
        """Points of the blocks that are done."""
        return sum(self.rows(i).stop - self.rows(i).start for i in self.done)

    def rows(self, number: int) -> slice:
        """Points of a block."""
        return slice(number * self.size, min((number + 1) * self.size, self.n))

    def missing(self) -> list[int]:
        """Blocks that are not done, in order."""
        return [i for i in range(self.blocks) if i not in self.done]

    def write(self, number: int, block: Mapping[str, Array]) -> None:
        """Keep a block: its arrays first, then its line in the record.

        Raises
        ------
        InputError
            Arrays that are missing, of another shape or type: the block is not of this map.
        """
        rows = self.rows(number)
        for name, column in self.columns.items():
            given = block.get(name)
            shape = (rows.stop - rows.start, *column.shape)
            if given is None or given.shape != shape or given.dtype != np.dtype(column.dtype):
                found = "missing" if given is None else f"{given.dtype} {given.shape}"
                raise InputError(
                    f"block {number} of the map: {name}", code="S013", value=found, allowed=f"{column.dtype} {shape}"
                )
        arrays = {name: np.ascontiguousarray(block[name]) for name in self.columns}
        for name, values in arrays.items():
            self._put(name, rows.start, values)
        sha256 = self._sha256(number, {name: memoryview(values.tobytes()) for name, values in arrays.items()})
        with (self.folder / _DONE).open("a", encoding="ascii") as file:
            file.write(f"{number} {sha256}\n")
            file.flush()
            os.fsync(file.fileno())
        self.done[number] = sha256

    def complete(self, make: Callable[[], None]) -> None:
        """Have ``make`` write the blocks that are missing until all are there as they were written.

        Raises
        ------
        InputError
            The disk does not keep what is written.
        """
        for _ in range(TRIES):
            make()
            if not self._spoilt():
                return
        raise InputError(
            f"work folder {self.folder}: blocks come back other than they were written, {TRIES} times over",
            code="S013",
            remedy="choose a folder on another disk, and check this one",
        )

    def finished(self) -> dict[str, Array]:
        """All arrays, to be read only.

        Raises
        ------
        InputError
            Blocks are missing.
        """
        if self.missing():
            raise InputError("map", code="S013", value=f"{len(self.missing())} of {self.blocks} blocks are missing")
        return {name: np.load(self._file(name), mmap_mode="r", allow_pickle=False) for name in self.columns}

    def _spoilt(self) -> list[int]:
        """Blocks whose arrays are not as they were written; they count as missing from now on, and are named."""
        spoilt = [number for number, sha256 in self.done.items() if self._sha256(number, self._read(number)) != sha256]
        for number in spoilt:
            del self.done[number]
        if spoilt:
            few = ", ".join(map(str, sorted(spoilt)[:5])) + (", ..." if len(spoilt) > 5 else "")
            _log.warning(
                "work folder %s: %d of %d blocks are damaged (%s); they are made again",
                self.folder,
                len(spoilt),
                self.blocks,
                few,
            )
        return spoilt

    def _sha256(self, number: int, arrays: Mapping[str, memoryview]) -> str:
        """Hash of a block's arrays, and of whose they are."""
        digest = hashlib.sha256(f"{self.key} {number}\n".encode())
        for name in sorted(arrays):
            digest.update(f"{name}\n".encode())
            digest.update(arrays[name])
        return digest.hexdigest()

    def _read(self, number: int) -> dict[str, memoryview]:
        """The bytes of a block as they are on the disk."""
        rows, out = self.rows(number), dict[str, memoryview]()
        for name, column in self.columns.items():
            size = np.dtype(column.dtype).itemsize * int(np.prod(column.shape))
            start, count = self.starts[name] + rows.start * size, (rows.stop - rows.start) * size
            out[name] = np.fromfile(self._file(name), np.uint8, count, offset=start).data
        return out

    def _put(self, name: str, row: int, values: Array) -> None:
        itemsize = values.dtype.itemsize * int(np.prod(values.shape[1:]))
        with self._file(name).open("r+b") as file:
            file.seek(self.starts[name] + row * itemsize)
            file.write(values.data)
            file.flush()
            os.fsync(file.fileno())

    def _begin(self, record: Mapping[str, object]) -> None:
        # What a process left that died before it had written the record may be written over.
        own = {*(f"{name}.npy" for name in self.columns), _DONE}
        if any(file.name not in own and not is_draft(file.name) for file in self.folder.iterdir()):
            raise InputError(
                f"work folder {self.folder}",
                code="S013",
                value="holds other files",
                allowed="a new or empty folder, or one of the same map",
                remedy="choose another folder",
            )
        free = os.statvfs(self.folder).f_bavail * os.statvfs(self.folder).f_frsize if hasattr(os, "statvfs") else None
        if free is not None and free < self.bytes:
            raise InputError(
                f"work folder {self.folder}: space for the map",
                code="S013",
                value=f"{free / 1e9:.3g} GB free",
                allowed=f"{self.bytes / 1e9:.3g} GB or more",
                remedy="choose a folder on another disk, fewer points or fewer quantities",
            )
        for name, column in self.columns.items():
            made = open_memmap(self._file(name), "w+", column.dtype, (self.n, *column.shape))
            self.starts[name] = made.offset
            del made
        (self.folder / _DONE).write_text("", encoding="ascii")
        # Last and in one go: a folder without a record is begun anew.
        write_whole(self.folder / _RECORD, json.dumps(record, indent=2) + "\n")

    def _go_on(self, record: Mapping[str, object]) -> None:
        text = read_text(self.folder / _RECORD, "map work", kept=False)
        try:
            kept = parse_json(text, str(self.folder / _RECORD))
        except InputError:
            kept = None
        if kept != record:
            raise InputError(
                f"work folder {self.folder}",
                code="S013",
                value="of another map",
                allowed="the folder of the same map, a new one or an empty one",
                remedy="choose another folder, or remove this one",
            )
        for name, column in self.columns.items():
            array = self._opened(name)
            right = array.shape == (self.n, *column.shape) and array.dtype == np.dtype(column.dtype)
            if not right or not array.flags.c_contiguous:
                raise InputError(
                    f"work folder {self.folder}: {name}", code="S013", value=f"{array.dtype} {array.shape}"
                )
            self.starts[name] = array.offset
        # A line that is not whole was being written when the process died, or has been damaged since.
        lines = (self.folder / _DONE).read_bytes().decode("ascii", "replace").split("\n")[:-1]
        found = [line for line in map(_LINE.fullmatch, lines) if line and int(line[1]) < self.blocks]
        self.done = {int(line[1]): line[2] for line in found}
        self._spoilt()
        write_whole(self.folder / _DONE, "".join(f"{number} {sha256}\n" for number, sha256 in self.done.items()))

    def _opened(self, name: str) -> Any:
        try:
            return np.load(self._file(name), mmap_mode="r", allow_pickle=False)
        except Exception as error:  # NumPy's parser of heads raises whatever Python's tokenizer does
            # NumPy's own words are about pickles, which this program never writes.
            raise InputError(
                f"work folder {self.folder}: {name}.npy is damaged or missing",
                code="S013",
                allowed="files as this program wrote them",
                remedy="remove the folder, and make the map anew",
            ) from error

    def _file(self, name: str) -> Path:
        return self.folder / f"{name}.npy"
