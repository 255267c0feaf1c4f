"""The arrays of a map while it is made, and its finished blocks in a folder, so that an interrupted map goes on."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robots import InputError
from robots.files.reading import parse_json, read_text
from robots.files.written import is_draft, write_whole, written_whole

Array = NDArray[np.generic]

FORM = "stiffarm-map-work/3"
_RECORD = "work.json"
_log = logging.getLogger("stiffarm")


@dataclass(eq=False)
class MapStore:
    """Arrays of n points, written block by block, in any order.

    With a ``folder`` each finished block is a file there too, and a folder that holds blocks of the same map (``key``)
    is gone on with. The files have checksums: a block that has changed since is made again and named in the log.

    Parameters
    ----------
    n, size : points, and points a block
    columns : arrays by name, as in ``np.empty(n, dtype)``
    key : of the map, its hash
    folder : made if it is not there; parents too

    Raises
    ------
    InputError
        The folder holds something else, or cannot be written.
    """

    n: int
    size: int
    columns: Mapping[str, np.dtype[np.generic]]
    key: str = ""
    folder: Path | None = None
    done: set[int] = field(init=False, default_factory=set)
    _arrays: dict[str, Array] = field(init=False)

    def __post_init__(self) -> None:
        self._arrays = {name: np.empty(self.n, kind) for name, kind in self.columns.items()}
        if self.folder is not None:
            self._go_on(self.folder)

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
        """Keep a block.

        Raises
        ------
        InputError
            Arrays that are missing, of another shape or type: the block is not of this map. A full disk.
        """
        self._fill(number, block)
        if self.folder is not None:
            kept = {name: block[name] for name in self.columns}
            with _writing(self.folder), written_whole(self._file(self.folder, number)) as draft:
                np.savez(draft, allow_pickle=False, of=np.array(f"{self.key} {number}"), **kept)
        self.done.add(number)

    def finished(self) -> Mapping[str, Array]:
        """All arrays.

        Raises
        ------
        InputError
            Blocks are missing.
        """
        if self.missing():
            raise InputError("map", code="S013", value=f"{len(self.missing())} of {self.blocks} blocks are missing")
        return self._arrays

    def _fill(self, number: int, block: Mapping[str, Array]) -> None:
        rows = self.rows(number)
        for name, kind in self.columns.items():
            given, shape = block.get(name), (rows.stop - rows.start, *kind.shape)
            if given is None or given.shape != shape or given.dtype != kind.base:
                found = "missing" if given is None else f"{given.dtype} {given.shape}"
                raise InputError(
                    f"block {number} of the map: {name}", code="S013", value=found, allowed=f"{kind.base} {shape}"
                )
        for name in self.columns:
            self._arrays[name][rows] = block[name]

    def _go_on(self, folder: Path) -> None:
        """Take up the folder: a new one, or the blocks of the same map in it."""
        record = {"form": FORM, "key": self.key, "n": self.n, "block": self.size, "arrays": sorted(self.columns)}
        with _writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
            if not (folder / _RECORD).exists():
                if any(not is_draft(file.name) for file in folder.iterdir()):
                    raise InputError(
                        f"work folder {folder}",
                        code="S013",
                        value="holds other files",
                        allowed="a new or empty folder, or one of the same map",
                        remedy="choose another folder",
                    )
                write_whole(folder / _RECORD, json.dumps(record, indent=2) + "\n")
        text = read_text(folder / _RECORD, "map work", kept=False)
        try:
            kept = parse_json(text, str(folder / _RECORD))
        except InputError:
            kept = None
        if kept != record:
            raise InputError(
                f"work folder {folder}",
                code="S013",
                value="of another map",
                allowed="the folder of the same map, a new one or an empty one",
                remedy="choose another folder, or remove this one",
            )
        there = [number for number in range(self.blocks) if self._file(folder, number).exists()]
        self.done = {number for number in there if self._taken_up(folder, number)}
        if damaged := [number for number in there if number not in self.done]:
            few = ", ".join(map(str, damaged[:5])) + (", ..." if len(damaged) > 5 else "")
            found = f"{len(damaged)} of {self.blocks} blocks are damaged ({few})"
            _log.warning("work folder %s: %s; they are made again", folder, found)

    def _taken_up(self, folder: Path, number: int) -> bool:
        """Fill in a block that was kept; False where its file is not as it was written."""
        try:
            # NumPy leaves a damaged file open that it has opened itself.
            with self._file(folder, number).open("rb") as stream, np.load(stream, allow_pickle=False) as file:
                block = {name: file[name] for name in file.files}  # which compares the checksums
            self._fill(number, block)
            return str(block["of"]) == f"{self.key} {number}"
        except Exception:  # what zipfile and NumPy raise of damaged files is anything
            return False

    def _file(self, folder: Path, number: int) -> Path:
        return folder / f"block_{number:06d}.npz"


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(
            f"work folder {folder} of the map ({error.strerror or error})",
            code="S013",
            allowed="a folder that can be written, on a disk with room for the map",
            remedy="choose another one",
        ) from error
