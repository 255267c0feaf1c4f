"""A hash of the program itself: what a result kept between runs depends on beside its input."""

from __future__ import annotations

import ast
import hashlib
import importlib.util
from functools import cache
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

LIBRARIES = ("numpy", "scipy", "scikit-fem")


@cache
def formulation_hash(*roots: str) -> str | None:
    """SHA-256 of the source of modules, of those they import from their own packages, and of the libraries' versions.

    None where a source cannot be read, as in a frozen program.
    """
    digest = hashlib.sha256()
    try:
        for root in roots:
            for name, source in sorted(_sources(root).items()):
                add_to(digest, f"{name}\n{source}")
    except (OSError, SyntaxError):
        return None
    for library in LIBRARIES:
        add_to(digest, f"{library} {version(library)}")
    return str(digest.hexdigest())


def _sources(root: str) -> dict[str, str]:
    """Source of a module and of those that it imports from its own package, at any depth."""
    package = root.partition(".")[0]
    found: dict[str, str] = {}
    waiting = [root]
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        found[name] = _source(name)
        waiting += _imported(found[name], package)
    return found


def _imported(source: str, package: str) -> list[str]:
    """Names of the package's modules that a source imports, folders within it included."""
    names: list[str] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module is not None and node.module.split(".")[0] == package:
            inside = [f"{node.module}.{alias.name}" for alias in node.names if _is_package(node.module)]
            names += [node.module, *(name for name in inside if importlib.util.find_spec(name) is not None)]
    return [name for name in names if name.startswith(f"{package}.")]


def _is_package(name: str) -> bool:
    spec = importlib.util.find_spec(name)
    return spec is not None and spec.submodule_search_locations is not None


def _source(name: str) -> str:
    spec = importlib.util.find_spec(name)
    get_source = getattr(None if spec is None else spec.loader, "get_source", None)
    text = None if get_source is None else get_source(name)
    if not isinstance(text, str):
        raise OSError(f"{name} has no source")
    return text


def add_to(digest: Any, content: str | NDArray[np.generic]) -> None:
    """Feed a text, or an array with its type and shape, so that no two contents run into one another."""
    if isinstance(content, str):
        data = content.encode()
        digest.update(f"text {len(data)}\n".encode() + data)
        return
    kind = np.float64 if np.issubdtype(content.dtype, np.floating) else np.int64
    array = np.ascontiguousarray(content, dtype=np.dtype(kind).newbyteorder("<"))
    digest.update(f"array {array.dtype.str} {array.shape}\n".encode() + array.tobytes())
