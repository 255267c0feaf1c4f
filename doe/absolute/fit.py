"""The estimate: frames, errors of the arm, what gives way, and variances, from absolute readings.

Steps of Gauss and Newton on the reduced triangle (:mod:`doe.absolute.reduced`), with exact derivatives; variances by
marginal likelihood (:mod:`doe.absolute.shrinkage`); compliances within their ranges (the engine's bounded step, on the
rows that are left to them alone). Readings scatter by Student's distribution in three directions with a tail that they
tell, so that a few wrong ones do not turn the frames.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.special import gammaln

from doe.absolute.chain import Sample, evaluate, loaded, samples
from doe.absolute.readings import AbsoluteReadings
from doe.absolute.reduced import FRAME, Frame, Reduced, block_rows, frame_columns, reduce_sessions, upper
from doe.absolute.shrinkage import Posterior, Variances, likeliest, posterior, starting, step_with
from doe.absolute.start import Start
from doe.absolute.unknowns import Layout
from doe.estimation.least_squares import bounded_step
from fem import ArmModel
from robots import InputError
from robots.arrays import Array, Indices
from robots.progress import Progress, report_progress

ROUNDS = 40
# Rounds in which weights are worked out anew, at the angles that joints really have.
LOADED = (1, 2, 4, 7)
# Rounds in which the readings are asked for variances.
TELLING = (1, 3, 6)
# Shares of a step that are tried one after the other until one comes nearer.
SHARES = (1.0, 0.5, 0.2, 0.05, 0.01)
# All positions together move by less than this share of their scatter in a step.
STILL = 1e-3
# Rounds after which variances are kept if they moved by less than this.
SAME = 0.01
# Tails of the scatter that are tried: degrees of freedom of Student's distribution.
TAILS = (3.0, 4.0, 6.0, 10.0, 20.0, 50.0, np.inf)


@dataclass(frozen=True)
class Fit:
    """What was found.

    ``u`` (p,): variables of ``layout``; ``frames`` by session; ``residual`` (n, 3) m in the arm's axes, read minus
    predicted; ``weight`` (n,): 1, less for readings far out; ``tail``: degrees of freedom of the scatter; ``free``
    (f,): the variables that were; ``reduced``: the triangle at the end, with weights; ``posterior``: the variables'
    distribution, as if compliances were not bounded; ``start``: where steps set out from; ``rounds``: steps taken, and
    whether they ``settled``.
    """

    model: ArmModel
    layout: Layout
    data: AbsoluteReadings
    u: Array
    frames: tuple[Frame, ...]
    residual: Array
    weight: Array
    variances: Variances
    tail: float
    free: Indices
    reduced: Reduced
    posterior: Posterior
    start: Start
    rounds: int
    settled: bool

    @property
    def moving(self) -> Layout:
        """The unknowns that were free, in the order of ``free``."""
        return Layout(tuple(self.layout.unknowns[k] for k in self.free))

    @property
    def sd(self) -> Array:
        """Standard deviations (p,) of the variables; zero of those that were held."""
        out = np.zeros(len(self.u))
        out[self.free] = np.sqrt(np.sum(self.half**2, axis=1))
        return out

    @property
    def half(self) -> Array:
        """H (f, f) with the free variables' covariance H H^T.

        What readings with tails tell of a place is less than their weighted squares say, by (d + 3) / (d + 5) in three
        directions (Lange, Little and Taylor 1989, doi:10.2307/2290063).
        """
        return self.widening * self.posterior.half

    @property
    def widening(self) -> float:
        """Factor on standard deviations by weighted squares for what tails cost."""
        return 1.0 if np.isinf(self.tail) else float(np.sqrt((self.tail + 5.0) / (self.tail + 3.0)))

    @property
    def prior_sd(self) -> Array:
        """The same before any reading; inf where nothing was known."""
        return self.variances.sds(self.layout.unknowns)

    @property
    def rms_m(self) -> float:
        """RMS of the distances between read and predicted positions."""
        return float(np.sqrt(np.mean(np.sum(self.residual**2, axis=1)))) if len(self.residual) else 0.0


def fit(
    model: ArmModel,
    data: AbsoluteReadings,
    layout: Layout,
    start: Start,
    *,
    held: Array | None = None,
    robust: bool = True,
    variances: Variances | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Estimate the unknowns of ``layout``, which has the targets of ``data``.

    ``held`` (p,): values of variables that stay as they are, NaN for those that are free; ``variances``: kept if given.

    Raises
    ------
    InputError
        Fewer readings than frames and targets need.
    """
    if 3 * len(data) <= FRAME * len(start.frames) + 3 * len(start.targets):
        raise InputError(
            "readings", code="C001", value=len(data), allowed=f"more than {2 * len(start.frames) + len(start.targets)}"
        )
    u = first_values(layout, start)
    free = np.arange(len(u)) if held is None else np.flatnonzero(np.isnan(held))
    u = u if held is None else np.where(np.isnan(held), u, held)
    work = _Work(model, layout, data, free, start)
    weight = start.agree.astype(float) * (1.0 - 1e-6) + 1e-6 if robust else np.ones(len(data))
    found = variances or starting(work.moving.unknowns, max(float(np.median(start.error)) / 1.5, 1e-6))
    state = _State(u, start.frames, weight, np.inf)
    settled, kept = False, variances is not None
    for turn in range(ROUNDS):
        if turn in LOADED:
            work.turn_under_load(state.u)
        reduced, residual = work.reduced(state, found.sigma)
        if turn in TELLING and not kept:
            before = found
            found = likeliest(reduced, state.u[free], work.moving.unknowns, found, work.readings)
            kept = turn == TELLING[-1] or abs(found.sigma / before.sigma - 1.0) < SAME
        open_, _ = posterior(reduced, state.u[free], work.first, work.sd(found), found.sigma)
        step = bounded_mode(open_, state.u[free], work.moving)
        moved = float(np.linalg.norm(reduced.R @ step)) / (found.sigma * np.sqrt(3.0 * len(data)))
        report_progress(progress, min(turn + 1, ROUNDS), ROUNDS)
        if kept and moved < STILL:
            settled = True
            break
        state, ahead = work.stepped(state, reduced, step, residual, found)
        if robust and turn:
            # Variances that were given say nothing of tails.
            asking = turn <= TELLING[-1] if variances is not None else not kept
            weight, tail = _weights(ahead, data, found.sigma, TAILS if asking else (state.tail,))
            state = replace(state, weight=weight, tail=tail)
    return Fit(
        model,
        layout,
        data,
        state.u,
        state.frames,
        residual,
        state.weight,
        found,
        state.tail,
        free,
        reduced,
        open_,
        start,
        turn + 1,
        settled,
    )


