"""The whole truth of a set, drawn from a seed and read from a key, and folders of sets."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from ..shared import (
    FORCES,
    MOMENTS,
    POINT,
    READ,
    csv_text,
    deal,
    description,
    key_in,
    model_text,
    numbers,
    sheet_rows,
    write_set,
)
from .arm import ARMS, SPRINGS, Arm, Vector, load
from .campaign import (
    KINDS,
    Noise,
    Nuisance,
    Truth,
    blur,
    draw_noise,
    draw_nuisance,
    draw_plan,
    draw_rows,
    draw_unseen,
    excess,
    none,
    site_of,
)
from .catalogue import CATALOGUE, EVERY, OUTSIDE, Clock, clock_of, code, draw_clock, effect_of, moments
from .effects import Effect, Row, Site

# Chi-square from which an effect can be found; nuisances are to stay well below it.
DETECTABLE = 30.0
UNSEEN = 15.0
# How often effects are drawn again, by how many there are; and whole campaigns.
TRIES = {1: 4, 2: 20}
ATTEMPTS = 20


@dataclass(frozen=True)
class Wish:
    """What one set is to be: families to hide, and what the study balances."""

    kind: str
    families: tuple[str, ...]
    robot: str
    poses: int
    xyz: bool
    back: bool
    noise: str
    scatter: float
    outliers: bool


@dataclass
class Hidden:
    """A set as its key has it, with its rows."""

    seed: int
    kind: str
    arm: Arm
    site: Site
    effects: list[Effect]
    rigid: tuple[str, ...]
    nuisance: Nuisance
    noise: Noise
    clock: Clock
    point: Vector
    load_path: str | None
    rows: list[Row]

    @property
    def axes(self) -> list[int]:
        """Directions that are read."""
        return [0, 1, 2] if self.site.xyz else [2]

    @property
    def share(self) -> float:
        """How the model takes the elbow to follow the shoulder."""
        return 0.0 if self.load_path == "serial" else float(self.arm.parallelogram)

    def free(self) -> list[str]:
        """Joints whose springs the model has."""
        return [name for name in self.arm.names if name not in self.rigid]

    def truth(self) -> Truth:
        """The arm as it is."""
        return Truth(self.site, self.effects, self.rigid, self.nuisance)

    def excess(self, effects: Sequence[Effect], nuisance: Nuisance | None = None) -> float:
        """How much of some of the effects, without nuisances, no springs can explain."""
        bare = nuisance or none(self.arm, self.nuisance.compensated)
        true = Truth(self.site, effects, self.rigid, bare).readings(self.rows)
        return excess(self.arm, self.rows, true, self.noise, self.axes, self.free(), self.share)


def draw(wish: Wish, seed: int) -> Hidden:
    """Draw a set; where its nuisances alone could be seen, no gauge would be trusted so far: draw all again."""
    wish = replace(wish, xyz=wish.xyz or "turned-frame" in wish.families)
    best, least = None, np.inf
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([seed, 18, attempt])
        bare = _draw_campaign(wish, seed, rng)
        chi2 = max(bare.excess([]), bare.excess([], bare.nuisance))
        if chi2 < least:
            best, least, chosen = bare, chi2, rng
        if chi2 < UNSEEN:
            break
    assert best is not None
    return _hide(wish, best, chosen)


def _draw_campaign(wish: Wish, seed: int, rng: np.random.Generator) -> Hidden:
    """Draw arm, plan, clock and noise, with nothing hidden yet."""
    families = wish.families
    robot = _fitting_robot(rng, wish)
    arm = load(robot)
    springs = {n: float(f"{k * 2 ** rng.uniform(-1, 1):.6g}") for n, k in zip(arm.names, SPRINGS[robot], strict=True)}
    needs_days = wish.noise == "session" or any("session" in EVERY[f].axis for f in families)
    back = wish.back or any("load history" in EVERY[f].axis and "clock" not in EVERY[f].axis for f in families)
    plan = draw_plan(rng, wish.poses, wish.xyz, back)
    point = _point(rng)
    rows = draw_rows(rng, arm, plan, point)
    needs_warmth = any("temperature" in EVERY[f].axis for f in families)
    thermometer = str(rng.choice(["air", "housing"] if needs_warmth else ["air", "housing", "none"]))
    clock = draw_clock(rng, thermometer, int(rng.integers(2, 4)) if needs_days else int(rng.integers(1, 3)))
    clock, stamps = moments(clock, [row.pose for row in rows], [row.repeat for row in rows], rng)
    rows = [replace(row, moment=moment) for row, moment in zip(rows, stamps, strict=True)]
    noise = draw_noise(rng, wish.noise, wish.scatter, wish.outliers, max(float(np.linalg.norm(r.force)) for r in rows))
    site = site_of(arm, springs, rows, wish.xyz)
    nuisance = draw_nuisance(rng, arm, plan.levels, float(rng.choice([0.0, 0.9, 1.0])))
    return Hidden(seed, wish.kind, arm, site, [], (), nuisance, noise, clock, point, None, rows)


def _hide(wish: Wish, bare: Hidden, rng: np.random.Generator) -> Hidden:
    """Hide the effects; where they cannot be seen, draw their places and sizes again a few times."""
    path = "serial" if "load-path" in wish.families else None
    best, most = bare, -1.0
    for _ in range(TRIES.get(len(wish.families), 0)):
        effects = [_draw_effect(rng, bare.site, family) for family in wish.families]
        rigid = tuple(e.place for e in effects if e.family == "joint-compliance")
        found = replace(bare, effects=effects, rigid=rigid, load_path=path)
        least = min(found.excess([effect]) for effect in effects)
        if least > most:
            best, most = found, least
        if least >= DETECTABLE:
            break
    return best


def _fitting_robot(rng: np.random.Generator, wish: Wish) -> str:
    """The robot that was wished for, or else one in which the effects can be."""
    others = [name for name in rng.permutation(ARMS).tolist() if name != wish.robot]
    for robot in (wish.robot, *others):
        arm = load(robot)
        ones = dict.fromkeys(arm.names, 1.0)
        site = Site(arm, dict(zip(arm.names, SPRINGS[robot], strict=True)), ones, ones, wish.xyz, 1.0)
        if all(EVERY[family].places(site) for family in wish.families):
            return str(robot)
    raise ValueError(f"no arm can have {wish.families}")


def _draw_effect(rng: np.random.Generator, site: Site, family: str) -> Effect:
    kind = EVERY[family]
    places = kind.places(site) or [site.arm.names[1]]
    place = str(rng.choice(places))
    return kind(place, kind.draw(rng, site, place))


def _point(rng: np.random.Generator) -> Vector:
    """Where the load hangs and is read, in the flange's frame: at the flange, on a rod, or on a bracket."""
    kind = int(rng.integers(3))
    if kind == 0:
        return np.zeros(3)
    side = rng.uniform(-0.15, 0.15, 2) if kind == 2 else np.zeros(2)
    return np.asarray(np.round([side[0], side[1], rng.uniform(0.05, 0.25)], 3))


