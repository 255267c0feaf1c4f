"""A folder of named arrays, filed under a hash of what they were computed from.

Losing a file costs time, never a result: whatever cannot be read back bit for bit is treated as absent. A file is
a mark, the key, the SHA-256 of key and content, and a .npz; a file of another key is damaged like any other that is
not whole. It appears under its name at once, so that any number of processes may read and write the same key. Part of
what a result depends on is the program itself: :func:`formulation_hash`.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import importlib.util
import io
import logging
import os
import re
import time
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs
from numpy.typing import NDArray

from robots.arrays import Array
from robots.files.written import is_draft, write_whole

LIBRARIES = ("numpy", "scipy", "scikit-fem")


@cache
def formulation_hash(*roots: str) -> str | None:
    """SHA-256 of the source of modules, of those they import from their own packages, and of the libraries' versions.

    None where a source cannot be read, as in a frozen program.
    """
    digest = hashlib.sha256()
    try:
        for root in roots:
            for name, source in sorted(_sources(root).items()):
                add_to(digest, f"{name}\n{source}")
    except (OSError, SyntaxError):
        return None
    for library in LIBRARIES:
        add_to(digest, f"{library} {version(library)}")
    return str(digest.hexdigest())


def _sources(root: str) -> dict[str, str]:
    """Source of a module and of those that it imports from its own package, at any depth."""
    package = root.partition(".")[0]
    found: dict[str, str] = {}
    waiting = [root]
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        found[name] = _source(name)
        waiting += _imported(found[name], package)
    return found


def _imported(source: str, package: str) -> list[str]:
    """Names of the package's modules that a source imports, folders within it included."""
    names: list[str] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module is not None and node.module.split(".")[0] == package:
            inside = [f"{node.module}.{alias.name}" for alias in node.names if _is_package(node.module)]
            names += [node.module, *(name for name in inside if importlib.util.find_spec(name) is not None)]
    return [name for name in names if name.startswith(f"{package}.")]


def _is_package(name: str) -> bool:
    spec = importlib.util.find_spec(name)
    return spec is not None and spec.submodule_search_locations is not None


def _source(name: str) -> str:
    spec = importlib.util.find_spec(name)
    get_source = getattr(None if spec is None else spec.loader, "get_source", None)
    text = None if get_source is None else get_source(name)
    if not isinstance(text, str):
        raise OSError(f"{name} has no source")
    return text


def add_to(digest: Any, content: str | NDArray[np.generic]) -> None:
    """Feed a text, or an array with its type and shape, so that no two contents run into one another."""
    if isinstance(content, str):
        data = content.encode()
        digest.update(f"text {len(data)}\n".encode() + data)
        return
    kind = np.float64 if np.issubdtype(content.dtype, np.floating) else np.int64
    array = np.ascontiguousarray(content, dtype=np.dtype(kind).newbyteorder("<"))
    digest.update(f"array {array.dtype.str} {array.shape}\n".encode() + array.tobytes())


def to_npz(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Bytes of a compressed .npz file; the same for equal arrays, since no time of day is in them.

    Raises
    ------
    ValueError
        An array of objects.
    """
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array(file, np.asarray(array), allow_pickle=False)
    return buffer.getvalue()


def from_npz(content: bytes) -> dict[str, NDArray[Any]]:
    """Arrays of a .npz file.

    Raises
    ------
    ValueError
        Anything that is no whole .npz file of plain arrays.
    """
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as file:
            return {name: np.asarray(file[name]) for name in file.files}
    except Exception as error:  # zip, zlib and NumPy's parser each raise their own, and a lone array is no archive
        raise ValueError(f"{type(error).__name__}: {error}") from error


Fault = Callable[[dict[str, Array]], str | None]

VARIABLE = "STIFFARM_CACHE"
OFF = "off"
# Files beyond this number go, the oldest first: some 10 kB each.
MOST_FILES = 2000
# A temporary file older than this was left by a process that was killed.
STALE_S = 3600.0
_MARK = b"stiffarm-arrays/2\n"
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
        arrays, wrong = _unpacked(key, content)
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
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, _head(key, content) + content)
            _tidy(path.parent)
        except OSError as error:
            _say_unused(path.parent, error.strerror or str(error))

    def _path(self, key: str) -> Path | None:
        if not _KEY.fullmatch(key):
            raise ValueError(f"a key is a SHA-256 in hexadecimal digits, not {key!r}")
        return None if self.folder is None else self.folder / f"{key}{_SUFFIX}"


def user_cache() -> ArrayCache:
    """The user's cache: the folder in the variable STIFFARM_CACHE ("off" for none), else the system's place for it."""
    chosen = os.environ.get(VARIABLE, "").strip()
    if chosen.lower() == OFF:
        return ArrayCache(None)
    try:
        place = Path(chosen or platformdirs.user_cache_path("stiffarm", appauthor=False)).expanduser()
    except RuntimeError:  # Without a home folder; the place would be one called "~" right here.
        return ArrayCache(None)
    return ArrayCache(place)


@cache
def _say_unused(folder: Path, reason: str) -> None:
    """Once for each folder and reason, however many files."""
    _log.debug("cache folder %s cannot be used (%s)", folder, reason)


def _head(key: str, content: bytes) -> bytes:
    """What stands before the content of a file."""
    named = _MARK + key.encode() + b"\n"
    return named + hashlib.sha256(named + content).digest()


def _unpacked(key: str, content: bytes) -> tuple[dict[str, Array], str | None]:
    """Arrays of the file of a key, and what is wrong with it."""
    size = len(_head(key, b""))
    head, rest = content[:size], content[size:]
    if not head.startswith(_MARK) or len(head) < size:
        return {}, "not a file of this kind, or cut short"
    if head != _head(key, rest):
        named = head[len(_MARK) :].startswith(key.encode())
        return {}, "its checksum does not match" if named else "it is that of another key"
    try:
        return from_npz(rest), None
    except ValueError as error:
        return {}, str(error)


def _tidy(folder: Path) -> None:
    """Remove what killed processes left, and the oldest files beyond the limit."""
    age = {}
    with os.scandir(folder) as entries:
        for entry in entries:
            with contextlib.suppress(FileNotFoundError):
                if entry.name.endswith(_SUFFIX):
                    age[entry.path] = entry.stat().st_mtime
    drafts = {path for path in age if is_draft(os.path.basename(path))}
    stale = [path for path in drafts if age[path] < time.time() - STALE_S]
    files = sorted(age.keys() - drafts, key=age.__getitem__)
    for path in [*stale, *files[: max(0, len(files) - MOST_FILES)]]:
        with contextlib.suppress(OSError):
            os.unlink(path)
