"""The step `rehearse`: something is hidden, readings are made, the diagnosis runs blind, the truth is unveiled."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from zlib import crc32

import numpy as np

from doe import read_measurements, write_measurements
from doe.diagnosis.findings.numbers import numbers_of
from fem.arm import Arm
from fem.effects import catalogue
from rehearsal import Arm as WorldArm
from rehearsal import Outcome, Readings, World, arm_of, codes, hide, outcome
from rehearsal.design import between
from rehearsal.kinematics import allowed
from rehearsal.meaning import meant
from rehearsal.possible import NOTHING, checked
from rehearsal.scoring import DETECTABLE, Verdict
from robots import InputError
from robots.arm_class import arm_class
from robots.arrays import Array
from robots.schema.units import factor
from stiffarm.commands.diagnose import step as diagnosing
from stiffarm.commands.diagnose.command import DiagnoseRequest
from stiffarm.commands.diagnose.step import Diagnosed
from stiffarm.commands.rehearse.sheet import Gauge, SetUps, bundled_sheet, campaign, distinct_loads, held_out, of_sheet
from stiffarm.session.inputs import refuse_effects

# Poses held out, within the angles that are read.
UNSEEN = 40
MOST_DRAWS = 1000


@dataclass(frozen=True)
class Request:
    """What is asked.

    ``code``: what to hide, "none" for nothing; None: drawn and kept secret; ``poses``: of a campaign of our own, in
    place of a bundled table.
    """

    code: str | None = None
    draws: int = 1
    seed: int = 0
    poses: int | None = None
    gauge: Gauge = Gauge()  # noqa: RUF009 - frozen


@dataclass(frozen=True)
class Number:
    """A number of the hidden effect beside the one found, in ``unit``; ``interval95`` of the one found."""

    name: str
    unit: str
    true: float
    found: float | None
    interval95: tuple[float, float] | None

    @property
    def is_inside(self) -> bool | None:
        """Whether the true one lies in the interval; None without one."""
        return None if self.interval95 is None else self.interval95[0] <= self.true <= self.interval95[1]


@dataclass(frozen=True)
class Rehearsed:
    """One draw, unveiled.

    ``excess``: chi-square by the hidden effect that no springs take up, in the world's own judgement; ``gap_mm``: RMS
    errors at poses held out, before and after, against the truth without noise.
    """

    world: World
    set_ups: SetUps
    diagnosed: Diagnosed
    verdict: Verdict
    outcome: Outcome
    excess: float
    gap_mm: tuple[float, float] | None
    numbers: tuple[Number, ...]

    @property
    def is_visible(self) -> bool:
        """Whether these readings could show what was hidden."""
        return self.world.code != NOTHING and self.excess >= DETECTABLE

    @property
    def is_right(self) -> bool:
        """By the measure of the blind study: what was taken up first is of the right family."""
        return self.verdict.is_right(() if self.world.code == NOTHING else (self.world.code,))


def prepared(given: Arm) -> WorldArm:
    """The arm of the world.

    Raises
    ------
    InputError
        A model that has effects already, or shell links.
    """
    refuse_effects(given, "rehearsal", "leave them out of the model: what is hidden is put on top of a plain arm")
    kind = given.model.link_kind
    if kind in ("shell", "solid"):
        raise InputError(
            "--links", code="A001", value=kind, allowed="beam, rigid", remedy="the world of rehearsals has no shells"
        )
    return arm_of(given.description, given.model.load_path)


def possible(given: Arm, world: WorldArm) -> list[str]:
    """Codes that this arm can have and that the diagnosis knows."""
    known = catalogue(given.model, given.description)
    return [code for code in codes(world, given.model.link_kind) if code in known]


def set_ups_of(given: Arm, world: WorldArm, sheet: Path | None, request: Request, draw: int = 0) -> SetUps:
    """What is measured: a sheet's set-ups, a bundled table's, or a campaign (a new one in each draw)."""
    if sheet is not None and request.poses is not None:
        raise InputError(
            "--poses", code="A002", value=request.poses, allowed="no SHEET beside it", remedy="leave one of them out"
        )
    own = bundled_sheet(given.robot.name) if request.poses is None and request.gauge.reads is None else None
    if sheet is None and own is None:
        poses = 27 if request.poses is None else request.poses
        return campaign(given, world, request.gauge, poses, _rng(given, request.seed, draw, 1))
    return of_sheet(given, sheet or own or Path(), request.gauge)


def _rng(given: Arm, seed: int, draw: int, part: int) -> np.random.Generator:
    """Numbers of an arm's own: the same seed hides something else in another arm."""
    return np.random.default_rng([seed, draw, part, crc32(given.robot.name.encode())])


