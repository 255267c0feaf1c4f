"""Writing an index over a plane or a box: tables, the .vtu for ParaView, pictures, figures for JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from machining.stiffness.distribution import Distribution, GammaChoice, Statistics
from machining.stiffness.units import Shown, shown
from robots.arrays import Array, Bools
from robots.constants import M_TO_MM
from robots.files.csv_text import columns_text
from stiffarm.commands.maps.planes import layer_of
from stiffarm.session.json_text import number
from stiffarm.session.outputs import OutputFolder
from surrogate.maps.data import Field, Layout, MapData
from surrogate.maps.layouts import points_of
from surrogate.maps.vtk_stream import write_vtu

# Angles drawn, and values in the .vtu, where the user names none: so many, spread over the range.
DRAWN: Final = 5
# Values at all gamma that differ by less than this share are one: the inverse of some arms is searched.
SAME: Final = 1e-6


@dataclass(frozen=True, eq=False)
class IndexMap:
    """What a map command found.

    ``inside`` (n,): points of the workpiece, None: all. ``choice``: the best gamma for it, None where none reaches all
    of it (``why_no_choice``). ``drawn``: columns of the distribution's gamma for pictures and .vtu. ``metadata``: what
    the map is of, words by name.
    """

    grid: Layout
    found: Distribution
    inside: Bools | None
    choice: GammaChoice | None
    why_no_choice: str | None
    drawn: tuple[int, ...]
    metadata: Mapping[str, str]

    @property
    def shown(self) -> Shown:
        """Quantity and unit."""
        return shown(self.found.objective.quantity)

    @property
    def points(self) -> Array:
        """Points (n, 3) m of the grid in the base frame."""
        return points_of(self.grid)


def drawn_columns(gamma: Array, choice: GammaChoice | None) -> tuple[int, ...]:
    """Which angles to draw unasked: some spread over the range, and the best."""
    spread = np.unique(np.round(np.linspace(0, len(gamma), DRAWN, endpoint=False)).astype(int))
    spread = spread[spread < len(gamma)]
    return tuple(sorted({*map(int, spread), *(() if choice is None else (choice.column,))}))


def angle_name(gamma: float) -> str:
    """An angle (rad) in the name of a column or array: ``gamma_-30_deg``."""
    return f"gamma_{round(float(np.degrees(gamma)), 6) + 0.0:g}_deg"


def write(made: IndexMap, folder: OutputFolder, pictures: bool = True) -> dict[str, Any]:
    """Write ``index_map.vtu``, ``index_map.csv``, ``gamma_statistics.csv``, ``index_map.json`` and the PNGs.

    Returns what the JSON file holds, with the names of all files.
    """
    files = ["index_map.vtu", "index_map.csv", "gamma_statistics.csv", "index_map.json"]
    write_vtu(map_data(made), folder.path(files[0]))
    folder.write_text(files[1], _point_table(made))
    folder.write_text(files[2], _statistics_table(made))
    if pictures:
        files += _pictures(made, folder)
    content = payload(made) | {"files": files}
    folder.write_json("index_map.json", content)
    return content


def payload(made: IndexMap) -> dict[str, Any]:
    """Figures for ``--json``."""
    what, found = made.shown, made.found
    best = found.best_at_points()
    return {
        "schema": "stiffarm-index-map/1",
        **made.metadata,
        "quantity": what.quantity,
        "unit": what.unit or "1",
        "points": made.grid.n,
        "counts": list(made.grid.shape[::-1]),
        "points_reached": int(found.reached.any(axis=1).sum()),
        "points_every_gamma_reaches": int(found.common.sum()),
        "all_solutions_found": found.sure,
        "best_of_each_point": _range(what.factor * best.value[np.isfinite(best.value)]),
        "workpiece_points": made.grid.n if made.inside is None else int(made.inside.sum()),
        "best_gamma": None
        if made.choice is None
        else {
            "gamma_deg": _degrees(made.choice.gamma),
            "aim": made.choice.aim,
            "value": number(what.factor * made.choice.value),
        },
        "why_no_best_gamma": made.why_no_choice,
        "drawn_gamma_deg": [_degrees(made.found.gamma[c]) for c in made.drawn],
        "by_gamma": _by_gamma(made),
        "messages": _messages(found),
    }


def _messages(found: Distribution) -> list[str]:
    low, high = (f(np.where(found.reached, found.value, -s * np.inf), axis=1) for f, s in ((np.min, -1), (np.max, 1)))
    several = found.reached.sum(axis=1) > 1
    if several.any() and (high[several] - low[several] <= SAME * np.abs(high[several])).all():
        return ["gamma changes nothing here, as with a tool point on the flange axis: the best gamma means nothing"]
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


def _point_table(made: IndexMap) -> str:
    """Points in base axes, the best gamma and its value, and the value at every gamma; empty where not reached."""
    what, best = made.shown, made.found.best_at_points()
    table: dict[str, Any] = dict(zip(("x_mm", "y_mm", "z_mm"), (M_TO_MM * made.points).T, strict=True))
    if made.inside is not None:
        table["workpiece"] = made.inside.astype(np.int64)
    table |= {"best_gamma_deg": np.degrees(best.gamma), f"best_{what.column}": what.factor * best.value}
    table |= {
        f"{what.column}_{angle_name(g)}": what.factor * v
        for g, v in zip(made.found.gamma, made.found.value.T, strict=True)
    }
    return columns_text(table, digits=9)


def map_data(made: IndexMap) -> MapData:
    """The map as all maps are.

    Fields: ``best_<quantity>`` and ``best_gamma_deg``, the quantity at each gamma drawn, ``share_of_gamma`` reached,
    ``workpiece`` 0 or 1. Every point of the grid counts as reached, NaN where no posture is.
    """
    what, found, grid = made.shown, made.found, made.grid
    best = found.best_at_points()
    unit = what.unit or "1"
    inside = np.ones(grid.n) if made.inside is None else made.inside.astype(np.float64)
    fields = {
        f"best_{what.column}": Field(what.factor * best.value, unit, f"best {what.quantity}"),
        "best_gamma_deg": Field(np.degrees(best.gamma), "deg", "best gamma"),
        **{
            f"{what.column}_{angle_name(found.gamma[c])}": Field(what.factor * found.value[:, c], unit, what.quantity)
            for c in made.drawn
        },
        "share_of_gamma": Field(found.reached.mean(axis=1), "", "share of the angles gamma that reach the point"),
        "workpiece": Field(inside, "", "point of the workpiece"),
    }
    every, none = np.ones(grid.n, dtype=np.bool_), np.zeros((grid.n, 0))
    return MapData(grid, made.points, none, every, (), fields, metadata=made.metadata)


def _pictures(made: IndexMap, folder: OutputFolder) -> list[str]:
    from stiffarm.commands.maps.index.figures import draw_gamma_statistics, draw_index_maps
    from stiffarm.pages.style import save_png

    name = f"{made.shown.quantity} of the {made.metadata['robot']}"
    plane = layer_of(made.grid, _busiest_layer(made))
    maps = draw_index_maps(plane, made.found, made.drawn, title=name, inside=made.inside)
    save_png(maps, folder.path("index_map.png"))
    if len(made.found.gamma) == 1:
        return ["index_map.png"]
    save_png(
        draw_gamma_statistics(made.found, title=f"{name} against gamma", choice=made.choice),
        folder.path("gamma_statistics.png"),
    )
    return ["index_map.png", "gamma_statistics.png"]


def _busiest_layer(made: IndexMap) -> int:
    """Of a box the layer with most points reached, of several the one nearest to the middle."""
    if made.grid.kind == "slice":
        return 0
    count = made.grid.shape[0]
    reached = made.found.reached.any(axis=1).reshape(count, -1).sum(axis=1)
    layers = np.flatnonzero(reached == reached.max())
    return int(layers[np.abs(layers - count // 2).argmin()])
