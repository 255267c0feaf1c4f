"""Frames of an APT file: in which one its coordinates are."""

from __future__ import annotations

import numpy as np

from machining.toolpaths.apt.words import WordError, as_number, numbers
from machining.toolpaths.recorder import Vector

# Numbers of each word; MCSYS has words between them.
COUNTS = {"MSYS": 9, "MCSYS": 9, "CSYS": 12, "TRANS": 3, "ORIGIN": 3}
NONE = {
    "MSYS": (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0),
    "CSYS": (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0),
    "TRANS": (0.0, 0.0, 0.0),
    "ORIGIN": (0.0, 0.0, 0.0),
}


class Frames:
    """Frame words in force, and those that motion happened in.

    ``MSYS/x,y,z,xx,xy,xz,yx,yy,yz``: origin, x and y axis of the machine coordinate system in absolute coordinates;
    points of the file are in it. ``CSYS/`` (SolidWorks CAM, Creo): a 3 x 4 matrix. ``TRANS/`` is added by
    postprocessors, ``ORIGIN/`` taken away.
    """

    def __init__(self, mode: str) -> None:
        self.mode = mode
        self.words: dict[str, tuple[float, ...]] = {}
        self.used: dict[str, tuple[float, ...]] | None = None
        self.told = False
        self.R, self.t = np.eye(3), np.zeros(3)

    @property
    def moves(self) -> bool:
        """Whether coordinates differ from those written."""
        return self.mode == "absolute"

    def set(self, word: str, parts: list[str], scale: float) -> None:
        """Take a frame word.

        Raises
        ------
        WordError
            Numbers missing, axes that are not at right angles, a word whose sense is not known with "absolute".
        """
        if word == "MCSYS":
            parts, word = _mcsys(parts), "MSYS"
        values = numbers(parts, (COUNTS[word],))
        if self.mode == "absolute" and word == "CSYS":
            raise WordError("CSYS cannot be applied: vendors differ in its direction", "frames='written'")
        self.words = {key: v for key, v in self.words.items() if key != word}
        if word == "MSYS":
            x, y = np.array(values[3:6]), np.array(values[6:9])
            if abs(np.linalg.norm(x) - 1.0) > 1e-3 or abs(np.linalg.norm(y) - 1.0) > 1e-3 or abs(x @ y) > 1e-3:
                raise WordError("axes of MSYS that are not at right angles and of length 1", "two unit vectors")
        if any(abs(v - w) > 1e-9 for v, w in zip(values, NONE[word], strict=True)):
            self.words[word] = tuple(values)
        if self.mode == "absolute":
            self._absolute(scale)

    def _absolute(self, scale: float) -> None:
        system = np.array(self.words.get("MSYS", NONE["MSYS"]))
        x, y = system[3:6], system[6:9]
        x = x / np.linalg.norm(x)
        y = y - (y @ x) * x
        y /= np.linalg.norm(y)
        self.R = np.column_stack([x, y, np.cross(x, y)])
        shift = np.array(self.words.get("TRANS", NONE["TRANS"])) - np.array(self.words.get("ORIGIN", NONE["ORIGIN"]))
        self.t = (system[:3] + self.R @ shift) * scale

    def use(self) -> str | None:
        """Motion happens now: None, or the frame that is not the first one, once."""
        if self.used is None:
            self.used = self.words
        elif self.mode == "one" and self.words != self.used and not self.told:
            self.told = True
            return "; ".join(f"{word}/{','.join(map(str, v))}" for word, v in self.words.items()) or "none"
        return None

    def point(self, point: Vector) -> Vector:
        """Point m as asked for."""
        if not self.moves:
            return point
        x, y, z = (self.R @ np.array(point) + self.t).tolist()
        return x, y, z

    def direction(self, direction: Vector) -> Vector:
        """Direction as asked for."""
        if not self.moves:
            return direction
        x, y, z = (self.R @ np.array(direction)).tolist()
        return x, y, z


def _mcsys(parts: list[str]) -> list[str]:
    """Numbers of ``MCSYS/NUM,n,POINT,x,y,z,VECTOR,x,y,z,VECTOR,x,y,z`` without the number of the system."""
    if parts[:1] == ["NUM"]:
        parts = parts[2:]
    return [part for part in parts if as_number(part) is not None]
