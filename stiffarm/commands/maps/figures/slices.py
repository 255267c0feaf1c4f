"""Slices of a map: a quantity over planes with contour lines, the robot in its pose and the extreme points marked."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from robots import InputError, ModelDescription, Robot
from robots.arrays import Array, Bools
from stiffarm.commands.maps.figures.robot import draw_outlines, robot_outlines
from stiffarm.commands.maps.looks import Look, category_patches, look_bar
from stiffarm.commands.maps.planes import Plane
from stiffarm.pages.figure_parts import title as figure_title
from stiffarm.pages.style import INK, house_style, new_figure
from surrogate.maps.data import MapData

# Contour lines: about so many in a slice that stands alone, and in one of many.
_LINES: Final = (6, 3)
# A robot is drawn whole where the map keeps this share of the panel's width or height; else the map fills the panel.
_WHOLE_FROM: Final = 0.3
# A step this many times the median one is a jump; where such points are more than this share there are no lines.
_STANDS_OUT: Final = 6.0
_MOST_SEAMS: Final = 0.3
# Planes that differ by less than this share of the range, in all but this share of their points, are alike.
_ALIKE: Final = 0.01
# Values that differ by less than this are one value.
_EQUAL: Final = 1e-6
# Width of a letter of the facts below a title, inches.
_LETTER: Final = 0.068
_MARKS: Final = (("*", 13.0), ("v", 8.0))


def slice_figure(
    data: MapData,
    look: Look,
    planes: Sequence[Plane],
    description: ModelDescription,
    robot: Robot,
    heading: str,
    facts: str,
) -> Figure:
    """Draw one panel a plane, all with one bar or one legend of categories.

    Raises
    ------
    InputError
        No plane holds a reached point.
    """
    shown = [plane for plane in planes if np.isfinite(_values(data, look, plane)).any()]
    if not shown:
        raise InputError(
            f"map: {look.name}",
            code="B002",
            value="no point reached",
            remedy="move the grid to where the robot reaches",
        )
    alone = len(shown) == 1
    bodies = [_robot(data, look, plane, description, robot) for plane in shown]
    known = [np.isfinite(_values(data, look, plane)) for plane in shown]
    frames = [_frame(*one) for one in zip(shown, known, bodies, strict=True)]
    # One frame for all panels, so that they compare.
    low, high = np.min([f[0] for f in frames], axis=0), np.max([f[1] for f in frames], axis=0)
    with house_style():
        figure, axes = panels(len(shown), (high - low), look)
        for k, (ax, plane) in enumerate(zip(axes, shown, strict=True)):
            panel(ax, _values(data, look, plane), look, plane, lines=_LINES[0] if alone else _LINES[1])
            draw_outlines(ax, bodies[k], linewidth=1.1 if alone else 0.8)
            _marks(ax, data, look, plane, scale=1.0 if alone else 0.75)
            ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
            if not alone:
                ax.set_title(plane.where, loc="left", size=9.5)
        if look.kind != "category":
            look_bar(figure, look, axes=axes)
        handles = category_patches(look) + _legend(data, look, shown, bool(any(bodies)))
        figure.legend(handles=handles, loc="outside lower left", ncols=2 if alone else 3)
        where, _, alike = shown[0].where.partition(" (")
        told = "; ".join(words for words in (alike.removesuffix(")") if alone else "", facts) if words)
        headings(figure, f"{heading}, {where}" if alone else heading, told)
    return figure


def unlike(data: MapData, look: Look, planes: Sequence[Plane]) -> list[Plane]:
    """The planes, or one of them if all show the same, as those around the main axis do: the one nearest to 0."""
    if len(planes) < 2 or len({plane.rows.shape for plane in planes}) > 1:
        return list(planes)
    values = np.stack([_values(data, look, plane) for plane in planes])
    known = np.isfinite(values)
    span = np.ptp(values[known]) if known.any() else 0.0
    with np.errstate(invalid="ignore"):
        other = (known != known[0]) | (np.abs(values - values[0]) > _ALIKE * span)
    if other.mean() > _ALIKE:
        return list(planes)
    one = planes[int(np.argmin([abs(plane.at) for plane in planes]))]
    others = ", ".join(f"{plane.at:g}" for plane in planes if plane is not one).replace("-", "−")
    return [replace(one, where=f"{one.where} (at {others} the same by symmetry)")]


def headings(figure: Figure, heading: str, facts: str) -> None:
    """A title, and below it facts in smaller print, for which the layout keeps room."""
    lines = textwrap.wrap(facts, int(figure.get_figwidth() / _LETTER))
    # The title's letters are larger: a line of it is more than one of facts.
    figure_title(figure, heading + "\n" * len(lines))
    # Once for all: with many panels the layout takes longer than the drawing, and each format would do it again.
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    if not lines:
        return
    (top,) = [text for text in figure.texts if text.get_text().startswith(heading)]
    box = top.get_window_extent().transformed(figure.transFigure.inverted())
    figure.text(box.x0, box.y0, "\n".join(lines), size=9, color="#555555", va="bottom")


def panels(count: int, size: Array, look: Look) -> tuple[Figure, list[Axes]]:
    """A figure with axes for planes of one size (2,) mm, and room for the bar or the legend of a quantity."""
    columns = 1 if count == 1 else (2 if count in (2, 4) else 3)
    rows = -(-count // columns)
    width = 6.0 if count == 1 else (4.2 if columns == 2 else 3.3)
    height = float(np.clip(width * size[1] / size[0], 0.35 * width, 1.25 * width))
    width = min(width, height * size[0] / size[1])
    wide = max(width * columns + (2.1 if look.kind != "category" else 1.2), 5.6)
    figure, axes = new_figure((wide, height * rows + 1.7), rows, columns, sharex=True, sharey=True)
    figure.set_layout_engine("compressed")
    for ax in axes[count:]:
        ax.remove()
    for k, ax in enumerate(axes[:count]):
        ax.label_outer()
        if k + columns >= count:
            ax.xaxis.set_tick_params(labelbottom=True)
    return figure, axes[:count]


def _values(data: MapData, look: Look, plane: Plane) -> Array:
    """Values of the plane's points, NaN where there is none."""
    values = np.asarray(data.fields[look.name].values[plane.rows.ravel()], dtype=np.float64).reshape(plane.rows.shape)
    if look.kind == "category":
        values = np.where(values >= 0.0, values, np.nan)
    return np.where(np.asarray(data.reached)[plane.rows], values, np.nan)


