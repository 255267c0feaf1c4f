"""Faults of a file while it is read: the first ones kept, all of them counted."""

from __future__ import annotations

from typing import Any

from robots import InputError, InputErrors
from robots.errors import FAULTS_SHOWN


class Faults:
    """Collects faults; a file of millions of them costs neither memory nor time."""

    def __init__(self) -> None:
        self.errors: list[InputError] = []
        self.count = 0

    def __bool__(self) -> bool:
        return self.count > 0

    def add(self, what: str, **parts: Any) -> None:
        """One more; arguments as :class:`robots.InputError`."""
        self.count += 1
        if len(self.errors) < FAULTS_SHOWN:
            self.errors.append(InputError(what, **parts))

    def check(self, what: str) -> None:
        """Raise InputErrors if there are any; ``what``: the file."""
        if self:
            raise InputErrors(what, self.errors, self.count)
