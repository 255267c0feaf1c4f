"""Where the code makes errors, read from its source: every place with the words that stand in the message."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from test_house import LAYERS, ROOT

# What makes an error, and functions that make one of what they are told.
CLASSES = {"InputError", "StatementError", "ArcError", "PathError", "NotReadError", "SurfaceFault"}
WORDING = {"require_one_of", "require_positive", "require_at_least"}
COLLECTORS = {"add": ("faults",), "each": ("faults",), "say": ("faults",), "error": ("recorder",)}
# Places that only pass on what others tell them; what they are told is counted where it is told.
PASSING = {"robots.errors", "robots.faults", "machining.toolpaths.recorder:Recorder.error"}


@dataclass(frozen=True)
class Site:
    """One place that makes errors: ``module:function``, the line, and the words of the message."""

    place: str
    line: int
    words: str


def error_sites() -> list[Site]:
    """Of all packages."""
    found: list[Site] = []
    for package in LAYERS:
        for path in sorted((ROOT / package).rglob("*.py")):
            found += sites_of(path)
    return found


def sites_of(path: Path, root: Path = ROOT) -> list[Site]:
    """Of one file."""
    module = ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")
    tree = ast.parse(path.read_text(encoding="utf-8"))
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    return [
        Site(f"{module}:{function}", call.lineno, "\0".join(words(node) for node in (call, *told(call, functions))))
        for function, call in calls(tree, [])
        if makes_an_error(call, module) and not {module, f"{module}:{function}"} & PASSING
    ]


def told(call: ast.Call, functions: list[ast.FunctionDef]) -> list[ast.FunctionDef]:
    """Functions that make the words for a collector: of each name that it is given, the last one above it."""
    if not isinstance(call.func, ast.Attribute) or call.func.attr != "each":
        return []
    names = {argument.id for argument in call.args if isinstance(argument, ast.Name)}
    above = {f.name: f for f in sorted(functions, key=lambda f: f.lineno) if f.name in names and f.lineno < call.lineno}
    return list(above.values())


def calls(node: ast.AST, within: list[str]) -> Iterator[tuple[str, ast.Call]]:
    """Calls with the function that they stand in."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.ClassDef):
            yield from calls(child, [*within, child.name])
            continue
        if isinstance(child, ast.Call):
            yield ".".join(within), child
        yield from calls(child, within)


def makes_an_error(call: ast.Call, module: str) -> bool:
    """Whether it makes an error of its own: one that is passed on carries its place along."""
    if any(keyword.arg == "site" for keyword in call.keywords):
        return False
    if isinstance(call.func, ast.Name):
        return call.func.id in CLASSES | WORDING
    if not isinstance(call.func, ast.Attribute):
        return False
    if module == "machining.toolpaths.recorder" and call.func.attr == "error":
        return True
    return call.func.attr in COLLECTORS and ast.unparse(call.func.value).endswith(COLLECTORS[call.func.attr])


def words(call: ast.AST) -> str:
    """The constant parts of all arguments, apart from one another."""
    return "\0".join(n.value for n in ast.walk(call) if isinstance(n, ast.Constant) and isinstance(n.value, str))
