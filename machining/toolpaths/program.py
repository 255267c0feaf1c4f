"""A program of any language while it is read: what becomes of a statement that cannot be read, and arcs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar

from numpy.typing import ArrayLike

from machining.toolpaths.arcs import arc_points
from machining.toolpaths.options import ReadOptions
from machining.toolpaths.recorder import Recorder, StatementError, Vector
from robots.arrays import Array


class Program:
    """Options, recorder, line that is read, tool axis, and whether the recorder lacks a change of feed or tool."""

    def __init__(self, path: Path, options: ReadOptions) -> None:
        self.options, self.recorder = options, Recorder(path.name, options.max_moves, options.retract)
        self.line, self.dirty = 0, True
        self.axis: Vector = (0.0, 0.0, 1.0)

    # Words that are certain to change nothing about path and feed, each with the reason.
    harmless: ClassVar[Mapping[str, str]] = MappingProxyType({})

    def changes_nothing(self, word: str, text: str = "") -> bool:
        """Whether a word is harmless, or the caller knows it to be on the machine at hand: it is kept as an event."""
        if word in self.harmless:
            self.recorder.event(self.line, word, text or self.harmless[word])
        elif word in self.options.ignore:
            self.recorder.event(self.line, word, text, note=f"{word} is left out, as asked", code="W041")
        return word in self.harmless or word in self.options.ignore

    def refuse(self, fault: StatementError, statement: str = "") -> None:
        """Keep a fault of the line that is read."""
        self.recorder.error(
            self.line,
            fault.what,
            value=statement.strip() or None,
            allowed=fault.allowed,
            remedy=fault.remedy,
            code=fault.code,
        )

    def left_out(self, word: str, fault: StatementError, text: str = "") -> None:
        """Refuse a word that is not read; where the caller leaves such words out, keep it as an event with a note."""
        if self.options.unknown_motion == "error":
            raise fault
        self.recorder.event(self.line, word, text, note=f"{word} left out, as asked", code="W041")

    def chords(self, start: ArrayLike, end: ArrayLike, center: Array, axis: Array, **more: Any) -> tuple[Array, Array]:
        """Shares and points of an arc within the tolerances asked for; see :func:`arc_points`."""
        return arc_points(
            start,
            end,
            center,
            axis,
            chord_tolerance=self.options.chord_tolerance,
            arc_tolerance=self.options.arc_tolerance,
            limit=self.options.max_moves,
            **more,
        )
