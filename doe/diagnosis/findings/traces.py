"""The trace that an effect leaves in the readings, beside what springs leave of them and beside its twins' traces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from doe.diagnosis.candidates import MANY
from doe.diagnosis.diagnose import Diagnosis
from doe.diagnosis.findings.numbers import in_order
from doe.diagnosis.hypotheses import NONE, UNKNOWN, Ranking
from doe.diagnosis.known import base_of, free_columns, refit
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import Signature, shape_count, signatures
from doe.diagnosis.twins import likely_amplitude
from doe.diagnosis.where import labels_of
from robots.arrays import Array, Bools, Indices

# So many effects have a row, with the likest of their twins beside them; of many twins so many are asked.
MOST_ROWS, MOST_TWINS, ASKED = 4, 2, 8
# What is less probable, and was not taken up, has none.
LEAST = 0.05
# More readings than this are drawn under each pose's largest loads only.
MOST_READINGS = 400


@dataclass(frozen=True, eq=False)
class Trace:
    """What an effect makes of the readings (m,), in their order of :class:`Traces`; mm, or mrad of rotations.

    ``off``: RMS by which a twin's trace, as like as it can be, differs from its row's; 0 of the row's own effect.
    """

    code: str
    values: Array
    off: float


@dataclass(frozen=True, eq=False)
class Row:
    """An effect with its probability in a look, its trace, and those of its twins; ``left`` (m,): what is to explain.

    ``given``: effects that the model had by then.
    """

    own: Trace
    probability: float
    twins: tuple[Trace, ...]
    left: Array
    given: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Traces:
    """Rows over readings sorted by what was read, pose, load and phase; labels (m,) of ``pose`` and ``read``."""

    rows: tuple[Row, ...]
    pose: tuple[str, ...]
    read: tuple[str, ...]
    unit: str


def traces_of(d: Diagnosis, twins: Mapping[str, Sequence[str]], poses: Sequence[str]) -> Traces | None:
    """Traces of the credible effects of each look that found something; None where there are none.

    ``twins``: by code, those that these readings cannot separate from it; ``poses``: all of them in the order in which
    they are to stand.
    """
    if d.verdict in ("none", "uninformative"):
        return None
    order = _sorted(d, poses)
    p = d.before.setting.data
    labels = labels_of(d.before.setting)
    rows: list[Row] = []
    taken = [f.code for f in in_order(d)]
    for k, ranking in enumerate(d.rankings[: max(len(taken), 1)]):
        known = {h.code: h.probability for h in ranking.hypotheses if h.code not in (NONE, UNKNOWN)}
        codes = [c for c in taken[k : k + 1] if c in known] + [c for c in ranking.credible() if known.get(c, 0) > LEAST]
        for code in dict.fromkeys(codes):
            if len(rows) < MOST_ROWS and all(row.own.code != code for row in rows):
                rows += _row(d, k, code, twins.get(code, ()), order, tuple(taken[:k]))
    if not rows:
        return None
    linear = bool((p.component < 3).any())
    return Traces(
        tuple(rows),
        tuple(labels["pose"][i] for i in order),
        tuple(("X", "Y", "Z", "about X", "about Y", "about Z")[c] for c in p.component[order]),
        "mm" if linear else "mrad",
    )


def _sorted(d: Diagnosis, poses: Sequence[str]) -> Indices:
    """Readings that are drawn, in their order: translations, else rotations, of those that count."""
    s = d.before.setting
    p = s.data
    linear = p.component < 3
    mine = np.flatnonzero((linear if linear.any() else ~linear) & d.counts)
    load = np.linalg.norm(p.free.at.wrench[p.row, :3], axis=1)
    if len(mine) > MOST_READINGS:
        most = np.zeros(len(p.poses))
        np.maximum.at(most, p.pose[mine], load[mine])
        mine = mine[load[mine] > 0.99 * most[p.pose[mine]]]
    place = np.array([poses.index(name) for name in p.poses])[p.pose]
    down = s.unloading[p.row] if s.history.is_known else np.zeros(len(p), dtype=bool)
    return np.asarray(mine[np.lexsort((down[mine], load[mine], place[mine], p.component[mine]))], dtype=np.intp)


def _row(d: Diagnosis, look: int, code: str, twins: Sequence[str], order: Indices, given: tuple[str, ...]) -> list[Row]:
    """The row of an effect in a look; none where it changes no reading."""
    r, counts = d.rankings[look], d.counts
    h = r.of(code)
    if h.signature is None:
        return []
    s = _setting(d, look)
    follow = free_columns(s, base_of(s))
    amplitude = likely_amplitude(h) if h.signature.columns.shape[1] else np.ones(1)
    change = _beside(_columns(h.signature) @ amplitude, follow, counts)
    if not change.any():
        return []
    some = [_twin(s, other, r, change, follow, counts) for other in twins[:ASKED]]
    likest = sorted((t for t in some if t is not None), key=lambda t: t.off)[:MOST_TWINS]
    left = _beside(s.residual, follow, counts)
    return [
        Row(
            Trace(code, 1e3 * change[order], 0.0),
            h.probability,
            tuple(replace(t, values=t.values[order]) for t in likest),
            1e3 * left[order],
            given,
        )
    ]


def _setting(d: Diagnosis, look: int) -> Setting:
    """The setting of a look at its best: with what had been found by then."""
    if look == 0:
        return d.before.setting
    s, noise = d.after.setting, d.after.refit.noise
    taken = s.accepted[: len(s.accepted) - len(d.found) + look]
    return refit(s.moved(s.springs, taken), noise, d.weight).setting


def _twin(s: Setting, code: str, r: Ranking, change: Array, follow: Array, counts: Bools) -> Trace | None:
    """The trace of an effect in the shape and size that imitates a change (m,) of the readings best; of all of them."""
    effect = s.known[code]
    if effect.gross or shape_count(effect) > MANY:
        some = [h.signature for h in r.hypotheses if h.code == code and h.signature is not None]
    else:
        some = signatures(s, effect)
    best: Trace | None = None
    for one in some:
        X = _beside(_columns(one), follow, counts)
        size = np.maximum(np.linalg.norm(X, axis=0), 1e-300)
        low = np.where(one.positive, 0.0, -np.inf) if len(one.positive) else -np.inf
        fitted = X @ (lsq_linear((X / size)[counts], change[counts], (low, np.inf)).x / size)
        off = 1e3 * float(np.sqrt(np.mean((fitted - change)[counts] ** 2)))
        if best is None or off < best.off:
            best = Trace(code, 1e3 * fitted, off)
    return best


def _columns(c: Signature) -> Array:
    """What its amplitudes change of the readings (m, a); of what has none the change itself (m, 1)."""
    return c.shift[:, None] if c.shift is not None else c.columns


def _beside(values: Array, follow: Array, counts: Bools) -> Array:
    """Values (m,) or columns (m, k) without what springs and effects in the model (m, f) can follow of them."""
    A = follow / np.maximum(np.linalg.norm(follow, axis=0), 1e-300)
    return np.asarray(values - A @ np.linalg.lstsq(A[counts], values[counts], rcond=None)[0])
