"""Lines of a tool path file, one at a time: size, encoding and line length are checked before memory is used."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from robots import InputError

# Longest line (characters). APT lines have 72 to 80, G-code blocks up to 512 on known controls.
LINE_LIMIT = 16384
_SAMPLE = 65536


def check_size(path: Path, max_bytes: int) -> None:
    """Refuse what is no ordinary file, holds nothing, or is larger than ``max_bytes``.

    Raises
    ------
    InputError
        With the size and the option that lifts the limit.
    """
    try:
        status = os.stat(path)
    except OSError as error:
        raise InputError(f"tool path file {path.name} cannot be opened ({error.strerror})", remedy="check") from error
    if not stat.S_ISREG(status.st_mode):
        raise InputError(f"tool path file {path.name}", value="not an ordinary file", remedy="give a file")
    if status.st_size > max_bytes:
        raise InputError(
            f"tool path file {path.name}: size",
            value=f"{status.st_size} bytes",
            allowed=f"up to {max_bytes} bytes",
            remedy="split the file by operation, or raise max_bytes (about 170 bytes of memory for each move)",
        )
    if status.st_size == 0:
        raise InputError(f"tool path file {path.name} is empty", remedy="post the program once more")


def lines(path: Path) -> Iterator[str]:
    """Lines of a file without their ends, every byte as one Latin-1 character; ``readable`` decodes names in it.

    Raises
    ------
    InputError
        The file cannot be read, holds NUL bytes at its start (binary or UTF-16), or has a line too long.
    """
    with path.open("rb") as raw:
        head = raw.read(_SAMPLE)
    if b"\0" in head:
        raise InputError(
            f"tool path file {path.name} holds NUL bytes: binary or UTF-16", remedy="write it as text in UTF-8"
        )
    with path.open(encoding="latin-1", newline=None) as file:
        for number, line in enumerate(iter(partial(file.readline, LINE_LIMIT + 1), ""), start=1):
            if len(line) > LINE_LIMIT:
                raise InputError(
                    f"{path.name}, line {number}: length", allowed=f"up to {LINE_LIMIT} characters", remedy="break it"
                )
            yield line


def readable(text: str) -> str:
    """Text of :func:`lines` as UTF-8 where it is that, else as Latin-1."""
    if text.isascii():
        return text
    try:
        return text.encode("latin-1").decode("utf-8")
    except UnicodeError:
        # Upper case of Latin-1 is not always Latin-1.
        return text
