"""Result files that are there whole or not at all, however the writing ends."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from robots.errors import InputError
from robots.files.written import written_whole


@contextmanager
def whole_file(path: Path, suffix: str) -> Iterator[Path]:
    """:func:`robots.files.written.written_whole` for a map's file, with what may go wrong said to the user.

    Raises
    ------
    InputError
        The name does not end in ``suffix``, the folder does not exist or cannot be written, or the system
        refuses while the file is written (a full disk).
    """
    if path.suffix != suffix:
        raise InputError("map file", code="B004", value=str(path), allowed=f"a name that ends in {suffix}")
    if not path.parent.is_dir() or not os.access(path.parent, os.W_OK):
        raise InputError(
            "map folder", code="F008", value=str(path.parent), allowed="an existing folder one may write to"
        )
    try:
        with written_whole(path) as draft:
            yield draft
    except OSError as error:
        raise InputError(
            f"map file {path} could not be written ({error.strerror or error})",
            code="F008",
            remedy="check the free space of the disk and what stands under this name",
        ) from error


def claim_disk(stream: BinaryIO, n_bytes: int) -> None:
    """Claim the disk for a file at once, so that a full one is known before the work.

    Where the system has no such call, only the free space is looked at.

    Raises
    ------
    OSError
        There is not as much left.
    """
    if hasattr(os, "posix_fallocate"):
        try:
            os.posix_fallocate(stream.fileno(), 0, n_bytes)
        except OSError as error:
            if error.errno not in (errno.EINVAL, errno.EOPNOTSUPP):  # file systems that know no such call
                raise
        else:
            return
    if shutil.disk_usage(Path(stream.name).parent).free < n_bytes:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
