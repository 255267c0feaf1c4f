"""What only some machines have: independent codes, optional packages, programs. Where one is missing, a test skips.

Some packages are installed and cannot be loaded, because a system library is missing; only that skips too. What fails
once it is loaded fails the test.
"""

from __future__ import annotations

import importlib
import shutil
from functools import cache
from types import ModuleType
from typing import Any

import pytest


@cache
def _loaded(name: str) -> ModuleType | str:
    """The module, or why it cannot be loaded."""
    try:
        return importlib.import_module(name)
    # As met: libraries that are not there (ImportError, OSError), what packages make of it, and giving up altogether.
    except (ImportError, OSError, RuntimeError, SystemExit) as error:
        first: BaseException = error
        while (earlier := first.__cause__ or first.__context__) is not None:
            first = earlier
        return f"{name} cannot be loaded: {first}"


def load(name: str) -> Any:
    """The module; the test or, on top of a file, all its tests skip where it cannot be loaded."""
    found = _loaded(name)
    if isinstance(found, str):
        pytest.skip(found, allow_module_level=True)
    return found


def program(*names: str) -> str | None:
    """Where the first of these programs is."""
    return next(filter(None, map(shutil.which, names)), None)


def needs(*names: str) -> pytest.MarkDecorator:
    """Skip where none of these programs is installed."""
    return pytest.mark.skipif(program(*names) is None, reason=f"no {' or '.join(names)} here")
