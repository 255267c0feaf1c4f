"""What only some machines have: independent codes, optional packages, programs. Where one is missing, a test skips.

Some packages are installed and cannot be loaded, because a system library is missing; only that skips too. What fails
once it is loaded fails the test.
"""

from __future__ import annotations

import importlib
import os
import shutil
import subprocess
import sys
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


@cache
def _loads_apart(name: str) -> str:
    """Why a module cannot be loaded in a process of its own; "" if it can."""
    command = [sys.executable, __file__, name]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)  # noqa: S603 - ours
    return "" if done.returncode == 0 else (done.stdout or done.stderr or f"ends with {done.returncode}").strip()


def load_apart(name: str) -> None:
    """As ``load``, for what our code runs in a process of its own because it would spoil ours."""
    if why := _loads_apart(name):
        pytest.skip(why, allow_module_level=True)


def program(*names: str) -> str | None:
    """Where the first of these programs is."""
    return next(filter(None, map(shutil.which, names)), None)


def needs(*names: str) -> pytest.MarkDecorator:
    """Skip where none of these programs is installed."""
    return pytest.mark.skipif(program(*names) is None, reason=f"no {' or '.join(names)} here")


if __name__ == "__main__":
    outcome = _loaded(sys.argv[1])
    if isinstance(outcome, str):
        print(outcome)
        sys.exit(1)
    os._exit(0)  # Some crash on their way out.
