"""What happens to a frame while it stands at one pose: weights, how it came there, loads put on, held and taken off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .deck import Deck
from .plan import Nodes, Plan, couple, weights
from .solver import solver

Array = NDArray[np.float64]
ON = 4.0  # s, weights and the way there, before the arm is left to settle
PUT = 8.0  # s, to put a load on or to take one off


@dataclass(frozen=True)
class Event:
    """A force and a moment (6,) at the point from a time on; ``read``: its end is read, when the next load comes."""

    at_s: float
    until_s: float
    wrench: Array
    read: bool


def _legs(deck: Deck, start: float, events: list[Event], came: bool) -> list[list[Any]]:
    """Ends of legs in s, steps, whether to read: weights, the way there and back, settling, then every event."""
    put = 1 if deck.linear else 2 if deck.forgets else 4 if deck.viscous else 10
    hold = 6 if deck.viscous else 1
    legs: list[list[Any]] = [[1.0, 2 * put, False], [2.5, put if came else 1, False], [ON, put if came else 1, False]]
    legs.append([start, 3 * hold, False])
    for event in events:
        legs.append([start + event.at_s + PUT, put, False])
        legs.append([start + event.until_s, hold, event.read])
    return legs


def _wrenches(nodes: Nodes, start: float, events: list[Event]) -> list[dict[str, Any]]:
    """A pattern for each of the six components that is there."""
    times, values = [0.0, start], [np.zeros(6), np.zeros(6)]
    for event in events:
        begin = start + event.at_s
        times += [max(begin, times[-1] + 1e-3), begin + PUT]
        values += [values[-1], event.wrench]
    table = np.array(values)
    return [
        {"times": times, "values": table[:, k].tolist(), "loads": [[nodes.tip, *np.eye(6)[k].tolist()]]}
        for k in range(6)
        if np.any(table[:, k])
    ]


def run(plan: Plan, deck: Deck, nodes: Nodes, events: list[Event], settle_s: float) -> Array:
    """Displacements (n, 6) of the point at the ends of the events that are read, since weights came on."""
    if not deck.forgets:
        return _run(plan, deck, nodes, events, settle_s)
    loads = [event.wrench for event in events if event.read]
    different, which = np.unique(loads, axis=0, return_inverse=True)
    once = [Event(20.0 * i, 20.0 * i + 15.0, wrench, True) for i, wrench in enumerate(different)]
    return _run(plan, deck, nodes, once, settle_s)[which.ravel()]


def _run(plan: Plan, deck: Deck, nodes: Nodes, events: list[Event], settle_s: float) -> Array:
    start = ON + settle_s
    patterns = [{"times": [0.0, 1.0], "values": [0.0, 1.0], "loads": weights(plan, nodes)}]
    patterns += [
        {"times": [0.0, 1.0, 2.5, ON], "values": [0.0, 0.0, 1.0, 0.0], "loads": couple(plan, nodes, i, torque)}
        for i, torque in plan.came.items()
    ]
    patterns += _wrenches(nodes, start, events)
    legs = _legs(deck, start, events, bool(plan.came))
    return solver().run({"deck": deck.commands, "patterns": patterns, "legs": legs, "node": nodes.tip})
