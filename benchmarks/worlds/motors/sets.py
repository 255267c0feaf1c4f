"""Draws sets and writes them: wishes dealt out evenly, then everything by the set's own seed; fills in sheets."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..shared import (
    READ,
    Effect,
    csv_text,
    deal,
    description,
    key_in,
    make_kinds,
    model_text,
    partner,
    sheet_rows,
    write_set,
)
from .arm import SPRINGS
from .known import ALONE
from .readings import (
    DAY,
    EVERY,
    KINDS,
    KNOWN,
    SO_IT_IS,
    STRANGE,
    Off,
    Table,
    campaign,
    convention,
    draw_noise,
    excess,
    later,
    measured,
    measurement_table,
    of_sheet,
    own_columns,
    readings,
    session_span,
)
from .spec import Rng, Scene, Spec

Array = NDArray[np.float64]
WORLD = "motors"
UNSEEN, UNSEEN_FIRST = 12, 5000
ARMS = (("xr701", "parallelogram"), ("xr701", "serial"), *((name, "serial") for name in SPRINGS if name != "xr701"))
# What is read, poses, noise, scatter of springs, outliers, repeats, loads in two directions.
CHOICES = (
    ("z", "xyz"),
    (9, 27, 81),
    KINDS,
    (0.0, 0.015),
    (False, True),
    (False, True),
    (True, False, False),
)
SIDEWAYS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.6, 0.0, -0.8), (0.0, -0.8, -0.6))


@dataclass(frozen=True)
class Wish:
    """What a set is to be, before anything is drawn."""

    kind: str
    families: tuple[str, ...]
    arm: str
    path: str
    reads: str
    poses: int
    noise: str
    scatter: float
    outliers: bool
    repeated: bool
    two_ways: bool

    def needs(self, what: str) -> bool:
        """Whether any of its families does."""
        return any(what in EVERY[f].needs for f in self.families)


def wishes(rng: Rng, kind: str, count: int) -> list[Wish]:
    """Sets of a kind: every family and every choice as often as any other."""
    paired = [f for f in KNOWN if f not in ALONE]
    families = deal(rng, {"single": list(KNOWN), "outside": list(STRANGE), "pair": paired}.get(kind, [""]))
    arms, choices = deal(rng, ARMS), [deal(rng, cards) for cards in CHOICES]
    out, aside = [], list[str]()
    for _ in range(count):
        chosen: tuple[str, ...] = () if kind == "none" else (next(families),)
        if kind == "pair":
            chosen = (*chosen, partner(chosen[0], families, aside, lambda f: EVERY[f].spot))
        wish = Wish(kind, chosen, *next(arms), *(next(choice) for choice in choices))
        if wish.needs("pins"):
            wish = replace(wish, arm="xr701", path="parallelogram")
        if wish.needs("both") and not any(f == "parallelogram-bar" for f in chosen):
            wish = replace(wish, path=str(rng.choice(["parallelogram", "serial"])))
        out.append(wish)
    return out


def bare(rng: Rng, seed: int, wish: Wish) -> Spec:
    """A set without what is hidden. What remembers is mostly asked both ways, what goes by the clock says the time."""
    springs = np.array(SPRINGS[wish.arm]) * np.exp(rng.normal(0, 0.25, 6))
    sessions = int(rng.integers(2, 4)) if rng.random() < 0.4 else 1
    has = {"step": rng.random() < 0.5, "time_s": rng.random() < 0.5 or wish.needs("clock"), "session": sessions > 1}
    has["temperature_C"] = rng.random() < 0.15
    count, down = int(rng.integers(1, 5)), bool(rng.random() < 0.5)
    if wish.needs("levels") or (wish.needs("history") and rng.random() < 0.85):
        count, down = max(count, 2), down or wish.needs("history")
    levels = np.arange(1, count + 1) / count * (1 + rng.uniform(-0.1, 0.1, count))
    spec = Spec(
        seed=seed,
        kind=wish.kind,
        arm=wish.arm,
        path=wish.path,
        springs=tuple(map(float, springs)),
        stated=tuple(map(float, springs * (1 + rng.uniform(-0.4, 0.4, 6)))),
        reads=wish.reads,
        poses=wish.poses,
        grid=bool(rng.random() < 0.5),
        loads=(),
        down=down and count > 1,
        repeats=int(rng.integers(2, 4)) if wish.repeated else 1,
        second=SIDEWAYS[rng.integers(4)] if wish.two_ways else (),
        sessions=sessions,
        columns=tuple(name for name in has if has[name]),
        scatter=wish.scatter,
        outliers=wish.outliers,
        noise=draw_noise(rng, wish.noise, sessions),
        balance=1.0 if wish.needs("poised") else float(rng.choice([1.0, rng.uniform(0.2, 1)])),
        away=bool(rng.random() < 0.5),
        point=(),
        air={"swing": rng.uniform(0, 0.35), "period_s": rng.uniform(1500, 9000), "phase": rng.uniform(0, 6.28)},
    )
    top = spec.of.payload * rng.uniform(0.6, 1.0)
    point = tuple(map(float, np.round(rng.uniform([-0.15, -0.15, 0.03], [0.15, 0.15, 0.3]), 3)))
    loads = tuple(float(x) for x in np.round(top * levels / levels[-1], 1))
    return replace(spec, loads=loads, point=point if rng.random() < 0.6 else ())


def draw(wish: Wish, seed: int) -> Spec:
    """A set, drawn by its seed alone; two effects are at different places. ValueError: there is none."""
    rng = np.random.default_rng([seed, 0])
    start = bare(rng, seed, wish)
    scene = Scene(start, session_span(start))
    for _ in range(80):
        effects = tuple(EVERY[f].effect(rng, scene) for f in wish.families)
        if len({e.place for e in effects}) < len(effects):
            continue
        rigid = [e.place for e in effects if EVERY[e.family].rigid]
        stated = tuple(0.0 if j in rigid else k for j, k in zip(start.of.joints, start.stated, strict=True))
        spec = replace(start, effects=effects, stated=stated)
        try:
            measured_at(spec)
        except ValueError:  # No pose is allowed with such a convention of angles.
            continue
        return spec
    raise ValueError(f"no set for {wish}")


def measured_at(spec: Spec) -> Table:
    """The readings of the set."""
    return campaign(spec, convention(spec, spec.effects), spec.poses, spec.repeats, 0, spec.grid)


def unseen_at(spec: Spec, after: Table) -> Table:
    """Readings of other set-ups, after the campaign."""
    alone = campaign(replace(spec, sessions=1), convention(spec, spec.effects), UNSEEN, 1, 1)
    return later(alone, after, UNSEEN_FIRST)


def write_wish(folder: Path, wish: Wish, seed: int) -> Path:
    """A set's folder."""
    spec = draw(wish, seed)
    table = measured_at(spec)
    others = unseen_at(spec, table)
    whole, real = readings(spec, table), readings(spec, table, off=SO_IT_IS)

    def shows(effects: tuple[Effect, ...]) -> float:
        return excess(spec, table, whole if effects == spec.effects else readings(spec, table, effects), whole)

    springs = {joint: k for joint, k in zip(spec.of.joints, spec.stated, strict=True) if k}
    true = readings(spec, others, off=Off(arm=True))
    tags = {"path": spec.path, "repeats": spec.repeats}
    files = {
        "model.toml": model_text(description(spec.arm), springs),
        "readings.csv": measurement_table(spec, table, measured(spec, table, real, 0)),
        "unseen.csv": measurement_table(spec, others, true, "U", len(real) + 1, 6),
        "key.json": spec.key(WORLD, EVERY, shows, excess(spec, table, real, whole), **tags),
    }
    return write_set(folder, files, load_path=spec.path)


