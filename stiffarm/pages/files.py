"""What the files in a folder of results are, so that pages can lead to each of them."""

from __future__ import annotations

import re
from collections.abc import Collection
from fnmatch import fnmatch
from typing import Final
from urllib.parse import quote

from markupsafe import Markup, escape

# Written by every command once all else is.
LAST: Final = "run.json"
# Patterns of names, the first that fits says what a file is.
_WHAT: Final = (
    ("index.html", "start here: links to everything"),
    ("*report.html", "the report"),
    ("*map.html", "the map: turn it, cut it, pick points"),
    ("card.html", "the result on one A4 page, to print"),
    ("*missing_effect.html", "what leaving the missing effect out costs, as a map"),
    ("*replay.html", "the program as the robot runs it"),
    ("*axes.html", "the axes map: drag the course, and the arm follows"),
    ("*sheet*.html", "sheet to fill in at the robot"),
    ("positions_sheet.csv", "sheet to fill in at the robot"),
    ("*.html", "page"),
    ("model.toml", "the model, for every other command"),
    ("*model.toml", "the model that goes with it"),
    ("models/*.toml", "one of the calibrated models"),
    ("*.urdf", "the calibrated arm as URDF"),
    ("controller.json", "values for the controller: zeros, frames, tool points"),
    ("surrogate.json", "the surrogate, for `query` and `map`"),
    ("fit.json", "the errors of every basis tried"),
    ("*surrogate*.json", "a surrogate, for `query` and `map`"),
    ("*run.json", "command, versions, hashes and timings"),
    ("*.json", "the figures, for other programs"),
    ("*next_readings.csv", "the sheet of set-ups to measure next"),
    ("*parameters.csv", "the parameters with their intervals"),
    ("*.csv", "table"),
    ("*.xlsx", "table"),
    ("*.vt[ikpru]", "for ParaView"),
    ("*.png", "picture"),
    ("*.npz", "arrays"),
    ("*.npy", "arrays"),
    ("*.onnx", "the surrogate as ONNX"),
    ("*.h", "the surrogate as a C header"),
    ("*.py", "the surrogate as Python"),
    ("*.js", "the surrogate as JavaScript"),
    ("*.toml", "model or settings"),
)
_NAME: Final = re.compile(r"[A-Za-z0-9_][\w.\-/]*(?:\.[A-Za-z]\w{0,4}|/)")


def what_it_is(name: str) -> str:
    """One phrase on a file of results."""
    return next((words for pattern, words in _WHAT if fnmatch(name, pattern)), "file")


def listed(files: Collection[str]) -> list[tuple[str, str]]:
    """Every file that a reader may open by itself, with what it is: pages first, pictures of pages left out."""
    order = [pattern for pattern, _ in _WHAT]

    def place(name: str) -> tuple[int, int, str]:
        rank = next((k for k, pattern in enumerate(order) if fnmatch(name, pattern)), len(order))
        return name.count("/"), rank, name

    shown = [name for name in files if "figures/" not in name]
    return [(name, what_it_is(name)) for name in sorted(shown, key=place)]


def linked(text: str, files: Collection[str]) -> Markup:
    """A text for HTML, escaped, in which each of these files is a link to itself, and a folder to its page."""
    out, last = Markup(), 0
    for found in _NAME.finditer(text):
        name = found[0].rstrip(".")
        target = target_of(name, files)
        if target is None:
            continue
        start, end = found.start(), found.start() + len(name)
        link = Markup('<a href="{}">{}</a>').format(quote(target), name)
        out, last = out + escape(text[last:start]) + link, end
    return out + escape(text[last:])


def target_of(name: str, files: Collection[str]) -> str | None:
    """Where a link on a file's or folder's name leads; None where it is no file of the folder."""
    if name in files:
        return name
    if name.endswith("/") and any(one.startswith(name) for one in files):
        page = f"{name}report.html"
        return page if page in files else name
    return None
