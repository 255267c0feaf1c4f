"""Where the code makes errors, read from its source: every place with its code and the words of the message."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from test_house import LAYERS, ROOT

# What makes an error, and functions that make one of what they are told; those that end in a name here do as well.
MAKERS = ("InputError", "StatementError", "PathError", "NotReadError", "SurfaceFault")
HELPERS = ("require_one_of", "require_positive", "require_at_least")
DEFINED = ROOT / "robots" / "errors.py"


@dataclass(frozen=True)
class Site:
    """One call that makes an error: where, its code and the words of the message.

    ``code``: None where it comes from whoever calls, or from the error that is passed on; "" where it is none of these.
    """

    place: str
    code: str | None
    words: str


def error_sites() -> list[Site]:
    """Of all packages; where errors are defined, none is made."""
    files = [path for package in LAYERS for path in sorted((ROOT / package).rglob("*.py")) if path != DEFINED]
    return [site for path in files for site in sites_of(path)]


def sites_of(path: Path, root: Path = ROOT) -> Iterator[Site]:
    """Of one file: calls that are told a code, and those that should be."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    for within, call in calls(tree, []):
        given = next((keyword.value for keyword in call.keywords if keyword.arg == "code"), None)
        name = call.func.id if isinstance(call.func, ast.Name) else getattr(call.func, "attr", "")
        if given is None and name not in MAKERS + HELPERS:
            continue
        place = f"{path.relative_to(root).as_posix()}:{call.lineno}"
        yield Site(place, code_of(given, within), "\0".join(words(node) for node in (call, *told(call, functions))))


def code_of(given: ast.expr | None, within: list[ast.FunctionDef]) -> str | None:
    """The code that a call is given; see :class:`Site`."""
    if isinstance(given, ast.Constant) and isinstance(given.value, str):
        return given.value
    if isinstance(given, ast.Attribute) and given.attr == "code":
        return None
    told = {argument.arg for function in within for argument in (*function.args.args, *function.args.kwonlyargs)}
    return None if isinstance(given, ast.Name) and given.id == "code" and "code" in told else ""


def told(call: ast.Call, functions: list[ast.FunctionDef]) -> list[ast.FunctionDef]:
    """Functions that make the words for a collector of faults: of each name given, the last one above the call."""
    names = {argument.id for argument in call.args if isinstance(argument, ast.Name)}
    above = {f.name: f for f in sorted(functions, key=lambda f: f.lineno) if f.name in names and f.lineno < call.lineno}
    return list(above.values())


def calls(node: ast.AST, within: list[ast.FunctionDef]) -> Iterator[tuple[list[ast.FunctionDef], ast.Call]]:
    """Calls with the functions that they stand in."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Call):
            yield within, child
        yield from calls(child, [*within, child] if isinstance(child, ast.FunctionDef) else within)


def words(call: ast.AST) -> str:
    """The constant parts of all arguments, apart from one another."""
    return "\0".join(n.value for n in ast.walk(call) if isinstance(n, ast.Constant) and isinstance(n.value, str))