def made(given: Arm, world: WorldArm, set_ups: SetUps, request: Request, draw: int) -> World:
    """The world of one draw; which code is in it nobody has been told."""
    kind = given.model.link_kind
    code = request.code
    if code is None:
        rng = _rng(given, request.seed, draw, 2)
        known = possible(given, world)
        kinds = list(dict.fromkeys(c.partition(":")[0] for c in known))
        mine = kinds[int(rng.integers(len(kinds)))]
        places = [c for c in known if c.partition(":")[0] == mine]
        code = places[int(rng.integers(len(places)))]
    else:
        code = checked(code, world, kind)
    size = arm_class(given.description, given.robot)
    seed = int(_rng(given, request.seed, draw, 3).integers(2**31))
    return hide(
        world,
        code,
        set_ups.readings,
        set_ups.noise,
        seed=seed,
        links=kind,
        read=set_ups.read,
        ranges=(size.low, size.high),
    )


@contextmanager
def places(draws: int, root: Path | None = None) -> Iterator[list[Path]]:
    """A folder for the readings of each draw: ``root`` itself for one, folders in it for several; None: for a while."""
    with ExitStack() as stack:
        root = Path(stack.enter_context(TemporaryDirectory())) if root is None else root
        digits = len(str(draws))
        each = [root] if draws == 1 else [root / f"draw_{k:0{digits}d}" for k in range(1, draws + 1)]
        for place in each:
            place.mkdir(exist_ok=True)
        yield each


def rehearsals(
    given: Arm,
    sheet: Path | None,
    request: Request,
    places: Sequence[Path],
    *,
    say: Callable[[str], None] = lambda _: None,
) -> list[Rehearsed]:
    """One rehearsal in each folder of ``places``, which gets its readings.csv.

    Raises
    ------
    InputError
        A model with effects or shell links, a code that the arm cannot have, or a sheet that does not fit.
    """
    world, done = prepared(given), list[Rehearsed]()
    for k, place in enumerate(places):
        set_ups = set_ups_of(given, world, sheet, request, k)
        if k == 0:
            say(f"{set_ups.source}; noise {set_ups.words}")
        if len(places) > 1:
            say(f"draw {k + 1} of {len(places)}")
        one = made(given, world, set_ups, request, k)
        quiet = say if len(places) == 1 else lambda _: None
        done.append(rehearse(given, one, set_ups, place / "readings.csv", seed=request.seed, say=quiet))
    return done


def rehearse(
    given: Arm, world: World, set_ups: SetUps, path: Path, *, seed: int = 0, say: Callable[[str], None] = lambda _: None
) -> Rehearsed:
    """Make the readings into the file ``path``, diagnose what it holds, and unveil the truth.

    Raises
    ------
    InputError
        As of :func:`stiffarm.commands.diagnose.step.diagnose`.
    """
    write_measurements(set_ups.filled(world.measured()), path, given.robot)
    table = read_measurements(path, given.robot)
    unseen = _unseen(world)
    truth = None if unseen is None else held_out(unseen)
    if truth is not None and unseen is not None:
        d = np.full((truth.n, 6), np.nan)
        axes = np.flatnonzero(world.read.any(axis=0))
        d[:, axes] = world.without_noise(unseen)[:, axes]
        truth = replace(truth, displacement=d)
    found = diagnosing.diagnose(given, table, DiagnoseRequest(next_poses=0, seed=seed, folds=0), holdout=truth, say=say)
    verdict = verdict_of(found)
    known = world.code in found.found.start.known
    gap = None if found.held_out is None else found.unseen_rms_mm
    return Rehearsed(
        world,
        set_ups,
        found,
        verdict,
        outcome(world.code, verdict, known),
        world.excess() if world.code != NOTHING else 0.0,
        gap,
        tuple(_numbers(world, found)),
    )


