"""Pictures of an index over a plane: maps at several gamma, the best gamma, and the statistics against gamma."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from machining.stiffness.distribution import Distribution, GammaChoice
from machining.stiffness.units import Shown, shown
from robots import InputError
from robots.arrays import Array, Bools
from stiffarm.commands.maps.planes import Plane
from stiffarm.pages.figure_parts import title as figure_title
from stiffarm.pages.style import INK, OKABE_ITO, STIFFNESS_COLOURS, colour_scale, house_style, new_figure

# Where no posture is: pale and hatched, unlike any colour of the scale.
NOTHING: Final = "#ECECEC"
HATCH: Final = "////"
HATCH_INK: Final = "#B0B0B0"
# Angle maps close on themselves: -180 and 180 deg have one colour.
ANGLE_COLOURS: Final = "twilight"
# Panels of a figure of maps at most, and side by side.
MOST_PANELS: Final = 12
COLUMNS: Final = 4
_SCALES: Final = (
    ("reached", "-", "o", "points that this gamma reaches"),
    ("common", "--", "s", "points that all reach"),
)


def stiffness_colours(minimised: bool) -> Colormap:
    """Colours of an objective: warm and bright is stiff, also where a small value is."""
    return STIFFNESS_COLOURS.reversed() if minimised else STIFFNESS_COLOURS


def value_bar(
    figure: Figure, axes: Sequence[Axes], norm: Normalize, ticks: Array, shows: tuple[Shown, bool], values: Array
) -> None:
    """Colour bar of a quantity beside axes; ends that cut values off say so ("≥ 700"). ``shows``: and if minimised."""
    what, minimised = shows
    below, above = bool((values < ticks[0]).any()), bool((values > ticks[-1]).any())
    extend = {(False, False): "neither", (True, False): "min", (False, True): "max"}.get((below, above), "both")
    bar = figure.colorbar(
        ScalarMappable(norm, stiffness_colours(minimised)),
        ax=list(axes),
        extend=extend,
        ticks=ticks,
        pad=0.02,
        aspect=30,
    )
    labels = [f"{t:.6g}" for t in ticks]
    labels[0], labels[-1] = ("≤ " if below else "") + labels[0], ("≥ " if above else "") + labels[-1]
    bar.ax.minorticks_off()
    bar.ax.set_yticklabels(labels)
    bar.set_label(what.label + (", log scale" if isinstance(norm, LogNorm) else ""))


def draw_index_maps(
    plane: Plane, found: Distribution, columns: Sequence[int], *, title: str, inside: Bools | None = None
) -> Figure:
    """Maps at some gamma on one scale of colours, then the best value at each point, and the gamma it has.

    Parameters
    ----------
    plane : of the map that the distribution is of
    columns : which of the distribution's gamma
    inside : (n,) region to outline: the workpiece

    Raises
    ------
    InputError
        More panels than fit, a plane of other points, or nothing reached.
    """
    if plane.rows.max() >= len(found.value):
        raise InputError("map", value=f"{len(found.value)} values", allowed="one a point of the grid")
    if len(columns) + 2 > MOST_PANELS:
        raise InputError("maps in one figure", value=len(columns), allowed=f"{MOST_PANELS - 2} at most")
    what, minimised = shown(found.objective.quantity), found.objective.minimised
    best = found.best_at_points()
    rows = plane.rows
    values = what.factor * np.column_stack([found.value[:, list(columns)], best.value])[rows]
    finite = values[np.isfinite(values)]
    if not finite.size:
        raise InputError("map", value="no point reached", remedy="draw another layer, or move the grid")
    norm, ticks = colour_scale(finite, None)
    outline = None if inside is None else inside[rows]
    with house_style():
        names = [f"gamma = {np.degrees(found.gamma[c]):.4g} deg" for c in columns] + ["best of each point"]
        # With one angle there is nothing to choose.
        single = len(found.gamma) == 1
        names, values = (names[:1], values[..., :1]) if single else (names, values)
        figure, axes = _panels(plane, len(names) + (not single))
        for k, (ax, name) in enumerate(zip(axes, names, strict=False)):
            _panel(ax, plane, values[..., k], outline, norm=norm, cmap=stiffness_colours(minimised))
            ax.set_title(name)
        value_bar(figure, axes, norm, ticks, (what, minimised), finite)
        if not single:
            _angles(figure, axes, plane, np.degrees(best.gamma[rows]), outline)
        handles: list[Any] = []
        if not found.reached[rows].all():
            handles.append(
                Patch(facecolor=NOTHING, edgecolor=HATCH_INK, hatch=HATCH, label="no posture within reach and limits")
            )
        if outline is not None:
            handles.append(Line2D([], [], color=INK, linewidth=1.4, label="workpiece"))
        if handles:
            figure.legend(handles=handles, loc="outside lower left", ncols=2)
        figure_title(figure, f"{title}, {plane.where}")
    return figure


def draw_gamma_statistics(found: Distribution, *, title: str, choice: GammaChoice | None = None) -> Figure:
    """Mean, standard deviation, peak to valley and share reached against gamma (Gao 2024, Fig. 11).

    ``choice``: a dotted line at this gamma.
    """
    what = shown(found.objective.quantity)
    degrees = np.degrees(found.gamma)
    with house_style():
        figure, axes = new_figure((10.0, 6.4), 2, 2, sharex=True)
        for (over, line, marker, label), colour in zip(_SCALES, ("blue", "vermillion"), strict=True):
            s = found.statistics(over)  # type: ignore[arg-type]
            look: dict[str, Any] = {"linestyle": line, "marker": marker, "color": OKABE_ITO[colour], "markersize": 3.5}
            for ax, figures in zip(axes, (s.mean, s.standard_deviation, s.peak_to_valley), strict=False):
                ax.plot(degrees, what.factor * figures, label=label, **look)
        axes[3].plot(degrees, 100.0 * found.reached.mean(axis=0), "-o", color=OKABE_ITO["blue"], markersize=3.5)
        if found.common.any():
            axes[3].axhline(100.0 * found.common.mean(), linestyle="--", color=OKABE_ITO["vermillion"])
        names = ("mean", "standard deviation", "peak to valley")
        for ax, name in zip(axes, names, strict=False):
            ax.set(title=name, ylabel=what.label)
        axes[3].set(title="share of the points reached", ylabel="share (%)", ylim=(0.0, 104.0))
        for ax in axes:
            ax.set_xticks(angle_ticks(degrees))
            if choice is not None:
                ax.axvline(np.degrees(choice.gamma), color=INK, linestyle=":", linewidth=1.2)
        for ax in axes[2:]:
            ax.set_xlabel("gamma (deg)")
        handles = axes[0].get_legend_handles_labels()[0]
        if choice is not None:
            words = f"best for the {choice.aim}: {np.degrees(choice.gamma):.4g} deg"
            handles.append(Line2D([], [], color=INK, linestyle=":", linewidth=1.2, label=words))
        figure.legend(handles=handles, loc="outside lower left", ncols=3)
        figure_title(figure, title)
    return figure


def angle_ticks(degrees: Array) -> Array:
    """Ticks of an axis of angles: parts of a turn, about eight of them."""
    low, high = float(degrees.min()), float(degrees.max())
    for step in (1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 45.0, 60.0):
        if (high - low) / step <= 8.0:
            break
    return np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1.0) * step


def _panels(plane: Plane, count: int) -> tuple[Figure, list[Axes]]:
    rows = -(-count // COLUMNS)
    columns = -(-count // rows)
    across, up = (float(np.ptp(corners)) for corners in plane.corners)
    # Long or high planes: bounded, so that the labels have their room.
    width = float(np.clip(4.5 * across / up, 1.7, 3.1))
    height = float(np.clip(width * up / across, 1.2, 4.5)) + 0.6
    size = (max(width * columns + 2.9, 5.4), height * rows + 1.2)
    figure, axes = new_figure(size, rows, columns, sharex=True, sharey=True)
    # For axes of a given aspect: the constrained layout would leave gaps, and cut labels off.
    figure.set_layout_engine("compressed")
    for ax in axes[count:]:
        ax.remove()
    for k, ax in enumerate(axes[:count]):
        ax.label_outer()
        if k + columns >= count:
            ax.xaxis.set_tick_params(labelbottom=True)
            ax.set_xlabel(plane.labels[0])
        if k % columns == 0:
            ax.set_ylabel(plane.labels[1])
    return figure, axes[:count]


def _panel(ax: Axes, plane: Plane, values: Array, outline: Bools | None, **look: Any) -> Any:
    ax.set_aspect("equal")
    ax.grid(visible=False)
    ax.set_facecolor(NOTHING)
    ax.patch.set(hatch=HATCH, edgecolor=HATCH_INK)
    image = ax.pcolormesh(*plane.corners, values, rasterized=True, **look)
    if outline is not None:
        # Around the cells, not through the points.
        padded = np.pad(outline.astype(np.float64), 1)
        fine = np.repeat(np.repeat(padded, 2, axis=0), 2, axis=1)
        x, y = plane.centres[0][0], plane.centres[1][:, 0]
        ax.contour(_edges(x), _edges(y), fine, levels=[0.5], colors=INK, linewidths=1.4)
    x, y = plane.corners
    ax.set(xlim=(x.min(), x.max()), ylim=(y.min(), y.max()))
    return image


def _edges(centres: Array) -> Array:
    """Both edges of each cell, and of one cell more at either end: steps, not slopes, for contours."""
    half = 0.5 * (centres[1] - centres[0])
    outer = np.concatenate([[centres[0] - 2 * half], centres, [centres[-1] + 2 * half]])
    return np.sort(np.concatenate([outer - 0.999 * half, outer + 0.999 * half]))


def _angles(figure: Figure, axes: Sequence[Axes], plane: Plane, degrees: Array, outline: Bools | None) -> None:
    """Best gamma in the last of the axes; its bar stands beside all, so that the panels stay alike."""
    ax = axes[-1]
    known = degrees[np.isfinite(degrees)]
    low = 0.0 if known.min() >= 0.0 and known.max() > 180.0 else -180.0
    norm = Normalize(low, low + 360.0)
    image = _panel(ax, plane, degrees, outline, norm=norm, cmap=mpl.colormaps[ANGLE_COLOURS])
    bar = figure.colorbar(image, ax=axes, ticks=low + np.arange(0.0, 361.0, 45.0), pad=0.02, aspect=30)
    bar.set_label("best gamma (deg)")
    ax.set_title("its gamma")
