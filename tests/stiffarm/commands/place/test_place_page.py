"""The page of a placement: N/mm and the place first, and the recommended place in no colour of a zone."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from cli_runs import Command, row_of
from matplotlib.colors import to_hex, to_rgb
from matplotlib.patches import Polygon, Rectangle

from stiffarm.commands.place.figures import ZONES, curve_figure, map_figure
from stiffarm.pages.figure_parts import paler

CELL = """
schema = "stiffarm-cell/1"
name = "small"
[tool]
position_mm = [200, 0, 80]
rpy_deg = [0, 90, 0]
[part]
position_mm = [1200, 200, 600]
[[linear_axis]]
name = "rail"
direction = [1, 0, 0]
limits_mm = [-400, 200]
"""


@pytest.mark.usefixtures("blank")
def test_the_answer_comes_first(cli: Command, tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(CELL)
    rows = [f"{x},0,0,0,0,1" for x in (-50, 0, 50)]
    (tmp_path / "path.csv").write_text("\n".join(["x_mm,y_mm,z_mm,nx,ny,nz", *rows]) + "\n")
    out = tmp_path / "out"
    outcome = cli(
        "place",
        "kr60-3",
        tmp_path / "path.csv",
        "--cell",
        tmp_path / "cell.toml",
        "--force",
        "80,40,-60",
        "--links",
        "rigid",
        "--gamma",
        "-180:180:30",
        "--no-collisions",
        "--out",
        out,
    )
    assert outcome.code == 0, outcome.err
    page = (out / "report.html").read_text(encoding="utf-8")
    cards = re.findall(r"<li[^>]*><b>(.*?)</b>", page)
    content = json.loads((out / "placement.json").read_text(encoding="utf-8"))
    best = row_of(content["placements"], placement="recommended")
    assert cards[0].endswith("N/mm")
    said = float(cards[0].split()[0].replace(",", ""))
    assert abs(said / best["worst_stiffness_N_per_mm"] - 1.0) < 0.05
    assert cards[1].startswith("rail")
    assert cards[2].endswith("deg")
    assert cards[3].endswith("%")
    # K_sf cannot be compared between tasks: it is folded away.
    assert "K_sf" not in page[: page.index("<nav")].replace("stiffness criterion K_sf", "")
    assert re.search(r"<summary>[^\n]*The criterion K_sf", page)
    assert {name for name in re.findall(r'href="([^"#:]+)"', page) if not (out / name).exists()} == set()


def test_the_recommended_place_has_no_colour_of_a_zone() -> None:
    x = np.linspace(-1.0, 1.0, 5)
    why = ["", "collision", "collision", "singularity", "reach"]
    value = np.array([300.0, np.nan, np.nan, np.nan, np.nan])
    figure = curve_figure(x, {"softest point": value}, why, "rail, mm", "N/mm", {"recommended": 0.0, "now": -0.5})
    (ax,) = figure.axes
    zones = {to_hex(colour) for colour, _ in ZONES.values()} | {to_hex(paler(c)) for c, _ in ZONES.values()}
    marks = [line for line in ax.lines if line.get_label() in ("recommended", "now")]
    assert len(marks) == 2
    for line in marks:
        assert to_hex(line.get_color()) not in zones
        # And far darker than any zone, so that hue is not needed.
        assert max(to_rgb(line.get_color())) < 0.3
    assert {line.get_linestyle() for line in marks} == {"-", "--"}
    shaded = [p for p in ax.patches if isinstance(p, Polygon | Rectangle)]
    # Zones differ by hatch too.
    assert len({p.get_hatch() for p in shaded}) == 3


def test_a_map_marks_the_recommended_place_by_shape() -> None:
    x = y = np.linspace(0.0, 1.0, 4)
    value = np.where(np.eye(4, dtype=bool), np.nan, 200.0 + np.arange(16.0).reshape(4, 4))
    why = ["collision" if bad else "" for bad in np.eye(4, dtype=bool).ravel()]
    spots = {"recommended": (0.3, 0.6), "present": (0.0, 0.3)}
    figure = map_figure(x, y, value, why, ("rail, mm", "lift, mm"), "softest point, N/mm", spots)
    shapes = [line.get_marker() for line in figure.axes[0].lines if line.get_label() in spots]
    assert len(set(shapes)) == 2
    assert shapes[0] == "*"
