"""Names of a package that are imported when they are first asked for, so that a command loads only what it uses.

A package lists its names as ordinary imports under ``if TYPE_CHECKING:``, where type checkers, editors and the import
contract read them, and ends with ``__getattr__ = lazily(__name__)`` (PEP 562).
"""

from __future__ import annotations

import ast
import importlib
import sys
from collections.abc import Callable
from typing import Any

from robots.errors import InputError


def lazily(package: str) -> Callable[[str], Any]:
    """The ``__getattr__`` of a package: imports the module that its source names for a public name."""
    homes: dict[str, str] = {}

    def get(name: str) -> Any:
        module = sys.modules[package]
        if not homes:
            homes.update(_homes(package))
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(importlib.import_module(homes[name]), name)
        setattr(module, name, value)
        return value

    return get


def _homes(package: str) -> dict[str, str]:
    """Name -> module of the imports that only type checkers run."""
    loader = getattr(sys.modules[package].__spec__, "loader", None)
    tree = ast.parse("" if loader is None else loader.get_source(package))
    guarded = [node.body for node in tree.body if isinstance(node, ast.If)]
    imports = [node for body in guarded for node in body if isinstance(node, ast.ImportFrom)]
    return {alias.name: str(node.module) for node in imports for alias in node.names}


def optional(package: str, what: str, extra: str) -> Any:
    """A package that not every installation has.

    Raises
    ------
    InputError
        It is missing, or something that it needs; ``what`` needs it, and stiffarm's ``extra`` installs it.
    """
    try:
        return importlib.import_module(package)
    except ImportError as error:
        raise InputError(
            f"{what} need the package {package} ({error})",
            code="F013",
            remedy=f"install it: pip install 'stiffarm[{extra}]'",
        ) from error
