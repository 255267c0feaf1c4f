"""Bytes of a text file as text: by its byte order mark, as UTF-8 or UTF-16, else as Windows-1252."""

from __future__ import annotations

import codecs
import re
from typing import Final

from robots import InputError

# Encodings that can be asked for, by the name that users type.
ENCODINGS: Final = {
    "utf-8": "utf-8-sig",
    "utf-16": "utf-16",
    "utf-16-le": "utf-16-le",
    "utf-16-be": "utf-16-be",
    "latin-1": "latin-1",
    "windows-1252": "cp1252",
    "windows-1250": "cp1250",
    "windows-1251": "cp1251",
    "shift-jis": "cp932",
    "gb18030": "gb18030",
}
_MARKS: Final = ((codecs.BOM_UTF8, "utf-8"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
# Text of Western letters in UTF-16 has a zero in nearly every second byte; a third of these is no accident.
_ZEROS = 1 / 3
_CONTROL: Final = re.compile(r"[\x00-\x08\x0b\x0e-\x1f\x7f]")
_OPEN_DOCUMENT: Final = b"mimetypeapplication/vnd.oasis.opendocument"
_WORKBOOKS: Final = {b"PK\x03\x04": "a workbook (XLSX)", b"\xd0\xcf\x11\xe0": "an old workbook (XLS)"}


def decoded(data: bytes, where: str, encoding: str | None = None) -> tuple[str, str]:
    """The text of a file and the name of its encoding; ``encoding``: the one to take in place of what is found.

    Raises
    ------
    InputError
        It is a workbook or another binary file, or not text in the encoding asked for.
    """
    if data.startswith(b"PK\x03\x04") and _OPEN_DOCUMENT in data[:200]:
        raise InputError(
            f"{where} is an OpenDocument file (ODS)",
            code="I001",
            allowed="text, or a workbook (XLSX)",
            remedy="save it as XLSX, or as CSV (UTF-8)",
        )
    for mark, what in _WORKBOOKS.items():
        if data.startswith(mark):
            raise InputError(
                f"{where} is {what} under another name",
                code="I001",
                allowed="text, or a workbook named .xlsx",
                remedy="save it as XLSX, or as CSV (UTF-8)",
            )
    if encoding is not None and encoding not in ENCODINGS:
        raise InputError(
            "--encoding", code="I001", value=encoding, allowed=", ".join(ENCODINGS), remedy="choose one of them"
        )
    name = encoding or _found(data)
    try:
        text = data.decode(ENCODINGS[name]).removeprefix("\ufeff")
    except UnicodeDecodeError as error:
        if encoding is None:
            raise InputError(
                f"{where} is not text (byte {error.start})",
                code="I001",
                allowed="text, or a workbook (XLSX)",
                remedy="export it from the instrument's program as text or CSV",
            ) from error
        raise InputError(
            f"{where} is not text in {name} (byte {error.start})",
            code="I001",
            allowed=", ".join(ENCODINGS),
            remedy="name its encoding with --encoding, or save it as CSV (UTF-8)",
        ) from error
    if found := _CONTROL.search(text):
        line = text.count("\n", 0, found.start()) + 1
        raise InputError(
            f"{where} is not text (control character in line {line})",
            code="I001",
            allowed="text, or a workbook (XLSX)",
            remedy="export it from the instrument's program as text or CSV",
        )
    return text, name


def _found(data: bytes) -> str:
    for mark, name in _MARKS:
        if data.startswith(mark):
            return name
    start = data[:4096]
    for name, zeros in (("utf-16-le", start[1::2]), ("utf-16-be", start[::2])):
        if len(start) > 1 and zeros.count(0) > _ZEROS * len(zeros):
            return name
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "windows-1252"
    return "utf-8"