def key(hidden: Hidden, world: str) -> dict[str, Any]:
    """All that is hidden, as plain data."""
    alone = [hidden.excess([effect]) for effect in hidden.effects]
    both = alone[0] if len(alone) == 1 else hidden.excess(hidden.effects)
    rows, noise = hidden.rows, hidden.noise
    bare = replace(hidden, load_path=None)
    moment_of_unseen = asdict(middle(hidden.clock))
    return {
        "schema": "stiffarm-study-key/1",
        "world": world,
        "seed": hidden.seed,
        "kind": hidden.kind,
        "effects": [
            {
                "code": code(effect),
                "axis": list(effect.axis),
                "place": effect.place,
                "parameters": effect.parameters,
                "excess_chi2": round(chi2, 3),
            }
            for effect, chi2 in zip(hidden.effects, alone, strict=True)
        ],
        "excess_chi2": round(both, 3),
        "detectable": both >= DETECTABLE,
        "springs_Nm_per_rad": dict(hidden.site.springs),
        "rigid_in_model": list(hidden.rigid),
        "load_path_of_model": hidden.load_path,
        "tags": {
            "robot": hidden.arm.name,
            "reads": "xyz" if hidden.site.xyz else "z",
            "poses": len({row.pose for row in rows}),
            "noise": noise.kind,
            "scatter": noise.scatter,
            "outliers": 0,
            "rows": len(rows),
            "repeats": max(row.repeat for row in rows),
            "loads": 1 + max(row.level for row in rows),
            "phases": len({row.phase for row in rows}),
            "sessions": hidden.clock.days,
            "thermometer": hidden.clock.thermometer,
        },
        "nuisance": {
            **asdict(hidden.nuisance),
            "excess_chi2": round(bare.excess([], hidden.nuisance), 3),
            "geometry_excess_chi2": round(bare.excess([]), 3),
            "clock": hidden.clock.data(),
            "noise": asdict(noise),
            "point_m": hidden.point.tolist(),
        },
        "site": {"torques": dict(hidden.site.torques), "held": dict(hidden.site.held), "force": hidden.site.force},
        "levels_N": list(
            {r.level: float(np.linalg.norm(r.force)) for r in sorted(rows, key=lambda r: r.level)}.values()
        ),
        "unseen_state": "rested and fresh before each load (friction, creep); time, warmth and running-in as in the"
        " middle of the campaign, half a day's work done; gauge's zero and scale as in the readings; without noise,"
        " drift, steps, sticking of the gauge, people, slips and the hall's warmth in what is read",
        "unseen_moment": moment_of_unseen,
    }


