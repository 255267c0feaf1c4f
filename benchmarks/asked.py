"""The command line of a benchmark: ``asked(__doc__, "folder", repeats=200, write=False)``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


def asked(doc: str | None, *paths: str, **options: Any) -> argparse.Namespace:
    """What the command line says: files and folders in order, then options by name.

    An option is False for a flag, a number or text that is its default, a type of what has no default, a tuple of
    choices, a list of choices that may be named again and again, or a dict as ``add_argument`` takes it.
    """
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in paths:
        parser.add_argument(name, type=Path)
    for name, value in options.items():
        if value is False:
            said: dict[str, Any] = {"action": "store_true"}
        elif isinstance(value, dict):
            said = value
        elif isinstance(value, type):
            said = {"type": value}
        elif isinstance(value, list):
            said = {"action": "append", "choices": value}
        else:
            said = {"choices": value} if isinstance(value, tuple) else {"type": type(value), "default": value}
        parser.add_argument(f"--{name.replace('_', '-')}", **said)
    return parser.parse_args()
