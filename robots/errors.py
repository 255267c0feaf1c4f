"""The one kind of error that reaches a user as a message instead of a traceback."""

from __future__ import annotations

from collections.abc import Sequence


class InputError(ValueError):
    """Bad input: what is wrong, which value, what is allowed, and what to do.

    Parameters
    ----------
    what : the thing at fault, with its place ("data.csv, row 3, column fz_N")
    value : the offending value as the user wrote it, if there is one
    allowed : the allowed range or form
    remedy : what the user can do about it
    """

    def __init__(
        self, what: str, *, value: object = None, allowed: str | None = None, remedy: str | None = None
    ) -> None:
        self.what, self.value, self.allowed, self.remedy = what, value, allowed, remedy
        text = what
        if value is not None:
            text += f": got {value!r}" if isinstance(value, str) else f": got {value}"
        if allowed is not None:
            text += f"; allowed: {allowed}"
        if remedy is not None:
            text += f". To fix it: {remedy}"
        super().__init__(text)


class InputErrors(InputError):  # noqa: N818 - the plural of InputError
    """Several faults found in one reading of the input, reported together."""

    def __init__(self, what: str, errors: Sequence[InputError]) -> None:
        self.errors = tuple(errors)
        lines = "\n".join(f"  - {error}" for error in errors)
        super().__init__(f"{what}: {len(self.errors)} problem(s)\n{lines}")
