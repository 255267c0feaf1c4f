"""Ctrl-C on the command line: one line, exit code 130, and nothing half-written; SIGTERM likewise with 143.

Python's own answer, a KeyboardInterrupt, unwinds through whatever is running. VTK prints it and goes on
with a broken picture, modules that are being imported swallow it, other libraries turn it into errors of their own,
and some crash. So the process tidies up and ends right where it is.

This is loaded before anything else: it imports nothing that takes time.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
from contextlib import contextmanager, suppress

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType
    from typing import Any

    Handler = Callable[[int, FrameType | None], Any] | signal.Handlers

# As shells have it: 128 and the number of the signal.
EXIT_STOPPED = 128 + signal.SIGINT
_LINE = b"stiffarm: stopped by the user; no half-written files are left\n"
_USUAL: dict[signal.Signals, Handler] = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}

_deferred = False
_pending: int | None = None


def heed_for_life() -> None:
    """From now on Ctrl-C and SIGTERM end the process with one line; what is ignored stays ignored."""
    mine = _install()
    # Registered first, so it runs last: what follows is Python taking itself apart, with the command's work done.
    atexit.register(lambda: [signal.signal(number, signal.SIG_IGN) for number in mine])


@contextmanager
def stoppable() -> Iterator[None]:
    """Within this, the same where nobody has seen to it for the whole process."""
    mine = _install()
    try:
        yield
    finally:
        for number in mine:
            signal.signal(number, _USUAL[number])


@contextmanager
def undisturbed() -> Iterator[None]:
    """Put off being stopped to the end of this; for what takes milliseconds and belongs together."""
    global _deferred
    _deferred = True
    try:
        yield
    finally:
        _deferred = False
        if _pending is not None:
            _stop(_pending)


def _install() -> list[signal.Signals]:
    """Set the handlers that are still Python's own; returns which."""
    mine = [number for number, before in _USUAL.items() if signal.getsignal(number) is before]
    try:
        for number in mine:
            signal.signal(number, _stop)
    except ValueError:  # only the main thread may set handlers
        return []
    return mine


def _stop(signum: int, frame: FrameType | None = None) -> None:
    global _pending
    if _deferred:
        _pending = signum
        return
    for number in _USUAL:  # once is enough: no second line, and no tidying inside the tidying
        signal.signal(number, signal.SIG_IGN)
    # Whatever is to be put away was made after this module had been loaded.
    written = sys.modules.get("robots.files.written")
    tidy = getattr(written, "tidy", None)
    if tidy is not None:
        tidy()
    # A progress bar hides the cursor. Not through Python's streams: they may be in the middle of a write.
    with suppress(OSError):  # nobody may be listening
        os.write(2, (b"\x1b[?25h\n" if os.isatty(2) else b"") + _LINE)
    os._exit(128 + signum)
