"""Making an index over a plane or a box, and its files: tables, the map's arrays, pictures, figures for JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from fem.arm import Arm
from machining import Task
from machining.stiffness.distribution import (
    PRICE,
    Distribution,
    EveryGamma,
    GammaChoice,
    Statistics,
    TradeOff,
    best_gamma,
    distribution,
    trade_off,
    why_not_reached,
)
from machining.stiffness.objective import shown
from robots import InputError
from robots.arrays import Array, Bools
from robots.files.csv_text import columns_text
from robots.progress import Progress
from robots.quantities import Quantity, rounded
from stiffarm.commands.maps.files import Files, write_arrays, write_table
from stiffarm.commands.maps.index.request import IndexRequest
from stiffarm.commands.maps.planes import layer_of
from stiffarm.commands.maps.request import Vector
from stiffarm.commands.maps.step import evaluated
from stiffarm.session.outputs import OutputFolder
from surrogate.maps.blocks import Engine
from surrogate.maps.data import Field, MapData

# Angles drawn, and values in the map's file, where the user names none: so many, spread over the range.
DRAWN: Final = 5
# Values at all gamma that differ by less than this share are one: the inverse of some arms is searched.
SAME: Final = 1e-6


@dataclass(frozen=True, eq=False)
class IndexMap:
    """What a map command found.

    ``data``: the best gamma's pose at each point, with the fields that all maps have. ``inside`` (n,): points of the
    workpiece, None: all. ``choice``: the best gamma for it, None where none reaches all of it (``why_no_choice``).
    ``named``: columns of gamma that were named to be drawn.
    """

    data: MapData
    found: Distribution
    inside: Bools | None
    choice: GammaChoice | None
    why_no_choice: str | None
    named: tuple[int, ...] = ()

    @property
    def drawn(self) -> tuple[int, ...]:
        """Columns of gamma for pictures and the map's file: those named, else some over the range, and the best."""
        gamma = self.found.gamma
        spread = np.unique(np.round(np.linspace(0, len(gamma), DRAWN, endpoint=False)).astype(int))
        best = [] if self.choice is None else [self.choice.column]
        return self.named or tuple(sorted({*map(int, spread[spread < len(gamma)]), *best}))

    @property
    def traded(self) -> TradeOff:
        """What each gamma has against what it reaches, of the workpiece."""
        return trade_off(self.found, self.inside, None if self.choice is None else self.choice.aim)

    @property
    def shown(self) -> Quantity:
        """Quantity and unit."""
        return shown(self.found.objective.quantity)

    def with_values(self, columns: Sequence[int]) -> MapData:
        """The map with the quantity at some of the gamma.

        Fields: ``best_<quantity>`` and ``best_gamma_deg`` (to a small share, so that neighbours are alike: see
        :meth:`Distribution.steady_at_points`), the quantity at each gamma, ``share_of_gamma`` that reach
        the point, ``workpiece`` 0 or 1, and those that all maps have.
        """
        what, found = self.shown, self.found
        own, unit, within = found.steady_at_points(), what.unit or "1", f"within {100.0 * PRICE:g} % of the best"
        inside = np.ones(len(found.value)) if self.inside is None else self.inside.astype(np.float64)
        fields = {
            f"best_{what.column}": Field(what.factor * own.value, unit, f"{what.name}, {within}"),
            "best_gamma_deg": Field(np.degrees(own.gamma), "deg", f"gamma, {within}"),
        }
        for c in columns:
            name = angle_name(found.gamma[c])
            label = f"{what.name}, {name.removesuffix('_deg').replace('_', ' ')} deg"
            fields[f"{what.column}_{name}"] = Field(what.factor * found.value[:, c], unit, label)
        fields["share_of_gamma"] = Field(
            found.reached.mean(axis=1), "", "share of the angles gamma that reach the point"
        )
        fields["workpiece"] = Field(inside, "", "point of the workpiece")
        return replace(self.data, fields={**fields, **self.data.fields})