def middle(clock: Clock) -> Any:
    """Return the middle of a campaign, with half a day's work done."""
    return clock.moment(clock.end_s / 2, clock.work_s / 2, clock.days // 2, clock.cycles // 2)


def hidden_of(data: dict[str, Any]) -> Hidden:
    """Read a key; its rows are not in it."""
    plain = dict(data["nuisance"])
    clock, noise = clock_of(plain.pop("clock")), Noise(**plain.pop("noise"))
    point = np.array(plain.pop("point_m"))
    plain.pop("excess_chi2"), plain.pop("geometry_excess_chi2")
    plain["shifts"] = tuple(tuple(row) for row in plain["shifts"])
    plain["zeros"], plain["loads"] = tuple(plain["zeros"]), tuple(plain["loads"])
    arm, around = load(data["tags"]["robot"]), data["site"]
    site = Site(
        arm,
        data["springs_Nm_per_rad"],
        around["torques"],
        around["held"],
        data["tags"]["reads"] == "xyz",
        around["force"],
    )
    effects = [effect_of(entry) for entry in data["effects"]]
    return Hidden(
        data["seed"],
        data["kind"],
        arm,
        site,
        effects,
        tuple(data["rigid_in_model"]),
        Nuisance(**plain),
        noise,
        clock,
        point,
        data["load_path_of_model"],
        [],
    )


WORLD = "equilibrium"
# In pairs they would be seen by nobody (a scale is all springs at once).
UNPAIRED = {"gauge-scale"}


def make(out: Path, seed: int, single: int = 100, none: int = 50, outside: int = 50, pairs: int = 33) -> list[Path]:
    """Write so many sets of each kind; the same seed writes the same bytes."""
    folders = []
    for place, (kind, count) in enumerate({"single": single, "none": none, "outside": outside, "pair": pairs}.items()):
        rng = np.random.default_rng([seed, place])
        for number, wish in enumerate(wishes(rng, kind, count), start=1):
            folders.append(write(draw(wish, int(rng.integers(2**31))), out / f"{kind}-{number:03d}"))
    return folders


def wishes(rng: np.random.Generator, kind: str, count: int) -> list[Wish]:
    """Balance what the study compares: each value of each tag equally often, in an order of its own."""
    streams = iter(rng.spawn(8))

    def deck(values: Sequence[Any]) -> list[Any]:
        return list(islice(deal(next(streams), values), count))

    robots, poses, xyz = deck(ARMS), deck((9, 27, 81)), deck((False, True))
    back, noise, scatter, outliers = deck((True, True, False)), deck(KINDS), deck((0.0, 0.015)), deck((False, True))
    if kind == "pair":
        stream, names = next(streams), [name for name in CATALOGUE if name not in UNPAIRED]
        drawn = [stream.choice(len(names), 2, replace=False) for _ in range(count)]
        families = [tuple(names[i] for i in pair) for pair in drawn]
    elif kind == "none":
        families = [()] * count
    else:
        families = [(name,) for name in deck(tuple(CATALOGUE if kind == "single" else OUTSIDE))]
    cards = zip(families, robots, poses, xyz, back, noise, scatter, outliers, strict=True)
    return [Wish(kind, *card) for card in cards]


def write(hidden: Hidden, folder: Path) -> Path:
    """Write one set."""
    rng = np.random.default_rng([hidden.seed, 1])
    truth = hidden.truth()
    said, wrong = blur(hidden.noise, hidden.rows, truth.readings(hidden.rows), rng)
    unseen = [replace(row, moment=middle(hidden.clock)) for row in draw_unseen(rng, hidden.arm, hidden.rows)]
    unread = truth.readings(unseen, held_out=True)
    told = key(hidden, WORLD)
    told["tags"]["outliers"] = len({i // 3 for i in wrong})
    told["nuisance"]["spoilt_cells"] = sorted([i // 3, READ[i % 3]] for i in wrong if i % 3 in hidden.axes)
    springs = dict(zip(hidden.arm.names, SPRINGS[hidden.arm.name], strict=True))
    free = {name: springs[name] for name in hidden.free()}
    files = {
        "model.toml": model_text(description(hidden.arm.name), free, hidden.load_path or ""),
        "key.json": told,
        "readings.csv": _table(hidden, hidden.rows, said, rng, 0),
        "unseen.csv": _table(hidden, unseen, unread, None, 0),
    }
    return write_set(folder, files)


def fill(set_folder: Path, sheet_csv: str, visit: int) -> str:
    """Fill in a sheet of further set-ups: the same truth some days later, with noise and set-ups of their own."""
    told = key_in(set_folder)
    told["nuisance"].pop("spoilt_cells")
    hidden = hidden_of(told)
    rng = np.random.default_rng([hidden.seed, 2, visit])
    lines = sheet_rows(sheet_csv)
    rows = _rows_of(hidden.arm, lines, np.array(told["levels_N"]))
    _, stamps = moments(hidden.clock, [row.pose for row in rows], [row.repeat for row in rows], rng, visit)
    rows = [replace(row, moment=moment) for row, moment in zip(rows, stamps, strict=True)]
    said, _ = blur(hidden.noise, rows, hidden.truth().readings(rows), rng)
    times = sheet_rows(_table(hidden, rows, said, rng, visit))
    columns = list(lines[0])
    asked = [name for name in READ if name in lines[0]] or [READ[i] for i in hidden.axes]
    more = [name for name in ("time_s", "temperature_C", "session") if name in times[0] and name not in lines[0]]
    for line, time, reading in zip(lines, times, said, strict=True):
        line |= {READ[i]: f"{1e3 * reading[i]:.3f}" for i in range(3) if READ[i] in asked}
        line |= {name: time[name] for name in ("time_s", "temperature_C", "session") if name in time}
    return csv_text(lines, [*columns, *asked, *more])


def _rows_of(arm: Arm, lines: Sequence[dict[str, str]], levels: Vector) -> list[Row]:
    """Rows of a sheet; a missing angle, force or point is 0, as the table's description says."""
    for line in lines:
        if any(numbers(line, MOMENTS)):
            raise ValueError("the sheet asks for moments; this world only pulls")
    coordinates = [joint.coordinate for joint in arm.joints]
    found = []
    for i, line in enumerate(lines):
        angles = np.radians(numbers(line, coordinates))
        name = line.get("pose") or "/".join(line.get(c) or "0" for c in coordinates)
        repeat = line.get("repeat") or "1"
        found.append((name, repeat, line.get("phase") or "loading", angles, numbers(line, FORCES), i))
    repeats = list(dict.fromkeys(repeat for _, repeat, *_ in found))
    return [
        Row(
            name,
            repeats.index(repeat) + 1,
            phase,
            angles,
            force,
            numbers(lines[i], POINT) / 1e3,
            int(np.argmin(np.abs(levels - np.linalg.norm(force)))),
        )
        for name, repeat, phase, angles, force, i in found
    ]


def _table(hidden: Hidden, rows: Sequence[Row], said: Vector, rng: np.random.Generator | None, visit: int) -> str:
    """Write a measurement table; without a random generator no times stand in it."""
    arm, axes, clock = hidden.arm, hidden.axes, hidden.clock
    point = bool(np.any(hidden.point))
    days = clock.days > 1 or visit > 0
    head = ["pose", "repeat", *(joint.coordinate for joint in arm.joints), *FORCES, *(POINT if point else ())]
    timed = rng is not None
    if timed:
        head += ["phase", "step", "time_s", *["temperature_C"] * (clock.thermometer != "none"), *["session"] * days]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*head, *(READ[i] for i in axes)])
    for step, (row, reading) in enumerate(zip(rows, said, strict=True), start=1):
        cells = [
            row.pose,
            row.repeat,
            *(f"{a:.2f}" for a in np.degrees(row.angles)),
            *(f"{f + 0:.3f}" for f in row.force),
        ]
        cells += [f"{1e3 * p:.1f}" for p in row.point] if point else []
        if rng is not None:
            cells += [row.phase, step, f"{row.moment.time_s:.0f}"]
            if clock.thermometer != "none":
                cells.append(f"{clock.temperature(row.moment) + 0.05 * rng.normal():.1f}")
            cells += [f"day{row.moment.session + 1}"] * days
        digits = 3 if timed else 6
        writer.writerow([*cells, *(f"{1e3 * reading[i]:.{digits}f}" for i in axes)])
    return text.getvalue()