@dataclass(frozen=True)
class _State:
    """Where the steps are: variables (p,), frames, weights (n,) and the tail they belong to."""

    u: Array
    frames: tuple[Frame, ...]
    weight: Array
    tail: float


class _Work:
    """Readings in blocks by session, and the unknowns that move."""

    def __init__(self, model: ArmModel, layout: Layout, data: AbsoluteReadings, free: Indices, start: Start) -> None:
        self.model, self.layout, self.data, self.free, self.start = model, layout, data, free, start
        self.moving = Layout(tuple(layout.unknowns[k] for k in free))
        self.first = np.array([one.start for one in self.moving.unknowns])
        self.rows = [np.flatnonzero(data.session.number == s) for s in range(len(start.frames))]
        self.parts = [samples(model, _within(data, mine), layout, start.nominal) for mine in self.rows]
        self.readings = 3 * len(data) - FRAME * len(start.frames)

    def turn_under_load(self, u: Array) -> None:
        """Work out what gives way at the joints' real angles with variables u (p,)."""
        if self.layout.of("spring"):
            self.parts = [
                [loaded(self.model, part, self.data, self.layout, self.start.nominal, u) for part in parts]
                for parts in self.parts
            ]

    def sd(self, variances: Variances) -> Array:
        return variances.sds(self.moving.unknowns)

    def blocks(self, frames: Sequence[Frame]) -> Iterator[tuple[int, Sample, Indices, Frame]]:
        """Session, block, which of the readings (b,) it holds, and its frame."""
        for s, (mine, parts, frame) in enumerate(zip(self.rows, self.parts, frames, strict=True)):
            first = 0
            for part in parts:
                yield s, part, mine[first : first + len(part)], frame
                first += len(part)

    def reduced(self, state: _State, sigma: float) -> tuple[Reduced, Array]:
        """The triangle, and residuals (n, 3) m in the arm's axes."""
        residual = np.empty((len(self.data), 3))
        root = np.sqrt(state.weight * given_weight(self.data, sigma))
        sessions: list[list[Callable[[], Array]]] = [[] for _ in self.rows]
        for s, part, rows, frame in self.blocks(state.frames):
            sessions[s].append(partial(self._rows, part, rows, frame, state.u, root, residual))
        return reduce_sessions(sessions, len(self.free)), residual

    def _rows(self, part: Sample, rows: Indices, frame: Frame, u: Array, root: Array, residual: Array) -> Array:
        P, J = evaluate(self.model, self.layout, part, u)
        r = frame.inside(self.data.position[rows]) - P
        residual[rows] = r.T
        return block_rows(frame_columns(P), J[self.free], r, root[rows])

    def stepped(
        self, state: _State, reduced: Reduced, step: Array, residual: Array, found: Variances
    ) -> tuple[_State, Array]:
        """The state after as much of a step as comes nearer to the readings and the priors, and residuals there."""
        root, sd = state.weight * given_weight(self.data, found.sigma) / found.sigma**2, self.sd(found)

        def loss(u: Array, r: Array) -> float:
            return float(root @ np.sum(r**2, axis=1) + np.sum(((u[self.free] - self.first) / sd) ** 2))

        here, ahead, r = loss(state.u, residual), state, residual
        for share in SHARES:
            u = state.u.copy()
            u[self.free] += share * step
            frames = tuple(f.moved(share * own.step(step)) for f, own in zip(state.frames, reduced.own, strict=True))
            ahead = replace(state, u=u, frames=frames)
            r = self.residuals(ahead)
            if loss(u, r) <= here:
                break
        return ahead, r

    def residuals(self, state: _State) -> Array:
        """Residuals (n, 3) m in the arm's axes, without derivatives."""
        out = np.empty((len(self.data), 3))
        for _, part, rows, frame in self.blocks(state.frames):
            P, _ = evaluate(self.model, self.layout, part, state.u, slopes=False)
            out[rows] = (frame.inside(self.data.position[rows]) - P).T
        return out


