"""What is wrong at a point of a path, with the point, so that a caller can name the line that it comes from."""

from __future__ import annotations

from robots import InputError


class PathError(InputError):
    """Bad input at path point ``point``; else as :class:`robots.InputError`."""

    def __init__(
        self,
        point: int,
        what: str,
        *,
        value: object = None,
        allowed: str | None = None,
        remedy: str | None = None,
    ) -> None:
        super().__init__(what, value=value, allowed=allowed, remedy=remedy)
        self.point = point

    def at(self, point: int, where: str) -> PathError:
        """The same at another point of a finer path, or under another name."""
        return PathError(point, f"{where}: {self.what}", value=self.value, allowed=self.allowed, remedy=self.remedy)
