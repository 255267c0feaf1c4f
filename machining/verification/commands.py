"""What is commanded between moves, held against what the moves need and say.

A program has spindle speed, tool and rest of each move twice: as columns of the moves, and as the commands between them
that a controller follows. A command that is missing leaves the two apart.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from machining.toolpaths.events import told_in_order
from machining.toolpaths.motions import Event, Motions
from machining.verification.offences import Kind, Offence, Reported, Severity
from robots.constants import RPM


def has_commands(motions: Motions) -> bool:
    """Whether a program says anything between its moves; tables of moves alone cannot."""
    return any(event.kind for event in motions.events)


def command_offences(reported: Reported) -> Iterator[Offence]:
    """Faults of the file, missing commands, cuts with the spindle at rest, tools changed as it turns, and the end."""
    motions = reported.courses.program.motions
    for fault in reported.courses.program.faults:
        kind = Kind.OTHER_POINT if fault.place else Kind.COMMAND
        yield reported.offence(kind, fault.move, 1.0 if fault.place else 0.0, np.nan, np.nan, "", text=fault.text)
    if not has_commands(motions):
        return
    seen, places, stands = _State(), [0], [False]
    for told in told_in_order(motions):
        event = told.event
        if not told.given and event.kind != "operation":
            yield _offence(reported, event.move, f"{_words(motions, event)}: the moves say it, no command does")
        if event.kind == "tool" and seen.turning:
            yield _offence(reported, event.move, f"{_words(motions, event)} while the spindle turns")
        seen.take(event)
        places.append(event.move)
        stands.append(seen.stands)
    standing = np.repeat(stands, np.diff([*places, motions.n]))
    for move in np.flatnonzero(standing & motions.cutting).tolist():
        yield _offence(reported, move, "a move at feed while the spindle stands")
    if seen.turning:
        yield _offence(reported, motions.n, "the spindle still turns at the end")
    if seen.cooled:
        yield _offence(reported, motions.n, "the coolant is still on at the end", Severity.WARNING)


class _State:
    """What has been commanded so far."""

    def __init__(self) -> None:
        self.turning = self.turned = self.cooled = self.probing = False

    def take(self, event: Event) -> None:
        if event.kind == "spindle":
            self.turning = event.value != 0.0
            self.turned |= self.turning
        elif event.kind == "coolant":
            self.cooled = event.text != "off"
        elif event.kind == "probe":
            self.probing = event.value > 0.0

    @property
    def stands(self) -> bool:
        """Whether nothing can be cut; where the spindle was never commanded, or a probe is on, it need not turn."""
        return self.turned and not self.turning and not self.probing


def _offence(reported: Reported, move: int, text: str, severity: Severity = Severity.ERROR) -> Offence:
    last = reported.courses.program.n - 1
    at = 1.0 if move > last else 0.0
    return reported.offence(Kind.COMMAND, min(move, last), at, np.nan, np.nan, "", text=text, severity=severity)


def _words(motions: Motions, event: Event) -> str:
    """A command as a message names it."""
    if event.kind == "spindle":
        speed = abs(event.value) / RPM
        return "spindle stop" if event.value == 0.0 else f"spindle at {speed:.6g} rpm"
    if event.kind == "tool":
        tool = motions.tools[int(event.value)]
        return f"change to tool {tool.name if tool.number is None else tool.number}"
    return f"rest of {event.value:.6g} s" if event.kind == "dwell" else event.kind
