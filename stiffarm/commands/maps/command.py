"""The command `map`: the arm over its joints or over points in space, or an index over a plane or box by gamma."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import typer
from typer.core import TyperGroup

from fem.arm import Arm
from robots import InputError, content_hash, require_one_of
from robots.arrays import Array
from robots.library.models import bundled_names
from robots.progress import Progress
from robots.quantities import Quantity, percent, rounded, significant
from stiffarm.capability import capability
from stiffarm.commands.maps.files import CSV_UP_TO, DRAWN_UP_TO, write_arrays, write_table
from stiffarm.commands.maps.index.request import IndexMapRequest
from stiffarm.commands.maps.joints import JointsRequest
from stiffarm.commands.maps.request import (
    FORMATS,
    ArmMapRequest,
    BoxRequest,
    CylinderRequest,
    MapJob,
    MapRequest,
    SliceRequest,
    SpaceRequest,
    evaluate,
)
from stiffarm.pages.report import KeyFigure
from stiffarm.result import Result, Table
from stiffarm.session.caution import cautioned, caveats
from stiffarm.session.console import progress, say_notes, user_errors
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.softness import require_springs
from stiffarm.session.stated import stated_table
from surrogate.maps.blocks import Engine
from surrogate.maps.cluster import run_on
from surrogate.maps.data import Layout, MapData, figures
from surrogate.maps.mesh import map_mesh, write_map
from surrogate.maps.poses import Extreme, shortfall
from surrogate.maps.quantities import STIFFNESS_ARRAY

if TYPE_CHECKING:
    import pandas as pd

    from stiffarm.pages.picture import Picture

# Points at which an extreme pose is sought again with a denser sample.
CHECKED = 12
_OVER = {
    "joints": "map over joint angles",
    "slice": "map over a plane",
    "box": "map over a box",
    "cylinder": "map over a cylinder",
}


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Map(Result):
    """A map: a pose at each point, and quantities with units. ``m["stiffness_N_per_mm"]`` is one of them."""

    found: MapData

    @property
    def data(self) -> MapData:
        """Points, poses and quantities as arrays."""
        return self.found

    @property
    def mesh(self) -> Any:
        """The map as a data set of pyvista: an image of a slice or a box, else cells between the reached points."""
        return map_mesh(self.found, "vti" if self.found.layout.kind in ("slice", "box") else "vtu")

    def to_frame(self, table: str | None = None) -> pd.DataFrame:
        """One row a point: its place in mm, the pose in degrees, the quantities; or another table by its name."""
        if table is not None:
            return super().to_frame(table)
        import pandas as pd

        return pd.DataFrame({name: f.values for name, f in (self.found.places() | dict(self.found.fields)).items()})

    def __getitem__(self, name: str) -> Array:
        """A quantity (n,) by its name, in the unit that this says; NaN where there is no pose."""
        require_one_of("quantity", name, self.found.fields, code="B003")
        return np.asarray(self.found.fields[name].values)

    def __repr__(self) -> str:
        return f"{self.title}\n{self.answer}"

    def _repr_html_(self) -> str:
        return f"<p>{self.title}. {self.answer}</p>" + self.tables[0].frame().to_html(index=False, border=0)

    def plot(self, name: str | None = STIFFNESS_ARRAY, file: str | Path | None = None) -> Picture:
        """One quantity with the robot in it; ``file``: a PNG to write."""
        from stiffarm.commands.maps.figures.whole import one_figure
        from stiffarm.pages.picture import Picture

        if name is None or name not in self.found.fields or self.arm is None:
            return super().plot(name, file)
        with cautioned(self.warning):
            return Picture.of(one_figure(self.found, name, self.arm)).kept(file)

    def save(self, folder: str | Path) -> Path:
        """Write all files into a folder, or the points alone into a .vti (slice, box), .vtu, .vtp or .csv file."""
        from robots.files.written import written_whole

        path, endings = Path(folder), [f".{name}" for name in (*FORMATS, "csv")]
        if not path.suffix:
            return super().save(path)
        if path.suffix not in endings:
            raise InputError("map file", code="B004", value=str(path), allowed=f"a name ending in {', '.join(endings)}")
        if path.suffix != ".csv":
            write_map(self.found, path)
            return path
        with written_whole(path) as draft:
            write_table(self.found, draft)
        return path


def evaluated(given: Arm, asked: MapRequest, report: Progress | None = None) -> tuple[Engine, MapData]:
    """A map, its blocks made here or on a cluster, and its engine; ``given``: the arm of :meth:`MapRequest.stated`.

    Raises
    ------
    InputError
        A work folder or a cluster that cannot be used; a package that is missing.
    """
    engine = asked.engine(given)
    store = engine.store() if asked.work is None else engine.store(asked.key(given), asked.work)
    make = None if asked.dask is None else partial(run_on, asked.dask, evaluate, MapJob.of(asked, given))
    return engine, engine.computed(asked.metadata(given, engine), report, store, make)


def answer(given: Arm, asked: ArmMapRequest) -> Map:
    """The map with its figures."""
    require_springs(given, "map")
    return mapped(asked.stated(given), asked)


def mapped(arm: Arm, asked: ArmMapRequest, *, table: bool = True) -> Map:
    """The map of an arm of :meth:`MapRequest.stated`; ``table``: its files have all points as CSV too.

    Raises
    ------
    InputError
        No point is reached; else as :func:`evaluated`.
    """
    with progress("map points") as bar:
        engine, data = evaluated(arm, asked, bar)
    n, reached = data.layout.n, int(np.count_nonzero(data.reached))
    if not reached:
        raise _out_of_reach(arm, asked, data.layout)
    facts = statistics(engine, data, asked) | stated_table(arm.model)
    shown = {name: Quantity(name, f.unit, label=f.label) for name, f in data.fields.items()}
    numbers = {name: of for name, of in facts["quantities"].items() if "min" in of}
    first = STIFFNESS_ARRAY if STIFFNESS_ARRAY in numbers else next(iter(numbers), None)
    words, key = (
        f"It reaches {reached:,} of {n:,} points.",
        [KeyFigure(percent(reached / n), "of the points are reached")],
    )
    if first is not None:
        of, quantity = numbers[first], shown[first]
        median, ends = quantity.text(of["median"], unit=True), quantity.between(of["min"], of["max"])
        words = f"Its {quantity.label} is {median} at the median point, {ends} over all; {words[0].lower()}{words[1:]}"
        key.insert(0, KeyFigure(median, f"{quantity.label}, median point", ends))
    caption = _OVER[asked.kind] + ("" if asked.kind == "joints" else f": {asked.pose_words}")
    draws = asked.pictures and (asked.kind != "joints" or asked.values is not None or STIFFNESS_ARRAY in data.fields)
    return Map(
        name="map",
        title=f"Stiffness map of the {arm.description.title.split(' (')[0]}",
        question="where is it stiff?",
        answer=words,
        how_sure=_how_sure(facts),
        what_next="`stiffarm index MODEL --pose ...` shows one pose in all directions, `stiffarm posture` a tool path.",
        facts=facts,
        tables=tuple(_tables(numbers, facts["quantities"], caption)),
        drawings=_drawings(arm, data, asked) if draws and n <= DRAWN_UP_TO else (),
        key=tuple(key),
        remarks=tuple(_remarks(arm, data, asked, draws)),
        arm=arm,
        found=data,
        more=partial(_write, arm, data, asked, table),
    )


def _drawings(arm: Arm, data: MapData, asked: ArmMapRequest) -> Any:
    from stiffarm.commands.maps.figures.whole import drawings

    return drawings(data, arm, every=asked.kind != "joints" or asked.values is not None)


def _write(arm: Arm, data: MapData, asked: ArmMapRequest, table: bool, folder: OutputFolder) -> Mapping[str, Any]:
    stem = "stiffness_map" if asked.kind == "joints" else "map"
    title = f"Stiffness map of the {arm.description.title.split(' (')[0]}"
    names = write_arrays(arm, data, folder, asked, stem, title)
    if table and data.layout.n <= CSV_UP_TO:
        names.append("map.csv")
        write_table(data, folder.path("map.csv"))
    if asked.pictures and data.layout.kind != "slice":
        from stiffarm.pages.rendering import chosen

        works, message = chosen(None)
        if not works:
            say_notes([message])
    return {"files": names}


def _remarks(arm: Arm, data: MapData, asked: ArmMapRequest, draws: bool) -> list[str]:
    """What the reader must know of the arm, of the search, and of what is left out."""
    note, n = asked.note(arm.robot), data.layout.n
    out: list[str] = [text for text in (caveats(arm), note) if text]
    unsure = 0 if data.sure is None else n - int(np.count_nonzero(data.sure))
    if note is None and unsure:
        out.append(f"at {unsure} points the search may have missed a branch of the inverse kinematics")
    learned = asked.learned if isinstance(asked, JointsRequest) else None
    if learned is not None and learned.model_hash != content_hash(arm.description):
        out.append("the surrogate was fitted to another model than MODEL; the map's file has the stiffness of both")
    if draws and n > DRAWN_UP_TO:
        out.append(f"no figures of more than {DRAWN_UP_TO} points; the {asked.formats[0]} file has them all")
    return out


def _how_sure(facts: Mapping[str, Any]) -> str:
    check = facts.get("search_check", {})
    if not check.get("points"):
        return "Static stiffness at each pose; collisions are not checked."
    worst = significant(check["worst_shortfall_percent"], 2)
    return f"A finer search at {check['points']} of these points finds poses that are at most {worst} % better."


def _tables(numbers: Mapping[str, Any], quantities: Mapping[str, Any], caption: str) -> list[Table]:
    """Figures of the quantities, and of those that name something the share of each, for people."""
    labels = [of["label"] + (f", {of['unit']}" if of["unit"] else "") for of in numbers.values()]
    ends = {"least": "min", "median": "median", "greatest": "max"}
    columns = {Quantity(name): np.array([of[key] for of in numbers.values()]) for name, key in ends.items()}
    if any("max_near_singular" in of for of in numbers.values()):
        caption += " (greatest: without poses near a singularity, where stiffness along one direction has no bound)"
    shares = [
        (of["label"], name, share)
        for of in quantities.values()
        for name, share in sorted(of.get("share_of_points", {}).items(), key=lambda item: -item[1])
        if share > 0.0 and name != "no"
    ]
    out = [Table("quantities", caption, {"": labels}, columns, is_extract=True)]
    if shares:
        names, parts, values = zip(*shares, strict=True)
        of_points = {Quantity("share_of_points", "%", 100.0, "share of the points", 3): np.array(values)}
        out.append(Table("shares", "Share of the points", {"": names, "is": parts}, of_points, is_extract=True))
    return out


def statistics(engine: Engine, data: MapData, asked: ArmMapRequest) -> dict[str, Any]:
    """Figures of a map for its JSON."""
    n, reached = data.layout.n, int(np.count_nonzero(data.reached))
    out: dict[str, Any] = {
        "robot": data.metadata["robot"],
        "grid": data.layout.kind,
        "axes": [
            {"name": a.name, "unit": a.unit, "first": a.values[0], "last": a.values[-1], "count": len(a.values)}
            for a in data.layout.axes
        ],
        "held_mm": dict(data.layout.held),
        "pose": asked.pose_words,
        "grid_points": n,
        "points": reached,
        "share_reached": rounded(reached / n),
        "quantities": {},
    }
    for name, field in data.fields.items():
        if field.categories:
            known = field.values[field.values >= 0.0].astype(np.int64)
            found = np.bincount(known, minlength=len(field.categories))
            out["quantities"][name] = {
                "label": field.label,
                "share_of_points": {c: rounded(k / reached) for c, k in zip(field.categories, found, strict=True)},
            }
            continue
        of = figures(field.values)
        if of is None:
            continue
        highest = of
        if field.unit == "N/mm":
            highest = figures(np.where(data.regular(), field.values, np.nan)) or of
        out["quantities"][name] = {
            "label": field.label,
            "unit": field.unit,
            "points": of.count,
            "min": rounded(of.least),
            "median": rounded(of.median),
            "max": rounded(highest.greatest),
            "least_at": _place(data, of.row_of_least),
            "greatest_at": _place(data, highest.row_of_greatest),
        }
        if highest.greatest < of.greatest:
            out["quantities"][name]["max_near_singular"] = rounded(of.greatest)
    if isinstance(engine.rule, Extreme) and engine.arm is not None:
        out["search_check"] = _search_check(engine, engine.rule, data)
    return out


def _search_check(engine: Engine, rule: Extreme, data: MapData) -> dict[str, Any]:
    """By how much a denser search beats the map's at some of its points."""
    assert engine.arm is not None  # noqa: S101 - a rule has an arm
    step, found = max(1, data.layout.n // (64 * CHECKED)), np.zeros(0)
    rows = step * np.flatnonzero(data.reached[::step])
    if len(rows):
        rows = rows[np.linspace(0, len(rows) - 1, min(CHECKED, len(rows))).astype(int)]
        found = shortfall(rule, engine.arm, data.points[rows], data.q[rows], np.random.default_rng(engine.seed))
        found = found[np.isfinite(found)]
    worst = rounded(100.0 * float(found.max())) if len(found) else None
    return {"points": len(found), "worst_shortfall_percent": worst}


def _place(data: MapData, row: int) -> dict[str, Any]:
    place = {name: rounded(float(f.values[row])) for name, f in data.places().items()}
    return {"row": row, **place}


def _out_of_reach(given: Arm, asked: ArmMapRequest, grid: Layout) -> InputError:
    if not isinstance(asked, SpaceRequest):
        return InputError(
            f"map of {given.robot.name}: no pose of the sweep can be taken", code="S012", remedy="use other --layers"
        )
    pose = "" if asked.any_orientation else f" with {asked.pose_words.split(', best')[0]}"
    return InputError(
        f"no point of the {grid.kind} can be reached{pose}",
        code="S012",
        value=f"{grid.n} points",
        allowed=f"within the reach of {given.robot.name}, about {asked.reach(given.robot).words}",
        remedy="move or widen the grid" + (", or let the orientation be free: --pose stiffest" if pose else ""),
    )


def index_answer(given: Arm, asked: IndexMapRequest) -> Result:
    """The index at every gamma, and the best gamma."""
    arm = asked.stated(given)
    # What an index needs is not loaded with the other maps.
    from stiffarm.commands.maps.index.answer import index_map

    with progress("map points") as bar:
        return index_map(arm, asked, *evaluated(arm, asked, bar))


class _Maps(TyperGroup):
    """The kinds of maps. Whoever types the form of before, without a kind, is told the new one."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        old = any(word.split("=")[0] in ("--grid", "--quantity") for word in args) or Path(args[0]).suffix != ""
        if args[0] not in self.commands and (old or args[0] in bundled_names()):
            with user_errors(debug=False):
                raise InputError(
                    "`stiffarm map` needs to know what kind of map",
                    code="A003",
                    allowed=", ".join(self.commands),
                    remedy=f"type {new_form(args)}",
                )
        return super().resolve_command(ctx, args)


def new_form(args: list[str]) -> str:
    """The command of today that does what arguments of `stiffarm map` without a kind did."""
    words, kind = [part for word in args for part in word.split("=", 1)], "joints"
    if "--grid" in words:
        at = words.index("--grid")
        kind = words[at + 1] if at + 1 < len(words) else kind
        del words[at : at + 2]
    kind = "index" if "--quantity" in words else kind
    return "`" + shlex.join(["stiffarm", "map", kind, *words]) + "`"


map_command = typer.Typer(
    cls=_Maps,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Map the stiffness over joints or over points in space.",
)
map_joints = capability("map joints", JointsRequest, answer)
map_slice = capability("map slice", SliceRequest, answer)
map_box = capability("map box", BoxRequest, answer)
map_cylinder = capability("map cylinder", CylinderRequest, answer)
map_index = capability("map index", IndexMapRequest, index_answer)
