"""Readings and a model with numbers set free, as one estimation problem."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from doe.estimation.blocks import Blocks
from doe.tables.checks import joint_keys
from doe.tables.loaded import history_of, loaded_points
from doe.tables.measurements import Measurements
from fem import ArmModel
from fem.effects.base import PlacedEffect
from fem.effects.situation import History
from fem.free.model import FreeModel
from fem.free.parameters import FreeLaw, Parameter
from fem.statics.loads import as_loaded
from robots.arrays import Array, Bools, Integers

# Lengths' factor for what was not read, squared: springs of the model as given may be softer or stiffer than the arm's.
MOST_UNREAD = 9.0

# First load cycles are told from later ones where so many groups of repeats have both, and their distance is in the
# middle so many times that of later ones from one another.
FEWEST_FIRST, FIRST_APART = 8, 6.0

Flexibility = Callable[[float], tuple[Array, Array]]


@dataclass(frozen=True)
class When:
    """When components were read: ``clock`` (m,) from 0 to 1, NaN where unknown; ``session`` and ``visit`` (m,) numbers.

    A visit is a stay at a pose: the arm left it and came back where another pose was read between two of its readings.
    """

    clock: Array
    session: Integers
    visit: Integers

    def take(self, mask: Bools) -> When:
        """Keep the components where ``mask`` (m,) is true."""
        return When(self.clock[mask], self.session[mask], self.visit[mask])

    def followed(self, visit: Integers) -> When:
        """The same and further components, of visits (k,) counted from 0 beyond these, at times that are not known."""
        new = np.full(len(visit), int(self.session.max(initial=0)))
        first = int(self.visit.max(initial=-1)) + 1
        return When(
            np.concatenate([self.clock, np.full(len(visit), np.nan)]),
            np.concatenate([self.session, new]),
            np.concatenate([self.visit, first + visit]),
        )


@dataclass(frozen=True)
class Problem:
    """m read components and a model with p numbers set free.

    ``value`` (m,) m or rad as read; ``row`` (m,): the reading it belongs to; ``component`` (m,): 0..5 for dx, dy,
    dz, rx, ry, rz; ``pose`` (m,): number of the pose (set-up) it was read in, ``poses`` their labels;
    ``replicate`` (m,): number of the group of readings of one component under the same pose, load, point and
    phase; ``sigma`` (m,): standard deviation given with the reading, NaN where none was; ``when`` they were read, None
    where nothing is known of it; ``apart``: whether each visit to a pose scatters by itself, not the pose as a whole.
    """

    free: FreeModel
    value: Array
    row: Integers
    component: Integers
    pose: Integers
    poses: tuple[str, ...]
    replicate: Integers
    sigma: Array
    when: When | None = None
    apart: bool = False

    def __len__(self) -> int:
        return len(self.value)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The numbers set free."""
        return self.free.parameters

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds (p,) of the estimator's variables."""
        ends = np.array([p.inner_bounds for p in self.parameters]).reshape(-1, 2)
        return ends[:, 0], ends[:, 1]

    @cached_property
    def blocks(self) -> Blocks:
        """Readings of one component in one pose, or in one visit to it where these scatter apart."""
        place = self.when.visit if self.apart and self.when is not None else self.pose
        return Blocks.of(6 * place + self.component)

    @cached_property
    def load(self) -> Array:
        """Size (m,) of each reading's load: its force in N and its moment in N m, added up."""
        wrench = self.free.at.wrench[self.row]
        return np.asarray(np.linalg.norm(wrench[:, :3], axis=1) + np.linalg.norm(wrench[:, 3:], axis=1))

    def lengths(self, f: Array) -> Array:
        """Lengths (m,) of the displacement vectors whose components are read, of one kind, at predictions f (m,).

        Components that were not read are those of the model as it is given, times a factor for all of them: the lengths
        are for noise alone.
        """
        key = 2 * self.row + (self.component >= 3)
        read: Array = np.bincount(key, weights=f**2, minlength=2 * len(self.free.at)).astype(np.float64)
        other, whole = self._unread
        if other is not None:
            read = read + other * min(float(f @ f) / max(whole, 1e-300), MOST_UNREAD)
        return np.sqrt(read)[key]

    @cached_property
    def _unread(self) -> tuple[Array | None, float]:
        """Squares (2 n,) of what no gauge read, by reading and kind, and the sum of squares of what one did."""
        used = np.zeros((len(self.free.at), 6), dtype=np.bool_)
        used[self.row, self.component] = True
        if used.all() or (used[:, :3].all() and not used[:, 3:].any()):
            return None, 0.0
        d = self.free.displacement(self.free.start)
        square = np.where(used, 0.0, d**2).reshape(-1, 2, 3).sum(axis=2).reshape(-1)
        return square, float(np.sum(d[self.row, self.component] ** 2))

    @cached_property
    def memory(self) -> dict[str, object]:
        """What was worked out of the readings alone, by name: many fits ask for it again."""
        return {}

    def evaluate(self, u: Array) -> tuple[Array, Array]:
        """Predicted readings (m,) and their derivatives (m, p) by the estimator's variables u (p,)."""
        if self._linear is not None:
            start, value, J = self._linear
            return value + J @ (u - start), J
        if not self._last or not np.array_equal(self._last[0], u):
            value, J = self.free.evaluate(u)
            self._last[:] = [u.copy(), value[self.row, self.component], J[self.row, self.component]]
        return self._last[1], self._last[2]

    def predict(self, u: Array) -> Array:
        """Predicted readings (m,) alone, at a fraction of the work where angles or points are free."""
        if self._linear is not None:
            return self.evaluate(u)[0]
        return np.asarray(self.free.displacement(u)[self.row, self.component])

    @cached_property
    def _last(self) -> list[Array]:
        """The latest variables evaluated, with readings and derivatives: rounds and stages ask again for the same."""
        return []

    @cached_property
    def is_linear(self) -> bool:
        """Whether the predictions are linear in all of the estimator's variables."""
        return self.free.is_linear

    @cached_property
    def _linear(self) -> tuple[Array, Array, Array] | None:
        """Variables, readings predicted with them, and derivatives, which hold everywhere; None if they do not."""
        if not self.is_linear:
            return None
        start = self.free.start
        value, J = self.free.evaluate(start)
        J = np.ascontiguousarray(J[self.row, self.component])
        J.setflags(write=False)
        return start, value[self.row, self.component], J

    def take(self, mask: Bools) -> Problem:
        """Keep the components where ``mask`` (m,) is true; loaded poses that none of them needs are dropped."""
        rows, row = np.unique(self.row[mask], return_inverse=True)
        free, kept_as = self.free.take(rows)
        kept, pose = np.unique(self.pose[mask], return_inverse=True)
        return Problem(
            free,
            self.value[mask],
            kept_as[row],
            self.component[mask],
            pose,
            tuple(self.poses[k] for k in kept),
            np.unique(self.replicate[mask], return_inverse=True)[1],
            self.sigma[mask],
            None if self.when is None else self.when.take(mask),
            self.apart,
        )


