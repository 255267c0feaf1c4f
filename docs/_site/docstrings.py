"""Docstrings as they are written: plain English, `code` in backticks, numpy's sections; no further markup."""

from __future__ import annotations

import re

CODE = re.compile(r"(``[^`]+``|:[a-z:]+:`[^`]+`|`[^`]+`)")


def as_plain_text(_app: object, _what: str, _name: str, _value: object, _options: object, lines: list[str]) -> None:
    """Take literally what reStructuredText would read as markup outside of code."""
    for i, line in enumerate(lines):
        if line.lstrip().startswith((".. ", ":")):
            continue
        parts = CODE.split(line)
        lines[i] = "".join(
            re.sub(r"([*|]|(?<=\w)_(?!\w))", r"\\\1", part) if place % 2 == 0 else part
            for place, part in enumerate(parts)
        )