def verdict_of(d: Diagnosed) -> Verdict:
    """What a diagnosis said, for scoring."""
    found = tuple(f.code for f in d.in_model)
    twins = [other for code in found for other in d.twins.get(code, ())]
    return Verdict(
        d.found.verdict,
        found,
        len(d.found.effects),
        (*d.credible, *twins),
        tuple(d.not_testable),
        d.given.robot.joint_names[0],
    )


def _unseen(world: World) -> Readings | None:
    """Poses held out within the angles read, under loads that were read; None where the arm can take none."""
    r, arm = world.readings, world.arm
    low, high = r.q.min(axis=0), r.q.max(axis=0)
    clear = (-np.inf, -1.0)
    q = between(
        arm,
        (low + high) / 2,
        (high - low) / 2,
        UNSEEN,
        np.random.default_rng([world.truth.seed, 77]),
        lambda q: allowed(arm, q, 1.0, clear),
    )
    seen = {tuple(row) for row in np.round(r.q, 9).tolist()}
    q = q[[tuple(row) not in seen for row in np.round(q, 9).tolist()]]
    if not len(q):
        return None
    loads = distinct_loads(r)
    n = len(q) * len(loads)

    def each(values: Array) -> Array:
        return np.tile(values[loads], (len(q), 1))

    count = np.arange(n)
    return Readings(
        np.repeat(q, len(loads), axis=0),
        each(r.force),
        np.repeat(np.arange(len(q)), len(loads)),
        count,
        np.zeros(n, dtype=bool),
        np.ones(n, dtype=np.int64),
        np.zeros(n),
        np.zeros((n, 3)),
        None if r.moment is None else each(r.moment),
        None if r.point is None else each(r.point),
    )


def _numbers(world: World, d: Diagnosed) -> list[Number]:
    """The true numbers that a model file would have, beside those found of the same effect."""
    if world.code == NOTHING:
        return []
    true = meant(world.truth.effects[0])
    mine = {n.name: n for n in numbers_of(d.found.after) if n.code == world.code}
    known = d.found.start.known.get(world.code)
    out = []
    for p in () if known is None else known.parameters:
        if p.name not in true:
            continue
        value = true[p.name] / factor(p.dimension, p.unit)
        n = mine.get(p.name)
        found = None if n is None or not np.isfinite(n.value) else n.value
        ends = None if n is None or n.low is None or n.high is None else (n.low, n.high)
        out.append(Number(p.name, p.unit, value, found, ends))
    return out


def truth(world: World) -> dict[str, Any]:
    """Everything that was hidden, as plain values."""
    return {
        "schema": "stiffarm-truth/1",
        "hidden": world.code,
        "effects": [dict(e) for e in world.truth.effects],
        "springs_Nm_per_rad": {
            joint: None if c == 0.0 else float(1.0 / c)
            for joint, c in zip(world.arm.joints, world.truth.compliance, strict=True)
        },
        "links": world.truth.links,
        "errors": {k: v for k, v in world.truth.nuisance.items() if k != "load_seed"},
        "noise": {
            "share": world.noise.share,
            "floor_mm": float(1e3 * np.mean(world.noise.floor_m)),
            "resolution_mm": 1e3 * world.noise.resolution_m,
            "setup_share": world.noise.setup,
        },
        "seed": world.truth.seed,
    }
