"""What a comparison of two link models says, in sentences computed from its numbers."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from fem import LinkKind
from robots.arrays import Bools
from stiffarm.commands.run.link_models import LinkCalibrations, LinkModels, Pair
from stiffarm.pages.blocks import percent

NOUN: Final[Mapping[LinkKind, str]] = MappingProxyType({"rigid": "rigid links", "beam": "beams", "shell": "shells"})


def sentences(both: LinkModels, best: str, gauge_mm: float) -> tuple[str, ...]:
    """What the comparison says, computed from it; ``best`` is the recommended variant."""
    return (_alone(both), _verdict(both, best, gauge_mm))


def _alone(both: LinkModels) -> str:
    """The links' own bending, before any spring is calibrated."""
    path = both.own.variants[0].model.load_path
    a, b = (np.abs(side.alone_mm[path][_vertical(both)]) for side in (both.own, both.other))
    own, other = NOUN[both.own.links], NOUN[both.other.links]
    start = f"With rigid joints ({path} load path) "
    if not a.any() or not b.any():
        kind, flexible = (other, a) if a.any() else (own, b)
        name = own if a.any() else other
        return (
            start + f"{name} alone give {flexible.min():.3f} to {flexible.max():.3f} mm at the readings used, "
            f"{kind} nothing."
        )
    ratio = a / b - 1.0
    word = "softer" if ratio.mean() > 0.0 else "stiffer"
    low, high = sorted(np.abs([ratio.min(), ratio.max()]))
    if ratio.min() * ratio.max() < 0.0:
        by = f"{percent(-ratio.min())} stiffer to {percent(ratio.max())} softer, by pose"
    else:
        by = f"{percent(low)} to {percent(high)} {word}"
    return (
        start + f"{own} alone give {a.min():.3f} to {a.max():.3f} mm at the readings used, {other} {b.min():.3f} to "
        f"{b.max():.3f} mm: {own} are {by}."
    )


def _vertical(both: LinkModels) -> Bools:
    return np.asarray(both.own.variants[0].found.overall.component == 2)


def signed(change: float) -> str:
    """A relative change in percent with its sign."""
    size = 100.0 * abs(change)
    number = f"{size:.0f}" if size >= 10.0 else f"{size:.1f}"
    sign = "" if float(number) == 0.0 else "+" if change > 0.0 else "−"
    return f"{sign}{number}\u00a0%"


def _verdict(both: LinkModels, best: str, gauge_mm: float) -> str:
    """What follows for the recommended calibration, and which calibration predicts best of all."""
    own, other = NOUN[both.own.links], NOUN[both.other.links]
    pair = next(pair for pair in both.pairs if pair.own.name == best)
    difference = pair.left_out_difference_mm
    outside = any(s.agreement == "outside" for s in pair.springs)
    text = f"For the recommended calibration ({best}) "
    if not np.isfinite(difference):
        text += f"the left-out poses do not compare {own} with {other}"
    elif abs(difference) < gauge_mm and not outside:
        text += f"these readings do not tell {own} from {other}: the springs take up the difference"
    elif abs(difference) < gauge_mm:
        text += f"{own} and {other} predict alike, but with springs that do not agree"
    else:
        text += f"{own if difference < 0.0 else other} predict better by {abs(difference):.3f} mm"
    errors = {
        f"{v.name} with {NOUN[side.links]}": v.left_out_rms_mm
        for side in (both.own, both.other)
        for v in side.variants
        if np.isfinite(v.left_out_rms_mm)
    }
    if not errors:
        return text + "."
    least = min(errors, key=errors.__getitem__)
    return text + f". The smallest left-out error of all: {least}, {errors[least]:.3f} mm."


def share_text(side: LinkCalibrations, pair: Pair) -> str:
    """Least and largest share of links, bar and crank in the strain energy over the readings."""
    share = 100.0 * side.share[pair.own.name]
    low, high = f"{share.min():.1f}", f"{share.max():.1f}"
    return f"{low}\u00a0%" if low == high else f"{low} to {high}\u00a0%"
