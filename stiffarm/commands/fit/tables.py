"""Tables for people: the surrogates of a training, and other methods beside ours."""

from __future__ import annotations

from typing import Any

from stiffarm.session.console import show_table


def surrogates(content: dict[str, Any]) -> None:
    """Held-out errors of the surrogates of a training."""
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
