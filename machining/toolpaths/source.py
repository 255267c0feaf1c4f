"""Lines of a tool path file, one at a time: size, encoding and line length are checked before memory is used."""

from __future__ import annotations

import io
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from robots import InputError
from robots.files.reading import BYTE_ORDER_MARK, LARGEST_FILE, read_bytes

# Longest line (characters). APT lines have 72 to 80, G-code blocks up to 512 on known controls.
LINE_LIMIT = 16384
_SAMPLE = 65536


def content(path: Path, max_bytes: int = LARGEST_FILE) -> bytes:
    """Content of a tool path file, without a byte order mark.

    Raises
    ------
    InputError
        What :func:`robots.files.reading.read_bytes` refuses, an empty file, NUL bytes at its start (binary or UTF-16).
    """
    # CP/M and DOS end a text with byte 0x1A.
    data = read_bytes(path, "tool path file", most=max_bytes).removeprefix(BYTE_ORDER_MARK).rstrip(b"\x1a")
    if not data:
        raise InputError(f"tool path file {path.name} is empty", code="P002", remedy="post the program once more")
    if b"\0" in data[:_SAMPLE]:
        raise InputError(
            f"tool path file {path.name} holds NUL bytes: binary or UTF-16",
            code="P002",
            remedy="write it as text in UTF-8",
        )
    return data


def lines(path: Path, max_bytes: int = LARGEST_FILE) -> Iterator[str]:
    """Lines of a file without their ends, every byte as one Latin-1 character; ``readable`` decodes names in it.

    Raises
    ------
    InputError
        As :func:`content`, and for a line too long.
    """
    return lines_of(path.name, content(path, max_bytes))


def lines_of(name: str, data: bytes) -> Iterator[str]:
    """Lines as :func:`lines` of the content of a file with this name."""
    file = io.TextIOWrapper(io.BytesIO(data), encoding="latin-1", newline=None)
    for number, line in enumerate(iter(partial(file.readline, LINE_LIMIT + 1), ""), start=1):
        if len(line) > LINE_LIMIT:
            raise InputError(
                f"{name}, line {number}: length",
                code="P002",
                allowed=f"up to {LINE_LIMIT} characters",
                remedy="break it",
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
