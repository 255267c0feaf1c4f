"""Draws sets and writes them: wishes dealt out evenly, then everything by the set's own seed."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from . import noise
from .arms import SPRINGS
from .campaign import rows_of, schedule
from .catalogue import EVERY, KNOWN, PAIRED, STRANGE
from .excess import excess
from .laws import Scene
from .spec import Effect, Row, Spec
from .tables import table, write
from .truth import Off, readings, true_angles

WORLD = "frame"
UNSEEN = 12
UNSEEN_FIRST = 5000
Dealt = TypeVar("Dealt")
Rng = np.random.Generator
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Wish:
    """What a set is to be, before anything is drawn."""

    kind: str
    families: tuple[str, ...]
    arm: str
    reads: str
    poses: int
    noise: str
    scatter: float
    outliers: bool
    two_ways: bool


def deal(rng: Rng, cards: Sequence[Dealt]) -> Iterator[Dealt]:
    """All cards in a random order, again and again."""
    while True:
        for i in rng.permutation(len(cards)):
            yield cards[i]


def wishes(rng: Rng, kind: str, count: int) -> list[Wish]:
    """Sets of a kind: every family and every choice as often as any other."""
    families = {"single": tuple(KNOWN), "outside": tuple(STRANGE), "pair": PAIRED}.get(kind, ())
    hidden, arms = deal(rng, families), deal(rng, tuple(SPRINGS))
    reads, poses = deal(rng, ("z", "xyz")), deal(rng, (9,) * 2 + (27,) * 5 + (81,) * 3)
    scatter, outliers, ways = deal(rng, (0.0, 0.015)), deal(rng, (False, True)), deal(rng, (True, False, False))
    out = []
    aside: list[str] = []
    for i in range(count):
        chosen = tuple(next(hidden) for _ in range({"none": 0, "pair": 1}.get(kind, 1)))
        if kind == "pair":
            chosen = (*chosen, _partner(chosen[0], hidden, aside))
        allowed = [EVERY[f].arms for f in chosen if EVERY[f].arms]
        arm = next(arms)
        while any(arm not in some for some in allowed):
            arm = "xr701" if any(some == ("xr701",) for some in allowed) else next(arms)
        out.append(
            Wish(
                kind,
                chosen,
                arm,
                next(reads),
                next(poses),
                noise.KINDS[i % len(noise.KINDS)],
                next(scatter),
                next(outliers),
                next(ways),
            )
        )
    return out


def _partner(first: str, hidden: Iterator[str], aside: list[str]) -> str:
    """The next family that can be elsewhere than the first; those that cannot are put aside for the next pair."""

    def fits(family: str) -> bool:
        return family != first and (not EVERY[first].spot or EVERY[first].spot != EVERY[family].spot)

    for i, family in enumerate(aside):
        if fits(family):
            return aside.pop(i)
    while not fits(family := next(hidden)):
        aside.append(family)
    return family


def _loads(rng: Rng, wish: Wish, payload: float) -> tuple[tuple[float, ...], bool]:
    """Loads in N, and whether they are read going down too. What remembers is mostly asked both ways."""
    remembers = any("load history" in EVERY[f].axis for f in wish.families)
    count = int(rng.integers(1, 5))
    down = rng.random() < 0.5
    if remembers and rng.random() < 0.8:
        count, down = max(count, 2), True
    top = payload * rng.uniform(0.6, 1.0)
    levels = np.arange(1, count + 1) / count * (1 + rng.uniform(-0.08, 0.08, count))
    return tuple(float(x) for x in np.round(top * levels / levels[-1], 1)), down and count > 1


def _columns(rng: Rng, wish: Wish, sessions: bool) -> tuple[str, ...]:
    by_clock = any(EVERY[f].by_clock for f in wish.families)
    has = {"step": rng.random() < 0.5, "time_s": rng.random() < 0.5, "session": sessions}
    if by_clock and not (has["step"] or has["time_s"]):
        has["time_s"] = True
    return tuple(name for name in has if has[name])


def _bare(rng: Rng, seed: int, wish: Wish, path: str) -> Spec:
    """A set without what is hidden."""
    springs = np.array(SPRINGS[wish.arm]) * np.exp(rng.normal(0, 0.25, len(SPRINGS[wish.arm])))
    stated = springs * (1 + rng.uniform(-0.4, 0.4, len(springs)))
    by_session = wish.noise == "session" or any(EVERY[f].by_session for f in wish.families)
    sessions = int(rng.integers(2, 4)) if by_session or rng.random() < 0.35 else 1
    start = Spec(
        seed=seed,
        kind=wish.kind,
        arm=wish.arm,
        path=path,
        springs=tuple(map(float, springs)),
        stated=tuple(map(float, stated)),
        reads=wish.reads,
        poses=wish.poses,
        grid=bool(rng.random() < 0.5),
        loads=(),
        down=False,
        repeats=int(rng.integers(1, 4)),
        second=(),
        sessions=sessions,
        columns=_columns(rng, wish, sessions > 1 or rng.random() < 0.1),
        scatter=wish.scatter,
        outliers=wish.outliers,
        noise=noise.draw(rng, wish.noise),
        balance=float(rng.choice([1.0, rng.uniform(0, 1)])),
        settle_s=float(rng.uniform(300, 1200)),
        moves=bool(rng.random() < 0.5),
        soft_links=float(rng.uniform(0.005, 0.015) * (rng.random() < 0.5)),
        point=(),
    )
    loads, down = _loads(rng, wish, start.of.payload)
    sideways = [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.8, -0.6), (-0.6, 0.0, -0.8)]
    second = sideways[rng.integers(4)] if wish.two_ways else ()
    point = tuple(map(float, np.round(rng.uniform([-0.12, -0.12, 0.03], [0.12, 0.12, 0.3]), 3)))
    return replace(start, loads=loads, down=down, second=second, point=point if rng.random() < 0.5 else ())


def _effects(rng: Rng, spec: Spec, wish: Wish) -> Spec:
    """With what is hidden; two effects are at different places."""
    times = schedule(spec, spec.poses, spec.repeats, 0)
    scene = Scene(spec, max(r.since_s for r in times), tuple(r.time_s for r in times))
    while True:
        places = [EVERY[f].place(rng, scene) for f in wish.families]
        if len(set(places)) == len(places):
            break
    effects = tuple(
        Effect(f, place, EVERY[f].draw(rng, scene, place)) for f, place in zip(wish.families, places, strict=True)
    )
    rigid = {joint for e in effects for joint in EVERY[e.family].rigid(e.place)}
    stated = tuple(0.0 if joint in rigid else k for joint, k in zip(spec.of.joints, spec.stated, strict=True))
    return replace(spec, effects=effects, stated=stated)


def draw(wish: Wish, seed: int) -> Spec:
    """A set, drawn by its seed alone."""
    rng = np.random.default_rng([seed, 0])
    path = next((EVERY[f].path for f in wish.families if EVERY[f].path != "serial"), "serial")
    bare = _bare(rng, seed, wish, path)
    for _ in range(60):
        spec = _effects(rng, bare, wish)
        try:
            campaign(spec)
        except ValueError:  # No pose is allowed with such a convention of angles.
            continue
        return spec
    raise ValueError(f"no set for {wish}")


def campaign(spec: Spec) -> list[Row]:
    """The readings of the set."""
    return rows_of(spec, lambda q: true_angles(spec.effects, spec.of, q), spec.poses, spec.repeats, 0, spec.grid)


def unseen(spec: Spec, after: Row) -> list[Row]:
    """Readings of other set-ups, after the campaign."""
    alone = replace(spec, sessions=1)
    rows = rows_of(alone, lambda q: true_angles(spec.effects, spec.of, q), UNSEEN, 1, 1)
    later = after.time_s + 600.0
    return [
        replace(
            r,
            visit=r.visit + UNSEEN_FIRST,
            session=after.session,
            pose=f"U{r.visit + 1:02d}",
            time_s=round(r.time_s + later, 1),
            zero_s=r.zero_s + later,
            since_s=after.since_s + 600.0 + r.time_s,
        )
        for r in rows
    ]


def key(spec: Spec, rows: list[Row], real: Array) -> dict[str, Any]:
    """The truth and how much of it shows; beside it, with all that is off too, of readings ``real`` (n, 3)."""
    whole = readings(spec, rows)
    effects = []
    for e in spec.effects:
        alone = whole if len(spec.effects) == 1 else readings(spec, rows, (e,))
        law = EVERY[e.family]
        effects.append(
            {
                "code": law.code(e.place),
                "axis": list(law.axis),
                "place": e.place,
                "excess_chi2": round(excess(spec, rows, alone, whole), 2),
            }
        )
    # A pair's noise is that of both, so both together are counted anew.
    total = effects[0]["excess_chi2"] if len(effects) == 1 else round(excess(spec, rows, whole, whole), 2)
    way = "up and down" if spec.down else "up"
    tags = {
        "reads": spec.reads,
        "poses": spec.poses,
        "scatter": spec.scatter,
        "outliers": spec.outliers,
        "noise": spec.noise["kind"],
        "loads": f"{len(spec.loads)} {way}",
        "arm": spec.arm,
        "directions": 2 if spec.second else 1,
        "sessions": spec.sessions,
        "kind": spec.kind,
    }
    return {
        "schema": "stiffarm-study-key/1",
        "world": WORLD,
        "effects": effects,
        "excess_chi2": total,
        "tags": tags,
        "excess_chi2_with_nuisance": round(excess(spec, rows, real, whole), 2),
        WORLD: spec.text(),
    }


def write_set(folder: Path, spec: Spec) -> None:
    """A set's folder."""
    rows = campaign(spec)
    others = unseen(spec, rows[-1])
    real = readings(spec, rows, off=Off())
    said = noise.measured(spec, rows, real, 0)
    true = readings(spec, others, off=Off(loads=False))
    write(
        folder,
        spec,
        table(spec, rows, said),
        table(spec, others, true, len(rows) + 1, 6),
        key(spec, rows, real),
    )


def make(out: Path, seed: int, single: int = 0, none: int = 0, outside: int = 0, pairs: int = 0) -> list[Path]:
    """Write sets below ``out`` and give their folders. ValueError: a folder is there already."""
    folders = []
    for number, (kind, count) in enumerate({"single": single, "none": none, "outside": outside, "pair": pairs}.items()):
        for i, wish in enumerate(wishes(np.random.default_rng([seed, number]), kind, count)):
            folder = Path(out) / f"{kind}-{i + 1:03d}"
            if folder.exists():
                raise ValueError(f"{folder} is there already")
            write_set(folder, draw(wish, int(np.random.default_rng([seed, number, i]).integers(2**31))))
            folders.append(folder)
    return folders


def said_in(folder: Path) -> dict[str, Any]:
    """A set's key."""
    return dict(json.loads((folder / "key.json").read_text(encoding="utf-8")))
