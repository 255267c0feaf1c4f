"""The page of two maps: the first one's own page with the second in it, on one scale, and their difference.

Nothing is drawn anew: a map's page holds its data as one block of JSON, and knows how to show another map beside it.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from robots import InputError
from robots.files.reading import parse_json, read_text

_DATA = re.compile(r'(<script type="application/json" id="data">)([^<]*)(</script>)')
# What a page must be able to do; those of older versions cannot.
_ABLE = "D.beside"
_TAKEN = ("kind", "n", "axes", "fields", "reached", "title", "warning")


def page_of_both(first: Path, second: Path, name: str) -> str | None:
    """The page of both maps; ``name`` of the second; None where one of the pages is of an older version."""
    text, other = (read_text(path, "map's page") for path in (first, second))
    a, own, b = _DATA.search(text), _data(text), _data(other)
    if a is None or own is None or b is None or _ABLE not in text:
        return None
    own["beside"] = {key: b[key] for key in _TAKEN if key in b} | {"name": name}
    # Inside a script element nothing but "<" can end it early.
    block = json.dumps(own, allow_nan=False).replace("<", "\\u003c").replace("&", "\\u0026")
    return text[: a.start(2)] + block + text[a.end(2) :]


def _data(text: str) -> dict[str, Any] | None:
    found = _DATA.search(text)
    try:
        content = None if found is None else parse_json(found[2], "map's page")
    except InputError:
        return None
    return content if isinstance(content, dict) and "fields" in content else None
