"""Ctrl-C on the command line: stop at once and leave nothing half-written.

Python's own answer, a KeyboardInterrupt, unwinds through whatever is running. VTK prints it and goes on
with a broken picture, other libraries turn it into errors of their own, and some crash. So the process
tidies up and ends right where it is.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

EXIT_STOPPED = 1

_open: list[Callable[[], None]] = []
_deferred = _pending = False


@contextmanager
def stoppable() -> Iterator[None]:
    """Within this, Ctrl-C and SIGTERM end the process with exit code 1; what is ignored stays ignored."""
    usual = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
    if threading.current_thread() is not threading.main_thread():
        usual = {}  # only the main thread may set handlers
    mine = {number: before for number, before in usual.items() if signal.getsignal(number) is before}
    for number in mine:
        signal.signal(number, _stop)
    try:
        yield
    finally:
        for number, before in mine.items():
            signal.signal(number, before)


@contextmanager
def tidied_by(tidy: Callable[[], None]) -> Iterator[None]:
    """Call ``tidy`` if the process is stopped inside this."""
    _open.append(tidy)
    try:
        yield
    finally:
        _open.remove(tidy)


@contextmanager
def undisturbed() -> Iterator[None]:
    """Put off being stopped to the end of this; for what takes milliseconds and belongs together."""
    global _deferred
    _deferred = True
    try:
        yield
    finally:
        _deferred = False
        if _pending:
            _stop()


def _stop(signum: int = signal.SIGINT, frame: FrameType | None = None) -> None:
    global _pending
    if _deferred:
        _pending = True
        return
    for tidy in reversed(_open):
        tidy()
    # A progress bar hides the cursor. Not through Python's streams: they may be in the middle of a write.
    end = b"\x1b[?25h\n" if os.isatty(2) else b""
    os.write(2, end + b"stiffarm: stopped by the user; no half-written files are left\n")
    os._exit(EXIT_STOPPED)
