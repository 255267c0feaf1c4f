"""The loop: a line in, a line out, until the input ends or a request says so."""

from __future__ import annotations

from collections.abc import Callable
from typing import BinaryIO

from machining.service.session import Session
from machining.service.wire import LONGEST_LINE, NotReadError, error_of, write_line


def serve(session: Session, requests: BinaryIO, write: Callable[[bytes], None], longest: int = LONGEST_LINE) -> None:
    """Answer each line of ``requests`` by one call of ``write``; ends at the end of input or at ``quit``.

    A last line without its end counts as one. Lines of more than ``longest`` bytes are passed over without being kept.
    """
    while not session.stopped:
        line = requests.readline(longest + 1)
        if not line:
            return
        if len(line) > longest and not line.endswith(b"\n"):
            while line and not line.endswith(b"\n"):
                line = requests.readline(longest)
            write(_too_long(longest))
            continue
        write(session.answer(line))


def _too_long(longest: int) -> bytes:
    error = NotReadError("line", value="too long", allowed=f"at most {longest} bytes", remedy="ask in several requests")
    return write_line({"id": None, "ok": False, "error": error_of(error)})
