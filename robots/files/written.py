"""Files that are there whole or not at all, and on the disk before they count as there.

Who makes a draft or a folder that must not stay says here how it goes (:func:`tidied_by`); who stops the process
(Ctrl-C) calls :func:`tidy`.
"""

from __future__ import annotations

import errno
import hashlib
import os
import re
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

# What systems answer that cannot settle a folder (or anything): there is nothing to be done about it.
_CANNOT = (errno.EINVAL, errno.EBADF, errno.ENOTSUP, errno.EACCES, errno.EPERM, errno.EISDIR)
_DRAFT = re.compile(r"\.[0-9a-f]{12}\.tmp(\..*)?")

_open: list[Callable[[], None]] = []


@contextmanager
def tidied_by(put_away: Callable[[], None]) -> Iterator[None]:
    """Have ``put_away`` called if the process is stopped inside this."""
    _open.append(put_away)
    try:
        yield
    finally:
        _open.remove(put_away)


def tidy() -> None:
    """Put everything away, the latest first; what fails keeps nothing else from going."""
    for put_away in reversed(_open):
        try:
            put_away()
        except Exception:  # noqa: S112 - the process ends next, and nobody is left to ask
            continue


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """A hidden name beside ``path`` to write under; it becomes ``path`` at the end, or goes after an error.

    The content is on the disk before it bears the name, and the name is when this returns. A process that is killed
    leaves at most the hidden file (:func:`is_draft`). The name's ending stays, since some writers judge by it.
    Errors of the system are raised as they are.
    """
    draft = path.with_name(f".{secrets.token_hex(6)}.tmp{path.suffix}")

    def put_away() -> None:
        draft.unlink(missing_ok=True)

    with tidied_by(put_away):
        try:
            yield draft
            settle(draft)
            os.replace(draft, path)
            settle(path.parent)
        finally:
            put_away()


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file as of :func:`written_whole`; text as UTF-8, its ends of lines as they are."""
    with written_whole(path) as draft:
        draft.write_bytes(content.encode(errors="surrogateescape") if isinstance(content, str) else content)


def sha256_of(path: Path) -> str:
    """SHA-256 of a file that this program has written, of any size."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def is_draft(name: str) -> bool:
    """Whether a file's name is one that :func:`written_whole` gives before the final one."""
    return _DRAFT.fullmatch(name) is not None


def settle(path: Path) -> None:
    """Wait until the disk holds a file, or the names in a folder, as they are now.

    Raises
    ------
    OSError
        The disk cannot take it: it is full or broken.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except OSError as error:
        if error.errno in _CANNOT:
            return
        raise
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in _CANNOT:
            raise
    finally:
        os.close(descriptor)
