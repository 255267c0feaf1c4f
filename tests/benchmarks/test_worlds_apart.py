"""Foreign worlds share no code with the program, nor with one another: what their files import, by their text."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
WORLDS = ROOT / "benchmarks" / "worlds"
OURS = {"robots", "meshes", "fem", "doe", "surrogate", "machining", "rehearsal", "stiffarm", "tests"}
# What worlds share is theirs alone: folders and texts, no physics.
FILES = sorted(WORLDS.rglob("*.py"))
# Programs of other benchmarks, which the tests' settings put on the path by their bare names.
BESIDE = {p.stem for p in (ROOT / "benchmarks").glob("*/*.py")} | {p.stem for p in (ROOT / "benchmarks").glob("*.py")}


def imported(tree: ast.AST, place: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    """Modules that a file at ``place`` (its package as parts, from the repository's root) imports, as parts."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (tuple(alias.name.split(".")) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = place[: len(place) + 1 - node.level] if node.level else ()
            base = (*above, *(node.module or "").split(".")) if node.module else above
            yield from ((*base, alias.name) for alias in node.names)
        elif isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in {"import_module", "__import__"}:
            first = node.args[0] if node.args else None
            known = isinstance(first, ast.Constant) and isinstance(first.value, str)
            yield tuple(ast.literal_eval(first).split(".")) if known and first else ("what", "nobody", "knows")


def foreign_to(parts: tuple[str, ...], world: str) -> bool:
    """Whether an import leaves the world: to our packages, to another world, or to other benchmarks."""
    if parts[:1] == ("worlds",):
        parts = ("benchmarks", *parts)
    if parts[:1] == ("benchmarks",):
        return parts[:3] not in {("benchmarks", "worlds", world), ("benchmarks", "worlds", "shared")}
    return parts[0] in OURS | BESIDE - {"__init__"} or parts == ("what", "nobody", "knows")


def strangers(text: str, world: str, place: tuple[str, ...]) -> list[str]:
    return [".".join(parts) for parts in imported(ast.parse(text), place) if foreign_to(parts, world)]


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(WORLDS)))
def test_a_world_imports_neither_us_nor_another_world(path: Path) -> None:
    place = path.parent.relative_to(ROOT).parts
    assert strangers(path.read_text(encoding="utf-8"), "".join(place[2:3]), place) == []


def test_worlds_are_there() -> None:
    assert FILES, WORLDS


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("import numpy as np", []),
        ("from . import laws", []),
        ("from .laws import drift", []),
        ("from benchmarks.worlds.ours.laws import drift", []),
        ("from worlds.ours import laws", []),
        ("import fem", ["fem"]),
        ("from doe.tables import reading", ["doe.tables.reading"]),
        ("from ..shared import write_set", []),
        ("from .. import shared", []),
        ("from ..other import laws", ["benchmarks.worlds.other.laws"]),
        ("from .. import other", ["benchmarks.worlds.other"]),
        ("from benchmarks.worlds.other import laws", ["benchmarks.worlds.other.laws"]),
        ("from worlds import other", ["worlds.other"]),
        ("import interval_coverage", ["interval_coverage"]),
        ("def f():\n    from stiffarm import load", ["stiffarm.load"]),
        ("importlib.import_module('robots.arrays')", ["robots.arrays"]),
        ("importlib.import_module(name)", ["what.nobody.knows"]),
    ],
)
def test_the_scan_sees_it(text: str, found: list[str]) -> None:
    assert strangers(text, "ours", ("benchmarks", "worlds", "ours")) == found
