"""A failing input made small: pieces are left out as long as it fails in the same way."""

from __future__ import annotations

import time
from collections.abc import Callable

MOST_TRIES, MOST_SECONDS = 600, 8.0


def shrunk(data: bytes, fails: Callable[[bytes], bool]) -> bytes:
    """The data with lines, then bytes left out, halves first; ``fails`` says whether it still does."""
    until, tries = time.monotonic() + MOST_SECONDS, 0

    def still(pieces: list[bytes]) -> bool:
        nonlocal tries
        tries += 1
        return tries <= MOST_TRIES and time.monotonic() < until and fails(b"".join(pieces))

    for pieces in (data.splitlines(keepends=True), None):
        if pieces is None:
            pieces = [data[i : i + 1] for i in range(len(data))]
        chunk = max(1, len(pieces) // 2)
        while pieces and tries <= MOST_TRIES:
            at = 0
            while at < len(pieces):
                fewer = pieces[:at] + pieces[at + chunk :]
                if still(fewer):
                    pieces = fewer
                else:
                    at += chunk
            if chunk == 1:
                break
            chunk //= 2
        data = b"".join(pieces)
    return data
