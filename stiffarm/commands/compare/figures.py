"""Pictures of a comparison: numbers as dumbbells with their intervals, maps side by side with their difference."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, LogNorm, Normalize
from matplotlib.figure import Figure

from doe.estimation.differences import Figure as Number
from doe.estimation.differences import Pair
from robots.arrays import Array
from stiffarm.pages.figure_parts import above, drawing, log_ticks, named_rows, note
from stiffarm.pages.style import INK, OKABE_ITO, STIFFNESS_COLOURS
from surrogate.maps.differences import MapPair, Quantity

# Rows in one picture.
ROWS = 40
# Beyond this ratio of ends a map is drawn on a log scale; a grid has at least one point in so many of its cells.
DECADE, SPARSEST = 10.0, 6
# An interval is drawn so far, over the first value.
WIDEST = 10.0


def numbers_figure(pairs: Sequence[Pair]) -> Figure:
    """Draw both values of numbers that both have over the first one, with their 95 % intervals."""
    shown = pairs[:ROWS]
    ratios = [(p.b.value or 0.0) / (p.a.value or 1.0) for p in shown if p.a is not None and p.b is not None]
    # Shares of a stiffness have decades between them; what may change its sign has none.
    is_log = all(r > 0.0 for r in ratios)
    least, most = (1.0 / WIDEST, WIDEST) if is_log else (-WIDEST, WIDEST)
    with drawing("Second over first, with 95 % intervals", (10.0, 1.7 + 0.34 * len(shown))) as (figure, (ax,)):
        ax.axvline(1.0, color=INK, linewidth=1.0)
        looks = (("a", -0.15, "o", OKABE_ITO["blue"], "first"), ("b", 0.15, "D", OKABE_ITO["vermillion"], "second"))
        for name, off, marker, colour, label in looks:
            for row, p in enumerate(shown):
                low, value, high = _over(getattr(p, name), p.a.value if p.a is not None and p.a.value else 1.0)
                at = np.clip([low, value, high], least, most)
                ax.plot(np.sort(at[[0, 2]]), [row + off] * 2, color=colour, linewidth=2.0, alpha=0.6)
                ax.plot(
                    [at[1]],
                    [row + off],
                    marker,
                    color=colour,
                    markersize=6,
                    label=label if row == 0 else None,
                    clip_on=False,
                )
                if value != at[1]:
                    note(ax, f"{value:.3g}", (float(at[1]), row + off), (-2, 6), ha="right")
        if is_log:
            ax.set_xscale("log")
            log_ticks(ax.xaxis, lambda v: f"{v:g}")
        named_rows(ax, [f"{p.name}{' *' if p.verdict == 'beyond the noise' else ''}" for p in shown])
        ends = ax.get_xlim()
        ax.set_xlim(max(ends[0], least), min(ends[1], most))
        ax.set_xlabel("over the first value (*: beyond the noise)")
        above(ax, ax.get_legend_handles_labels()[0], 2)
    return figure


def _over(one: Number, size: float) -> tuple[float, float, float]:
    """Lower end, value and upper end over a size; open ends are infinite, missing ones the value."""
    value = (one.value or 0.0) / size
    if one.low is None and one.high is None:
        return value, value, value
    low, high = (-np.inf if one.low is None else one.low / size), (np.inf if one.high is None else one.high / size)
    return min(low, high), value, max(low, high)


def map_figure(m: MapPair, q: Quantity) -> Figure:
    """Draw a quantity of both maps on one scale, and what they differ by, in the plane where most points lie."""
    across, down, kept, words = _plane(m)
    x, y = across[0][kept], down[0][kept]
    a, b, change = q.a[kept], q.b[kept], (100.0 if q.is_share else 1.0) * q.change[kept]
    both = np.concatenate([a, b])
    both = both[np.isfinite(both)]
    low, high = np.quantile(both, [0.02, 0.98]) if both.size else (0.0, 1.0)
    most = float(np.nanquantile(np.abs(change), 0.98)) if np.isfinite(change).any() else 1.0
    heading = f"{q.label[0].upper()}{q.label[1:]}{words}"
    with drawing(heading, (11.0, 4.3), 1, 3, sharex=True, sharey=True) as (figure, axes):
        most = max(most, 1e-12)
        scale: Normalize = LogNorm(low, high) if low > 0.0 and high > DECADE * low else Normalize(low, high)
        looks: tuple[tuple[str, Array, Colormap | str, Normalize], ...] = (
            ("first", a, STIFFNESS_COLOURS, scale),
            ("second", b, STIFFNESS_COLOURS, scale),
            ("difference", change, "PuOr_r", Normalize(-most, most)),
        )
        for ax, (name, values, colours, norm) in zip(axes, looks, strict=True):
            mesh = _coloured(ax, x, y, values, colours, norm)
            ax.set_title(name, loc="left", weight="bold")
            ax.set_xlabel(across[1])
            ax.grid(visible=False)
            if across[1].endswith("(mm)"):
                ax.set_aspect("equal")
            if name != "first":
                bar = figure.colorbar(mesh, ax=ax, shrink=0.85)
                bar.set_label(("%" if q.is_share else q.unit) if name == "difference" else q.unit)
                if isinstance(norm, LogNorm):
                    log_ticks(bar.ax.yaxis, lambda v: f"{v:g}")
        axes[0].set_ylabel(down[1])
    return figure


def _coloured(ax: Axes, x: Array, y: Array, values: Array, colours: Colormap | str, norm: Normalize) -> ScalarMappable:
    """Points in colours: as cells without gaps where they lie on a grid, else as squares."""
    columns, i = np.unique(np.round(x, 3), return_inverse=True)
    rows, j = np.unique(np.round(y, 3), return_inverse=True)
    steps = [np.diff(ends) for ends in (columns, rows)]
    regular = all(s.size and np.ptp(s) <= 0.01 * s.max() for s in steps)
    if regular and columns.size * rows.size <= SPARSEST * len(x):
        grid = np.full((rows.size, columns.size), np.nan)
        grid[j, i] = values
        return ax.pcolormesh(columns, rows, grid, cmap=colours, norm=norm, shading="nearest", rasterized=True)
    size = max(4.0, 12_000.0 / max(len(x), 1))
    return ax.scatter(x, y, c=values, s=size, marker="s", linewidths=0, cmap=colours, norm=norm)


def _plane(m: MapPair) -> tuple[tuple[Array, str], tuple[Array, str], Array, str]:
    """Two coordinates to draw over, which points are drawn, and in words where the others are held."""
    columns = [(m.points[:, k], f"{'xyz'[k]} (mm)") for k in range(3)]
    spread = [len(np.unique(np.round(values, 3))) for values, _ in columns]
    if np.prod([max(s, 1) for s in spread]) > 50 * len(m.points) and m.q.shape[1]:
        # A sweep of the joints: the two that take most values.
        columns = [(m.q[:, k], f"coordinate {k + 1} (deg)") for k in range(m.q.shape[1])]
        spread = [len(np.unique(np.round(values, 2))) for values, _ in columns]
    order = sorted(range(len(columns)), key=lambda k: -spread[k])
    first, second = sorted(order[:2])
    kept, words = np.ones(len(m.points), dtype=bool), []
    for k in order[2:]:
        values, name = columns[k]
        if spread[k] > 1:
            known, count = np.unique(np.round(values[kept], 3), return_counts=True)
            at = known[count.argmax()]
            kept &= np.abs(values - at) < 2e-3
            words.append(f"{name.partition(' (')[0]} {at:g}")
    return columns[first], columns[second], kept, f", at {', '.join(words)}" if words else ""
