"""What is wrong at a point of a path, with the point, so that a caller can name the line that it comes from."""

from __future__ import annotations

import numpy as np

from robots import InputError
from robots.arrays import Integers


class PathError(InputError):
    """Bad input at path points: ``points`` (k,), the first is ``point``; else as :class:`robots.InputError`."""

    def __init__(
        self,
        points: int | Integers,
        what: str,
        *,
        code: str,
        value: object = None,
        allowed: str | None = None,
        remedy: str | None = None,
    ) -> None:
        super().__init__(what, code=code, value=value, allowed=allowed, remedy=remedy)
        self.points = np.atleast_1d(np.asarray(points, dtype=np.int64))

    @property
    def point(self) -> int:
        """The first point."""
        return int(self.points[0])

    def at(self, points: int | Integers, where: str) -> PathError:
        """The same at other points, of a finer path or under another name."""
        what = f"{where}: {self.what}"
        return PathError(points, what, code=self.code, value=self.value, allowed=self.allowed, remedy=self.remedy)
