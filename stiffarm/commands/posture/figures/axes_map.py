"""Picture of an axes map: gamma against the path with the value as colour, barred zones, and courses through it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke

from machining import Course
from machining.posture.axes_map import AxesMap, Zone
from machining.posture.path import PathPosture
from machining.stiffness.objective import shown
from robots.arrays import Array, Bools
from stiffarm.commands.maps.index.figures import angle_ticks
from stiffarm.commands.maps.looks import look_bar, look_of
from stiffarm.pages.figure_parts import drawing
from stiffarm.pages.style import INK, OKABE_ITO
from surrogate.maps.data import Field

TURN: Final = 360.0


@dataclass(frozen=True)
class _Tone:
    face: str
    hatch: str | None
    ink: str


# Greys, told apart by their hatches too; near a singularity the colour stays, under dots.
TONES: Final[dict[Zone, _Tone]] = {
    Zone.UNREACHABLE: _Tone("#F0F0F0", None, "#F0F0F0"),
    Zone.LIMITS: _Tone("#D2D2D2", "////", "#8C8C8C"),
    Zone.COLLISION: _Tone("#A8A8A8", "xxxx", "#5A5A5A"),
    Zone.SINGULAR: _Tone("#BEBEBE", "....", "#FFFFFF"),
}


@dataclass(frozen=True)
class CourseLine:
    """A course to draw: ``gamma`` (n,) rad, ``value`` (n,) of the objective; ``dots`` where it may jump."""

    gamma: Array
    value: Array
    colour: str
    dots: bool = False
    dash: Literal["-", "--", ":"] = "-"


def course_lines(found: PathPosture, before: Course | None = None) -> dict[str, CourseLine]:
    """The courses of a path's posture by the names of the legend; the fixed gamma only where there is one.

    ``before``: the course of the program as it stands.
    """
    lines = {
        "recommended": CourseLine(found.course.gamma, found.course.value, "#000000"),
        "each point by itself": CourseLine(
            found.each_point.gamma, found.each_point.value, OKABE_ITO["green"], dots=True
        ),
    }
    if found.fixed is not None:
        name = f"best fixed gamma, {np.degrees(found.fixed.gamma[0]):.4g} deg"
        lines[name] = CourseLine(found.fixed.gamma, found.fixed.value, OKABE_ITO["sky"], dash=":")
    if before is not None:
        lines["as programmed"] = CourseLine(before.gamma, before.value, OKABE_ITO["vermillion"], dash="--")
    return lines


def draw_axes_map(
    made: AxesMap, courses: Mapping[str, CourseLine] | None = None, *, title: str, narrow: bool = False
) -> Figure:
    """Map above, the courses' values along the path below; ``narrow``: for half of a page's width."""
    courses = courses or {}
    degrees = np.degrees(made.gamma)
    x = 1e3 * made.length
    look: dict[str, Any] = {"height_ratios": (2.3, 1.0)} if courses else {}
    size = (5.2, 6.4) if narrow else (10.5, 7.6 if courses else 5.4)
    with drawing(title, size, 2 if courses else 1, 1, sharex=True, **look) as (figure, axes):
        window = _cells(figure, axes[0], x, degrees, made)
        for line in courses.values():
            _course(axes[0], x, _turns(np.degrees(line.gamma), *window), line)
        axes[0].set(ylabel="gamma (deg)", xlim=(x[0], x[-1]), ylim=window, yticks=angle_ticks(np.array(window)))
        axes[-1].set_xlabel("path length (mm)")
        if courses:
            _values(axes[1], x, made, courses)
        handles = [_line_handle(name, line) for name, line in courses.items()] + _zone_handles(made)
        if handles:
            figure.legend(handles=handles, loc="outside lower left", ncols=2 if narrow else 3)
    return figure


def _cells(figure: Figure, ax: Axes, x: Array, degrees: Array, made: AxesMap) -> tuple[float, float]:
    """Draw values and zones; returns the range of gamma that the axis shows."""
    what = shown(made.objective.quantity)
    value, zone, rows = what.factor * made.value, made.zone, degrees
    window = (float(degrees[0]), float(degrees[-1]))
    cell = float(np.median(np.diff(degrees)))
    if degrees[-1] + cell > degrees[0] + TURN - 1e-6:
        # A full turn: its first angle is also its last.
        window = (window[0], window[0] + TURN)
        if degrees[-1] < window[1] - 1e-6:
            rows = np.append(degrees, window[1])
            value, zone = (np.concatenate([a, a[:, :1]], axis=1) for a in (value, zone))
    ax.grid(visible=False)
    ax.set_facecolor(TONES[Zone.UNREACHABLE].face)
    finite = value[np.isfinite(value)]
    xe, ye = steps(x), steps(rows)
    if finite.size:
        look = look_of(what.column, Field(finite, what.unit, what.name))
        edges = np.append(xe[::2], xe[-1]), np.append(ye[::2], ye[-1])
        ax.pcolormesh(*edges, np.ma.masked_invalid(value.T), norm=look.norm, cmap=look.colours, rasterized=True)
        look_bar(figure, look, axes=ax)
    for one, tone in TONES.items():
        mask = zone == one
        if one is Zone.UNREACHABLE or not mask.any():
            continue
        bare = mask & ~np.isfinite(value)
        for part, face in ((bare, tone.face), (mask & ~bare, None)):
            if part.any():
                hatched(ax, xe, ye, part, face, tone.hatch, tone.ink)
    return window


def hatched(ax: Axes, xe: Array, ye: Array, mask: Bools, face: str | None, hatch: str | None, ink: str) -> None:
    """Fill the cells of a mask (n, m), whose edges are the :func:`steps` of their centres."""
    fine = np.repeat(np.repeat(mask.astype(np.float64), 2, axis=0), 2, axis=1)
    shades = [to_rgba(face)] if face else ["none"]
    drawn = ax.contourf(xe, ye, fine.T, levels=[0.5, 1.5], colors=shades, hatches=[hatch])
    drawn.set(edgecolor=ink, linewidth=0.0)


def steps(centres: Array) -> Array:
    """Both edges of each cell in turn: a mask drawn over them has steps, not slopes."""
    middle = 0.5 * (centres[1:] + centres[:-1])
    outer = np.concatenate([[1.5 * centres[0] - 0.5 * centres[1]], middle, [1.5 * centres[-1] - 0.5 * centres[-2]]])
    return np.asarray(np.repeat(outer, 2)[1:-1])


def _turns(gamma: Array, low: float, high: float) -> list[Array]:
    """A course's gamma (deg) as often as a turn's axis shows it, whole turns apart: the axis cuts off what is beyond.

    So a line that leaves at one end comes back at the other. On a shorter axis nothing wraps.
    """
    if high - low < TURN - 1e-6:
        return [gamma]
    whole = np.unwrap(gamma, period=TURN)
    first, last = np.ceil((low - whole.max() - 1e-9) / TURN), np.floor((high - whole.min() + 1e-9) / TURN)
    return [whole + TURN * k for k in np.arange(first, last + 1.0)]


def _course(ax: Axes, x: Array, gammas: list[Array], line: CourseLine) -> None:
    look: dict[str, Any] = {"linewidth": 2.0, "path_effects": [Stroke(linewidth=4.0, foreground="white"), Normal()]}
    look |= {"linestyle": line.dash, "zorder": 3.5} if line.dash != "-" else {"linestyle": "-", "zorder": 5.0}
    if line.dots:
        look = {"linestyle": "none", "marker": "o", "markersize": 3.2, "markeredgecolor": "white"}
        look |= {"markeredgewidth": 0.5, "zorder": 4}
    for gamma in gammas:
        ax.plot(x, gamma, color=line.colour, **look)


def _values(ax: Axes, x: Array, made: AxesMap, courses: Mapping[str, CourseLine]) -> None:
    what = shown(made.objective.quantity)
    for name, line in courses.items():
        look: dict[str, Any] = {"marker": "o", "markersize": 3.4, "linewidth": 0.8} if line.dots else {"linewidth": 1.8}
        ax.plot(
            x,
            what.factor * line.value,
            color=line.colour,
            linestyle=line.dash,
            label=name,
            zorder=3.0 if line.dots or line.dash != "-" else 4.0,
            **look,
        )
    ax.set_ylabel(what.axis)
    ax.margins(y=0.08)


def _line_handle(name: str, line: CourseLine) -> Line2D:
    if line.dots:
        return Line2D([], [], color=line.colour, marker="o", markersize=4, linewidth=0.8, label=name)
    return Line2D([], [], color=line.colour, linestyle=line.dash, linewidth=2.0, label=name)


def _zone_handles(made: AxesMap) -> list[Patch]:
    """Patches of the zones that the map has."""
    handles = []
    for zone, tone in TONES.items():
        if not (made.zone == zone).any():
            continue
        edge = INK if tone.hatch is None else tone.ink
        width = 0.5 if tone.hatch is None else 0.0
        face = "#9C3A8C" if zone is Zone.SINGULAR else tone.face
        handles.append(Patch(facecolor=face, edgecolor=edge, hatch=tone.hatch, linewidth=width, label=zone.words))
    return handles
