"""Tables for people: the surrogates of a training, and other methods beside ours."""

from __future__ import annotations

from collections.abc import Sequence
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


def peers(rows: Sequence[dict[str, Any]]) -> None:
    """Other methods beside ours, on the same runs."""

    def percent(value: float | None) -> str:
        return "-" if value is None else f"{100.0 * value:.2g} %"

    show_table(
        "The same runs by other methods (errors of compliance on runs kept out)",
        ["method", "RMS", "worst", "fit, s", "1e5 queries, s", "kB"],
        [
            [r["method"], "refused", "", "", "", ""]
            if r["refused"]
            else [
                r["method"],
                percent(r["interior_rms"]),
                percent(r["interior_worst"]),
                f"{r['fit_s']:.2g}",
                f"{r['seconds_for_1e5_queries']:.2g}",
                f"{(r['bytes'] or 0) / 1e3:.3g}",
            ]
            for r in rows
        ],
    )
