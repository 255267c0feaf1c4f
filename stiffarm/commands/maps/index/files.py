"""Making an index over a plane or a box, and its files: tables, the map's arrays, pictures, figures for JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

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
from machining.stiffness.objective import Shown, shown
from robots import InputError
from robots.arrays import Array, Bools
from robots.files.csv_text import columns_text
from robots.progress import Progress
from stiffarm.commands.maps.files import Files, write_arrays, write_table
from stiffarm.commands.maps.index.request import IndexRequest, map_request
from stiffarm.commands.maps.planes import layer_of
from stiffarm.commands.maps.request import MapRequest
from stiffarm.commands.maps.step import evaluated
from stiffarm.session.caution import warned
from stiffarm.session.json_text import number
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.parsing import frame_words
from surrogate.maps.assembled import map_data
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
    ``drawn``: columns of the distribution's gamma for pictures and the map's file.
    """

    data: MapData
    found: Distribution
    inside: Bools | None
    choice: GammaChoice | None
    why_no_choice: str | None
    drawn: tuple[int, ...]

    @property
    def traded(self) -> TradeOff:
        """What each gamma has against what it reaches, of the workpiece."""
        return trade_off(self.found, self.inside, None if self.choice is None else self.choice.aim)

    @property
    def shown(self) -> Shown:
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
            f"best_{what.column}": Field(what.factor * own.value, unit, f"{what.quantity}, {within}"),
            "best_gamma_deg": Field(np.degrees(own.gamma), "deg", f"gamma, {within}"),
        }
        for c in columns:
            name = angle_name(found.gamma[c])
            label = f"{what.quantity}, {name.removesuffix('_deg').replace('_', ' ')} deg"
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
    seed: int,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Make the map and write it; returns what index_map.json holds.

    Raises
    ------
    InputError
        No point of the grid, or of the workpiece, can be reached at any gamma; else as
        :func:`stiffarm.commands.maps.step.evaluated`.
    """
    request = map_request(given, asked, seed)
    with evaluated(given, request, folder, files, progress) as (engine, arrays):
        assert isinstance(engine.rule, EveryGamma)  # noqa: S101 - map_request asks for it
        task = engine.rule.task(np.asarray(arrays["points"], dtype=np.float64))
        values, sure = np.asarray(arrays["by_gamma"], dtype=np.float64), bool(np.all(arrays["sure"]))
        found = Distribution(asked.objective, asked.gamma, values, sure)
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
        data = map_data(engine, steadied(engine, arrays, found, task), _metadata(given, asked, request, task))
        drawn = asked.drawn or drawn_columns(asked.gamma, choice)
        with folder.timed("files"):
            return write(IndexMap(data, found, asked.inside, choice, why, drawn), given, folder, files, request.normal)


def steadied(
    engine: Engine, arrays: Mapping[str, NDArray[np.generic]], found: Distribution, task: Task
) -> dict[str, NDArray[np.generic]]:
    """A map's arrays with each point's pose at the gamma that is alike in its neighbours, not best by a hair.

    The blocks of a map know no neighbours; so the poses that this changes, and their fields, are made once more.
    """
    assert isinstance(engine.rule, EveryGamma)  # noqa: S101 - of an index map
    steady, best = found.steady_at_points(), found.best_at_points()
    out: dict[str, NDArray[np.generic]] = dict(arrays)
    moved = steady.column != best.column
    if not moved.any():
        return out
    names = [kind.name for kind in engine.quantities.kinds]
    out |= {name: np.array(arrays[name]) for name in ("q", *names)}
    for column in np.unique(steady.column[moved]):
        rows = np.flatnonzero(moved & (steady.column == column))
        generator = np.random.default_rng(engine.seed)
        one = distribution(
            engine.rule.model, task.at(rows), found.objective, found.gamma[[column]], generator=generator
        )
        assert one.q is not None  # noqa: S101 - just made
        # An inverse that is searched may miss what it found before: then the best pose stays.
        there = np.isfinite(one.q).all(axis=1)
        out["q"][rows[there]] = one.q[there]
        for name, values in engine.quantities.values(one.q[there]).items():
            out[name][rows[there]] = values
    return out


def _metadata(given: Arm, asked: IndexRequest, request: MapRequest, task: Task) -> dict[str, str]:
    """What the map is of, words by name."""
    frame, force = task.T_base_part, asked.objective.force
    return {
        "robot": given.robot.name,
        "model_hash": request.model_hash,
        "links": request.links,
        "load_path": given.model.load_path,
        "tool_on_flange": frame_words(task.T_flange_tool),
        "part_in_base": frame_words(frame),
        "normal": _words(asked.normal),
        "tool_axis": _words(asked.axis),
        "gamma_counts_from": _words(frame[:3, :3] @ np.asarray(task.reference)),
        "force_N": "none" if force is None else _words(force),
        "not_looked_at": "collisions; the way from point to point",
    } | warned(given)


def _words(vector: Array) -> str:
    return " ".join(f"{v + 0.0:.6g}" for v in vector)


def drawn_columns(gamma: Array, choice: GammaChoice | None) -> tuple[int, ...]:
    """Which angles to draw unasked: some spread over the range, and the best."""
    spread = np.unique(np.round(np.linspace(0, len(gamma), DRAWN, endpoint=False)).astype(int))
    spread = spread[spread < len(gamma)]
    return tuple(sorted({*map(int, spread), *(() if choice is None else (choice.column,))}))


def angle_name(gamma: float) -> str:
    """An angle (rad) in the name of a column or array: ``gamma_-30_deg``."""
    return f"gamma_{round(float(np.degrees(gamma)), 6) + 0.0:g}_deg"


def write(
    made: IndexMap, given: Arm, folder: OutputFolder, files: Files, normal: Sequence[float] = (0.0, 0.0, 1.0)
) -> dict[str, Any]:
    """Write the files asked for, ``index_map.csv``, ``gamma_statistics.csv``, ``index_map.json``, pictures and page.

    ``normal`` of the surface, base axes. Returns what the JSON file holds, with the names of all files.
    """
    title = f"Map of {made.shown.quantity} of the {given.description.title.split(' (')[0]}"
    names = write_arrays(given, made.with_values(made.drawn), folder, files, "index_map", title)
    names += ["index_map.csv", "gamma_statistics.csv", "index_map.json"]
    write_table(made.with_values(range(len(made.found.gamma))), folder.path("index_map.csv"))
    folder.write_text("gamma_statistics.csv", _statistics_table(made))
    if files.picture_formats:
        names += _pictures(made, folder, files.picture_formats)
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
        "quantity": what.quantity,
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
            "value": number(what.factor * made.choice.value),
            "points_reached": int(traded.points[made.choice.column]),
        },
        "why_no_best_gamma": made.why_no_choice,
        "trade_off": [
            {
                "gamma_deg": _degrees(traded.gamma[c]),
                "points_reached": int(traded.points[c]),
                "share_reached": number(traded.points[c] / traded.n),
                "value": number(what.factor * float(traded.score[c])),
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
    return {name: number(float(value)) for name, value in figures.items()}


def _degrees(gamma: float) -> float:
    return round(float(np.degrees(gamma)), 9) + 0.0


def _by_gamma(made: IndexMap) -> list[dict[str, Any]]:
    sets = [made.found.statistics("reached"), made.found.statistics("common")]
    return [
        {"gamma_deg": _degrees(gamma), "share_reached": number(float(sets[0].share[i]))}
        | {s.over: _figures(s, i, made.shown) for s in sets}
        for i, gamma in enumerate(made.found.gamma)
    ]


_FIGURES: Final = ("mean", "standard_deviation", "peak_to_valley", "smallest", "largest")


def _figures(s: Statistics, i: int, what: Shown) -> dict[str, Any]:
    found = {name: what.factor * float(getattr(s, name)[i]) for name in _FIGURES}
    return {"points": int(s.points[i])} | {k: number(v) if np.isfinite(v) else None for k, v in found.items()}


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


def _pictures(made: IndexMap, folder: OutputFolder, formats: Sequence[str]) -> list[str]:
    from stiffarm.commands.maps.figures.whole import save_figure
    from stiffarm.commands.maps.index.figures import draw_gamma_statistics, draw_index_maps, draw_trade_off

    name = f"{made.shown.quantity} of the {made.data.metadata['robot']}"
    plane = layer_of(made.data.layout, _busiest_layer(made))
    maps = draw_index_maps(plane, made.found, made.drawn, title=name, inside=made.inside)
    names = save_figure(maps, folder, "index_map", formats)
    if len(made.found.gamma) == 1:
        return names
    of = "" if made.inside is None else ", over the workpiece"
    statistics = draw_gamma_statistics(
        made.found, title=f"{name} against gamma{of}", choice=made.choice, inside=made.inside
    )
    names += save_figure(statistics, folder, "gamma_statistics", formats)
    if len(made.traded.front) > 1:
        figure = draw_trade_off(
            made.traded, made.choice, made.shown, title=f"{name}: {made.traded.aim} against reach{of}"
        )
        names += save_figure(figure, folder, "gamma_trade_off", formats)
    return names


def _busiest_layer(made: IndexMap) -> int:
    """Of a box the layer with most points reached, of several the one nearest to the middle."""
    if made.data.layout.kind == "slice":
        return 0
    count = made.data.layout.shape[0]
    reached = made.found.reached.any(axis=1).reshape(count, -1).sum(axis=1)
    layers = np.flatnonzero(reached == reached.max())
    return int(layers[np.abs(layers - count // 2).argmin()])
