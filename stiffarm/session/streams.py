"""The process's standard streams, where one of them is closed or full.

A file that the program opens would take the number of a closed stream, and whatever a library prints would end up in
it. So closed ones are plugged before anything else is loaded; this imports nothing that takes time.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress

_NAMES = ("stdin", "stdout", "stderr")

CLOSED: set[str] = set()
"""Names of the streams that were closed when the program began."""


def plug() -> None:
    """Connect closed streams to the null device."""
    for number, name in enumerate(_NAMES):
        if getattr(sys, name) is None:
            CLOSED.add(name)
            silence(number)
            setattr(sys, name, open(number, "r" if number == 0 else "w", encoding="utf-8", closefd=False))  # noqa: SIM115


def silence(number: int) -> None:
    """Connect a stream to the null device, for what nobody can take any more."""
    null = os.open(os.devnull, os.O_RDWR)
    if null != number:
        os.dup2(null, number)
        os.close(null)


def tell(line: str) -> None:
    """One line on stderr where the libraries for that are not loaded, or nothing where it goes nowhere."""
    with suppress(OSError):
        os.write(2, f"{line}\n".encode(errors="backslashreplace"))
