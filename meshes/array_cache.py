"""A folder of named arrays, filed under a hash of what they were computed from.

Losing a file costs time, never a result: whatever cannot be read back bit for bit is treated as absent. A file is
a mark, the SHA-256 of the rest, and a .npz; it appears under its name at once and whole, so that
any number of processes may read and write the same key.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import re
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import platformdirs
from numpy.typing import NDArray

from meshes.npz import from_npz, to_npz

Array = NDArray[np.float64]
Fault = Callable[[dict[str, Array]], str | None]

VARIABLE = "STIFFARM_CACHE"
OFF = "off"
# Files beyond this number go, the oldest first: some 10 kB each.
MOST_FILES = 2000
# A temporary file older than this was left by a process that was killed.
STALE_S = 3600.0
_MARK = b"stiffarm-arrays/1\n"
_SUFFIX = ".arrays"
_KEY = re.compile(r"[0-9a-f]{64}")

_log = logging.getLogger("stiffarm")


@dataclass(frozen=True)
class ArrayCache:
    """The cache in ``folder``; None is no cache: nothing is found and nothing kept."""

    folder: Path | None

    def get(
        self, key: str, fault: Callable[[dict[str, Array]], str | None] = lambda _: None
    ) -> dict[str, Array] | None:
        """Arrays kept under ``key``, or None.

        ``fault`` says what is wrong with the arrays, None if nothing is. A file with a fault, of whatever kind,
        is removed with one remark in the log, so that its owner builds it again.
        """
        path = self._path(key)
        if path is None:
            return None
        try:
            content = path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            _say_unused(path.parent, error.strerror or str(error))
            return None
        arrays, wrong = _unpacked(content)
        if wrong is None:
            wrong = fault(arrays)
        if wrong is None:
            return arrays
        _log.warning("cache file %s is damaged (%s); it is built again", path, wrong)
        with contextlib.suppress(OSError):
            path.unlink()
        return None

    def put(self, key: str, arrays: Mapping[str, Array]) -> None:
        """Keep arrays under ``key``. A folder that cannot be written is no error: nothing is kept then."""
        path = self._path(key)
        if path is None:
            return
        content = to_npz({name: np.asarray(array, dtype=np.float64) for name, array in arrays.items()})
        temporary = None
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            handle, temporary = tempfile.mkstemp(prefix=f".{key[:8]}-", suffix=".tmp", dir=path.parent)
            with os.fdopen(handle, "wb") as file:
                file.write(_MARK + hashlib.sha256(content).digest() + content)
            os.replace(temporary, path)
            _tidy(path.parent)
        except OSError as error:
            _say_unused(path.parent, error.strerror or str(error))
        finally:
            if temporary is not None:
                with contextlib.suppress(OSError):
                    os.unlink(temporary)

    def _path(self, key: str) -> Path | None:
        if not _KEY.fullmatch(key):
            raise ValueError(f"a key is a SHA-256 in hexadecimal digits, not {key!r}")
        return None if self.folder is None else self.folder / f"{key}{_SUFFIX}"


def user_cache() -> ArrayCache:
    """The user's cache: the folder in the variable STIFFARM_CACHE ("off" for none), else the system's place for it."""
    chosen = os.environ.get(VARIABLE, "").strip()
    if chosen.lower() == OFF:
        return ArrayCache(None)
    if chosen:
        return ArrayCache(Path(os.path.expanduser(chosen)))
    place = platformdirs.user_cache_path("stiffarm", appauthor=False)
    # Without a home folder the place would be one called "~" right here.
    return ArrayCache(place if place.is_absolute() else None)


@cache
def _say_unused(folder: Path, reason: str) -> None:
    """Once for each folder and reason, however many files."""
    _log.debug("cache folder %s cannot be used (%s)", folder, reason)


def _unpacked(content: bytes) -> tuple[dict[str, Array], str | None]:
    """Arrays of a file, and what is wrong with it."""
    head = len(_MARK) + hashlib.sha256().digest_size
    if content[: len(_MARK)] != _MARK or len(content) < head:
        return {}, "not a file of this kind, or cut short"
    if hashlib.sha256(content[head:]).digest() != content[len(_MARK) : head]:
        return {}, "its checksum does not match"
    try:
        return from_npz(content[head:]), None
    except ValueError as error:
        return {}, str(error)


def _tidy(folder: Path) -> None:
    """Remove what killed processes left, and the oldest files beyond the limit."""
    age = {}
    with os.scandir(folder) as entries:
        for entry in entries:
            with contextlib.suppress(FileNotFoundError):
                if entry.name.endswith((".tmp", _SUFFIX)):
                    age[entry.path] = entry.stat().st_mtime
    stale = [path for path, when in age.items() if path.endswith(".tmp") and when < time.time() - STALE_S]
    files = sorted((path for path in age if path.endswith(_SUFFIX)), key=age.__getitem__)
    for path in [*stale, *files[: max(0, len(files) - MOST_FILES)]]:
        with contextlib.suppress(OSError):
            os.unlink(path)
