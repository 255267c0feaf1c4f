"""How a stiffness index is distributed over a plane, a box or any points, for each angle gamma about the tool axis.

Gao 2024 (doi:10.1109/ACCESS.2024.3435911), section IV.C, Figs. 10 and 11: k_fs over a plane at several gamma, its
mean, standard deviation and peak to valley against gamma, and the gamma with the largest mean. The paper does not say
what becomes of points that a gamma does not reach. Here both answers are given: each gamma over the points that *it*
reaches, which compares different sets of points, and all over the points that *every* gamma reaches.

Each point has the best branch within joint limits. Neither collisions nor the way from point to point are looked at.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

import fem
from machining.stiffness.objective import Objective
from machining.sweep_parts import sweep_parts
from machining.task import Task, tool_path
from robots import InputError, Reason, require_one_of
from robots.arrays import Array, Bools, Integers
from robots.inverse.solutions import why_no_closed_form
from robots.progress import Progress
from surrogate.maps.candidates import Arm, Chosen

Over = Literal["reached", "common"]

# Share of the best value that a gamma may give away to be like its neighbours': arms are nearly symmetric, so two far
# apart are often equally good but for a few per mille, and which of them is ahead changes from point to point.
PRICE = 0.03
# Merits that differ by less than this share are equally good: a tool point on the flange axis makes all gamma so.
TIED = 1e-9


@dataclass(frozen=True, eq=False)
class Statistics:
    """Figures of a distribution at each of m angles gamma; NaN where no point counts.

    ``over``: "reached", at each gamma the points that it reaches, or "common", the points that every gamma reaches.
    ``points`` (m,): how many those are. ``mean``, ``standard_deviation`` (of these points as they are: divided by
    their number), ``smallest``, ``largest``, ``peak_to_valley`` (m,) in the unit of the quantity. ``share`` (m,) of
    all points that this gamma reaches, whatever ``over`` is.
    """

    over: Over
    points: Integers
    mean: Array
    standard_deviation: Array
    smallest: Array
    largest: Array
    share: Array

    @property
    def peak_to_valley(self) -> Array:
        """Largest less smallest value (m,)."""
        return np.asarray(self.largest - self.smallest)


@dataclass(frozen=True, eq=False)
class Distribution:
    """Best branch's value at n points and m angles.

    ``gamma`` (m,) rad; ``value`` (n, m) of the objective, NaN where no posture is within reach and limits; ``sure``:
    the inverse kinematics found all solutions. ``q`` (n, dof) rad: the pose at each point's best gamma, NaN where there
    is none; None where it was not asked for.

    Raises
    ------
    InputError
        Shapes that do not fit, or infinite values.
    """

    objective: Objective
    gamma: Array
    value: Array
    sure: bool = True
    q: Array | None = None

    def __post_init__(self) -> None:
        gamma, value = np.asarray(self.gamma, dtype=np.float64), np.asarray(self.value, dtype=np.float64)
        if gamma.ndim != 1 or value.ndim != 2 or value.shape[1] != len(gamma) or value.size == 0:
            shapes = f"gamma {gamma.shape}, value {value.shape}"
            raise InputError("distribution", code="S012", value=shapes, allowed="(m,) and (n, m), n and m at least 1")
        if np.isinf(value).any() or not np.isfinite(gamma).all():
            raise InputError(
                "distribution", code="S012", value="infinite", allowed="finite, NaN where a point is not reached"
            )
        object.__setattr__(self, "gamma", gamma)
        object.__setattr__(self, "value", value)

    @property
    def reached(self) -> Bools:
        """Whether a point is reached at an angle (n, m)."""
        return np.isfinite(self.value)

    @property
    def common(self) -> Bools:
        """Points (n,) that every gamma reaches."""
        return np.asarray(self.reached.all(axis=1))

    def within(self, inside: Bools) -> Distribution:
        """The same over some of the points: ``inside`` (n,).

        Raises
        ------
        InputError
            Another shape, or no point.
        """
        mask = _checked(inside, len(self.value))
        return Distribution(self.objective, self.gamma, self.value[mask], self.sure)

    def statistics(self, over: Over = "reached") -> Statistics:
        """Mean, scatter and range at each gamma."""
        require_one_of("statistics over", over, ("reached", "common"), code="S012")
        counted = self.reached if over == "reached" else np.broadcast_to(self.common[:, None], self.value.shape)
        number = counted.sum(axis=0)
        some = np.where(number > 0, number, np.nan)
        mean = np.where(counted, self.value, 0.0).sum(axis=0) / some
        away = np.where(counted, self.value - mean, 0.0)
        empty = number == 0
        return Statistics(
            over=over,
            points=np.asarray(number, dtype=np.int64),
            mean=mean,
            standard_deviation=np.sqrt((away**2).sum(axis=0) / some),
            smallest=np.where(empty, np.nan, np.where(counted, self.value, np.inf).min(axis=0)),
            largest=np.where(empty, np.nan, np.where(counted, self.value, -np.inf).max(axis=0)),
            share=self.reached.mean(axis=0),
        )

    def best_at_points(self) -> BestAtPoints:
        """Best gamma of each point by itself; of equally good ones (to 1e-9) the first."""
        merit = np.where(self.reached, self.objective.sign * self.value, -np.inf)
        column = _first_best(merit)
        found = self.reached.any(axis=1)
        value = self.value[np.arange(len(self.value)), column]
        gamma = np.where(found, self.gamma[column], np.nan)
        return BestAtPoints(np.where(found, column, -1), gamma, np.where(found, value, np.nan))

    def steady_at_points(self, price: float = PRICE) -> BestAtPoints:
        """A gamma for each point whose value is within the share ``price`` of its best, alike at neighbouring points.

        Of the angles that will do at a point it is the one next to the angle that is best for all points together.
        """
        merit = np.where(self.reached, self.objective.sign * self.value, -np.inf)
        best = merit.max(axis=1, keepdims=True)
        some = np.isfinite(best[:, 0])
        if not some.any():
            return self.best_at_points()
        with np.errstate(invalid="ignore"):
            will_do = self.reached & (merit >= best - price * np.abs(best))
            # How good an angle is at a point as a share of that point's best; 0 where it does not reach it.
            share = np.where(self.reached, np.minimum(np.abs(self.value / best), np.abs(best / self.value)), 0.0)
        favourite = self.gamma[int(share[some].sum(axis=0).argmax())]
        away = np.abs(np.angle(np.exp(1j * (self.gamma - favourite))))
        column = np.where(will_do, away, np.inf).argmin(axis=1)
        value = self.value[np.arange(len(self.value)), column]
        return BestAtPoints(
            np.where(some, column, -1), np.where(some, self.gamma[column], np.nan), np.where(some, value, np.nan)
        )


@dataclass(frozen=True, eq=False)
class BestAtPoints:
    """Best angle of each of n points: ``column`` (n,) into gamma, -1 where none; ``gamma`` rad and ``value`` or NaN."""

    column: Integers
    gamma: Array
    value: Array


@dataclass(frozen=True, eq=False)
class GammaChoice:
    """One gamma (rad) for all points of a region.

    ``column`` into the distribution's gamma; ``score`` (m,): mean or worst value over what each reaches, in the
    quantity's unit, NaN where a gamma was not allowed; ``share`` (m,) of the region that each gamma reaches.
    """

    column: int
    gamma: float
    value: float
    aim: Literal["mean", "worst"]
    score: Array
    share: Array


def distribution(
    model: fem.ArmModel,
    task: Task,
    objective: Objective | None = None,
    gamma: ArrayLike = (0.0,),
    *,
    generator: np.random.Generator | None = None,
    progress: Progress | None = None,
) -> Distribution:
    """Value of the best branch at every point of a task and every angle gamma (m,) rad.

    Parts of the points are worked on in turn, so only the result grows with their number. ``generator`` as in
    :func:`machining.posture.points.sweep_gamma`; ``progress`` is called with points done and points in all.

    Raises
    ------
    InputError
        As :func:`machining.sweep_parts.sweep_parts`.
    """
    objective = objective or Objective()
    angle = np.atleast_1d(np.asarray(gamma, dtype=np.float64))
    value, q, sure = [], [], True
    for _, _, sweep in sweep_parts(model, task, objective, angle, generator=generator, progress=progress):
        best, each = sweep.merit.max(axis=2), np.arange(len(sweep.merit))
        value.append(np.where(np.isfinite(best), objective.sign * best, np.nan))
        column = _first_best(best)
        branch = sweep.merit[each, column].argmax(axis=1)
        q.append(np.where(np.isfinite(best).any(axis=1)[:, None], sweep.q[each, column, branch], np.nan))
        sure = sure and bool(sweep.sure.all())
    return Distribution(objective, angle, np.concatenate(value), sure, np.concatenate(q))


@dataclass(frozen=True, eq=False)
class EveryGamma:
    """Rule of a map's poses (:class:`surrogate.maps.poses.PoseRule`): at each point that of its best gamma.

    It also tells ``by_gamma`` (n, m): the objective's value at each angle ``gamma`` (m,) rad, NaN where that does not
    reach the point. ``normal`` and tool ``axis`` (3,) in base axes; gamma counts from a direction of the part frame
    ``T_base_part`` (4, 4) m, as in :class:`machining.task.Task`. Errors as :func:`distribution`.
    """

    model: fem.ArmModel
    objective: Objective
    gamma: Array
    T_flange_tool: Array
    T_base_part: Array
    normal: Array
    axis: Array

    def task(self, points: Array) -> Task:
        """The task of bringing the tool to points (n, 3) m, base frame; it is no path, the order means nothing."""
        R = self.T_base_part[:3, :3]
        own = (points - self.T_base_part[:3, 3]) @ R
        return Task(tool_path(own, self.normal @ R, self.axis @ R), self.T_flange_tool, self.T_base_part)

    def choose(self, arm: Arm, points: Array, generator: np.random.Generator | None = None) -> Chosen:
        """Best gamma and branch at each point, and the value at every gamma; see the class."""
        found = distribution(self.model, self.task(points), self.objective, self.gamma, generator=generator)
        assert found.q is not None  # noqa: S101 - a distribution that was just made has poses
        return Chosen(found.q, np.full(len(points), found.sure), {"by_gamma": found.value})


def why_not_reached(model: fem.ArmModel, task: Task, gamma: ArrayLike, *, sample: int = 200) -> str:
    """Say in words what keeps the branches from the points: shares over some of the points and all angles.

    ``sample``: points looked at, spread over all. For arms in closed form; "" for others. Errors as
    :func:`machining.sweep_parts.sweep_parts`.
    """
    if why_no_closed_form(model.robot) is not None:
        return ""
    rows = np.unique(np.linspace(0, task.path.n - 1, sample).astype(int))
    found: Counter[int] = Counter()
    for _, _, sweep in sweep_parts(
        model, task.at(rows), Objective(), np.atleast_1d(np.asarray(gamma, dtype=np.float64))
    ):
        found.update(sweep.reason.ravel().tolist())
    shares = {Reason(code): count / found.total() for code, count in found.most_common() if code != Reason.NO_SUCH}
    return "; ".join(f"{100.0 * share:.3g} % of the branches {reason.words}" for reason, share in shares.items())


def best_gamma(
    found: Distribution,
    inside: Bools | None = None,
    *,
    aim: Literal["mean", "worst"] | None = None,
    partly: bool = False,
) -> GammaChoice:
    """The one gamma that is best for a region; of equally good ones (to 1e-9) the first.

    Parameters
    ----------
    inside : (n,) the region's points, as :func:`machining.stiffness.grid.in_box` and its like give; default all
    aim : the mean over the region or its worst point; default the objective's
    partly : also allow a gamma that does not reach all of the region: its value over what it reaches, times the share
        of the region that it reaches (for a quantity that is to be small, divided by it), decides. A point that is
        missed counts as one that has no stiffness; so a gamma cannot win by losing the soft places, nor lose the
        stiff ones to a few points at the rim

    Raises
    ------
    InputError
        No gamma reaches all of the region (``partly``: none of it); a region of another shape or without a point.
    """
    aim = aim or found.objective.aim
    require_one_of("aim of the best gamma", aim, ("mean", "worst"), code="S012")
    region = found if inside is None else found.within(inside)
    s = region.statistics()
    worst = s.largest if found.objective.minimised else s.smallest
    score = np.where((s.share > 0.0) & (partly | (s.share == 1.0)), s.mean if aim == "mean" else worst, np.nan)
    if np.isnan(score).all():
        most = int(s.share.argmax())
        whole = " all of" if not partly else " any point of"
        raise InputError(
            f"region of {len(region.value)} points: no gamma reaches{whole} it",
            code="S012",
            value=f"at most {100.0 * s.share[most]:.4g} % of it, at {np.degrees(found.gamma[most]):.4g} deg",
            allowed="a gamma that does",
            remedy="move or shrink the region, change the tool, or judge by what is reached (partly)",
        )
    with np.errstate(divide="ignore", invalid="ignore"):
        weighed = score / s.share if found.objective.minimised else score * s.share
    merit = np.where(np.isnan(score), -np.inf, found.objective.sign * weighed)
    column = int(_first_best(merit[None])[0])
    return GammaChoice(column, float(found.gamma[column]), float(score[column]), aim, score, s.share)


@dataclass(frozen=True, eq=False)
class TradeOff:
    """How good the angles gamma are against how much they reach, over a region of n points.

    ``points`` (m,) that each angle reaches; ``score`` (m,): mean or worst value over these, NaN where there are none;
    ``front``: columns of the angles that no other beats in both, those that reach most first.
    """

    gamma: Array
    points: Integers
    score: Array
    n: int
    aim: Literal["mean", "worst"]
    front: tuple[int, ...]


def trade_off(
    found: Distribution, inside: Bools | None = None, aim: Literal["mean", "worst"] | None = None
) -> TradeOff:
    """Mean or worst value against reach, over the points ``inside`` (n,), default all; errors as :func:`best_gamma`."""
    aim = aim or found.objective.aim
    require_one_of("aim of the best gamma", aim, ("mean", "worst"), code="S012")
    region = found if inside is None else found.within(inside)
    s = region.statistics()
    score = s.mean if aim == "mean" else s.largest if found.objective.minimised else s.smallest
    merit = np.where(np.isnan(score), -np.inf, found.objective.sign * score)
    front, best = list[int](), -np.inf
    for points in np.unique(s.points[s.points > 0])[::-1]:
        column = int(_first_best(np.where(s.points == points, merit, -np.inf)[None])[0])
        if merit[column] > best + TIED * abs(merit[column]):
            front.append(column)
            best = merit[column]
    return TradeOff(region.gamma, s.points, score, len(region.value), aim, tuple(front))


def _first_best(merit: Array) -> Integers:
    """Column of the largest merit (n, m) in each row: where rounding alone tells two apart, the first."""
    best = merit.max(axis=1, keepdims=True)
    # Nothing reached: all are -inf, and the first is as good as any.
    least = np.where(np.isfinite(best), best - TIED * np.abs(best), -np.inf)
    return np.asarray((merit >= least).argmax(axis=1), dtype=np.int64)


def _checked(inside: Bools, n: int) -> Bools:
    mask = np.asarray(inside)
    if mask.shape != (n,) or mask.dtype != np.bool_ or not mask.any():
        raise InputError(
            "region", code="S012", value=f"shape {mask.shape}, {mask.dtype}", allowed=f"({n},) of bool, some true"
        )
    return mask
