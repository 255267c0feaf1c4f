"""Which unknowns no campaign could tell apart: singular directions of the derivatives at random poses over all angles.

Columns are taken in an order of preference, the sessions' frames first, and of a rail's way the largest component; one
that the columns before it span at every pose is held at what the arm's description says (a rail's way and targets where
the start found them), and the combination that it is the twin of is said.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from doe.absolute.chain import Nominal, evaluate, samples
from doe.absolute.readings import AbsoluteReadings, Labels
from doe.absolute.reduced import FRAME, frame_columns
from doe.absolute.unknowns import Layout, Unknown
from fem import ArmModel
from robots.arrays import Array

# What is left of a column across those before it, as a share of its length, below which it is their twin.
TWIN = 1e-7
# Orders of periodic errors that are looked at: higher ones are no twins of anything else.
LOOKED_AT = 4
# Members of a combination below this share of the largest are not named.
NAMED = 1e-4
POSES = 150
# Poses are drawn so many times, for couplings of joints allow some of them alone.
TRIED = 10
ORDER = (
    "target",
    "zero",
    "frame",
    "rail",
    "ratio",
    "coupling",
    "spring",
    "mass",
    "payload",
    "periodic",
    "growth",
    "drift",
    "reversal",
)
# Components of a rail's way below this share of the largest are none.
OBLIQUE = 0.1
# What the start finds and no model has.
STARTED = ("rail.", "target.")


@dataclass(frozen=True)
class Twin:
    """An unknown that moves nothing, or moves what ``others`` move together (their names; none: nothing at all)."""

    name: str
    others: tuple[str, ...]

    @property
    def words(self) -> str:
        """One sentence."""
        held = "where the first fit of frames put it" if self.name.startswith(STARTED) else "as the model has it"
        if not self.others:
            return f"{self.name} moves no target: held {held}"
        together = "moves" if len(self.others) == 1 else "move together"
        return f"{self.name} moves what {_listed(self.others)} {together}: held {held}"


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def twins(model: ArmModel, data: AbsoluteReadings, layout: Layout, nominal: Nominal, seed: int = 0) -> tuple[Twin, ...]:
    """Unknowns that no poses within the joints' ranges tell apart, with the targets where they are."""
    looked = tuple(one for one in layout.unknowns if one.kind != "periodic" or one.index[1] <= LOOKED_AT)
    way = np.array(nominal.way) / np.abs(nominal.way).max()
    # Turns about a rail along an axis move nothing: that it was found to lie slightly off tells nothing of them.
    way = np.where(np.abs(way) < OBLIQUE, 0.0, way)
    part = Layout(tuple(sorted(looked, key=lambda one: (ORDER.index(one.kind), -_along(one, way)))))
    some = _random(model, data, np.random.default_rng(seed))
    u = np.array([one.start for one in part.unknowns])
    for k, (t, a) in part.of("target"):
        u[k] = nominal.targets[t, a]
    for k, (turns, order, a) in part.of("rail"):
        u[k] = way[a] if (turns, order) == (0, 1) else 0.0
    # Masses move something where springs give way; everything else is looked at where none does, for what gives way
    # has the levers of the arm as described, and does not turn with its zeros.
    soft = u + np.array([1e-6 * (one.kind == "spring") for one in part.unknowns])
    carried = np.array([one.kind in ("payload", "mass") for one in part.unknowns])
    blocks = []
    for s in samples(model, some, part, nominal):
        (P, J), (_, yielding) = evaluate(model, part, s, u), evaluate(model, part, s, soft)
        blocks.append((P, np.where(carried[:, None, None], yielding, J)))
    made = [np.concatenate([frame_columns(P), J]) for P, J in blocks]
    columns = np.concatenate(made, axis=2).reshape(FRAME + len(part), -1)
    names = [
        *(f"the tracker frame's {w}" for w in ("rx", "ry", "rz", "x", "y", "z")),
        *(one.name for one in part.unknowns),
    ]
    scale = np.array([1.0] * FRAME + [_scale(one) for one in part.unknowns])
    return tuple(_dependent(columns * scale[:, None], names))


def _along(one: Unknown, way: Array) -> float:
    """How much of a rail's way (3,) an unknown is."""
    return float(abs(way[one.index[2]])) if one.kind == "rail" and one.index[:2] == (0, 1) else 0.0


def _scale(one: Unknown) -> float:
    return one.sd if np.isfinite(one.sd) else 1.0


def _random(model: ArmModel, data: AbsoluteReadings, rng: np.random.Generator) -> AbsoluteReadings:
    low, high = np.clip(model.robot.limits, -np.pi, np.pi).T
    wide = np.where(high > low, high - low, 1.0)
    n = POSES * len(data.target.names)
    q = low + wide * rng.uniform(size=(TRIED * n, model.robot.dof))
    # Couplings keep parallelograms from folding flat.
    q = q[np.argsort(~model.robot.reachable(q), kind="stable")][:n]
    pick = rng.integers(0, len(data), n)
    span = float(data.rail.min(initial=0.0)), float(data.rail.max(initial=0.0))
    return replace(
        data,
        q=q,
        position=np.zeros((n, 3)),
        session=Labels(("",), np.zeros(n, dtype=np.int64)),
        target=Labels(data.target.names, np.arange(n) % len(data.target.names)),
        payload=data.payload[pick],
        rail=rng.uniform(*span, n),
        sigma=np.full(n, np.nan),
        line=np.zeros(n, dtype=np.int64),
        time=rng.uniform(data.time.min(), data.time.max(), n) if len(data.time) else data.time,
        temperature=data.temperature[pick] if len(data.temperature) else data.temperature,
        approach=data.approach[pick] if data.approach.size else np.zeros((n, 0)),
    )


def _dependent(columns: Array, names: Sequence[str]) -> list[Twin]:
    """Columns (c, m) that those before them span, with what they are made of."""
    lengths = np.linalg.norm(columns, axis=1)
    largest = float(lengths.max(initial=0.0))
    basis, kept, out = np.zeros((0, columns.shape[1])), list[int](), list[Twin]()
    for k, column in enumerate(columns):
        if lengths[k] <= 1e-12 * largest:
            out.append(Twin(names[k], ()))
            continue
        rest = column - basis.T @ (basis @ column)
        rest = rest - basis.T @ (basis @ rest)
        if np.linalg.norm(rest) > TWIN * lengths[k]:
            basis, kept = np.vstack([basis, rest / np.linalg.norm(rest)]), [*kept, k]
            continue
        made = np.linalg.lstsq(columns[kept].T, column, rcond=None)[0] * lengths[kept]
        share = np.abs(made) / np.abs(made).max()
        out.append(Twin(names[k], tuple(names[kept[i]] for i in np.flatnonzero(share > NAMED))))
    return out
