"""Pictures of an index over a plane: maps at several gamma, the best gamma, and the statistics against gamma."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from machining.stiffness.distribution import PRICE, Distribution, GammaChoice, TradeOff, trade_off
from machining.stiffness.objective import shown
from robots import InputError
from robots.arrays import Array, Bools
from robots.quantities import Quantity
from stiffarm.commands.maps.figures.slices import panel, panels
from stiffarm.commands.maps.looks import look_bar, look_of
from stiffarm.commands.maps.planes import Plane, edges
from stiffarm.pages.figure_parts import drawing, note
from stiffarm.pages.figure_parts import title as figure_title
from stiffarm.pages.style import FAINT, INK, OKABE_ITO, house_style
from surrogate.maps.data import Field

# Where no posture is: pale and hatched, unlike any colour of the scale.
NOTHING: Final = "#ECECEC"
HATCH: Final = "////"
HATCH_INK: Final = "#B0B0B0"
# What the gamma of a point is: not the best by a hair, which changes from point to point where two are as good.
WITHIN: Final = f"to {100.0 * PRICE:g} %"
# Panels of a figure of maps at most.
MOST_PANELS: Final = 12
_SCALES: Final = (
    ("reached", "-", "o", "points that this gamma reaches"),
    ("common", "--", "s", "points that all reach"),
)


def draw_index_maps(
    plane: Plane, found: Distribution, columns: Sequence[int], *, title: str, inside: Bools | None = None
) -> Figure:
    """Maps at some gamma on one scale of colours, then each point at a gamma of its own, and that gamma.

    These are within a small share of the point's best (:meth:`Distribution.steady_at_points`).

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
        raise InputError("map", code="B002", value=f"{len(found.value)} values", allowed="one a point of the grid")
    if len(columns) + 2 > MOST_PANELS:
        raise InputError("maps in one figure", code="B002", value=len(columns), allowed=f"{MOST_PANELS - 2} at most")
    what, rows, best = shown(found.objective.quantity), plane.rows, found.steady_at_points()
    # With one angle there is nothing to choose.
    single = len(found.gamma) == 1
    names = [f"gamma = {np.degrees(found.gamma[c]):.4g} deg".replace("-", "−") for c in columns] + [
        f"best of each point, {WITHIN}"
    ] * (not single)
    values = what.factor * np.column_stack([found.value[:, list(columns)], best.value])[rows][..., : len(names)]
    look = look_of(what.column, Field(values.ravel(), what.unit, what.name))
    drawn = [(name, values[..., k], look) for k, name in enumerate(names)]
    if not single:
        degrees = np.degrees(best.gamma[rows])
        angles = Field(degrees.ravel(), "deg", "gamma")
        drawn.append(("its gamma", degrees, look_of("best_gamma_deg", angles)))
    outline = None if inside is None else inside[rows]
    with house_style():
        figure, axes = panels(len(drawn), np.array([np.ptp(corners) for corners in plane.corners]), look)
        for ax, (name, of_plane, own) in zip(axes, drawn, strict=True):
            panel(ax, of_plane, own, plane, lines=3)
            _surround(ax, plane, outline)
            ax.set_title(name)
        look_bar(figure, look, axes=axes)
        if not single:
            look_bar(figure, drawn[-1][2], axes=axes)
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


def draw_gamma_statistics(
    found: Distribution, *, title: str, choice: GammaChoice | None = None, inside: Bools | None = None
) -> Figure:
    """Mean, standard deviation, peak to valley and share reached against gamma (Gao 2024, Fig. 11).

    ``choice``: a dotted line at this gamma, and in the legend what it costs; ``inside`` (n,): the points that it was
    made for, which then are those drawn.
    """
    what = shown(found.objective.quantity)
    degrees = np.degrees(found.gamma)
    found = found if inside is None else found.within(inside)
    with drawing(title, (10.0, 6.6), 2, 2, sharex=True) as (figure, axes):
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
            ax.set(title=name, ylabel=what.axis)
        axes[3].set(title="share of the points reached", ylabel="share (%)", ylim=(0.0, 104.0))
        for ax in axes:
            ax.set_xticks(angle_ticks(degrees))
            if choice is not None:
                ax.axvline(np.degrees(choice.gamma), color=INK, linestyle=":", linewidth=1.2)
        for ax in axes[2:]:
            ax.set_xlabel("gamma (deg)")
        handles = axes[0].get_legend_handles_labels()[0]
        if choice is not None:
            words = f"best for the {choice.aim}: {price_words(trade_off(found, aim=choice.aim), choice, what)}"
            handles.append(Line2D([], [], color=INK, linestyle=":", linewidth=1.2, label=words))
        figure.legend(handles=handles, loc="outside lower left", ncols=2)
    return figure