def panel(ax: Axes, values: Array, look: Look, plane: Plane, lines: int) -> None:
    """Draw values (a, b) of a plane's points, NaN where there is none, with about so many contour lines."""
    masked = np.ma.masked_invalid(values)
    ax.set_aspect("equal")
    # Pixels inside a vector file stay small, and cells of thousands of paths do not.
    ax.pcolormesh(*plane.corners, masked, cmap=look.colours, norm=look.norm, rasterized=True, zorder=1)
    ax.set(
        xlabel=plane.labels[0] if ax.xaxis.get_tick_params()["labelbottom"] else "",
        ylabel=plane.labels[1] if ax.yaxis.get_tick_params()["labelleft"] else "",
    )
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(MaxNLocator(nbins=6 if lines > 3 else 4, steps=[1, 2, 5, 10]))
    levels = contour_levels(look, values, lines)
    if not len(levels) or min(values.shape) < 3:
        return
    at_seam = seams(look, values)
    if at_seam.mean() > _MOST_SEAMS * np.isfinite(values).mean():
        return
    x, y = plane.centres
    masked = np.ma.masked_where(masked.mask | at_seam, values)
    if masked.mask.all():
        return
    if plane.closed:
        x, y, masked = (np.ma.vstack([a, a[:1]]) for a in (x, y, masked))
    inks = [look.level_ink(level) for level in levels]
    drawn = ax.contour(x, y, masked, levels=levels, colors=inks, linewidths=0.8, alpha=0.85, zorder=2)
    ax.clabel(drawn, fmt=lambda v: f"{v:.6g}".replace("-", "−"), fontsize=8.0 if lines > 3 else 9.0, inline_spacing=3)


def contour_levels(look: Look, values: Array, lines: int) -> Array:
    """Round numbers for contour lines: of the bar's ticks those between the values, thinned to about ``lines``."""
    if look.kind in ("angle", "category") or not np.isfinite(values).any():
        return np.zeros(0)
    inner = look.ticks[(look.ticks > np.nanmin(values)) & (look.ticks < np.nanmax(values))]
    return np.asarray(inner[:: max(1, round(len(inner) / lines))])


def seams(look: Look, values: Array) -> Bools:
    """Points (a, b) beside which the colour jumps: by over a tenth of the scale, and unlike elsewhere in the plane.

    Maps of the stiffest of several postures change abruptly where another one takes over. A contour line would run
    along that seam as if the quantity had the line's value there.
    """
    scaled = np.clip(np.ma.filled(look.norm(np.ma.masked_invalid(values)), np.nan), 0.0, 1.0)
    steps = [np.abs(np.diff(scaled, axis=i)) for i in (0, 1)]
    out = np.zeros(values.shape, dtype=bool)
    # Each direction by itself: where the field changes along one only, the other has no steps to compare with. On a
    # coarse grid a smooth field takes such steps everywhere.
    limits = [
        max(0.1, _STANDS_OUT * float(np.median(s[np.isfinite(s)]))) if np.isfinite(s).any() else 1.0 for s in steps
    ]
    up, across = (s > limit for s, limit in zip(steps, limits, strict=True))
    out[1:] |= up
    out[:-1] |= up
    out[:, 1:] |= across
    out[:, :-1] |= across
    return out


