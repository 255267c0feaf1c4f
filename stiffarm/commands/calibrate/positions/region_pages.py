"""Accuracy by region of the workspace: JSON, CSV, a map and its part of the page."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from doe.absolute.regions import Accuracy, Region, Regions, where
from robots.arrays import Array
from robots.files.csv_text import rows_text
from robots.quantities import rounded
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.figure_parts import drawing
from stiffarm.pages.report import Block, Section, Table, Text

# Regions in the page's table: the most and the least accurate.
SHOWN: Final = 5
# Squares in which the number of readings is written.
MOST_NUMBERS: Final = 60
_VIEWS: Final = ((0, 1, "from above"), (0, 2, "from the side"))


def payload(r: Regions) -> dict[str, Any]:
    """All regions, keys with units; mm in the arm's base frame."""
    return {
        "edge_mm": rounded(1e3 * r.edge),
        "words": r.words,
        "regions": [
            {
                "low_mm": (1e3 * one.low).round(6).tolist(),
                "high_mm": (1e3 * one.high).round(6).tolist(),
                "readings": one.readings,
                "before": _figures(one.before),
                "after": _figures(one.after),
                "left_out": _figures(one.left_out),
                "verdict": one.verdict,
            }
            for one in r.regions
        ],
    }


def _figures(a: Accuracy) -> dict[str, float | None]:
    return {"mean_mm": rounded(1e3 * a.mean), "rms_mm": rounded(1e3 * a.rms), "largest_mm": rounded(1e3 * a.largest)}


def regions_csv(r: Regions) -> str:
    """One row a region."""
    kinds = ("before", "after", "left_out")
    heads = [f"{a}_{end}_mm" for a in "xyz" for end in ("low", "high")] + ["readings"]
    heads += [f"{kind}_{what}_mm" for kind in kinds for what in ("mean", "rms", "largest")] + ["verdict"]
    rows = [tuple(heads)]
    for one in r.regions:
        ends = [f"{1e3 * v:g}" for pair in zip(one.low, one.high, strict=True) for v in pair]
        figures = [f"{1e3 * v:.5f}" for kind in kinds for v in _three(getattr(one, kind))]
        rows.append((*ends, str(one.readings), *figures, one.verdict))
    return rows_text(rows)


def _three(a: Accuracy) -> tuple[float, float, float]:
    return a.mean, a.rms, a.largest


def regions_figure(r: Regions) -> Figure:
    """RMS by column of regions, from above and from the side, before and for readings left out."""
    title = "How far off the arm is, by region of its workspace"
    with drawing(title, (10.0, 8.4), 2, 2) as (figure, axes):
        for k, (name, d) in enumerate((("as described", r.before), ("calibrated, poses left out", r.left_out))):
            views = [(a, b, view, _columns(r, d, a, b)) for a, b, view in _VIEWS]
            # One scale for both views of the same errors.
            most = 1e3 * max(float(np.nanmax(rms)) for *_, (_, _, rms, _) in views)
            for ax, (a, b, view, (x, y, rms, count)) in zip(axes[2 * k : 2 * k + 2], views, strict=True):
                shown = ax.pcolormesh(1e3 * x, 1e3 * y, 1e3 * rms.T, cmap="cividis", vmin=0.0, vmax=most)
                ax.set_aspect("equal")
                ax.set(xlabel=f"{'xyz'[a]} (mm)", ylabel=f"{'xyz'[b]} (mm)", title=f"{name}, {view}")
                figure.colorbar(shown, ax=ax, label="RMS (mm)", shrink=0.8)
                _write_counts(ax, x, y, 1e3 * rms / most, count)
    return figure


def _write_counts(ax: Axes, x: Array, y: Array, share: Array, count: Array) -> None:
    """Write how many readings a square has, where there is room for it."""
    if count.size > MOST_NUMBERS:
        return
    for i, j in np.argwhere(count > 0):
        middle = 500.0 * (x[i] + x[i + 1]), 500.0 * (y[j] + y[j + 1])
        ax.text(*middle, f"{count[i, j]:.0f}", ha="center", va="center", color="0.1" if share[i, j] > 0.6 else "1.0")


def _columns(r: Regions, d: Array, a: int, b: int) -> tuple[Array, Array, Array, Array]:
    """Edges (m), RMS (m) of readings over two axes, NaN where nothing was read, and how many they are."""
    place = np.floor(r.place[:, [a, b]] / r.edge).astype(np.int64)
    low, high = place.min(axis=0), place.max(axis=0) + 1
    edges = [r.edge * np.arange(low[i], high[i] + 1) for i in range(2)]
    row = (place[:, 0] - low[0]) * (high[1] - low[1]) + place[:, 1] - low[1]
    size = int(np.prod(high - low))
    count = np.bincount(row, minlength=size)
    square = np.bincount(row, d**2, minlength=size)
    rms = np.sqrt(np.where(count > 0, square / np.maximum(count, 1), np.nan))
    return edges[0], edges[1], rms.reshape(high - low), count.reshape(high - low)


def section(r: Regions, pictures: Pictures) -> Section:
    """The page's part."""
    text = (
        f"{r.words[0].upper()}{r.words[1:]}. Ranges are in the arm's base frame. A region counts as better or worse "
        "only if the difference is more than chance: readings shuffled at random over the regions seldom differ as "
        "much. regions.csv lists all regions: place a part where the arm is accurate and was measured."
    )
    picture = pictures.add(
        regions_figure(r),
        "regions",
        "Each square: all readings in a column of regions, and their number. White: not measured.",
    )
    blocks: list[Block] = [Text(text), picture]
    judged = r.judged
    if len(judged) > 1:
        ends = judged if len(judged) <= 2 * SHOWN else (*judged[:SHOWN], *judged[-SHOWN:])
        heads = ("region (mm)", "readings", "before, RMS", "left out: mean", "RMS", "largest (mm)", "than elsewhere")
        what = "Regions" if len(ends) == len(judged) else f"The {SHOWN} most and the {SHOWN} least accurate regions"
        blocks.append(Table(what, heads, tuple(map(_row, ends)), text_columns=(0, 6)))
    return Section("Where the arm is accurate", tuple(blocks))


def _row(one: Region) -> tuple[str, ...]:
    figures = (one.before.rms, *_three(one.left_out))
    verdict = "no difference" if one.verdict == "as elsewhere" else one.verdict
    return (where(one), str(one.readings), *(f"{1e3 * v:.3f}" for v in figures), verdict)
