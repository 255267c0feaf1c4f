"""What worlds share: folders of sets, tables and sheets as text, description files, the command line. No physics.

How an arm moves, yields, is loaded and is read, and what hides in it, is each world's own.
"""

from __future__ import annotations

import argparse
import csv
import inspect
import io
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

Dealt = TypeVar("Dealt")
Rng = np.random.Generator
HERE = Path(__file__).resolve().parent
READ = ("dx_mm", "dy_mm", "dz_mm")
FORCES, MOMENTS, POINT = ("fx_N", "fy_N", "fz_N"), ("mx_Nm", "my_Nm", "mz_Nm"), ("px_mm", "py_mm", "pz_mm")
UNITS = {
    "m": 1.0,
    "mm": 1e-3,
    "rad": 1.0,
    "kg": 1.0,
    "kg/m^3": 1.0,
    "GPa": 1e9,
    "N m/rad": 1.0,
    "N mm/rad": 1e-3,
    "1": 1.0,
}


def command(make: Callable[..., list[Path]], fill: Callable[..., str] | None = None) -> None:
    """The command line of a world: ``make OUT --seed N`` and ``fill SET SHEET OUT --visit K``."""
    parser = argparse.ArgumentParser(prog=f"python -m {make.__module__.rpartition('.')[0]}")
    commands = parser.add_subparsers(dest="command", required=True)
    making = commands.add_parser("make", help="write measurement sets with their hidden truth")
    making.add_argument("out", type=Path)
    making.add_argument("--seed", type=int, required=True)
    for kind, count in list(inspect.signature(make).parameters.items())[2:]:
        making.add_argument(f"--{kind}", type=int, default=count.default, help=f"sets [default: {count.default}]")
    if fill:
        filling = commands.add_parser("fill", help="fill in a sheet of further set-ups")
        for name in ("set_folder", "sheet", "out"):
            filling.add_argument(name, type=Path)
        filling.add_argument("--visit", type=int, default=1)
    given = vars(parser.parse_args())
    if given.pop("command") == "make":
        print(f"{len(make(**given))} sets in {given['out']}")
    elif fill:
        filled = fill(given["set_folder"], given["sheet"].read_text(encoding="utf-8"), given["visit"])
        given["out"].write_text(filled, encoding="utf-8", newline="")


def write_files(folder: Path, files: Mapping[str, Any]) -> Path:
    """A new folder with files: text as it is, anything else as JSON. ValueError: it is there already."""
    if folder.exists():
        raise ValueError(f"{folder} is there already")
    folder.mkdir(parents=True)
    for name, content in files.items():
        text = content if isinstance(content, str) else json.dumps(content, indent=1, ensure_ascii=False) + "\n"
        (folder / name).write_text(text, encoding="utf-8", newline="")
    return folder


def write_set(folder: Path, files: Mapping[str, Any], **start: str) -> Path:
    """A set's folder, where set.json says ``start``."""
    head = {"schema": "stiffarm-study-set/1", "model": "model.toml", "links": "rigid"}
    return write_files(folder, {"set.json": head | start, **files})


def key_in(folder: Path) -> dict[str, Any]:
    """A set's key."""
    return dict(json.loads((Path(folder) / "key.json").read_text(encoding="utf-8")))


