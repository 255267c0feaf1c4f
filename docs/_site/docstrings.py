"""Docstrings as they are written here: plain English, `code` in backticks, numpy's sections; no further markup.

An entry of a section is ``name : what it is, with shape and unit``. Readers of numpy's style (napoleon) would take all
of that for a type and look for links in it, so the sections are read here.
"""

from __future__ import annotations

import re

CODE = re.compile(r"(``[^`]+``|:[a-z:]+:`[^`]+`|`[^`]+`)")
RULE = re.compile(r"-{3,}")
ENTRY = re.compile(r"(?P<name>\S.*?) : (?P<text>.+)")
FIELDS = {"Parameters": "param", "Attributes": "ivar", "Raises": "raises", "Warns": "raises"}


def readable(_app: object, _what: str, _name: str, _value: object, _options: object, lines: list[str]) -> None:
    """Rewrite a docstring's lines in place, as reStructuredText."""
    body = literal("\n".join(lines)).split("\n")
    starts = [i for i in range(len(body) - 1) if body[i].strip() and RULE.fullmatch(body[i + 1].strip())]
    found = body[: starts[0]] if starts else body
    for start, end in zip(starts, [*starts, len(body)][1:], strict=True):
        found += section(body[start].strip(), body[start + 2 : end])
    lines[:] = [*found, ""]


def short(
    _app: object, _what: str, name: str, _value: object, _options: object, signature: str | None, returns: str | None
) -> tuple[str | None, str | None]:
    """Signatures without what Python puts around the names of types and around computed defaults."""
    brief = in_brief(signature), in_brief(returns)
    if not name.startswith("stiffarm."):
        return brief
    # The package `surrogate` has a class of that name, too.
    own = (text and re.sub(r"(?<![\w.])Surrogate\b", "stiffarm.Surrogate", text) for text in brief)
    return next(own), next(own)


def in_brief(text: str | None) -> str | None:
    """One signature, as its source reads."""
    return text and re.sub(r"TypeAliasForwardRef\('(\w+)'\)", r"\1", text).replace("<factory>", "...")


def literal(text: str) -> str:
    """Take literally what reStructuredText would read as markup outside of code."""
    parts = CODE.split(text)
    return "".join(
        re.sub(r"([*|]|(?<=\w)_(?!\w))", r"\\\1", part) if place % 2 == 0 else part for place, part in enumerate(parts)
    )


def section(title: str, lines: list[str]) -> list[str]:
    """One section: a field for each entry, a list of what is returned, or a heading and its text."""
    entries = list(split(lines))
    if title == "Returns":
        many = any(ENTRY.fullmatch(head) for head, _ in entries)
        texts = [" ".join(filter(None, [named(head), *(line.strip() for line in rest)])) for head, rest in entries]
        return ["", ":returns:", *(f"    {'- ' if many else ''}{text}" for text in texts), ""]
    if title not in FIELDS:
        return ["", f".. rubric:: {title}", "", *lines]
    found = [""]
    for head, rest in entries:
        entry = ENTRY.fullmatch(head)
        name, text = (entry["name"], [entry["text"]]) if entry else (head, [])
        text += [line.strip() for line in rest]
        found += [f":{FIELDS[title]} {one}: {' '.join(filter(None, text))}" for one in re.split(r", ", name)]
    return found


def split(lines: list[str]) -> list[tuple[str, list[str]]]:
    """Entries: a line at the margin, and the indented ones below it."""
    entries: list[tuple[str, list[str]]] = []
    for line in lines:
        if line[:1].strip():
            entries.append((line, []))
        elif entries:
            entries[-1][1].append(line)
    return entries


def named(head: str) -> str:
    """``name : text`` with the name as code."""
    entry = ENTRY.fullmatch(head)
    return f"``{entry['name']}``: {entry['text']}" if entry else head
