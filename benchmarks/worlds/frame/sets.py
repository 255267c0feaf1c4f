"""Sets as folders: drawn evenly, written, and filled in on later visits."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..shared import (
    FORCES,
    MOMENTS,
    POINT,
    READ,
    Effect,
    csv_text,
    deal,
    description,
    key_in,
    make_kinds,
    model_text,
    number,
    numbers,
    partner,
    sheet_rows,
    write_set,
)
from .arm import ANGLE_DIGITS, SPRINGS, Row, Spec
from .campaign import (
    KINDS,
    Off,
    draw_noise,
    excess,
    measured,
    point_of,
    readings,
    rows_of,
    schedule,
    true_angles,
)
from .other_laws import EVERY, KNOWN, PAIRED, STRANGE
from .plan import Scene

Array = NDArray[np.float64]


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
        line |= {READ[k]: f"{1e3 * d[k]:.{digits}f}" for k in spec.axes}
        out.append(line)
    return csv_text(out)


def rows_from(spec: Spec, lines: list[dict[str, str]], first_visit: int, session: int, start_s: float) -> list[Row]:
    """Rows of a sheet to be filled in: a set-up is a run of lines at one pose, a cycle one of its repeats."""
    point = 1e3 * point_of(spec)
    rows: list[Row] = []
    visit, cycle, now, last = first_visit - 1, 0, start_s, None
    for line in lines:
        q, force = numbers(line, spec.of.columns), numbers(line, FORCES)
        here = (line.get("pose"), *q, *(force / (np.linalg.norm(force) or 1)).round(6))
        if here != last:
            visit, cycle, now, repeat = visit + 1, 0, now + 120.0, line.get("repeat")
            zero = now
        elif line.get("repeat") != repeat:
            cycle, now, repeat = cycle + 1, now + 25.0, line.get("repeat")
            zero = now
        last, now = here, now + 30.0
        p = np.array([number(line, name, point[k]) for k, name in enumerate(POINT)]) / 1e3
        phase = line.get("phase") or "loading"
        rows.append(
            Row(
                visit,
                cycle,
                session,
                now - start_s,
                now,
                zero,
                phase,
                line.get("pose") or "",
                q,
                force,
                p,
                numbers(line, MOMENTS),
            )
        )
    return rows


WORLD = "frame"
UNSEEN = 12
UNSEEN_FIRST = 5000
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
            chosen = (*chosen, partner(chosen[0], hidden, aside, lambda f: EVERY[f].spot))
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


def _loads(rng: Rng, wish: Wish, payload: float) -> tuple[tuple[float, ...], bool]:
    """Loads in N, and whether they are read going down too. What remembers is mostly asked both ways."""
    remembers = any("load history" in EVERY[f].axes for f in wish.families)
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


def write_wish(folder: Path, wish: Wish, seed: int) -> Path:
    """A set's folder."""
    spec = draw(wish, seed)
    rows = campaign(spec)
    others = unseen(spec, rows[-1])
    whole, real = readings(spec, rows), readings(spec, rows, off=Off())

    def shows(effects: tuple[Effect, ...]) -> float:
        return excess(spec, rows, whole if effects == spec.effects else readings(spec, rows, effects), whole)

    springs = {joint: k for joint, k in zip(spec.of.joints, spec.stated, strict=True) if k}
    files = {
        "model.toml": model_text(description(spec.arm), springs),
        "readings.csv": table(spec, rows, measured(spec, rows, real, 0)),
        "unseen.csv": table(spec, others, readings(spec, others, off=Off(loads=False)), len(rows) + 1, 6),
        "key.json": spec.key(WORLD, EVERY, shows, excess(spec, rows, real, whole)),
    }
    return write_set(folder, files, load_path=spec.path)


def make(out: Path, seed: int, single: int = 0, none: int = 0, outside: int = 0, pairs: int = 0) -> list[Path]:
    """Write sets below ``out`` and give their folders. ValueError: a folder is there already."""
    counts = {"single": single, "none": none, "outside": outside, "pair": pairs}
    return make_kinds(out, seed, counts, wishes, write_wish)


DAY = 86400.0


def fill(set_folder: Path, sheet: str, visit: int) -> str:
    """The sheet as measured on visit 1, 2 ...: a day later each, by another session's gauge and new noise."""
    spec = Spec.of_key(key_in(set_folder)[WORLD])
    last, lines = campaign(spec)[-1], sheet_rows(sheet)
    rows = rows_from(spec, lines, 10000 * visit, last.session + visit, last.time_s + visit * DAY)
    said = 1e3 * measured(spec, rows, readings(spec, rows, off=Off()), visit)
    names = list(lines[0])
    names += [READ[k] for k in spec.axes if READ[k] not in names]
    names += [name for name in ("time_s", "session") if name in spec.columns and name not in names]
    for line, r, d in zip(lines, rows, said, strict=True):
        line |= {name: f"{d[k]:.4f}" for k, name in enumerate(READ) if name in names}
        own = {"time_s": f"{r.time_s:.1f}", "session": f"S{r.session + 1}"}
        line |= {name: own[name] for name in own if name in names}
    return csv_text(lines, names)
