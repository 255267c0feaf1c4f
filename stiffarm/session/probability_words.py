"""Probabilities as they are written everywhere."""

from __future__ import annotations


def percent(value: float) -> str:
    """``82 %``; never 0 % or 100 % for what is neither."""
    if 0.0 < value < 0.005:
        return "below 1 %"
    if value >= 0.995:
        return "above 99 %"
    return f"{100.0 * value:.0f} %"
