"""What the paper reads off the map of the XR701, asked of the models that `stiffarm run` calibrates.

    python benchmarks/surrogates/map_findings_page.py [FOLDER] [--write]

FOLDER: results of `stiffarm run xr701`; without it the command is run. ``--write`` writes docs/validation/xr701_map.md
with its figure.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

import numpy as np
from map_findings import (
    LARGE_SHARE,
    NEIGHBOURHOOD_M,
    PoseSample,
    Samples,
    influences,
    local_ranges,
    middle_of_reach,
    model_findings,
    spread_ratio,
)
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from fem import build_model
from robots import load_description
from robots.arrays import Array
from stiffarm.commands.maps.figures.slices import headings
from stiffarm.commands.maps.looks import COLOURS
from stiffarm.pages.figure_parts import log_ticks, note
from stiffarm.pages.style import FAINT, INK, OKABE_ITO, house_style, new_figure, save_png

_BINS: Final = 24
# Bins with fewer poses have no percentiles worth drawing; points beyond these are one grey mass.
_LEAST_IN_BIN: Final = 20
_POINTS: Final = 3000


def findings_figure(samples: Samples, heading: str) -> Figure:
    """Draw what the findings rest on: four panels, one for distance and stretch each, contrasts, influences."""
    with house_style():
        figure, axes = new_figure((10.0, 7.8), 2, 2)
        poses = samples.poses
        _against(axes[0], poses.radius, poses.stiffness, "distance from the main axis (mm)")
        _against(axes[1], poses.stretch, poses.stiffness, "stretch, shoulder to tool point (mm)")
        _contrasts(figure, axes[2], poses)
        _influences(axes[3], samples)
        facts = f"{len(poses.stiffness):,} poses spread evenly over the joint ranges, vertical load"
        headings(figure, heading, facts)
    return figure


def _against(ax: Axes, distance: Array, stiffness: Array, label: str) -> None:
    x, y = 1e3 * distance, 1e-3 * stiffness
    step = max(1, len(x) // _POINTS)
    ax.plot(x[::step], y[::step], ".", color=FAINT, markersize=2.5, rasterized=True, zorder=1)
    edges = np.linspace(x.min(), x.max(), _BINS + 1)
    which = np.clip(np.digitize(x, edges) - 1, 0, _BINS - 1)
    kept = [k for k in range(_BINS) if (which == k).sum() >= _LEAST_IN_BIN]
    if kept:
        low, median, high = np.array([np.percentile(y[which == k], [5.0, 50.0, 95.0]) for k in kept]).T
        middles = 0.5 * (edges[1:] + edges[:-1])[kept]
        ax.fill_between(middles, low, high, color=OKABE_ITO["blue"], alpha=0.2, linewidth=0, label="5 to 95 %")
        ax.plot(middles, median, color=OKABE_ITO["blue"], label="median")
    ax.set_yscale("log")
    ax.set_ylim(0.9 * np.percentile(y, 0.2), 1.1 * np.percentile(y, 99.8))
    log_ticks(ax.yaxis, lambda v: f"{v:g}")
    ax.set(xlabel=label, ylabel="stiffness (N/mm), log scale")
    ax.legend(loc="upper right")


def _contrasts(figure: Figure, ax: Axes, poses: PoseSample) -> None:
    """Where in the cross-section the stiffness ranges widely within a neighbourhood."""
    found = local_ranges(poses, np.arange(len(poses.stiffness)))
    ax.set_aspect("equal")
    ax.set(xlabel="distance from the main axis (mm)", ylabel="z (mm)")
    whole = np.log(spread_ratio(poses.stiffness))
    if not len(found.rows) or whole <= 0.0:
        ax.text(0.5, 0.5, "nothing to compare", transform=ax.transAxes, ha="center", color="#555555")
        return
    share = np.log(found.ratio) / whole
    order = np.argsort(share, kind="stable")
    norm = Normalize(0.0, max(1.0, float(share.max())))
    look = {"c": share[order], "cmap": COLOURS["other"], "norm": norm, "s": 9, "linewidths": 0, "rasterized": True}
    ax.scatter(1e3 * poses.radius[found.rows][order], 1e3 * poses.points[found.rows, 2][order], **look)
    limits = 1e3 * poses.radius[middle_of_reach(poses)]
    for x in (limits.min(), limits.max()) if limits.size else ():
        ax.axvline(x, color=INK, linestyle="--", linewidth=0.9)
    bar = figure.colorbar(ScalarMappable(norm, COLOURS["other"]), ax=ax, pad=0.02, aspect=25)
    bar.set_label(f"range within {1e3 * NEIGHBOURHOOD_M:.0f} mm / whole range (–)")
    bar.ax.axhline(LARGE_SHARE, color="white", linewidth=1.6)
    ax.set_title("dashed: middle third of the reach", loc="left", size=9, color="#555555")


def _influences(ax: Axes, samples: Samples) -> None:
    """Total and mean effect of each coordinate, the layer coordinate last."""
    found = influences(samples)
    names = list(found)[::-1]
    places = np.arange(len(names), dtype=np.float64)
    total, main = ([100.0 * getattr(found[n], kind) for n in names] for kind in ("total", "main"))
    ax.barh(places + 0.2, total, 0.36, color=OKABE_ITO["blue"], label="with all interactions")
    ax.barh(places - 0.2, main, 0.36, color=OKABE_ITO["orange"], label="on average alone")
    for place, values in ((0.2, total), (-0.2, main)):
        for k, value in enumerate(values):
            text = f"{value:.2g} %" if value < 99.5 else f"{value:.0f} %"
            text = text if np.isfinite(value) else "tied to others by a coupling"
            note(ax, text, (float(np.nan_to_num(value)), k + place), (4, 0), ha="left", size=8.5)
    ax.set_yticks(places, [n.removesuffix("_deg") for n in names])
    ax.set_xlim(0.0, 1.2 * max([*total, *np.nan_to_num(main), 1e-3]))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    ax.set_xlabel("share of the variance of log stiffness (%)")
    ax.grid(visible=False, axis="y")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, 1.12), ncols=2)


ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "validation" / "xr701_map.md"
HEAD = """# The paper's findings on the map of the XR701

