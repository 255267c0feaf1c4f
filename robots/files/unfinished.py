"""What is to be put away where the process is stopped in the middle: drafts of files, folders of its own.

Who makes such a thing says here how it goes; who stops the process (Ctrl-C) calls :func:`tidy`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

_open: list[Callable[[], None]] = []


@contextmanager
def tidied_by(put_away: Callable[[], None]) -> Iterator[None]:
    """Have ``put_away`` called if the process is stopped inside this."""
    _open.append(put_away)
    try:
        yield
    finally:
        _open.remove(put_away)


def tidy() -> None:
    """Put everything away, the latest first; what fails keeps nothing else from going."""
    for put_away in reversed(_open):
        try:
            put_away()
        except Exception:  # noqa: S112 - the process ends next, and nobody is left to ask
            continue
