"""What an arm with something hidden really does under a table's loads, set-up by set-up, without noise."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from .arms import Arm, Section, rotation
from .catalogue import EVERY
from .deck import STIFF
from .history import Event, run
from .laws import Moment
from .plan import Joint, Plan, build
from .spec import Effect, Row, Spec

Array = NDArray[np.float64]
REST = 20.0  # s between the end of settling and the gauge's zero


@dataclass(frozen=True)
class Off:
    """What is off beside the effects: the arm (lengths, zeros, soft links), and weights and ropes."""

    arm: bool = True
    loads: bool = True


HONEST = Off(arm=False, loads=False)


def true_arm(spec: Spec, off: Off) -> Arm:
    """Lengths off by 0.5 mm and joint zeros by 0.03 deg."""
    arm = spec.of
    if not off.arm:
        return arm
    rng, n = spec.rng(4), len(arm.joints)
    return arm.shifted(rng.normal(0, 5e-4, (n + 1, 3)), rng.normal(0, 0.03, n))


def true_force(spec: Spec, row: Row, off: Off) -> Array:
    """Every weight off by 0.1 %, and every set-up's rope by 0.1 deg."""
    if not off.loads or row.load == 0:
        return row.force
    weight = 1 + 1e-3 * spec.rng(5, round(10 * row.load)).normal()
    lean = np.radians(spec.rng(6, row.visit).normal(0, 0.1, 2))
    return weight * rotation(np.array([0.0, 1, 0]), lean[0]) @ rotation(np.array([1.0, 0, 0]), lean[1]) @ row.force


def true_angles(effects: Iterable[Effect], arm: Arm, q: Array) -> Array:
    """What the table's angles (n,) stand for, deg."""
    for e in effects:
        q = EVERY[e.family].true_angles(e, arm, q)
    return q


def _soft(spec: Spec, arm: Arm) -> dict[int, Section]:
    """Links of which each gives as much as it takes to add up to a share of what the second joint gives."""
    lengths = np.append(np.linalg.norm(arm.frames[:, :3, 3], axis=1), np.linalg.norm(arm.flange))
    # A beam's end turns by M L / (E I).
    each = spec.springs[1] / (spec.soft_links * 0.5)
    return {i: Section(1e14, each * x, each * x, 1.0, 1.0) for i, x in enumerate(lengths.tolist()) if x > 0.1}


def plan_of(spec: Spec, arm: Arm, effects: tuple[Effect, ...], off: Off, q: Array, point: Array, when: Moment) -> Plan:
    """The frame's plan at stated angles (n,) in deg."""
    q = true_angles(effects, arm, q)
    turn = np.radians(arm.signs * q + arm.offsets)
    # A joint that the model holds rigid is so, until a law says what it is.
    joints = [Joint(k if stated else STIFF) for k, stated in zip(spec.springs, spec.stated, strict=True)]
    plan = Plan(arm, arm.stand(q), joints, turn, point, path=spec.path, balance=spec.balance)
    if off.arm and spec.soft_links:
        plan.beams |= _soft(spec, arm)
    for e in effects:
        EVERY[e.family].change(e, plan, when)
    return plan


def _pulls(spec: Spec, rows: list[Row], effects: tuple[Effect, ...], off: Off) -> list[tuple[Array, Array, Array]]:
    """Of every row the true force, where it acts and where it is read."""
    out = []
    for row in rows:
        pull = (true_force(spec, row, off), row.point, row.point)
        for e in effects:
            pull = EVERY[e.family].pull(e, row, *pull)
        out.append(pull)
    return out


def _events(plan: Plan, rows: list[Row], pulls: list[tuple[Array, Array, Array]]) -> list[Event]:
    """No load until the gauge is zeroed, then the loads, for each cycle."""
    start = rows[0].zero_s - REST
    events: list[Event] = []
    cycle = None
    for row, (force, at, read) in zip(rows, pulls, strict=True):
        last = events[-1].until_s if events else 0.0
        if row.cycle != cycle:
            events.append(Event(last, row.zero_s - start, np.zeros(6), True))
            cycle, last = row.cycle, row.zero_s - start
        moment = row.moment + np.cross(plan.stand.turned[-1] @ (at - read), force)
        events.append(Event(last, row.time_s - start, np.append(force, moment), True))
    return events


def _stay(spec: Spec, arm: Arm, rows: list[Row], effects: tuple[Effect, ...], off: Off) -> Array:
    """Readings (n, 3) in m while the arm stays where it is."""
    first = rows[0]
    came = float(np.sign(spec.rng(7, first.visit, first.cycle if spec.moves else 0).normal()))
    when = Moment(first.visit, first.time_s, first.session, first.since_s, came)
    pulls = _pulls(spec, rows, effects, off)
    plan = plan_of(spec, arm, effects, off, first.angles, pulls[0][2], when)
    deck, nodes = build(plan)
    found = iter(run(plan, deck, nodes, _events(plan, rows, pulls), spec.settle_s)[:, :3])
    out = []
    for _, cycle in groupby(rows, lambda r: r.cycle):
        one = list(cycle)
        zero = next(found)
        moved = np.array([next(found) - zero for _ in one])
        for e in effects:
            moved = EVERY[e.family].read(e, one, moved)
        out.append(moved)
    return np.vstack(out)


def readings(spec: Spec, rows: list[Row], effects: tuple[Effect, ...] | None = None, off: Off = HONEST) -> Array:
    """What a gauge without noise says (n, 3), m. RuntimeError: a frame finds no equilibrium."""
    effects = spec.effects if effects is None else effects
    arm = true_arm(spec, off)
    stays = groupby(rows, lambda r: (r.visit, r.cycle if spec.moves else 0))
    return np.vstack([_stay(spec, arm, list(stay), effects, off) for _, stay in stays])