def make_index_map(
    given: Arm,
    asked: IndexRequest,
    folder: OutputFolder,
    files: Files,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Make the map and write it; returns what index_map.json holds.

    Raises
    ------
    InputError
        No point of the grid, or of the workpiece, can be reached at any gamma; else as
        :func:`stiffarm.commands.maps.step.evaluated`.
    """
    engine, data = evaluated(given, asked, folder, files, progress)
    assert isinstance(engine.rule, EveryGamma)  # noqa: S101 - of an index map
    task, sure = engine.rule.task(data.points), bool(np.all(data.sure))
    found = Distribution(asked.objective, asked.gamma, data.by_rule["by_gamma"], sure)
    for inside, what in ((None, "grid"), (asked.inside, "workpiece")):
        if not (found.reached if inside is None else found.reached[inside]).any():
            raise InputError(
                f"no point of the {what} can be reached at any gamma",
                code="S012",
                value=why_not_reached(given.model, task, asked.gamma) or "no posture was found",
                allowed="one point within reach and joint limits",
                remedy="move the grid or the part, or change the tool or its axis",
            )
    choice, why = None, None
    try:
        # Without a workpiece nobody needs the points at the rim of the grid: reach is weighed against the value.
        choice = best_gamma(found, asked.inside, partly=asked.partly or asked.inside is None)
    except InputError as error:
        why = error.prose
    made = IndexMap(steadied(engine, data, found, task), found, asked.inside, choice, why, asked.drawn or ())
    with folder.timed("files"):
        return write(made, given, folder, files, asked.normal)


def steadied(engine: Engine, data: MapData, found: Distribution, task: Task) -> MapData:
    """A map with each point's pose at the gamma that is alike in its neighbours, not best by a hair.

    The blocks of a map know no neighbours; so the poses that this changes, and their fields, are made once more.
    """
    steady, best = found.steady_at_points(), found.best_at_points()
    moved = steady.column != best.column
    q, fields = data.q.copy(), {name: f.values.copy() for name, f in data.fields.items()}
    for column in np.unique(steady.column[moved]):
        rows = np.flatnonzero(moved & (steady.column == column))
        generator = np.random.default_rng(engine.seed)
        one = distribution(
            engine.quantities.model, task.at(rows), found.objective, found.gamma[[column]], generator=generator
        )
        assert one.q is not None  # noqa: S101 - just made
        # An inverse that is searched may miss what it found before: then the best pose stays.
        there = np.isfinite(one.q).all(axis=1)
        q[rows[there]] = one.q[there]
        for name, values in engine.quantities.values(one.q[there]).items():
            fields[name][rows[there]] = values
    return replace(data, q=q, fields={name: replace(f, values=fields[name]) for name, f in data.fields.items()})


def angle_name(gamma: float) -> str:
    """An angle (rad) in the name of a column or array: ``gamma_-30_deg``."""
    return f"gamma_{round(float(np.degrees(gamma)), 6) + 0.0:g}_deg"


def write(
    made: IndexMap, given: Arm, folder: OutputFolder, files: Files, normal: Vector = (0.0, 0.0, 1.0)
) -> dict[str, Any]:
    """Write the files asked for, ``index_map.csv``, ``gamma_statistics.csv``, ``index_map.json``, pictures and page.

    ``normal`` of the surface, base axes. Returns what the JSON file holds, with the names of all files.
    """
    title = f"Map of {made.shown.name} of the {given.description.title.split(' (')[0]}"
    names = write_arrays(given, made.with_values(made.drawn), folder, files, "index_map", title)
    names += ["index_map.csv", "gamma_statistics.csv", "index_map.json"]
    write_table(made.with_values(range(len(made.found.gamma))), folder.path("index_map.csv"))
    folder.write_text("gamma_statistics.csv", _statistics_table(made))
    if files.pictures:
        names += _pictures(made, folder)
    content = payload(made) | {"files": [*names, "report.html"]}
    folder.write_json("index_map.json", content)
    from stiffarm.commands.maps.index.report import write_report

    write_report(made, given, folder, content, normal)
    return content


def payload(made: IndexMap) -> dict[str, Any]:
    """Figures for ``--json``."""
    what, found = made.shown, made.found
    best, traded = found.best_at_points(), made.traded
    return {
        "schema": "stiffarm-index-map/1",
        **made.data.metadata,
        "quantity": what.name,
        "unit": what.unit or "1",
        "points": made.data.layout.n,
        "counts": list(made.data.layout.shape[::-1]),
        "points_reached": int(found.reached.any(axis=1).sum()),
        "points_every_gamma_reaches": int(found.common.sum()),
        "all_solutions_found": found.sure,
        "best_of_each_point": _range(what.factor * best.value[np.isfinite(best.value)]),
        "workpiece_points": made.data.layout.n if made.inside is None else int(made.inside.sum()),
        "best_gamma": None
        if made.choice is None
        else {
            "gamma_deg": _degrees(made.choice.gamma),
            "aim": made.choice.aim,
            "value": rounded(what.factor * made.choice.value),
            "points_reached": int(traded.points[made.choice.column]),
        },
        "why_no_best_gamma": made.why_no_choice,
        "trade_off": [
            {
                "gamma_deg": _degrees(traded.gamma[c]),
                "points_reached": int(traded.points[c]),
                "share_reached": rounded(traded.points[c] / traded.n),
                "value": rounded(what.factor * float(traded.score[c])),
            }
            for c in traded.front
        ],
        "drawn_gamma_deg": [_degrees(made.found.gamma[c]) for c in made.drawn],
        "by_gamma": _by_gamma(made),
        "warning": made.data.metadata.get("warning"),
        "messages": _messages(found) + [made.data.metadata[key] for key in ("warning",) if key in made.data.metadata],
    }


def _messages(found: Distribution) -> list[str]:
    low, high = (f(np.where(found.reached, found.value, -s * np.inf), axis=1) for f, s in ((np.min, -1), (np.max, 1)))
    several = found.reached.sum(axis=1) > 1
    if several.any() and (high[several] - low[several] <= SAME * np.abs(high[several])).all():
        return ["gamma makes no difference here, as with a tool point on the flange axis: any gamma is as good"]
    return []


def _range(values: Array) -> dict[str, Any]:
    figures = {"min": values.min(), "median": np.median(values), "mean": values.mean(), "max": values.max()}
    return {name: rounded(float(value)) for name, value in figures.items()}


def _degrees(gamma: float) -> float:
    return round(float(np.degrees(gamma)), 9) + 0.0


def _by_gamma(made: IndexMap) -> list[dict[str, Any]]:
    sets = [made.found.statistics("reached"), made.found.statistics("common")]
    return [
        {"gamma_deg": _degrees(gamma), "share_reached": rounded(float(sets[0].share[i]))}
        | {s.over: _figures(s, i, made.shown) for s in sets}
        for i, gamma in enumerate(made.found.gamma)
    ]


_FIGURES: Final = ("mean", "standard_deviation", "peak_to_valley", "smallest", "largest")


def _figures(s: Statistics, i: int, what: Quantity) -> dict[str, Any]:
    found = {name: what.factor * float(getattr(s, name)[i]) for name in _FIGURES}
    return {"points": int(s.points[i])} | {k: rounded(v) if np.isfinite(v) else None for k, v in found.items()}


def _statistics_table(made: IndexMap) -> str:
    """Gamma, share reached, and the figures over both sets of points; empty where there is none."""
    what = made.shown
    table: dict[str, Any] = {"gamma_deg": [_degrees(g) for g in made.found.gamma]}
    for over in ("reached", "common"):
        s = made.found.statistics(over)
        if over == "reached":
            table["share_reached"] = s.share
        table[f"{over}_points"] = s.points
        table |= {f"{over}_{name}_{what.column}": what.factor * getattr(s, name) for name in _FIGURES}
    return columns_text(table, digits=9)


def _pictures(made: IndexMap, folder: OutputFolder) -> list[str]:
    from stiffarm.commands.maps.figures.whole import save_figure
    from stiffarm.commands.maps.index.figures import draw_gamma_statistics, draw_index_maps, draw_trade_off

    name = f"{made.shown.name} of the {made.data.metadata['robot']}"
    plane = layer_of(made.data.layout, _busiest_layer(made))
    maps = draw_index_maps(plane, made.found, made.drawn, title=name, inside=made.inside)
    names = save_figure(maps, folder, "index_map")
    if len(made.found.gamma) == 1:
        return names
    of = "" if made.inside is None else ", over the workpiece"
    statistics = draw_gamma_statistics(
        made.found, title=f"{name} against gamma{of}", choice=made.choice, inside=made.inside
    )
    names += save_figure(statistics, folder, "gamma_statistics")
    if len(made.traded.front) > 1:
        figure = draw_trade_off(
            made.traded, made.choice, made.shown, title=f"{name}: {made.traded.aim} against reach{of}"
        )
        names += save_figure(figure, folder, "gamma_trade_off")
    return names


def _busiest_layer(made: IndexMap) -> int:
    """Of a box the layer with most points reached, of several the one nearest to the middle."""
    if made.data.layout.kind == "slice":
        return 0
    count = made.data.layout.shape[0]
    reached = made.found.reached.any(axis=1).reshape(count, -1).sum(axis=1)
    layers = np.flatnonzero(reached == reached.max())
    return int(layers[np.abs(layers - count // 2).argmin()])
