"""The substitute stiffness model: six stiffnesses at every joint, each over that joint's angle, with uncertainty.

Diagonal model: row r of joint j gives way by ``c_jr(q_j)`` times the force or moment of that row. Each set-up gives
one compliance a row (:mod:`doe.joint_twists.cycles`), and the law over the angle is fitted to these. Set-ups scatter
beyond the noise of their readings (mounts, poses of the other joints): by a share of the compliance, common to all
translations and to all rotations, found from set-ups at the same angle by restricted likelihood (Patterson and
Thompson 1971, doi:10.1093/biomet/58.3.545) and added to their variances.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from doe.joint_twists.cycles import Branches, Cycles, cycles_of
from doe.joint_twists.laws import (
    FEWEST_FOR_A_LAW,
    FEWEST_FOR_ORDER_TWO,
    LAWS,
    Direction,
    LawKind,
    angles_of,
    check_law,
    choose_law,
    fit_law,
    fullest,
)
from doe.joint_twists.readings import TwistReadings
from fem import ArmModel
from fem.statics.ports import ROWS
from robots import InputError
from robots.arrays import Array

# Rows of a joint that carry less than this share of their largest possible load (a force: all of the load; a moment:
# the load at one metre) were not loaded: what they do is noise.
UNLOADED = 1e-6
MOST_SCATTER = 2.0
# Freedoms with which Student's distribution is the normal one.
PLENTY = 10**9
KINDS = ("translations", "rotations")
# Fewer spare set-ups say nothing about their scatter.
FEWEST_SPARE = 6
NO_NOISE = (
    "no load cycle has more readings than are fitted to it, and the table gives no standard deviation (sigma_mm, "
    "sigma_twist_mrad): nothing tells the noise of a reading"
)


@dataclass(frozen=True, eq=False)
class Identified:
    """A campaign's result: 6 stiffnesses a joint.

    ``directions``: by joint and row; ``cycles``: what they rest on; ``scatter`` (2,): of set-ups, as a share of the
    compliance of translations and rotations, with ``scatter_dof``; ``branches``: which readings were used;
    ``unjudged``: what these readings cannot judge, and why.
    """

    robot: str
    data: TwistReadings
    cycles: Cycles
    directions: Mapping[tuple[str, str], Direction]
    scatter: tuple[float, float]
    scatter_dof: tuple[int, int]
    branches: Branches
    notes: tuple[str, ...]
    unjudged: tuple[Unjudged, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(dict.fromkeys(joint for joint, _ in self.directions))

    def compliances(self, q: Array) -> tuple[Array, Array]:
        """Compliances (n, dof, 6) at poses q, zero where there is no number, and their standard deviations."""
        c, sd = np.zeros((2, len(q), len(self.directions) // 6, 6))
        for k, d in enumerate(self.directions.values()):
            if d.law is not None:
                c[:, k // 6, k % 6], sd[:, k // 6, k % 6] = d.compliance(q[:, k // 6])
        return c, sd


def identify(
    model: ArmModel, data: TwistReadings, *, law: LawKind | None = None, branches: Branches = "mean"
) -> Identified:
    """Identify six stiffnesses at every joint of a serial arm.

    Parameters
    ----------
    law : of every direction; None takes for each the fullest that its angles can tell
    branches : "mean" of loading and unloading, or "loading" alone

    Raises
    ------
    InputError
        What :func:`doe.joint_twists.cycles.cycles_of` refuses; a law that the angles measured cannot tell; an
        unknown law.
    """
    if law is not None and law not in LAWS:
        raise InputError("law of the stiffnesses", code="J004", value=law, allowed=", ".join(LAWS))
    cycles = cycles_of(model, data, branches)
    names = model.robot.joint_names
    if law is not None:
        for j, name in enumerate(names):
            if (cycles.joint == j).any():
                check_law(law, name, angles_of(cycles.angle[cycles.joint == j])[0])
    setups = [_setups(cycles, j, r) for j in range(len(names)) for r in range(6)]
    scatter, dof = zip(*(_scatter(setups, kind) for kind in (0, 1)), strict=True)
    directions = {}
    for s in setups:
        d = _direction(names[s.joint], s, scatter[s.row // 3], dof[s.row // 3], law, cycles)
        directions[d.joint, d.row] = d
    open_questions = unjudged(directions, cycles, names, law, dof)
    notes = (*_notes(directions, cycles, names), *(one.words for one in open_questions))
    return Identified(model.robot.name, data, cycles, directions, scatter, dof, branches, notes, open_questions)


@dataclass(frozen=True, eq=False)
class _SetUps:
    """Compliance of one row of one joint by set-up: angle (s,) rad of the joint, c (s,), variance (s,)."""

    joint: int
    row: int
    angle: Array
    c: Array
    variance: Array


def _setups(cycles: Cycles, joint: int, row: int) -> _SetUps:
    """Weighted least squares through zero over the cycles of each set-up."""
    t, u, v = cycles.carried[:, row], cycles.slope[:, row], cycles.variance[:, row]
    use = (cycles.joint == joint) & np.isfinite(u) & (np.abs(t) > UNLOADED)
    _, first, place = np.unique(cycles.setup[use], return_index=True, return_inverse=True)
    information = np.bincount(place, t[use] ** 2 / v[use])
    c = np.bincount(place, t[use] * u[use] / v[use]) / information
    return _SetUps(joint, row, cycles.angle[use][first], c, 1.0 / information)


def _scatter(setups: list[_SetUps], kind: int) -> tuple[float, int]:
    """Scatter of set-ups at one angle as a share of the compliance, by restricted likelihood, and its freedoms.

    Each angle has a mean of its own, so no law is taken for granted; a set-up alone at its angle says nothing.
    """
    mine = [s for s in setups if s.row // 3 == kind and s.c.size]
    c = np.concatenate([np.zeros(0), *(s.c for s in mine)])
    v = np.concatenate([np.zeros(0), *(s.variance for s in mine)])
    numbers, groups = [np.zeros(0, dtype=np.intp)], 0
    for s in mine:
        numbers.append(groups + angles_of(s.angle)[1])
        groups = int(numbers[-1].max()) + 1
    place, spare = np.concatenate(numbers), len(c) - groups
    if spare < FEWEST_SPARE:
        return 0.0, 0

    def minus_twice_log(share: float) -> float:
        w = 1.0 / v
        for _ in range(3):
            information = np.bincount(place, w)
            mean = np.bincount(place, w * c) / information
            w = 1.0 / (v + (share * mean[place]) ** 2)
        information = np.bincount(place, w)
        return float(np.sum(w * (c - mean[place]) ** 2) - np.sum(np.log(w)) + np.sum(np.log(information)))

    shares = np.concatenate([[0.0], np.geomspace(1e-5, MOST_SCATTER, 40)])
    values = [minus_twice_log(share) for share in shares]
    k = int(np.argmin(values))
    if k == 0:
        return 0.0, spare
    ends = (shares[k - 1], shares[min(k + 1, len(shares) - 1)])
    return float(minimize_scalar(minus_twice_log, bounds=ends, method="bounded").x), spare


def _direction(name: str, s: _SetUps, scatter: float, dof: int, asked: LawKind | None, cycles: Cycles) -> Direction:
    row, none, kind = ROWS[s.row], np.zeros(0), s.row // 3
    is_judged = bool(cycles.noise_known[s.joint, kind]) or dof > 0
    # Where nothing was estimated there are no freedoms to run short of.
    free = min([int(n) for n in (dof, cycles.noise_dof[s.joint, kind]) if n > 0], default=PLENTY)
    if not s.c.size:
        return Direction(name, row, "not identified", None, np.nan, np.nan, none, none, none, free)
    angle, place = angles_of(s.angle)
    means = [_mean(s.c[place == a], s.variance[place == a], scatter) for a in range(len(angle))]
    value, sd = np.array(means).T
    mean, spread = _mean(s.c, s.variance, scatter)
    if not is_judged:
        spread, sd = np.nan, np.full_like(sd, np.nan)
    found = Direction(name, row, "not determined", None, mean, spread, angle, value, sd, free)
    if not mean > 0.0:
        return found
    readings = (s.angle, s.c, s.variance, scatter)
    if mean < found.quantile * spread:
        law = fit_law("constant", *readings)
        return found if law is None else replace(found, status="one-sided", law=law)
    chosen, scores = (asked, {}) if asked else choose_law(*readings)
    law = fit_law(chosen, *readings) or fit_law("constant", *readings)
    if law is None:
        return replace(found, scores=scores)
    if is_judged:
        told = replace(found, status="determined", law=law, scores=scores)
        # Where rigid is possible at an angle that was measured, there is no upper limit, and it is not determined.
        limited = bool(np.isfinite(told.stiffness(angle)[2]).all())
        return told if limited else replace(told, status="one-sided")
    unsure = replace(law, covariance=np.full_like(law.covariance, np.nan))
    return replace(found, status="not judged", law=unsure, scores=scores)


def _mean(c: Array, variance: Array, scatter: float) -> tuple[float, float]:
    mean = float(np.sum(c / variance) / np.sum(1.0 / variance))
    w = 1.0 / (variance + (scatter * mean) ** 2)
    return float(np.sum(w * c) / np.sum(w)), float(1.0 / np.sqrt(np.sum(w)))


def _notes(directions: Mapping[tuple[str, str], Direction], cycles: Cycles, names: tuple[str, ...]) -> tuple[str, ...]:
    out = []
    unwatched = [name for j, name in enumerate(names) if not (cycles.joint == j).any()]
    if unwatched:
        out.append(f"no readings of {', '.join(unwatched)}: their stiffnesses are not identified")
    never = [f"{j}.{r}" for (j, r), d in directions.items() if d.status == "not identified" and j not in unwatched]
    if never:
        out.append(f"never loaded or never read, so not identified: {', '.join(never)}")
    negative = [f"{j}.{r}" for (j, r), d in directions.items() if d.status == "not determined"]
    if negative:
        out.append(
            f"not determined, because the best-fitting compliance is not positive: {', '.join(negative)}; at most a "
            "lower limit of the stiffness is known, and the model treats them as rigid"
        )
    return tuple(out)


@dataclass(frozen=True)
class Unjudged:
    """Something that these readings cannot judge: ``what``, of which joints, stiffnesses or kinds, and why."""

    what: str
    of: tuple[str, ...]
    reason: str

    @property
    def words(self) -> str:
        """One sentence."""
        return f"{self.what} of {', '.join(self.of)} cannot be judged: {self.reason}"


def unjudged(
    directions: Mapping[tuple[str, str], Direction],
    cycles: Cycles,
    names: tuple[str, ...],
    asked: LawKind | None,
    scatter_dof: tuple[int, int],
) -> tuple[Unjudged, ...]:
    """All of it, each reason once."""
    found: dict[tuple[str, str], list[str]] = {}

    def add(what: str, of: str, reason: str) -> None:
        found.setdefault((what, reason), []).append(of)

    watched = [j for j in range(len(names)) if (cycles.joint == j).any()]
    for j in watched:
        for reason in _of_angles(angles_of(cycles.angle[cycles.joint == j])[0], asked):
            add("how the stiffnesses vary with the angle", names[j], reason)
        for kind, words in enumerate(KINDS):
            if not cycles.noise_known[j, kind]:
                add(f"how sure the {words} are", names[j], NO_NOISE)
    for (joint, row), d in directions.items():
        for what, reason in _of_law(d, asked):
            add(what, f"{joint}.{row}", reason)
    for words, freedoms in zip(KINDS, scatter_dof, strict=True):
        if freedoms < FEWEST_SPARE:
            add(
                "the scatter between set-ups",
                words,
                f"fewer than {FEWEST_SPARE} set-ups beyond the first at an "
                "angle; intervals hold for the noise of the readings alone",
            )
    return tuple(Unjudged(what, tuple(of), reason) for (what, reason), of in found.items())


def _of_angles(angles: Array, asked: LawKind | None) -> list[str]:
    count = len(angles)
    if count == 1:
        return ["all readings at one angle (whole turns apart is the same angle)"]
    if asked is None and count < FEWEST_FOR_A_LAW:
        return [f"fewer than {FEWEST_FOR_A_LAW} angles; constants are taken"]
    if asked is None and count < FEWEST_FOR_ORDER_TWO:
        return [f"fewer than {FEWEST_FOR_ORDER_TWO} angles show nothing that varies faster than once a turn"]
    if asked is None and fullest(angles) != "fourier-2":
        return ["angles over less than half a turn show nothing that varies faster than once a turn"]
    return []


def _of_law(d: Direction, asked: LawKind | None) -> list[tuple[str, str]]:
    if d.law is None:
        return []
    out, size, count = [], d.law.basis.size, len(d.angle)
    if d.law.kind == "constant" and d.status != "one-sided" and (d.scores if asked is None else asked != "constant"):
        wanted = "a law over the angle" if asked is None else f"the law {asked}"
        out.append((wanted, "it does not settle on these angles; a constant is taken"))
    if 1 < count <= size:
        out.append(("the law's lack of fit", f"{size} numbers through {count} angles leave none to check the law by"))
    lost = [kind for kind, score in d.scores.items() if not np.isfinite(score)]
    if lost:
        out.append(
            (f"how well {' and '.join(lost)} predicts angles left out", "without one of the angles it does not settle")
        )
    return out
