"""Laws to learn of what is around an arm: the temperature, and who reads, or which day it is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fem.effects.base import Effect
from fem.effects.history import ROOM
from fem.effects.learned_parts import FAMILY, Reach, held, pieces
from fem.effects.situation import Situation
from robots.arrays import Array

# Kelvins per which shares and lengths are stated.
PER_KELVINS = 10.0


def surroundings(reach: Reach) -> Iterator[Effect]:
    """Every law of this kind; a joint's own over the temperature is :mod:`warming <fem.effects.lagging_laws>`."""
    yield _gauge_temperature(reach)
    yield _session(reach)


def _warmer(s: Situation) -> Array:
    """How much warmer (n,) than a room it was, in tens of kelvins; nothing where that was not read."""
    return np.asarray(np.nan_to_num((s.history.temperature - ROOM) / PER_KELVINS))


def _gauge_temperature(reach: Reach) -> Effect:
    """Readings, straight lines over the temperature: what holds the gauge grows, or the floor does."""

    def law(d: Array, s: Situation, v: Array) -> Array:
        out, warm = d.copy(), _warmer(s)
        out[:, :3] += np.outer(warm, v[:3]) * v[6] + warm[:, None] * v[3:6] * d[:, :3]
        return out

    own = pieces([f"{axis}" for axis in "xyz"], "share of the size named that is added by ten kelvins")
    shares = pieces([f"share_{axis}" for axis in "xyz"], "share of the deflection that is added by ten kelvins")
    size = held("size", "length", "mm", max(reach.size, 1e-9), "size to which the shares refer")
    return Effect(
        "learned-temperature:gauge",
        "readings move with the temperature",
        "gauge",
        (*own, *shares, size),
        law,
        FAMILY,
        depends_on="temperature",
        doubt=0.0,
    )


def _session(reach: Reach) -> Effect:
    """Readings that every session after the first has a scale and a zero of its own for: another gauge or reader."""
    count = reach.sessions - 1

    def law(d: Array, s: Situation, v: Array) -> Array:
        # Sessions beyond those that it was learned of are as the first.
        number = np.where(s.history.session <= count, s.history.session, 0)
        share = np.concatenate([[0.0], v[:count]])[number]
        zero = np.vstack([np.zeros(3), v[count : 4 * count].reshape(count, 3)])[number]
        out = d * (1.0 + share)[:, None]
        out[:, :3] += zero * v[-1]
        return np.asarray(out)

    scales = pieces([f"share{k}" for k in range(2, count + 2)], "share that this session reads too much")
    zeros = pieces([f"{axis}{k}" for k in range(2, count + 2) for axis in "xyz"], "share of the size named")
    size = held("size", "length", "mm", max(0.2 * reach.size, 1e-9), "size to which the shares refer")
    # A file holds those of the sessions that there were.
    numbers = tuple(replace(p, default=0.0) for p in (*scales, *zeros))
    return Effect(
        "learned-session:gauge",
        "each session reads with a scale and a zero of its own",
        "gauge",
        (*numbers, size),
        law,
        FAMILY,
        depends_on="session",
        doubt=0.0,
    )
