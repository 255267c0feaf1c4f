"""Text that came out of somebody's file, on its way into a program that moves a machine.

A template cannot print a :class:`SourceText` as it is: printing raises. It has to go through the filter ``comment`` or
``word``, which let through only characters that mean nothing in any of the languages, so that no text can end a
comment, open a string or start a statement.
"""

from __future__ import annotations

import re
import unicodedata

from robots import InputError

# Longest comment made of somebody's text; controllers cut or refuse longer lines.
LONGEST = 80
_NOT_COMMENT = re.compile(r"[^A-Za-z0-9 _.,+/#*=:()-]")
_NOT_WORD = re.compile(r"[^A-Za-z0-9_]")


class SourceText:
    """Text from a source file; opaque to templates."""

    __slots__ = ("_text",)

    def __init__(self, text: str) -> None:
        self._text = text

    def __str__(self) -> str:
        raise InputError(
            "template prints a text of the source file as it is", code="Q010", remedy="put it through | comment"
        )

    __repr__ = __str__

    def __format__(self, _: str) -> str:
        return str(self)

    def __html__(self) -> str:
        return str(self)

    def __bool__(self) -> bool:
        return bool(self._text.strip())


def comment(text: SourceText | str) -> str:
    """One line of harmless characters; others become ``_``, accents are dropped, at most ``LONGEST`` characters."""
    return _NOT_COMMENT.sub("_", plain_text(text))[:LONGEST].strip()


def word(text: SourceText | str) -> str:
    """Capitals, digits and ``_``: something that a template can compare with."""
    return _NOT_WORD.sub("_", plain_text(text).strip())[:LONGEST].upper()


def plain_text(text: SourceText | str) -> str:
    """The text without accents, so far as it can be of use."""
    raw = text._text if isinstance(text, SourceText) else str(text)
    # A long text is cut first: nobody's file should cost time here.
    split = unicodedata.normalize("NFKD", raw[: 4 * LONGEST])
    return "".join(c for c in split if not unicodedata.combining(c))