def problem(
    model: ArmModel,
    data: Measurements,
    parameters: Sequence[Parameter],
    laws: Sequence[FreeLaw] = (),
    walls: Mapping[str, Flexibility] | None = None,
    effects: Sequence[PlacedEffect] = (),
    history: History | None = None,
) -> Problem:
    """Set up the estimation of ``parameters`` from all components that were read.

    ``effects``: those that the arm has beyond ``model``; ``history``: by default what the table says. Readings at the
    same angles are of one pose, which has the first of their labels.
    """
    first: dict[tuple[float, ...], str] = {}
    data = replace(data, pose=tuple(map(first.setdefault, joint_keys(data.q), data.pose)))
    at = as_loaded(model, data.q, data.wrench, loaded_points(model, data))
    row, component = np.nonzero(data.used)
    labels = tuple(dict.fromkeys(data.pose))
    number = {label: k for k, label in enumerate(labels)}
    then = history or history_of(data)
    down = then.unloading(np.linalg.norm(at.wrench[:, :3], axis=1) + np.linalg.norm(at.wrench[:, 3:], axis=1))
    phase = 2 * np.unique([p or "" for p in data.phase], return_inverse=True)[1] + down
    case = np.column_stack([at.q, at.wrench, at.point, phase, [number[p] for p in data.pose]])
    same = np.unique(np.round(case, 12), axis=0, return_inverse=True)[1].reshape(-1)
    value = data.displacement[row, component]
    replicate = _first_apart(value, 6 * same[row] + component, then.fresh[row])
    free = FreeModel(
        model, tuple(parameters), at, tuple(laws), dict(walls or {}), tuple(effects), then if effects else None
    )
    return Problem(
        free=free,
        value=value,
        row=row.astype(np.int64),
        component=component.astype(np.int64),
        pose=np.array([number[data.pose[i]] for i in row], dtype=np.int64),
        poses=labels,
        replicate=np.unique(replicate, return_inverse=True)[1].astype(np.int64),
        sigma=data.sigma[row],
        when=When(then.clock[row], then.session[row], _visits(data, then)[row]),
    )


def _first_apart(value: Array, group: Integers, fresh: Bools) -> Integers:
    """Groups (m,) of repeats, those of a stay's first load cycle (``fresh``) apart where these differ from later ones.

    What sticks, or has to settle, makes the first cycle another one than those after it: no scatter, and no outliers.
    """
    out, apart, within = 2 * group, [], []
    # Of most groups there is nothing to compare.
    firsts, laters = (np.bincount(group[which], minlength=1 + group.max(initial=0)) for which in (fresh, ~fresh))
    known = np.flatnonzero(((firsts > 0) & (laters > 1))[group])
    order = known[np.argsort(group[known], kind="stable")]
    for rows in np.split(order, np.flatnonzero(np.diff(group[order])) + 1) if len(order) else ():
        first, later = value[rows[fresh[rows]]], value[rows[~fresh[rows]]]
        apart.append(abs(float(first.mean() - np.median(later))))
        within.append(float(np.median(np.abs(later - np.median(later)))))
    differ = len(apart) >= FEWEST_FIRST and np.median(apart) > FIRST_APART * np.median(within)
    return out + fresh if differ else out


def _visits(data: Measurements, history: History) -> Integers:
    """Number (n,) of the stay at a pose that each reading belongs to: one a pose where the order is not known."""
    pose = np.unique(np.array(data.pose, dtype=str), return_inverse=True)[1].reshape(-1)
    if data.n == 0 or not np.isfinite(history.clock).all():
        return pose.astype(np.int64)
    order = np.lexsort((pose, history.clock))
    visit = np.empty(data.n, dtype=np.int64)
    visit[order] = np.cumsum(np.diff(pose[order], prepend=pose[order[0]]) != 0)
    # Readings taken one by one in any order have no visits.
    return visit if int(visit.max()) < data.n // 2 else pose.astype(np.int64)
