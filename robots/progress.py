"""How long work says how far it is."""

from __future__ import annotations

from collections.abc import Callable

# Called with how much is done, and of how much.
Progress = Callable[[int, int], None]
# Called with what is being done, in words.
Messages = Callable[[str], None]


def report_progress(progress: Progress | None, done: int, total: int) -> None:
    """Say that ``done`` of ``total`` is done, where somebody listens."""
    if progress is not None:
        progress(done, total)
