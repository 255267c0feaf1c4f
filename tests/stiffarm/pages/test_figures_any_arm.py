"""Figures of an arm with 36 parameters and 43 loads: no label lies on another, no letter is too small to read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from drawn_figures import Drawn, faults, looked_at
from figure_texts import texts
from made_estimates import INF, NAN, made_spring
from matplotlib.figure import Figure

from doe import bundled_data, read_measurements
from robots import load_description
from robots.robot import robot_from
from stiffarm.commands.calibrate.figures.identifiability import intervals_figure
from stiffarm.commands.calibrate.figures.residuals import residuals_figure
from stiffarm.commands.run.figures import data_figure, match_figure
from stiffarm.pages.bars import bars_figure, ranked_figure
from stiffarm.pages.figure_parts import drawing
from stiffarm.pages.numbers import naturally
from stiffarm.pages.style import INK, OKABE_ITO

RNG = np.random.default_rng(0)
DATA = read_measurements(bundled_data("fanuc-r2000ic"), robot_from(load_description("fanuc-r2000ic")))
POSES = list(DATA.pose_groups())
N = len(POSES)
ERRORS = {name: dict(zip(POSES, RNG.uniform(0.01, 0.3, N), strict=True)) for name in ("fitted", "left out", "held out")}
OPEN = [made_spring(f"link{k}", NAN, (NAN, NAN), "not identified") for k in range(20)]
KNOWN = [made_spring(f"j{k}", 1e6 * k, (8e5 * k, INF if k % 3 else 2e6 * k), "determined") for k in range(1, 17)]


def residuals() -> Figure:
    residual, labels = RNG.normal(0.0, 0.1, N), list(RNG.permutation(POSES))
    return residuals_figure(
        residual, "mm", {"pose": labels}, np.zeros(N, dtype=np.bool_), np.full(N, 0.1), DATA.loads_N
    )


FIGURES: dict[str, Callable[[], Figure]] = {
    "readings": lambda: data_figure(DATA),
    "match": lambda: match_figure(POSES[::-1], np.ones(N), {"one": RNG.normal(1.0, 0.1, N)}),
    "errors": lambda: bars_figure("", ERRORS, "RMS error (mm)", "pose"),
    "residuals": residuals,
    "intervals": lambda: intervals_figure({"": [*OPEN[:10], *KNOWN, *OPEN[10:]]}),
    "ranked": lambda: ranked_figure("Shares", {f"j{k}.stiffness": 1.0 / k for k in range(1, 37)}, "share (%)"),
}


@pytest.mark.parametrize("name", FIGURES)
def test_no_label_lies_on_another_and_all_can_be_read(name: str) -> None:
    assert N == len(np.unique(DATA.loads_N)) == 43
    assert faults([looked_at(FIGURES[name]())]) == []


def test_what_is_looked_for_is_found() -> None:
    with drawing("", (4.0, 2.0)) as (figure, (ax,)):
        ax.set_xticks(range(20), [f"a long label {k}" for k in range(20)])
    assert looked_at(figure).overlaps
    with drawing("", (20.0, 2.0)) as (figure, (ax,)):
        ax.set_xlabel("load (N)")
    assert faults([replace(looked_at(figure), overlaps=[])])
    assert faults([Drawn("good", 12.0)]) == []


def test_series_that_a_hue_alone_tells_apart_are_found() -> None:
    def drawn(**other: object) -> list[str]:
        with drawing("", (6.0, 3.0)) as (figure, (ax,)):
            ax.plot([0, 1], color=OKABE_ITO["vermillion"], label="one")
            ax.plot([1, 0], **{"color": OKABE_ITO["green"], "label": "other", **other})  # type: ignore[arg-type]
            ax.legend()
        return looked_at(figure).alike

    assert drawn() == ["one | other"]
    assert drawn(linestyle="--") == drawn(color=INK) == drawn(marker="o") == drawn(linewidth=5.0) == []


def test_many_loads_make_an_axis() -> None:
    for name in ("readings", "residuals"):
        assert "load (N)" in {ax.get_xlabel() for ax in FIGURES[name]().axes}


def test_parameters_that_are_not_identified_share_one_line() -> None:
    figure = FIGURES["intervals"]()
    rows = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert len(rows) == len(KNOWN)
    (line,) = [one.text for one in texts(figure) if one.text.startswith("Not identified")]
    assert all(f"link{k}.stiffness" in line.replace("\n", " ") for k in range(20))


def test_poses_stand_in_the_order_in_which_people_count() -> None:
    assert naturally(["p10", "p9", "p1a", "p1"]) == ["p1", "p1a", "p9", "p10"]
    low = FIGURES["match"]().axes[1]
    shown = [label.get_text() for label in low.get_xticklabels()]
    assert shown == naturally(shown)
