"""The forearm's moment goes down a parallelogram's bar, through joint 2 as in a serial chain, or both ways.

All of it the other way is ``load-path``: it holds or it does not, and belongs to the arm. Some of it is
``partial-load-path``, whose share is free: a bar with play, or one that a stiff joint 2 relieves. The two are one
family; at a share of one they are one effect.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fem.effects.base import NEARLY_STRAIGHT, Effect, EffectParameter
from fem.effects.situation import Situation
from fem.effects.structure import ASSUMED
from fem.model import ArmModel, BarPart
from fem.statics.flexibility import batches
from fem.statics.transfers import Transfer, transfers
from fem.statics.vectors import poses_last
from robots import LoadPath
from robots.arrays import Array

Bar = Callable[[], BarPart | None]
# A share of what is changed wholly would change it back.
SLOT = "load-path"
# How much likelier than half of the family: a path is mostly taken wholly.
WHOLLY = 1.3
# Arrays of poses that are all worked on at once.
WHOLE = 10**9


def load_path(path: LoadPath, bar: Bar) -> Effect:
    """The other way for the forearm's moment: down the parallelogram's bar, or through joint 2 as in a serial chain.

    ``path`` is that way; ``bar()`` what it has of a bar, built when it is asked for.
    """

    def law(model: ArmModel, _: object, v: Array) -> ArmModel:
        return replace(model, load_path=path, bar=None if path == "serial" else bar())

    if path == "parallelogram":
        words = "the forearm's moment goes down the parallelogram's bar, not through joint 2"
    else:
        words = "the forearm's moment goes through joint 2 as in a serial chain, not down the bar"
    return Effect("load-path", words, "model", (), law, "load-path", slot=SLOT, chance=WHOLLY)


def partial_load_path(path: LoadPath, bar: Bar) -> Effect:
    """A share of the forearm's moment goes the other way, ``path``; statics with ``T = (1 - a) T_own + a T_other``.

    Every part carries so much of what it would carry either way, and moves the tool as much (virtual forces). What
    decides on the share, play and prestress, is not modelled; it is taken to be the same at all poses and loads.
    """

    def law(_: object, s: Situation, v: Array) -> Array:
        # Where the whole path is changed already, a share of it stays behind.
        there = path if s.model.load_path != path else "serial" if path == "parallelogram" else "parallelogram"
        other = replace(s.model, load_path=there, bar=None if there == "serial" else bar())
        w = poses_last(s.at.wrench)
        own, ways = (_parts(m, s) for m in (s.model, other))
        total = np.zeros((6, len(s.at)))
        for name in {**own, **ways}:
            total += _share(own.get(name), ways.get(name), min(float(v[0]), 1.0), w)
            if name in own:
                total -= own[name].share(w)
        return np.asarray(total.T)

    share = EffectParameter("share", "ratio", "1", 0.1, 0.9, ASSUMED, meaning="share that goes the other way")
    words = "a part of the forearm's moment goes " + (
        "down the parallelogram's bar" if path == "parallelogram" else "through joint 2, past the parallelogram's bar"
    )
    return Effect(
        "partial-load-path",
        words,
        "arm",
        (share,),
        law,
        "load-path",
        depends_on="pose",
        doubt=NEARLY_STRAIGHT,
        slot=SLOT,
        chance=2.0 - WHOLLY,
    )


def _parts(model: ArmModel, s: Situation) -> dict[str, Transfer]:
    [(_, frames, tool)] = batches(model, s.at.q, s.at.point, WHOLE)
    return {part.name: part for part in transfers(model, frames, s.at.q, tool)}


def _share(own: Transfer | None, other: Transfer | None, a: float, w: Array) -> Array:
    """Displacement (6, n) by a part that carries (1 - a) of what it has in its own arm, a of what in the other."""
    pairs = [(k, part) for k, part in ((1.0 - a, own), (a, other)) if part is not None]
    # A part carries more where the bar hangs on it; what is not there is carried by nobody.
    whole = max((part for _, part in pairs), key=lambda part: len(np.atleast_1d(part.carried(w))))
    s = np.zeros_like(whole.carried(w))
    for k, part in pairs:
        one = part.carried(w)
        s[: len(one)] += k * one
    h = whole.deformation(s)
    out = np.zeros_like(w)
    for k, part in pairs:
        out += k * part.displacement(h[: len(part.carried(w))])
    return out