def extremes(data: MapData, look: Look, plane: Plane) -> tuple[int, int]:
    """Numbers of the plane's points with the largest and the smallest value.

    The stiffest one is sought where no pose is near a singular one, if there are such points.
    """
    every = _values(data, look, plane)
    across = plane.centres[0]
    regular = np.where(data.regular(plane.rows.ravel()).reshape(plane.rows.shape), every, np.nan)
    stiffest = regular if np.isfinite(regular).any() else every
    out = []
    for k, pick in enumerate((np.nanmax, np.nanmin)):
        values = stiffest if look.kind == ("stiff", "soft")[k] else every
        end = pick(values)
        # Of equals, as on both sides of a symmetric map, the one to the right.
        equal = np.abs(values - end) <= _EQUAL * abs(end)
        out.append(int(plane.rows.flat[np.argmax(np.where(equal, across, -np.inf))]))
    return out[0], out[1]


def posed(data: MapData, look: Look, plane: Plane) -> int | None:
    """The point whose pose the robot is drawn in: the stiffest one, of other quantities the largest.

    Of categories the reached point nearest to the middle of all reached ones. None without a pose.
    """
    known = np.isfinite(np.asarray(data.q)[plane.rows]).all(axis=2) & np.isfinite(_values(data, look, plane))
    if not known.any():
        return None
    rows = plane.rows[known]
    if look.kind == "category":
        points = np.asarray(data.points)[rows]
        return int(rows[np.linalg.norm(points - points.mean(axis=0), axis=1).argmin()])
    best = extremes(data, look, plane)[1 if look.kind == "soft" else 0]
    if best in rows:
        return best
    values = np.asarray(data.fields[look.name].values)[rows]
    return int(rows[values.argmin() if look.kind == "soft" else values.argmax()])


def _robot(data: MapData, look: Look, plane: Plane, description: ModelDescription, robot: Robot) -> list[Array]:
    point = posed(data, look, plane)
    if point is None:
        return []
    return robot_outlines(description, robot, np.asarray(data.q[point]), plane.right, plane.up)


def _frame(plane: Plane, reached: Bools, polygons: Sequence[Array]) -> tuple[Array, Array]:
    """Corners of what a panel shows: reached points and robot, or only the points if they became too small."""
    x, y = (_at_cells(c, reached) for c in plane.corners)
    low, high = np.array([x.min(), y.min()]), np.array([x.max(), y.max()])
    if polygons:
        every = np.vstack(polygons)
        both = np.minimum(low, every.min(axis=0)), np.maximum(high, every.max(axis=0))
        if ((high - low) / (both[1] - both[0])).max() >= _WHOLE_FROM:
            low, high = both
    pad = 0.03 * (high - low).max()
    return low - pad, high + pad


def _at_cells(corners: Array, reached: Bools) -> Array:
    """Corners (a + 1, b + 1) of the cells (a, b) that are reached, in no order."""
    return np.concatenate(
        [corners[i : i + len(reached), j : j + reached.shape[1]][reached] for i in (0, 1) for j in (0, 1)]
    )


def _marks(ax: Axes, data: MapData, look: Look, plane: Plane, scale: float) -> None:
    if look.kind == "category":
        return
    for row, (marker, size) in zip(extremes(data, look, plane), _ordered(look), strict=True):
        spot = plane.flat(1e3 * np.asarray(data.points[row]))
        look_of_mark: dict[str, Any] = {"color": "white", "markeredgecolor": INK, "markeredgewidth": 1.0, "zorder": 5}
        ax.plot(*spot, marker, markersize=scale * size, clip_on=False, **look_of_mark)


def _ordered(look: Look) -> tuple[tuple[str, float], tuple[str, float]]:
    """Marks of the largest and the smallest value: the star is always the stiffest."""
    return (_MARKS[1], _MARKS[0]) if look.kind == "soft" else _MARKS


def _legend(data: MapData, look: Look, planes: Sequence[Plane], robot: bool) -> list[Line2D]:
    out = []
    if look.kind != "category":
        for k, name in enumerate((look.ends[0], look.ends[1])):
            # ``ends``: largest first, and so are the extremes.
            marker, size = _ordered(look)[k]
            where = [extremes(data, look, plane)[k] for plane in planes]
            values = [float(data.fields[look.name].values[row]) for row in where]
            best = where[int(np.argmax(values) if k == 0 else np.argmin(values))]
            place = ", ".join(f"{1e3 * v:.0f}" for v in data.points[best]).replace("-", "−")
            text = f"{name}: {look.text(float(data.fields[look.name].values[best]))} at ({place}) mm"
            if len(planes) > 1:
                text = f"{name} of each slice; of all {text.split(': ')[1]}"
            out.append(
                Line2D(
                    [],
                    [],
                    marker=marker,
                    markersize=0.85 * size,
                    color="white",
                    markeredgecolor=INK,
                    label=text,
                    linestyle="none",
                )
            )
    if robot:
        which = (
            "in the middle" if look.kind == "category" else f"at the {look.ends[1 if look.kind == 'soft' else 0]} point"
        )
        out.append(Line2D([], [], color=INK, linewidth=1.0, label=f"robot, {which}"))
    return out
