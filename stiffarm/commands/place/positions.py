"""What each base position is worth, and what stops it: the picture of placement's report, and the table of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from machining.cell import clearance
from machining.placement import Along, Look, Problem, Survey
from machining.placement.search import COARSE_ROWS, stop_words
from machining.placement.study import PlacedStep
from robots.arrays import Array
from robots.quantities import rounded
from stiffarm.commands.place.figures import ZONES, curve_figure, map_figure
from stiffarm.commands.place.payload import named
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Picture

NAME = "positions.csv"
# Distance (m) beyond the clearance to keep within which the pair that is too near is looked for.
BEYOND = 1e-3


def position_picture(step: PlacedStep, pictures: Pictures) -> Picture:
    """Curve or map of what positions are worth; of three coordinates or more the best over those that are not drawn."""
    space, grid = step.placed.problem.space, step.map
    values, label = position_values(grid)
    why = [look.why for look in grid.grid]
    labels = tuple(f"{name}, {unit}" for name, unit in zip(space.names, space.units, strict=True))
    lines = [
        np.linspace(a, b, n) * f for a, b, n, f in zip(space.lower, space.upper, grid.counts, space.shown, strict=True)
    ]
    caption = caption_of(grid)
    spots = {name: space.coordinates(one.e.mean(axis=0), one.table) * space.shown for name, one in _marked(step)}
    if space.d == 1:
        figure = curve_figure(
            lines[0], values, why, labels[0], label, {name: float(spot[0]) for name, spot in spots.items()}
        )
        return pictures.add(figure, "positions", caption)
    shape = (grid.counts[0], grid.counts[1], -1)
    best = np.array([look.merit for look in grid.grid]).reshape(shape).argmax(axis=2)[..., None]
    name, value = next(iter(values.items()))
    flat = np.take_along_axis(value.reshape(shape), best, axis=2)[..., 0]
    reasons = np.take_along_axis(np.array(why, dtype=object).reshape(shape), best, axis=2)[..., 0]
    if space.d > 2:
        caption += f" The best over {', '.join(space.names[2:])}."
    figure = map_figure(
        lines[0],
        lines[1],
        flat,
        reasons.ravel().tolist(),
        (labels[0], labels[1]),
        f"{name}, {label.split(', ')[-1]}",
        {name: (float(spot[0]), float(spot[1])) for name, spot in spots.items()},
    )
    return pictures.add(figure, "positions", caption)


def position_values(grid: Survey) -> tuple[dict[str, Array], str]:
    """What each position looked at is worth (p,), NaN where none is, by name; and what the figures' axis says."""
    problem = grid.problem
    share = problem.share_of(problem.sure_rows(COARSE_ROWS))
    looks = [look.values for look in grid.grid]

    def each(of: Callable[[Array], float]) -> Array:
        return np.array([np.nan if values is None else of(values) for values in looks])

    if problem.goal.minimised:
        return {"RMS error": each(lambda v: 1e6 * float(np.sqrt(v**2 @ share)))}, "predicted surface error, um"
    return {
        "softest point": each(lambda v: 1e-3 * float(v.min())),
        "mean over the path": each(lambda v: 1e-3 * float(v @ share)),
    }, "stiffness along the force, N/mm"


def _marked(step: PlacedStep) -> list[tuple[str, Along]]:
    """Placements that are one position, and so can be marked on a map."""
    return [(name, one) for name, one in named(step).items() if not np.ptp(one.e, axis=0).any()]


def caption_of(grid: Survey) -> str:
    """What the picture of positions shows, and what a shaded position means."""
    rows = len(grid.problem.sure_rows(COARSE_ROWS))
    worth = f"What the base's positions are worth, each at rest with its best gamma, on {rows} points of the path."
    if not grid.angles:
        return f"{worth} Shaded: no posture was found that takes the whole path, and what stops the nearest."
    moves = "" if grid.problem.links is None else " and at the moves between its cuts"
    angles = f"none of {grid.angles} angles gamma, and of more about the nearest, takes"
    if grid.angles == 1:
        angles = "the one angle gamma does not take"
    return (
        f"{worth} Open positions are free at all points of the path{moves}. Shaded: {angles} the whole path with any "
        "branch, "
        f"and what stops the posture that comes nearest; {NAME} names it."
    )


def why_words(problem: Problem, look: Look) -> str:
    """What stops the posture of a position that comes nearest, and where."""
    stopped = look.stopped
    if stopped is None:
        return look.shortfall.words if look.shortfall is not None else ""
    if stopped.why:
        return stop_words(look)
    where = f"at point {stopped.point} with gamma {np.degrees(stopped.gamma):.4g} deg"
    scenes = problem.by_scene(np.array([stopped.point]))
    if look.why != "collision" or not scenes:
        return f"near a singularity {where}"
    e, table = problem.space.sites(look.x[None])
    pair = clearance(scenes[0][1], stopped.q[None], e, table, within=problem.clearance + BEYOND).nearest(0)
    return f"collision {where}" if pair is None else f"{pair[0]} and {pair[1]} too near {where}"


def position_columns(grid: Survey) -> dict[str, list[Any]]:
    """Columns over the positions of the picture: where, the best gamma, its worth; or what stops it, and where."""
    space = grid.problem.space
    shown = np.array([look.x for look in grid.grid]) * space.shown
    out: dict[str, list[Any]] = {
        f"{name}_{unit}": [rounded(v, 9) for v in column]
        for name, unit, column in zip(space.names, space.units, shown.T, strict=True)
    }
    out["gamma_deg"] = ["" if look.why else rounded(float(np.degrees(look.gamma)), 9) for look in grid.grid]
    values, label = position_values(grid)
    unit = label.rsplit(", ", 1)[-1].replace("/", "_per_")
    for name, value in values.items():
        out[f"{name.replace(' ', '_')}_{unit}"] = ["" if np.isnan(v) else rounded(float(v)) for v in value]
    out["stopped_by"] = [ZONES[look.why][0] if look.why else "" for look in grid.grid]
    out["nearest_posture"] = [why_words(grid.problem, look) if look.why else "" for look in grid.grid]
    return out