Two of the paper's three findings hold in part in both models. The third, that soft and stiff regions lie close
together in the middle of the workspace, holds in the model of the published scheme but not in the one that predicts
left-out poses best. So it depends on how the springs vary at angles that nobody has measured; it says little about the
arm itself.

Measured by `python benchmarks/surrogates/map_findings_page.py --write`.

Gotlih, Karner, Gotlih and Brezocnik, "Experiment based structural stiffness calibration of a virtual robot model",
section 3, draw three conclusions from their stiffness map: low stiffness far from the main Z axis and at large stretch,
soft and stiff regions close together in the middle of the workspace, and q4 almost without influence. Here they are
checked at 20 000 poses spread evenly over the joint ranges of two models that `stiffarm run xr701` calibrates: the one
that predicts left-out poses best, and that of the published scheme. Geometry and readings are the same; the models
differ in how springs depend on the joint angles, between and beyond the measured poses.

"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--write", action="store_true")
    wanted = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = wanted.folder or Path(place) / "run"
        if wanted.folder is None:
            command = [sys.executable, "-m", "stiffarm", "run", "xr701", "--points", "6", "--out", str(folder)]
            subprocess.run(command, check=True, cwd=ROOT)  # noqa: S603 - our own program with constant arguments
        text = page(folder, PAGE.with_suffix(".png") if wanted.write else None)
    print(text)
    if wanted.write:
        PAGE.write_text(text, encoding="utf-8")
    return 0


def page(folder: Path, figure: Path | None) -> str:
    """The page for the results of a run; ``figure``: where the recommended model's goes."""
    results = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    best, published = results["recommended"], next(iter(results["variants"]))
    names = {best: "recommended", published: "the published scheme"} if best != published else {best: "recommended"}
    found = {}
    for name in names:
        file = folder / "models" / f"{'_'.join(name.replace(',', ' ').split())}.toml"
        found[name] = model_findings(build_model(load_description(file)))
    samples, claims = found[best]
    lines = ["| claim | " + " | ".join(f"{name} ({role})" for name, role in names.items()) + " |"]
    lines.append("|---|" + "---|" * len(names))
    for k, claim in enumerate(claims):
        lines.append(f"| {claim.claim} | " + " | ".join(found[name][1][k].verdict for name in names) + " |")
    for name, (_, ones) in found.items():
        lines += ["", f"## {name[:1].upper()}{name[1:]}", "", *(f"- {one.sentence}" for one in ones)]
    if samples is not None and figure is not None:
        save_png(findings_figure(samples, "ACMA XR701: what its stiffness depends on"), figure)
        lines += ["", f"![what the stiffness of the recommended model depends on]({figure.name})"]
    lines += ["", "## What the verdicts mean", "", *(f"- {one.claim}: {one.thresholds}." for one in claims)]
    return HEAD + "\n".join(lines).replace("\u00a0", " ") + "\n"


if __name__ == "__main__":
    sys.exit(main())
