"""The published factorial: effects of the springs on each pose's deflection, as JSON and as a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from doe import PoseEffects
from robots.quantities import rounded
from stiffarm.session.console import show_table


def payload(results: Sequence[PoseEffects]) -> list[dict[str, Any]]:
    """Sensitivity effects by pose."""
    return [
        {
            "pose": e.pose,
            "read": f"d{'xyz'[e.component]}",
            "effect_mm": {joint: rounded(v) for joint, v in zip(e.joints, e.effect_mm, strict=True)},
            "share": {joint: rounded(v) for joint, v in zip(e.joints, e.share, strict=True)},
            "ranking": list(e.ranking),
        }
        for e in results
    ]


def show(effects: Sequence[PoseEffects], low: float, high: float, load_path: str) -> None:
    """Effect of each spring on the largest reading, pose by pose."""
    show_table(
        f"Effect (mm) of stiffening each spring from {low:g} to {high:g} N m/rad ({load_path}), positive: less",
        ["pose", "read", *effects[0].joints, "ranking"],
        [
            [e.pose, f"d{'xyz'[e.component]}", *(f"{v:+.3f}" for v in e.effect_mm), " > ".join(e.ranking)]
            for e in effects
        ],
    )