def make(out: Path, seed: int, single: int = 0, none: int = 0, outside: int = 0, pairs: int = 0) -> list[Path]:
    """Write sets below ``out`` and give their folders. ValueError: a folder is there already."""
    counts = {"single": single, "none": none, "outside": outside, "pair": pairs}
    return make_kinds(out, seed, counts, wishes, write_wish)


def fill(set_folder: Path, sheet: str, visit: int) -> str:
    """The sheet as measured on visit 1, 2 ...: a day later each, with another session's gauge and new noise."""
    spec = Spec.of_key(key_in(set_folder)[WORLD])
    lines = sheet_rows(sheet)
    before = measured_at(spec)
    table = of_sheet(spec, lines, 10000 * visit, int(before.session[-1]) + visit, before.time_s[-1] + visit * DAY)
    said = 1e3 * measured(spec, table, readings(spec, table, off=SO_IT_IS), visit)
    names = list(lines[0])
    names += [READ[k] for k in spec.axes if READ[k] not in names]
    names += [name for name in spec.columns if name not in ("step", *names)]
    for line, d, own in zip(lines, said, own_columns(spec, table, len(before.visit) + 1), strict=True):
        line |= {name: f"{d[k]:.4f}" for k, name in enumerate(READ) if name in names}
        line |= {name: value for name, value in own.items() if name in names and name != "step"}
    return csv_text(lines, names)