def _within(data: AbsoluteReadings, rows: Indices) -> AbsoluteReadings:
    """Readings of a session with the targets' numbers as they are in all."""
    part = data.take(rows)
    return replace(part, target=replace(data.target, number=data.target.number[rows]))


def first_values(layout: Layout, start: Start) -> Array:
    """Variables (p,) to begin with."""
    u = np.array([one.start for one in layout.unknowns])
    for k, (t, a) in layout.of("target"):
        u[k] = start.targets[t, a]
    for k, (turns, order, a) in layout.of("rail"):
        if (turns, order) == (0, 1):
            u[k] = start.way[a]
    return u


def given_weight(data: AbsoluteReadings, sigma: float) -> Array:
    """Weights (n,) by the standard deviations that readings bring, on top of a scatter that all have."""
    own = np.nan_to_num(data.sigma)
    return np.asarray(sigma**2 / (sigma**2 + own**2))


def bounded_mode(free: Posterior, u: Array, layout: Layout) -> Array:
    """The step to the mode within the ranges: bounded variables on the rows that no other one has a say in."""
    low, high = (np.array([getattr(one, end) for one in layout.unknowns]) for end in ("low", "high"))
    limited = layout.places(lambda one: one.kind == "spring")
    if not limited.size or ((u + free.step >= low) & (u + free.step <= high))[limited].all():
        return free.step
    other = np.setdiff1d(np.arange(len(u)), limited)
    R = upper(np.column_stack([free.root[:, other], free.root[:, limited], free.root @ free.step]))
    k, p = len(other), len(u)
    inside = bounded_step(R[k:p, k:p], R[k:p, p], (low - u)[limited], (high - u)[limited])
    return step_with(free, limited, inside)


def _weights(residual: Array, data: AbsoluteReadings, sigma: float, tails: Sequence[float]) -> tuple[Array, float]:
    """Weights (n,) of Student's distribution in three directions with the likeliest tail, and that."""
    square = np.sum(residual**2, axis=1) * given_weight(data, sigma) / sigma**2
    best, chosen = -np.inf, tails[0]
    for nu in tails:
        scale = _scale(square, nu)
        value = _log_likelihood(square / scale, nu) - 1.5 * len(square) * float(np.log(scale))
        if value > best + 1.0:
            best, chosen = value, nu
    return (np.ones(len(square)) if np.isinf(chosen) else (chosen + 3.0) / (chosen + square)), chosen


def _scale(square: Array, nu: float) -> float:
    """Factor on the variance for squares (n,) of three directions that are alike."""
    scale = max(float(np.median(square)) / 2.366, 1e-12)
    for _ in range(30):
        weight = np.ones(len(square)) if np.isinf(nu) else (nu + 3.0) / (nu + square / scale)
        scale = max(float(np.mean(weight * square)) / 3.0, 1e-12)
    return scale


def _log_likelihood(square: Array, nu: float) -> float:
    """Of squares (n,) over the scale, but for a constant of three normal directions."""
    if np.isinf(nu):
        return float(-0.5 * square.sum() - 1.5 * len(square) * np.log(2.0 * np.pi))
    each = gammaln(0.5 * (nu + 3.0)) - gammaln(0.5 * nu) - 1.5 * np.log(nu * np.pi)
    return float(len(square) * each - 0.5 * (nu + 3.0) * np.log1p(square / nu).sum())
