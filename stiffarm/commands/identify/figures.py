"""Figures of an identification of joint twists: loops, laws, compliances, the map. Data in, Figure out."""

from __future__ import annotations

from collections.abc import Sequence
from operator import attrgetter
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from doe.joint_twists import Direction, Identified
from doe.joint_twists.substitute import Errors, Window
from fem.statics.ports import ROWS
from robots import InputError
from stiffarm.pages.bars import HATCHES, bars_figure
from stiffarm.pages.figure_parts import SERIES, above, drawing, log_ticks, note, panels
from stiffarm.pages.style import INK, OKABE_ITO, STIFFNESS_COLOURS

_BLUE: Final = OKABE_ITO["blue"]
_ORANGE: Final = OKABE_ITO["vermillion"]
_WORDS: Final = {
    "tx": "along X",
    "ty": "along Y",
    "tz": "along Z (gear axis)",
    "rx": "about X",
    "ry": "about Y",
    "rz": "about Z (gear axis)",
}


def loops_figure(found: Identified) -> Figure:
    """Hysteresis: twist about the gear axis over the torque, up and down, of each joint's most loaded cycle.

    Raises
    ------
    InputError
        No joint's gear was loaded.
    """
    c, data = found.cycles, found.data
    shown = [(j, name) for j, name in enumerate(found.names) if _most_loaded(found, j) is not None]
    if not shown:
        raise InputError("loops figure: no gear was loaded", code="B002")
    heading = "Hysteresis about the gear axes, most loaded cycle of each joint"
    with panels(heading, len(shown), 3, 10.5, 3.0, 0.9) as (figure, axes):
        for ax, (j, name) in zip(axes, shown, strict=True):
            cycle = _most_loaded(found, j)
            mine = (c.number == cycle) & np.isfinite(data.twist[:, 5])
            torque = np.abs(c.carried[cycle, 5]) * data.load
            turn = 1e6 * np.sign(c.carried[cycle, 5]) * data.twist[:, 5]
            for up, colour, marker, word in ((True, _BLUE, "o", "loading"), (False, _ORANGE, "s", "unloading")):
                rows_ = np.flatnonzero(mine & (data.is_loading == up))
                rows_ = rows_[np.argsort(torque[rows_])]
                if not up:  # the way down begins where the way up ended
                    top = np.flatnonzero(mine & data.is_loading)
                    rows_ = np.append(rows_, top[np.argmax(torque[top])])
                ax.plot(torque[rows_], turn[rows_], marker + "-", color=colour, linewidth=1.2, markersize=5, label=word)
            ax.set(xlabel="torque about the gear axis (N m)", ylabel="twist (µrad)")
            ax.set_title(name, loc="left", weight="bold")
        axes[0].legend(loc="upper left")
    return figure


def _most_loaded(found: Identified, j: int) -> int | None:
    c = found.cycles
    mine = np.flatnonzero((c.joint == j) & np.isfinite(c.slope[:, 5]) & (np.abs(c.carried[:, 5]) > 1e-6))
    return int(mine[np.argmax(np.abs(c.carried[mine, 5]))]) if mine.size else None


def laws_figure(found: Identified) -> Figure:
    """Stiffness over the joint's angle with 95 % bands, six directions (columns) of every joint (rows)."""
    dof = len(found.names)
    high = 0.8 + 2.3 * dof
    with drawing("Six stiffnesses of every joint over its angle", (12.0, high), 0) as (figure, _):
        axes = figure.subplots(dof, 6, squeeze=False).ravel()
        for k, d in enumerate(found.directions.values()):
            ax = axes[k]
            _law_panel(ax, d)
            if k < 6:
                unit = "N/µm" if d.is_shift else "10⁶ N m/rad"
                ax.set_title(f"{_WORDS[d.row]}\n{unit}", loc="left", size=10)
            if k % 6 == 0:
                ax.set_ylabel(d.joint, weight="bold", rotation=0, labelpad=18, size=12)
            if k // 6 == dof - 1:
                ax.set_xlabel("joint angle (deg)")
        handles = [
            Line2D([], [], color=_BLUE, linewidth=2.0, label="law with 95 % band"),
            Line2D(
                [],
                [],
                color=INK,
                marker="o",
                linestyle="none",
                markersize=4,
                markerfacecolor="white",
                label="each angle by itself, 95 %",
            ),
        ]
        figure.legend(handles=handles, loc="upper right", ncols=2)
        # By hand: 36 panels laid out by constraints are drawn twice, which takes seconds.
        figure.subplots_adjust(0.065, 0.5 / high, 0.99, 1.0 - 0.9 / high, wspace=0.34, hspace=0.2)
    return figure


def _law_panel(ax: Axes, d: Direction) -> None:
    if d.law is None:
        words: str = d.status
        if d.status == "not determined":
            _, low, _ = d.stiffness(np.zeros(1))
            if np.isfinite(low[0]):
                words += f"\nat least {low[0] / 1e6:.3g}"
        ax.text(0.5, 0.5, words, transform=ax.transAxes, ha="center", va="center", size=9, color="#666666")
        ax.set(xticks=[], yticks=[])
        return
    angle = np.linspace(d.angle.min(), d.angle.max(), 61) if len(d.angle) > 1 else d.angle
    k, low, high = (v / 1e6 for v in d.stiffness(angle))
    with np.errstate(divide="ignore", invalid="ignore"):
        points = 1e-6 / d.value
        lower, upper = 1e-6 / (d.value + d.quantile * d.sd), 1e-6 / (d.value - d.quantile * d.sd)
    top = 2.0 * float(k.max())
    upper = np.where((upper > 0.0) & np.isfinite(upper), upper, 10.0 * top)
    ax.fill_between(np.degrees(angle), low, np.minimum(high, 10.0 * top), color=_BLUE, alpha=0.16, linewidth=0)
    ax.plot(np.degrees(angle), k, color=_BLUE, linewidth=2.0)
    good = points > 0.0
    spread = np.maximum([(points - lower)[good], (upper - points)[good]], 0.0)
    if d.status == "not judged":
        spread = np.zeros_like(spread)
        note(ax, "no interval", (0.97, 0.9), xycoords="axes fraction", ha="right", color="#666666")
    ax.errorbar(
        np.degrees(d.angle)[good],
        points[good],
        spread,
        fmt="o",
        markersize=3.5,
        color=INK,
        markerfacecolor="white",
        elinewidth=0.7,
    )
    ax.set_ylim(0.0, top)
    ax.xaxis.set_major_locator(MaxNLocator(3))
    ax.yaxis.set_major_locator(MaxNLocator(4))
    if d.status == "one-sided":
        note(ax, "rigid is possible", (0.97, 0.9), xycoords="axes fraction", ha="right", color="#666666")


