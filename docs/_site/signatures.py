"""Long signatures, a parameter a line, as plain elements: Sphinx writes lists of definitions that define nothing."""

from __future__ import annotations

import re
from typing import Any

_LIST = re.compile(r"<dl>\s*((?:<dd>(?:(?!<dd>|<dl>).)*?</dd>\s*)+)</dl>", re.DOTALL)
_OPENED_AND_CLOSED = {"<dd>": '<span class="sig-line">', "</dd>": "</span>"}


def without_lists(body: str) -> str:
    """A page's body, where a reader's screen reader no longer hears of lists in signatures."""

    def spans(found: re.Match[str]) -> str:
        return re.sub(r"</?dd>", lambda tag: _OPENED_AND_CLOSED[tag[0]], found[1])

    return _LIST.sub(spans, body)


def plain(_app: object, _page: str, _template: str, context: dict[str, Any], _doctree: object) -> None:
    """Called by Sphinx before a page is written."""
    if "body" in context:
        context["body"] = without_lists(context["body"])