def price_words(traded: TradeOff, choice: GammaChoice, what: Quantity) -> str:
    """A chosen gamma and its value; what another would have, and which points that costs or gains."""
    unit = f" {what.unit}".rstrip()
    value = f"{what.factor * choice.value:.4g}{unit}"
    reach = int(traded.points[choice.column])
    said = f"{np.degrees(choice.gamma):.4g} deg, {value}, reaches {reach} of {traded.n} points"
    others = [c for c in traded.front if traded.points[c] != reach]
    wider = [c for c in others if traded.points[c] > reach]
    if not others:
        return said
    # One that reaches more, if there is: that which reaches most; else the most gained for a point lost.
    gain = [abs(traded.score[c] - choice.value) / abs(reach - traded.points[c]) for c in others]
    other = wider[0] if wider else others[int(np.argmax(gain))]
    apart = int(traded.points[other] - reach)
    points = f"{abs(apart)} {'point' if abs(apart) == 1 else 'points'} more"
    change = 100.0 * (traded.score[other] / choice.value - 1.0) if choice.value else 0.0
    return (
        f"{said};\n{np.degrees(traded.gamma[other]):.4g} deg would have {what.factor * traded.score[other]:.4g}{unit} "
        f"({change:+.0f} %) {'and reaches' if apart > 0 else 'but misses'} {points}"
    ).replace("-", "−")


def draw_trade_off(traded: TradeOff, choice: GammaChoice | None, what: Quantity, *, title: str) -> Figure:
    """Mean (or worst) value of each gamma against how many points it reaches; the line is what no other gamma beats."""
    with drawing(title, (8.0, 5.0)) as (figure, (ax,)):
        known = np.isfinite(traded.score)
        look: dict[str, Any] = {"linestyle": "none", "markersize": 6}
        (dots,) = ax.plot(
            traded.points[known],
            what.factor * traded.score[known],
            marker="o",
            color=FAINT,
            markeredgecolor="#777777",
            label="a gamma that another beats in both",
            **look,
        )
        at = list(traded.front)
        x, y = traded.points[at], what.factor * traded.score[at]
        (front,) = ax.plot(
            x, y, "-s", color=OKABE_ITO["blue"], markersize=7, label="no other has more of both: the trade-off"
        )
        handles = [dots, front]
        if choice is not None:
            place = (float(traded.points[choice.column]), what.factor * choice.value)
            words = f"chosen for the {choice.aim}: {price_words(traded, choice, what)}"
            handles += ax.plot(*place, "*", color="white", markeredgecolor=INK, markersize=17, zorder=5, label=words)
            handles[-1].set_linestyle("none")
        span, taken = np.ptp(ax.get_ylim()), list[tuple[float, float]]()
        for column, a, b in zip(at, x, y, strict=True):
            if any(abs(a - u) < 0.05 * np.ptp(ax.get_xlim()) and abs(b - v) < 0.06 * span for u, v in taken):
                continue
            taken.append((float(a), float(b)))
            note(
                ax, f"{np.degrees(traded.gamma[column]):.4g} deg".replace("-", "−"), (a, b), (9, 5), ha="left", size=9.0
            )
        ax.margins(x=0.12, y=0.12)
        ax.xaxis.set_major_locator(MaxNLocator(nbins=8, integer=True))
        ax.set(xlabel=f"points reached, of {traded.n}", ylabel=f"{traded.aim} over the points reached: {what.axis}")
        figure.legend(handles=handles, loc="outside lower left", ncols=1)
    return figure


def angle_ticks(degrees: Array) -> Array:
    """Ticks of an axis of angles: parts of a turn, about eight of them."""
    low, high = float(degrees.min()), float(degrees.max())
    for step in (1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 45.0, 60.0):
        if (high - low) / step <= 8.0:
            break
    return np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1.0) * step


def _surround(ax: Axes, plane: Plane, outline: Bools | None) -> None:
    """Mark where there is no posture, and the outline of the workpiece."""
    ax.grid(visible=False)
    ax.set_facecolor(NOTHING)
    ax.patch.set(hatch=HATCH, edgecolor=HATCH_INK)
    if outline is not None:
        # Around the cells, not through the points: steps, not slopes.
        fine = np.pad(np.repeat(np.repeat(outline.astype(np.float64), 2, axis=0), 2, axis=1), 1)
        x, y = (np.repeat(edges(centres), 2) for centres in (plane.centres[0][0], plane.centres[1][:, 0]))
        ax.contour(x, y, fine, levels=[0.5], colors=INK, linewidths=1.4)
    x, y = plane.corners
    ax.set(xlim=(x.min(), x.max()), ylim=(y.min(), y.max()))