def compliances_figure(found: Identified) -> Figure:
    """Six compliances of every joint: mean over the angles measured, with 95 % intervals, log axes."""
    heading = "Six compliances of every joint, means over the angles with 95 % intervals"
    with drawing(heading, (11.0, 4.6), 1, 2) as (figure, axes):
        for ax, rows, factor, unit in (
            (axes[0], ROWS[:3], 1e9, "nm/N"),
            (axes[1], ROWS[3:], 1e9, "nrad/(N m)"),
        ):
            handles = _bars(ax, found, rows, factor)
            ax.set_ylabel(f"compliance ({unit})")
            ax.set_xticks(range(len(found.names)), found.names)
            ax.grid(axis="x", visible=False)
            above(ax, handles, 3)
    return figure


def _bars(ax: Axes, found: Identified, rows: Sequence[str], factor: float) -> list[object]:
    ax.set_yscale("log")
    known = [d for d in found.directions.values() if d.row in rows and d.law is not None]
    bottom = 0.4 * min((factor * d.mean for d in known), default=1.0)
    top = 2.5 * max((factor * (d.mean + np.nan_to_num(d.quantile * d.spread)) for d in known), default=10.0)
    handles: dict[str, object] = {}
    for r, row in enumerate(rows):
        for j, name in enumerate(found.names):
            d, x = found.directions[name, row], j + 0.27 * (r - 1)
            if d.law is None:
                note(
                    ax,
                    "n.i." if d.status == "not identified" else "n.d.",
                    (x, bottom * 1.1),
                    rotation=90,
                    va="bottom",
                    size=8,
                    color="#666666",
                )
                continue
            bar = ax.bar(
                x,
                factor * d.mean - bottom,
                0.25,
                bottom=bottom,
                color=SERIES[r],
                hatch=HATCHES[r],
                edgecolor="white",
                linewidth=0.0,
            )
            half = float(np.nan_to_num(factor * d.quantile * d.spread))
            low = min(half, factor * d.mean - 0.5 * bottom)
            ax.errorbar(x, factor * d.mean, [[low], [half]], color=INK, linewidth=1.0, capsize=2.0)
            if row not in handles:
                bar.set_label(_WORDS[row])
                handles[row] = bar
    ax.set(xlim=(-0.6, len(found.names) - 0.4), ylim=(bottom, top))
    log_ticks(ax.yaxis, lambda v: f"{v:g}")
    return list(handles.values())


def usual_models_figure(same: Errors, refitted: Errors) -> Figure:
    """How wrong models of the gears alone are: mean, 95th percentile and worst, by flange axis, log axis."""
    # A logarithmic axis has no place for a model that is right to the last digit.
    percent = {
        word: {
            f"{axis}, {name}": value
            for name, e in (("same", same), ("refitted", refitted))
            for axis, value in zip("XYZ", np.maximum(100.0 * of(e), 0.1).tolist(), strict=True)
        }
        for word, of in (
            ("mean", attrgetter("mean")),
            ("95th percentile", attrgetter("p95")),
            ("worst", attrgetter("worst")),
        )
    }
    heading = "Gears alone against six stiffnesses a joint, random reachable poses"
    below = "flange axis; gears with the same torsional stiffness, or refitted to flange deflections"
    return bars_figure(heading, percent, "error of directional stiffness (%)", below, log=True)


def window_figure(w: Window, robot: str) -> Figure:
    """The map: mean of the directional stiffnesses in flange X, Y, Z over the window; grey is not reached."""
    with drawing(f"Stiffness map of {robot}", (7.2, 5.6), 1, 1) as (figure, (ax,)):
        mean = np.ma.masked_invalid(1e-3 * w.mean)
        ax.set_facecolor("#D9DBDE")
        mesh = ax.pcolormesh(1e3 * w.x, 1e3 * w.z, mean, cmap=STIFFNESS_COLOURS, shading="gouraud")
        if np.isfinite(w.mean).sum() > 8:
            lines = ax.contour(1e3 * w.x, 1e3 * w.z, mean, levels=8, colors="white", linewidths=0.7, alpha=0.8)
            ax.clabel(lines, fmt="%.0f", fontsize=8)
        bar = figure.colorbar(mesh, ax=ax)
        bar.set_label("mean directional stiffness (N/mm)")
        bar.outline.set_linewidth(0.6)
        ax.set_aspect("equal")
        ax.grid(visible=False)
        ax.set(xlabel="X (mm)", ylabel="Z (mm)")
        words = {"base": "flange axes as the base's", "forward": "flange forward", "down": "flange down"}
        ax.set_title(f"plane Y = 0, {words[w.orientation]}, elbow {w.elbow}", loc="left", size=9.5)
    return figure
