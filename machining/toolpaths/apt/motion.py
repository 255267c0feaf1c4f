"""Words of APT files that move the tool, or prepare a motion."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from machining.toolpaths.apt.arcs import ArcWord, circle, movarc, tlon
from machining.toolpaths.apt.cycles import cycle
from machining.toolpaths.apt.state import AptState, Handler
from machining.toolpaths.apt.words import Statement
from machining.toolpaths.arcs import between
from machining.toolpaths.cycles import Cycle, drill
from machining.toolpaths.motions import Feed
from machining.toolpaths.recorder import StatementError, Vector


class AptMotion(AptState):
    """Motion words on top of the state words."""

    def motion_words(self) -> dict[str, Handler]:
        """Handlers by word."""
        return {
            "GOTO": self._goto,
            "FROM": self._from,
            "GOHOME": self._gohome,
            "GODLTA": self._godlta,
            "RAPID": self._rapid,
            "RETRCT": self._leave,
            "CIRCLE": lambda s: self._open(circle(s.parts, self.scale, self.options.circle_axis)),
            "MOVARC": lambda s: self._open(movarc(s.parts, self.scale)),
            "INDIRV": self._indirv,
            "TLON,GOFWD": self._tlon,
            "CYCLE": self._cycle,
        }

    def _to(self, point: Vector) -> None:
        if self.dirty:
            self._commit()
        self.recorder.move(self.line, point, self.axis, self.rapid)
        self.here, self.rapid = point, False

    def _target(self, s: Statement) -> Vector:
        values = s.numbers(3, 6) if self.arc is None else s.numbers(3, 6, *range(9, 400, 3))
        if len(values) > 6:
            # Creo: all points of an arc in one statement; the last one ends it.
            values = values[-3:]
        if len(values) == 6:
            self.axis = self.frames.direction((values[3], values[4], values[5]))
        return self.frames.point((values[0] * self.scale, values[1] * self.scale, values[2] * self.scale))

    def _goto(self, s: Statement) -> None:
        before = self.axis
        point = self._target(s)
        if self.cycle is not None:
            self._drill(self.cycle, point)
        elif self.arc is not None:
            self._along(self.arc, point, before)
        else:
            self._to(point)

    def _along(self, arc: ArcWord, end: Vector, before: Vector) -> None:
        self.arc = None
        if self.here is None:
            raise StatementError("an arc without a point before it", "GOTO or FROM before the arc", code="P011")
        here, self.here = self.here, end
        arc, remark = arc.settled(np.array(here), np.array(end))
        if remark:
            self.recorder.note(self.line, remark)
        fraction, points = self.chords(here, end, arc.center, arc.axis, radius=arc.radius, turns=arc.turns)
        if self.dirty:
            self._commit()
        self.recorder.moves(self.line, points, between(before, self.axis, fraction), self.rapid)
        self.rapid = False

    def _from(self, s: Statement) -> None:
        point = self._target(s)
        self.rapid = True
        self._to(point)

    def _gohome(self, s: Statement) -> None:
        self._leave(s)
        if s.rest.strip():
            self.here = self._target(s)
            if len(self.recorder):
                self.recorder.across(self.line, self.here, self.axis)

    def _leave(self, s: Statement) -> None:
        """GOHOME, RETRCT: the tool goes to a place of the machine; data of a tool given before are the next move's."""
        self.recorder.event(self.line, s.word, s.rest)
        if len(self.recorder):
            loaded = self.loaded
            if self.dirty:
                self._commit()
            self.loaded = loaded
            self.recorder.away(self.line, s.word)
        self.here, self.rapid = None, False

    def _godlta(self, s: Statement) -> None:
        values = [v * self.scale for v in s.numbers(1, 3)]
        if self.here is None:
            raise StatementError("GODLTA without a point before it", "GOTO or FROM before it", code="P011")
        if len(values) == 1:
            length = math.sqrt(sum(v * v for v in self.axis)) or 1.0
            step = [values[0] * v / length for v in self.axis]
        else:
            step = list(self.frames.direction((values[0], values[1], values[2])))
        self._to((self.here[0] + step[0], self.here[1] + step[1], self.here[2] + step[2]))

    def _rapid(self, s: Statement) -> None:
        self.rapid = True

    def _drill(self, work: Cycle, point: Vector) -> None:
        if self.dirty:
            self._commit()

        def state(own: Feed | None, reverse: bool) -> None:
            sign = self.spindle.signed
            feed = self.feed if own is None else own
            self.recorder.state(feed.speed(sign), -sign if reverse else sign, self.tool, self.operation)

        self.here = drill(self.recorder, self.line, self.here, point, self.axis, work, state)
        self.rapid = False

    def _no_open_arc(self) -> None:
        if self.arc is not None:
            self.arc = None
            self.refuse(StatementError("an arc without its GOTO before this line", "the end of the arc", code="P011"))

    def _open(self, arc: ArcWord) -> None:
        center = self.frames.point((arc.center[0], arc.center[1], arc.center[2]))
        axis = self.frames.direction((arc.axis[0], arc.axis[1], arc.axis[2]))
        self.arc = replace(arc, center=np.array(center), axis=np.array(axis))

    def _indirv(self, s: Statement) -> None:
        self.tangent = np.array(s.numbers(3))

    def _tlon(self, s: Statement) -> None:
        if self.here is None or self.tangent is None or self.frames.moves:
            raise StatementError(
                "no point or no INDIRV before it", "GOTO and INDIRV before it, frames as written", code="P011"
            )
        arc, end = tlon(s.rest, self.scale, np.array(self.here), self.tangent)
        self._along(arc, (float(end[0]), float(end[1]), float(end[2])), self.axis)

    def _cycle(self, s: Statement) -> None:
        self.recorder.event(self.line, "CYCLE", s.rest)
        if s.parts in (["OFF"], ["INIT"], ["CLEAR"], ["START"], ["NOMORE"]):
            self.cycle = None
        elif s.parts == ["ON"] and self.last_cycle is not None:
            self.cycle = self.last_cycle
        else:
            self.cycle = None
            try:
                self.cycle = cycle(s.parts, self.scale)
            except StatementError as fault:
                self.left_out("CYCLE", fault, fault.what)
                return
            self.last_cycle = self.cycle
