"""Entry point: ``python -m stiffarm``.

The libraries take a second or two to load. Python would answer a Ctrl-C in that time with the traceback of
whatever was being imported, so it is caught before the first of them.
"""

from __future__ import annotations

import os
import signal
from types import FrameType


def main() -> None:
    """Load the command line and run it."""
    usual = signal.getsignal(signal.SIGINT) is signal.default_int_handler  # not where SIGINT is ignored
    if usual:
        signal.signal(signal.SIGINT, _stop)
    from stiffarm.cli import app

    if usual:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    app(prog_name="stiffarm")


def _stop(signum: int, frame: FrameType | None) -> None:
    # Nothing is open yet. Raising would go through half-made modules, and some of them swallow it.
    os.write(2, b"stiffarm: stopped by the user\n")
    os._exit(1)


if __name__ == "__main__":
    main()
