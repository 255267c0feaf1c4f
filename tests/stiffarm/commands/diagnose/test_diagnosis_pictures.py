"""Pictures of a diagnosis: the arm where the model was wrong, traces of effects, the gap."""

from __future__ import annotations

import numpy as np
from figure_texts import texts

import robots
from doe.diagnosis.findings.traces import Row, Trace, Traces
from doe.diagnosis.space import Gaps, stands
from stiffarm.commands.diagnose.arms import arms_figure
from stiffarm.commands.diagnose.figures import gap_figure, traces_figure

ROBOT = robots.load_robot("xr701")


def gaps() -> Gaps:
    """Two poses under two loads, each read twice along Z; the second pose is the worse one under its smaller load."""
    q = np.repeat([np.zeros(6), np.full(6, 0.2)], 4, axis=0)
    force = np.tile([[0.0, 0.0, -100.0], [0.0, 0.0, -200.0]], (4, 1))
    before = np.full((8, 3), np.nan)
    before[:, 2] = np.array([1.0, 2.0, 1.0, 2.0, 5.0, 3.0, 7.0, 3.0]) * 1e-5
    measured = np.where(np.isnan(before), np.nan, -1e-3)
    nothing = np.zeros(8, dtype=bool)
    return Gaps(
        ("a",) * 4 + ("b",) * 4,
        q,
        robots.tool_position(ROBOT, robots.forward_kinematics(ROBOT, q)),
        force,
        measured,
        before,
        0.5 * before,
        nothing,
    )


def test_stands_are_the_worst_load_of_each_pose_the_worst_first() -> None:
    first, second = stands(gaps())
    assert (first.pose, second.pose) == ("b", "a")
    assert (first.load_N, second.load_N) == (100.0, 200.0)
    # Repeats are averaged; what was not read stays so.
    assert np.isclose(first.left_over_m, 6e-5)
    assert np.isnan(first.read[:2]).all()


def test_readings_along_z_need_one_view_and_others_two() -> None:
    some = stands(gaps())
    said = [one.text for one in texts(arms_figure(some, ROBOT, "arms"))]
    assert sum("left over\n" in t or t.endswith("mm left over") for t in said) == 2
    assert not any("from above" in t for t in said)
    g = gaps()
    g.measured[:, 0] = g.before[:, 0] = 1e-5
    assert sum("from above" in one.text for one in texts(arms_figure(stands(g), ROBOT, "arms"))) == 2


def test_twins_stand_beside_their_effect() -> None:
    x = np.arange(6.0)
    row = Row(Trace("backlash:j2", x, 0.0), 0.9, (Trace("hardening:j2", x + 0.01, 0.01),), x, ())
    figure = traces_figure(Traces((row,), ("a",) * 3 + ("b",) * 3, ("Z",) * 6, "mm"))
    assert [ax.get_title(loc="left").split("\n")[0] for ax in figure.axes] == ["backlash:j2", "twin hardening:j2"]
    # They differ by dash, not by colour alone.
    assert len({str(ax.lines[-2].get_linestyle()) for ax in figure.axes}) == 2


def test_the_lines_bear_their_names() -> None:
    figure = gap_figure({"in the fit": (0.2, 0.1), "poses left out": (0.3, 0.15)}, 0.05, 0.12, "repeats")
    (ax,) = figure.axes
    labels = ax.get_legend_handles_labels()[1]
    assert sorted(labels) == ["repeats: 0.0500", "springs alone, at best: 0.120"]
