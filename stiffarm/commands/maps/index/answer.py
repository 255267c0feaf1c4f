"""An index over a plane or a box at every gamma: which is best, what it costs, how the index lies over the part."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from fem.arm import Arm
from machining import Task
from machining.stiffness.distribution import (
    PRICE,
    Distribution,
    EveryGamma,
    GammaChoice,
    TradeOff,
    best_gamma,
    distribution,
    trade_off,
    why_not_reached,
)
from machining.stiffness.objective import shown
from robots import InputError
from robots.arrays import Array, Bools
from robots.quantities import Quantity, angle, relative, rounded
from stiffarm.commands.maps.files import write_arrays, write_table
from stiffarm.commands.maps.index.figures import draw_gamma_statistics, draw_index_maps, draw_trade_off, price_words
from stiffarm.commands.maps.index.request import IndexMapRequest
from stiffarm.commands.maps.planes import layer_of
from stiffarm.pages.arm_uncertainty import half_widths
from stiffarm.pages.report import KeyFigure, Note, Section, Table, Text
from stiffarm.result import Drawing, Result
from stiffarm.result import Table as Values
from stiffarm.session.caution import caveats
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.stated import stated_table
from surrogate.maps.blocks import Engine
from surrogate.maps.data import Field, MapData

# Angles drawn, and values in the map's file, where the user names none: so many, spread over the range.
DRAWN: Final = 5
# Values at all gamma that differ by less than this share are one: the inverse of some arms is searched.
SAME: Final = 1e-6
# Poses that the interval of the stiffness is taken over, spread over the map.
JUDGED: Final = 200
GAMMA: Final = angle("gamma")
SHARE: Final = Quantity("share_reached", label="share reached", stored=9)
FIGURES: Final = ("mean", "standard_deviation", "peak_to_valley", "smallest", "largest")
CAPTIONS: Final = {
    "gamma_trade_off": "Each mark is one gamma: how good it is, and how many points it reaches. No other gamma beats "
    "those on the line in both. A gamma that misses the soft points looks better than it is.",
    "index_map": "The index over the part at some angles gamma; then with each point at its own gamma, within a few "
    "per cent of its best; then that gamma. Hatched: out of reach. index_map.csv has every point at every gamma.",
    "gamma_statistics": "Mean, scatter and reach against gamma. Dashed: only over the points that every gamma reaches, "
    "for a fair comparison.",
}


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


def index_map(given: Arm, asked: IndexMapRequest, engine: Engine, data: MapData) -> Result:
    """What the evaluated map says of every gamma, and which is best.

    Raises
    ------
    InputError
        No point of the grid, or of the workpiece, can be reached at any gamma.
    """
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
    facts = _facts(made) | stated_table(given.model)
    rows = range(len(found.gamma))
    tables = [_by_gamma(made, rows, "gamma_statistics"), _trade_off(made)]
    if len(made.drawn) < len(rows):
        tables = [
            replace(_by_gamma(made, made.drawn, "drawn"), is_extract=True),
            replace(tables[0], folded=True),
            tables[1],
        ]
    return Result(
        name="index_map",
        title=f"{made.shown.name} of the {given.description.title.split(' (')[0]} by gamma",
        question="which gamma, and what does it cost?",
        answer=f"No single gamma is best: {why}."
        if choice is None
        else f"Best gamma for the {choice.aim} of {made.shown.name}: "
        + price_words(made.traded, choice, made.shown).replace("\n", " ")
        + ".",
        how_sure=_how_sure(made, given, asked.normal),
        what_next=_what_next(made),
        facts=facts,
        tables=tuple(tables),
        drawings=_drawings(made) if asked.pictures else (),
        key=_key(made, facts),
        sections=(_method(facts),),
        remarks=(*_remarks(found), *([text] if (text := caveats(given)) else [])),
        arm=given,
        found=made,
        more=partial(_write, made, given, asked),
    )


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


def _write(made: IndexMap, given: Arm, asked: IndexMapRequest, folder: OutputFolder) -> Mapping[str, Any]:
    title = f"Map of {made.shown.name} of the {given.description.title.split(' (')[0]}"
    names = write_arrays(given, made.with_values(made.drawn), folder, asked, "index_map", title)
    write_table(made.with_values(range(len(made.found.gamma))), folder.path("index_map.csv"))
    return {"files": [*names, "index_map.csv"]}


def _facts(made: IndexMap) -> dict[str, Any]:
    what, found, n = made.shown, made.found, made.data.layout.n
    best = found.best_at_points().value
    best = what.factor * best[np.isfinite(best)]
    of_points = {"min": best.min(), "median": np.median(best), "mean": best.mean(), "max": best.max()}
    return {
        **{key: text for key, text in made.data.metadata.items() if key != "warning"},
        "quantity": what.name,
        "unit": what.unit or "1",
        "points": n,
        "counts": list(made.data.layout.shape[::-1]),
        "points_reached": int(found.reached.any(axis=1).sum()),
        "points_every_gamma_reaches": int(found.common.sum()),
        "all_solutions_found": found.sure,
        "best_of_each_point": {name: rounded(float(value)) for name, value in of_points.items()},
        "workpiece_points": n if made.inside is None else int(made.inside.sum()),
        "best_gamma": None
        if made.choice is None
        else {
            "gamma_deg": GAMMA.stored_value(made.choice.gamma),
            "aim": made.choice.aim,
            "value": what.stored_value(made.choice.value),
            "points_reached": int(made.traded.points[made.choice.column]),
        },
        "why_no_best_gamma": made.why_no_choice,
        "drawn_gamma_deg": GAMMA.stored_values(made.found.gamma[list(made.drawn)]),
    }


def _by_gamma(made: IndexMap, rows: Sequence[int], name: str) -> Values:
    """Share reached and figures at some gamma, over the points that it reaches and over those that all reach."""
    what, rows = made.shown, list(rows)
    sets = {"reached": made.found.statistics("reached"), "common": made.found.statistics("common")}
    columns: dict[Quantity, Array] = {}
    for over, s in sets.items():
        columns[Quantity(f"{over}_points")] = s.points[rows].astype(np.float64)
        for figure in FIGURES:
            label = figure.replace("_", " ") + (", points that all reach" if over == "common" else "")
            quantity = replace(what, key=f"{over}_{figure}_{what.key}", label=label, stored=9)
            columns[quantity] = getattr(s, figure)[rows]
    people = [f"reached_{figure}_{what.key}" for figure in FIGURES[:4]] + [f"common_mean_{what.key}"]

    return Values(
        name,
        f"{what.heading}, over the points that each gamma reaches",
        {"gamma": [GAMMA.text(made.found.gamma[i], unit=True) for i in rows]},
        {SHARE: sets["reached"].share[rows]} | {q: values for q, values in columns.items() if q.key in people},
        in_files={GAMMA: made.found.gamma[rows]} | {q: values for q, values in columns.items() if q.key not in people},
    )


def _trade_off(made: IndexMap) -> Values:
    """Angles that no other beats in value and reach."""
    traded = made.traded
    front = list(traded.front)
    return Values(
        "trade_off",
        f"What reach costs: {traded.aim} of {made.shown.name} over the workpiece",
        {"gamma": [GAMMA.text(traded.gamma[c], unit=True) for c in front]},
        {
            SHARE: traded.points[front] / traded.n,
            replace(made.shown, key="value", label=traded.aim): traded.score[front],
        },
        in_files={GAMMA: traded.gamma[front], Quantity("points_reached"): traded.points[front].astype(np.float64)},
    )


def _remarks(found: Distribution) -> list[str]:
    low, high = (f(np.where(found.reached, found.value, -s * np.inf), axis=1) for f, s in ((np.min, -1), (np.max, 1)))
    several = found.reached.sum(axis=1) > 1
    if several.any() and (high[several] - low[several] <= SAME * np.abs(high[several])).all():
        return ["gamma makes no difference here, as with a tool point on the flange axis: any gamma is as good"]
    return []


def _how_sure(made: IndexMap, given: Arm, normal: Any) -> str:
    rows = np.flatnonzero(np.asarray(made.data.reached))
    rows = rows[:: max(1, len(rows) // JUDGED)]
    half = half_widths(given, np.asarray(made.data.q[rows]), np.asarray(normal, dtype=np.float64))
    said = "all postures were found" if made.found.sure else "postures were searched for, and some may be missing"
    if half is None:
        return f"No interval: the model does not say how sure its springs are; {said}."
    low, high = np.quantile(half, [0.5, 0.95])
    return (
        f"Stiffness along the normal is known to ± {relative(float(low))} or better at half of the points and to "
        f"± {relative(float(high))} or better at 95 % of them (95 % intervals from the model's calibration); {said}."
    )


def _what_next(made: IndexMap) -> str:
    if made.choice is None:
        return "Move or shrink the workpiece, change the tool, or allow points out of reach: `--partly`."
    if made.traded.points[made.choice.column] < made.traded.n:
        return (
            "This gamma does not reach all points of the map. Give the part with --workpiece to find the best gamma "
            "that reaches all of the part."
        )
    if len(made.traded.front) > 1:
        return "A stiffer gamma misses some points. If you do not need them, leave them out of --workpiece."
    return "Use this gamma for the whole part, or let `stiffarm posture` choose gamma point by point along a path."


def _key(made: IndexMap, facts: Mapping[str, Any]) -> tuple[KeyFigure, ...]:
    out = list[KeyFigure]()
    if made.choice is not None:
        best, what = made.choice, made.shown
        at = f"at gamma {GAMMA.text(best.gamma, unit=True)}"
        out.append(KeyFigure(what.text(best.value, unit=True), f"{best.aim} {at}"))
        s = made.found.statistics("reached")
        least = (s.largest if made.found.objective.minimised else s.smallest)[best.column]
        if np.isfinite(least):
            out.append(KeyFigure(what.text(float(least), unit=True), "worst point of the map at that gamma"))
    n = facts["points"]
    out.append(KeyFigure(relative(facts["points_reached"] / n), f"of {n} points reached at some gamma"))
    out.append(KeyFigure(relative(facts["points_every_gamma_reaches"] / n), "reached at every gamma"))
    return tuple(out)


def _method(facts: Mapping[str, Any]) -> Section:
    rows = tuple((key.replace("_", " "), str(facts[key])) for key in _SHOWN if key in facts)
    text = (
        "Each point has the best branch of the inverse kinematics within joint limits at each gamma. Mean, standard "
        "deviation and peak to valley are those of Gao 2024 (doi:10.1109/ACCESS.2024.3435911), Figs. 10 and 11."
    )
    note = Note("Not checked: collisions, and the motion from point to point.")
    return Section(
        "How it was found", (Text(text), Table("What the map is of", ("", ""), rows, (0, 1)), note), folded=True
    )


_SHOWN = (
    "tool_on_flange",
    "part_in_base",
    "normal",
    "tool_axis",
    "gamma_counts_from",
    "force_N",
    "links",
    "load_path",
)


def _drawings(made: IndexMap) -> tuple[Drawing, ...]:
    """The picture that decides first: what reach costs, where there is a choice."""
    name = f"{made.shown.name} of the {made.data.metadata['robot']}"
    of = "" if made.inside is None else ", over the workpiece"
    draws: dict[str, Any] = {"index_map": partial(_index_maps, made, name)}
    if len(made.found.gamma) > 1:
        title = f"{name} against gamma{of}"
        draws["gamma_statistics"] = partial(
            draw_gamma_statistics, made.found, title=title, choice=made.choice, inside=made.inside
        )
        if len(made.traded.front) > 1:
            title = f"{name}: {made.traded.aim} against reach{of}"
            draw = partial(draw_trade_off, made.traded, made.choice, made.shown, title=title)
            draws = {"gamma_trade_off": draw, **draws}
    return tuple(Drawing(key, CAPTIONS[key], key.replace("_", " "), draw) for key, draw in draws.items())


def _index_maps(made: IndexMap, name: str) -> Figure:
    plane = layer_of(made.data.layout, _busiest_layer(made))
    return draw_index_maps(plane, made.found, made.drawn, title=name, inside=made.inside)


def _busiest_layer(made: IndexMap) -> int:
    """Of a box the layer with most points reached, of several the one nearest to the middle."""
    if made.data.layout.kind == "slice":
        return 0
    count = made.data.layout.shape[0]
    reached = made.found.reached.any(axis=1).reshape(count, -1).sum(axis=1)
    layers = np.flatnonzero(reached == reached.max())
    return int(layers[np.abs(layers - count // 2).argmin()])
