"""The figure of the gap names its lines by what they are."""

from __future__ import annotations

from stiffarm.commands.diagnose.figures import gap_figure


def test_the_lines_bear_their_names() -> None:
    figure = gap_figure({"in the fit": (0.2, 0.1), "poses left out": (0.3, 0.15)}, 0.05, 0.12, "repeats")
    (ax,) = figure.axes
    labels = ax.get_legend_handles_labels()[1]
    assert sorted(labels) == ["repeats: 0.0500", "springs alone, at best: 0.120"]
