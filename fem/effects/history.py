"""When readings were taken, and what remembers it: play, ratchets, what sticks and jumps, what creeps, what warms up.

A law with a memory starts from rest in each load cycle, for that is where a gauge is zeroed; what lags behind recovers
in the time between cycles, where the table says how long that is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.linalg import solve_banded

from robots.arrays import Array, Bools, Indices

# Seconds between readings of a cycle where a table has no times: to hang a load, wait and read.
BETWEEN = 30.0
# Time to settle, in shares of a campaign's, that leaves a nearly straight course.
SLOW = 10.0
# Temperature (deg C) to which laws refer; any would do, for the springs are free.
ROOM = 20.0


# What sticks under no load: gone before the next load cycle (0); still there until the arm moves on, with a gauge that
# is zeroed before each cycle (1), or once (2).
Carried = Literal[0, 1, 2]


@dataclass(frozen=True)
class History:
    """When n readings were taken.

    ``cycle`` (n,): number of the load cycle a reading belongs to, each of which starts unloaded; ``order`` (n,): its
    place in the cycle, from 0, equal for readings taken at one time; ``clock`` (n,): time in the whole campaign, 0 at
    the first reading, 1 at the last; NaN where it is not known. ``is_known``: whether loading and unloading are told
    apart; else each reading is taken as a loading from zero. ``session`` (n,): number of the day or visit, all 0 where
    that is not known. ``seconds`` (n,): time from the first reading; ``temperature`` (n,): deg C; NaN where not known.
    ``stay`` (n,): number of the stay at a pose: between cycles of one stay, in the order of the clock, the arm did not
    move; where that is not known each cycle is a stay of its own.
    """

    cycle: Indices
    order: Indices
    clock: Array
    is_known: bool
    session: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    seconds: Array = field(default_factory=lambda: np.zeros(0))
    temperature: Array = field(default_factory=lambda: np.zeros(0))
    stay: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.intp))

    def __post_init__(self) -> None:
        n = len(self.cycle)
        unknown = {"session": np.zeros(n, dtype=np.intp), "seconds": np.full(n, np.nan)}
        unknown |= {"temperature": unknown["seconds"], "stay": self.cycle}
        for name, nothing in unknown.items():
            if not len(getattr(self, name)):
                object.__setattr__(self, name, nothing)

    def unloading(self, size: Array) -> Bools:
        """Whether readings (n,) were taken on the way down; ``size`` (n,): of their loads.

        That is, a larger load came before in the cycle.
        """
        most = self.follow(lambda now, last: np.maximum(size[now], last))
        return np.asarray(size < most - 1e-9)

    def follow(self, law: Callable[[Indices, Array], Array]) -> Array:
        """A state (n,) along every cycle, 0 before its first reading.

        ``law(now, last)``: the state at readings ``now`` (k,), one of each cycle, from the states ``last`` (k,) before.
        """
        y, before = np.zeros(len(self.cycle)), np.zeros(int(self.cycle.max(initial=-1)) + 1)
        for step in range(int(self.order.max(initial=-1)) + 1):
            now = np.flatnonzero(self.order == step)
            mine = self.cycle[now]
            y[now] = law(now, before[mine])
            before[mine] = y[now]
        return y

    def play(self, x: Array, width: Array | float, carried: Carried = 0) -> Array:
        """The play operator over every cycle: y (n,) follows x (n,) at a distance of at most ``width``.

        ``y_i = max(x_i - r, min(x_i + r, y_(i-1)))`` with y = 0 before the first (Visintin 1994,
        doi:10.1007/978-3-662-11557-2, ch. III). ``carried``: :data:`Carried`.
        """
        z = np.append(x, 0.0)
        r = np.append(np.broadcast_to(np.asarray(width, dtype=np.float64), x.shape), np.min(width, initial=np.inf))

        def law(now: Indices, last: Array) -> Array:
            return np.asarray(np.maximum(z[now] - r[now], np.minimum(z[now] + r[now], last)))

        return self._follow(law, carried)

    def stick(self, x: Array, width: float, kept: float, carried: Carried = 0) -> Array:
        """What stays where it is until x (n,) is more than ``width`` away, then jumps to ``kept`` of that from x.

        Static and sliding friction in their simplest form (Armstrong-Helouvry, Dupont, Canudas de Wit 1994,
        doi:10.1016/0005-1098(94)90209-7), in steps of what was read. ``carried``: :data:`Carried`. Returns (n,).
        """
        z = np.append(x, 0.0)

        def law(now: Indices, last: Array) -> Array:
            held = z[now] - last
            return np.where(np.abs(held) > width, z[now] - np.sign(held) * kept * width, last)

        return self._follow(law, carried)

    def _follow(self, law: Callable[[Indices, Array], Array], carried: Carried) -> Array:
        return self.follow_on(law, zeroed=carried == 1) if carried else self.follow(law)

    def follow_on(self, law: Callable[[Indices, Array], Array], *, zeroed: bool) -> Array:
        """A state (n,) along every stay, 0 before its first reading; ``zeroed``: less what it was at its cycle's start.

        Between cycles the arm is unloaded where it stands: ``law`` is asked for number n there, the load that is none.
        """
        n = len(self.cycle)
        out, stays = np.zeros(n), self._events
        last, zero = np.zeros(len(stays)), np.zeros(len(stays))
        for now in stays.T:
            there = now >= 0
            last[there] = law(now[there], last[there])
            zero = np.where((now == n) & zeroed, last, zero)
            read = there & (now < n)
            out[now[read]] = (last - zero)[read]
        return out

    @cached_property
    def _events(self) -> Indices:
        """Readings (stays, steps) of each stay in order, n for the unloaded arm between two cycles, -1 after all."""
        n = len(self.cycle)
        row = self._in_time
        row = row[np.argsort(self.stay[row], kind="stable")]
        stay = np.cumsum(np.diff(self.stay[row], prepend=self.stay[row[0]] if n else 0) != 0)
        again = self._starts(row) & np.concatenate([[False], np.diff(stay) == 0])[:n]
        events = np.insert(row, np.flatnonzero(again), n)
        stay = np.insert(stay, np.flatnonzero(again), stay[again])
        step = np.arange(len(stay)) - np.searchsorted(stay, stay)
        out = np.full((int(stay.max(initial=-1)) + 1, int(step.max(initial=-1)) + 1), -1, dtype=np.intp)
        out[stay, step] = events
        return out

    def ratchet(self, x: Array, limit: float, *, lasting: bool, zeroed_once: bool = False) -> Array:
        """What x (n,) at its largest has exceeded a limit by, less at the cycle's start; it never goes back.

        ``lasting``: what slipped in one cycle has slipped for all that come after, by the clock if there is one.
        ``zeroed_once``: less at the start of the stay, for that is where the gauge was zeroed.
        """
        beyond = np.maximum(x - limit, 0.0)
        if not lasting:
            if zeroed_once:
                more = np.append(beyond, 0.0)
                return self.follow_on(lambda now, last: np.maximum(more[now], last), zeroed=False)
            return self.follow(lambda now, last: np.maximum(beyond[now], last))
        row = self._in_time
        most = np.maximum.accumulate(beyond[row])
        zeroed = self._zeroed(row, once=zeroed_once)
        before = np.concatenate([[0.0], most[:-1]])[zeroed][np.cumsum(zeroed) - 1]
        out = np.empty(len(x))
        out[row] = most - before
        return out

    def lag(self, x: Array, seconds: float, *, zeroed_once: bool = False) -> Array:
        """Solution y (n,) of ``T dy/dt = x - y``, less its value at the start of the cycle; T in s.

        A load is put on half way between two readings, and nothing hangs between cycles. Without times readings are
        taken ``BETWEEN`` seconds apart, and what lags has recovered before the next cycle. ``zeroed_once``: less its
        value at the start of the stay, for that is where the gauge was zeroed.
        """
        row, half, rest = self._pauses
        if not len(row):
            return np.zeros(0)
        starts, aim = self._starts(row), x[row]
        held, off = np.exp(-half / seconds), np.exp(-rest / seconds)
        # From one reading to the next all is linear, y_i = a_i y_(i-1) + b_i: first the load before, then the new one.
        a = held * np.where(starts, off, held)
        last = np.where(starts, 0.0, np.concatenate([[0.0], aim[:-1]]))
        b = (1.0 - held) * (aim + held * last)
        y = solve_banded((1, 0), np.stack([np.ones(len(a)), np.append(-a[1:], 0.0)]), b)
        zeroed = self._zeroed(row, once=zeroed_once)
        zero = (off * np.concatenate([[0.0], y[:-1]]))[zeroed]
        out = np.empty(len(x))
        out[row] = y - zero[np.cumsum(zeroed) - 1]
        return out

    def warmth(self, settling: float) -> Array:
        """How warm (n,) an arm is that was cold at the start of each session: 1 after the whole campaign.

        ``(1 - exp(-t / T)) / (1 - exp(-1 / T))``, t the session's part of the campaign's time, T ``settling``, a share
        of it too. T = 0: as warm as was read, 1 for each 10 K above room temperature; where that was not, T = ``SLOW``.
        """
        if settling <= 0.0 and np.isfinite(self.temperature).all():
            return np.asarray((self.temperature - ROOM) / 10.0)
        settling = settling or SLOW
        t = self.clock_or_middle
        if not np.isfinite(self.clock).all():
            return settled(t, settling)
        cold = np.full(int(self.session.max(initial=0)) + 1, np.inf)
        np.minimum.at(cold, self.session, t)
        return settled(t - cold[self.session], settling)

    @property
    def outlasts_cycles(self) -> bool:
        """Whether there is a stay of several load cycles."""
        return len(np.unique(self.stay)) < len(np.unique(self.cycle))

    def varies(self, what: Literal["temperature", "session"]) -> bool:
        """Whether readings differ in their temperature, which all of them have, or their session."""
        x = getattr(self, what)
        return bool(len(x) and np.isfinite(x).all() and np.ptp(x) > 0.0)

    @property
    def fresh(self) -> Bools:
        """Whether readings (n,) are of the first of several cycles of a stay."""
        cycle = np.unique(np.column_stack([self.stay, self.cycle]), axis=0)
        several = np.unique(cycle[:, 0], return_counts=True)
        begun = np.full(int(self.cycle.max(initial=-1)) + 1, np.inf)
        np.minimum.at(begun, self.cycle, self.clock_or_middle)
        first = np.full(int(self.stay.max(initial=-1)) + 1, np.inf)
        np.minimum.at(first, self.stay, begun[self.cycle])
        return np.asarray(np.isin(self.stay, several[0][several[1] > 1]) & (begun[self.cycle] <= first[self.stay]))

    @property
    def clock_or_middle(self) -> Array:
        """The clock (n,), half way where it is not known: what changes over a campaign is then as it was on average."""
        return np.nan_to_num(self.clock, nan=0.5)

    def followed(self, cycles: int, readings: int, clock: float) -> History:
        """The history and after it, on a visit of its own, so many cycles of so many readings, at a time ``clock``.

        They come ``BETWEEN`` seconds apart, each cycle an hour after the last, at the last temperature.
        """
        new = cycles * readings
        step = np.tile(np.arange(readings), cycles)
        after = 3600.0 * (1 + np.repeat(np.arange(cycles), readings)) + BETWEEN * step
        visit = int(self.session.max(initial=0)) + int(self.session.any())
        return History(
            np.concatenate([self.cycle, int(self.cycle.max(initial=-1)) + 1 + np.repeat(np.arange(cycles), readings)]),
            np.concatenate([self.order, step]).astype(np.intp),
            np.concatenate([self.clock, np.full(new, clock)]),
            self.is_known,
            np.concatenate([self.session, np.full(new, visit)]),
            np.concatenate([self.seconds, self.seconds.max(initial=0.0) + after]),
            np.concatenate([self.temperature, np.full(new, self.temperature[-1] if len(self.temperature) else np.nan)]),
            np.concatenate([self.stay, int(self.stay.max(initial=-1)) + 1 + np.repeat(np.arange(cycles), readings)]),
        )

    def take(self, rows: Indices) -> History:
        """The history of some readings; a memory only knows what is still there, so keep whole cycles."""
        cycle = np.unique(self.cycle[rows], return_inverse=True)[1].astype(np.intp)
        kept = (getattr(self, name)[rows] for name in ("session", "seconds", "temperature", "stay"))
        return History(cycle, self.order[rows], self.clock[rows], self.is_known, *kept)

    @cached_property
    def _in_time(self) -> Indices:
        """Readings (n,) in the order of time; cycle by cycle where that is not known."""
        by_clock = np.isfinite(self.clock).all()
        return np.lexsort((self.order, self.cycle, self.clock) if by_clock else (self.order, self.cycle))

    def _starts(self, row: Indices) -> Bools:
        """Whether readings in the order of time are a cycle's first."""
        return np.asarray(np.diff(self.cycle[row], prepend=-1) != 0)

    def _zeroed(self, row: Indices, *, once: bool) -> Bools:
        """Whether the gauge was zeroed before readings in the order of time: at each cycle, or each stay's first."""
        starts = self._starts(row)
        return np.asarray(starts & (np.diff(self.stay[row], prepend=-1) != 0)) if once else starts

    @cached_property
    def _pauses(self) -> tuple[Indices, Array, Array]:
        """Readings in the order of time (n,), half of the time since the one before, and the unloaded time before."""
        if not np.isfinite(self.seconds).all():
            n = len(self.cycle)
            return np.lexsort((self.order, self.cycle)), np.full(n, 0.5 * BETWEEN), np.full(n, np.inf)
        row = np.lexsort((self.order, self.cycle, self.seconds))
        starts = self._starts(row)
        gap = np.maximum(np.diff(self.seconds[row], prepend=0.0), 0.0)
        usual = float(np.median(gap[~starts])) if (~starts).any() else BETWEEN
        half = 0.5 * np.where(starts, usual, gap)
        return row, half, np.maximum(gap - half, 0.0)


def settled(t: Array, settling: float) -> Array:
    """``(1 - exp(-t/T)) / (1 - exp(-1/T))`` of times (n,) from 0 to 1: nearly straight for large T."""
    return np.asarray((1.0 - np.exp(-t / settling)) / (1.0 - np.exp(-1.0 / settling)))


def plain_history(n: int) -> History:
    """Each of n readings a loading of its own, from zero; no clock."""
    return History(np.arange(n), np.zeros(n, dtype=np.intp), np.full(n, np.nan), is_known=False)
