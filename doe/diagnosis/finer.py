"""Shapes between the points of a law's grid, for laws that lead: a joint that lets go in jumps does so at one torque.

A grid misses nobody at a glance, but where the noise is small a law that jumps, or bends sharply, fits between two of
its points only. All around the best one half steps are tried, then quarters and eighths from where that leads.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Final

import numpy as np

from doe.diagnosis.evidence import Whitened
from doe.diagnosis.fits import fit_all
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import Signature, signature
from fem.effects.base import EffectParameter
from robots.arrays import Array

# Steps tried, in shares of the grid's own, how many to each side at once, and how often that may be done.
STEPS: Final = ((0.5, 3, 1), (0.25, 1, 2), (0.125, 1, 2))
# Log evidence that a step must add.
WORTH = 0.5


def finer(s: Setting, w: Whitened, c: Signature) -> tuple[Signature, Array] | None:
    """A better shape near ``c``'s, with its amplitudes (a,) at the noise and base of ``w``; None where there is none.

    Its ``rarity``: log of how many shapes of the last step's size go into one point of the grid.
    """
    fine = c.effect.fine
    if not fine or c.shift is not None:
        return None
    first = fit_all(w, [c])
    best, worth, amplitude = c, float(first.log_evidence[0]), first.mean(0)
    for step, far, times in STEPS:
        rarity = -len(fine) * math.log(step)
        for _ in range(times):
            some = [_like(s, c, values, rarity) for values in _beside(best, fine, step, far)]
            fits = fit_all(w, some)
            # What is rare is charged for at the end: on the way the law itself counts.
            z = fits.log_evidence + rarity
            top = int(np.argmax(z))
            if z[top] < worth + WORTH:
                break
            best, worth, amplitude = some[top], float(z[top]), fits.mean(top)
    return None if best is c else (best, amplitude)


def _like(s: Setting, c: Signature, values: Array, rarity: float) -> Signature:
    """A signature with other shapes and the priors of ``c``."""
    return replace(signature(s, c.effect, values), mean=c.mean, sd=c.sd, rarity=rarity)


def _beside(c: Signature, fine: list[int], step: float, far: int) -> Iterator[Array]:
    """Values of up to so many steps away to all sides."""
    for ways in product([step * k for k in range(-far, far + 1)], repeat=len(fine)):
        if any(ways):
            values = c.values.copy()
            for k, way in zip(fine, ways, strict=True):
                values[k] = _moved(c.effect.parameters[k], float(values[k]), way)
            yield values


def _moved(p: EffectParameter, value: float, way: float) -> float:
    """A shape's value so many of its grid's steps away, within its range; steps of a torque, force or time are ratios.

    The grid's steps are taken as equal.
    """
    low, high = min(p.grid), max(p.grid)
    steps = len(p.grid) - 1
    if low > 0.0 and p.dimension != "ratio":
        moved = value * math.exp(way / steps * math.log(high / low))
    else:
        moved = value + way * (high - low) / steps
    return min(max(moved, p.lower), p.upper)
