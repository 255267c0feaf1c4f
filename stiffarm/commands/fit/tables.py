"""A table for people: the surrogates of a training."""

from __future__ import annotations

from typing import Any

from stiffarm.session.console import say, show_table


def show(content: dict[str, Any]) -> None:
    """Held-out errors of the surrogates of a training, and which one is best."""
    show_table(
        f"Relative error of {content['quantity']} on runs kept out",
        ["basis", "terms", "RMS", "worst", "in 95 % bars", "cond."],
        [
            [
                f"{s['basis']} {s['degree_or_order']}",
                str(s["terms"]),
                f"{s['rms_relative_error']:.1e}",
                f"{s['max_relative_error']:.1e}",
                f"{100.0 * s['coverage_of_95_percent_bars']:.1f} %",
                f"{s['condition_number']:.0e}",
            ]
            for s in content["surrogates"]
        ],
    )
    say(f"best: {content['best']}")
