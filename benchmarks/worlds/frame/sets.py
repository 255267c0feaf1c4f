"""Sets as folders: drawn evenly, written, and filled in on later visits."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from .arm import ANGLE_DIGITS, SPRINGS, Effect, Row, Spec, from_text, model_text
from .campaign import (
    KINDS,
    Off,
    draw_noise,
    excess,
    measured,
    point_of,
    read_axes,
    readings,
    rows_of,
    schedule,
    true_angles,
)
from .other_laws import EVERY, KNOWN, PAIRED, STRANGE
from .plan import Scene

Array = NDArray[np.float64]
READ = ("dx_mm", "dy_mm", "dz_mm")


def table(spec: Spec, rows: list[Row], said: Array, first_step: int = 1, digits: int = 4) -> str:
    """The measurement table as CSV."""
    out = []
    for step, (r, d) in enumerate(zip(rows, said, strict=True), first_step):
        line: dict[str, Any] = {"pose": r.pose}
        line |= {c: f"{a:.{ANGLE_DIGITS}f}" for c, a in zip(spec.of.columns, r.angles, strict=True)}
        line |= {f"f{x}_N": f"{f + 0.0:.4f}" for x, f in zip("xyz", r.force, strict=True)}
        if spec.point:
            line |= {f"p{x}_mm": f"{1e3 * p + 0.0:.3f}" for x, p in zip("xyz", r.point, strict=True)}
        line["repeat"] = r.cycle + 1
        if spec.down:
            line["phase"] = r.phase
        own = {"step": step, "time_s": f"{r.time_s:.1f}", "session": f"S{r.session + 1}"}
        line |= {name: own[name] for name in spec.columns}
        line |= {READ[k]: f"{1e3 * d[k]:.{digits}f}" for k in read_axes(spec)}
        out.append(line)
    text = io.StringIO()
    writer = csv.DictWriter(text, out[0], lineterminator="\n")
    writer.writeheader()
    writer.writerows(out)
    return text.getvalue()


def write(folder: Path, spec: Spec, readings: str, unseen: str, key: dict[str, Any]) -> None:
    """All files of a set, in a new folder."""
    folder.mkdir(parents=True)
    springs = {joint: k for joint, k in zip(spec.of.joints, spec.stated, strict=True) if k}
    start = {"schema": "stiffarm-study-set/1", "model": "model.toml", "links": "rigid", "load_path": spec.path}
    files = {
        "model.toml": model_text(spec.of, springs),
        "set.json": json.dumps(start, indent=1),
        "readings.csv": readings,
        "unseen.csv": unseen,
        "key.json": json.dumps(key, indent=1),
    }
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")


def rows_from(spec: Spec, sheet: str, first_visit: int, session: int, start_s: float) -> list[Row]:
    """Rows of a sheet to be filled in: a set-up is a run of lines at one pose, a cycle one of its repeats."""
    lines = list(csv.DictReader(io.StringIO(sheet)))

    def number(line: dict[str, str], name: str, missing: float = 0.0) -> float:
        return float(line[name]) if line.get(name) else missing

    point = 1e3 * point_of(spec)
    rows: list[Row] = []
    visit, cycle, now, last = first_visit - 1, 0, start_s, None
    for line in lines:
        q = np.array([number(line, c) for c in spec.of.columns])
        force = np.array([number(line, f"f{x}_N") for x in "xyz"])
        here = (line.get("pose"), *q, *(force / (np.linalg.norm(force) or 1)).round(6))
        if here != last:
            visit, cycle, now, repeat = visit + 1, 0, now + 120.0, line.get("repeat")
            zero = now
        elif line.get("repeat") != repeat:
            cycle, now, repeat = cycle + 1, now + 25.0, line.get("repeat")
            zero = now
        last, now = here, now + 30.0
        p = np.array([number(line, f"p{x}_mm", point[k]) for k, x in enumerate("xyz")]) / 1e3
        moment = np.array([number(line, f"m{x}_Nm") for x in "xyz"])
        phase = line.get("phase") or "loading"
        rows.append(
            Row(visit, cycle, session, now - start_s, now, zero, phase, line.get("pose") or "", q, force, p, moment)
        )
    return rows


WORLD = "frame"
UNSEEN = 12
UNSEEN_FIRST = 5000
Dealt = TypeVar("Dealt")
Rng = np.random.Generator


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
                KINDS[i % len(KINDS)],
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
        noise=draw_noise(rng, wish.noise),
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
    said = measured(spec, rows, real, 0)
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


DAY = 86400.0


def fill(set_folder: Path, sheet: str, visit: int) -> str:
    """The sheet as measured on visit 1, 2 ...: a day later each, by another session's gauge and new noise."""
    spec = from_text(said_in(Path(set_folder))[WORLD])
    last = campaign(spec)[-1]
    rows = rows_from(spec, sheet, 10000 * visit, last.session + visit, last.time_s + visit * DAY)
    said = 1e3 * measured(spec, rows, readings(spec, rows, off=Off()), visit)
    lines = list(csv.DictReader(io.StringIO(sheet)))
    names = list(lines[0])
    names += [READ[k] for k in read_axes(spec) if READ[k] not in names]
    names += [name for name in ("time_s", "session") if name in spec.columns and name not in names]
    for line, r, d in zip(lines, rows, said, strict=True):
        line |= {name: f"{d[k]:.4f}" for k, name in enumerate(READ) if name in names}
        own = {"time_s": f"{r.time_s:.1f}", "session": f"S{r.session + 1}"}
        line |= {name: own[name] for name in own if name in names}
    text = io.StringIO()
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    return text.getvalue()