def csv_text(rows: Iterable[Mapping[str, Any]], columns: Sequence[str] = ()) -> str:
    """Rows as CSV; columns are the first row's if none are given."""
    rows, out = list(rows), io.StringIO()
    writer = csv.DictWriter(out, list(dict.fromkeys(columns or rows[0])), restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def sheet_rows(sheet: str) -> list[dict[str, str]]:
    """Lines of a sheet of readings to be taken, each with all columns. ValueError: there are none."""
    first = sheet.partition("\n")[0]
    rows = list(csv.DictReader(io.StringIO(sheet), delimiter=";" if first.count(";") > first.count(",") else ","))
    if not rows:
        raise ValueError("the sheet has no rows; pass one with a row for each reading to take")
    return rows


def number(row: Mapping[str, str], name: str, otherwise: float = 0.0) -> float:
    """A cell's figure."""
    cell = (row.get(name) or "").strip()
    return float(cell) if cell else otherwise


def numbers(row: Mapping[str, str], names: Sequence[str]) -> np.ndarray:
    """Figures of some cells; an empty one is 0."""
    return np.array([number(row, name) for name in names])


def source_of(name: str) -> Path:
    """The description file of an arm of the worlds' own, or a bundled one."""
    own = HERE / "arms" / f"{name}.toml"
    return own if own.exists() else HERE.parents[1] / "robots" / "data" / own.name


def description(name: str) -> str:
    """Its text."""
    return source_of(name).read_text(encoding="utf-8")


def si(entry: Mapping[str, Any], degree: float = 1.0) -> Any:
    """A figure of a description file in SI units, a list as an array; ``degree``: what a degree counts."""
    factor = degree if entry["unit"] == "deg" else UNITS[entry["unit"]]
    value = entry["value"]
    return np.asarray(value, dtype=float) * factor if isinstance(value, list) else float(value) * factor


def model_text(text: str, springs: Mapping[str, float], load_path: str = "", digits: str = ".6g") -> str:
    """A description with these springs in N m/rad and no others: joints that are not named are held rigid."""
    text = re.sub(r"^stiffness = .*\n", "", text, flags=re.M)
    if load_path:
        text = re.sub(r'^load_path = ".*"', f'load_path = "{load_path}"', text, flags=re.M)
    for name, k in springs.items():
        line = f'stiffness = {{ value = {float(k):{digits}}, unit = "N m/rad", source = "assumed" }}\n'
        text, count = re.subn(rf'^(\[\[joint\]\]\nname = "{re.escape(name)}"\n)', rf"\g<1>{line}", text, flags=re.M)
        if count != 1:
            raise ValueError(f"joint {name} stands {count} times in the description; once is right")
    return text


def log_uniform(rng: Rng, low: float, high: float) -> float:
    """Between two positive numbers, all magnitudes alike."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def sign(rng: Rng) -> float:
    """-1 or 1."""
    return float(rng.choice([-1.0, 1.0]))


def direction(rng: Rng, flat: bool = False) -> list[float]:
    """A unit vector; flat: a horizontal one."""
    v = rng.normal(size=3) * ([1, 1, 0] if flat else [1, 1, 1])
    return [float(x) for x in v / np.linalg.norm(v)]


def deal(rng: Rng, cards: Sequence[Dealt]) -> Iterator[Dealt]:
    """All cards in a random order, again and again."""
    while True:
        for i in rng.permutation(len(cards)):
            yield cards[i]


def partner(first: str, families: Iterator[str], aside: list[str], spot: Callable[[str], str]) -> str:
    """The next family that can be elsewhere than the first; those that cannot are put aside for the next pair."""

    def fits(family: str) -> bool:
        return family != first and not (spot(first) and spot(first) == spot(family))

    for i, family in enumerate(aside):
        if fits(family):
            return aside.pop(i)
    while not fits(family := next(families)):
        aside.append(family)
    return family


@dataclass(frozen=True)
class Effect:
    """A law by its family, where it acts, and its numbers."""

    family: str
    place: str
    numbers: dict[str, Any]


@dataclass(frozen=True)
class Spec:
    """One set, all of it in its key. Loads in N, springs in N m/rad; a stated spring of 0 is a rigid joint."""

    seed: int
    kind: str
    arm: str
    path: str
    springs: tuple[float, ...]
    stated: tuple[float, ...]
    reads: str
    poses: int
    grid: bool
    loads: tuple[float, ...]
    down: bool
    repeats: int
    second: tuple[float, ...]  # direction of every other set-up's load; none: all go down
    sessions: int
    columns: tuple[str, ...]
    scatter: float
    outliers: bool
    noise: dict[str, Any]
    balance: float  # share of the weights' torques that is balanced
    effects: tuple[Effect, ...] = field(default=(), kw_only=True)

    @property
    def axes(self) -> list[int]:
        """Components that are read."""
        return [2] if self.reads == "z" else [0, 1, 2]

    def rng(self, *what: int) -> Rng:
        """Chance that goes by the set and by what it is asked for."""
        return np.random.default_rng([self.seed, *what])

    @classmethod
    def of_key(cls, raw: Mapping[str, Any]) -> Any:
        """A set as it stands in its key."""
        given = {key: tuple(value) if isinstance(value, list) else value for key, value in raw.items()}
        return cls(**given | {"effects": tuple(Effect(**one) for one in raw["effects"])})

    def key(
        self,
        world: str,
        laws: Mapping[str, Any],
        shows: Callable[[tuple[Effect, ...]], float],
        real: float,
        **tags: Any,
    ) -> dict[str, Any]:
        """The truth and how much of it shows: of each effect, of all, and ``real`` with all that is off too."""
        common = {
            "reads": self.reads,
            "poses": self.poses,
            "scatter": self.scatter,
            "outliers": self.outliers,
            "noise": self.noise["kind"],
            "loads": f"{len(self.loads)} {'up and down' if self.down else 'up'}",
            "arm": self.arm,
            "directions": 2 if self.second else 1,
            "sessions": self.sessions,
            "kind": self.kind,
        }
        return {
            "schema": "stiffarm-study-key/1",
            "world": world,
            "effects": [
                {
                    "code": laws[e.family].code(e.place),
                    "axis": list(laws[e.family].axes),
                    "place": e.place,
                    "excess_chi2": round(shows((e,)), 2),
                }
                for e in self.effects
            ],
            "excess_chi2": round(shows(self.effects), 2),
            "tags": common | tags,
            "excess_chi2_with_nuisance": round(real, 2),
            world: asdict(self),
        }


def make_kinds(
    out: Path, seed: int, counts: Mapping[str, int], wishes: Callable[..., list[Any]], write: Callable[..., Path]
) -> list[Path]:
    """Sets by kind: ``wishes(rng, kind, count)`` says what each is to be, ``write(folder, wish, seed)`` makes it."""
    return [
        write(Path(out) / f"{kind}-{i + 1:03d}", wish, int(np.random.default_rng([seed, k, i]).integers(2**31)))
        for k, (kind, count) in enumerate(counts.items())
        for i, wish in enumerate(wishes(np.random.default_rng([seed, k]), kind, count))
    ]
