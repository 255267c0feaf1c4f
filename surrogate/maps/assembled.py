"""From the arrays of an engine to a map, and figures of it taken block by block."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robots.arrays import Array, Integers, in_blocks
from robots.progress import Progress, report_progress
from surrogate.maps.blocks import Engine
from surrogate.maps.columns import row_blocks
from surrogate.maps.data import Field, MapData
from surrogate.maps.layouts import sweep_layout
from surrogate.maps.quantities import Quantities

# Above this many points a median is that of evenly spaced points.
EXACT_MEDIAN = 2_000_000


def computed_map(
    engine: Engine, metadata: Mapping[str, str] | None = None, progress: Progress | None = None
) -> MapData:
    """The map of an engine, worked out here and now and held in memory. Errors as :meth:`Engine.block`."""
    blocks, n = [], engine.grid.n
    for rows in in_blocks(n, engine.points_a_block):
        blocks.append(engine.block(rows))
        report_progress(progress, rows.stop, n)
    return map_data(engine, {name: np.concatenate([b[name] for b in blocks]) for name in engine.columns}, metadata)


def swept_map(
    quantities: Quantities,
    points: int,
    layers_deg: Sequence[float] | None = None,
    metadata: Mapping[str, str] | None = None,
    progress: Progress | None = None,
) -> MapData:
    """The map of quantities over the usual sweep of the workspace, ``points`` values of each joint coordinate.

    Raises
    ------
    InputError
        As :func:`surrogate.maps.layouts.sweep_layout`.
    """
    robot = quantities.model.robot
    known = {"robot": robot.name, **(metadata or {})}
    return computed_map(Engine(sweep_layout(robot, points, layers_deg), quantities), known, progress)


def map_data(
    engine: Engine, arrays: Mapping[str, NDArray[np.generic]], metadata: Mapping[str, str] | None = None
) -> MapData:
    """The map of an engine's arrays, all rows of each."""
    fields = {
        kind.name: Field(_numbers(arrays[kind.name]), kind.unit, kind.label, engine.quantities.categories(kind.name))
        for kind in engine.quantities.kinds
    }
    reached = arrays["reached"]
    assert reached.dtype == np.bool_  # noqa: S101 - the engine has seen to it
    return MapData(
        layout=engine.grid,
        points=_numbers(arrays["points"]),
        q=_numbers(arrays["q"]),
        reached=reached.view(np.bool_),
        coordinates=engine.quantities.model.robot.coordinates,
        fields=fields,
        parts=engine.quantities.parts if "shares" in arrays else (),
        shares=_numbers(arrays["shares"]) if "shares" in arrays else None,
        metadata=dict(metadata or {}),
    )


@dataclass(frozen=True)
class Figures:
    """Of one field over the points where it has a value: least, median and greatest, and the rows of the ends.

    ``median_of``: points that the median was taken of; it is exact where that is ``count``.
    """

    count: int
    least: float
    median: float
    greatest: float
    row_of_least: int
    row_of_greatest: int
    median_of: int


def figures(values: Array) -> Figures | None:
    """Figures of values (n,), a block at a time; None if all are NaN."""
    n = len(values)
    count, low, high, at_low, at_high = 0, np.inf, -np.inf, -1, -1
    for rows in row_blocks(n):
        part = np.asarray(values[rows])
        there = np.flatnonzero(np.isfinite(part))
        if not len(there):
            continue
        count += len(there)
        least, most = there[part[there].argmin()], there[part[there].argmax()]
        if part[least] < low:
            low, at_low = float(part[least]), rows.start + int(least)
        if part[most] > high:
            high, at_high = float(part[most]), rows.start + int(most)
    if not count:
        return None
    sample = np.asarray(values[:: max(1, -(-n // EXACT_MEDIAN))])
    sample = sample[np.isfinite(sample)]
    median = float(np.median(sample)) if len(sample) else float("nan")
    return Figures(count, low, median, high, at_low, at_high, len(sample))


def counts(values: Array, categories: int) -> Integers:
    """How many points (categories,) have each whole number 0, 1, ..."""
    out = np.zeros(categories, dtype=np.int64)
    for rows in row_blocks(len(values)):
        part = np.asarray(values[rows])
        out += np.bincount(part[part >= 0.0].astype(np.int64), minlength=categories)[:categories]
    return out


def _numbers(array: NDArray[np.generic]) -> Array:
    # Shares are kept in single precision; who reads them need not care.
    numbers: Array = array  # type: ignore[assignment]
    return numbers
