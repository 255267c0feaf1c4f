"""The reference of the Python packages: a page for each, over the names that it makes public."""

from __future__ import annotations

import importlib
import inspect
import typing
from collections.abc import Collection
from pathlib import Path
from typing import Any

import pages

# The face first; below it, from the shop floor down to the description of robots.
PACKAGES = ("stiffarm", "machining", "surrogate", "doe", "fem", "meshes", "robots")
INTRODUCTION = """# Python

`import stiffarm` is the face: the steps of the command line as functions
([stiffarm from Python](../../start/python.md)).
The packages below it stay importable for those who extend them. Arrays are in SI units: m, N, rad, N m/rad; a batch of
poses is `(n, dof)`, a wrench `(n, 6)` in the order force, moment.
"""


def write(folder: Path) -> None:
    """Write ``index.md`` and a page for each package into the folder."""
    written = {f"{name}.md": page(name) for name in PACKAGES}
    rows = [f"| [`{name}`]({name}.md) | {first_line(importlib.import_module(name))} |" for name in PACKAGES]
    table = ["| package | what it owns |", "|---|---|", *rows, ""]
    written["index.md"] = "\n".join([INTRODUCTION, *table, *pages.hidden_toctree(list(PACKAGES))])
    pages.write_all(folder, written)


def page(package: str) -> str:
    """One package: what it owns, then its public names, grouped by the room that they live in."""
    module = importlib.import_module(package)
    rooms: dict[str, list[str]] = {}
    lent: dict[str, list[str]] = {}
    for name in sorted(getattr(module, "__all__", ()), key=str.lower):
        owner = str(getattr(getattr(module, name), "__module__", package)).split(".")[0]
        if owner in PACKAGES and owner != package:
            lent.setdefault(owner, []).append(name)
            continue
        rooms.setdefault(room(package, getattr(module, name)), []).append(name)
    lines = [f"# {package}", "", first_line(module), ""]
    for where in sorted(rooms):
        lines += [f"## {where}", ""] if where != package else []
        for name in rooms[where]:
            lines += entry(package, name, getattr(module, name))
    lines += [
        f"Also here: {', '.join(f'`{name}`' for name in borrowed)}, from [`{top}`]({top}.md)."
        for top in PACKAGES
        if (borrowed := lent.get(top))
    ]
    return "\n".join(lines)


def room(package: str, value: Any) -> str:
    """``machining.posture`` for what is defined below it; the package itself for the rest."""
    parts = str(getattr(value, "__module__", package)).split(".")
    if parts[0] not in PACKAGES:
        return package
    return ".".join(parts[:2])


def entry(package: str, name: str, value: Any) -> list[str]:
    """What autodoc is to show of one name."""
    fence = ["````{eval-rst}"]
    if inspect.isclass(value):
        fence += [f".. autoclass:: {package}.{name}", "   :members:", ""]
    elif inspect.isroutine(value):
        fence += [f".. autofunction:: {package}.{name}", ""]
    else:
        fence += [f".. py:data:: {package}.{name}", "", f"   {values(value)}", ""]
    return [*fence, "````", ""]


def values(value: Any) -> str:
    """What a table or a choice of names consists of."""
    names = typing.get_args(value) or (value if isinstance(value, Collection) and not isinstance(value, str) else ())
    return f"One of: {', '.join(f'``{name}``' for name in names)}." if names else f"``{value!r}``."


def first_line(module: Any) -> str:
    """The first line of its docstring."""
    return (inspect.getdoc(module) or "").split("\n")[0]
