"""The ladder of a diagnosis, the arm where the model was wrong, and traces of effects."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from figure_texts import texts

import robots
from doe.diagnosis.checks import Check
from doe.diagnosis.space import Gaps
from stiffarm.commands.diagnose.arms import stands, tool_points
from stiffarm.commands.diagnose.arms_figure import arms_figure
from stiffarm.commands.diagnose.ladder import Ladder, Rung, ladder_table
from stiffarm.commands.diagnose.ladder_figure import ladder_figure
from stiffarm.commands.diagnose.traces import Row, Trace, Traces
from stiffarm.commands.diagnose.traces_figure import traces_figure

ROBOT = robots.load_robot("xr701")
AGAINST = Check("no-twin", "backlash:j2", passed=False, evidence="", factor=0.8)


def ladder() -> Ladder:
    last: Any = SimpleNamespace(
        hypotheses=[SimpleNamespace(code="none", probability=0.6), SimpleNamespace(code="unknown", probability=0.4)],
        of=lambda code: SimpleNamespace(code=code, probability=0.6),
    )
    rungs = (
        Rung("backlash:j2", (0.2, 0.1), 0.99, 0.42, (AGAINST,), provisional=False),
        Rung("payload", (0.1, 0.05), 0.54, 0.5, (), provisional=True),
    )
    return Ladder(rungs, 0.2, last)


def test_a_row_for_each_step_says_what_it_left_and_how_sure_it_is() -> None:
    start, first, second, last = ladder_table(ladder()).rows
    assert start[1] == "0.200"
    assert first[:4] == ("+ backlash:j2", "0.200 → 0.100", "99 %", "42 %")
    assert second[0].endswith("(provisional)")
    assert "40\u00a0% that something more" in last[4]
    assert first[4] != second[4]


def test_the_picture_shows_the_same_figures() -> None:
    said = " ".join(one.text for one in texts(ladder_figure(ladder(), ("noise alone", 0.04))))
    for text in ("0.200", "0.100", "0.0500", "99 %", "42 %", "54 % → 50 %", "40 %"):
        assert text in said


def gaps() -> Gaps:
    """Two poses under two loads, each read twice along Z; the second pose is the worse one under its smaller load."""
    q = np.repeat([np.zeros(6), np.full(6, 0.2)], 4, axis=0)
    force = np.tile([[0.0, 0.0, -100.0], [0.0, 0.0, -200.0]], (4, 1))
    before = np.full((8, 3), np.nan)
    before[:, 2] = np.array([1.0, 2.0, 1.0, 2.0, 5.0, 3.0, 7.0, 3.0]) * 1e-5
    measured = np.where(np.isnan(before), np.nan, -1e-3)
    nothing = np.zeros(8, dtype=bool)
    return Gaps(("a",) * 4 + ("b",) * 4, q, tool_points(ROBOT, q), force, measured, before, 0.5 * before, nothing)


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
